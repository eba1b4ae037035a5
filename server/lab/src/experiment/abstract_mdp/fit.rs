//! Fitting a table of rewards to preferences, and how far it is from the true one.

use domain::agreement::mean;
use domain::random::{Rng, Stream};
use serde::{Deserialize, Serialize};

use super::{Chain, N_ACTIONS, N_STAGES, Selection};

/// Epochs, each with fresh queries and one step.
const N_EPOCHS: u64 = 100;
/// Queries in an epoch.
const N_QUERIES: usize = 200;
/// Adam's step size.
const LEARNING_RATE: f64 = 0.05;

/// How far the learned table is from the true one. The paper reports a reward error without
/// defining it; these three differ in what they forgive.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Errors {
    /// Mean absolute difference of both tables, each standardised. Counts the stages' offsets,
    /// which aligned queries never show.
    pub global_error: f64,
    /// Mean squared difference once every stage's mean is taken away, both standardised: what a
    /// policy can notice.
    pub within_error: f64,
    /// Share of pairs of actions of one stage that are in the wrong order; ties count half.
    pub misordered: f64,
}

/// Learns from the queries of a seed; the normalised episode reward before and after each epoch,
/// and the errors in the end.
pub fn fit(chain: &Chain, selection: Selection, seed: u64) -> (Vec<f64>, Errors) {
    let truth = chain.rewards();
    let mut learned = Table::zeros(truth.len());
    let mut rewards = vec![episode_reward(&learned.psi, truth)];
    for epoch in 0..N_EPOCHS {
        let mut rng = Rng::new(seed, Stream::Candidates, epoch);
        let mut gradient = vec![0.0; truth.len()];
        for _ in 0..N_QUERIES {
            let [first, second] = draw_query(selection, &mut rng);
            let is_second = f64::from(u8::from(truth[second] > truth[first]));
            let p_second = 1.0 / (1.0 + (learned.psi[first] - learned.psi[second]).exp());
            let slope = (p_second - is_second) / N_QUERIES as f64;
            gradient[second] += slope;
            gradient[first] -= slope;
        }
        learned.step(&gradient);
        rewards.push(episode_reward(&learned.psi, truth));
    }
    (rewards, errors(&learned.psi, truth))
}

/// Places in the table of the two state-action pairs of a query; they may be the same.
fn draw_query(selection: Selection, rng: &mut Rng) -> [usize; 2] {
    let mut stages = [rng.below(N_STAGES), rng.below(N_STAGES)];
    if selection == Selection::Aligned {
        stages[1] = stages[0];
    }
    stages.map(|stage| stage * N_ACTIONS + rng.below(N_ACTIONS))
}

/// ψ with Adam's moments.
struct Table {
    psi: Vec<f64>,
    first: Vec<f64>,
    second: Vec<f64>,
    n_steps: i32,
}

impl Table {
    fn zeros(len: usize) -> Self {
        Self {
            psi: vec![0.0; len],
            first: vec![0.0; len],
            second: vec![0.0; len],
            n_steps: 0,
        }
    }

    /// Adam (Kingma and Ba, 2015) with its usual β = (0.9, 0.999), ε = 10⁻⁸.
    fn step(&mut self, gradient: &[f64]) {
        self.n_steps += 1;
        let unbias = |beta: f64| 1.0 - beta.powi(self.n_steps);
        let (c1, c2) = (unbias(0.9), unbias(0.999));
        let moments = self.first.iter_mut().zip(&mut self.second);
        for ((psi, (m, v)), g) in self.psi.iter_mut().zip(moments).zip(gradient) {
            *m += 0.1 * (g - *m);
            *v += 0.001 * (g * g - *v);
            *psi -= LEARNING_RATE * (*m / c1) / ((*v / c2).sqrt() + 1e-8);
        }
    }
}

/// What the policy earns a stage that takes the best action by ψ; equally good ones share.
fn episode_reward(psi: &[f64], truth: &[f64]) -> f64 {
    let stages = psi.chunks(N_ACTIONS).zip(truth.chunks(N_ACTIONS));
    let of_stage = |(psi, truth): (&[f64], &[f64])| {
        let best = psi.iter().copied().fold(f64::NEG_INFINITY, f64::max);
        let chosen = psi.iter().zip(truth).filter(|(psi, _)| **psi >= best);
        mean(&chosen.map(|(_, reward)| *reward).collect::<Vec<_>>())
    };
    mean(&stages.map(of_stage).collect::<Vec<_>>())
}

