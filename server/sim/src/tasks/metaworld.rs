//! What all MetaWorld tasks share: the 39 numbers of an observation, the course of an episode,
//! an expert's action, distances.
//!
//! Observations and judgements are functions of plain values, [`Readings`]: the environments call
//! them with what the physics says, `golden` with what the original environment recorded.
//!
//! Differs from the original: of its two versions the hand's response and the start of an episode
//! are those of v2, and the moment that is read is v3's, the end of the control step (v2 reads
//! positions 2.5 ms before it). In the first observation of an episode both moments are its own
//! start (in v2 the earlier one is the last of the episode before).
//! Source: METAWORLD.md 1.1–1.4.

use std::fmt::Debug;

use domain::environment::{EnvSpec, Environment, Step, TaskReward};
use domain::random::Rng;
use rapier3d::prelude::PhysicsWorld;
use serde::de::DeserializeOwned;
use serde::{Deserialize, Serialize};

use crate::course::Course;
use crate::robots::sawyer_hand::{self, HandRange, SawyerHand};
use crate::robots::tabletop;
use crate::world::World;

pub mod picture;
mod simulation;

pub use simulation::Simulation;

/// Metres; x right, y away from the robot, z up.
pub type Point = [f64; 3];

/// Numbers in an observation.
pub const OBSERVATION_SIZE: usize = 39;
/// Numbers that describe one moment; an observation holds two of them and the goal.
pub const MOMENT_SIZE: usize = 18;
/// Control steps in an episode.
pub const EPISODE_LEN: u32 = 500;
/// Seconds in a control step.
pub const CONTROL_PERIOD_S: f64 = 0.0125;
/// Steps in a segment shown to people.
pub const SEGMENT_LEN: u32 = 50;

/// One moment as an observation shows it.
///
/// | index | meaning | unit |
/// |---|---|---|
/// | 0–2 | hand | m |
/// | 3 | gripper openness, 1 open, 0.2967 closed on nothing | – |
/// | 4–6 | the task's point on its object | m |
/// | 7–10 | the object's quaternion, its order up to the task; zeros where there is none | – |
/// | 11–17 | a second object; always zeros in these tasks | – |
pub fn moment(
    hand: Point,
    openness: f64,
    object: Point,
    quaternion: [f64; 4],
) -> [f64; MOMENT_SIZE] {
    let mut moment = [0.0; MOMENT_SIZE];
    moment[..3].copy_from_slice(&hand);
    moment[3] = openness;
    moment[4..7].copy_from_slice(&object);
    moment[7..11].copy_from_slice(&quaternion);
    moment
}

/// An observation: the moment (0–17), the moment one step before (18–35) and the goal
/// (36–38), which stays hidden and therefore zero.
///
/// After a reset there is no step before: pass the same moment twice.
pub fn observation(
    now: &[f64; MOMENT_SIZE],
    before: &[f64; MOMENT_SIZE],
) -> [f64; OBSERVATION_SIZE] {
    let mut observation = [0.0; OBSERVATION_SIZE];
    observation[..MOMENT_SIZE].copy_from_slice(now);
    observation[MOMENT_SIZE..2 * MOMENT_SIZE].copy_from_slice(before);
    observation
}

/// How far open the gripper is: the distance of the fingers over 0.1 m, in [0, 1].
pub fn openness(left: Point, right: Point) -> f64 {
    (distance(left, right) / 0.1).clamp(0.0, 1.0)
}

/// Metres.
pub fn distance(a: Point, b: Point) -> f64 {
    a.iter()
        .zip(b)
        .map(|(a, b)| (a - b) * (a - b))
        .sum::<f64>()
        .sqrt()
}

/// Component by component.
pub fn plus(a: Point, b: Point) -> Point {
    [a[0] + b[0], a[1] + b[1], a[2] + b[2]]
}

/// Component by component.
pub fn minus(a: Point, b: Point) -> Point {
    [a[0] - b[0], a[1] - b[1], a[2] - b[2]]
}

/// Metres in the plane of the table.
pub fn distance_xy(a: Point, b: Point) -> f64 {
    (a[0] - b[0]).hypot(a[1] - b[1])
}

/// A scripted expert's action: towards a waypoint, as fast as `gain` says, with the gripper
/// at `grip` (+1 closes, −1 opens).
pub fn towards(hand: Point, waypoint: Point, gain: f64, grip: f64) -> Vec<f32> {
    (0..3)
        .map(|i| (gain * (waypoint[i] - hand[i])).clamp(-1.0, 1.0) as f32)
        .chain([grip as f32])
        .collect()
}

/// A MetaWorld task: what stands on the table, what an agent sees of it, and what counts.
///
/// [`Simulation`] makes an environment of it.
pub trait Setup: Sized + Serialize + DeserializeOwned {
    /// As users type it.
    const NAME: &'static str;
    /// Where the hand starts and may go.
    const RANGE: HandRange;
    /// Numbers of a pose that follow the hand's: see [`Setup::pose`].
    const POSE_SIZE: usize;
    /// Where the object is, as far as observation and reward care.
    type Object: Copy + Debug;

    /// Draws where the object stands: its root `P`.
    fn draw(rng: &mut Rng) -> Point;

    /// Adds everything that the hand may run into beside the object.
    fn add_surroundings(world: &mut PhysicsWorld) {
        tabletop::add_table(world);
    }

    /// Adds the object, its root at `root`.
    fn add_object(world: &mut PhysicsWorld, root: Point) -> Self;

