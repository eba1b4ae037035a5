//! `cargo xtask setup`: what `serve`, `test` and `bench` share.

use std::time::Instant;

use crate::failure::Failure;
use crate::workspace::Workspace;
use crate::{child, debian, libtorch, needs, progress};

/// Components of the toolchain that a minimal installation lacks, and a command that has each.
const COMPONENTS: [(&str, &str); 2] = [("rustfmt", "fmt"), ("clippy", "clippy")];

/// Installs what is missing.
///
/// # Errors
/// What could not be installed, with exit code 2 where a person has to do it.
pub(crate) fn run(workspace: &Workspace, with_tests: bool) -> Result<(), Failure> {
    let started = Instant::now();
    let with_fetch = libtorch::is_missing(workspace)?;
    let missing = needs::missing(with_tests, with_fetch);
    let components = if with_tests {
        missing_components(workspace)
    } else {
        Vec::new()
    };
    if !with_fetch && missing.is_empty() && components.is_empty() {
        println!("everything is installed: nothing to do");
        return Ok(());
    }
    debian::install(&missing)?;
    add_components(&components)?;
    if with_fetch {
        libtorch::fetch(workspace)?;
    }
    println!(
        "everything is installed, after {}",
        progress::seconds(started.elapsed())
    );
    Ok(())
}

fn missing_components(workspace: &Workspace) -> Vec<&'static str> {
    let answers = |subcommand: &str| {
        workspace
            .cargo()
            .args([subcommand, "--version"])
            .output()
            .is_ok_and(|output| output.status.success())
    };
    COMPONENTS
        .into_iter()
        .filter(|(_, subcommand)| !answers(subcommand))
        .map(|(component, _)| component)
        .collect()
}

fn add_components(components: &[&str]) -> Result<(), Failure> {
    if components.is_empty() {
        return Ok(());
    }
    let line = format!("rustup component add {}", components.join(" "));
    if !child::is_on_path("rustup") {
        return Err(Failure::needs_a_person(format!(
            "this Rust toolchain lacks {}. With rustup the line is:\n\n  {line}\n",
            components.join(" and ")
        )));
    }
    let mut rustup = std::process::Command::new("rustup");
    rustup.args(["component", "add"]).args(components);
    child::run(&line, &mut rustup)
}
