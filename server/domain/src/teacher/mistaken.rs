//! The teacher that sometimes says the opposite of what is true.

use super::{Judge, Oracle};
use crate::answer::Preference;
use crate::query::OfferedQuery;
use crate::random::{Rng, Stream};

/// The oracle's answer, flipped with a fixed probability.
///
/// Source: B-Pref's `mistake` teacher; the paper's "Error" teacher at 0.1.
#[derive(Debug, Clone, Copy)]
pub struct Mistaken {
    /// Chance of a flip, [0, 1]; ½ makes answers worthless.
    pub probability: f64,
    /// Of the run.
    pub seed: u64,
}

impl Judge for Mistaken {
    fn judge(&self, query: &OfferedQuery) -> Option<Preference> {
        let step = u64::from(query.key.session) << 32 | u64::from(query.key.index);
        let is_flipped = Rng::new(self.seed, Stream::Teacher, step).chance(self.probability);
        Oracle.judge(query).map(|preference| match preference {
            Preference::Prefer(which) if is_flipped => Preference::Prefer(which.other()),
            other => other,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::answer::Which;
    use crate::environment::TaskReward;
    use crate::episode::{EpisodeId, Segment, SegmentRecord};
    use crate::query::QueryKey;

    fn query(index: u32) -> OfferedQuery {
        let record = |reward| SegmentRecord {
            segment: Segment {
                episode: EpisodeId(0),
                start: 0,
                len: 2,
            },
            poses: vec![],
            task_rewards: vec![TaskReward(reward); 2],
            stages: vec![],
        };
        OfferedQuery {
            key: QueryKey { session: 1, index },
            first: record(1.0),
            second: record(2.0),
            asks_same_stage: false,
            disagreement: None,
            stage_gap: None,
        }
    }

    #[test]
    fn one_answer_in_ten_is_flipped_and_always_the_same_ones() {
        let teacher = Mistaken {
            probability: 0.1,
            seed: 3,
        };
        let answers = || {
            (0..2000)
                .map(|i| teacher.judge(&query(i)))
                .collect::<Vec<_>>()
        };
        let first = answers();
        let n_flipped = first
            .iter()
            .filter(|a| **a == Some(Preference::Prefer(Which::First)))
            .count();
        assert!(
            (150..250).contains(&n_flipped),
            "{n_flipped} of 2000 flipped"
        );
        assert_eq!(first, answers());
    }
}
