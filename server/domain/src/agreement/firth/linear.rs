//! Small symmetric systems.

/// A symmetric matrix, `[K × K]`.
pub(super) struct Symmetric {
    n: usize,
    values: Vec<f64>,
}

/// The lower triangle L of a positive definite matrix A = L·Lᵀ.
pub(super) struct Cholesky {
    n: usize,
    values: Vec<f64>,
}

impl Symmetric {
    pub(super) fn zeros(n: usize) -> Self {
        Self {
            n,
            values: vec![0.0; n * n],
        }
    }

    /// Adds `weight · x·xᵀ`.
    pub(super) fn add_outer(&mut self, x: &[f64], weight: f64) {
        for (i, xi) in x.iter().enumerate() {
            for (j, xj) in x.iter().enumerate() {
                self.values[i * self.n + j] += weight * xi * xj;
            }
        }
    }

    /// `None` unless positive definite.
    pub(super) fn cholesky(&self) -> Option<Cholesky> {
        let n = self.n;
        let mut l = vec![0.0; n * n];
        for i in 0..n {
            for j in 0..=i {
                let before: f64 = (0..j).map(|k| l[i * n + k] * l[j * n + k]).sum();
                let rest = self.values[i * n + j] - before;
                if i != j {
                    l[i * n + j] = rest / l[j * n + j];
                } else if rest > 1e-13 * self.values[i * n + i] && rest.is_finite() {
                    l[i * n + i] = rest.sqrt();
                } else {
                    return None;
                }
            }
        }
        Some(Cholesky { n, values: l })
    }

    /// Solves A·x = b with the `held` row and column left out, where x is 0.
    pub(super) fn solve_without(&self, b: &[f64], held: Option<usize>) -> Option<Vec<f64>> {
        let kept: Vec<usize> = (0..self.n).filter(|&i| Some(i) != held).collect();
        let pairs = kept.iter().flat_map(|&i| kept.iter().map(move |&j| (i, j)));
        let part = Self {
            n: kept.len(),
            values: pairs.map(|(i, j)| self.values[i * self.n + j]).collect(),
        };
        let of_kept: Vec<f64> = kept.iter().map(|&i| b[i]).collect();
        let solved = part.cholesky()?.solve(&of_kept);
        let mut x = vec![0.0; self.n];
        kept.iter().zip(solved).for_each(|(&i, value)| x[i] = value);
        Some(x)
    }
}

impl Cholesky {
    pub(super) fn ln_determinant(&self) -> f64 {
        let diagonal = (0..self.n).map(|i| self.values[i * self.n + i].ln());
        2.0 * diagonal.sum::<f64>()
    }

    /// Solves A·x = b.
    pub(super) fn solve(&self, b: &[f64]) -> Vec<f64> {
        let (n, l) = (self.n, &self.values);
        let mut x = b.to_vec();
        for i in 0..n {
            let before: f64 = (0..i).map(|k| l[i * n + k] * x[k]).sum();
            x[i] = (x[i] - before) / l[i * n + i];
        }
        for i in (0..n).rev() {
            let after: f64 = (i + 1..n).map(|k| l[k * n + i] * x[k]).sum();
            x[i] = (x[i] - after) / l[i * n + i];
        }
        x
    }
}
