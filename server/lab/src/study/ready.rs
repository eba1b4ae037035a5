//! The studies that come with the program, as `assets/studies` has them.

/// `(name, text)`, in the order in which lists show them.
pub const READY: &[(&str, &str)] = &[
    (
        "task-1",
        include_str!("../../../../assets/studies/task-1.toml"),
    ),
    (
        "task-1-demo",
        include_str!("../../../../assets/studies/task-1-demo.toml"),
    ),
    (
        "task-2",
        include_str!("../../../../assets/studies/task-2.toml"),
    ),
    (
        "task-2-demo",
        include_str!("../../../../assets/studies/task-2-demo.toml"),
    ),
];

#[cfg(test)]
mod tests {
    use std::path::Path;

    use domain::environment::TaskReward;
    use domain::episode::SegmentRecord;
    use domain::query::Question;

    use super::*;
    use crate::study::plan::play;
    use crate::study::{Expected, KnownPair, PairRole, Shot, StudyFile, plan};

    fn ready() -> impl Iterator<Item = (&'static str, StudyFile)> {
        READY.iter().map(|(name, text)| {
            let file = format!("{name}.toml");
            let study = StudyFile::parse(&file, text, Path::new(""));
            (*name, study.unwrap_or_else(|mistakes| panic!("{mistakes}")))
        })
    }

    #[test]
    fn every_ready_study_is_without_mistake() {
        let sizes: Vec<_> = ready()
            .map(|(name, study)| (name, study.n_pairs()))
            .collect();
        assert_eq!(
            sizes,
            [
                ("task-1", (80, 2, 10)),
                ("task-1-demo", (20, 1, 3)),
                ("task-2", (200, 5, 20)),
                ("task-2-demo", (40, 2, 2)),
            ]
        );
    }

    #[test]
    fn the_answers_that_a_ready_study_calls_right_are_right_by_the_task_reward() {
        let preferences = ready().filter(|(_, study)| study.question == Question::Preference);
        for (name, study) in preferences {
            for pair in study.practice.iter().chain(&study.checks) {
                let KnownPair { task, expects, .. } = pair;
                let sum = |shot| reward_of(task, shot, study.segment_len);
                let (first, second) = (sum(pair.first), sum(pair.second));
                let better = match expects {
                    Expected::First => first - second,
                    _ => second - first,
                };
                let size = first.abs().max(second.abs());
                assert!(better > 0.1 * size, "{name}, {task}: {first} and {second}");
            }
        }
    }

    #[test]
    fn practice_of_stages_is_right_by_the_true_stages() {
        let stages = ready().filter(|(_, study)| study.question == Question::SameStage);
        for (name, study) in stages {
            for pair in plan(&study, Path::new("")).unwrap() {
                let PairRole::Practice { expects, .. } = &pair.role else {
                    continue;
                };
                let (first, second) = (stage(&pair.first), stage(&pair.second));
                let is_same = first.is_some() && first == second;
                assert_eq!(
                    is_same,
                    *expects == Expected::Same,
                    "{name}: {first:?} {second:?}"
                );
            }
        }
    }

    #[test]
    fn every_ready_study_can_be_planned_without_anything_else() {
        for (name, study) in ready() {
            let pairs = plan(&study, Path::new("")).unwrap_or_else(|e| panic!("{name}: {e}"));
            let (counted, practice, _) = study.n_pairs();
            let n_known = practice as usize + study.checks.len();
            assert_eq!(pairs.len(), counted as usize + n_known, "{name}");
        }
    }

    /// The one stage that a segment shows. Where a task does not know its stages, whether the
    /// task is not begun or done, by the reward of every step.
    fn stage(record: &SegmentRecord) -> Option<u8> {
        if let (Some(first), Some(last)) = (record.stages.first(), record.stages.last()) {
            return (first == last).then_some(*first);
        }
        let is_done = |reward: &TaskReward| u8::from(reward.0 > 5.0); // of 10
        let mut done = record.task_rewards.iter().map(is_done);
        let first = done.next()?;
        done.all(|is| is == first).then_some(first)
    }

    /// Sum of the task rewards in a shot.
    fn reward_of(task: &str, shot: Shot, len: u32) -> f64 {
        let played = play(sim::tasks::task(task).unwrap(), shot).unwrap();
        let window = shot.start as usize..(shot.start + len) as usize;
        played.task_rewards[window].iter().sum()
    }
}
