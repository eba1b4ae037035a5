//! Returns of chance and of doing nothing, per task:
//! `cargo run -p sim --example returns TASK [EPISODES]`.
//!
//! Prints mean, standard deviation, least and greatest return of both policies, and how fast the
//! last numbers of a pose, a walking robot's joints, move on average under chance, per second.

use domain::random::{Rng, Stream};
use sim::expert::{Rollout, rollout};
use sim::tasks::task;

fn main() {
    let mut arguments = std::env::args().skip(1);
    let name = arguments.next().expect("the name of a task");
    let n_episodes = arguments
        .next()
        .map_or(20, |n| n.parse().expect("a number"));
    let task = task(&name).unwrap_or_else(|error| panic!("{error}"));
    let spec = (task.spec)();
    let mut environment = (task.make)();
    for is_random in [true, false] {
        let rollouts: Vec<Rollout> = (0..n_episodes)
            .map(|seed| {
                let mut rng = Rng::new(seed, Stream::Rollout, 0);
                let mut act = |_: &[f32]| -> Vec<f32> {
                    let mut draw = || rng.uniform_in(-1.0, 1.0) as f32;
                    let draws = (0..spec.action_size).map(|_| draw());
                    draws.map(|a| if is_random { a } else { 0.0 }).collect()
                };
                rollout(environment.as_mut(), seed, &mut act).expect("finite")
            })
            .collect();
        let mut returns: Vec<f64> = rollouts.iter().map(|r| r.task_return).collect();
        returns.sort_by(f64::total_cmp);
        let (mean, std) = moments(&returns);
        let policy = if is_random { "chance" } else { "nothing" };
        println!(
            "{name} {policy}: {mean:.2} ± {std:.2}, {:.2} to {:.2}",
            returns[0],
            returns[returns.len() - 1]
        );
        if is_random {
            println!(
                "joint speed {:.3}/s",
                joint_speed(&rollouts, spec.control_period_s)
            );
            modes(&returns);
        }
    }
}

/// Returns on either side of 250: quadrupeds either stand or lie.
fn modes(returns: &[f64]) {
    let (high, low): (Vec<f64>, Vec<f64>) = returns.iter().partition(|r| **r > 250.0);
    if !high.is_empty() {
        println!(
            "above 250: share {:.3}, mean {:.1}; the others: mean {:.1}",
            high.len() as f64 / returns.len() as f64,
            moments(&high).0,
            moments(&low).0
        );
    }
}

fn joint_speed(rollouts: &[Rollout], period_s: f64) -> f64 {
    let (mut sum, mut n) = (0.0, 0.0);
    for poses in rollouts.iter().flat_map(|r| r.poses.windows(2)) {
        let first = poses[0].len() - if poses[0].len() == 23 { 16 } else { 6 };
        for (a, b) in poses[0][first..].iter().zip(&poses[1][first..]) {
            sum += f64::from((b - a).abs()) / period_s;
            n += 1.0;
        }
    }
    sum / n
}

fn moments(numbers: &[f64]) -> (f64, f64) {
    let n = numbers.len() as f64;
    let mean = numbers.iter().sum::<f64>() / n;
    let variance = numbers.iter().map(|x| (x - mean).powi(2)).sum::<f64>() / n;
    (mean, variance.sqrt())
}
