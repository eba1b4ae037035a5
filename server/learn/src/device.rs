//! Where tensors live, and what the process needs before the first one.

use std::hint::black_box;
use std::sync::atomic::{AtomicU8, AtomicU64, Ordering};
use std::sync::{Once, OnceLock};

use libloading::os::unix::{Library, RTLD_GLOBAL, RTLD_NOW};

use crate::error::LearnError;

mod denormals;

/// The libtorch that tch is bound to.
const LIBTORCH_VERSION: &str = "2.11.0";

/// A place for tensors: the processor or a graphics card.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Device(pub(crate) tch::Device);

impl Device {
    /// The processor.
    pub const CPU: Self = Self(tch::Device::Cpu);

    /// Opens `cpu`, `cuda` (the first card) or `cuda:N`, and prepares the process ([`init`]).
    ///
    /// # Errors
    /// [`LearnError::NoDevice`], with what can be had.
    pub fn open(name: &str) -> Result<Self, LearnError> {
        init();
        let no_device = |reason: String| LearnError::NoDevice {
            name: name.to_owned(),
            reason,
        };
        let index = match name.split_once(':') {
            None if name == "cpu" => return Ok(Self::CPU),
            None if name == "cuda" => 0,
            Some(("cuda", index)) => index
                .parse::<usize>()
                .map_err(|_| no_device(format!("{index:?} is no number of a card")))?,
            _ => return Err(no_device("devices are `cpu`, `cuda` and `cuda:N`".into())),
        };
        load_cuda().map_err(no_device)?;
        let n_cards = usize::try_from(tch::Cuda::device_count()).unwrap_or(0);
        if index >= n_cards {
            return Err(no_device(format!(
                "this libtorch sees {n_cards} CUDA cards; use `cpu`"
            )));
        }
        Ok(Self(tch::Device::Cuda(index)))
    }
}

/// Loads libtorch's part for cards, which executables are not linked with: the slim libtorch of
/// the set-up has none.
fn load_cuda() -> Result<(), String> {
    static LOADED: OnceLock<Result<(), String>> = OnceLock::new();
    let load = || {
        // SAFETY: what the library does when it is loaded is to register its kernels with the
        // libtorch that this process runs on; it is never unloaded.
        #[expect(unsafe_code, reason = "a library runs its own code when it is loaded")]
        let library = unsafe { Library::open(Some("libtorch_cuda.so"), RTLD_NOW | RTLD_GLOBAL) };
        match library {
            Ok(library) => {
                std::mem::forget(library);
                Ok(())
            }
            Err(error) => Err(format!(
                "{error}; name the `torch/lib` folder of a PyTorch {LIBTORCH_VERSION} with CUDA \
                 in LD_LIBRARY_PATH, or use `cpu`"
            )),
        }
    };
    LOADED.get_or_init(load).clone()
}

/// Prepares the process once and every thread that calls it; calling it again does nothing.
/// A thread that computes with tensors calls it first.
///
/// One tensor operation runs on one thread: what runs side by side does so on Rust threads
/// (two threads inside one product gain 1.2×, and waiting ones spin). MKL keeps its number of
/// threads for each thread apart, so a new thread would start with one for each core. Freed
/// memory of up to 32 MiB a block is kept, because giving it back and faulting it in again
/// costs more than the arithmetic on it. Numbers below 1.2e-38 become zero: what they add is lost
/// in any sum, and Intel's processors take far longer for them (PERFORMANCE.md), which is where
/// the moments of units that no longer learn and the probabilities of far pairs end up.
pub fn init() {
    static ONCE: Once = Once::new();
    ONCE.call_once(keep_freed_memory);
    thread_local! {
        static IS_READY: () = {
            tch::set_num_threads(1);
            denormals::flush();
        };
    }
    IS_READY.with(|()| ());
}

/// Does something that is no learning, such as physics, with all of single precision, on a thread
/// that may or may not have been prepared ([`init`]): the result is the same on either.
///
/// To the compiler a product does not depend on how the thread is set, and it may move one past
/// the setting; what goes in and what comes out are therefore hidden from it.
pub fn with_denormals<R>(work: impl FnOnce() -> R) -> R {
    let _until_done = denormals::Kept::begin();
    let work = black_box(work);
    black_box(work())
}

