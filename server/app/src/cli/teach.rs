//! `stair teach`: a scripted teacher that answers over HTTP, as a person's page would.

use std::process::ExitCode;
use std::time::{Duration, Instant};

use anyhow::Context as _;
use domain::answer::{Preference, Which};
use domain::environment::TaskReward;
use domain::episode::{EpisodeId, Segment, SegmentRecord};
use domain::query::{OfferedQuery, QueryKey};
use domain::teacher::{Judge, TeacherSettings};
use indicatif::{ProgressBar, ProgressStyle};
use lab::words::counted;
use serde::Deserialize;
use serde_json::{Value, json};

use super::client::{Client, Refused, path_segment};
use super::number;

/// Queries asked for at once.
const LEASES: u32 = 50;
/// Pause while the agent collects experience or fits its reward.
const WAIT: Duration = Duration::from_millis(200);
/// How long a server may be away in the middle, for example while it is restarted.
const PATIENCE: Duration = Duration::from_mins(2);

/// Answer a run's queries over HTTP with a scripted teacher, until the run needs no more
#[derive(Debug, clap::Args)]
#[command(after_help = "Examples:
  stair teach --server http://127.0.0.1:8080 --run 1 --teacher oracle
  stair teach --server http://127.0.0.1:8080 --run 1 --teacher mistaken --seed 3")]
pub struct Args {
    /// The server's address
    #[arg(long, value_name = "URL", default_value = "http://127.0.0.1:8080")]
    server: String,
    /// The run's id, as its page's address has it
    #[arg(long, value_name = "ID")]
    run: String,
    /// Who answers, as irregular as the run's settings say: oracle, mistaken, inconsistent, myopic,
    /// noisy, equal, skip, coin
    #[arg(long, default_value = "oracle")]
    teacher: String,
    /// A teacher token of the run [default: STAIR_TEACHER_TOKEN, or one that the server gives where
    /// it wants no token of its own; else POST /api/v1/runs/ID/teacher-tokens with the server's
    /// token makes one]
    #[arg(long)]
    token: Option<String>,
    /// Of the teacher's mistakes [default: the run's]
    #[arg(long, value_parser = number::whole::<u64>, allow_negative_numbers = true)]
    seed: Option<u64>,
}

/// Runs the command.
///
/// # Errors
/// [`super::BadInput`] for a server that cannot be reached, an unknown run or teacher, a wrong token;
/// anything else that the server refuses.
pub fn run(args: Args) -> anyhow::Result<ExitCode> {
    let regular = TeacherSettings::default();
    super::train::judge(&args.teacher, 0, &regular)?; // a wrong name is said before anything is sent
    let mut client = Client::new(&args.server, PATIENCE)?;
    let run = format!("/api/v1/runs/{}", path_segment(&args.run)?);
    let given = args
        .token
        .or_else(|| std::env::var("STAIR_TEACHER_TOKEN").ok());
    let is_given = given.is_some();
    if let Some(token) = given {
        client.authorize(token); // first of all: some servers tell nothing without
    }
    let told = client.get(&run)?;
    if !is_given {
        let token = new_token(&mut client, &run)?;
        client.authorize(token);
    }
    let seed = args.seed.or(told["seed"].as_u64()).unwrap_or_default();
    // As irregular as the run's settings say; a server of before they were told knows no others.
    let settings: Option<TeacherSettings> =
        serde_json::from_value(told["teacher_settings"].clone())
            .context("the run's teacher settings are of another kind")?;
    let settings = settings.unwrap_or(regular);
    let mut teacher = Remote {
        client,
        run,
        judge: super::train::judge(&args.teacher, seed, &settings)?,
        n_answered: 0,
    };
    let started = Instant::now();
    let end = teacher.answer_all()?;
    println!(
        "Answered {} in {:.0} s. {end}",
        counted(teacher.n_answered.into(), "query", "queries"),
        started.elapsed().as_secs_f64()
    );
    Ok(ExitCode::SUCCESS)
}

pub(super) fn new_token(client: &mut Client, run: &str) -> anyhow::Result<String> {
    let told = client.post(&format!("{run}/teacher-tokens"), &json!({}))?;
    told["token"]
        .as_str()
        .map(str::to_owned)
        .context("the server gave no teacher token")
}

