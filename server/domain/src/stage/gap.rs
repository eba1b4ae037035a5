//! The distance between two segments by the ends of both, and what bounds it.

/// Mean of the four distances from an end of the first segment to an end of the second.
///
/// * `distance` – from the first to the second argument; need not be symmetric
/// * `first`, `second` – start and end of each segment
///
/// Source: STAIR, Eq. 8 (quadrilateral distance).
pub fn stage_gap<S: Copy>(distance: impl Fn(S, S) -> f64, first: [S; 2], second: [S; 2]) -> f64 {
    let from = |end| distance(end, second[0]) + distance(end, second[1]);
    (from(first[0]) + from(first[1])) / 4.0
}

/// How many of the four pairs of ends, one of each segment, lie in one stage: 0, 1, 2 or 4.
///
/// The paper's alignment cases are 4 (A: all ends together), 2 (B: starts together and ends
/// together), 1 (C: one pair) and 0 (D: none).
pub fn n_aligned<W: PartialEq + Copy>(first: [W; 2], second: [W; 2]) -> usize {
    let with = |end: &W| second.iter().filter(|other| *other == end).count();
    with(&first[0]) + with(&first[1])
}

/// What a temporal distance keeps to on a task whose stages are clear-cut, nats.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct StageGeometry {
    /// δ_s⁺: states of one stage are at most so far apart.
    pub within: f64,
    /// δ_c⁻: states of different stages are at least so far apart.
    pub across: f64,
    /// Δ⁺: no two states are farther apart.
    pub any: f64,
}

/// The least and the greatest that a stage gap can be, nats.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct GapBounds {
    /// It is not smaller.
    pub least: f64,
    /// It is not greater.
    pub greatest: f64,
}

impl StageGeometry {
    /// Bounds of the gap between segments with so many aligned pairs of ends: each aligned pair
    /// contributes [0, δ_s⁺], each other one [δ_c⁻, Δ⁺], and the gap is their mean.
    ///
    /// Source: STAIR, appendix, table of alignment cases; its four cases are `n_aligned` 4, 2, 1
    /// and 0. Both bounds fall as alignment grows.
    ///
    /// ```
    /// use domain::stage::StageGeometry;
    /// let geometry = StageGeometry { within: 1.0, across: 2.0, any: 5.0 };
    /// assert_eq!(geometry.gap_bounds(2).greatest, (1.0 + 5.0) / 2.0);
    /// ```
    pub fn gap_bounds(&self, n_aligned: usize) -> GapBounds {
        let aligned = n_aligned as f64 / 4.0;
        GapBounds {
            least: (1.0 - aligned) * self.across,
            greatest: aligned * self.within + (1.0 - aligned) * self.any,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::random::{Rng, Stream};

    const N: usize = 14;

    /// Shortest ways on a random directed graph: a quasimetric, not a metric.
    fn random_quasimetric(rng: &mut Rng) -> [[f64; N]; N] {
        let mut d = [[0.0; N]; N];
        for (a, row) in d.iter_mut().enumerate() {
            for (b, length) in row.iter_mut().enumerate() {
                *length = if a == b {
                    0.0
                } else {
                    rng.uniform_in(0.1, 10.0)
                };
            }
        }
        for via in 0..N {
            for a in 0..N {
                for b in 0..N {
                    d[a][b] = d[a][b].min(d[a][via] + d[via][b]);
                }
            }
        }
        d
    }

    /// The tightest numbers that fulfil the assumptions.
    fn geometry(d: &[[f64; N]; N], stages: &[usize; N]) -> StageGeometry {
        let mut tight = StageGeometry {
            within: 0.0,
            across: f64::INFINITY,
            any: 0.0,
        };
        for a in 0..N {
            for b in 0..N {
                tight.any = tight.any.max(d[a][b]);
                if stages[a] == stages[b] {
                    tight.within = tight.within.max(d[a][b]);
                } else {
                    tight.across = tight.across.min(d[a][b]);
                }
            }
        }
        tight
    }

    #[test]
    fn on_random_quasimetrics_every_gap_lies_within_its_cases_bounds() {
        let mut rng = Rng::new(0, Stream::Test, 0);
        let mut seen = [0; 5];
        for _ in 0..30 {
            let d = random_quasimetric(&mut rng);
            let stages: [usize; N] = std::array::from_fn(|_| rng.below(5));
            let geometry = geometry(&d, &stages);
            for _ in 0..500 {
                let mut ends = || [rng.below(N), rng.below(N)];
                let (first, second) = (ends(), ends());
                let gap = stage_gap(|a, b| d[a][b], first, second);
                let case = n_aligned(first.map(|s| stages[s]), second.map(|s| stages[s]));
                let bounds = geometry.gap_bounds(case);
                seen[case] += 1;
                assert!(
                    bounds.least - 1e-12 <= gap && gap <= bounds.greatest + 1e-12,
                    "{gap} with {case} aligned pairs, {bounds:?}"
                );
            }
        }
        assert!([0, 1, 2, 4].iter().all(|&case| seen[case] > 50), "{seen:?}");
        assert_eq!(seen[3], 0, "three pairs of one stage make it four");
    }

    #[test]
    fn both_bounds_fall_strictly_as_alignment_grows() {
        let mut rng = Rng::new(1, Stream::Test, 0);
        for _ in 0..100 {
            let within = rng.uniform_in(0.0, 3.0);
            let across = rng.uniform_in(0.1, 3.0);
            let geometry = StageGeometry {
                within,
                across,
                any: within.max(across) + rng.uniform_in(0.1, 3.0),
            };
            let bounds = [4, 2, 1, 0].map(|case| geometry.gap_bounds(case));
            assert!(bounds.is_sorted_by(|a, b| a.least < b.least));
            assert!(bounds.is_sorted_by(|a, b| a.greatest < b.greatest));
        }
    }

    #[test]
    fn the_four_cases_have_the_papers_bounds() {
        let (within, across, any) = (1.0, 2.0, 8.0);
        let geometry = StageGeometry {
            within,
            across,
            any,
        };
        let at = |first, second| {
            let bounds = geometry.gap_bounds(n_aligned(first, second));
            (bounds.least, bounds.greatest)
        };
        assert_eq!(at([1, 1], [1, 1]), (0.0, within), "A");
        assert_eq!(
            at([1, 2], [1, 2]),
            (across / 2.0, f64::midpoint(within, any)),
            "B"
        );
        let c = (3.0 * across / 4.0, (within + 3.0 * any) / 4.0);
        assert_eq!(at([1, 2], [1, 3]), c, "C");
        assert_eq!(at([1, 2], [3, 4]), (across, any), "D");
    }
}
