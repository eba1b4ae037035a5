//! The accelerations that physics and soft constraints agree on.
//!
//! They minimise `½ (a − a₀)ᵀ M (a − a₀) + Σ ½ wᵢ xᵢ²` with `x = J a − r`, where a₀ are the
//! accelerations without constraints and the sum goes over couplings and over those one-sided
//! constraints with x < 0. The function is convex and piecewise quadratic: Newton's method with an
//! exact search along each step ends at its only minimum.

/// One constraint, `x = J a − r`.
#[derive(Debug, Clone, Copy)]
pub(super) struct Row<const N: usize> {
    /// J
    pub(super) jacobian: [f64; N],
    /// r, the acceleration that it wants.
    pub(super) reference: f64,
    /// w; the constraint's force is −w x.
    pub(super) weight: f64,
    /// Whether x > 0 costs nothing.
    pub(super) is_one_sided: bool,
}

impl<const N: usize> Row<N> {
    fn residual(&self, a: &[f64; N]) -> f64 {
        dot(&self.jacobian, a) - self.reference
    }

    fn acts(&self, residual: f64) -> bool {
        !self.is_one_sided || residual < 0.0
    }

    /// The constraint's force at the accelerations `a`.
    pub(super) fn force(&self, a: &[f64; N]) -> f64 {
        let residual = self.residual(a);
        if self.acts(residual) {
            -self.weight * residual
        } else {
            0.0
        }
    }
}

/// `U` with `Uᵀ U = A`, right of the diagonal; the diagonal holds 1/Uᵢᵢ. Row by row, because rows
/// are what a processor adds many numbers of at once.
pub(super) struct Cholesky<const N: usize> {
    upper: [[f64; N]; N],
}

impl<const N: usize> Cholesky<N> {
    /// `None` when `matrix` is not positive definite.
    pub(super) fn new(matrix: &[[f64; N]; N]) -> Option<Self> {
        let mut upper = *matrix;
        for k in 0..N {
            let pivot = upper[k][k];
            if pivot.is_nan() || pivot <= 0.0 {
                return None;
            }
            let scale = 1.0 / pivot.sqrt();
            let row = upper[k].map(|x| x * scale);
            for i in k + 1..N {
                let factor = row[i];
                if factor != 0.0 {
                    for (entry, other) in upper[i][i..].iter_mut().zip(&row[i..]) {
                        *entry -= factor * other;
                    }
                }
            }
            upper[k] = row;
            upper[k][k] = scale;
        }
        Some(Self { upper })
    }

    /// x with `A x = b`.
    pub(super) fn solve(&self, b: &[f64; N]) -> [f64; N] {
        let mut x = *b;
        for k in 0..N {
            let row = &self.upper[k];
            x[k] *= row[k];
            let known = x[k];
            for (x, entry) in x[k + 1..].iter_mut().zip(&row[k + 1..]) {
                *x -= known * entry;
            }
        }
        for k in (0..N).rev() {
            let row = &self.upper[k];
            let sum: f64 = (k + 1..N).map(|i| row[i] * x[i]).sum();
            x[k] = (x[k] - sum) * row[k];
        }
        x
    }
}

/// Scratch of [`Solver::solve`].
#[derive(Debug, Default)]
pub(super) struct Solver {
    residuals: Vec<f64>,
    slopes: Vec<f64>,
}

/// More steps than any minimum has taken; a bound, not a setting.
const MAX_STEPS: usize = 60;
/// A gradient this small, relative to the forces at hand, is none.
const TOLERANCE: f64 = 1e-10;

