//! `stair export`: a run's answers as a table.

use std::io::Write as _;
use std::path::{Path, PathBuf};
use std::process::ExitCode;
use std::time::Duration;

use anyhow::Context as _;
use clap::ValueEnum;
use store::{RunId, Store};

use super::BadInput;
use super::client::{Client, path_segment};
use crate::api::labels::{csv, json_lines};

/// Write a run's answers as a table, one row each, from a server or from its data folder
#[derive(Debug, clap::Args)]
#[command(after_help = "Examples:
  stair export --run 1 --out answers.csv
  stair export --run 1 --format jsonl --server http://127.0.0.1:8080")]
pub struct Args {
    /// The run's id, as its page's address has it
    #[arg(long, value_name = "ID")]
    run: String,
    /// A data folder that no server holds
    #[arg(long, value_name = "DIR", default_value = "data")]
    data: PathBuf,
    /// A server, instead of a data folder
    #[arg(long, value_name = "URL", conflicts_with = "data")]
    server: Option<String>,
    /// What to write
    #[arg(long, value_enum, default_value_t = Format::Csv)]
    format: Format,
    /// Where to [default: the terminal]
    #[arg(long, value_name = "FILE")]
    out: Option<PathBuf>,
}

/// The same rows and columns, written in two ways.
#[derive(Debug, Clone, Copy, ValueEnum)]
enum Format {
    /// Comma-separated, with a header line.
    Csv,
    /// One JSON object a line.
    Jsonl,
}

/// Runs the command.
///
/// # Errors
/// [`BadInput`] for an unknown run, a folder without data or held by a server; a file that
/// cannot be written.
pub fn run(args: &Args) -> anyhow::Result<ExitCode> {
    let bytes = match &args.server {
        Some(server) => from_server(server, args)?,
        None => from_folder(args)?,
    };
    match &args.out {
        Some(path) => std::fs::write(path, bytes)
            .with_context(|| format!("cannot write {}", path.display()))?,
        None => std::io::stdout()
            .write_all(&bytes)
            .context("cannot write to the terminal")?,
    }
    Ok(ExitCode::SUCCESS)
}

fn from_server(server: &str, args: &Args) -> anyhow::Result<Vec<u8>> {
    let format = match args.format {
        Format::Csv => "csv",
        Format::Jsonl => "jsonl",
    };
    let mut client = Client::new(server, Duration::from_secs(30))?;
    client.download(&format!(
        "/api/v1/runs/{}/labels?format={format}",
        path_segment(&args.run)?
    ))
}

fn from_folder(args: &Args) -> anyhow::Result<Vec<u8>> {
    let unknown = || {
        BadInput(format!(
            "there is no run {} in {}",
            args.run,
            args.data.display()
        ))
    };
    let id = RunId(args.run.parse().map_err(|_| unknown())?);
    let labels = tokio::runtime::Runtime::new()?.block_on(async {
        let store = open(&args.data).await?;
        store.run(id).await?.ok_or_else(unknown)?;
        anyhow::Ok(store.labels(id).await?)
    })?;
    Ok(match args.format {
        Format::Csv => csv(&labels),
        Format::Jsonl => json_lines(&labels),
    }
    .into_bytes())
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
