//! CPU time of cutting one trajectory into stages.
//!
//! `cargo run --release -p domain --example segmentation` prints the least of several rounds, long
//! enough for the coarse clock that Linux keeps of a thread.

use domain::random::{Rng, Stream};
use domain::stage::{StageProbabilities, best_segmentation};

const N_ROUNDS: usize = 5;
const N_REPEATS: u32 = 10_000;

fn main() {
    println!("states  stages  CPU time (ms)");
    for (n_states, n_stages) in [(500, 10), (500, 100), (500, 500)] {
        let mut rng = Rng::new(0, Stream::Test, 0);
        let values = (0..n_states * n_stages).map(|_| rng.uniform() as f32);
        let table = StageProbabilities::new(values.collect(), n_stages).expect("probabilities");
        let mut least = f64::INFINITY;
        for _ in 0..N_ROUNDS {
            let before = cpu_seconds();
            for _ in 0..N_REPEATS {
                std::hint::black_box(best_segmentation(std::hint::black_box(&table)));
            }
            least = least.min((cpu_seconds() - before) / f64::from(N_REPEATS));
        }
        println!("{n_states:6}  {n_stages:6}  {:13.4}", 1e3 * least);
    }
}

/// CPU time of this thread, seconds (Linux).
fn cpu_seconds() -> f64 {
    let line = std::fs::read_to_string("/proc/thread-self/schedstat").expect("Linux keeps it");
    let nanoseconds = line.split(' ').next().and_then(|n| n.parse::<f64>().ok());
    1e-9 * nanoseconds.expect("its first number is the time on a processor")
}
