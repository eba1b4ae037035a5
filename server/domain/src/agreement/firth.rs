//! Logistic regression for few answers: Firth's penalty keeps it finite where answers separate.

use super::interval::{Estimate, Interval};
use super::special::{bisect, normal_z};
use linear::Symmetric;

mod linear;

/// Why a regression cannot be fitted.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum FirthError {
    /// Shapes that do not fit.
    #[error("{n_rows} rows of covariates for {n_outcomes} outcomes, or rows of unequal length")]
    Shape {
        /// Rows given.
        n_rows: usize,
        /// Outcomes given.
        n_outcomes: usize,
    },
    /// Too little to learn from: columns that depend on one another, fewer rows than columns, or
    /// values that are not finite.
    #[error("the covariates do not determine the coefficients")]
    Singular,
    /// The search for the maximum or an end of an interval did not end.
    #[error("the fit of coefficient {coefficient} does not converge")]
    Diverged {
        /// From 0.
        coefficient: usize,
    },
}

/// Fits P(yes) = 1/(1 + e^(−x·β)) by maximum penalised likelihood.
///
/// * `rows` – `[B][K]`, covariates of each answer; give a column of ones for an intercept
/// * `outcomes` – `[B]`
///
/// Each coefficient comes with its profile penalised likelihood interval, which exists where
/// Wald's breaks down.
///
/// Source: Firth (1993): log-likelihood + ½ log |I(β)|; Heinze and Schemper (2002) for the
/// intervals, as R's `logistf` makes them.
///
/// # Errors
/// When shapes do not fit or the covariates do not determine the coefficients.
pub fn firth(
    rows: &[Vec<f64>],
    outcomes: &[bool],
    level: f64,
) -> Result<Vec<Estimate>, FirthError> {
    let n_columns = rows.first().map_or(0, Vec::len);
    let is_whole = rows.len() == outcomes.len() && rows.iter().all(|r| r.len() == n_columns);
    if !is_whole || n_columns == 0 {
        return Err(FirthError::Shape {
            n_rows: rows.len(),
            n_outcomes: outcomes.len(),
        });
    }
    let problem = Problem { rows, outcomes };
    let best = problem
        .maximise(&vec![0.0; n_columns], None)
        .ok_or(FirthError::Singular)?;
    (0..n_columns)
        .map(|k| {
            let interval = problem
                .profile_interval(&best, k, level)
                .ok_or(FirthError::Diverged { coefficient: k })?;
            Ok(Estimate {
                value: best.coefficients[k],
                interval,
            })
        })
        .collect()
}

struct Problem<'a> {
    rows: &'a [Vec<f64>],
    outcomes: &'a [bool],
}

/// A maximum: where it is and how high.
struct Maximum {
    coefficients: Vec<f64>,
    height: f64,
}

/// The penalised log-likelihood at one place.
struct Place {
    height: f64,
    gradient: Vec<f64>,
    information: Symmetric,
}

impl Problem<'_> {
    /// `None` where the information is singular.
    fn look(&self, coefficients: &[f64]) -> Option<Place> {
        let n = coefficients.len();
        let mut information = Symmetric::zeros(n);
        let p: Vec<f64> = self
            .rows
            .iter()
            .map(|row| 1.0 / (1.0 + (-dot(row, coefficients)).exp()))
            .collect();
        for (row, p) in self.rows.iter().zip(&p) {
            information.add_outer(row, p * (1.0 - p));
        }
        let factor = information.cholesky()?;
        let mut height = 0.5 * factor.ln_determinant();
        let mut gradient = vec![0.0; n];
        for ((row, &p), &yes) in self.rows.iter().zip(&p).zip(self.outcomes) {
            let logit = dot(row, coefficients);
            // −ln(1 + e^(∓logit)) without overflow.
            let signed = if yes { logit } else { -logit };
            height += signed.min(0.0) - (-signed.abs()).exp().ln_1p();
            let leverage = p * (1.0 - p) * dot(row, &factor.solve(row));
            let residual = f64::from(u8::from(yes)) - p + leverage * (0.5 - p);
            gradient
                .iter_mut()
                .zip(row)
                .for_each(|(g, x)| *g += residual * x);
        }
        height.is_finite().then_some(Place {
            height,
            gradient,
            information,
        })
    }

    /// Climbs by scoring steps, halved where they lead down; `held` stays where it is.
    fn maximise(&self, start: &[f64], held: Option<usize>) -> Option<Maximum> {
        const MOST_STEPS: usize = 1_000;
        const LARGEST_STEP: f64 = 5.0;
        let mut at = start.to_vec();
        let mut place = self.look(&at)?;
        for _ in 0..MOST_STEPS {
            let mut step = place.information.solve_without(&place.gradient, held)?;
            let largest = step.iter().fold(0.0, |most: f64, s| most.max(s.abs()));
            let times = if largest > LARGEST_STEP {
                LARGEST_STEP / largest
            } else {
                1.0
            };
            for s in &mut step {
                *s *= times;
            }
            (at, place) = self.walk(&at, &step, place.height)?;
            if largest < 1e-12 {
                return Some(Maximum {
                    coefficients: at,
                    height: place.height,
                });
            }
        }
        None
    }

    /// The farthest of a step, its half, its quarter, … that does not lead down, rounding apart.
    fn walk(&self, from: &[f64], step: &[f64], height: f64) -> Option<(Vec<f64>, Place)> {
        const MOST_HALVINGS: i32 = 60;
        let lowest = height - 1e-12 * (1.0 + height.abs());
        (0..MOST_HALVINGS).find_map(|n| {
            let times = 0.5_f64.powi(n);
            let to: Vec<f64> = from.iter().zip(step).map(|(b, s)| b + times * s).collect();
            let seen = self.look(&to)?;
            (seen.height >= lowest).then_some((to, seen))
        })
    }

    /// Where the profile falls by half the quantile of χ² with one degree of freedom.
    fn profile_interval(&self, best: &Maximum, k: usize, level: f64) -> Option<Interval> {
        const MOST_DOUBLINGS: i32 = 60;
        let floor = best.height - normal_z(level).powi(2) / 2.0;
        let centre = best.coefficients[k];
        let is_above = |value: f64| {
            let mut start = best.coefficients.clone();
            start[k] = value;
            let profile = self.maximise(&start, Some(k));
            profile.is_some_and(|maximum| maximum.height > floor)
        };
        let first = (0.1 * centre.abs()).max(1e-6);
        let end = |direction: f64| {
            let outside = (0..MOST_DOUBLINGS)
                .map(|n| first * 2_f64.powi(n))
                .find(|reach| !is_above(centre + direction * reach))?;
            let reach = bisect(0.0, outside, |reach| is_above(centre + direction * reach));
            Some(centre + direction * reach)
        };
        Some(Interval {
            lo: end(-1.0)?,
            hi: end(1.0)?,
        })
    }
}

fn dot(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}

#[cfg(test)]
mod tests;
