//! All distances between two sets of latent states, and the way back.
//!
//! The straightforward tensors of B × B × D numbers are what makes this step slow elsewhere
//! (two of 22 MB at B = 416); here nothing larger than B × B is ever made.

use tch::{Device, Kind, Tensor};

use crate::kernel::{Real, values, values_mut};

/// Under the root, so that it has a slope everywhere.
const EPSILON: f64 = 1e-8;

/// d(x, y) along the last dimension, broadcast over the others.
pub(super) fn distance(x: &Tensor, y: &Tensor) -> Tensor {
    let difference = x - y;
    let half = difference.size().last().map_or(0, |d| d / 2);
    let (ahead, _) = difference.narrow(-1, 0, half).max_dim(-1, false);
    let apart = difference.narrow(-1, half, half).square().sum_dim_intlist(
        [-1_i64].as_slice(),
        false,
        None,
    );
    ahead.relu() + (apart + EPSILON).sqrt()
}

/// Distances of B states `x` to B states `y`, with what the way back needs.
pub(super) struct Pairwise {
    x: Tensor,
    y: Tensor,
    half: i64,
    /// The maximum, `[B × B]`.
    ahead: Tensor,
    /// Which coordinate was the maximum, −1 where none was positive; `[B × B]`, as numbers.
    which: Tensor,
    /// The root, `[B × B]`.
    apart: Tensor,
}

impl Pairwise {
    /// `x`, `y`: `[B × D]`.
    pub(super) fn new(x: &Tensor, y: &Tensor) -> Self {
        let (x, y) = (x.contiguous(), y.contiguous());
        let (n, half) = (x.size()[0], x.size()[1] / 2);
        let square = || Tensor::empty([n, n], (x.kind(), x.device()));
        let (mut ahead, mut which, mut apart) = (square(), square(), square());
        let outputs = (&mut ahead, &mut which, &mut apart);
        match (x.device(), x.kind()) {
            (Device::Cpu, Kind::Float) => forward::<f32>(&x, &y, outputs),
            (Device::Cpu, Kind::Double) => forward::<f64>(&x, &y, outputs),
            _ => forward_by_tensors(&x, &y, outputs),
        }
        Self {
            x,
            y,
            half,
            ahead,
            which,
            apart,
        }
    }

    /// `[B × B]`.
    pub(super) fn distance(&self) -> Tensor {
        &self.ahead + &self.apart
    }

    /// Gradients of `x` and `y`, `[B × D]`, from that of the distances.
    pub(super) fn backward(&self, slope: &Tensor) -> (Tensor, Tensor) {
        let pull = (slope / &self.apart).contiguous();
        let ((x_ahead, y_ahead), (x_apart, y_apart)) = match (slope.device(), slope.kind()) {
            (Device::Cpu, Kind::Float) => (
                self.ahead_backward::<f32>(slope),
                self.apart_backward::<f32>(&pull),
            ),
            (Device::Cpu, Kind::Double) => (
                self.ahead_backward::<f64>(slope),
                self.apart_backward::<f64>(&pull),
            ),
            _ => (
                self.ahead_backward_by_tensors(slope),
                self.apart_backward_by_tensors(&pull),
            ),
        };
        (
            Tensor::cat(&[x_ahead, x_apart], 1),
            Tensor::cat(&[y_ahead, y_apart], 1),
        )
    }

    /// Σ_j pull_ij (x_i − y_j) and its counterpart for `y`, `[B × D/2]` each.
    ///
    /// Two matrix products would be shorter, but x_i Σ pull − Σ pull y cancels: a state that is
    /// its own positive has a root of 1e-4, and what remains of the two large terms in single
    /// precision is noise that grows with the latent states until it drives them.
    fn apart_backward<T: Real>(&self, pull: &Tensor) -> (Tensor, Tensor) {
        let (n, half) = (self.x.size()[0] as usize, self.half as usize);
        let y = self.y.transpose(0, 1).contiguous();
        let y = &values::<T>(&y)[half * n..];
        let zeros = |rows, columns| Tensor::zeros([rows, columns], (pull.kind(), pull.device()));
        let mut x_slope = zeros(n as i64, self.half);
        let mut y_slope = zeros(self.half, n as i64);
        let y_slopes = values_mut::<T>(&mut y_slope);
        let rows = values::<T>(&self.x).chunks_exact(2 * half);
        let rows = rows.zip(values::<T>(pull).chunks_exact(n));
        for ((x, pull), x_slopes) in rows.zip(values_mut::<T>(&mut x_slope).chunks_exact_mut(half))
        {
            let columns = y.chunks_exact(n).zip(y_slopes.chunks_exact_mut(n));
            for ((x, x_slope), (y, y_slopes)) in x[half..].iter().zip(x_slopes).zip(columns) {
                *x_slope = push_apart(*x, pull, y, y_slopes);
            }
        }
        (x_slope, y_slope.transpose(0, 1).contiguous())
    }

