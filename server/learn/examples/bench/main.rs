//! CPU time of what learning does, on one thread, beside the floor of its arithmetic.
//!
//! `cargo xtask bench` (or `cargo run -p learn --example bench [-- NAME…]`) prints the table of
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

use std::sync::LazyLock;
use std::time::Instant;

use learn::device::Device;
use rows::{Row, Work};

const N_ROUNDS: usize = 5;

fn main() {
    let mut wanted: Vec<String> = std::env::args().skip(1).collect();
    let device = match wanted.iter().position(|name| name == "--device") {
        Some(at) => wanted.drain(at..wanted.len().min(at + 2)).next_back(),
        None => None,
    };
    let device = Device::open(device.as_deref().unwrap_or("cpu")).unwrap_or_else(|error| {
        eprintln!("{error}");
        std::process::exit(2);
    });
    let now = if device == Device::CPU {
        cpu_time
    } else {
        wall_time
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
    let mut product = product_of_1024(now);
    let mut fastest_product = f64::INFINITY;
    for _ in 0..N_ROUNDS {
        fastest_product = fastest_product.min(product());
        for (_, work, least) in &mut timed {
            let before = now();
            (0..work.n_repeats).for_each(|_| (work.run)());
            let seconds = (now() - before) / f64::from(work.n_repeats);
            *least = least.min(seconds);
        }
    }
    let rate = 2.0 * 1.024_f64.powi(3) / fastest_product; // GF/s
    println!(
        "1024³ f32 product: {rate:.0} GF/s; MKL asked its switch {} times\n",
        learn::device::n_mkl_switch_calls()
    );
    let clock = if device == Device::CPU {
        "CPU ms"
    } else {
        "ms"
    };
    println!("| what | {clock} | floor ms | share | peer ms |\n|---|---|---|---|---|");
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

/// Seconds of one 1024³ product on the processor, as libtorch multiplies.
fn product_of_1024(now: fn() -> f64) -> impl FnMut() -> f64 {
    let numbers = (tch::Kind::Float, tch::Device::Cpu);
    let (a, b) = (
        tch::Tensor::ones([1024, 1024], numbers),
        tch::Tensor::ones([1024, 1024], numbers),
    );
    let c = tch::Tensor::zeros([1024, 1024], numbers);
    move || {
        let time = |_| {
            let before = now();
            let _ = a.matmul_out(&c, &b);
            now() - before
        };
        (0..10).map(time).fold(f64::INFINITY, f64::min)
    }
}

/// Seconds since the first call.
fn wall_time() -> f64 {
    static BEGAN: LazyLock<Instant> = LazyLock::new(Instant::now);
    BEGAN.elapsed().as_secs_f64()
}

/// Seconds of CPU time that this thread has used.
#[expect(
    unsafe_code,
    reason = "the thread's own clock is read through a C function"
)]
fn cpu_time() -> f64 {
    const CLOCK_THREAD_CPUTIME_ID: i32 = 3;
    unsafe extern "C" {
        fn clock_gettime(clock: i32, time: *mut [i64; 2]) -> i32;
    }
    let mut time = [0_i64; 2];
    // SAFETY: on 64-bit Linux a timespec is two 64-bit numbers, which it fills.
    let failed = unsafe { clock_gettime(CLOCK_THREAD_CPUTIME_ID, &raw mut time) };
    assert_eq!(failed, 0, "the thread's clock can be read");
    time[0] as f64 + 1e-9 * time[1] as f64
}
