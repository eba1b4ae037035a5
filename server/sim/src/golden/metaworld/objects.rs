//! From what was recorded of each task's object to what the task makes of it.

use crate::golden::trajectory::{self, Replayed};
use crate::tasks::door_open::{self, Door, DoorOpen};
use crate::tasks::door_unlock::{self, DoorUnlock, Lock};
use crate::tasks::drawer_open::{self, Drawer, DrawerOpen};
use crate::tasks::faucet_open::{self, Faucet, FaucetOpen};
use crate::tasks::metaworld::{Judgement, MOMENT_SIZE, Point, Readings, Setup, minus, plus};
use crate::tasks::sweep_into::{Block, SweepInto};
use crate::tasks::window::{self, WindowReading};
use crate::tasks::window_close::{self, WindowClose};
use crate::tasks::window_open::{self, WindowOpen};

/// Where the object's root is and actions, to the states they lead to.
type Play = fn(Point, &[Vec<f32>]) -> Result<Vec<Replayed>, String>;

/// How a task's recordings are replayed.
pub(in crate::golden) struct TaskRecordings {
    pub(in crate::golden) name: &'static str,
    /// Turns what was recorded into what the task makes of it.
    pub(super) rebuild: fn(&Recorded) -> Result<Rebuilt, String>,
    /// How many numbers of `rand_vec` say where the object stands.
    pub(in crate::golden) n_drawn: usize,
    /// Whether the reward looks at the fingers' pads, which trajectory lines do not tell.
    pub(super) needs_pads: bool,
    /// Whether the original reads the object anew before the first observation; elsewhere that
    /// shows the object where the episode before put it. METAWORLD.md 3.
    pub(super) is_fresh_at_reset: bool,
    /// Plays recorded actions in our own physics, the object's root where it was recorded.
    pub(in crate::golden) replay: Play,
    /// How far the object moves in a solved episode: metres, radians.
    pub(in crate::golden) travel: f64,
}

/// The tasks whose recordings can be replayed. One entry here makes a task's recordings known.
pub(in crate::golden) const TASKS: [TaskRecordings; 7] = [
    jointed::<WindowOpen>(|r| rebuild::<WindowOpen>(r, window_open), window::TRAVEL_M),
    jointed::<WindowClose>(
        |r| rebuild::<WindowClose>(r, window_close),
        window::TRAVEL_M,
    ),
    TaskRecordings {
        is_fresh_at_reset: true,
        ..jointed::<DoorOpen>(|r| rebuild::<DoorOpen>(r, door), 2.0)
    },
    TaskRecordings {
        is_fresh_at_reset: true,
        ..jointed::<DoorUnlock>(|r| rebuild::<DoorUnlock>(r, lock), 1.57)
    },
    jointed::<DrawerOpen>(|r| rebuild::<DrawerOpen>(r, drawer), 0.16),
    jointed::<FaucetOpen>(|r| rebuild::<FaucetOpen>(r, faucet), 1.57),
    TaskRecordings {
        name: SweepInto::NAME,
        rebuild: |r| rebuild::<SweepInto>(r, block),
        n_drawn: 2,
        needs_pads: true,
        is_fresh_at_reset: true,
        replay: trajectory::replay::<SweepInto>,
        travel: 0.19, // from the middle of where it starts to the middle of the hole
    },
];

const fn jointed<S: Setup + Send>(
    rebuild: fn(&Recorded) -> Result<Rebuilt, String>,
    travel: f64,
) -> TaskRecordings {
    TaskRecordings {
        name: S::NAME,
        rebuild,
        n_drawn: 3,
        needs_pads: false,
        is_fresh_at_reset: false,
        replay: trajectory::replay::<S>,
        travel,
    }
}

/// The recorded side of a task's readings.
pub(super) struct Recorded {
    pub(super) hand: Point,
    pub(super) tcp: Point,
    pub(super) openness: f64,
    pub(super) pads: Option<[f64; 2]>,
    pub(super) command: f64,
    /// The joint at the end of the step; without one, position and quaternion.
    pub(super) newest: Vec<f64>,
    pub(super) object: Object,
    pub(super) target: Point,
    pub(super) obj_init: Option<Point>,
    pub(super) init_tcp: Point,
    pub(super) handle_init: Option<Point>,
    /// The object's point in the observation after the reset.
    pub(super) first_seen: Option<Point>,
}

/// Where the object is, as far as the line tells.
pub(super) enum Object {
    /// Its joint, or its position without one, at the time of the positions.
    Joints(Vec<f64>),
    /// Its point of the observation.
    Point(Point),
}

