//! CPU time of what learning does, on one thread, beside the floor of its arithmetic.
//!
//! `cargo xtask bench` (or `cargo run -p learn --example learn_bench [-- NAME…]`) prints the table of
//! `PERFORMANCE.md` for the machine it runs on; names pick rows. Times are CPU time of the
//! thread, the least of interleaved rounds, so that other work on the machine disturbs little.
//! The floor is the row's matrix products at the rate of a 1024³ f32 product in the same run,
//! in the rows of bf16 too: those may go below it.
//!
//! `--device cuda` measures a graphics card instead: wall time, which holds the waiting for it.

#![expect(
    clippy::cast_possible_wrap,
    reason = "sizes of tensors and floating-point counts"
)]

mod experience;
mod rows;

use std::time::Instant;

use cpu_time::ThreadTime;
use learn::device::Device;
use rows::{Row, Work};

const N_ROUNDS: usize = 5;

fn main() {
    // What would be worked on side by side stays on this thread, whose time is taken.
    rayon::ThreadPoolBuilder::new()
        .num_threads(1)
        .use_current_thread()
        .build_global()
        .expect("nothing was computed before");
    let mut wanted: Vec<String> = std::env::args().skip(1).collect();
    let device = match wanted.iter().position(|name| name == "--device") {
        Some(at) => wanted.drain(at..wanted.len().min(at + 2)).next_back(),
        None => None,
    };
    let device = Device::open(device.as_deref().unwrap_or("cpu")).unwrap_or_else(|error| {
        eprintln!("{error}");
        std::process::exit(2);
    });
    let seconds = if device == Device::CPU {
        cpu_seconds
    } else {
        wall_seconds
    };
    let is_wanted =
        |name: &str| wanted.is_empty() || wanted.iter().any(|w| name.contains(w.as_str()));
    let rows = rows::all(device)
        .into_iter()
        .filter(|row| is_wanted(row.name));
    let mut timed: Vec<(Row, Work, f64)> = rows
        .map(|row| {
            let work = (row.prepare)();
            (row, work, f64::INFINITY)
        })
        .collect();
    let mut product = product_of_1024();
    let mut fastest_product = f64::INFINITY;
    for _ in 0..N_ROUNDS {
        fastest_product = fastest_product.min(product());
        for (_, work, least) in &mut timed {
            let all = seconds(&mut || (0..work.n_repeats).for_each(|_| (work.run)()));
            *least = least.min(all / f64::from(work.n_repeats));
        }
    }
    let rate = 2.0 * 1.024_f64.powi(3) / fastest_product; // GF/s
    println!(
        "1024³ f32 product: {rate:.0} GF/s; MKL asked its switch {} times\n",
        learn::device::n_mkl_switch_calls()
    );
    tell(device, timed, rate);
}

/// Milliseconds beside the floor; on a card, beside what one core takes at best.
fn tell(device: Device, timed: Vec<(Row, Work, f64)>, rate: f64) {
    let columns = if device == Device::CPU {
        "CPU ms | floor ms | share"
    } else {
        "ms | a core's floor ms | times as fast"
    };
    println!("| what | {columns} | peer ms |\n|---|---|---|---|---|");
    for (row, work, least) in timed {
        let (ms, floor) = (least * 1e3, work.gigaflop / rate * 1e3);
        let (floor, share) = if work.gigaflop > 0.0 {
            (format!("{floor:.1}"), format!("{:.2}", floor / ms))
        } else {
            ("–".into(), "–".into())
        };
        println!(
            "| {} | {ms:.1} | {floor} | {share} | {} |",
            row.name, row.peer
        );
    }
}

/// Seconds of CPU time of one 1024³ product, as libtorch multiplies.
fn product_of_1024() -> impl FnMut() -> f64 {
    let numbers = (tch::Kind::Float, tch::Device::Cpu);
    let (a, b) = (
        tch::Tensor::ones([1024, 1024], numbers),
        tch::Tensor::ones([1024, 1024], numbers),
    );
    let c = tch::Tensor::zeros([1024, 1024], numbers);
    move || {
        let time = |_| {
            cpu_seconds(&mut || {
                let _ = a.matmul_out(&c, &b);
            })
        };
        (0..10).map(time).fold(f64::INFINITY, f64::min)
    }
}

/// Seconds of CPU time of this thread that the work takes.
fn cpu_seconds(work: &mut dyn FnMut()) -> f64 {
    let before = ThreadTime::now();
    work();
    before.elapsed().as_secs_f64()
}

/// Seconds of wall time that it takes.
fn wall_seconds(work: &mut dyn FnMut()) -> f64 {
    let before = Instant::now();
    work();
    before.elapsed().as_secs_f64()
}
