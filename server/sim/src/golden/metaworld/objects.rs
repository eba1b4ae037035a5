//! From what was recorded of each task's object to what the task makes of it.

use crate::tasks::metaworld::{Judgement, MOMENT_SIZE, Point, Readings, Setup, minus};
use crate::tasks::window::WindowReading;
use crate::tasks::window_open::{self, WindowOpen};

/// How a task's recordings are replayed.
pub(super) struct TaskRecordings {
    pub(super) name: &'static str,
    /// Turns what was recorded into what the task makes of it.
    pub(super) rebuild: fn(&Recorded) -> Result<Rebuilt, String>,
    /// How many numbers of `rand_vec` say where the object stands.
    pub(super) n_drawn: usize,
    /// Whether the reward looks at the fingers' pads, which trajectory lines do not tell.
    pub(super) needs_pads: bool,
}

/// The tasks whose recordings can be replayed. One line here makes a task's recordings known.
pub(super) const TASKS: [TaskRecordings; 1] = [
    jointed::<WindowOpen>(|recorded| rebuild::<WindowOpen>(recorded, window_open)),
];

const fn jointed<S: Setup>(rebuild: fn(&Recorded) -> Result<Rebuilt, String>) -> TaskRecordings {
    TaskRecordings {
        name: S::NAME,
        rebuild,
        n_drawn: 3,
        needs_pads: false,
    }
}

/// The recorded side of a task's readings.
pub(super) struct Recorded {
    pub(super) hand: Point,
    pub(super) tcp: Point,
    pub(super) openness: f64,
    pub(super) pads: Option<[f64; 2]>,
    pub(super) command: f64,
    /// The joint at the end of the step.
    pub(super) newest_joint: f64,
    pub(super) object: Object,
    pub(super) target: Point,
    pub(super) obj_init: Option<Point>,
    pub(super) init_tcp: Point,
    pub(super) handle_init: Option<Point>,
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
    let slide = recorded.joint(|point| point[0] - window_open::handle(root, 0.0)[0])?;
    let init_handle = recorded.handle_init.ok_or("missing field `handle_init`")?;
    let reading = WindowReading {
        root,
        slide,
        init_handle,
    };
    Ok((root, reading))
}