/// The task's side.
pub(super) struct Rebuilt {
    pub(super) root: Point,
    pub(super) moment: [f64; MOMENT_SIZE],
    pub(super) judgement: Judgement,
}

/// Where the object's root is, and the object.
type Placed<Object> = Result<(Point, Object), String>;

fn rebuild<S: Setup>(
    recorded: &Recorded,
    place: fn(&Recorded) -> Placed<S::Object>,
) -> Result<Rebuilt, String> {
    let (root, object) = place(recorded)?;
    let readings = Readings {
        hand: recorded.hand,
        tcp: recorded.tcp,
        openness: recorded.openness,
        pads: recorded.pads.unwrap_or([recorded.tcp[1]; 2]),
        command: recorded.command,
        init_tcp: recorded.init_tcp,
        object,
    };
    Ok(Rebuilt {
        root,
        moment: S::moment(&readings),
        judgement: S::judge(&readings),
    })
}

impl Recorded {
    /// The joint at the time of the positions; `from_point` finds it from the observation's
    /// point where the line does not tell.
    fn joint(&self, from_point: impl FnOnce(Point) -> f64) -> Result<f64, String> {
        match &self.object {
            Object::Joints(joints) => joints.first().copied().ok_or("q is empty".into()),
            Object::Point(point) => Ok(from_point(*point)),
        }
    }
}

fn window_open(recorded: &Recorded) -> Placed<WindowReading> {
    let root = minus(recorded.target, window_open::goal([0.0; 3]));
    let shut = window_open::handle(root, 0.0);
    let init_handle = recorded.handle_init.or(recorded.first_seen);
    window(recorded, root, shut, init_handle)
}

/// The first observation shows a window that is still shut.
fn window_close(recorded: &Recorded) -> Placed<WindowReading> {
    let root = minus(recorded.target, window_close::goal([0.0; 3]));
    let shut = window_close::handle(root, 0.0);
    let opened = |point| plus(point, [window::TRAVEL_M, 0.0, 0.0]);
    let init_handle = recorded.handle_init.or(recorded.first_seen.map(opened));
    window(recorded, root, shut, init_handle)
}

/// `shut` is the task's point on the handle of a shut window.
fn window(
    recorded: &Recorded,
    root: Point,
    shut: Point,
    init_handle: Option<Point>,
) -> Placed<WindowReading> {
    let reading = WindowReading {
        root,
        slide: recorded.joint(|point| point[0] - shut[0])?,
        init_handle: init_handle.ok_or("missing field `handle_init`")?,
    };
    Ok((root, reading))
}

fn door(recorded: &Recorded) -> Placed<Door> {
    let root = minus(recorded.target, door_open::goal([0.0; 3]));
    let reading = Door {
        root,
        angle: *recorded.newest.first().ok_or("q is empty")?,
        seen_angle: recorded.joint(|point| door_open::angle_of(root, point))?,
    };
    Ok((root, reading))
}

fn lock(recorded: &Recorded) -> Placed<Lock> {
    let root = minus(recorded.target, door_unlock::goal([0.0; 3]));
    let angle = recorded.joint(|point| door_unlock::angle_of(root, point))?;
    Ok((root, Lock { root, angle }))
}

fn drawer(recorded: &Recorded) -> Placed<Drawer> {
    let root = minus(recorded.target, drawer_open::goal([0.0; 3]));
    let slide = recorded.joint(|point| point[1] - drawer_open::handle(root, 0.0)[1])?;
    Ok((root, Drawer { root, slide }))
}

fn faucet(recorded: &Recorded) -> Placed<Faucet> {
    let root = minus(recorded.target, faucet_open::goal([0.0; 3]));
    let angle = recorded.joint(|point| faucet_open::angle_of(root, point))?;
    Ok((root, Faucet { root, angle }))
}

/// Without the pads, a transition's reward cannot be checked; a trajectory's is not.
fn block(recorded: &Recorded) -> Placed<Block> {
    let start = recorded.obj_init.ok_or("missing field `obj_init`")?;
    let position = match &recorded.object {
        Object::Joints(joints) => *joints.first_chunk().ok_or("q has fewer than 3 numbers")?,
        Object::Point(point) => *point,
    };
    // It hardly turns: as little within a substep as to make no difference.
    let [w, x, y, z] = *recorded
        .newest
        .last_chunk()
        .ok_or("q has fewer than 4 numbers")?;
    let reading = Block {
        position,
        turn: [x, y, z, w],
        start,
    };
    Ok((start, reading))
}
