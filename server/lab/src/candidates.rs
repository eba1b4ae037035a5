//! Candidate pairs of segments: references into the newest complete episodes.

use domain::episode::{EpisodeId, Segment};
use domain::query::Query;
use domain::random::Rng;
use learn::replay::Replay;

/// Draws `n` pairs of `segment_len` steps from the newest `newest_episodes` complete episodes.
///
/// Both episodes are drawn with replacement and independently, starts uniformly over all
/// places where a segment fits. Fewer than `n` pairs only when no episode is long enough.
///
/// Differs from the released code, which never takes an episode's last possible start and
/// may pair a segment with itself.
pub(crate) fn draw(
    replay: &Replay,
    newest_episodes: usize,
    segment_len: u32,
    n: usize,
    rng: &mut Rng,
) -> Vec<Query> {
    let complete = replay.complete_episodes();
    let newest = &complete[complete.len().saturating_sub(newest_episodes)..];
    let long_enough: Vec<EpisodeId> = newest
        .iter()
        .copied()
        .filter(|id| replay.episode(*id).len >= segment_len)
        .collect();
    let n_segments: u64 = long_enough
        .iter()
        .map(|id| u64::from(replay.episode(*id).len - segment_len + 1))
        .sum();
    if n_segments < 2 {
        return Vec::new();
    }
    let mut segment = || {
        let episode = long_enough[rng.below(long_enough.len())];
        let n_starts = replay.episode(episode).len - segment_len + 1;
        Segment {
            episode,
            start: rng.below(n_starts as usize) as u32,
            len: segment_len,
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
