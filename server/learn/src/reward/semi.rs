//! SURF: pairs that nobody answered teach where the ensemble is sure, and segments are cropped.

use domain::episode::Segment;
use domain::query::Query;
use domain::random::{Rng, Stream};
use serde::{Deserialize, Serialize};

use super::{Example, Labeled, Lesson, Pass, RewardEnsemble, RewardFit, RewardLearner, summary};
use crate::checkpoint::Archive;
use crate::error::LearnError;
use crate::replay::Replay;

/// Settings of SURF. Defaults: its released settings for MetaWorld.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct SemiSupervisedConfig {
    /// Unanswered pairs for each query of a session; 100 for DMControl.
    pub unlabeled_per_query: u32,
    /// Unanswered pairs in a minibatch for each answered one, μ.
    pub batch_ratio: usize,
    /// A pair is trained on as a member would answer it once the member is as sure as this, τ;
    /// the code's default is 0.95, its scripts use 0.99.
    pub certainty: f64,
    /// What such an answer counts, λ.
    pub weight: f64,
    /// How often the answers are passed over, in minibatches' worth: ⌈passes · answers / batch⌉
    /// minibatches, without early stop; 1,000 for DMControl.
    pub passes: u32,
    /// Whether segments are cropped.
    pub is_cropping: bool,
    /// Steps before and after a segment that a crop may reach into.
    pub margin: u32,
    /// Most steps by which a crop is longer or shorter than its segment.
    pub crop_spread: u32,
}

impl Default for SemiSupervisedConfig {
    fn default() -> Self {
        Self {
            unlabeled_per_query: 10,
            batch_ratio: 4,
            certainty: 0.99,
            weight: 1.0,
            passes: 20,
            is_cropping: true,
            margin: 5,
            crop_spread: 5,
        }
    }
}

/// Fits on answers and on the ensemble's own sure ones.
///
/// Source: SURF, §4, as in its released code. Differs from the code: at an episode's end the
/// margin is cut, where the code never asks about a segment without its whole margin.
pub struct SemiSupervised {
    config: SemiSupervisedConfig,
    seed: u64,
    pool: Vec<Query>,
    n_fits: u64,
}

impl SemiSupervised {
    /// With nothing to look at yet.
    pub fn new(config: &SemiSupervisedConfig, seed: u64) -> Self {
        Self {
            config: config.clone(),
            seed,
            pool: Vec::new(),
            n_fits: 0,
        }
    }

    /// What a member trains on in one minibatch beside the answers: pairs of which it is sure,
    /// with its own answer; `logits` are those of the whole segments.
    fn pseudo_labeled(&self, queries: &[Query], logits: &[f64]) -> Vec<Example> {
        let weight = self.config.weight / queries.len().max(1) as f64;
        let pairs = queries.iter().zip(logits);
        let sure = pairs.filter(|(_, logit)| {
            let certainty = 1.0 / (1.0 + (-logit.abs()).exp());
            certainty >= self.config.certainty
        });
        sure.map(|(query, logit)| Example {
            query: *query,
            target: f64::from(u8::from(*logit > 0.0)),
            weight,
        })
        .collect()
    }

    /// Both segments to one random length, each shifted on its own.
    fn cropped(&self, replay: &Replay, query: Query, rng: &mut Rng) -> Query {
        if !self.config.is_cropping {
            return query;
        }
        let [first, second] = [query.first, query.second].map(|s| self.window(replay, s));
        let spread = self.config.crop_spread;
        let longest = (query.first.len + spread).min(first.len).min(second.len);
        let shortest = query.first.len.saturating_sub(spread).clamp(1, longest);
        let len = shortest + rng.below((longest - shortest + 1) as usize) as u32;
        let mut place = |window: Segment| Segment {
            start: window.start + rng.below((window.len - len + 1) as usize) as u32,
            len,
            ..window
        };
        Query {
            first: place(first),
            second: place(second),
        }
    }

