//! `cargo xtask test`: everything that a change must pass, and what `.ci/run` calls.
//!
//! All steps share the dev profile, so that dependencies are built once for all of them.

use std::time::Instant;

use crate::failure::Failure;
use crate::workspace::Workspace;
use crate::{child, progress, setup};

/// The steps, quickest to fail first.
const STEPS: [&str; 4] = [
    "fmt --all --check",
    "clippy --workspace --all-targets -- -D warnings",
    "test --workspace",
    "doc --workspace --no-deps",
];

/// Runs the steps one after the other.
///
/// # Errors
/// The first step that fails, with its exit code.
pub(crate) fn run(workspace: &Workspace) -> Result<(), Failure> {
    let started = Instant::now();
    setup::run(workspace, true)?;
    for step in STEPS {
        let mut cargo = workspace.cargo();
        cargo.args(step.split(' '));
        if step.starts_with("doc") {
            cargo.env("RUSTDOCFLAGS", "-D warnings");
        }
        child::run(&format!("cargo {step}"), &mut cargo).map_err(|failure| Failure {
            message: format!("TESTS FAILED: {}", failure.message),
            ..failure
        })?;
    }
    println!(
        "ALL TESTS PASSED in {}",
        progress::seconds(started.elapsed())
    );
    Ok(())
}
