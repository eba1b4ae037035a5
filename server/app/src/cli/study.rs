//! `stair study`: studies with people, from one file each.

use std::path::{Path, PathBuf};
use std::process::ExitCode;

use clap::Subcommand;
use domain::nearest::nearest;
use domain::query::Question;
use lab::study::{READY, StudyFile};
use lab::words::counted;

use super::{BadInput, say};

mod answer;
mod pack;
mod remote;
mod report;

/// Studies with people, from one file each
#[derive(Debug, clap::Args)]
pub struct Args {
    #[command(subcommand)]
    action: Action,
}

#[derive(Debug, Subcommand)]
enum Action {
    /// Look for mistakes in a study's file, and say what the study asks of labelers
    #[command(after_help = "Examples:
  stair study check task-1          a study that comes with the program
  stair study check my-study.toml")]
    Check {
        /// A file, or the name of a ready study: task-1, task-1-demo, task-2, task-2-demo
        file: PathBuf,
    },
    /// Pack the queries of a finished run into one small file, to be asked in studies
    Pack(pack::Args),
    Prepare(remote::PrepareArgs),
    Open(remote::OpenArgs),
    Invite(remote::InviteArgs),
    Status(remote::StatusArgs),
    Close(remote::CloseArgs),
    Export(remote::ExportArgs),
    Answer(answer::Args),
    Report(report::Args),
}

/// Runs the command.
///
/// # Errors
/// [`BadInput`] names each mistake of a file with its line; what a server refuses.
pub fn run(args: &Args) -> anyhow::Result<ExitCode> {
    match &args.action {
        Action::Check { file } => say(&described(&read(file)?.study))?,
        Action::Pack(args) => pack::run(args)?,
        Action::Prepare(args) => remote::prepare(args)?,
        Action::Open(args) => remote::open(args)?,
        Action::Invite(args) => remote::invite(args)?,
        Action::Status(args) => remote::status(args)?,
        Action::Close(args) => remote::close(args)?,
        Action::Export(args) => remote::export(args)?,
        Action::Answer(args) => answer::run(args)?,
        Action::Report(args) => report::run(args)?,
    }
    Ok(ExitCode::SUCCESS)
}

/// A study as a server takes it.
struct Read {
    study: StudyFile,
    text: String,
    /// From which query sets are named.
    folder: PathBuf,
    /// The ready study that it is.
    ready: Option<&'static str>,
}

/// The study in a file, or the ready one of that name.
fn read(path: &Path) -> anyhow::Result<Read> {
    let name = path.display().to_string();
    let ready = READY.iter().find(|(ready, _)| *ready == name);
    let ready = ready.filter(|_| !path.exists());
    let text = match ready {
        Some((_, text)) => (*text).to_owned(),
        None => std::fs::read_to_string(path).map_err(|error| unreadable(&name, &error))?,
    };
    let folder = path.parent().unwrap_or(Path::new(""));
    Ok(Read {
        study: StudyFile::parse(&name, &text, folder).map_err(BadInput::from_error)?,
        text,
        folder: std::path::absolute(folder).unwrap_or_else(|_| folder.to_owned()),
        ready: ready.map(|(name, _)| *name),
    })
}

fn unreadable(name: &str, error: &std::io::Error) -> BadInput {
    let ready: Vec<&str> = READY.iter().map(|(name, _)| *name).collect();
    let hint = match nearest(name, &ready) {
        Some(meant) => format!("did you mean the ready study '{meant}'?"),
        None => format!("the ready studies are {}", ready.join(", ")),
    };
    BadInput(format!("cannot read {name}: {error}; {hint}"))
}

/// What the study asks, line by line.
fn described(study: &StudyFile) -> String {
    let asked = match study.question {
        Question::Preference => "which of two segments is better",
        Question::SameStage => "whether two segments show the same stage",
    };
    let (n_counted, n_practice, n_extra) = study.n_pairs();
    let methods = study.source.methods();
    let from = if methods.is_empty() {
        "episodes of scripted experts".to_owned()
    } else {
        format!("queries of {}", methods.join(" and "))
    };
    format!(
        "{}\n  asks      {asked}, {} each\n  tasks     {}\n  segments  from {from}\n  \
         labelers  {} at most; each answers {}, after {n_practice} for practice, with {} among \
         them\nNo mistakes.\n",
        study.title,
        counted(study.segment_len.into(), "step", "steps"),
        study.tasks.join(", "),
        study.labelers_per_item,
        counted(n_counted.into(), "pair", "pairs"),
        counted(n_extra.into(), "repeat or check", "repeats and checks"),
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_ready_study_is_described_by_its_name() {
        let told = described(&read(Path::new("task-1")).unwrap().study);
        assert!(told.contains("each answers 80 pairs"), "{told}");
        assert!(told.contains("door-open, drawer-open"), "{told}");
    }

    #[test]
    fn a_file_that_is_not_there_is_answered_with_the_ready_study_that_was_meant() {
        let told = read(Path::new("task-1-dmeo")).err().unwrap();
        assert!(told.is::<BadInput>() && told.to_string().contains("'task-1-demo'"));
    }

    #[test]
    fn every_mistake_of_a_file_has_a_line_of_its_own() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("mine.toml");
        std::fs::write(&path, "title = \"\"\ntasks = [\"windowopen\"]\n").unwrap();
        let told = read(&path).err().unwrap().to_string();
        assert!(told.contains("mine.toml: line 1: `title` must say something\n"));
        assert!(
            told.contains("line 2: there is no task 'windowopen'; did you mean 'window-open'?")
        );
    }
}
