//! `stair export`: a run's answers as a table.

use std::fs::File;
use std::io::{self, BufWriter, Write};
use std::path::{Path, PathBuf};
use std::process::ExitCode;
use std::time::Duration;

use anyhow::Context as _;
use store::{LabelsOf, RunId, Store, StudyId};

use super::client::{Client, path_segment};
use super::{BadInput, out};
use crate::label_table::{self, TableError, TableFormat};

/// Write the answers of a run or a study as a table, one row each, from a server or from its data folder
#[derive(Debug, clap::Args)]
#[command(after_help = "Examples:
  stair export --run 1 --out answers.csv
  stair export --run 1 --format jsonl --server http://127.0.0.1:8080
  stair export --study 2 --format parquet --out answers.parquet")]
#[command(group(clap::ArgGroup::new("of").required(true).args(["run", "study"])))]
pub struct Args {
    /// The run's id, as its page's address has it
    #[arg(long, value_name = "ID")]
    run: Option<String>,
    /// Instead of a run: a study's number, as its page's address has it
    #[arg(long, value_name = "ID")]
    study: Option<String>,
    /// A data folder that no server holds
    #[arg(long, value_name = "DIR", default_value = "data")]
    data: PathBuf,
    /// A server, instead of a data folder; its token, where it wants one, is taken from STAIR_TOKEN
    #[arg(long, value_name = "URL", conflicts_with = "data")]
    server: Option<String>,
    /// What to write
    #[arg(long, value_enum, default_value_t = TableFormat::Csv)]
    format: TableFormat,
    /// Where to [default: the terminal]
    #[arg(long, value_name = "FILE")]
    out: Option<PathBuf>,
}

/// Runs the command.
///
/// # Errors
/// [`BadInput`] for an unknown run, a folder without data or held by a server; a file that
/// cannot be written.
pub fn run(args: &Args) -> anyhow::Result<ExitCode> {
    write_to(args.out.as_deref(), |to| match &args.server {
        Some(server) => from_server(server, args, to),
        None => from_folder(args, to),
    })?;
    Ok(ExitCode::SUCCESS)
}

/// Writes a table to a file, whole or not at all, or to the terminal.
///
/// # Errors
/// [`BadInput`] for a file that has no place; what `write` says; a file that cannot be written.
pub(super) fn write_to(
    path: Option<&Path>,
    write: impl FnOnce(&mut dyn Write) -> anyhow::Result<()>,
) -> anyhow::Result<()> {
    let Some(path) = path else {
        return write(&mut std::io::stdout().lock());
    };
    out::file(path)?;
    let told = || format!("cannot write {}", path.display());
    // Beside it first: a table that ends early must not look whole.
    let part = path.with_added_extension("part");
    let mut file = LateFile::new(&part);
    let written = write(&mut file).and_then(|()| file.flush().with_context(told));
    if written.is_err() {
        let _ = std::fs::remove_file(&part); // it may be gone; the first error is told
    }
    written?;
    std::fs::rename(&part, path).with_context(told)
}

/// A file that is made, with its folder, when something is written or flushed: who is refused
/// before that finds nothing new.
struct LateFile<'p> {
    path: &'p Path,
    made: Option<BufWriter<File>>,
}

impl<'p> LateFile<'p> {
    fn new(path: &'p Path) -> Self {
        Self { path, made: None }
    }

    fn file(&mut self) -> io::Result<&mut BufWriter<File>> {
        if self.made.is_none() {
            std::fs::create_dir_all(out::parent(self.path))?;
        }
        match &mut self.made {
            Some(file) => Ok(file),
            made => Ok(made.insert(BufWriter::new(File::create(self.path)?))),
        }
    }
}

impl Write for LateFile<'_> {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        self.file()?.write(bytes)
    }

    fn flush(&mut self) -> io::Result<()> {
        self.file()?.flush()
    }
}

/// What is exported: `runs` or `studies`, with the number that was typed.
fn asked(args: &Args) -> (&'static str, &str) {
    match (&args.study, &args.run) {
        (Some(study), _) => ("studies", study),
        (None, run) => ("runs", run.as_deref().unwrap_or_default()),
    }
}

fn from_server(server: &str, args: &Args, mut to: &mut dyn Write) -> anyhow::Result<()> {
    let (kind, id) = asked(args);
    let mut client = Client::new(server, Duration::from_secs(30))?;
    let path = format!(
        "/api/v1/{kind}/{}/labels?format={}",
        path_segment(id)?,
        args.format.word()
    );
    client.enter(None);
    client.download(&path, &mut to)
}

fn from_folder(args: &Args, to: &mut dyn Write) -> anyhow::Result<()> {
    let (kind, id) = asked(args);
    let what = if kind == "runs" { "run" } else { "study" };
    let unknown = || {
        BadInput(format!(
            "there is no {what} {id} in {}",
            args.data.display()
        ))
    };
    let number: i64 = id.parse().map_err(|_| unknown())?;
    tokio::runtime::Runtime::new()?.block_on(async {
        let store = open(&args.data).await?;
        let of = if kind == "runs" {
            let id = RunId(number);
            store.run(id).await?.ok_or_else(unknown)?;
            LabelsOf::Run(id)
        } else {
            let id = StudyId(number);
            store.study(id).await.map_err(|_| unknown())?;
            LabelsOf::Study(id)
        };
        let take = |bytes: Vec<u8>| {
            let written = to.write_all(&bytes);
            std::future::ready(written.map_err(|error| TableError::Unreadable(error.to_string())))
        };
        label_table::write(&store, of, args.format, take).await?;
        anyhow::Ok(())
    })
}

/// Opening a store makes what is not there, so a folder without one is refused first.
async fn open(data: &Path) -> anyhow::Result<Store> {
    if !data.join("stair.sqlite").exists() {
        return Err(BadInput(format!(
            "{} holds no data of a STAIR server",
            data.display()
        ))
        .into());
    }
    Store::open(data).await.map_err(|error| match error {
        store::StoreError::Held { .. } => {
            let told = format!(
                "a server holds {}; ask it instead: --server URL",
                data.display()
            );
            BadInput(told).into()
        }
        error => BadInput::from_error(error),
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_refused_table_leaves_nothing_and_an_empty_one_is_a_file() {
        let here = tempfile::tempdir().unwrap();
        let path = here.path().join("new/answers.csv");
        let refused = write_to(Some(&path), |_| Err(BadInput("no such run".into()).into()));
        assert_eq!(refused.unwrap_err().to_string(), "no such run");
        assert_eq!(std::fs::read_dir(here.path()).unwrap().count(), 0);

        write_to(Some(&path), |_| Ok(())).unwrap();
        assert_eq!(std::fs::read(&path).unwrap(), b"");
        let broken = write_to(Some(&path), |to| {
            to.write_all(b"half a tab")?;
            Err(BadInput("it broke off".into()).into())
        });
        broken.unwrap_err();
        let names = std::fs::read_dir(path.parent().unwrap()).unwrap();
        assert_eq!(names.count(), 1, "no half of a table beside the whole one");
        assert_eq!(std::fs::read(&path).unwrap(), b"");
    }
}
