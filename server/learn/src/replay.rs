//! Every transition of a run, once: what SAC samples, segments refer to, and clips are drawn from.
//!
//! Plain memory and append-only files, no tensors. Lanes are the parallel environments; an
//! episode is a contiguous range of its lane, with one state more than it has steps, so that
//! next observations need no copy. A step of window-open takes 226
//! bytes.

use std::ops::Range;

use domain::environment::{EpisodeEnd, TaskReward};
use domain::episode::{EpisodeId, Segment, SegmentRecord};

mod batch;
mod journal;
mod lane;

pub use batch::{Batch, BatchRule, RewardSource};
pub use journal::{ReplayMark, forget_others};
use lane::{Lane, NO_STAGE, StepMark, row};

/// Numbers in one row of each kind.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct ReplayShape {
    /// `S`.
    pub observation: usize,
    /// `A`.
    pub action: usize,
    /// Numbers in a recorded pose.
    pub pose: usize,
}

impl ReplayShape {
    /// Bytes of memory that a step takes, pose and all.
    pub fn step_bytes(self) -> usize {
        let learned_reward = 1;
        let numbers = self.observation + self.pose + self.action + learned_reward;
        let (task_reward, episode, stage) = (size_of::<f64>(), size_of::<u32>(), size_of::<u8>());
        numbers * size_of::<f32>() + task_reward + episode + stage + size_of::<StepMark>()
    }
}

/// One step as the replay takes it.
#[derive(Debug, Clone, Copy)]
pub struct NewStep<'a> {
    /// `[A]`.
    pub action: &'a [f32],
    /// The present estimate; relabelling replaces it.
    pub learned_reward: f32,
    /// Ground truth: for evaluation, scripted teachers and the upper bound.
    pub task_reward: TaskReward,
    /// Whether the task counts as solved at this step.
    pub success: bool,
    /// True stage of the state after the step, where the task knows it.
    pub stage: Option<u8>,
    /// Set on an episode's last step.
    pub end: Option<EpisodeEnd>,
    /// The state after the step, `[S]`.
    pub next_observation: &'a [f32],
    /// What it takes to draw that state, `[pose]`.
    pub next_pose: &'a [f32],
}

/// An episode in numbers.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct EpisodeInfo {
    /// Number in order of start.
    pub id: EpisodeId,
    /// What its reset was drawn from.
    pub seed: u64,
    /// Which environment.
    pub lane: usize,
    /// Steps so far.
    pub len: u32,
    /// Why it is over; `None` while it runs or if it was abandoned.
    pub end: Option<EpisodeEnd>,
    /// Sum of task rewards so far.
    pub task_return: f64,
    /// Whether any step counted as a success.
    pub is_success: bool,
}

/// Every transition of a run.
#[derive(Debug)]
pub struct Replay {
    shape: ReplayShape,
    lanes: Vec<Lane>,
    episodes: Vec<Episode>,
    complete: Vec<EpisodeId>,
    keeps_disagreement: bool,
    journal: journal::Journal,
}

#[derive(Debug)]
struct Episode {
    seed: u64,
    lane: u32,
    first_state: usize,
    first_step: usize,
    len: u32,
    end: Option<EpisodeEnd>,
    task_return: f64,
    is_success: bool,
}

impl Replay {
    /// Without transitions, for `n_lanes` parallel environments.
    pub fn new(shape: ReplayShape, n_lanes: usize) -> Self {
        Self {
            shape,
            lanes: std::iter::repeat_with(Lane::default)
                .take(n_lanes)
                .collect(),
            episodes: Vec::new(),
            complete: Vec::new(),
            keeps_disagreement: false,
            journal: journal::Journal::new(n_lanes),
        }
    }

    /// Starts an episode in `lane`; one that was running there is abandoned.
    ///
    /// # Panics
    /// When a row has the wrong size or the lane does not exist: a bug of the caller.
    pub fn begin_episode(
        &mut self,
        lane: usize,
        seed: u64,
        observation: &[f32],
        pose: &[f32],
        stage: Option<u8>,
    ) -> EpisodeId {
        let id = EpisodeId(self.episodes.len() as u32);
        let rows = &mut self.lanes[lane];
        self.episodes.push(Episode {
            seed,
            lane: lane as u32,
            first_state: rows.stages.len(),
            first_step: rows.marks.len(),
            len: 0,
            end: None,
            task_return: 0.0,
            is_success: false,
        });
        rows.push_state(self.shape, observation, pose, stage);
        rows.running = Some(id);
        self.journal.note_begin(lane);
        id
    }

