//! Numbers that the kernels compute with, and numbers that tensors store.

use std::ops::{Add, AddAssign, Div, Mul, MulAssign, Sub, SubAssign};

use tch::Kind;

/// What is computed with: f32, or f64 where a test wants more digits.
pub(crate) trait Real:
    Stored<Real = Self>
    + PartialOrd
    + AddAssign
    + SubAssign
    + MulAssign
    + Add<Output = Self>
    + Sub<Output = Self>
    + Mul<Output = Self>
    + Div<Output = Self>
{
    fn of(value: f64) -> Self;
    fn sqrt(self) -> Self;
    /// A whole number from 0 on as an index; `None` below.
    fn index(self) -> Option<usize>;
}

/// What lies in a tensor.
pub(crate) trait Stored: Copy {
    /// What it is computed with.
    type Real: Real;
    /// The tensor's name for it.
    const KIND: Kind;
    fn load(self) -> Self::Real;
    fn store(value: Self::Real) -> Self;
}

/// The upper half of an f32: its exponent, and 8 significant bits.
#[derive(Debug, Clone, Copy)]
#[repr(transparent)]
pub(crate) struct Bf16(u16);

impl Stored for Bf16 {
    type Real = f32;
    const KIND: Kind = Kind::BFloat16;
    fn load(self) -> f32 {
        f32::from_bits(u32::from(self.0) << 16)
    }
    /// To the nearest, ties to even, as the processor's own instruction rounds. What is no
    /// number stays none unless its upper half alone says infinity, which nothing here makes.
    fn store(value: f32) -> Self {
        let bits = value.to_bits();
        let tie = (bits >> 16) & 1;
        Self((bits.wrapping_add(0x7fff + tie) >> 16) as u16)
    }
}

impl Stored for f32 {
    type Real = f32;
    const KIND: Kind = Kind::Float;
    fn load(self) -> f32 {
        self
    }
    fn store(value: f32) -> f32 {
        value
    }
}

impl Stored for f64 {
    type Real = f64;
    const KIND: Kind = Kind::Double;
    fn load(self) -> f64 {
        self
    }
    fn store(value: f64) -> f64 {
        value
    }
}

impl Real for f32 {
    fn of(value: f64) -> Self {
        value as f32
    }
    fn sqrt(self) -> Self {
        f32::sqrt(self)
    }
    fn index(self) -> Option<usize> {
        (self >= 0.0).then_some(self as usize)
    }
}

impl Real for f64 {
    fn of(value: f64) -> Self {
        value
    }
    fn sqrt(self) -> Self {
        f64::sqrt(self)
    }
    fn index(self) -> Option<usize> {
        (self >= 0.0).then_some(self as usize)
    }
}

#[cfg(test)]
mod tests {
    use tch::Tensor;

    use super::*;

    #[test]
    fn bf16_rounds_as_libtorch_does() {
        let ties = [1.0 + 1.0 / 256.0, 1.0 + 3.0 / 256.0, -0.1, 1e-40, 3.3e38];
        let rounded = Tensor::from_slice(&ties).to_kind(Kind::BFloat16);
        let theirs: Vec<f32> = Vec::try_from(rounded.to_kind(Kind::Float)).expect("f32");
        let ours = ties.map(|x: f32| Bf16::store(x).load());
        assert_eq!(
            ours.map(f32::to_bits)[..],
            theirs.iter().map(|x| x.to_bits()).collect::<Vec<_>>()[..]
        );
        assert!(Bf16::store(f32::NAN).load().is_nan());
    }
}
