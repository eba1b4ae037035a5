//! push-green: press the green button until the green light is on (RoboDesk).
//!
//! # Geometry
//! A Panda in front of a desk (`robots::panda`, [`desk`]). The green button's holder is at
//! `b = (−0.25, 0.625, 0.76)` on the table; its cap ends 3 cm above that, presses down by 5 mm
//! and takes the green light `g` with it, which goes off again when the button is let go. One
//! control step is 20 ms; an episode has 500 and ends by the time limit only.
//!
//! Reset: each joint at its home plus 0.15 of a number drawn uniformly from the range of its
//! commands (so the elbow and the sixth joint start bent to one side); the drawer open by up to
//! 10 cm, the door by up to 20 cm; ball and blocks in their parts of the table; all at rest.
//!
//! # State
//! | observation | meaning | unit |
//! |---|---|---|
//! | 0–2 | end effector `e`, 5 cm behind the fingertips | m |
//! | 3 | wrist, joint 7 | rad |
//! | 4 | left finger | m |
//! | 5–33 | the desk, [`desk::Desk::positions`]: drawer, door, buttons, lights, ball, blocks | m |
//! | 34–67 | 0–33 one step before | |
//!
//! # Action
//! In [−1, 1]⁵: the end effector's target is `e + 0.01 (a₀, a₁, a₂)`, the wrist's its angle
//! + 0.0593 `a₃`, each finger's 0.02 (`a₄` + 1) m. See `robots::panda::targets`.
//!
//! # Reward
//! `r = 0.25 p + 0.75 clamp(1 − ‖e − b‖, 0, 1)` in [0, 1], with `p` = 1 while the light is on.
//!
//! # Success
//! `p`: `g < −0.00453`. An episode succeeds when it is on after any step.
//!
//! Differs from the original: see `robots::panda` and [`desk`].
//! Source: DMCONTROL_ROBODESK.md 5; the dense reward and the 68 numbers are the paper's.

use domain::environment::{EnvError, EnvSpec, Environment, Step, TaskReward};
use domain::random::{Rng, Stream};
use domain::scene::{Frame, Scene, Transform};
use serde::{Deserialize, Serialize};

use super::Task;
use super::desk::{self, BUTTONS, Desk, LIGHTS, Layer, N_POSITIONS};
use crate::course::Course;
use crate::robots::panda::{self, ACTION_SIZE, N_JOINTS, Panda, Point, links};
use crate::world::{self, Timing, World};

const NAME: &str = "push-green";

/// push-green, as the list of tasks shows it.
pub const TASK: Task = Task {
    name: NAME,
    title: "Push the green button",
    summary: "The arm should press the green button, so that the green light goes on.",
    spec,
    make: || Box::new(PushGreen::new()),
    scene,
    place,
    expert: Some(expert),
};

/// Numbers that describe one moment; an observation holds two of them.
pub const MOMENT_SIZE: usize = 5 + N_POSITIONS;
const OBSERVATION_SIZE: usize = 2 * MOMENT_SIZE;
/// The joints, then the desk.
const POSE_SIZE: usize = N_JOINTS + N_POSITIONS;
const EPISODE_LEN: u32 = 500;
const CONTROL_PERIOD_S: f32 = 0.02;
/// The green one among red, green, blue.
const GREEN: usize = 1;
/// Share of a joint's range of commands that the reset's noise covers.
const NOISE: f64 = 0.15;

// ── Readings: from physics or from a recording ─────────────────────────────────────────────

/// What observation, reward and success are made of.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Readings {
    /// Hinges, left and right finger; radians and metres.
    pub joints: [f64; N_JOINTS],
    /// See [`desk::Desk::positions`].
    pub desk: [f64; N_POSITIONS],
}

impl Readings {
    /// The end effector, metres.
    pub fn end_effector(&self) -> Point {
        links::end_effector(&links::frames(&self.joints))
    }

    /// The first half of an observation.
    pub fn moment(&self) -> [f64; MOMENT_SIZE] {
        let mut moment = [0.0; MOMENT_SIZE];
        moment[..3].copy_from_slice(&self.end_effector());
        moment[3] = self.joints[6];
        moment[4] = self.joints[7];
        moment[5..].copy_from_slice(&self.desk);
        moment
    }

