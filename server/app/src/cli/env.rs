//! `stair env`: a task for programs in any language, one JSON object a line each way.

use std::io::{self, BufRead, Write};
use std::process::ExitCode;

use domain::environment::{EnvError, EnvSpec, Environment, EpisodeEnd, TaskReward};
use lab::config::{find_task, plainly};
use serde::{Deserialize, Serialize};
use serde_json::Value;

use super::BadInput;

/// Drive a task from another program: JSON Lines on stdin, one answer a line on stdout
///
/// Every line is an object with one of
///   "spec": {}                 answered with the task's sizes and names
///   "reset": {"seed": 7}       answered with "observation"
///   "step": {"action": [...]}  answered with "observation", "task_reward", "success" and "end",
///                              which is null, "time_limit" or "terminal"
/// and, if wanted, "pose": true, which adds the "pose" of the state that the answer describes.
///
/// Components of an action are clamped to [-1, 1]. What does not fit (another length, no number,
/// an unknown key, a step before the first reset or after an episode's end) is answered with
/// {"error": "..."} and changes nothing. The end of the input ends the program.
#[derive(Debug, clap::Args)]
#[command(verbatim_doc_comment)]
#[command(after_help = "Examples:
  echo '{\"spec\":{}}' | stair env window-open
  printf '%s\\n' '{\"reset\":{\"seed\":7}}' '{\"step\":{\"action\":[0,0,1]}}' | stair env go-fetch-return
  python3 assets/examples/gymnasium_env.py push-green")]
pub struct Args {
    /// The task; `stair tasks` lists them
    task: String,
}

/// Runs the command.
///
/// # Errors
/// [`BadInput`] for a task that does not exist; a pipe that breaks.
#[expect(
    clippy::needless_pass_by_value,
    reason = "every command has this signature"
)]
pub fn run(args: Args) -> anyhow::Result<ExitCode> {
    let task = find_task(&args.task).map_err(BadInput::from_error)?;
    converse((task.make)(), io::stdin().lock(), io::stdout().lock())?;
    Ok(ExitCode::SUCCESS)
}

/// What a line asks for.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Request {
    spec: Option<Nothing>,
    reset: Option<Reset>,
    step: Option<Action>,
    #[serde(default)]
    pose: bool,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Nothing {}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Reset {
    seed: Value,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Action {
    action: Value,
}

/// What a line is answered with.
#[derive(Serialize)]
struct Answer {
    #[serde(flatten)]
    content: Content,
    #[serde(skip_serializing_if = "Option::is_none")]
    pose: Option<Vec<f32>>,
}

#[derive(Serialize)]
#[serde(untagged)]
enum Content {
    Spec(EnvSpec),
    Start {
        observation: Vec<f32>,
    },
    Step {
        observation: Vec<f32>,
        task_reward: TaskReward,
        success: bool,
        end: Option<EpisodeEnd>,
    },
    Refusal {
        error: String,
    },
}

/// Answers line after line until the input ends; each answer is flushed.
///
/// # Errors
/// Of the reader and the writer; nothing that a line says is one.
fn converse(
    environment: Box<dyn Environment>,
    mut reader: impl BufRead,
    mut writer: impl Write,
) -> io::Result<()> {
    let mut server = Server {
        environment,
        episode: Episode::None,
    };
    let mut line = Vec::new();
    while reader.read_until(b'\n', &mut line)? > 0 {
        let answer = server.answer(&line).unwrap_or_else(|error| Answer {
            content: Content::Refusal { error },
            pose: None,
        });
        serde_json::to_writer(&mut writer, &answer)?;
        writer.write_all(b"\n")?;
        writer.flush()?;
        line.clear();
    }
    Ok(())
}

/// How far the conversation is.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Episode {
    None,
    Running,
    Over,
}

struct Server {
    environment: Box<dyn Environment>,
    episode: Episode,
}