    /// Appends a step to the episode that runs in `lane`.
    ///
    /// # Panics
    /// When no episode runs there or a row has the wrong size: a bug of the caller.
    pub fn push(&mut self, lane: usize, step: NewStep<'_>) {
        let rows = &mut self.lanes[lane];
        let id = rows.running.expect("an episode was begun in this lane");
        assert_eq!(step.action.len(), self.shape.action, "size of an action");
        rows.actions.extend_from_slice(step.action);
        rows.learned_rewards.push(step.learned_reward);
        if self.keeps_disagreement {
            rows.disagreements.push(0.0);
        }
        rows.task_rewards.push(step.task_reward.0);
        rows.marks.push(StepMark::new(step.success, step.end));
        rows.episode_of.push(id.0);
        rows.push_state(
            self.shape,
            step.next_observation,
            step.next_pose,
            step.stage,
        );
        let episode = &mut self.episodes[id.0 as usize];
        episode.len += 1;
        episode.end = step.end;
        episode.task_return += step.task_reward.0;
        episode.is_success |= step.success;
        if step.end.is_some() {
            rows.running = None;
            self.complete.push(id);
        }
        self.journal.note_push(lane);
    }

    /// Sizes of the rows.
    pub fn shape(&self) -> ReplayShape {
        self.shape
    }

    /// Transitions.
    pub fn len(&self) -> usize {
        self.lanes.iter().map(|lane| lane.marks.len()).sum()
    }

    /// Whether there is no transition yet.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// Episodes begun.
    pub fn n_episodes(&self) -> usize {
        self.episodes.len()
    }

    /// An episode in numbers.
    ///
    /// # Panics
    /// When there is no such episode.
    pub fn episode(&self, id: EpisodeId) -> EpisodeInfo {
        let episode = &self.episodes[id.0 as usize];
        EpisodeInfo {
            id,
            seed: episode.seed,
            lane: episode.lane as usize,
            len: episode.len,
            end: episode.end,
            task_return: episode.task_return,
            is_success: episode.is_success,
        }
    }

    /// Episodes that came to an end, in the order in which they did.
    pub fn complete_episodes(&self) -> &[EpisodeId] {
        &self.complete
    }

    /// Mean task reward of a step over the `n` newest complete episodes; `None` before the first.
    pub fn typical_reward(&self, n: usize) -> Option<TaskReward> {
        let newest = &self.complete[self.complete.len().saturating_sub(n)..];
        let total = |value: &dyn Fn(&Episode) -> f64| -> f64 {
            let episodes = newest.iter().map(|id| &self.episodes[id.0 as usize]);
            episodes.map(value).sum()
        };
        let n_steps = total(&|e| f64::from(e.len));
        (n_steps > 0.0).then(|| TaskReward(total(&|e| e.task_return) / n_steps))
    }

    /// State before step `t` of an episode, `[S]`; `t` = its length gives the final state.
    ///
    /// # Panics
    /// When the episode has no such state.
    pub fn observation(&self, id: EpisodeId, t: usize) -> &[f32] {
        let (lane, episode) = self.lane_of(id);
        assert!(t <= episode.len as usize, "state {t} of episode {}", id.0);
        row(
            &lane.observations,
            episode.first_state + t,
            self.shape.observation,
        )
    }

    /// Action of step `t`, `[A]`.
    ///
    /// # Panics
    /// When the episode has no such step.
    pub fn action(&self, id: EpisodeId, t: usize) -> &[f32] {
        let (lane, step) = self.step_of(id, t);
        row(&lane.actions, step, self.shape.action)
    }

    /// Ground truth of step `t`.
    ///
    /// # Panics
    /// When the episode has no such step.
    pub fn task_reward(&self, id: EpisodeId, t: usize) -> TaskReward {
        let (lane, step) = self.step_of(id, t);
        TaskReward(lane.task_rewards[step])
    }

    /// Present estimate of step `t`.
    ///
    /// # Panics
    /// When the episode has no such step.
    pub fn learned_reward(&self, id: EpisodeId, t: usize) -> f32 {
        let (lane, step) = self.step_of(id, t);
        lane.learned_rewards[step]
    }

    /// Everything that a teacher may need about a segment: poses and stages of the states
    /// after each of its steps, and their task rewards.
    ///
    /// # Panics
    /// When the segment reaches beyond its episode.
    pub fn record(&self, segment: Segment) -> SegmentRecord {
        let (lane, steps, states) = self.rows_of(segment);
        SegmentRecord {
            segment,
            poses: states
                .map(|s| row(&lane.poses, s, self.shape.pose).to_vec())
                .collect(),
            task_rewards: lane.task_rewards[steps]
                .iter()
                .copied()
                .map(TaskReward)
                .collect(),
            stages: self.stages(segment).to_vec(),
        }
    }

    /// True stage of the state after each step of a segment, `[H]`; empty where the task does not
    /// know its stages.
    ///
    /// # Panics
    /// When the segment reaches beyond its episode.
    pub fn stages(&self, segment: Segment) -> &[u8] {
        let (lane, _, states) = self.rows_of(segment);
        let stages = &lane.stages[states];
        if stages.contains(&NO_STAGE) {
            &[]
        } else {
            stages
        }
    }

