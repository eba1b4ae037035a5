//! What pictures cost: `cargo run --release -p app --example app_bench [TASK…]`.
//!
//! Plays a segment of 50 steps of every task, by its expert where it has one and by random actions
//! otherwise, and draws it as the labeling page shows it. Processor time of the process, the
//! graphics driver's threads included, least of interleaved rounds.

use cpu_time::ProcessTime;
use domain::random::{Rng, Stream};
use domain::scene::{Frame, Scene};
use render::{CLIP_SIZE, Renderer, clip};
use sim::tasks::{Task, tasks};

const N_FRAMES: usize = 50;
const N_ROUNDS: usize = 3;

fn main() -> anyhow::Result<()> {
    let wanted: Vec<String> = std::env::args().skip(1).collect();
    let start = ProcessTime::now();
    let renderer = Renderer::new()?;
    println!(
        "{}, ready after {:.0} ms CPU\n",
        renderer.device_name(),
        ms(start)
    );

    let mut rows = Vec::new();
    for task in tasks()
        .iter()
        .filter(|task| wanted.is_empty() || wanted.iter().any(|w| w == task.name))
    {
        rows.push((task.name, (task.scene)(), segment(task)?, Cost::default()));
    }
    for _ in 0..N_ROUNDS {
        for (_, scene, frames, cost) in &mut rows {
            cost.keep_least(&measure(&renderer, scene, frames)?);
        }
    }
    println!(
        "| task | CPU ms a frame | CPU ms to encode | CPU ms a clip | kB |\n|---|---|---|---|---|"
    );
    for (name, _, _, cost) in &rows {
        println!(
            "| {name} | {:.1} | {:.0} | {:.0} | {} |",
            cost.drawing / N_FRAMES as f64,
            cost.encoding,
            cost.drawing + cost.encoding,
            cost.bytes / 1000
        );
    }
    Ok(())
}

/// Of one clip, milliseconds and bytes.
struct Cost {
    drawing: f64,
    encoding: f64,
    bytes: usize,
}

impl Default for Cost {
    fn default() -> Self {
        Self {
            drawing: f64::INFINITY,
            encoding: f64::INFINITY,
            bytes: 0,
        }
    }
}

impl Cost {
    fn keep_least(&mut self, other: &Self) {
        self.drawing = self.drawing.min(other.drawing);
        self.encoding = self.encoding.min(other.encoding);
        self.bytes = other.bytes;
    }
}

fn measure(renderer: &Renderer, scene: &Scene, frames: &[Frame]) -> anyhow::Result<Cost> {
    let before = ProcessTime::now();
    let images = renderer.draw(scene, frames, CLIP_SIZE, &scene.cameras[0])?;
    let drawing = ms(before);
    let before = ProcessTime::now();
    let clip = clip::encode(&images, clip::frames_per_second(images.len()))?;
    Ok(Cost {
        drawing,
        encoding: ms(before),
        bytes: clip.bytes.len(),
    })
}

/// Where everything is after each of the first 50 steps of an episode.
fn segment(task: &Task) -> anyhow::Result<Vec<Frame>> {
    let mut environment = (task.make)();
    let mut rng = Rng::new(1, Stream::Rollout, 0);
    let size = environment.spec().action_size;
    let mut observation = environment.reset(0);
    let mut frames = Vec::with_capacity(N_FRAMES);
    for _ in 0..N_FRAMES {
        let action = match task.expert {
            Some(expert) => expert(&observation),
            None => (0..size)
                .map(|_| rng.uniform_in(-1.0, 1.0) as f32)
                .collect(),
        };
        let step = environment.step(&action)?;
        observation = if step.end.is_some() {
            environment.reset(1)
        } else {
            step.observation
        };
        frames.push((task.place)(&environment.pose()));
    }
    Ok(frames)
}

/// Processor time since then, milliseconds.
fn ms(since: ProcessTime) -> f64 {
    since.elapsed().as_secs_f64() * 1e3
}