impl Server {
    fn answer(&mut self, line: &[u8]) -> Result<Answer, String> {
        let line = line.trim_ascii();
        let value: Value = serde_json::from_slice(line)
            .map_err(|error| format!("this line is no JSON: {}", misread(line, &error)))?;
        if !value.is_object() {
            return Err("this line is JSON, but no object with named fields".into());
        }
        let request = Request::deserialize(value).map_err(|error| misfit(&error))?;
        let content = match (request.spec, request.reset, request.step) {
            (Some(Nothing {}), None, None) => {
                if request.pose && self.episode == Episode::None {
                    return Err("there is no pose before the first reset".into());
                }
                Content::Spec(self.environment.spec().clone())
            }
            (None, Some(Reset { seed }), None) => {
                let seed = whole(&seed)?;
                self.episode = Episode::Running;
                let observation = self.environment.reset(seed);
                Content::Start { observation }
            }
            (None, None, Some(Action { action })) => self.step(&action)?,
            _ => return Err("a line holds one of \"spec\", \"reset\" and \"step\"".into()),
        };
        let pose = request.pose.then(|| self.environment.pose());
        Ok(Answer { content, pose })
    }

    fn step(&mut self, action: &Value) -> Result<Content, String> {
        let action = components(action)?;
        match self.episode {
            Episode::None => return Err("reset the task before its first step".into()),
            Episode::Over => return Err("the episode is over: reset before the next step".into()),
            Episode::Running => {}
        }
        let step = self.environment.step(&action).map_err(|error| {
            if matches!(error, EnvError::NotFinite { .. }) {
                self.episode = Episode::Over;
            }
            error.to_string()
        })?;
        if step.end.is_some() {
            self.episode = Episode::Over;
        }
        Ok(Content::Step {
            observation: step.observation,
            task_reward: step.task_reward,
            success: step.success,
            end: step.end,
        })
    }
}

/// What is wrong with a line that cannot be read, and where in it.
fn misread(line: &[u8], error: &serde_json::Error) -> String {
    if line.is_empty() {
        return "it is empty".into();
    }
    if error.is_eof() {
        return "it ends early".into();
    }
    let place = format!(" at line {} column {}", error.line(), error.column());
    let told = error.to_string();
    let what = told.strip_suffix(place.as_str()).unwrap_or(&told);
    format!("{what}, at column {}", error.column())
}

/// What does not fit, without the names that types have here.
fn misfit(error: &serde_json::Error) -> String {
    let told = error.to_string();
    match told.split_once(", expected struct ") {
        Some((found, _)) => format!("{found}, expected an object with named fields"),
        None => plainly(&told),
    }
}

fn whole(seed: &Value) -> Result<u64, String> {
    let most = u64::MAX;
    let told = || format!("\"seed\" is {seed}, but must be a whole number from 0 to {most}");
    seed.as_u64().ok_or_else(told)
}

/// The numbers of an action, each within its bounds.
fn components(action: &Value) -> Result<Vec<f32>, String> {
    let Some(components) = action.as_array() else {
        let told = format!("\"action\" is {action}, but must be a list of numbers");
        return Err(told);
    };
    let clamped = |(place, component): (usize, &Value)| {
        let number = component.as_f64();
        let number = number.map(|number| number.clamp(-1.0, 1.0) as f32);
        number.ok_or_else(|| format!("action[{place}] is {component}, but must be a number"))
    };
    components.iter().enumerate().map(clamped).collect()
}

#[cfg(test)]
mod tests {
    use serde_json::json;

    use super::*;

    /// The answers to `lines` on go-fetch-return: 16 numbers observed, 3 acted.
    fn answers(lines: &[&str]) -> Vec<Value> {
        let task = find_task("go-fetch-return").expect("a listed task");
        let mut said = Vec::new();
        converse((task.make)(), lines.join("\n").as_bytes(), &mut said).expect("memory holds");
        let said = String::from_utf8(said).expect("JSON is UTF-8");
        assert!(said.is_empty() || said.ends_with('\n'));
        said.lines()
            .map(|line| serde_json::from_str(line).expect("each answer is JSON"))
            .collect()
    }

    fn error(answer: &Value) -> &str {
        assert_eq!(answer.as_object().map(serde_json::Map::len), Some(1));
        answer["error"].as_str().unwrap_or_default()
    }

    const RESET: &str = r#"{"reset":{"seed":7}}"#;
    const STEP: &str = r#"{"step":{"action":[1,0,-1]}}"#;

