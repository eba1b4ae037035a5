//! Studies on a server: prepare, open, invite, look, close.

use std::fmt::Write as _;
use std::path::PathBuf;
use std::time::Duration;

use anyhow::{Context as _, bail};
use indicatif::{ProgressBar, ProgressStyle};
use lab::words::counted;
use serde_json::{Value, json};

use super::super::client::{Client, path_segment};
use super::super::export::write_to;
use super::super::say;
use super::read;
use crate::api::studies::DAYS;
use crate::label_table::TableFormat;

/// How long a server may be away in the middle.
const PATIENCE: Duration = Duration::from_mins(2);
/// Labelers that are invited at once.
pub(super) const MOST_LABELERS: i64 = 10_000;
/// Where a server is unless somebody says otherwise.
const HERE: &str = "http://127.0.0.1:8080";
/// How often the number of drawn clips is asked for.
const LOOK: Duration = Duration::from_millis(500);

/// The server and one of its studies
#[derive(Debug, clap::Args)]
pub(super) struct Which {
    /// The study's number, as its page's address has it
    #[arg(value_name = "ID")]
    pub(super) study: String,
    #[command(flatten)]
    pub(super) server: Server,
}

/// The server
#[derive(Debug, clap::Args)]
pub(super) struct Server {
    /// The server's address
    #[arg(long, value_name = "URL", default_value = HERE)]
    pub(super) server: String,
    /// The server's token, where it listens on a network [default: STAIR_TOKEN]
    #[arg(long)]
    pub(super) token: Option<String>,
}

impl Server {
    pub(super) fn client(&self) -> anyhow::Result<Client> {
        let mut client = Client::new(&self.server, PATIENCE)?;
        client.enter(self.token.as_deref());
        Ok(client)
    }

    /// The command that asks the same server; one that is where it always is needs no naming.
    fn next(&self, command: &str) -> String {
        let server = self.server.trim_end_matches('/');
        if server == HERE {
            command.to_owned()
        } else {
            format!("{command} --server {server}")
        }
    }
}

impl Which {
    pub(super) fn path(&self) -> anyhow::Result<String> {
        Ok(format!("/api/v1/studies/{}", path_segment(&self.study)?))
    }
}

/// Choose a study's segments and draw its clips on a running server, with progress
#[derive(Debug, clap::Args)]
#[command(after_help = "Examples:
  stair study prepare task-1-demo
  stair study prepare my-study.toml --server http://127.0.0.1:8080

A preparation that is interrupted goes on by itself when the server starts again.")]
pub(super) struct PrepareArgs {
    /// A file, or the name of a ready study: task-1, task-1-demo, task-2, task-2-demo
    file: PathBuf,
    /// Let labelers answer as soon as it is ready
    #[arg(long)]
    open: bool,
    #[command(flatten)]
    server: Server,
}

pub(super) fn prepare(args: &PrepareArgs) -> anyhow::Result<()> {
    let read = read(&args.file)?;
    let mut client = args.server.client()?;
    let request = match read.ready {
        Some(name) => json!({"name": name}),
        None => json!({"text": read.text, "folder": read.folder}),
    };
    let mut study = client.post("/api/v1/studies", &request)?;
    let id = study["id"].as_i64().context("the server gave no number")?;
    let path = format!("/api/v1/studies/{id}");
    let bar = ProgressBar::new(0);
    if let Ok(style) = ProgressStyle::with_template("{bar:30} {pos}/{len} pairs drawn  {msg}") {
        bar.set_style(style);
    }
    while study["state"] == "preparing" {
        bar.set_length(study["n_items"].as_u64().unwrap_or(0));
        bar.set_position(study["n_drawn"].as_u64().unwrap_or(0));
        std::thread::sleep(LOOK);
        study = client.get(&path)?;
    }
    bar.finish_and_clear();
    let message = study["message"].as_str().unwrap_or_default();
    if study["state"] == "failed" {
        bail!(
            "study {id} cannot be prepared: {message}. `POST {path}/retry`, or the button on its page, tries again"
        );
    }
    if args.open {
        client.post(&format!("{path}/open"), &json!({}))?;
    }
    let address = format!("{}/studies/{id}", args.server.server.trim_end_matches('/'));
    let n_pairs = study["n_items"].as_u64().unwrap_or_default();
    let action = if args.open { "invite" } else { "open" };
    say(&format!(
        "Study {id} is ready: {}, {address}\nNext: {}\n",
        counted(n_pairs, "pair", "pairs"),
        args.server.next(&format!("stair study {action} {id}"))
    ))
}

/// Let labelers answer
#[derive(Debug, clap::Args)]
pub(super) struct OpenArgs {
    #[command(flatten)]
    which: Which,
}

pub(super) fn open(args: &OpenArgs) -> anyhow::Result<()> {
    let path = args.which.path()?;
    args.which
        .server
        .client()?
        .post(&format!("{path}/open"), &json!({}))?;
    let id = &args.which.study;
    let next = args.which.server.next(&format!("stair study invite {id}"));
    say(&format!("Study {id} is open.\nNext: {next}\n"))
}

