//! Installs what is missing, then serves, tests or measures.
//!
//! Invariants: needs nothing but the standard library, so that it builds in seconds on a bare
//! machine; whatever it installs it first looks for; a second start changes nothing.

mod bench;
mod child;
mod cli;
mod debian;
mod failure;
mod libtorch;
mod needs;
mod progress;
mod serve;
mod setup;
mod test;
mod workspace;

use std::process::ExitCode;

use cli::Command;
use failure::Failure;
use workspace::Workspace;

fn main() -> ExitCode {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    match run(&arguments) {
        Ok(()) => ExitCode::SUCCESS,
        Err(failure) => {
            eprintln!("{failure}");
            ExitCode::from(failure.exit_code)
        }
    }
}

fn run(arguments: &[String]) -> Result<(), Failure> {
    let command = cli::parse(arguments)?;
    let workspace = Workspace::of_this_program();
    match command {
        Command::Help(text) => println!("{text}"),
        Command::Setup { with_tests } => setup::run(&workspace, with_tests)?,
        Command::Serve { arguments } => serve::run(&workspace, &arguments)?,
        Command::Test => test::run(&workspace)?,
        Command::Bench { crates } => bench::run(&workspace, &crates)?,
    }
    Ok(())
}
