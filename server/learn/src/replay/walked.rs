//! Replays for tests that look at states alone.

use domain::environment::{EpisodeEnd, TaskReward};

use super::{NewStep, Replay, ReplayShape};

/// One lane through these episodes, each its states in order: actions of one number, nothing
/// earned, the time limit after each last state.
pub(crate) fn walked(
    n_observed: usize,
    episodes: impl IntoIterator<Item = Vec<Vec<f32>>>,
) -> Replay {
    let shape = ReplayShape {
        observation: n_observed,
        action: 1,
        pose: 0,
    };
    let mut replay = Replay::new(shape, 1);
    for states in episodes {
        let (first, later) = states.split_first().expect("an episode has a first state");
        replay.begin_episode(0, 0, first, &[], None);
        for (t, next) in (1..).zip(later) {
            let step = NewStep {
                action: &[0.0],
                learned_reward: 0.0,
                task_reward: TaskReward(0.0),
                success: false,
                stage: None,
                end: (t == later.len()).then_some(EpisodeEnd::TimeLimit),
                next_observation: next,
                next_pose: &[],
            };
            replay.push(0, step);
        }
    }
    replay
}
