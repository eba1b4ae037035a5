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
}

impl Pool {
    /// Draws `n` pairs.
    ///
    /// Both episodes are drawn with replacement and independently, starts uniformly over all
    /// places where a segment fits. Fewer than `n` pairs only when no episode is long enough.
    ///
    /// Differs from the released code, which may pair a segment with itself.
    pub(crate) fn draw(&self, replay: &Replay, n: usize, rng: &mut Rng) -> Vec<Query> {
        let complete = replay.complete_episodes();
        let newest = &complete[complete.len().saturating_sub(self.newest_episodes)..];
        let n_starts = |id: EpisodeId| {
            let n = (replay.episode(id).len + 1).saturating_sub(self.segment_len);
            n - u32::from(self.leaves_last_start && n > 1)
        };
        let long_enough: Vec<EpisodeId> = newest
            .iter()
            .copied()
            .filter(|id| n_starts(*id) > 0)
            .collect();
        let n_segments: u64 = long_enough.iter().map(|id| u64::from(n_starts(*id))).sum();
        if n_segments < 2 {
            return Vec::new();
        }
        let mut segment = || {
            let episode = long_enough[rng.below(long_enough.len())];
            Segment {
                episode,
                start: rng.below(n_starts(episode) as usize) as u32,
                len: self.segment_len,
            }
        };
        let mut queries = Vec::with_capacity(n);
        while queries.len() < n {
            let (first, second) = (segment(), segment());
            if first != second {
                queries.push(Query { first, second });
            }
        }
        queries
    }
}