    /// The segment with its margin, as far as the episode goes.
    fn window(&self, replay: &Replay, segment: Segment) -> Segment {
        let start = segment.start.saturating_sub(self.config.margin);
        let end = segment.start + segment.len + self.config.margin;
        Segment {
            start,
            len: end.min(replay.episode(segment.episode).len) - start,
            ..segment
        }
    }

    /// One minibatch of every member, at a share of the learning rate; returns its answered
    /// examples with their logits.
    fn minibatch(
        &self,
        ensemble: &mut RewardEnsemble,
        rate: f64,
        lesson: &Lesson<'_>,
        drawn: &[Drawn],
        rng: &mut Rng,
    ) -> Vec<Vec<(Example, f64)>> {
        let replay = lesson.replay;
        let unanswered: Vec<Query> = drawn
            .iter()
            .flat_map(|d| d.unlabeled.iter().map(|&i| self.pool[i]))
            .collect();
        let logits = ensemble.member_logits(replay, &unanswered);
        let n_own = unanswered.len() / drawn.len();
        let mut members: Vec<Vec<Example>> = Vec::with_capacity(drawn.len());
        for (index, own) in drawn.iter().enumerate() {
            let weight = 1.0 / own.labeled.len() as f64;
            let labeled = own.labeled.iter().map(|&i| &lesson.labeled[i]);
            let mut examples: Vec<Example> = labeled
                .map(|l: &Labeled| ensemble.example(l, weight))
                .collect();
            let range = index * n_own..(index + 1) * n_own;
            examples.extend(self.pseudo_labeled(&unanswered[range.clone()], &logits[range]));
            for example in &mut examples {
                example.query = self.cropped(replay, example.query, rng);
            }
            members.push(examples);
        }
        let longest = members.iter().map(Vec::len).max().unwrap_or(0);
        for examples in &mut members {
            let filler = Example {
                weight: 0.0,
                ..examples[0]
            };
            examples.resize(longest, filler);
        }
        let logits = ensemble.step(replay, &members.concat(), rate);
        let members = members.into_iter().zip(logits.chunks(longest)).zip(drawn);
        members
            .map(|((examples, logits), own)| {
                let pairs = examples.into_iter().zip(logits.iter().copied());
                pairs.take(own.labeled.len()).collect()
            })
            .collect()
    }
}

impl RewardLearner for SemiSupervised {
    fn fit(&mut self, ensemble: &mut RewardEnsemble, lesson: &Lesson<'_>) -> RewardFit {
        self.pool.extend_from_slice(lesson.unlabeled);
        let (n_labeled, batch) = (lesson.labeled.len(), ensemble.config.batch);
        if n_labeled == 0 {
            return RewardFit::default();
        }
        let mut rng = Rng::new(self.seed, Stream::SemiSupervised, self.n_fits);
        self.n_fits += 1;
        let members = 0..ensemble.config.members;
        let mut labeled: Vec<Cycle> = members.clone().map(|_| Cycle::new(n_labeled)).collect();
        let mut unlabeled: Vec<Cycle> = members.map(|_| Cycle::new(self.pool.len())).collect();
        let mut passes: Vec<Pass> = labeled.iter().map(|_| Pass::new(Vec::new())).collect();
        let n_minibatches = (self.config.passes as usize * n_labeled).div_ceil(batch);
        for rate in ensemble.config.rates(n_minibatches) {
            let cycles = labeled.iter_mut().zip(&mut unlabeled);
            let drawn: Vec<Drawn> = cycles
                .map(|(labeled, unlabeled)| Drawn {
                    labeled: labeled.take(batch, &mut rng),
                    unlabeled: unlabeled.take(batch * self.config.batch_ratio, &mut rng),
                })
                .collect();
            let done = self.minibatch(ensemble, rate, lesson, &drawn, &mut rng);
            for (pass, done) in passes.iter_mut().zip(done) {
                for (example, logit) in done {
                    pass.record(&example, logit);
                }
            }
        }
        let n_passes = passes[0].n_seen.div_ceil(n_labeled) as u32;
        summary(&passes, n_passes)
    }

