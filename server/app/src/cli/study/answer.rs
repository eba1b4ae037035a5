//! A labeler by script, with a known model of stages: answers a study as people do, by an
//! invitation of its own and the public API.

use anyhow::{Context as _, bail};
use domain::random::{Rng, Stream};
use domain::teacher::{Judge, TeacherSettings};
use lab::words::counted;
use serde_json::{Value, json};

use super::super::client::Client;
use super::super::teach::{Lease, TaskRewards, new_token, preference, same_stage};
use super::super::train::judge;
use super::super::{number, say};
use super::remote::{MOST_LABELERS, Which};

/// Questions asked for at once: as many as a person's page may have.
const LEASES: u32 = 20;

/// Answer a study by script, as invited labelers who know the true stages and rewards
#[derive(Debug, clap::Args)]
#[command(after_help = "Examples:
  stair study answer 1 --labelers 3 --error 0.1

Shows what figures to expect before people are invited. Preferences follow the task reward, the
question of stages the true stages; only tasks that know their stages have an answer to that.")]
pub(super) struct Args {
    #[command(flatten)]
    which: Which,
    /// How many labelers
    #[arg(
        long,
        value_name = "N",
        default_value_t = 1,
        allow_negative_numbers = true
    )]
    #[arg(value_parser = clap::value_parser!(u32).range(1..=MOST_LABELERS))]
    labelers: u32,
    /// Share of answers that are wrong, 0 to 0.5
    #[arg(long, default_value_t = 0.0, allow_negative_numbers = true)]
    error: f64,
    /// Of the wrong answers
    #[arg(long, default_value_t = 1, value_parser = number::whole::<u64>)]
    #[arg(allow_negative_numbers = true)]
    seed: u64,
}

pub(super) fn run(args: &Args) -> anyhow::Result<()> {
    if !(0.0..=0.5).contains(&args.error) {
        let told = format!("--error is {}, but must be from 0 to 0.5", args.error);
        return Err(super::BadInput(told).into());
    }
    let path = format!("{}/invitations", args.which.path()?);
    let mut researcher = args.which.server.client()?;
    let request = json!({"count": args.labelers});
    let links = researcher.post(&path, &request)?;
    let mut n = 0_u32;
    for (number, link) in (0..).zip(links.as_array().into_iter().flatten()) {
        let link = link["link"].as_str().unwrap_or_default();
        let code = link.split_once("code=").map(|(_, code)| code);
        let code = code.context("the server gave no link")?;
        let mut labeler = args.which.server.client()?;
        labeler.sign_in("/api/v1/join", &json!({"code": code, "agrees": true}))?;
        let settings = TeacherSettings::default();
        let script = Script {
            judge: judge("oracle", args.seed, &settings)?,
            error: args.error,
            rng: Rng::new(args.seed, Stream::Teacher, number),
        };
        n += script.answer_all(&mut researcher, &mut labeler)?;
    }
    say(&format!(
        "{} answered {} of study {}.\n",
        counted(args.labelers.into(), "labeler", "labelers"),
        counted(n.into(), "question", "questions"),
        args.which.study
    ))
}

/// One labeler.
struct Script {
    judge: Box<dyn Judge>,
    error: f64,
    rng: Rng,
}

impl Script {
    /// All parts to their ends; returns how many questions that were.
    fn answer_all(mut self, researcher: &mut Client, labeler: &mut Client) -> anyhow::Result<u32> {
        let seat = labeler.get("/api/v1/seat")?;
        let mut n = 0;
        for part in seat["parts"].as_array().into_iter().flatten() {
            let run = format!("/api/v1/runs/{}", part["run_id"]);
            let mut truth = researcher.clone();
            truth.authorize(new_token(researcher, &run)?);
            loop {
                let told = labeler.post(&format!("{run}/leases"), &json!({"count": LEASES}))?;
                let leases: Vec<Lease> = serde_json::from_value(told["leases"].clone())
                    .context("the server's leases are of another kind")?;
                if leases.is_empty() {
                    let kind = told["state"]["kind"].as_str().unwrap_or_default();
                    if kind != "done" {
                        bail!(
                            "the server offers no questions: {}",
                            told["state"]["message"]
                        );
                    }
                    break;
                }
                for lease in leases {
                    let path = format!("/api/v1/queries/{}/task-rewards", lease.query_id);
                    let truth = serde_json::from_value(truth.get(&path)?)
                        .context("the task rewards are of another kind")?;
                    let body = self.say(&lease, truth)?;
                    labeler.put(&format!("/api/v1/leases/{}/answer", lease.lease_id), &body)?;
                    n += 1;
                }
            }
        }
        Ok(n)
    }

    /// The answer, or with some probability its opposite.
    fn say(&mut self, lease: &Lease, truth: TaskRewards) -> anyhow::Result<Value> {
        let mut body = match lease.question.as_str() {
            "preference" => preference(self.judge.as_ref(), truth),
            "same_stage" => same_stage(&truth),
            other => bail!("the server asks '{other}', which this program cannot answer"),
        };
        if self.rng.chance(self.error) {
            let opposite = match body["answer"].as_str().unwrap_or_default() {
                "left" => "right",
                "right" => "left",
                "same" => "different",
                "different" => "same",
                other => other,
            };
            body["answer"] = opposite.into();
        }
        Ok(body)
    }
}
