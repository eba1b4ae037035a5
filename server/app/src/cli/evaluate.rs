//! `stair evaluate`: how well a policy does on held-out episodes.

use std::process::ExitCode;

use lab::config::find_task;
use lab::evaluate::evaluate;
use lab::words::counted;
use serde_json::json;

use super::{BadInput, number};
use crate::policy::Policy;

/// Try a policy on held-out episodes.
#[derive(Debug, clap::Args)]
#[command(after_help = "Examples:
  stair evaluate window-open --policy expert --episodes 50
  stair evaluate window-open --policy random --episodes 200 --json
  stair evaluate go-fetch-return --policy data/train/go-fetch-return-stair-1")]
pub struct Args {
    /// The task; `stair tasks` lists them
    task: String,
    /// expert, random, a checkpoint file or a run's folder
    #[arg(long)]
    policy: String,
    /// How many episodes
    #[arg(long, default_value_t = 50, value_parser = clap::value_parser!(u32).range(1..=10_000))]
    #[arg(allow_negative_numbers = true)]
    episodes: u32,
    /// Of the episodes' poses and the policy's chance
    #[arg(long, default_value_t = 0, value_parser = number::whole::<u64>)]
    #[arg(allow_negative_numbers = true)]
    seed: u64,
    /// Standard deviation of noise added to each action
    #[arg(
        long,
        default_value_t = 0.0,
        value_name = "SIGMA",
        allow_negative_numbers = true
    )]
    noise: f64,
    /// One JSON object instead of a sentence
    #[arg(long)]
    json: bool,
}

/// Runs the command.
///
/// # Errors
/// [`BadInput`] for names that do not exist; whatever the simulation refuses.
#[expect(
    clippy::needless_pass_by_value,
    reason = "every command has this signature"
)]
pub fn run(args: Args) -> anyhow::Result<ExitCode> {
    if !(args.noise >= 0.0 && args.noise.is_finite()) {
        return Err(BadInput(format!("--noise is {}, but must be 0 or more", args.noise)).into());
    }
    let task = find_task(&args.task).map_err(BadInput::from_error)?;
    let policy = Policy::open(task, &args.policy, args.noise, args.seed)?;
    let trial = evaluate(task, args.episodes, args.seed, &mut |observations, t| {
        policy.act(observations, t)
    })?;
    let (success, mean, std) = (
        trial.success_rate(),
        trial.return_mean(),
        trial.return_std(),
    );
    let median = trial.first_success_median();
    if args.json {
        println!(
            "{}",
            json!({
                "task": args.task, "policy": args.policy, "episodes": args.episodes, "seed": args.seed,
                "success_rate": success, "return_mean": mean, "return_std": std, "first_success_median": median,
            })
        );
    } else {
        let first = median.map_or_else(|| "never".to_owned(), |m| format!("at step {m} (median)"));
        println!(
            "{} on {}: success {success:.3} over {}, return {mean:.1} ± {std:.1}, first success {first}",
            args.policy,
            args.task,
            counted(args.episodes.into(), "episode", "episodes")
        );
    }
    Ok(ExitCode::SUCCESS)
}
