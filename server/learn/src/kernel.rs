//! Element-wise work in one pass over memory, where tensor operations would take several.
//!
//! Each function has two roads that agree to rounding: plain loops for tensors of the processor
//! (which the compiler turns into vector instructions), tensor operations for other devices.
//! Shapes: `E` members, `B` rows, `N` columns; all tensors contiguous. Activations and their
//! gradients may be bf16; biases, sums and everything in between are then f32.

use tch::{Device, Kind, Tensor};

mod number;

use number::Bf16;
pub(crate) use number::{Real, Stored};

/// LayerNorm's ε, as PyTorch's.
pub(crate) const NORM_EPSILON: f64 = 1e-5;

/// Runs the first block where plain loops can reach the tensor, else the second. `$T` is then
/// the type of its numbers, `$R` what they are computed with; without `$R`, they are the same.
macro_rules! on_slices {
    ($tensor:expr, $T:ident of $R:ident => $slices:expr, $tensors:expr) => {
        match ($tensor.device(), $tensor.kind()) {
            (Device::Cpu, Kind::BFloat16) => {
                type $T = Bf16;
                type $R = f32;
                $slices
            }
            (Device::Cpu, Kind::Float) => {
                type $T = f32;
                type $R = f32;
                $slices
            }
            (Device::Cpu, Kind::Double) => {
                type $T = f64;
                type $R = f64;
                $slices
            }
            _ => $tensors,
        }
    };
    ($tensor:expr, $T:ident => $slices:expr, $tensors:expr) => {
        match ($tensor.device(), $tensor.kind()) {
            (Device::Cpu, Kind::Float) => {
                type $T = f32;
                $slices
            }
            (Device::Cpu, Kind::Double) => {
                type $T = f64;
                $slices
            }
            _ => $tensors,
        }
    };
}

/// `z ← activation(z + bias)`; `z` is `[E × B × N]`, `bias` `[E × 1 × N]`. The activation keeps
/// positive numbers and scales the others by `slope` (0: ReLU, 1: none).
pub(crate) fn bias_activate(z: &mut Tensor, bias: &Tensor, slope: f64) {
    on_slices!(
        z,
        T of R => {
            let (n_columns, member) = (columns(z), member_len(z));
            let slope = R::of(slope);
            let members = values_mut::<T>(z).chunks_exact_mut(member);
            for (z, bias) in members.zip(values::<R>(bias).chunks_exact(n_columns)) {
                for row in z.chunks_exact_mut(n_columns) {
                    for (z, b) in row.iter_mut().zip(bias) {
                        *z = T::store(activated(z.load() + *b, slope));
                    }
                }
            }
        },
        {
            *z = activated_tensor((&*z + bias).to_kind(z.kind()), slope);
        }
    );
}

/// The way back through [`bias_activate`]: `gradient` (of the output) becomes that of the input,
/// and its column sums are added to `bias_gradient`.
pub(crate) fn bias_activate_backward(
    gradient: &mut Tensor,
    output: &Tensor,
    slope: f64,
    bias_gradient: Option<&mut Tensor>,
) {
    on_slices!(
        gradient,
        T of R => {
            let (n_columns, member) = (columns(gradient), member_len(gradient));
            let slope = R::of(slope);
            let mut unused = Vec::new();
            let sums = if let Some(sums) = bias_gradient {
                values_mut::<R>(sums)
            } else {
                unused.resize(gradient.numel() / member * n_columns, R::of(0.0));
                &mut unused[..]
            };
            let members = values_mut::<T>(gradient).chunks_exact_mut(member);
            let members = members.zip(values::<T>(output).chunks_exact(member));
            for ((gradient, output), sums) in members.zip(sums.chunks_exact_mut(n_columns)) {
                let rows = gradient.chunks_exact_mut(n_columns).zip(output.chunks_exact(n_columns));
                for (gradient, output) in rows {
                    for ((g, y), sum) in gradient.iter_mut().zip(output).zip(&mut *sums) {
                        let masked = passed(g.load(), y.load(), slope);
                        *g = T::store(masked);
                        *sum += masked;
                    }
                }
            }
        },
        {
            *gradient = output.leaky_relu_backward(gradient, slope, true);
            if let Some(sums) = bias_gradient {
                let own = gradient.sum_dim_intlist([1_i64].as_slice(), true, sums.kind());
                let _ = sums.g_add_(&own);
            }
        }
    );
}