    /// Lets the object's stops take hold or let go; called before each step.
    fn meet_stops(&self, _world: &mut PhysicsWorld) {}

    /// Reads where the object is.
    fn object(&self, world: &PhysicsWorld) -> Self::Object;

    /// How far the object has moved along its joint, metres or radians (without a joint: metres
    /// from its start).
    fn progress(object: &Self::Object) -> f64;

    /// The first half of an observation.
    fn moment(readings: &Readings<Self::Object>) -> [f64; MOMENT_SIZE];

    /// Reward, its parts, success.
    fn judge(readings: &Readings<Self::Object>) -> Judgement;

    /// What a picture needs to know of the object, [`Setup::POSE_SIZE`] numbers.
    fn pose(object: &Self::Object) -> Vec<f32>;
}

/// What observation, reward and success are made of: from physics or from a recording.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Readings<Object> {
    /// The hand, metres.
    pub hand: Point,
    /// The point between the fingertips, metres.
    pub tcp: Point,
    /// 1 open.
    pub openness: f64,
    /// Where the left and the right finger's pads are, metres along y.
    pub pads: [f64; 2],
    /// The gripper command of the step, in [−1, 1]: +1 closes.
    pub command: f64,
    /// `tcp` at the reset.
    pub init_tcp: Point,
    /// The task's own.
    pub object: Object,
}

/// 1 for yes, 0 for no.
pub fn yes(flag: bool) -> f64 {
    f64::from(u8::from(flag))
}

/// Ground truth about one step, with the parts of the reward that MetaWorld reports beside it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Judgement {
    /// In [0, 10].
    pub reward: f64,
    /// Whether the task counts as solved at this step.
    pub success: bool,
    /// Whether the hand is at the object: 1 or 0, in door-open something between.
    pub near_object: f64,
    /// How well the hand is placed, in [0, 1].
    pub grasp_reward: f64,
    /// How well the object is placed, in [0, 1].
    pub in_place_reward: f64,
    /// Metres from the object to its goal.
    pub obj_to_target: f64,
}

/// What every MetaWorld episode holds: a world on the table, the hand in it, the moment before.
#[derive(Serialize, Deserialize)]
pub struct Episode {
    /// The physics.
    pub world: World,
    /// The robot.
    pub hand: SawyerHand,
    /// Where the fingertips were at the reset, metres.
    pub init_tcp: Point,
    course: Course,
    before: [f64; MOMENT_SIZE],
}

impl Episode {
    /// Surroundings with a hand at its home; the task adds its object and then calls
    /// [`Episode::first_observation`].
    pub fn new(seed: u64, range: HandRange, add_surroundings: fn(&mut PhysicsWorld)) -> Self {
        let mut world = tabletop::world();
        add_surroundings(&mut world.physics);
        let hand = SawyerHand::new(&mut world.physics, range);
        Self {
            init_tcp: hand.fingertips(&world.physics),
            world,
            hand,
            course: Course::new(seed),
            before: [0.0; MOMENT_SIZE],
        }
    }

    /// The observation after a reset: both halves show the same moment.
    pub fn first_observation(&mut self, now: [f64; MOMENT_SIZE]) -> Vec<f32> {
        self.before = now;
        self.observe(now)
    }

    /// Moves target, fingers and physics with the task's object by one control step; says
    /// whether the physics is still one of finite numbers.
    #[must_use = "a world that left the finite numbers must end its episode"]
    pub fn advance<S: Setup>(&mut self, setup: &S, action: [f64; 4]) -> bool {
        setup.meet_stops(&mut self.world.physics);
        self.hand.drive(&mut self.world.physics, action);
        let is_finite = self.world.step();
        self.hand.feel(&self.world.physics);
        is_finite
    }

    /// What the present state says, given where the object is.
    pub fn readings<Object>(&self, object: Object) -> Readings<Object> {
        let Self { world, hand, .. } = self;
        Readings {
            hand: hand.position(&world.physics),
            tcp: hand.fingertips(&world.physics),
            openness: hand.openness(),
            pads: hand.pads(&world.physics),
            command: hand.command(),
            init_tcp: self.init_tcp,
            object,
        }
    }

    /// What the step brought, given the moment after it.
    pub fn finish_step(&mut self, now: [f64; MOMENT_SIZE], judgement: Judgement) -> Step {
        Step {
            observation: self.observe(now),
            task_reward: TaskReward(judgement.reward),
            success: judgement.success,
            end: self.course.end(EPISODE_LEN),
            stage: None,
        }
    }

    fn observe(&mut self, now: [f64; MOMENT_SIZE]) -> Vec<f32> {
        let observation = observation(&now, &self.before);
        self.before = now;
        observation.iter().map(|x| *x as f32).collect()
    }
}

/// Sizes and names of a MetaWorld task.
pub fn spec<S: Setup>() -> EnvSpec {
    EnvSpec {
        task: S::NAME.into(),
        observation_size: OBSERVATION_SIZE,
        action_size: 4,
        pose_size: sawyer_hand::POSE_SIZE + S::POSE_SIZE,
        episode_len: EPISODE_LEN,
        segment_len: SEGMENT_LEN,
        control_period_s: CONTROL_PERIOD_S,
        has_success: true,
        stages: Vec::new(),
    }
}

/// A simulation of a MetaWorld task.
pub fn make<S: Setup + Send + 'static>() -> Box<dyn Environment> {
    Box::new(Simulation::<S>::new())
}

/// Three numbers of an observation as a point.
pub fn point(observation: &[f32], start: usize) -> Point {
    std::array::from_fn(|i| f64::from(observation[start + i]))
}
