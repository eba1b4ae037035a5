//! The list of tasks: one line here and one file beside it make a task.

use domain::environment::{EnvSpec, Environment};
use domain::nearest::nearest;
use domain::scene::{Frame, Scene};

pub mod assembly;
pub mod cabinet;
pub mod cheetah_run;
pub mod desk;
pub mod door_open;
pub mod door_unlock;
pub mod drawer_open;
pub mod faucet_open;
pub mod go_fetch_return;
pub mod locomotion;
pub mod metaworld;
pub mod push_green;
pub mod quadruped;
pub mod quadruped_run;
pub mod quadruped_walk;
pub mod sweep_into;
pub mod walker_run;
pub mod window;
pub mod window_close;
pub mod window_open;

/// A task as the rest of the program knows it.
#[derive(Debug)]
pub struct Task {
    /// As users type it: `go-fetch-return`.
    pub name: &'static str,
    /// As people read it: `Go, fetch, return`.
    pub title: &'static str,
    /// What the agent should learn, in one sentence.
    pub summary: &'static str,
    /// Sizes and names.
    pub spec: fn() -> EnvSpec,
    /// A simulation of its own, to be reset before its first step.
    pub make: fn() -> Box<dyn Environment>,
    /// Everything in its picture that does not move.
    pub scene: fn() -> Scene,
    /// Where each body of [`Task::scene`] is in a recorded pose, `[pose_size]` → `[n_bodies]`.
    /// Needs no physics, so a pose can be drawn long after its episode.
    pub place: fn(pose: &[f32]) -> Frame,
    /// A scripted policy without memory; `None` where nobody wrote one.
    pub expert: Option<Expert>,
}

/// From an observation, `[S]`, to an action, `[A]`.
pub type Expert = fn(observation: &[f32]) -> Vec<f32>;

/// Every task, in the order in which lists show them.
pub fn tasks() -> &'static [Task] {
    const TASKS: &[Task] = &[
        go_fetch_return::TASK,
        window_open::TASK,
        window_close::TASK,
        door_open::TASK,
        door_unlock::TASK,
        drawer_open::TASK,
        faucet_open::TASK,
        sweep_into::TASK,
        push_green::TASK,
        walker_run::TASK,
        quadruped_walk::TASK,
        quadruped_run::TASK,
        cheetah_run::TASK,
    ];
    TASKS
}

/// The task of that name.
///
/// # Errors
/// [`UnknownTask`], which says what was probably meant.
pub fn task(name: &str) -> Result<&'static Task, UnknownTask> {
    tasks()
        .iter()
        .find(|task| task.name == name)
        .ok_or_else(|| UnknownTask::new(name))
}

/// A name that no task has.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("there is no task {name:?}{}; the tasks are: {known}", hint(.nearest.as_ref()))]
pub struct UnknownTask {
    /// What was asked for.
    pub name: String,
    /// The task that was probably meant; `None` where no name is like it.
    pub nearest: Option<&'static str>,
    /// All names, with commas between them.
    pub known: String,
}

impl UnknownTask {
    fn new(name: &str) -> Self {
        let names: Vec<&'static str> = tasks().iter().map(|task| task.name).collect();
        Self {
            name: name.into(),
            nearest: nearest(name, &names),
            known: names.join(", "),
        }
    }
}

fn hint(nearest: Option<&&str>) -> String {
    nearest
        .map(|name| format!(" (did you mean {name:?}?)"))
        .unwrap_or_default()
}

#[cfg(test)]
mod tests;
