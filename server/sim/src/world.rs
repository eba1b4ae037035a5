//! What every task shares of rapier: a world, a step that notices when numbers go bad, snapshots.

use domain::environment::EnvError;
use rapier3d::prelude::{PhysicsWorld, Vector};
use serde::{Deserialize, Serialize, de::DeserializeOwned};

/// Snapshots fit this program and this physics engine only: rapier's state has no stable form.
/// `states 2`: since episodes remember that they are lost.
const SNAPSHOT_VERSION: &str = concat!(
    "stair ",
    env!("CARGO_PKG_VERSION"),
    ", states 2, rapier3d 0.36.1"
);

/// How a world's time passes.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Timing {
    /// Seconds of one [`World::step`]: collisions are found once in it.
    pub step_s: f32,
    /// Dynamics substeps inside one step.
    pub n_substeps: usize,
    /// Metres per second squared; the tasks' z axis points up.
    pub gravity: f32,
}

/// A rapier world that is stepped at a fixed rate.
///
/// Bodies, colliders and joints are reached through [`World::physics`]; build them with
/// `can_sleep(false)`, because a sleeping body forgets the forces it is given.
#[derive(Serialize, Deserialize)]
pub struct World {
    /// Rapier's own sets.
    pub physics: PhysicsWorld,
}

impl World {
    /// An empty world with contacts tuned for bodies of centimetres to decimetres: 60 Hz,
    /// damping ratio 5, small margins, no continuous collision detection.
    pub fn new(timing: Timing) -> Self {
        let mut physics = PhysicsWorld::new();
        physics.gravity = Vector::new(0.0, 0.0, -timing.gravity);
        let parameters = &mut physics.integration_parameters;
        parameters.dt = timing.step_s;
        parameters.num_solver_iterations = timing.n_substeps;
        parameters.contact_softness.natural_frequency = 60.0;
        parameters.contact_softness.damping_ratio = 5.0;
        parameters.static_contact_softness = parameters.contact_softness;
        parameters.normalized_prediction_distance = 0.005;
        parameters.normalized_allowed_linear_error = 0.0005;
        parameters.normalized_contact_recycle_distance = 0.002;
        parameters.max_ccd_substeps = 0;
        Self { physics }
    }

    /// Advances by one step; says whether everything is still a finite number. Rapier itself
    /// would put a broken body aside without a word.
    #[must_use = "a world that left the finite numbers must end its episode"]
    pub fn step(&mut self) -> bool {
        self.physics.step();
        self.physics.quarantine().is_empty()
    }
}

/// A task's whole state as bytes, marked with the task and the version that can read it.
///
/// # Panics
/// When `state` holds a type that has no binary form, which is a mistake in the task.
pub fn snapshot<T: Serialize>(task: &str, state: &T) -> Vec<u8> {
    bincode::serde::encode_to_vec((SNAPSHOT_VERSION, task, state), bincode::config::standard())
        .expect("a task's state is plain data, which bincode writes into memory without fail")
}

/// Reads what [`snapshot`] wrote.
///
/// # Errors
/// [`EnvError::Snapshot`] for bytes of another task, another version, or none at all.
pub fn restore<T: DeserializeOwned>(task: &str, bytes: &[u8]) -> Result<T, EnvError> {
    let refuse = |reason: String| EnvError::Snapshot {
        task: task.into(),
        reason,
    };
    let config = bincode::config::standard();
    let ((version, name), _): ((String, String), usize) =
        bincode::serde::decode_from_slice(bytes, config)
            .map_err(|error| refuse(error.to_string()))?;
    if version != SNAPSHOT_VERSION {
        return Err(refuse(format!("it was written by {version}")));
    }
    if name != task {
        return Err(refuse(format!("it belongs to {name}")));
    }
    let ((_, _, state), n_read): ((String, String, T), usize) =
        bincode::serde::decode_from_slice(bytes, config)
            .map_err(|error| refuse(error.to_string()))?;
    if n_read != bytes.len() {
        return Err(refuse(format!(
            "{} bytes follow its end",
            bytes.len() - n_read
        )));
    }
    Ok(state)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_snapshot_is_read_by_its_own_task_only() {
        let bytes = snapshot("this", &7_u32);
        assert_eq!(restore::<u32>("this", &bytes), Ok(7));
        let error = restore::<u32>("that", &bytes).expect_err("another task's snapshot");
        assert!(error.to_string().contains("it belongs to this"), "{error}");
    }

    #[test]
    fn a_cut_or_lengthened_snapshot_is_refused() {
        let mut bytes = snapshot("this", &[1.5_f32, 2.5]);
        assert!(restore::<[f32; 2]>("this", &bytes[..bytes.len() - 1]).is_err());
        bytes.push(0);
        assert!(restore::<[f32; 2]>("this", &bytes).is_err());
        assert!(restore::<[f32; 2]>("this", &[]).is_err());
    }
}