    fn unlabeled_per_query(&self) -> u32 {
        self.config.unlabeled_per_query
    }

    /// Answered pairs there and back; for each of them μ others once to be judged and, where a member
    /// is sure, there and back too.
    fn ways_through(&self, _max_epochs: u32) -> f64 {
        f64::from(self.config.passes) * (3.0 + 4.0 * self.config.batch_ratio as f64)
    }

    fn save(&self, archive: &mut Archive) {
        archive.put_json("reward.unlabeled", &self.pool);
        archive.put_json("reward.semi_fits", &self.n_fits);
    }

    fn load(&mut self, archive: &Archive) -> Result<(), LearnError> {
        self.pool = archive.json("reward.unlabeled")?;
        self.n_fits = archive.json("reward.semi_fits")?;
        Ok(())
    }
}

/// One member's part of a minibatch, by number.
struct Drawn {
    labeled: Vec<usize>,
    unlabeled: Vec<usize>,
}

/// Goes through n things in a random order, again and again, each time in another.
struct Cycle {
    n: usize,
    order: Vec<usize>,
}

impl Cycle {
    fn new(n: usize) -> Self {
        let order = Vec::new();
        Self { n, order }
    }

    /// The next `n`, or what is left of this round.
    fn take(&mut self, n: usize, rng: &mut Rng) -> Vec<usize> {
        if self.order.is_empty() {
            self.order = rng.permutation(self.n);
        }
        self.order.split_off(self.order.len().saturating_sub(n))
    }
}

#[cfg(test)]
mod tests {
    use super::super::tests::{labeled, replay, small};
    use super::*;
    use crate::device::Device;
    use crate::reward::RewardConfig;

    fn semi(config: &SemiSupervisedConfig) -> SemiSupervised {
        SemiSupervised::new(config, 1)
    }

    fn queries(replay: &Replay, n: u32) -> Vec<Query> {
        labeled(replay, n, |_| 10).iter().map(|l| l.query).collect()
    }

    #[test]
    fn only_sure_pairs_are_answered_and_as_the_member_would() {
        let replay = replay(6);
        let queries = queries(&replay, 4);
        let semi = semi(&SemiSupervisedConfig {
            weight: 0.5,
            ..SemiSupervisedConfig::default()
        });
        // σ(4.6) = 0.99005, σ(4.59) = 0.98994
        let examples = semi.pseudo_labeled(&queries, &[4.6, -4.6, 4.59, 0.0]);
        let told: Vec<(Query, f64)> = examples.iter().map(|e| (e.query, e.target)).collect();
        assert_eq!(told, [(queries[0], 1.0), (queries[1], 0.0)]);
        assert!(examples.iter().all(|e| (e.weight - 0.125).abs() < 1e-12));
    }

    #[test]
    fn crops_share_a_length_and_stay_within_their_margins() {
        let replay = replay(6);
        let semi = semi(&SemiSupervisedConfig {
            margin: 3,
            crop_spread: 2,
            ..SemiSupervisedConfig::default()
        });
        let mut rng = Rng::new(1, Stream::Test, 0);
        let (mut lens, mut shifts) = (Vec::new(), Vec::new());
        for query in queries(&replay, 200) {
            let crop = semi.cropped(&replay, query, &mut rng);
            assert_eq!(crop.first.len, crop.second.len);
            lens.push(crop.first.len);
            for (crop, whole) in [(crop.first, query.first), (crop.second, query.second)] {
                assert!(crop.start + 3 >= whole.start);
                assert!(crop.start + crop.len <= (whole.start + whole.len + 3).min(20));
                shifts.push(i64::from(crop.start) - i64::from(whole.start));
            }
        }
        assert_eq!(
            (lens.iter().min(), lens.iter().max()),
            (Some(&8), Some(&12))
        );
        assert_eq!(
            (shifts.iter().min(), shifts.iter().max()),
            (Some(&-3), Some(&5))
        );
    }