    /// Keeps a column for how much the members of the learned reward disagree about each step,
    /// 0 until it is written.
    pub fn keep_disagreement(&mut self) {
        self.keeps_disagreement = true;
        for lane in &mut self.lanes {
            lane.disagreements.resize(lane.marks.len(), 0.0);
        }
    }

    /// Whether that column is kept.
    pub fn keeps_disagreement(&self) -> bool {
        self.keeps_disagreement
    }

    /// Writes the disagreement about the newest step of a lane.
    ///
    /// # Panics
    /// When the column is not kept or the lane has no step.
    pub fn note_disagreement(&mut self, lane: usize, disagreement: f32) {
        let column = &mut self.lanes[lane].disagreements;
        *column.last_mut().expect("a kept column with a step") = disagreement;
    }

    /// Disagreement about one lane's steps, to be rewritten; empty where it is not kept.
    pub(crate) fn disagreements_mut(&mut self, lane: usize) -> &mut [f32] {
        &mut self.lanes[lane].disagreements
    }

    /// Number of parallel environments.
    pub fn n_lanes(&self) -> usize {
        self.lanes.len()
    }

    /// Steps of one lane.
    pub(crate) fn lane_len(&self, lane: usize) -> usize {
        self.lanes[lane].marks.len()
    }

    /// Present estimates of one lane's steps, to be rewritten.
    pub(crate) fn learned_rewards_mut(&mut self, lane: usize) -> &mut [f32] {
        &mut self.lanes[lane].learned_rewards
    }

    /// Appends state and action of a lane's steps as rows of `S + A`.
    pub(crate) fn append_lane_rows(
        &self,
        lane: usize,
        steps: std::ops::Range<usize>,
        out: &mut Vec<f32>,
    ) {
        let lane = &self.lanes[lane];
        for step in steps {
            let state = self.state_of(lane, step);
            out.extend_from_slice(row(&lane.observations, state, self.shape.observation));
            out.extend_from_slice(row(&lane.actions, step, self.shape.action));
        }
    }

    /// Appends state and action of a segment's steps as rows of `S + A`.
    pub(crate) fn append_segment_rows(&self, segment: Segment, out: &mut Vec<f32>) {
        let (lane, episode) = self.lane_of(segment.episode);
        assert!(
            segment.start + segment.len <= episode.len,
            "a segment inside its episode"
        );
        for t in segment.start as usize..(segment.start + segment.len) as usize {
            let (state, step) = (episode.first_state + t, episode.first_step + t);
            out.extend_from_slice(row(&lane.observations, state, self.shape.observation));
            out.extend_from_slice(row(&lane.actions, step, self.shape.action));
        }
    }

    /// States from which a step was taken, episode by episode, `[len × S]` each.
    pub(crate) fn visited_states(&self) -> impl Iterator<Item = &[f32]> {
        let s = self.shape.observation;
        self.episodes.iter().map(move |episode| {
            let rows = &self.lanes[episode.lane as usize].observations;
            &rows[episode.first_state * s..(episode.first_state + episode.len as usize) * s]
        })
    }

    /// Lane and step of the transition with number `index`, lane after lane.
    fn locate(&self, mut index: usize) -> (&Lane, usize) {
        for lane in &self.lanes {
            if index < lane.marks.len() {
                return (lane, index);
            }
            index -= lane.marks.len();
        }
        unreachable!("an index below the number of transitions")
    }

    fn state_of(&self, lane: &Lane, step: usize) -> usize {
        let episode = &self.episodes[lane.episode_of[step] as usize];
        episode.first_state + step - episode.first_step
    }

    fn lane_of(&self, id: EpisodeId) -> (&Lane, &Episode) {
        let episode = &self.episodes[id.0 as usize];
        (&self.lanes[episode.lane as usize], episode)
    }

    /// Rows of a segment's steps, and of the states that they lead to.
    fn rows_of(&self, segment: Segment) -> (&Lane, Range<usize>, Range<usize>) {
        let (lane, episode) = self.lane_of(segment.episode);
        let (start, len) = (segment.start as usize, segment.len as usize);
        assert!(
            start + len <= episode.len as usize,
            "a segment inside its episode"
        );
        let steps = episode.first_step + start..episode.first_step + start + len;
        let states = episode.first_state + start + 1..episode.first_state + start + 1 + len;
        (lane, steps, states)
    }

    fn step_of(&self, id: EpisodeId, t: usize) -> (&Lane, usize) {
        let (lane, episode) = self.lane_of(id);
        assert!(t < episode.len as usize, "step {t} of episode {}", id.0);
        (lane, episode.first_step + t)
    }
}

#[cfg(test)]
mod tests;
#[cfg(test)]
pub(crate) mod walked;
