//! `cargo xtask serve`: set up, build with every optimisation, become the server.

use std::process::Command;

use crate::failure::Failure;
use crate::workspace::Workspace;
use crate::{child, setup};

/// Builds `stair` and hands this process over to `stair serve`.
///
/// # Errors
/// Something could not be installed, built or started. On success it does not return.
pub(crate) fn run(workspace: &Workspace, arguments: &[String]) -> Result<(), Failure> {
    setup::run(workspace, false)?;
    let mut build = workspace.cargo();
    build.args(["build", "--release", "--package", "app", "--bin", "stair"]);
    let program = workspace.release_program("stair");
    let title = if program.exists() {
        "cargo build --release"
    } else {
        "cargo build --release (the first time takes long)"
    };
    child::run(title, &mut build)?;
    hand_over(Command::new(&program).arg("serve").args(arguments))
}

/// The server takes this process's place: signals and the terminal are its own.
#[cfg(unix)]
fn hand_over(command: &mut Command) -> Result<(), Failure> {
    let error = std::os::unix::process::CommandExt::exec(command);
    Err(child::not_started("stair serve", &error))
}

/// Where a process cannot be replaced, the server runs below this one.
#[cfg(not(unix))]
fn hand_over(command: &mut Command) -> Result<(), Failure> {
    child::run("stair serve", command)
}
