//! What the members see, brought to one level and spread.

use serde::{Deserialize, Serialize};
use tch::{Kind, Tensor};

use super::matrix;
use crate::replay::Replay;

/// Spread below which a number counts as constant and is only moved, not stretched.
const LEAST_STD: f64 = 1e-4;
/// How many spreads from the mean a number can be; what lies further out is taken for that.
const FARTHEST: f64 = 5.0;

/// Mean and spread of each number of state and action; actions are left alone.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub(super) struct Moments {
    mean: Vec<f32>,
    /// 1 / standard deviation.
    factor: Vec<f32>,
}

impl Moments {
    /// Over all transitions, `None` without any.
    pub(super) fn of(replay: &Replay) -> Option<Self> {
        if replay.is_empty() {
            return None;
        }
        let shape = replay.shape();
        let columns = shape.observation + shape.action;
        let (mut sums, mut squares) = (vec![0.0; columns], vec![0.0; columns]);
        let mut rows = Vec::new();
        for lane in 0..replay.n_lanes() {
            rows.clear();
            replay.append_lane_rows(lane, 0..replay.lane_len(lane), &mut rows);
            for row in rows.chunks_exact(columns) {
                for ((sum, square), value) in sums.iter_mut().zip(&mut squares).zip(row) {
                    let value = f64::from(*value);
                    *sum += value;
                    *square += value * value;
                }
            }
        }
        let n = replay.len() as f64;
        let mut moments = Self {
            mean: vec![0.0; columns],
            factor: vec![1.0; columns],
        };
        for column in 0..shape.observation {
            let mean = sums[column] / n;
            let std = (squares[column] / n - mean * mean).max(0.0).sqrt();
            moments.mean[column] = mean as f32;
            if std > LEAST_STD {
                moments.factor[column] = (1.0 / std) as f32;
            }
        }
        Some(moments)
    }
}

/// The same where the members are.
pub(super) struct Inputs {
    pub(super) moments: Moments,
    mean: Tensor,
    factor: Tensor,
}

impl Inputs {
    pub(super) fn new(moments: Moments, options: (Kind, tch::Device)) -> Self {
        let columns = moments.mean.len() as i64;
        Self {
            mean: matrix(&moments.mean, columns, options),
            factor: matrix(&moments.factor, columns, options),
            moments,
        }
    }

    /// Rows `[n × (S + A)]` as the members see them.
    pub(super) fn apply(&self, rows: &Tensor) -> Tensor {
        ((rows - &self.mean) * &self.factor).clamp(-FARTHEST, FARTHEST)
    }
}
