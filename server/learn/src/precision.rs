//! In which numbers matrices are multiplied: the one place that decides it.

use serde::{Deserialize, Serialize};
use tch::{Kind, Tensor};

/// Numbers that go into a net's matrix products. Weights, their gradients, moments and whatever
/// is summed are f32 in either case, so checkpoints do not depend on it.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Precision {
    /// As the weights are.
    #[default]
    F32,
    /// Eight significant bits, products summed in f32: about twice the rate on processors with
    /// `AVX512_BF16` and on graphics cards. The output layer goes forward in f32: a value of 100
    /// would otherwise be known to the next half only.
    Bf16,
}

impl Precision {
    /// A tensor as products take it.
    pub(crate) fn operand(self, tensor: &Tensor) -> Tensor {
        match self {
            Self::F32 => tensor.shallow_clone(),
            Self::Bf16 => tensor.to_kind(Kind::BFloat16),
        }
    }
}

/// `x · w` in the numbers of `x`.
pub(crate) fn product(x: &Tensor, w: &Tensor) -> Tensor {
    x.bmm(&w.to_kind(x.kind()))
}

/// `sum ← sum + xᵀ · gradient`, multiplied in the numbers of `gradient`.
pub(crate) fn add_outer(sum: &mut Tensor, x: &Tensor, gradient: &Tensor) {
    let transposed = x.to_kind(gradient.kind()).transpose(1, 2);
    let _ = if gradient.kind() == sum.kind() {
        sum.baddbmm_(&transposed, gradient)
    } else {
        sum.g_add_(&transposed.bmm(gradient))
    };
}