/// A judge at the end of a wire.
struct Remote {
    client: Client,
    run: String,
    judge: Box<dyn Judge>,
    n_answered: u32,
}

/// The part of a lease that a program needs.
#[derive(Deserialize)]
#[expect(clippy::struct_field_names, reason = "the names of the API's fields")]
pub(super) struct Lease {
    pub(super) lease_id: Id,
    pub(super) query_id: Id,
    pub(super) question: String,
}

/// Ids are opaque: numbers or strings.
#[derive(Deserialize)]
#[serde(untagged)]
pub(super) enum Id {
    Number(i64),
    Text(String),
}

impl std::fmt::Display for Id {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Self::Number(number) => write!(f, "{number}"),
            Self::Text(text) => f.write_str(text),
        }
    }
}

/// Ground truth about a query, as this teacher's sides show it.
#[derive(Deserialize)]
pub(super) struct TaskRewards {
    left: Vec<f64>,
    right: Vec<f64>,
    left_is: Which,
    session: u32,
    index: u32,
    same_stage: Option<bool>,
    typical_reward: Option<f64>,
}

impl Remote {
    /// Answers whatever is offered until nothing will be; says how it ended.
    fn answer_all(&mut self) -> anyhow::Result<String> {
        let bar = ProgressBar::new(0);
        if let Ok(style) = ProgressStyle::with_template("{bar:30} {pos}/{len} answers  {msg}") {
            bar.set_style(style);
        }
        let mut has_said_why = false;
        loop {
            let told = self
                .client
                .post(&format!("{}/leases", self.run), &json!({"count": LEASES}))?;
            show(&bar, &told);
            let leases: Vec<Lease> = serde_json::from_value(told["leases"].clone())
                .context("the server's leases are of another kind")?;
            for lease in &leases {
                self.answer(lease)?;
                bar.inc(1);
            }
            let state = &told["state"];
            let message = state["message"].as_str().unwrap_or_default().to_owned();
            match state["kind"].as_str() {
                _ if !leases.is_empty() => {}
                Some("done") => {
                    bar.finish_and_clear();
                    return Ok(message);
                }
                Some("failed") => anyhow::bail!("the run cannot go on: {message}"),
                _ => {
                    let hold_up = hold_up(state).filter(|_| !has_said_why);
                    if let Some(hold_up) = hold_up {
                        bar.suspend(|| eprintln!("{hold_up}"));
                        has_said_why = true;
                    }
                    std::thread::sleep(WAIT);
                }
            }
        }
    }

    fn answer(&mut self, lease: &Lease) -> anyhow::Result<()> {
        let truth = self
            .client
            .get(&format!("/api/v1/queries/{}/task-rewards", lease.query_id))?;
        let truth: TaskRewards =
            serde_json::from_value(truth).context("the task rewards are of another kind")?;
        let body = match lease.question.as_str() {
            "preference" => preference(self.judge.as_ref(), truth),
            "same_stage" => same_stage(&truth),
            other => anyhow::bail!(
                "the server asks '{other}', which this version of the program cannot answer"
            ),
        };
        match self
            .client
            .put(&format!("/api/v1/leases/{}/answer", lease.lease_id), &body)
        {
            Ok(_) => self.n_answered += 1,
            // Somebody else answered it first: theirs counts.
            Err(error)
                if error
                    .downcast_ref::<Refused>()
                    .is_some_and(|r| matches!(r.status, 409 | 410)) => {}
            Err(error) => return Err(error),
        }
        Ok(())
    }
}

/// What others have to do before there is anything to answer, in words; `None` where the run only
/// needs its time.
fn hold_up(state: &Value) -> Option<String> {
    if !matches!(state["kind"].as_str(), Some("held" | "paused")) {
        return None;
    }
    let message = state["message"].as_str().unwrap_or_default();
    let until = state["until"].as_str();
    let until = until.map(|until| format!(" The first may come back at {until}."));
    Some(format!("Waiting. {message}{}", until.unwrap_or_default()))
}