/// `y = activation(gain · normalised(z + bias) + shift)`, each row normalised to mean 0 and
/// variance 1. `z` becomes the normalised rows; returns `y` and 1/σ of each row, `[E × B × 1]`.
pub(crate) fn norm_activate(
    z: &mut Tensor,
    bias: &Tensor,
    norm: (&Tensor, &Tensor),
    slope: f64,
) -> (Tensor, Tensor) {
    let (gain, shift) = norm;
    on_slices!(
        z,
        T of R => {
            let (n_columns, member) = (columns(z), member_len(z));
            let (slope, n) = (R::of(slope), R::of(n_columns as f64));
            let mut output = z.empty_like();
            let size = z.size();
            let mut inverse = Tensor::empty([size[0], size[1], 1], (R::KIND, z.device()));
            let (out, inv) = (values_mut::<T>(&mut output), values_mut::<R>(&mut inverse));
            let (bias, gain, shift) = (values::<R>(bias), values::<R>(gain), values::<R>(shift));
            let mut centred = vec![R::of(0.0); n_columns];
            let rows = values_mut::<T>(z).chunks_exact_mut(n_columns).zip(out.chunks_exact_mut(n_columns));
            for (index, ((z, y), inverse)) in rows.zip(inv).enumerate() {
                let at = index * n_columns / member * n_columns;
                let (bias, gain, shift) =
                    (&bias[at..at + n_columns], &gain[at..at + n_columns], &shift[at..at + n_columns]);
                for ((x, z), b) in centred.iter_mut().zip(&*z).zip(bias) {
                    *x = z.load() + *b;
                }
                let mean = sum(&centred) / n;
                for x in &mut centred {
                    *x -= mean;
                }
                let variance = dot(&centred, &centred) / n;
                *inverse = R::of(1.0) / (variance + R::of(NORM_EPSILON)).sqrt();
                for ((((x, z), y), g), s) in centred.iter().zip(z).zip(y).zip(gain).zip(shift) {
                    let normalised = *x * *inverse;
                    *z = T::store(normalised);
                    *y = T::store(activated(normalised * *g + *s, slope));
                }
            }
            (output, inverse)
        },
        {
            let sum = &*z + bias;
            let columns = columns(&sum) as i64;
            let (normalised, _mean, inverse) =
                sum.native_layer_norm([columns], None::<&Tensor>, None, NORM_EPSILON);
            let output = activated_tensor(shift.addcmul(&normalised, gain), slope);
            let kind = z.kind();
            *z = normalised.to_kind(kind);
            (output.to_kind(kind), inverse)
        }
    )
}

/// What [`norm_activate`] left for the way back.
pub(crate) struct Normed<'a> {
    /// `y`.
    pub(crate) output: &'a Tensor,
    /// The normalised rows.
    pub(crate) normalised: &'a Tensor,
    /// 1/σ of each row.
    pub(crate) inverse: &'a Tensor,
    /// Of the layer.
    pub(crate) gain: &'a Tensor,
}

/// Where the gradients of a normalised layer's vectors are added, `[E × 1 × N]` each.
pub(crate) struct NormGradient<'a> {
    pub(crate) bias: &'a mut Tensor,
    pub(crate) gain: &'a mut Tensor,
    pub(crate) shift: &'a mut Tensor,
}

