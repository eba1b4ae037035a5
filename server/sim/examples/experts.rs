//! How scripted experts, noisy experts and random actions do here and in the original:
//! `cargo run --release -p sim --example experts [EPISODES] [TASK]`.
//!
//! Plays 50 episodes of the expert and 200 of the others unless told how many.

use sim::golden::figures::{Actor, REFERENCES, measure};
use sim::tasks::task;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let mut arguments = std::env::args().skip(1);
    let n_episodes: Option<u64> = arguments.next().map(|text| text.parse()).transpose()?;
    let only = arguments.next();
    println!("task          actor         success (there)   return (there)   first (there)");
    for reference in REFERENCES {
        if only.as_ref().is_some_and(|only| only != reference.task) {
            continue;
        }
        let task = task(reference.task)?;
        for (actor, name, usual) in [
            (Actor::Expert, "expert", 50),
            (Actor::NoisyExpert, "noisy expert", 200),
            (Actor::Random, "random", 200),
        ] {
            let here = measure(task, actor, n_episodes.unwrap_or(usual))?;
            let there = reference.figures[actor as usize];
            println!(
                "{:<13} {name:<13} {:>7.3} ({:>5.2})   {:>6.0} ({:>5.0})   {:>5.0} ({:>5.0})  {}",
                task.name,
                here.success,
                there.success,
                here.task_return,
                there.task_return,
                here.first_success,
                there.first_success,
                reference.complaints(actor, here).join("; ")
            );
        }
    }
    Ok(())
}
