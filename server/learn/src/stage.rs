//! How far apart in the task the two segments of a query are, by the learned temporal distance
//! or without it.

use domain::episode::Segment;
use domain::query::Query;
use serde::{Deserialize, Serialize};

use crate::replay::Replay;
use crate::temporal::TemporalDistance;

/// What stands for the stage of a state; smaller gaps are better aligned in each.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum StageApproximator {
    /// Mean of the four temporal distances between the ends of both segments: STAIR, Eq. 8.
    Quadrilateral,
    /// The same, mean of both directions. The paper's runs from the first segment to the second.
    SymmetricQuadrilateral,
    /// A state's stage is its temporal distance from the start of its episode; segments are
    /// intervals of stages. The paper's STAIR (ISR).
    Intervals,
    /// A state's stage is its step in its episode; segments are intervals of steps.
    Timestep,
    /// A state's stage is what the task itself says, and a distance how many stages apart two
    /// states are: Eq. 8 without anything learned, so 0 within a true stage alone. Its ends are the
    /// states after a segment's first and last step, which a clip shows and by which people and
    /// [`is_same_stage`](domain::query::is_same_stage) judge; the learned distance's are those
    /// before these steps.
    True,
}

impl StageApproximator {
    /// Whether somebody has to learn a temporal distance for it.
    pub fn needs_temporal_distance(self) -> bool {
        !matches!(self, Self::Timestep | Self::True)
    }

    /// Whether the task has to know its stages.
    pub fn needs_true_stages(self) -> bool {
        self == Self::True
    }

    /// What its gaps are told in.
    pub fn unit(self) -> &'static str {
        match self {
            Self::Quadrilateral | Self::SymmetricQuadrilateral => "nats",
            Self::Intervals | Self::Timestep => "share of an interval",
            Self::True => "stages",
        }
    }

    /// Gap of each query, `[N]`, in its [unit](Self::unit). Empty without the temporal distance or
    /// the true stages that it needs.
    ///
    /// # Panics
    /// When a segment is not in the replay.
    pub fn gap(
        self,
        replay: &Replay,
        temporal: Option<&TemporalDistance>,
        queries: &[Query],
    ) -> Vec<f32> {
        match (self, temporal) {
            (Self::Timestep, _) => {
                let steps =
                    |s: Segment| (s.start as f32, (s.start + s.len.saturating_sub(1)) as f32);
                let gap = |q: &Query| interval_gap(steps(q.first), steps(q.second));
                queries.iter().map(gap).collect()
            }
            (Self::Quadrilateral, Some(temporal)) => temporal.stage_gap(replay, queries),
            (Self::SymmetricQuadrilateral, Some(temporal)) => {
                let swapped: Vec<Query> = queries.iter().map(|q| q.swapped()).collect();
                let there = temporal.stage_gap(replay, queries);
                let back = temporal.stage_gap(replay, &swapped);
                let means = there.iter().zip(&back).map(|(a, b)| 0.5 * (a + b));
                means.collect()
            }
            (Self::Intervals, Some(temporal)) => {
                let gap = |q: &Query| {
                    let [first, second] = [q.first, q.second].map(|s| stages(replay, temporal, s));
                    interval_gap(first, second)
                };
                queries.iter().map(gap).collect()
            }
            (Self::True, _) => {
                let gap = |q: &Query| true_gap(replay.stages(q.first), replay.stages(q.second));
                let gaps: Option<Vec<f32>> = queries.iter().map(gap).collect();
                gaps.unwrap_or_default()
            }
            (_, None) => Vec::new(),
        }
    }
}

/// Mean number of stages between either end of one segment and either end of the other; `None`
/// where the task does not know its stages.
///
/// * `first`, `second` – true stage of each state of a segment, `[H]`
fn true_gap(first: &[u8], second: &[u8]) -> Option<f32> {
    let ends = |stages: &[u8]| Some([*stages.first()?, *stages.last()?]);
    let (first, second) = (ends(first)?, ends(second)?);
    let apart = |a: u8| second.map(|b| f32::from(a.abs_diff(b))).iter().sum::<f32>();
    Some(first.map(apart).iter().sum::<f32>() / 4.0)
}

/// Smallest and largest distance from the episode's first state to a state of the segment.
fn stages(replay: &Replay, temporal: &TemporalDistance, segment: Segment) -> (f32, f32) {
    let (mut starts, mut states) = (Vec::new(), Vec::new());
    for t in segment.start..segment.start + segment.len {
        starts.extend_from_slice(replay.observation(segment.episode, 0));
        states.extend_from_slice(replay.observation(segment.episode, t as usize));
    }
    let distances = temporal.distance(&starts, &states);
    let lo = distances.iter().copied().fold(f32::INFINITY, f32::min);
    (lo, distances.into_iter().fold(f32::NEG_INFINITY, f32::max))
}

/// (1 − gIoU)/2 of two intervals: 0 for equal ones, ½ for touching ones, towards 1 far apart.
///
/// Differs from the paper: its index (named ISR, and larger for better aligned segments) leaves
/// (−1, 1] for nested intervals and is undefined for equal points; the generalised
/// intersection over union agrees with it elsewhere.
pub fn interval_gap(first: (f32, f32), second: (f32, f32)) -> f32 {
    let hull = first.1.max(second.1) - first.0.min(second.0);
    let overlap = first.1.min(second.1) - first.0.max(second.0);
    if hull > 0.0 {
        0.5 * (1.0 - overlap / hull)
    } else {
        0.0
    }
}