    #[test]
    fn without_crops_segments_stay_as_they_are() {
        let replay = replay(6);
        let semi = semi(&SemiSupervisedConfig {
            is_cropping: false,
            ..SemiSupervisedConfig::default()
        });
        let query = queries(&replay, 1)[0];
        let mut rng = Rng::new(1, Stream::Test, 0);
        assert_eq!(semi.cropped(&replay, query, &mut rng), query);
    }

    /// Each of SURF's two parts acts in a fit. What it is held against draws the same numbers: pairs of
    /// which nobody is sure, and crops that have no room.
    #[test]
    fn sure_pairs_and_crops_move_a_fit_and_others_do_not() {
        let replay = replay(12);
        let labeled = labeled(&replay, 24, |_| 10);
        let unlabeled = queries(&replay, 60);
        let config = RewardConfig {
            learning_rate: 3e-3,
            ..small()
        };
        let predictions = |certainty, weight, room| {
            let mut ensemble = RewardEnsemble::new(&config, 3, 2, 1, Device::CPU);
            let mut semi = semi(&SemiSupervisedConfig {
                certainty,
                weight,
                passes: 4,
                margin: room,
                crop_spread: room,
                ..SemiSupervisedConfig::default()
            });
            let lesson = Lesson {
                replay: &replay,
                labeled: &labeled,
                unlabeled: &unlabeled,
            };
            semi.fit(&mut ensemble, &lesson);
            let predicted = ensemble.probabilities(&replay, &unlabeled);
            let bits = predicted.into_iter().flatten().map(f32::to_bits);
            bits.collect::<Vec<_>>()
        };
        let (all, none) = (0.5, 1.0 - 1e-15);
        let answers_alone = predictions(none, 1.0, 0);
        assert_eq!(answers_alone, predictions(none, 9.0, 0), "no pair weighs");
        assert_ne!(predictions(all, 1.0, 0), predictions(all, 9.0, 0));
        assert_ne!(answers_alone, predictions(none, 1.0, 5), "cropped");
    }

    /// ⌈20 · 40 / 16⌉ = 50 minibatches of 16, 16 and 8 of 40: sixteen rounds and two thirds.
    #[test]
    fn answers_are_passed_over_as_often_as_the_settings_say_and_resumed_bit_for_bit() {
        let replay = replay(12);
        let labeled = labeled(&replay, 40, |_| 10);
        let unlabeled = queries(&replay, 60);
        let config = RewardConfig {
            learning_rate: 3e-3,
            ..small()
        };
        let new = || RewardEnsemble::new(&config, 3, 2, 1, Device::CPU);
        let lesson = |unlabeled| Lesson {
            replay: &replay,
            labeled: &labeled,
            unlabeled,
        };
        let eager = SemiSupervisedConfig {
            certainty: 0.7,
            ..SemiSupervisedConfig::default()
        };
        let (mut ensemble, mut whole) = (new(), semi(&eager));
        let fit = whole.fit(&mut ensemble, &lesson(&unlabeled));
        assert_eq!(fit.n_epochs, 17);
        let mut archive = Archive::new();
        ensemble.save(&mut archive);
        whole.save(&mut archive);
        let second = whole.fit(&mut ensemble, &lesson(&[]));
        assert!(second.accuracy > fit.accuracy, "{fit:?} {second:?}");
        let (mut other, mut resumed) = (new(), semi(&eager));
        other.load(&archive).expect("loads");
        resumed.load(&archive).expect("loads");
        assert_eq!(resumed.fit(&mut other, &lesson(&[])), second);
    }
}
