//! Several pairs of segments as rows of one matrix, and their logits.

use domain::episode::Segment;
use domain::query::Query;

use crate::replay::Replay;

/// Rows of several pairs, first then second segment, each padded to the longest.
pub(super) struct Chunk {
    /// `[2 · pairs · longest × (S + A)]`.
    pub(super) rows: Vec<f32>,
    /// Steps of each segment.
    lens: Vec<usize>,
    longest: usize,
    temperature: f64,
}

impl Chunk {
    pub(super) fn gather<'a>(
        replay: &Replay,
        queries: impl Iterator<Item = &'a Query>,
        longest: usize,
        temperature: f64,
    ) -> Self {
        let shape = replay.shape();
        let segment_len = longest * (shape.observation + shape.action);
        let (mut rows, mut lens) = (Vec::new(), Vec::new());
        for segment in queries.flat_map(|query| [query.first, query.second]) {
            replay.append_segment_rows(segment, &mut rows);
            lens.push(segment.len as usize);
            rows.resize(lens.len() * segment_len, 0.0);
        }
        Self {
            rows,
            lens,
            longest,
            temperature,
        }
    }

    /// (Σ r(second) − Σ r(first)) / temperature of each pair, from one number a row.
    pub(super) fn logits(&self, rewards: &[f32]) -> Vec<f64> {
        let sum =
            |(reward, &len): (&[f32], &usize)| reward[..len].iter().copied().map(f64::from).sum();
        let sums: Vec<f64> = rewards
            .chunks(self.longest)
            .zip(&self.lens)
            .map(sum)
            .collect();
        let logit = |pair: &[f64]| (pair[1] - pair[0]) / self.temperature;
        sums.chunks_exact(2).map(logit).collect()
    }

    /// What each row's reward adds to the loss, from what each pair's logit does.
    pub(super) fn row_slopes(&self, slopes: &[f64]) -> Vec<f32> {
        let mut rows = vec![0.0; self.lens.len() * self.longest];
        for (index, (rows, &len)) in rows.chunks_mut(self.longest).zip(&self.lens).enumerate() {
            let sign = if index % 2 == 0 { -1.0 } else { 1.0 };
            rows[..len].fill((sign * slopes[index / 2] / self.temperature) as f32);
        }
        rows
    }
}

/// Steps of the longer segment.
pub(super) fn longest(query: &Query) -> usize {
    let len = |segment: Segment| segment.len as usize;
    len(query.first).max(len(query.second)).max(1)
}