    fn apart_backward_by_tensors(&self, pull: &Tensor) -> (Tensor, Tensor) {
        let push = differences(&self.x, &self.y, self.half) * pull.unsqueeze(-1);
        sums_over_partners(&push)
    }

    fn ahead_backward<T: Real>(&self, slope: &Tensor) -> (Tensor, Tensor) {
        let (n, half) = (self.x.size()[0], self.half);
        let zeros = || Tensor::zeros([n, half], (slope.kind(), slope.device()));
        let (mut x_slope, mut y_slope) = (zeros(), zeros());
        let slope = slope.contiguous();
        let (n, half) = (n as usize, half as usize);
        let y_slopes = values_mut::<T>(&mut y_slope);
        let rows = values::<T>(&slope)
            .chunks_exact(n)
            .zip(values::<T>(&self.which).chunks_exact(n));
        for ((slopes, which), x_slopes) in
            rows.zip(values_mut::<T>(&mut x_slope).chunks_exact_mut(half))
        {
            for ((slope, which), y_slopes) in slopes
                .iter()
                .zip(which)
                .zip(y_slopes.chunks_exact_mut(half))
            {
                if let Some(coordinate) = which.index() {
                    x_slopes[coordinate] += *slope;
                    y_slopes[coordinate] -= *slope;
                }
            }
        }
        (x_slope, y_slope)
    }

    fn ahead_backward_by_tensors(&self, slope: &Tensor) -> (Tensor, Tensor) {
        let coordinates = Tensor::arange(self.half, (slope.kind(), slope.device()));
        let is_largest = self.which.unsqueeze(-1).eq_tensor(&coordinates);
        sums_over_partners(&(slope.unsqueeze(-1) * is_largest))
    }
}

/// x_i − y_j in each coordinate of one half, from `start` on, `[B × B × D/2]`.
fn differences(x: &Tensor, y: &Tensor, start: i64) -> Tensor {
    let half = x.size()[1] / 2;
    x.narrow(1, start, half).unsqueeze(1) - y.narrow(1, start, half).unsqueeze(0)
}

/// What pulls each earlier state and, with the other sign, each later one, `[B × D/2]` each.
fn sums_over_partners(pulls: &Tensor) -> (Tensor, Tensor) {
    let sum = |dim: i64| pulls.sum_dim_intlist([dim].as_slice(), false, None);
    (sum(1), sum(0).neg())
}

/// One coordinate of one earlier state against all later ones: returns Σ_j pull_j (x − y_j) and
/// takes each term from the later state's slope. Sums in lanes, so that it runs in vectors.
fn push_apart<T: Real>(x: T, pull: &[T], y: &[T], y_slopes: &mut [T]) -> T {
    const LANES: usize = 16;
    let mut sums = [T::of(0.0); LANES];
    let n_whole = pull.len() / LANES * LANES;
    let blocks = pull.chunks_exact(LANES).zip(y.chunks_exact(LANES));
    for ((pull, y), slopes) in blocks.zip(y_slopes.chunks_exact_mut(LANES)) {
        for lane in 0..LANES {
            let push = pull[lane] * (x - y[lane]);
            sums[lane] += push;
            slopes[lane] -= push;
        }
    }
    for j in n_whole..pull.len() {
        let push = pull[j] * (x - y[j]);
        sums[0] += push;
        y_slopes[j] -= push;
    }
    sums.into_iter().fold(T::of(0.0), |sum, lane| sum + lane)
}