impl Solver {
    /// The minimum.
    ///
    /// * `mass` – M
    /// * `free` – a₀
    /// * `guess` – accelerations to start from, if better than `free`
    pub(super) fn solve<const N: usize>(
        &mut self,
        mass: &[[f64; N]; N],
        free: &[f64; N],
        guess: &[f64; N],
        rows: &[Row<N>],
    ) -> [f64; N] {
        if rows.is_empty() {
            return *free;
        }
        let mut a = if cost(mass, free, rows, guess) < cost(mass, free, rows, free) {
            *guess
        } else {
            *free
        };
        self.residuals.clear();
        self.residuals
            .extend(rows.iter().map(|row| row.residual(&a)));
        for _ in 0..MAX_STEPS {
            let (gradient, size) = self.gradient(mass, free, rows, &a);
            if gradient.iter().all(|g| g.abs() <= TOLERANCE * size) {
                break;
            }
            let Some(factor) = Cholesky::new(&self.curvature(mass, rows)) else {
                break; // not finite: the step will say so
            };
            let step = factor.solve(&gradient).map(|x| -x);
            let length = self.search(mass, free, rows, &a, &step);
            for (a, step) in a.iter_mut().zip(&step) {
                *a += length * step;
            }
            let mut is_done = (length - 1.0).abs() < 1e-6;
            for ((residual, slope), row) in self.residuals.iter_mut().zip(&self.slopes).zip(rows) {
                let acted = row.acts(*residual);
                *residual += length * slope;
                is_done &= acted == row.acts(*residual);
            }
            if is_done {
                break; // the same quadratic as before, and its minimum
            }
        }
        a
    }

    /// The gradient, and the size of the forces that cancel in it.
    fn gradient<const N: usize>(
        &self,
        mass: &[[f64; N]; N],
        free: &[f64; N],
        rows: &[Row<N>],
        a: &[f64; N],
    ) -> ([f64; N], f64) {
        let difference = std::array::from_fn(|i| a[i] - free[i]);
        let mut gradient = times(mass, &difference);
        let mut size = gradient.iter().fold(1.0, |size: f64, g| size.max(g.abs()));
        for (row, residual) in rows.iter().zip(&self.residuals) {
            if row.acts(*residual) {
                let force = row.weight * residual;
                size = size.max(force.abs());
                for (g, j) in gradient.iter_mut().zip(&row.jacobian) {
                    *g += force * j;
                }
            }
        }
        (gradient, size)
    }

    /// `M + Jᵀ W J` over the rows that act.
    fn curvature<const N: usize>(&self, mass: &[[f64; N]; N], rows: &[Row<N>]) -> [[f64; N]; N] {
        let mut matrix = *mass;
        for (row, residual) in rows.iter().zip(&self.residuals) {
            if !row.acts(*residual) {
                continue;
            }
            for (line, &j) in matrix.iter_mut().zip(&row.jacobian) {
                if j != 0.0 {
                    let scaled = row.weight * j;
                    for (entry, other) in line.iter_mut().zip(&row.jacobian) {
                        *entry += scaled * other;
                    }
                }
            }
        }
        matrix
    }

    /// How far to go along `step`: the minimum of a convex, piecewise quadratic function of one
    /// variable, by Newton's method between bounds. Leaves J · step in `slopes`.
    fn search<const N: usize>(
        &mut self,
        mass: &[[f64; N]; N],
        free: &[f64; N],
        rows: &[Row<N>],
        a: &[f64; N],
        step: &[f64; N],
    ) -> f64 {
        self.slopes.clear();
        self.slopes
            .extend(rows.iter().map(|row| dot(&row.jacobian, step)));
        let pushed = times(mass, step);
        let curvature = dot(&pushed, step);
        let difference = std::array::from_fn(|i| a[i] - free[i]);
        let slope = dot(&pushed, &difference);
        let derivatives = |length: f64| {
            let (mut first, mut second) = (slope + length * curvature, curvature);
            for ((row, x), y) in rows.iter().zip(&self.residuals).zip(&self.slopes) {
                let residual = x + length * y;
                if row.acts(residual) {
                    first += row.weight * residual * y;
                    second += row.weight * y * y;
                }
            }
            (first, second)
        };
        let start = derivatives(0.0).0.abs();
        let (mut low, mut high, mut length) = (0.0, f64::INFINITY, 1.0);
        for _ in 0..MAX_STEPS {
            let (first, second) = derivatives(length);
            if first.abs() <= 1e-12 * start {
                break;
            }
            if first < 0.0 {
                low = length;
            } else {
                high = length;
            }
            let next = length - first / second;
            length = if next > low && next < high {
                next
            } else if high.is_finite() {
                f64::midpoint(low, high)
            } else {
                2.0 * length
            };
        }
        length
    }
}

