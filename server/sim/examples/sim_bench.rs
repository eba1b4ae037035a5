//! Control steps per second of every task, one thread, CPU time:
//! `cargo run --release -p sim --example sim_bench [SECONDS]`.
//!
//! Each task plays whole episodes, resets and the policy's own cost included, once with random
//! actions and once with its expert's, if it has one: contacts make the second one slower.

use cpu_time::ThreadTime;
use domain::random::{Rng, Stream};
use sim::tasks::{Task, tasks};

fn main() {
    let seconds = std::env::args()
        .nth(1)
        .and_then(|text| text.parse().ok())
        .unwrap_or(2.0);
    println!("task               random steps/s   expert steps/s");
    for task in tasks() {
        let mut rng = Rng::new(1, Stream::Rollout, 0);
        let size = (task.spec)().action_size;
        let random = steps_per_second(task, seconds, &mut |_| {
            (0..size)
                .map(|_| rng.uniform_in(-1.0, 1.0) as f32)
                .collect()
        });
        let expert = task.expert.map_or_else(
            || "–".into(),
            |mut expert| format!("{:.0}", steps_per_second(task, seconds, &mut expert)),
        );
        println!("{:<18} {random:>14.0}   {expert:>14}", task.name);
    }
}

fn steps_per_second(task: &Task, seconds: f64, policy: &mut dyn FnMut(&[f32]) -> Vec<f32>) -> f64 {
    let mut environment = (task.make)();
    let (start, mut n_steps, mut seed) = (ThreadTime::now(), 0_u32, 0);
    loop {
        let mut observation = environment.reset(seed);
        for _ in 0..environment.spec().episode_len {
            let step = environment
                .step(&policy(&observation))
                .expect("an action of the right size");
            observation = step.observation;
            n_steps += 1;
        }
        seed += 1;
        let spent = start.elapsed().as_secs_f64();
        if spent >= seconds {
            return f64::from(n_steps) / spent;
        }
    }
}
