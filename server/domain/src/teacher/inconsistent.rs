//! The teacher who judges now by one standard, now by another.

use super::{Judge, Myopic, Oracle, rng};
use crate::answer::Preference;
use crate::query::OfferedQuery;

/// For each query a coin decides: the myopic answer, or the oracle's with a chance of a flip.
///
/// Source: STAIR's "Inconsistent" teacher, a mixture of myopic (γ = 0.9) and mistaken (ε = 0.2);
/// the paper does not say how they are mixed, the even coin is ours.
#[derive(Debug, Clone, Copy)]
pub struct Inconsistent {
    /// γ of the myopic half.
    pub discount: f64,
    /// ε of the mistaken half.
    pub mistake: f64,
    /// Of the run.
    pub seed: u64,
}

impl Judge for Inconsistent {
    fn judge(&self, query: &OfferedQuery) -> Option<Preference> {
        let mut rng = rng(self.seed, query.key);
        let (is_myopic, is_flipped) = (rng.chance(0.5), rng.chance(self.mistake));
        if is_myopic {
            let discount = self.discount;
            return Myopic { discount }.judge(query);
        }
        let preference = Oracle.judge(query)?;
        Some(if is_flipped {
            preference.flipped()
        } else {
            preference
        })
    }
}
