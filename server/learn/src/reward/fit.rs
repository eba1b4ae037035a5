//! From answers to weights: the cross-entropy of preferences, member by member.

use domain::query::Query;
use domain::random::{Rng, Stream};

use super::chunk::longest;
use super::{CHUNK_ROWS, Labeled, RewardEnsemble, RewardFit};
use crate::net::{matrix, to_vec};
use crate::replay::Replay;

/// One member's order of the preferences in an epoch, and how it did.
pub(super) struct Pass {
    pub(super) order: Vec<usize>,
    pub(super) n_seen: usize,
    pub(super) loss: f64,
    pub(super) n_right: u32,
    pub(super) n_judged: u32,
}

impl Pass {
    pub(super) fn new(order: Vec<usize>) -> Self {
        Self {
            order,
            n_seen: 0,
            loss: 0.0,
            n_right: 0,
            n_judged: 0,
        }
    }

    /// Equal preferences count for the loss alone.
    pub(super) fn record(&mut self, example: &Example, logit: f64) {
        self.n_seen += 1;
        self.loss += softplus(logit) - example.target * logit;
        let side = example.target - 0.5;
        if side.abs() > f64::EPSILON {
            self.n_judged += 1;
            self.n_right += u32::from((logit > 0.0) == (side > 0.0));
        }
    }
}

/// What the members' passes say together.
pub(super) fn summary(passes: &[Pass], n_epochs: u32) -> RewardFit {
    let mean =
        |value: &dyn Fn(&Pass) -> f64| passes.iter().map(value).sum::<f64>() / passes.len() as f64;
    RewardFit {
        n_epochs,
        loss: mean(&|p| p.loss / p.n_seen.max(1) as f64) as f32,
        accuracy: mean(&|p| f64::from(p.n_right) / f64::from(p.n_judged.max(1))) as f32,
    }
}

/// A pair as a member's loss sees it.
#[derive(Debug, Clone, Copy)]
pub(super) struct Example {
    pub(super) query: Query,
    /// Of P(second ≻ first).
    pub(super) target: f64,
    /// Of its cross-entropy.
    pub(super) weight: f64,
}

impl RewardEnsemble {
    /// Goes on from the present weights, over all preferences so far, until the members are
    /// right often enough or the passes are used up.
    ///
    /// Each member sees the preferences in its own order. The loss is the cross-entropy of
    /// P(second ≻ first) = σ((Σ r(second) − Σ r(first)) / temperature) to 0, 1 (less the label margin), or ½ for
    /// equal, mean over a minibatch, summed over members.
    ///
    /// Source: BPref's `train_soft_reward` without smoothing. Differs from the code: equal
    /// preferences need no global switch.
    ///
    /// # Panics
    /// When a segment is not in the replay.
    pub fn fit(&mut self, replay: &Replay, labeled: &[Labeled]) -> RewardFit {
        let mut fit = RewardFit::default();
        if labeled.is_empty() {
            return fit;
        }
        let rates = self.config.rates(self.config.max_epochs as usize);
        for (n_epochs, rate) in (1..).zip(rates) {
            fit = summary(&self.epoch(replay, labeled, rate), n_epochs);
            if fit.accuracy > self.config.stop_accuracy {
                break;
            }
        }
        fit
    }

    /// One pass of every member over all preferences, at a share of the learning rate.
    pub(super) fn epoch(&mut self, replay: &Replay, labeled: &[Labeled], rate: f64) -> Vec<Pass> {
        let mut rng = Rng::new(self.seed, Stream::RewardFit, self.n_epochs);
        self.n_epochs += 1;
        let members = 0..self.config.members;
        let mut passes: Vec<Pass> = members
            .map(|_| Pass::new(rng.permutation(labeled.len())))
            .collect();
        for start in (0..labeled.len()).step_by(self.config.batch) {
            let end = labeled.len().min(start + self.config.batch);
            self.gradient(replay, labeled, &mut passes, start..end);
            self.parameters.step_at(rate);
        }
        passes
    }

    /// Fills the gradient with that of a range of each member's order.
    pub(super) fn gradient(
        &mut self,
        replay: &Replay,
        labeled: &[Labeled],
        passes: &mut [Pass],
        range: std::ops::Range<usize>,
    ) {
        let weight = 1.0 / range.len() as f64;
        let orders = passes.iter().flat_map(|p| &p.order[range.clone()]);
        let examples: Vec<Example> = orders.map(|&i| self.example(&labeled[i], weight)).collect();
        self.parameters.zero_gradient();
        let logits = self.add_gradient(replay, &examples);
        let own = examples.chunks(range.len()).zip(logits.chunks(range.len()));
        for (pass, (examples, logits)) in passes.iter_mut().zip(own) {
            for (example, logit) in examples.iter().zip(logits) {
                pass.record(example, *logit);
            }
        }
    }

    /// A preference as the loss sees it.
    pub(super) fn example(&self, labeled: &Labeled, weight: f64) -> Example {
        let certain = f64::from(labeled.preference.target());
        Example {
            query: labeled.query,
            target: certain + self.config.label_margin * (1.0 - 2.0 * certain),
            weight,
        }
    }

    /// One Adam step on examples `[M][n]`, at a share of the learning rate; returns their logits
    /// before it.
    pub(super) fn step(&mut self, replay: &Replay, examples: &[Example], rate: f64) -> Vec<f64> {
        self.parameters.zero_gradient();
        let logits = self.add_gradient(replay, examples);
        self.parameters.step_at(rate);
        logits
    }

    /// Adds the gradient of examples `[M][n]`; returns their logits. The loss is a sum over
    /// pairs, so a few pairs at a time go forward and back while their hidden layers are in the
    /// cache.
    pub(super) fn add_gradient(&mut self, replay: &Replay, examples: &[Example]) -> Vec<f64> {
        let n_members = self.config.members;
        let n = examples.len() / n_members;
        let longest = examples
            .iter()
            .map(|e| longest(&e.query))
            .max()
            .unwrap_or(1);
        let pairs_at_once = (CHUNK_ROWS / (2 * longest)).max(1);
        let mut all_logits = vec![0.0; examples.len()];
        for start in (0..n).step_by(pairs_at_once) {
            let end = n.min(start + pairs_at_once);
            let own = |member: usize| member * n + start..member * n + end;
            let pairs: Vec<Example> = (0..n_members)
                .flat_map(|member| &examples[own(member)])
                .copied()
                .collect();
            let queries = pairs.iter().map(|e| &e.query);
            let chunk = self.chunk(replay, queries, longest);
            let input = self
                .input(&chunk.rows)
                .view([n_members as i64, -1, self.columns]);
            let (output, tape) = self.net.forward_taped(&input);
            let reward = output.tanh();
            let logits = chunk.logits(&to_vec(&reward));
            let slope = |(example, logit): (&Example, &f64)| {
                let probability = 1.0 / (1.0 + (-logit).exp());
                (probability - example.target) * example.weight
            };
            let slopes: Vec<f64> = pairs.iter().zip(&logits).map(slope).collect();
            let slopes = matrix(&chunk.row_slopes(&slopes), 1, self.options).view_as(&reward);
            let gradient = slopes * (1.0 - reward.square());
            self.net
                .backward(&tape, &gradient, Some(&mut self.gradient), None);
            for (member, logits) in logits.chunks(end - start).enumerate() {
                all_logits[own(member)].copy_from_slice(logits);
            }
        }
        all_logits
    }
}

/// ln(1 + eˣ) without overflow.
pub(super) fn softplus(x: f64) -> f64 {
    x.max(0.0) + (-x.abs()).exp().ln_1p()
}