#[cfg(all(target_os = "linux", target_env = "gnu"))]
#[expect(
    unsafe_code,
    reason = "glibc's allocator is tuned through a C function"
)]
fn keep_freed_memory() {
    const M_TRIM_THRESHOLD: i32 = -1;
    const M_TOP_PAD: i32 = -2;
    const M_MMAP_THRESHOLD: i32 = -3;
    const MIB: i32 = 1 << 20;
    unsafe extern "C" {
        fn mallopt(parameter: i32, value: i32) -> i32;
    }
    // SAFETY: mallopt takes plain numbers and refuses what it does not know.
    unsafe {
        mallopt(M_MMAP_THRESHOLD, 32 * MIB); // the largest that glibc takes
        mallopt(M_TRIM_THRESHOLD, 512 * MIB);
        mallopt(M_TOP_PAD, 16 * MIB);
    }
}

#[cfg(not(all(target_os = "linux", target_env = "gnu")))]
fn keep_freed_memory() {}

/// The rate of a 512³ product in single precision on one core of this machine, 10⁹
/// multiplications and additions a second: the best of a few, so that other work on the machine
/// disturbs little.
pub fn gigaflop_per_second() -> f64 {
    const N: i64 = 512;
    init();
    let a = tch::Tensor::ones([N, N], (tch::Kind::Float, tch::Device::Cpu));
    let seconds = (0..8).map(|_| {
        let began = std::time::Instant::now();
        let _ = a.matmul(&a);
        began.elapsed().as_secs_f64()
    });
    let gigaflop = 2.0 * (N as f64).powi(3) / 1e9;
    gigaflop / seconds.fold(f64::INFINITY, f64::min).max(1e-9)
}

static N_SWITCH_CALLS: AtomicU64 = AtomicU64::new(0);

/// How often MKL has asked the switch below; zero after a matrix product means that the
/// executable was linked without `rpath.rs`, and that products run at half speed on AMD.
pub fn n_mkl_switch_calls() -> u64 {
    N_SWITCH_CALLS.load(Ordering::Relaxed)
}

/// Whether MKL may take its fastest path on this processor.
///
/// MKL calls this symbol to learn whether it runs on Intel's own processors; the executable's
/// answer wins over the library's. Without it, MKL leaves AVX-512 unused on AMD (90–97 instead
/// of 203–216 GF/s a Zen5 core). Unsupported by Intel, hence a switch: `STAIR_MKL_SWITCH=0`
/// gives the library's own answer back, and processors without AVX2 and FMA always get it.
#[unsafe(no_mangle)]
#[expect(unsafe_code, reason = "MKL looks the symbol up by its C name")]
pub extern "C" fn mkl_serv_intel_cpu_true() -> i32 {
    const UNKNOWN: u8 = 2;
    static ANSWER: AtomicU8 = AtomicU8::new(UNKNOWN);
    N_SWITCH_CALLS.fetch_add(1, Ordering::Relaxed);
    let mut answer = ANSWER.load(Ordering::Relaxed);
    if answer == UNKNOWN {
        answer = u8::from(is_intel() || (is_switched_on() && has_fused_multiply_add()));
        ANSWER.store(answer, Ordering::Relaxed);
    }
    i32::from(answer)
}

fn is_switched_on() -> bool {
    std::env::var_os("STAIR_MKL_SWITCH").is_none_or(|value| value != "0")
}

#[cfg(target_arch = "x86_64")]
fn has_fused_multiply_add() -> bool {
    std::is_x86_feature_detected!("avx2") && std::is_x86_feature_detected!("fma")
}

#[cfg(target_arch = "x86_64")]
fn is_intel() -> bool {
    let vendor = std::arch::x86_64::__cpuid(0);
    let name = [vendor.ebx, vendor.edx, vendor.ecx].map(u32::to_le_bytes);
    name.concat() == b"GenuineIntel"
}

#[cfg(not(target_arch = "x86_64"))]
fn has_fused_multiply_add() -> bool {
    false
}

#[cfg(not(target_arch = "x86_64"))]
fn is_intel() -> bool {
    false
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn mkl_asks_the_switch_of_this_executable() {
        init();
        let a = tch::Tensor::ones([64, 64], (tch::Kind::Float, tch::Device::Cpu));
        let product = a.matmul(&a);
        assert!((product.double_value(&[3, 5]) - 64.0).abs() < 1e-6);
        assert!(n_mkl_switch_calls() > 0, "linked without rpath.rs");
    }

    #[test]
    fn new_threads_compute_alone_too() {
        init();
        let n_threads = std::thread::spawn(tch::get_num_threads).join();
        assert_eq!(n_threads.expect("the thread returns"), 1);
    }

    #[test]
    fn an_unknown_device_is_named() {
        let error = Device::open("tpu").expect_err("no such device").to_string();
        assert!(error.contains("tpu") && error.contains("cuda"), "{error}");
    }
}
