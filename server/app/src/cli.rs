//! The command line: one file per command, each with `Args` and `run`.

use std::process::ExitCode;

use clap::{Parser, Subcommand};

mod client;
mod env;
mod evaluate;
mod experiment;
mod export;
mod figure;
mod golden;
mod interrupt;
mod number;
mod openapi;
mod out;
mod render;
mod serve;
mod study;
mod tasks;
mod teach;
mod train;

/// Train agents from human preferences, segment by segment (STAIR).
#[derive(Debug, Parser)]
#[command(name = "stair", version = VERSION, max_term_width = 100)]
#[command(after_help = "Examples:
  stair serve                       open http://127.0.0.1:8080 and choose a task
  stair train go-fetch-return --preset quick
  stair tasks                       all tasks, methods, presets and teachers")]
struct Cli {
    #[command(subcommand)]
    command: Command,
}

const VERSION: &str = concat!(env!("CARGO_PKG_VERSION"), " (", env!("STAIR_REVISION"), ")");

#[derive(Debug, Subcommand)]
enum Command {
    Serve(serve::Args),
    Train(train::Args),
    Evaluate(evaluate::Args),
    Env(env::Args),
    Teach(teach::Args),
    Render(render::Args),
    Golden(golden::Args),
    Tasks(tasks::Args),
    Export(export::Args),
    Figure(figure::Args),
    Experiment(experiment::Args),
    Study(study::Args),
    Openapi(openapi::Args),
}

/// What the user typed, or a file that they named, does not fit. The program ends with code 2.
#[derive(Debug)]
pub struct BadInput(pub String);

impl BadInput {
    /// An error whose cause is the input, with all that it says.
    pub fn from_error(error: impl Into<anyhow::Error>) -> anyhow::Error {
        let error: anyhow::Error = error.into();
        Self(told(&error)).into()
    }
}

impl std::fmt::Display for BadInput {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(&self.0)
    }
}

impl std::error::Error for BadInput {}

/// What an error says, and its causes, each once: many repeat their cause in their own words.
fn told(error: &anyhow::Error) -> String {
    let mut told = error.to_string();
    for cause in error.chain().skip(1).map(ToString::to_string) {
        if !told.ends_with(&cause) {
            told = told + ": " + &cause;
        }
    }
    told
}

/// Writes a text to standard output. A reader that has seen enough, as `head` has, is no error.
///
/// # Errors
/// When standard output cannot be written for another reason.
fn say(text: &str) -> anyhow::Result<()> {
    use std::io::{ErrorKind, Write as _};
    let mut output = std::io::stdout().lock();
    match output
        .write_all(text.as_bytes())
        .and_then(|()| output.flush())
    {
        Err(error) if error.kind() != ErrorKind::BrokenPipe => {
            Err(anyhow::Error::new(error).context("cannot write to standard output"))
        }
        _ => Ok(()),
    }
}

/// Parses, runs, and turns errors into a line on stderr and an exit code: 2 for bad input, and for
/// what a server refuses because it does not fit; 1 for everything else.
pub fn main() -> ExitCode {
    end_with_the_reader();
    let result = match Cli::parse().command {
        Command::Serve(args) => serve::run(args),
        Command::Train(args) => train::run(args),
        Command::Evaluate(args) => evaluate::run(args),
        Command::Env(args) => env::run(args),
        Command::Teach(args) => teach::run(args),
        Command::Render(args) => render::run(args),
        Command::Golden(args) => golden::run(&args),
        Command::Tasks(args) => tasks::run(&args),
        Command::Export(args) => export::run(&args),
        Command::Figure(args) => figure::run(&args),
        Command::Experiment(args) => experiment::run(args),
        Command::Study(args) => study::run(&args),
        Command::Openapi(args) => openapi::run(&args),
    };
    result.unwrap_or_else(|error| {
        eprintln!("stair: {}", told(&error));
        let refused = error.downcast_ref::<client::Refused>();
        let is_refused = refused.is_some_and(|refused| refused.status < 500);
        let is_bad_input = error.is::<BadInput>() || is_refused;
        ExitCode::from(if is_bad_input { 2 } else { 1 })
    })
}

/// What a shell says of a program that its reader's end has ended: 128 + SIGPIPE.
const NO_READER: i32 = 141;

/// Where nobody reads any longer (`stair … | head`), the program ends without a word. The signal
/// itself would also end a server whose browser has gone.
fn end_with_the_reader() {
    let usual = std::panic::take_hook();
    std::panic::set_hook(Box::new(move |panic| {
        let told = panic.payload_as_str().unwrap_or_default();
        if told.starts_with("failed printing to stdout") && told.contains("Broken pipe") {
            std::process::exit(NO_READER);
        }
        usual(panic);
    }));
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_cause_that_an_error_names_itself_is_told_once() {
        let gone = || std::io::Error::other("no such folder");
        let twice = anyhow::Error::new(gone()).context("cannot read it: no such folder");
        assert_eq!(told(&twice), "cannot read it: no such folder");
        let apart = anyhow::Error::new(gone()).context("cannot read it");
        assert_eq!(told(&apart), "cannot read it: no such folder");
    }
}