/// Fills the maximum, its coordinate and the root, row by row, all later states side by side.
fn forward<T: Real>(x: &Tensor, y: &Tensor, outputs: (&mut Tensor, &mut Tensor, &mut Tensor)) {
    let (n, half) = (x.size()[0] as usize, x.size()[1] as usize / 2);
    let y = y.transpose(0, 1).contiguous();
    let (y_ahead, y_apart) = values::<T>(&y).split_at(half * n);
    let (ahead, which, apart) = outputs;
    let rows = values_mut::<T>(ahead)
        .chunks_exact_mut(n)
        .zip(values_mut::<T>(which).chunks_exact_mut(n));
    let rows = rows.zip(values_mut::<T>(apart).chunks_exact_mut(n));
    for (x, ((ahead, which), apart)) in values::<T>(x).chunks_exact(2 * half).zip(rows) {
        ahead.fill(T::of(0.0));
        which.fill(T::of(-1.0));
        apart.fill(T::of(EPSILON));
        for (k, y) in y_ahead.chunks_exact(n).enumerate() {
            let (x, k) = (x[k], T::of(k as f64));
            for ((ahead, which), y) in ahead.iter_mut().zip(&mut *which).zip(y) {
                let difference = x - *y;
                let is_larger = difference > *ahead;
                *ahead = if is_larger { difference } else { *ahead };
                *which = if is_larger { k } else { *which };
            }
        }
        for (x, y) in x[half..].iter().zip(y_apart.chunks_exact(n)) {
            for (apart, y) in apart.iter_mut().zip(y) {
                let difference = *x - *y;
                *apart += difference * difference;
            }
        }
        for square in apart {
            *square = square.sqrt();
        }
    }
}

/// The same in one pass over all coordinates, where memory is fast and launches are slow.
fn forward_by_tensors(x: &Tensor, y: &Tensor, outputs: (&mut Tensor, &mut Tensor, &mut Tensor)) {
    let (ahead, which, apart) = outputs;
    let (largest, coordinate) = differences(x, y, 0).max_dim(-1, false);
    *which = coordinate
        .to_kind(x.kind())
        .masked_fill(&largest.le(0.0), -1.0);
    *ahead = largest.relu();
    let squares = differences(x, y, x.size()[1] / 2).square();
    *apart = (squares.sum_dim_intlist([-1_i64].as_slice(), false, None) + EPSILON).sqrt();
}

#[cfg(test)]
mod tests {
    use domain::random::{Rng, Stream};

    use super::*;
    use crate::net::matrix;

    const DOUBLE: (Kind, Device) = (Kind::Double, Device::Cpu);

    fn normals(columns: i64, step: u64) -> Tensor {
        let mut values = vec![0.0; 10 * columns as usize];
        Rng::new(8, Stream::Test, step).fill_normal(&mut values);
        matrix(&values, columns, DOUBLE)
    }

    #[test]
    fn both_roads_to_all_distances_agree() {
        let (x, y) = (normals(6, 3), normals(6, 4));
        let loops = Pairwise::new(&x, &y);
        let square = || Tensor::empty([10, 10], DOUBLE);
        let (mut ahead, mut which, mut apart) = (square(), square(), square());
        forward_by_tensors(&x, &y, (&mut ahead, &mut which, &mut apart));
        let close = |a: &Tensor, b: &Tensor| (a - b).abs().max().double_value(&[]) < 1e-12;
        assert!(close(&loops.distance(), &(ahead + apart)));
        assert!(close(
            &loops.distance(),
            &distance(&x.unsqueeze(1), &y.unsqueeze(0))
        ));
        assert!(close(&loops.which, &which));
        let slope = normals(10, 5);
        let (a, b) = loops.ahead_backward::<f64>(&slope);
        let (c, d) = loops.ahead_backward_by_tensors(&slope);
        assert!(close(&a, &c) && close(&b, &d));
        let (a, b) = loops.apart_backward::<f64>(&slope);
        let (c, d) = loops.apart_backward_by_tensors(&slope);
        assert!(close(&a, &c) && close(&b, &d));
    }

    #[test]
    fn states_that_are_their_own_positives_do_not_drown_the_gradient_in_noise() {
        let far_out = |double: Tensor| double + 1_000.0;
        let x = far_out(normals(64, 6));
        let y = far_out(normals(64, 7));
        y.narrow(0, 0, 5).copy_(&x.narrow(0, 0, 5)); // five at rest
        let slope = normals(10, 8);
        let gradient = |kind: Kind| {
            let (x, y) = (
                x.to_kind(Kind::Float).to_kind(kind),
                y.to_kind(Kind::Float).to_kind(kind),
            );
            let (x, y) = Pairwise::new(&x, &y).backward(&slope.to_kind(kind));
            Tensor::cat(&[x, y], 0).to_kind(Kind::Double)
        };
        let (single, double) = (gradient(Kind::Float), gradient(Kind::Double));
        let error = (single - &double).norm().double_value(&[]) / double.norm().double_value(&[]);
        assert!(error < 1e-4, "relative error {error}");
    }
}