/// Twice what is minimised.
fn cost<const N: usize>(
    mass: &[[f64; N]; N],
    free: &[f64; N],
    rows: &[Row<N>],
    a: &[f64; N],
) -> f64 {
    let difference = std::array::from_fn(|i| a[i] - free[i]);
    let inertial = dot(&times(mass, &difference), &difference);
    let violated = rows.iter().map(|row| {
        let residual = row.residual(a);
        if row.acts(residual) {
            row.weight * residual * residual
        } else {
            0.0
        }
    });
    inertial + violated.sum::<f64>()
}

/// Symmetric matrix times vector.
pub(super) fn times<const N: usize>(matrix: &[[f64; N]; N], v: &[f64; N]) -> [f64; N] {
    let mut product = [0.0; N];
    for (row, &x) in matrix.iter().zip(v) {
        for (sum, entry) in product.iter_mut().zip(row) {
            *sum += entry * x;
        }
    }
    product
}

fn dot<const N: usize>(a: &[f64; N], b: &[f64; N]) -> f64 {
    // Four sums that do not wait for each other.
    let mut sums = [0.0; 4];
    for i in 0..N {
        sums[i % 4] += a[i] * b[i];
    }
    (sums[0] + sums[1]) + (sums[2] + sums[3])
}

#[cfg(test)]
mod tests {
    use super::*;
    use domain::random::{Rng, Stream};

    fn random_problem(rng: &mut Rng, n_rows: usize) -> ([[f64; 5]; 5], Vec<Row<5>>) {
        let draw = |rng: &mut Rng| std::array::from_fn::<f64, 5, _>(|_| rng.normal());
        let mut mass = [[0.0; 5]; 5];
        for _ in 0..8 {
            let v = draw(rng);
            for i in 0..5 {
                for j in 0..5 {
                    mass[i][j] += v[i] * v[j];
                }
            }
        }
        let rows = (0..n_rows)
            .map(|k| Row {
                jacobian: draw(rng),
                reference: 10.0 * rng.normal(),
                weight: 10f64.powf(rng.uniform_in(-1.0, 4.0)),
                is_one_sided: k % 4 != 0,
            })
            .collect();
        (mass, rows)
    }

    #[test]
    fn physics_and_constraint_forces_balance_at_the_solution() {
        let mut rng = Rng::new(3, Stream::Test, 0);
        for n_rows in [1, 3, 12, 30] {
            let (mass, rows) = random_problem(&mut rng, n_rows);
            let free = std::array::from_fn(|_| 10.0 * rng.normal());
            let a = Solver::default().solve(&mass, &free, &[0.0; 5], &rows);
            let mut pull = times(&mass, &std::array::from_fn(|i| a[i] - free[i]));
            for row in &rows {
                let force = row.force(&a);
                assert!(!row.is_one_sided || force >= 0.0);
                for (pull, j) in pull.iter_mut().zip(&row.jacobian) {
                    *pull -= j * force;
                }
            }
            assert!(pull.iter().all(|p| p.abs() < 1e-6), "{n_rows}: {pull:?}");
        }
    }

    #[test]
    fn the_solution_does_not_depend_on_where_the_search_starts() {
        let mut rng = Rng::new(4, Stream::Test, 0);
        let (mass, rows) = random_problem(&mut rng, 20);
        let free = std::array::from_fn(|_| rng.normal());
        let from = |guess| Solver::default().solve(&mass, &free, &guess, &rows);
        let (a, b) = (from([0.0; 5]), from([300.0; 5]));
        let largest = a
            .iter()
            .zip(b)
            .map(|(a, b)| (a - b).abs())
            .fold(0.0, f64::max);
        assert!(largest < 1e-8, "{largest}");
    }

    #[test]
    fn without_constraints_nothing_changes() {
        let (mass, _) = random_problem(&mut Rng::new(5, Stream::Test, 0), 0);
        let free = [1.0, 2.0, 3.0, 4.0, 5.0];
        let a = Solver::default().solve(&mass, &free, &[9.0; 5], &[]);
        assert!(
            a.iter()
                .zip(free)
                .all(|(a, b)| (a - b).abs() < f64::EPSILON)
        );
    }
}
