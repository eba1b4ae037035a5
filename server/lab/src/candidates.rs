//! Candidate pairs of segments: references into the newest complete episodes.

use domain::episode::{EpisodeId, Segment};
use domain::query::Query;
use domain::random::Rng;
use learn::replay::Replay;

/// Where pairs may come from.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Pool {
    /// Newest complete episodes.
    pub newest_episodes: usize,
    /// Steps of a segment.
    pub segment_len: u32,
    /// Whether an episode's last possible start is never taken, as in the released code.
    pub leaves_last_start: bool,
    /// Whether a segment may be paired with itself, as in the released code.
    pub pairs_with_itself: bool,
}

impl Pool {
    /// Whether there is anything to ask about.
    pub(crate) fn holds_a_pair(&self, replay: &Replay) -> bool {
        self.makes_a_pair(&self.episodes(replay))
    }

    /// * `episodes` – as [`Pool::episodes`] counts them
    fn makes_a_pair(&self, episodes: &[(EpisodeId, u32)]) -> bool {
        let n_segments: u64 = episodes.iter().map(|(_, n)| u64::from(*n)).sum();
        n_segments >= if self.pairs_with_itself { 1 } else { 2 }
    }

    /// The episodes that are long enough, each with the number of places where a segment fits.
    fn episodes(&self, replay: &Replay) -> Vec<(EpisodeId, u32)> {
        let complete = replay.complete_episodes();
        let newest = &complete[complete.len().saturating_sub(self.newest_episodes)..];
        let n_starts = |id: EpisodeId| {
            let n = (replay.episode(id).len + 1).saturating_sub(self.segment_len);
            n - u32::from(self.leaves_last_start && n > 1)
        };
        let counted = newest.iter().map(|&id| (id, n_starts(id)));
        counted.filter(|(_, n)| *n > 0).collect()
    }

    /// Draws `n` pairs.
    ///
    /// Both episodes are drawn with replacement and independently, starts uniformly over all
    /// places where a segment fits. Fewer than `n` pairs only where no two segments fit.
    pub(crate) fn draw(&self, replay: &Replay, n: usize, rng: &mut Rng) -> Vec<Query> {
        let long_enough = self.episodes(replay);
        if !self.makes_a_pair(&long_enough) {
            return Vec::new();
        }
        let mut segment = || {
            let (episode, n_starts) = long_enough[rng.below(long_enough.len())];
            Segment {
                episode,
                start: rng.below(n_starts as usize) as u32,
                len: self.segment_len,
            }
        };
        let mut queries = Vec::with_capacity(n);
        while queries.len() < n {
            let (first, second) = (segment(), segment());
            if self.pairs_with_itself || first != second {
                queries.push(Query { first, second });
            }
        }
        queries
    }
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeSet;

    use domain::environment::{EpisodeEnd, TaskReward};
    use domain::random::Stream;
    use learn::replay::{NewStep, ReplayShape};

    use super::*;

    /// Complete episodes of these lengths.
    fn replay(lens: &[u32]) -> Replay {
        let shape = ReplayShape {
            observation: 1,
            action: 1,
            pose: 0,
        };
        let mut replay = Replay::new(shape, 1);
        for (seed, len) in (0_u64..).zip(lens) {
            replay.begin_episode(0, seed, &[0.0], &[], None);
            for t in 1..=*len {
                let step = NewStep {
                    action: &[0.0],
                    learned_reward: 0.0,
                    task_reward: TaskReward(0.0),
                    success: false,
                    stage: None,
                    end: (t == *len).then_some(EpisodeEnd::TimeLimit),
                    next_observation: &[0.0],
                    next_pose: &[],
                };
                replay.push(0, step);
            }
        }
        replay
    }

    fn pool(newest_episodes: usize, leaves_last_start: bool) -> Pool {
        Pool {
            newest_episodes,
            segment_len: 5,
            leaves_last_start,
            pairs_with_itself: false,
        }
    }

    /// Where the segments of many pairs begin: episode and step.
    fn starts(pool: Pool, replay: &Replay) -> BTreeSet<(u32, u32)> {
        let mut rng = Rng::new(1, Stream::Test, 0);
        let drawn = pool.draw(replay, 500, &mut rng);
        assert_eq!(drawn.len(), 500);
        let segments = drawn.iter().flat_map(|query| {
            assert_ne!(query.first, query.second, "a pair of two");
            [query.first, query.second]
        });
        segments.map(|s| (s.episode.0, s.start)).collect()
    }

    #[test]
    fn every_place_where_a_segment_fits_is_drawn_and_no_other() {
        let replay = replay(&[9, 4, 7]); // the second is too short
        let of = |episode, n| (0..n).map(move |start| (episode, start));
        let expected: BTreeSet<_> = of(0, 5).chain(of(2, 3)).collect();
        assert_eq!(starts(pool(3, false), &replay), expected);
        let newest: BTreeSet<_> = of(2, 3).collect();
        assert_eq!(starts(pool(2, false), &replay), newest);
    }

    #[test]
    fn the_released_codes_slip_leaves_out_an_episodes_last_start_where_there_are_others() {
        let replay = replay(&[9, 5]);
        let expected: BTreeSet<_> = [(0, 0), (0, 1), (0, 2), (0, 3), (1, 0)].into();
        assert_eq!(starts(pool(2, true), &replay), expected);
    }

    #[test]
    fn the_released_codes_slip_pairs_a_segment_with_itself_now_and_then() {
        let slip = Pool {
            pairs_with_itself: true,
            ..pool(1, false)
        };
        let mut rng = Rng::new(1, Stream::Test, 0);
        let drawn = slip.draw(&replay(&[6]), 1000, &mut rng); // two segments
        let with_itself = drawn.iter().filter(|q| q.first == q.second).count();
        assert_eq!(drawn.len(), 1000);
        assert!((400..600).contains(&with_itself), "{with_itself} of 1000");
    }

    #[test]
    fn where_there_is_one_segment_alone_there_is_no_pair() {
        let mut rng = Rng::new(1, Stream::Test, 0);
        let (pool, replay) = (pool(1, false), replay(&[5]));
        assert_eq!(pool.draw(&replay, 3, &mut rng), []);
        assert!(!pool.holds_a_pair(&replay));
        let slip = Pool {
            pairs_with_itself: true,
            ..pool
        };
        assert!(slip.holds_a_pair(&replay));
    }
}