/// The way back through [`norm_activate`]: `gradient` (of `y`) becomes that of `z`.
pub(crate) fn norm_activate_backward(
    gradient: &mut Tensor,
    forward: &Normed<'_>,
    slope: f64,
    into: Option<NormGradient<'_>>,
) {
    on_slices!(
        gradient,
        T of R => {
            let (n_columns, member) = (columns(gradient), member_len(gradient));
            let (slope, n) = (R::of(slope), R::of(n_columns as f64));
            let mut unused = Vec::new();
            let (bias, gains, shifts) = if let Some(NormGradient { bias, gain, shift }) = into {
                (values_mut::<R>(bias), values_mut::<R>(gain), values_mut::<R>(shift))
            } else {
                let len = gradient.numel() / member * n_columns;
                unused.resize(3 * len, R::of(0.0));
                let (bias, rest) = unused.split_at_mut(len);
                let (gains, shifts) = rest.split_at_mut(len);
                (bias, gains, shifts)
            };
            let (outputs, normalised) = (values::<T>(forward.output), values::<T>(forward.normalised));
            let (inverses, gain) = (values::<R>(forward.inverse), values::<R>(forward.gain));
            let mut scaled = vec![R::of(0.0); n_columns];
            for (index, d) in values_mut::<T>(gradient).chunks_exact_mut(n_columns).enumerate() {
                let at = index * n_columns / member * n_columns;
                let (row, own) = (index * n_columns..(index + 1) * n_columns, at..at + n_columns);
                let (y, x, inverse) = (&outputs[row.clone()], &normalised[row], inverses[index]);
                let (gain, gains) = (&gain[own.clone()], &mut gains[own.clone()]);
                let (shifts, bias) = (&mut shifts[own.clone()], &mut bias[own]);
                let parts = scaled.iter_mut().zip(&*d).zip(y).zip(x).zip(gain).zip(gains).zip(shifts);
                for ((((((scaled, d), y), x), gain), gains), shifts) in parts {
                    let g = passed(d.load(), y.load(), slope);
                    *shifts += g;
                    *gains += g * x.load();
                    *scaled = g * *gain;
                }
                let (mean, along) = (sum(&scaled) / n, dot(&scaled, x) / n);
                for (((d, scaled), x), bias) in d.iter_mut().zip(&scaled).zip(x).zip(bias) {
                    let own = inverse * (*scaled - mean - x.load() * along);
                    *d = T::store(own);
                    *bias += own;
                }
            }
        },
        {
            let g = forward.output.leaky_relu_backward(gradient, slope, true);
            let rows = [1_i64];
            let d = &g * forward.gain;
            let mean = d.mean_dim([-1_i64].as_slice(), true, None);
            let along = (&d * forward.normalised).mean_dim([-1_i64].as_slice(), true, None);
            let own = (d - mean - forward.normalised * along) * forward.inverse;
            *gradient = own.to_kind(gradient.kind());
            if let Some(NormGradient { bias, gain, shift }) = into {
                let sum = |of: &Tensor, kind| of.sum_dim_intlist(rows.as_slice(), true, kind);
                let _ = shift.g_add_(&sum(&g, shift.kind()));
                let _ = gain.g_add_(&sum(&(&g * forward.normalised), gain.kind()));
                let _ = bias.g_add_(&sum(gradient, bias.kind()));
            }
        }
    );
}

/// The numbers of one Adam step that are the same for all parameters.
#[derive(Debug, Clone, Copy)]
pub(crate) struct AdamStep {
    /// Learning rate over the first moment's bias correction.
    pub(crate) rate: f64,
    /// Square root of the second moment's bias correction.
    pub(crate) root_correction: f64,
    /// What the gradient is multiplied with first (clipping).
    pub(crate) scale: f64,
}

/// Decay rates and ε of Adam, the same everywhere.
pub(crate) const ADAM: (f64, f64, f64) = (0.9, 0.999, 1e-8);

/// One step of Adam on flat vectors of equal length.
pub(crate) fn adam(
    parameters: &mut Tensor,
    gradient: &Tensor,
    moments: (&mut Tensor, &mut Tensor),
    step: AdamStep,
) {
    let (first, second) = moments;
    let (decay_1, decay_2, epsilon) = ADAM;
    on_slices!(
        parameters,
        T => {
            let (d1, c1) = (T::of(decay_1), T::of(1.0 - decay_1));
            let (d2, c2) = (T::of(decay_2), T::of(1.0 - decay_2));
            let (rate, root, epsilon) = (T::of(step.rate), T::of(1.0 / step.root_correction), T::of(epsilon));
            let scale = T::of(step.scale);
            let values_and_gradient = values_mut::<T>(parameters).iter_mut().zip(values::<T>(gradient));
            let moments = values_mut::<T>(first).iter_mut().zip(values_mut::<T>(second));
            for ((p, g), (m, v)) in values_and_gradient.zip(moments) {
                let g = scale * *g;
                *m = d1 * *m + c1 * g;
                *v = d2 * *v + c2 * g * g;
                *p -= rate * *m / (v.sqrt() * root + epsilon);
            }
        },
        {
            let g = gradient * step.scale;
            let _ = first.lerp_(&g, 1.0 - decay_1);
            let _ = second.lerp_(&g.square(), 1.0 - decay_2);
            let denominator = second.sqrt() / step.root_correction + epsilon;
            let _ = parameters.addcdiv_(&(&*first * -step.rate), &denominator);
        }
    );
}

