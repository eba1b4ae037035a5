//! `cargo xtask bench`: the speed of physics, learning and drawing on this machine, as tables.

use crate::failure::Failure;
use crate::workspace::Workspace;
use crate::{child, setup};

/// Crates with an example named after them (`sim_bench`: one folder holds the examples of all),
/// cheapest to build first.
pub(crate) const CRATES: [&str; 4] = ["sim", "learn", "lab", "app"];

/// Builds and runs the benchmarks of the named crates; none named means all.
///
/// # Errors
/// Something could not be installed or built, or a benchmark failed.
pub(crate) fn run(workspace: &Workspace, crates: &[String]) -> Result<(), Failure> {
    setup::run(workspace, false)?;
    let chosen = CRATES
        .iter()
        .filter(|name| crates.is_empty() || crates.iter().any(|c| c == *name));
    for name in chosen {
        let mut cargo = workspace.cargo();
        cargo.args(["run", "--quiet", "--release", "--package", name]);
        cargo.args(["--example", &format!("{name}_bench")]);
        child::run(&format!("benchmark of {name} (builds first)"), &mut cargo)?;
    }
    println!("all benchmarks done; a difference below 1.2 times is noise");
    Ok(())
}