/// Make links for labelers; each works once
#[derive(Debug, clap::Args)]
#[command(after_help = "Examples:
  stair study invite 1 --labelers 3
  stair study invite 1 --again 2     a new link for labeler 2, who goes on where they were")]
pub(super) struct InviteArgs {
    #[command(flatten)]
    which: Which,
    /// How many
    #[arg(
        long,
        value_name = "N",
        default_value_t = 1,
        allow_negative_numbers = true
    )]
    #[arg(value_parser = clap::value_parser!(u32).range(1..=MOST_LABELERS))]
    labelers: u32,
    /// Days for which the links work
    #[arg(long, default_value_t = DAYS.0, allow_negative_numbers = true)]
    #[arg(value_parser = clap::value_parser!(u32).range(1..=i64::from(DAYS.1)))]
    days: u32,
    /// Instead: a new link for the labeler of this number
    #[arg(
        long,
        value_name = "NUMBER",
        conflicts_with = "labelers",
        allow_negative_numbers = true
    )]
    again: Option<u32>,
}

pub(super) fn invite(args: &InviteArgs) -> anyhow::Result<()> {
    let path = format!("{}/invitations", args.which.path()?);
    let request = json!({"count": args.labelers, "days": args.days, "seat": args.again});
    let links = args.which.server.client()?.post(&path, &request)?;
    for link in links.as_array().into_iter().flatten() {
        let text = link["link"].as_str().unwrap_or_default();
        say(&format!("labeler {}: {text}\n", link["seat"]))?;
    }
    Ok(())
}

/// Say how far a study is, labeler by labeler
#[derive(Debug, clap::Args)]
pub(super) struct StatusArgs {
    #[command(flatten)]
    which: Which,
    /// As JSON
    #[arg(long)]
    json: bool,
}

pub(super) fn status(args: &StatusArgs) -> anyhow::Result<()> {
    let study = args.which.server.client()?.get(&args.which.path()?)?;
    if args.json {
        return say(&format!("{study}\n"));
    }
    say(&described(&study))
}

fn described(study: &Value) -> String {
    let text = |key: &str| study[key].as_str().unwrap_or_default().to_owned();
    let mut told = format!(
        "{}\n  {}: {}\n  {} of {} pairs drawn\n",
        text("title"),
        text("state"),
        text("message"),
        study["n_drawn"],
        study["n_items"]
    );
    for seat in study["seats"].as_array().into_iter().flatten() {
        let state = seat["state"].as_str().unwrap_or_default();
        let (n, of) = (&seat["answered"], &seat["budget"]);
        // Writing to a String cannot fail.
        let _ = writeln!(
            told,
            "  labeler {}: {state}, {n} of {of} answers",
            seat["number"]
        );
    }
    told
}

/// Write a study's answers as a table, one row each, from a running server
#[derive(Debug, clap::Args)]
#[command(after_help = "Examples:
  stair study export 1 --out answers.csv
  stair study export 1 --format parquet --out answers.parquet

Methods are in it once the study is closed. A data folder that no server holds is read by
`stair export --study`.")]
pub(super) struct ExportArgs {
    #[command(flatten)]
    which: Which,
    /// What to write
    #[arg(long, value_enum, default_value_t = TableFormat::Csv)]
    format: TableFormat,
    /// Where to [default: the terminal]
    #[arg(long, value_name = "FILE")]
    out: Option<PathBuf>,
}

pub(super) fn export(args: &ExportArgs) -> anyhow::Result<()> {
    let path = format!(
        "{}/labels?format={}",
        args.which.path()?,
        args.format.word()
    );
    let mut client = args.which.server.client()?;
    write_to(args.out.as_deref(), |mut to| {
        client.download(&path, &mut to)
    })
}

/// Take no more answers, and tell from now on which method chose which pair
#[derive(Debug, clap::Args)]
pub(super) struct CloseArgs {
    #[command(flatten)]
    which: Which,
}

pub(super) fn close(args: &CloseArgs) -> anyhow::Result<()> {
    let path = args.which.path()?;
    args.which
        .server
        .client()?
        .post(&format!("{path}/close"), &json!({}))?;
    let id = &args.which.study;
    let next = args.which.server.next(&format!("stair study export {id}"));
    say(&format!(
        "Study {id} is closed.\nNext: {next} --out answers.csv\n"
    ))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_next_command_asks_the_same_server() {
        let next = |server: &str| {
            let (server, token) = (server.to_owned(), None);
            Server { server, token }.next("stair study open 1")
        };
        assert_eq!(next(HERE), "stair study open 1");
        assert_eq!(
            next("http://127.0.0.1:9000/"),
            "stair study open 1 --server http://127.0.0.1:9000"
        );
    }

    #[test]
    fn a_study_is_described_with_its_labelers() {
        let told = described(&json!({
            "title": "Which?", "state": "open", "message": "labelers can answer", "n_drawn": 22, "n_items": 22,
            "seats": [{"number": 1, "state": "answering", "answered": 3, "budget": 23}],
        }));
        assert!(
            told.contains("labeler 1: answering, 3 of 23 answers"),
            "{told}"
        );
    }
}
