//! Runs other programs: one line before, the duration after, their exit code on failure.

use std::process::{Command, ExitStatus};
use std::time::Instant;

use crate::failure::Failure;
use crate::progress;

/// Runs a command that speaks for itself on the terminal.
///
/// # Errors
/// The command could not be started, or failed: its own exit code is passed on.
pub(crate) fn run(title: &str, command: &mut Command) -> Result<(), Failure> {
    println!("── {title}");
    let started = Instant::now();
    let status = command
        .status()
        .map_err(|error| not_started(title, &error))?;
    let duration = progress::seconds(started.elapsed());
    if status.success() {
        println!("── passed in {duration}: {title}");
        return Ok(());
    }
    Err(Failure {
        message: format!("failed after {duration}: {title}"),
        exit_code: exit_code(status),
    })
}

/// Whether a command runs and succeeds, without a word from it.
pub(crate) fn succeeds(program: &str, arguments: &[&str]) -> bool {
    Command::new(program)
        .args(arguments)
        .stdin(std::process::Stdio::null())
        .output()
        .is_ok_and(|output| output.status.success())
}

/// Whether a program of this name lies on the search path.
pub(crate) fn is_on_path(program: &str) -> bool {
    let Some(path) = std::env::var_os("PATH") else {
        return false;
    };
    std::env::split_paths(&path).any(|folder| folder.join(program).is_file())
}

/// A program's exit code; one that a signal ended counts as 1.
pub(crate) fn exit_code(status: ExitStatus) -> u8 {
    status
        .code()
        .and_then(|code| u8::try_from(code).ok())
        .filter(|code| *code != 0)
        .unwrap_or(1)
}

/// A program that is not there or may not be run.
pub(crate) fn not_started(title: &str, error: &std::io::Error) -> Failure {
    Failure::failed(format!("could not start {title}: {error}"))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_exit_code_of_a_failed_command_is_passed_on() {
        let failure = run(
            "a shell that gives up",
            Command::new("sh").args(["-c", "exit 7"]),
        )
        .expect_err("it fails");
        assert_eq!(failure.exit_code, 7);
        assert!(failure.message.contains("a shell that gives up"));
    }

    #[test]
    fn a_program_that_is_missing_is_named() {
        let failure =
            run("no-such-program", &mut Command::new("no-such-program")).expect_err("not there");
        assert!(
            failure
                .message
                .starts_with("could not start no-such-program")
        );
    }

    #[test]
    fn programs_are_found_on_the_search_path() {
        assert!(is_on_path("sh"));
        assert!(!is_on_path("no-such-program"));
    }
}
