//! The command line: `cargo xtask setup | serve | test | bench`.

use crate::failure::Failure;

/// What the person asked for.
#[derive(Debug, PartialEq, Eq)]
pub(crate) enum Command {
    /// Print a text and stop.
    Help(&'static str),
    /// Install what is missing.
    Setup {
        /// Also what only the tests need.
        with_tests: bool,
    },
    /// Build and start the server.
    Serve {
        /// Passed on to `stair serve`.
        arguments: Vec<String>,
    },
    /// Format, lint, test, document.
    Test,
    /// Measure this machine.
    Bench {
        /// Which crates; empty means all.
        crates: Vec<String>,
    },
}

const COMMANDS: [&str; 4] = ["setup", "serve", "test", "bench"];

const HELP: &str = "\
Installs what is missing, then serves, tests or measures.

Usage: cargo xtask <COMMAND>

Commands:
  serve [ARGUMENTS]  start the server (release build), e.g. cargo xtask serve --bind 127.0.0.1:9000
  test               everything that must pass: format, lints, tests, documentation
  setup              only install what is missing (serve, test and bench do it by themselves)
  bench [CRATE…]     measure this machine: sim, learn, lab, app

cargo xtask <COMMAND> --help tells more.";

const HELP_SETUP: &str = "\
Installs what is missing; with nothing missing it says so and changes nothing.

Usage: cargo xtask setup [--with-tests]

Debian packages (g++, nasm, libvulkan1, mesa-vulkan-drivers) are installed with apt-get when that
needs no password; otherwise the line to type is printed and the exit code is 2.
libtorch 2.11.0 (544 MB to download, 0.5 GB kept) goes to .libtorch in this folder, unless
LIBTORCH names one of your own. An interrupted download goes on where it can.

Options:
  --with-tests  also what only `cargo xtask test` needs: chromium, chromium-driver, rustfmt, clippy";

const HELP_SERVE: &str = "\
Installs what is missing, builds `stair` with every optimisation and starts `stair serve`.

Usage: cargo xtask serve [ARGUMENTS]

All arguments go to the server; `cargo xtask serve -- --help` lists them.

Examples:
  cargo xtask serve
  cargo xtask serve --bind 127.0.0.1:9000 --data /var/lib/stair";

const HELP_TEST: &str = "\
Installs what is missing, then runs everything that a change must pass, in this order:
  cargo fmt --all --check
  cargo clippy --workspace --all-targets -- -D warnings
  cargo test --workspace
  cargo doc --workspace --no-deps      with RUSTDOCFLAGS=-D warnings
It stops at the first failure, with that command's exit code.

Usage: cargo xtask test";

const HELP_BENCH: &str = "\
Installs what is missing, builds the benchmarks with every optimisation and prints their tables.

Usage: cargo xtask bench [CRATE…]

Crates: sim (control steps per second of every task), learn (milliseconds per update), lab (64
environments on one thread and on two, steps per second of runs), app (milliseconds per frame of
every task). Without one, all in turn. Keep the machine otherwise idle.";

/// Reads the command line.
///
/// # Errors
/// Names what was not understood and the nearest thing that would have been.
pub(crate) fn parse(arguments: &[String]) -> Result<Command, Failure> {
    let Some((name, rest)) = arguments.split_first() else {
        return Ok(Command::Help(HELP));
    };
    let asks_for_help = rest.first().is_some_and(|a| is_help(a));
    match name.as_str() {
        _ if is_help(name) || name == "help" => Ok(Command::Help(HELP)),
        "setup" if asks_for_help => Ok(Command::Help(HELP_SETUP)),
        "serve" if asks_for_help => Ok(Command::Help(HELP_SERVE)),
        "test" if asks_for_help => Ok(Command::Help(HELP_TEST)),
        "bench" if asks_for_help => Ok(Command::Help(HELP_BENCH)),
        "setup" => parse_setup(rest),
        "serve" => Ok(Command::Serve {
            arguments: without_separator(rest).to_vec(),
        }),
        "test" => match rest.first() {
            None => Ok(Command::Test),
            Some(argument) => Err(refused("test", argument, &[])),
        },
        "bench" => parse_bench(rest),
        unknown => Err(Failure::needs_a_person(format!(
            "there is no command '{unknown}'; {}\n\n{HELP}",
            suggestion(unknown, &COMMANDS)
        ))),
    }
}

fn parse_setup(rest: &[String]) -> Result<Command, Failure> {
    let mut with_tests = false;
    for argument in rest {
        match argument.as_str() {
            "--with-tests" => with_tests = true,
            _ => return Err(refused("setup", argument, &["--with-tests"])),
        }
    }
    Ok(Command::Setup { with_tests })
}

fn parse_bench(rest: &[String]) -> Result<Command, Failure> {
    let known = crate::bench::CRATES;
    match rest.iter().find(|c| !known.contains(&c.as_str())) {
        Some(argument) => Err(refused("bench", argument, &known)),
        None => Ok(Command::Bench {
            crates: rest.to_vec(),
        }),
    }
}

fn is_help(argument: &str) -> bool {
    matches!(argument, "--help" | "-h")
}

/// `cargo xtask serve -- --help`: the separator itself is not for the server.
fn without_separator(arguments: &[String]) -> &[String] {
    match arguments.split_first() {
        Some((first, rest)) if first == "--" => rest,
        _ => arguments,
    }
}

fn refused(command: &str, argument: &str, known: &[&str]) -> Failure {
    let hint = if known.is_empty() {
        "it takes none".to_owned()
    } else {
        suggestion(argument, known)
    };
    Failure::needs_a_person(format!(
        "'{argument}' is no argument of `cargo xtask {command}`; {hint}"
    ))
}

/// `did you mean 'serve'? (setup, serve, test, bench)`
fn suggestion(unknown: &str, known: &[&str]) -> String {
    let nearest = known
        .iter()
        .min_by_key(|candidate| edit_distance(unknown, candidate));
    let list = known.join(", ");
    match nearest {
        Some(nearest) => format!("did you mean '{nearest}'? ({list})"),
        None => list,
    }
}

/// Fewest insertions, deletions and replacements of a letter that turn one word into the other.
fn edit_distance(from: &str, to: &str) -> usize {
    let to: Vec<char> = to.chars().collect();
    let mut row: Vec<usize> = (0..=to.len()).collect();
    for (i, letter) in from.chars().enumerate() {
        let mut diagonal = row[0];
        row[0] = i + 1;
        for j in 0..to.len() {
            let replaced = diagonal + usize::from(letter != to[j]);
            diagonal = row[j + 1];
            row[j + 1] = replaced.min(row[j] + 1).min(row[j + 1] + 1);
        }
    }
    row[to.len()]
}

#[cfg(test)]
mod tests {
    use super::*;

