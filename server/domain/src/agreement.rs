//! How far labelers agree, and how sure a number from few observations is.
//!
//! Every estimate comes with an interval at a level that the caller chooses, and every interval
//! says which one it is and where it is from.

mod bootstrap;
mod center;
mod firth;
mod interval;
mod kappa;
mod proportion;
mod ratings;
mod special;
mod strata;
mod superiority;

pub use bootstrap::Bootstrap;
pub use center::{interquartile_mean, mean};
pub use firth::{FirthError, firth};
pub use interval::{Estimate, Interval};
pub use kappa::cohens_kappa;
pub use proportion::{Share, newcombe};
pub use ratings::{Ratings, self_consistency};
pub use strata::{Continuity, StratifiedTest, Stratum, cochran_mantel_haenszel};
pub use superiority::probability_of_superiority;

#[cfg(test)]
mod tests {
    use super::Interval;

    pub(super) fn assert_close(found: f64, expected: f64, allowed: f64) {
        assert!(
            (found - expected).abs() <= allowed,
            "{found} for {expected}"
        );
    }

    pub(super) fn assert_interval(found: Interval, [lo, hi]: [f64; 2], allowed: f64) {
        assert_close(found.lo, lo, allowed);
        assert_close(found.hi, hi, allowed);
    }
}
