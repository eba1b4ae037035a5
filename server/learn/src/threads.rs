//! Parts of one computation side by side, on the threads of the present rayon pool.
//!
//! What is worth threads follows from sizes alone, never from how many threads there are: the
//! same parts are computed either way, so no result depends on the machine's cores.

use std::ops::Deref;

use rayon::iter::{IndexedParallelIterator as _, IntoParallelIterator as _, ParallelIterator as _};

/// Multiplications from which on a part saves time on a thread of its own.
pub(crate) const WORTH_A_THREAD: i64 = 5_000_000;

/// Does each part; results come in the order of the parts.
pub(crate) fn each<P: Send, R: Send>(parts: Vec<P>, work: impl Fn(P) -> R + Sync) -> Vec<R> {
    let parts = parts.into_par_iter().with_max_len(1);
    parts.map(|part| prepared(|| work(part))).collect()
}

/// Does both, side by side where that is worth it.
pub(crate) fn both<A: Send, B: Send>(
    is_worth_it: bool,
    a: impl FnOnce() -> A + Send,
    b: impl FnOnce() -> B + Send,
) -> (A, B) {
    if is_worth_it {
        rayon::join(|| prepared(a), || prepared(b))
    } else {
        (a(), b())
    }
}

/// Does it on a thread of the pool, which may never have computed with tensors before.
fn prepared<R>(work: impl FnOnce() -> R) -> R {
    crate::device::init();
    work()
}

/// What holds nothing but tensors and plain numbers, and changes neither through a shared
/// reference.
pub(crate) trait Readable {}

impl Readable for tch::Tensor {}

/// What several threads read at once: a net, a tape, a batch.
pub(crate) struct Reading<'a, T: Readable>(pub(crate) &'a T);

#[expect(unsafe_code, reason = "tch leaves open who else writes to a tensor")]
// SAFETY: libtorch counts references atomically and lets any number of threads read a tensor
// that none writes to. Whoever holds this borrows the tensors, and parts of one call write to
// tensors of their own: fresh ones, and the slices of one member's gradient.
unsafe impl<T: Readable> Send for Reading<'_, T> {}

#[expect(unsafe_code, reason = "tch leaves open who else writes to a tensor")]
// SAFETY: as above.
unsafe impl<T: Readable> Sync for Reading<'_, T> {}

impl<T: Readable> Deref for Reading<'_, T> {
    type Target = T;

    fn deref(&self) -> &T {
        self.0
    }
}