    #[test]
    fn a_task_tells_its_sizes_and_plays_an_episode_to_its_end() {
        let mut lines = vec![r#"{"spec":{}}"#, RESET];
        lines.extend([STEP; 100]);
        let answers = answers(&lines);
        assert_eq!(answers[0]["observation_size"], 16);
        assert_eq!(answers[0]["action_size"], 3);
        assert_eq!(answers[1].as_object().map(serde_json::Map::len), Some(1));
        for (index, answer) in answers[2..].iter().enumerate() {
            assert_eq!(answer["observation"].as_array().map(Vec::len), Some(16));
            assert!(answer["task_reward"].is_f64() && answer["success"].is_boolean());
            let end = if index == 99 {
                json!("time_limit")
            } else {
                Value::Null
            };
            assert_eq!(answer["end"], end, "step {}", index + 1);
            assert!(answer.get("pose").is_none());
        }
    }

    #[test]
    fn the_same_seed_and_actions_are_answered_with_the_same_numbers() {
        let answers = answers(&[
            RESET,
            STEP,
            STEP,
            RESET,
            STEP,
            STEP,
            r#"{"reset":{"seed":8}}"#,
        ]);
        assert_eq!(answers[..3], answers[3..6]);
        assert_ne!(answers[0], answers[6]);
    }

    #[test]
    fn a_pose_is_added_where_it_is_asked_for() {
        let pose = |line: &str| line.replacen('{', r#"{"pose":true,"#, 1);
        let (reset, step, spec) = (pose(RESET), pose(STEP), pose(r#"{"spec":{}}"#));
        let answers = answers(&[&spec, &reset, &step, &spec]);
        assert!(error(&answers[0]).contains("before the first reset"));
        for answer in &answers[1..] {
            assert_eq!(answer["pose"].as_array().map(Vec::len), Some(9), "{answer}");
        }
        assert_eq!(answers[2]["pose"], answers[3]["pose"]);
    }

    #[test]
    fn a_large_action_counts_as_one_at_its_bounds() {
        let large = r#"{"step":{"action":[1e300,0,-7]}}"#;
        let answers = answers(&[RESET, STEP, RESET, large]);
        assert_eq!(answers[1], answers[3]);
    }

    #[test]
    fn what_does_not_fit_is_named_and_changes_nothing() {
        let wrong = [
            (r#"{"step":{"action":[1,0]}}"#, "3 numbers, got 2"),
            (r#"{"step":{"action":[1,0,null]}}"#, "action[2] is null"),
            (r#"{"step":{"action":"up"}}"#, "must be a list of numbers"),
            (r#"{"step":3}"#, "expected an object with named fields"),
            (r#"{"step":{"action":[1,0,1e999]}}"#, "out of range"),
            (r#"{"step":{"action":[1,0,NaN]}}"#, "no JSON"),
            (r#"{"step":{"action":[1,0,0],"n":2}}"#, "unknown field `n`"),
            (r#"{"stepp":{"action":[1,0,0]}}"#, "unknown field `stepp`"),
            (r#"{"reset":{}}"#, "missing field `seed`"),
            (
                r#"{"reset":{"seed":-1}}"#,
                "\"seed\" is -1, but must be a whole",
            ),
            (r#"{"pose":1,"spec":{}}"#, "expected true or false"),
            (r#"{"spec":{},"reset":{"seed":1}}"#, "one of"),
            ("{}", "one of"),
            ("[1]", "no object"),
            ("", "no JSON: it is empty"),
            ("{", "no JSON: it ends early"),
            ("hello", "no JSON: expected value, at column"),
        ];
        let mut lines = vec![RESET];
        lines.extend(wrong.map(|(line, _)| line));
        lines.push(STEP);
        let told = answers(&lines);
        for (answer, (line, word)) in told[1..].iter().zip(wrong) {
            assert!(error(answer).contains(word), "{line}: {answer}");
        }
        assert_eq!(told[told.len() - 1], answers(&[RESET, STEP])[1]);
    }

    #[test]
    fn a_step_needs_a_running_episode() {
        let told = answers(&[STEP, RESET, STEP]);
        assert!(error(&told[0]).contains("before its first step"));
        assert!(told[2]["error"].is_null());

        let mut lines = vec![RESET];
        lines.extend([STEP; 101]);
        lines.extend([RESET, STEP]);
        let told = answers(&lines);
        assert!(error(&told[101]).contains("the episode is over"));
        assert_eq!(told[102..], told[..2]);
    }

    #[test]
    fn bytes_that_are_no_text_are_answered_too() {
        let task = find_task("go-fetch-return").expect("a listed task");
        let mut said = Vec::new();
        converse((task.make)(), &b"\xff\xfe\n{\"spec\":{}}"[..], &mut said).expect("memory holds");
        let said = String::from_utf8(said).expect("JSON is UTF-8");
        assert_eq!(said.lines().count(), 2);
        assert!(said.starts_with("{\"error\""));
    }
}