/// `target ← target + weight · (source − target)`.
pub(crate) fn lerp(target: &mut Tensor, source: &Tensor, weight: f64) {
    on_slices!(
        target,
        T => {
            let weight = T::of(weight);
            for (t, s) in values_mut::<T>(target).iter_mut().zip(values::<T>(source)) {
                *t += weight * (*s - *t);
            }
        },
        {
            let _ = target.lerp_(source, weight);
        }
    );
}

/// The activation.
fn activated<R: Real>(value: R, slope: R) -> R {
    if value > R::of(0.0) {
        value
    } else {
        slope * value
    }
}

/// The activation of a whole tensor with few launches, for a slope in [0, 1].
fn activated_tensor(mut value: Tensor, slope: f64) -> Tensor {
    if slope == 0.0 {
        value.relu_()
    } else if (slope - 1.0).abs() < f64::EPSILON {
        value
    } else {
        let scaled = &value * slope;
        value.maximum(&scaled)
    }
}

/// What of an output's gradient reaches the activation's input.
fn passed<R: Real>(gradient: R, output: R, slope: R) -> R {
    if output > R::of(0.0) {
        gradient
    } else {
        slope * gradient
    }
}

/// Sum in 16 strands, so that it vectorises and always rounds alike.
fn sum<T: Real>(values: &[T]) -> T {
    let (mut strands, chunks) = ([T::of(0.0); 16], values.chunks_exact(16));
    let rest = chunks.remainder();
    for chunk in chunks {
        for (strand, value) in strands.iter_mut().zip(chunk) {
            *strand += *value;
        }
    }
    strands
        .iter()
        .chain(rest)
        .fold(T::of(0.0), |total, value| total + *value)
}

/// Inner product in 16 strands.
fn dot<R: Real, T: Stored<Real = R>>(a: &[R], b: &[T]) -> R {
    let (mut strands, chunks) = ([R::of(0.0); 16], a.chunks_exact(16).zip(b.chunks_exact(16)));
    for (a, b) in chunks {
        for (strand, (a, b)) in strands.iter_mut().zip(a.iter().zip(b)) {
            *strand += *a * b.load();
        }
    }
    let done = a.len() / 16 * 16;
    let rest = a[done..]
        .iter()
        .zip(&b[done..])
        .fold(R::of(0.0), |total, (a, b)| total + *a * b.load());
    strands.iter().fold(rest, |total, value| total + *value)
}

fn columns(tensor: &Tensor) -> usize {
    tensor.size().last().map_or(1, |&n| n as usize)
}

/// Numbers of one member of an `[E × B × N]` tensor.
fn member_len(tensor: &Tensor) -> usize {
    tensor.size().iter().skip(1).product::<i64>() as usize
}

/// A tensor's numbers in place. Panics unless they are `T`s, on the processor and contiguous.
#[expect(unsafe_code, reason = "libtorch hands out its memory as a pointer")]
pub(crate) fn values<T: Stored>(tensor: &Tensor) -> &[T] {
    check::<T>(tensor);
    if tensor.numel() == 0 {
        return &[];
    }
    // SAFETY: contiguous, on the processor, of this type (checked), and alive as long as the
    // borrow; nothing writes to it meanwhile, because writers borrow theirs exclusively and no
    // caller reads and writes overlapping views at once.
    unsafe { std::slice::from_raw_parts(tensor.data_ptr().cast::<T>(), tensor.numel()) }
}

/// The same to be written.
#[expect(unsafe_code, reason = "libtorch hands out its memory as a pointer")]
pub(crate) fn values_mut<T: Stored>(tensor: &mut Tensor) -> &mut [T] {
    check::<T>(tensor);
    if tensor.numel() == 0 {
        return &mut [];
    }
    // SAFETY: as above, and exclusively borrowed.
    unsafe { std::slice::from_raw_parts_mut(tensor.data_ptr().cast::<T>(), tensor.numel()) }
}

fn check<T: Stored>(tensor: &Tensor) {
    assert!(
        tensor.kind() == T::KIND && tensor.device() == Device::Cpu && tensor.is_contiguous(),
        "kernels take contiguous tensors of the processor"
    );
}

#[cfg(test)]
mod tests;
