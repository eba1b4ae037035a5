//! CPU time of cutting one trajectory into stages.
//!
//! `cargo run --release -p domain --example segmentation` prints the least of several rounds.

use cpu_time::ThreadTime;
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
            let before = ThreadTime::now();
            for _ in 0..N_REPEATS {
                std::hint::black_box(best_segmentation(std::hint::black_box(&table)));
            }
            least = least.min(before.elapsed().as_secs_f64() / f64::from(N_REPEATS));
        }
        println!("{n_states:6}  {n_stages:6}  {:13.4}", 1e3 * least);
    }
}
