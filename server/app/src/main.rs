//! `stair`: people take part in a run. HTTP, pages and the command line.
//!
//! Invariants: the only crate that knows everyone; what a run needs to know about people
//! reaches it through [`live`] alone; no page and no handler touches tensors or the GPU.

#![expect(
    unreachable_pub,
    reason = "an executable: nothing outside reaches into it"
)]

use std::process::ExitCode;

mod api;
mod assets;
mod cli;
mod experiments;
mod extract;
mod guard;
mod label_table;
mod live;
mod pages;
mod policy;
mod problem;
mod provenance;
mod router;
mod state;
mod study_results;
mod worker;

fn main() -> ExitCode {
    cli::main()
}