    fn parse_words(line: &str) -> Result<Command, Failure> {
        let words: Vec<String> = line.split_whitespace().map(str::to_owned).collect();
        parse(&words)
    }

    #[test]
    fn arguments_of_serve_reach_the_server_untouched() {
        let command = parse_words("serve --bind 127.0.0.1:9000 --data runs").expect("parses");
        let Command::Serve { arguments } = command else {
            panic!("not serve: {command:?}");
        };
        assert_eq!(
            arguments,
            ["--bind", "127.0.0.1:9000", "--data", "runs"].map(str::to_owned)
        );
    }

    #[test]
    fn help_after_the_separator_is_for_the_server() {
        assert_eq!(
            parse_words("serve --help").expect("parses"),
            Command::Help(HELP_SERVE)
        );
        assert_eq!(
            parse_words("serve -- --help").expect("parses"),
            Command::Serve {
                arguments: vec!["--help".to_owned()]
            }
        );
    }

    #[test]
    fn a_mistyped_command_is_told_the_nearest_one() {
        let failure = parse_words("tset").expect_err("no such command");
        assert!(failure.message.contains("did you mean 'test'?"));
        assert_eq!(failure.exit_code, 2);
    }

    #[test]
    fn test_takes_no_arguments() {
        let failure = parse_words("test --fast").expect_err("no such argument");
        assert!(failure.message.contains("it takes none"));
    }

    #[test]
    fn a_benchmark_of_an_unknown_crate_is_refused() {
        let failure = parse_words("bench lern").expect_err("no such crate");
        assert!(failure.message.contains("did you mean 'learn'?"));
    }

    #[test]
    fn edit_distance_counts_single_letters() {
        assert_eq!(edit_distance("", "abc"), 3);
        assert_eq!(edit_distance("serve", "serve"), 0);
        assert_eq!(edit_distance("srve", "serve"), 1);
        assert_eq!(edit_distance("kitten", "sitting"), 3);
    }
}