fn errors(psi: &[f64], truth: &[f64]) -> Errors {
    let difference = |a: &[f64], b: &[f64], of: fn(f64) -> f64| {
        let pairs = standardised(a).into_iter().zip(standardised(b));
        mean(&pairs.map(|(a, b)| of(a - b)).collect::<Vec<_>>())
    };
    let (psi_within, truth_within) = (centred_by_stage(psi), centred_by_stage(truth));
    Errors {
        global_error: difference(psi, truth, f64::abs),
        within_error: difference(&psi_within, &truth_within, |d| d * d),
        misordered: misordered(psi, truth),
    }
}

/// Mean 0, standard deviation 1; what does not vary stays 0.
fn standardised(values: &[f64]) -> Vec<f64> {
    let centre = mean(values);
    let squares: Vec<f64> = values.iter().map(|v| (v - centre).powi(2)).collect();
    let spread = mean(&squares).sqrt();
    let spread = if spread > 0.0 { spread } else { 1.0 };
    values.iter().map(|v| (v - centre) / spread).collect()
}

fn centred_by_stage(values: &[f64]) -> Vec<f64> {
    let stages = values.chunks(N_ACTIONS);
    stages
        .flat_map(|stage| {
            let centre = mean(stage);
            stage.iter().map(move |v| v - centre)
        })
        .collect()
}

fn misordered(psi: &[f64], truth: &[f64]) -> f64 {
    let mut wrong = Vec::new();
    for (psi, truth) in psi.chunks(N_ACTIONS).zip(truth.chunks(N_ACTIONS)) {
        for i in 0..N_ACTIONS {
            for j in 0..i {
                let agreement = (psi[i] - psi[j]) * (truth[i] - truth[j]);
                wrong.push(match agreement.total_cmp(&0.0) {
                    _ if agreement == 0.0 => 0.5,
                    std::cmp::Ordering::Less => 1.0,
                    _ => 0.0,
                });
            }
        }
    }
    mean(&wrong)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_true_table_has_no_error_and_its_negative_every_one() {
        let chain = Chain::draw(20.0, 1);
        let truth = chain.rewards();
        let stretched: Vec<f64> = truth.iter().map(|r| 3.0 * r + 1.0).collect();
        let none = errors(&stretched, truth);
        assert!(none.global_error < 1e-9 && none.within_error < 1e-9 && none.misordered < 1e-9);
        let turned: Vec<f64> = truth.iter().map(|r| -r).collect();
        let every = errors(&turned, truth);
        assert!((every.misordered - 1.0).abs() < 1e-12 && (every.within_error - 4.0).abs() < 1e-9);
        let blank = errors(&vec![0.0; truth.len()], truth);
        assert!((blank.misordered - 0.5).abs() < 1e-12, "ties count half");
    }

    #[test]
    fn offsets_of_stages_are_forgiven_within_stages_alone() {
        let chain = Chain::draw(0.0, 1);
        let truth = chain.rewards();
        let shifted: Vec<f64> = (0..truth.len())
            .map(|k| truth[k] + (k / N_ACTIONS) as f64)
            .collect();
        let found = errors(&shifted, truth);
        assert!(found.within_error < 1e-9 && found.misordered < 1e-9);
        assert!(found.global_error > 0.5);
    }

    #[test]
    fn the_best_policy_earns_one_a_stage_and_an_ignorant_one_the_mean() {
        let chain = Chain::draw(50.0, 2);
        let truth = chain.rewards();
        assert!((episode_reward(truth, truth) - 1.0).abs() < 1e-9);
        let worst: Vec<f64> = truth.iter().map(|r| -r).collect();
        assert!(episode_reward(&worst, truth).abs() < 1e-9);
        let ignorant = episode_reward(&vec![0.0; truth.len()], truth);
        assert!((ignorant - mean(truth)).abs() < 1e-9);
    }

    #[test]
    fn a_first_adam_step_moves_by_the_learning_rate() {
        let mut table = Table::zeros(2);
        table.step(&[0.3, -0.001]);
        assert!((table.psi[0] + LEARNING_RATE).abs() < 1e-6);
        assert!((table.psi[1] - LEARNING_RATE).abs() < 1e-6);
    }
}