fn show(bar: &ProgressBar, told: &Value) {
    let progress = &told["progress"];
    if let (Some(answered), Some(budget)) =
        (progress["answered"].as_u64(), progress["budget"].as_u64())
    {
        bar.set_length(budget);
        bar.set_position(answered);
    }
    bar.set_message(
        told["state"]["message"]
            .as_str()
            .unwrap_or_default()
            .to_owned(),
    );
}

pub(super) fn preference(judge: &dyn Judge, truth: TaskRewards) -> Value {
    let left_is = truth.left_is;
    let (first, second) = match left_is {
        Which::First => (truth.left, truth.right),
        Which::Second => (truth.right, truth.left),
    };
    let query = OfferedQuery {
        key: QueryKey {
            session: truth.session,
            index: truth.index,
        },
        first: record(&first),
        second: record(&second),
        asks_same_stage: false,
        disagreement: None,
        stage_gap: None,
        typical_reward: truth.typical_reward.map(TaskReward),
    };
    match judge.judge(&query) {
        Some(Preference::Prefer(which)) => {
            json!({"answer": if which == left_is { "left" } else { "right" }})
        }
        Some(Preference::Equal) => json!({"answer": "equal"}),
        None => json!({"answer": "skip", "reason": "the teacher cannot tell"}),
    }
}

pub(super) fn same_stage(truth: &TaskRewards) -> Value {
    match truth.same_stage {
        Some(true) => json!({"answer": "same"}),
        Some(false) => json!({"answer": "different"}),
        None => json!({"answer": "skip", "reason": "the task does not know its stages"}),
    }
}

/// What a judge looks at: the rewards. Where the segment lies is not known out here.
fn record(task_rewards: &[f64]) -> SegmentRecord {
    SegmentRecord {
        segment: Segment {
            episode: EpisodeId(0),
            start: 0,
            len: task_rewards.len() as u32,
        },
        poses: Vec::new(),
        task_rewards: task_rewards.iter().copied().map(TaskReward).collect(),
        stages: Vec::new(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use domain::teacher::Oracle;

    fn truth(left: &[f64], right: &[f64], left_is: Which) -> TaskRewards {
        let (left, right) = (left.to_vec(), right.to_vec());
        TaskRewards {
            left,
            right,
            left_is,
            session: 0,
            index: 0,
            same_stage: None,
            typical_reward: None,
        }
    }

    #[test]
    fn the_side_with_the_larger_return_is_pressed_and_a_tie_goes_to_the_first_segment() {
        let pressed = |t: TaskRewards| preference(&Oracle, t)["answer"].clone();
        assert_eq!(
            pressed(truth(&[1.0, 2.0], &[0.0, 9.0], Which::First)),
            "right"
        );
        assert_eq!(
            pressed(truth(&[1.0, 2.0], &[0.0, 9.0], Which::Second)),
            "right"
        );
        assert_eq!(pressed(truth(&[1.0], &[1.0], Which::First)), "left");
        assert_eq!(pressed(truth(&[1.0], &[1.0], Which::Second)), "right");
    }

    #[test]
    fn a_wait_for_others_is_told_and_one_for_the_agent_is_not() {
        let held = json!({
            "kind": "held", "message": "Others hold them.", "until": "2026-12-01T13:40:00Z",
        });
        assert_eq!(
            hold_up(&held).as_deref(),
            Some("Waiting. Others hold them. The first may come back at 2026-12-01T13:40:00Z.")
        );
        let waiting = json!({"kind": "waiting", "message": "training", "until": null});
        assert_eq!(hold_up(&waiting), None);
    }

    #[test]
    fn what_is_close_or_poor_is_measured_by_how_the_agent_does() {
        let settings = domain::teacher::TeacherSettings::default();
        let judge = |name: &str| domain::teacher::judge(name, 1, &settings).expect("a teacher");
        let pressed = |name: &str, left: f64, right: f64| {
            let mut truth = truth(&[left], &[right], Which::First);
            truth.typical_reward = Some(8.0);
            preference(judge(name).as_ref(), truth)["answer"].clone()
        };
        assert_eq!(pressed("equal", 5.0, 5.01), "equal");
        assert_eq!(pressed("equal", 5.0, 7.0), "right");
        assert_eq!(pressed("skip", 0.001, 0.002), "skip");
        assert_eq!(pressed("skip", 5.0, 7.0), "right");
    }
}
