//! What a thread makes of numbers too small for a full mantissa.

/// From now on this thread takes them as zero, given or made.
pub(super) fn flush() {
    control::set(control::get() | control::FLUSH);
}

/// While it lives, its thread keeps them; then it does what it did before.
pub(super) struct Kept {
    before: u32,
}

impl Kept {
    pub(super) fn begin() -> Self {
        let before = control::get();
        control::set(before & !control::FLUSH);
        Self { before }
    }
}

impl Drop for Kept {
    fn drop(&mut self) {
        control::set(self.before);
    }
}

#[cfg(target_arch = "x86_64")]
#[expect(unsafe_code, reason = "the register has no safe accessor")]
mod control {
    use std::arch::asm;

    /// Results (bit 15) and operands (bit 6).
    pub(super) const FLUSH: u32 = 1 << 15 | 1 << 6;

    pub(super) fn get() -> u32 {
        let mut value = 0_u32;
        // SAFETY: writes the thread's MXCSR, 32 bits, to a place of that size.
        unsafe {
            asm!("stmxcsr [{}]", in(reg) &raw mut value, options(nostack, preserves_flags));
        }
        value
    }

    pub(super) fn set(value: u32) {
        // SAFETY: `value` came from this register, but for two bits that every processor with
        // AVX has; rounding and exceptions stay as they are. What the compiler worked out beforehand
        // it did with denormals, and nothing here depends on whether it did.
        unsafe {
            asm!("ldmxcsr [{}]", in(reg) &raw const value, options(nostack, preserves_flags));
        }
    }
}

/// Other processors keep them: what they cost there was not measured.
#[cfg(not(target_arch = "x86_64"))]
mod control {
    pub(super) const FLUSH: u32 = 0;

    pub(super) fn get() -> u32 {
        0
    }

    pub(super) fn set(_value: u32) {}
}

#[cfg(all(test, target_arch = "x86_64"))]
mod tests {
    use std::hint::black_box;

    use super::super::{init, with_denormals};

    /// Where it is called, and not where the compiler would rather have it.
    fn half_of_the_least() -> f32 {
        black_box(black_box(f32::MIN_POSITIVE) * black_box(0.5))
    }

    #[test]
    fn a_prepared_thread_flushes_and_physics_on_it_does_not() {
        let (before, prepared, physics, after) = std::thread::spawn(|| {
            let before = half_of_the_least();
            init();
            let prepared = half_of_the_least();
            let physics = with_denormals(half_of_the_least);
            (before, prepared, physics, half_of_the_least())
        })
        .join()
        .unwrap();
        assert!(before > 0.0 && physics.to_bits() == before.to_bits());
        assert!(prepared == 0.0 && after == 0.0);
    }

    #[test]
    fn a_panic_leaves_the_thread_as_it_was() {
        let after = std::thread::spawn(|| {
            init();
            let told = std::panic::catch_unwind(|| with_denormals(|| panic!("on purpose")));
            assert!(told.is_err());
            half_of_the_least()
        });
        assert!(after.join().unwrap() == 0.0);
    }
}