#[cfg(test)]
mod tests {
    use domain::episode::EpisodeId;

    use super::*;
    use crate::device::Device;
    use crate::replay::walked::walked;
    use crate::temporal::TemporalConfig;

    fn query(first: (u32, u32), second: (u32, u32), len: u32) -> Query {
        let segment = |(episode, start)| Segment {
            episode: EpisodeId(episode),
            start,
            len,
        };
        Query {
            first: segment(first),
            second: segment(second),
        }
    }

    /// Two episodes that walk along a line at different speeds.
    fn replay() -> Replay {
        let state = |speed: u8, t: u8| vec![f32::from(t * speed), 1.0];
        walked(
            2,
            [1, 2].map(|speed| (0..=30).map(|t| state(speed, t)).collect()),
        )
    }

    fn temporal() -> TemporalDistance {
        let config = TemporalConfig {
            hidden: vec![16],
            latent: 8,
            ..TemporalConfig::default()
        };
        TemporalDistance::new(&config, 2, 1, Device::CPU)
    }

    #[test]
    fn intervals_are_equal_nested_touching_or_far_apart() {
        let close = |a, b, expected: f32| (interval_gap(a, b) - expected).abs() < 1e-6;
        assert!(close((1.0, 3.0), (1.0, 3.0), 0.0));
        assert!(close((0.0, 10.0), (1.0, 2.0), 0.45)); // the paper's index would be 4.5
        assert!(close((0.0, 1.0), (1.0, 2.0), 0.5));
        assert!(close((0.0, 1.0), (9.0, 10.0), 0.9));
        assert!(close((9.0, 10.0), (0.0, 1.0), 0.9));
        assert!(close((2.0, 2.0), (2.0, 2.0), 0.0));
    }

    /// With H = 5, ISR = (4 − D)/(4 + D) for starts D apart.
    #[test]
    fn the_timestep_gap_ranks_by_the_distance_of_the_starts() {
        let replay = replay();
        let at = |start| query((0, 3), (1, start), 5);
        let queries: Vec<Query> = [3, 4, 1, 9, 20].map(at).into();
        let gaps = StageApproximator::Timestep.gap(&replay, None, &queries);
        for (gap, apart) in gaps.iter().zip([0.0, 1.0, 2.0, 6.0, 17.0]) {
            let index = (4.0 - apart) / (4.0 + apart);
            assert!((gap - 0.5 * (1.0 - index)).abs() < 1e-6, "{gap} {apart}");
        }
        assert!(gaps.is_sorted());
    }

    #[test]
    fn the_true_gap_counts_stages_between_the_ends_and_is_0_within_a_stage_alone() {
        let is = |a: &[u8], b: &[u8], expected: f32| {
            let gaps = [true_gap(a, b).unwrap(), true_gap(b, a).unwrap()];
            assert!(
                gaps.iter().all(|gap| (gap - expected).abs() < 1e-6),
                "{gaps:?}"
            );
        };
        is(&[1, 1, 1], &[1, 1, 1], 0.0);
        is(&[0, 0, 0], &[2, 2, 2], 2.0);
        is(&[0, 1, 1], &[0, 0, 1], 0.5); // both go from one to the next
        is(&[0, 0, 1], &[0, 0, 0], 0.5);
        is(&[2, 2, 2], &[0, 0, 1], 1.5);
        let unknown = StageApproximator::True.gap(&replay(), None, &[query((0, 3), (1, 3), 5)]);
        assert!(unknown.is_empty());
    }

    #[test]
    fn the_symmetric_gap_is_the_same_from_either_side_and_the_papers_is_not() {
        let replay = replay();
        let temporal = temporal();
        let gap =
            |how: StageApproximator, a, b| how.gap(&replay, Some(&temporal), &[query(a, b, 5)])[0];
        let (a, b) = ((0, 2), (1, 20));
        let both = |how| (gap(how, a, b), gap(how, b, a));
        let (there, back) = both(StageApproximator::Quadrilateral);
        assert!((there - back).abs() > 1e-4, "{there} {back}");
        let (one, other) = both(StageApproximator::SymmetricQuadrilateral);
        assert!((one - other).abs() < 1e-6 && (one - 0.5 * (there + back)).abs() < 1e-6);
        let (one, other) = both(StageApproximator::Intervals);
        assert!((one - other).abs() < 1e-6, "{one} {other}");
        let nothing = StageApproximator::Intervals.gap(&replay, None, &[query(a, b, 5)]);
        assert!(nothing.is_empty());
    }

    /// One state after another lies farther from the start, so nearer segments have smaller gaps.
    #[test]
    fn intervals_of_a_segment_with_itself_have_no_gap() {
        let replay = replay();
        let temporal = temporal();
        let queries = [query((0, 3), (0, 3), 5), query((0, 3), (0, 20), 5)];
        let gaps = StageApproximator::Intervals.gap(&replay, Some(&temporal), &queries);
        assert!(gaps[0].abs() < 1e-6 && gaps[1] > 0.1, "{gaps:?}");
    }
}