    /// Whether the green light is on: the task counts as solved.
    pub fn is_lit(&self) -> bool {
        self.desk[LIGHTS + GREEN] < desk::light::ON_BELOW_M
    }

    /// In [0, 1].
    pub fn reward(&self) -> f64 {
        let far = rapier3d::na::Vector3::from(self.end_effector())
            - rapier3d::na::Vector3::from(BUTTONS[GREEN]);
        let near = (1.0 - far.norm()).clamp(0.0, 1.0);
        (0.25 * f64::from(u8::from(self.is_lit())) + 0.75 * near).clamp(0.0, 1.0)
    }
}

/// An observation: this moment, then the one a step before. After a reset there is no step
/// before: pass the same moment twice.
pub fn observation(
    now: &[f64; MOMENT_SIZE],
    before: &[f64; MOMENT_SIZE],
) -> [f64; OBSERVATION_SIZE] {
    std::array::from_fn(|i| {
        if i < MOMENT_SIZE {
            now[i]
        } else {
            before[i - MOMENT_SIZE]
        }
    })
}

// ── Environment ────────────────────────────────────────────────────────────────────────────

/// The simulation of push-green.
pub struct PushGreen {
    spec: EnvSpec,
    state: State,
}

/// Everything a snapshot holds.
#[derive(Serialize, Deserialize)]
struct State {
    world: World,
    panda: Panda,
    desk: Desk,
    course: Course,
    /// The moment that the last observation showed first.
    before: Vec<f64>,
}

impl PushGreen {
    /// A desk in the episode of seed 0, before its first step.
    pub fn new() -> Self {
        Self {
            spec: spec(),
            state: State::new(0),
        }
    }

    /// What the present state says.
    pub fn readings(&self) -> Readings {
        self.state.readings()
    }
}

impl Default for PushGreen {
    fn default() -> Self {
        Self::new()
    }
}

impl State {
    fn new(seed: u64) -> Self {
        let mut rng = Rng::new(seed, Stream::Reset, 0);
        let start = desk::Start::draw(&mut rng);
        let joints = std::array::from_fn(|i| {
            let [lowest, highest] = links::LINKS[i].drive.command;
            panda::HOME[i] + NOISE * rng.uniform_in(lowest, highest)
        });
        Self::with(seed, &joints, &start)
    }

    fn with(seed: u64, joints: &[f64; N_JOINTS], start: &desk::Start) -> Self {
        let mut world = World::new(Timing {
            step_s: CONTROL_PERIOD_S,
            n_substeps: 5,
            gravity: links::GRAVITY as f32,
        });
        let desk = Desk::new(&mut world.physics, start);
        let panda = Panda::new(&mut world.physics, joints, Layer::Robot.groups());
        let mut state = Self {
            world,
            panda,
            desk,
            course: Course::new(seed),
            before: Vec::new(),
        };
        state.before = state.readings().moment().to_vec();
        state
    }

    fn readings(&self) -> Readings {
        Readings {
            joints: self.panda.joints(&self.world.physics),
            desk: self.desk.positions(&self.world.physics),
        }
    }

    /// One control step; says whether the physics is still one of finite numbers.
    #[must_use = "a world that left the finite numbers must end its episode"]
    fn advance(&mut self, action: &[f64; ACTION_SIZE]) -> bool {
        let joints = self.panda.joints(&self.world.physics);
        let targets = panda::targets(&joints, action);
        self.panda.hold(&mut self.world.physics, &targets);
        let is_finite = self.world.step();
        self.desk
            .follow(&self.world.physics, f64::from(CONTROL_PERIOD_S));
        is_finite
    }

    /// The observation of `now`, which then is the moment before.
    fn observe(&mut self, now: &[f64; MOMENT_SIZE]) -> Vec<f32> {
        let before = self.before.as_slice().try_into().unwrap_or(*now);
        self.before = now.to_vec();
        observation(now, &before).map(|x| x as f32).to_vec()
    }
}

impl Environment for PushGreen {
    fn spec(&self) -> &EnvSpec {
        &self.spec
    }

