//! Made-up experience in the sizes that the rows are about.

use domain::environment::{EpisodeEnd, TaskReward};
use domain::episode::{EpisodeId, Segment};
use domain::query::Query;
use domain::random::{Rng, Stream};
use learn::replay::{Batch, NewStep, Replay, ReplayShape};

/// Transitions for one SAC update.
pub(crate) fn random_batch(n: usize, s: usize, a: usize) -> Batch {
    let mut rng = Rng::new(1, Stream::Test, 0);
    let mut normals = |n: usize| {
        let mut values = vec![0.0; n];
        rng.fill_normal(&mut values);
        values
    };
    Batch {
        observation: normals(n * s),
        action: normals(n * a).iter().map(|x| x.tanh()).collect(),
        reward: normals(n),
        next_observation: normals(n * s),
        not_terminal: vec![1.0; n],
    }
}

/// Episodes of a Meta-World task, spread over the lanes.
pub(crate) fn random_replay(n_episodes: usize, len: usize, n_lanes: usize) -> Replay {
    let shape = ReplayShape {
        observation: 39,
        action: 4,
        pose: 12,
    };
    let mut replay = Replay::new(shape, n_lanes);
    push_episodes(&mut replay, n_episodes, len, n_lanes);
    replay
}

/// Adds such episodes.
pub(crate) fn push_episodes(replay: &mut Replay, n_episodes: usize, len: usize, n_lanes: usize) {
    let mut noise = vec![0.0; 4_096];
    for episode in 0..n_episodes {
        let lane = episode % n_lanes;
        Rng::new(2, Stream::Test, replay.n_episodes() as u64).fill_normal(&mut noise);
        replay.begin_episode(lane, episode as u64, &noise[..39], &noise[..12], None);
        for t in 0..len {
            let row = &noise[t * 7 % 4_000..];
            let end = (t + 1 == len).then_some(EpisodeEnd::TimeLimit);
            let step = NewStep {
                action: &row[..4],
                learned_reward: 0.0,
                task_reward: TaskReward(0.0),
                success: false,
                stage: None,
                end,
                next_observation: &row[..39],
                next_pose: &row[..12],
            };
            replay.push(lane, step);
        }
    }
}

/// Pairs of segments of 50 steps.
pub(crate) fn random_queries(n: usize, n_episodes: usize) -> Vec<Query> {
    let mut rng = Rng::new(3, Stream::Test, 0);
    let mut segment = || Segment {
        episode: EpisodeId(rng.below(n_episodes) as u32),
        start: rng.below(450) as u32,
        len: 50,
    };
    (0..n)
        .map(|_| Query {
            first: segment(),
            second: segment(),
        })
        .collect()
}