    fn reset(&mut self, seed: u64) -> Vec<f32> {
        self.state = State::new(seed);
        let now = self.state.readings().moment();
        self.state.observe(&now)
    }

    fn step(&mut self, action: &[f32]) -> Result<Step, EnvError> {
        let action = self.state.course.begin_step(NAME, action)?;
        let is_finite = self.state.advance(&action);
        let pose = self.pose();
        self.state.course.check_state(NAME, is_finite, &pose)?;
        let readings = self.state.readings();
        let step = Step {
            observation: self.state.observe(&readings.moment()),
            task_reward: TaskReward(readings.reward()),
            success: readings.is_lit(),
            end: self.state.course.end(EPISODE_LEN),
            stage: None,
        };
        self.state.course.checked_step(NAME, step)
    }

    fn pose(&self) -> Vec<f32> {
        let Readings { joints, desk } = self.state.readings();
        joints.iter().chain(&desk).map(|x| *x as f32).collect()
    }

    fn snapshot(&self) -> Vec<u8> {
        world::snapshot(NAME, &self.state)
    }

    fn restore(&mut self, snapshot: &[u8]) -> Result<(), EnvError> {
        self.state = world::restore(NAME, snapshot)?;
        Ok(())
    }
}

fn spec() -> EnvSpec {
    EnvSpec {
        task: NAME.into(),
        observation_size: OBSERVATION_SIZE,
        action_size: ACTION_SIZE,
        pose_size: POSE_SIZE,
        episode_len: EPISODE_LEN,
        segment_len: 50,
        control_period_s: f64::from(CONTROL_PERIOD_S),
        has_success: true,
        stages: Vec::new(),
    }
}

/// With closed fingers: up in front of the desk where they start low, over the button, down on it.
/// The original's script (DYNAMICS R7) goes straight over the button and then down for ever: the
/// detour keeps low starts off the desk's edge, and the wider circle once below 0.88 m stands in
/// for the script's memory of being on its way down.
fn expert(observation: &[f32]) -> Vec<f32> {
    let here = [observation[0], observation[1], observation[2]];
    let [x, y, _] = BUTTONS[GREEN].map(|x| x as f32);
    let off = (here[0] - x).hypot(here[1] - y);
    // Once on its way down it only goes up again when it has strayed.
    let is_over = off < if here[2] < 0.88 { 0.05 } else { 0.03 };
    let target = if is_over {
        [x, y, 0.80]
    } else if here[2] < 0.86 {
        [here[0], here[1].min(0.5), 0.90]
    } else {
        [x, y, 0.90]
    };
    let towards = (0..3).map(|i| ((target[i] - here[i]) / 0.05).clamp(-1.0, 1.0));
    towards.chain([0.0, -1.0]).collect()
}

// ── Picture ────────────────────────────────────────────────────────────────────────────────

const ARM_BODY: usize = 1;
const DESK_BODY: usize = ARM_BODY + panda::N_BODIES;

fn scene() -> Scene {
    let mut shapes = panda::shapes(ARM_BODY);
    shapes.extend(desk::shapes(DESK_BODY));
    Scene {
        n_bodies: DESK_BODY + desk::N_BODIES,
        shapes,
        arm: None,
        cameras: desk::cameras(),
        background: desk::BACKGROUND,
        focus: ([0.0, 0.7, 0.7], 1.1),
    }
}

/// The bodies of [`scene`] in a pose: the nine joints, then the desk's positions.
///
/// # Panics
/// When the pose is not one of this task.
fn place(pose: &[f32]) -> Frame {
    let joints = pose.first_chunk::<N_JOINTS>();
    let desk = pose.last_chunk::<N_POSITIONS>();
    let (Some(joints), Some(desk), POSE_SIZE) = (joints, desk, pose.len()) else {
        panic!(
            "a pose of {NAME} has {POSE_SIZE} numbers, not {}",
            pose.len()
        );
    };
    let mut frame = vec![Transform::IDENTITY];
    frame.extend(panda::bodies(&joints.map(f64::from)));
    frame.extend(desk::bodies(desk));
    frame
}

#[cfg(test)]
mod tests;
