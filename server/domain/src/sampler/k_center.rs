//! Queries unlike any that were asked before.

use super::{Beliefs, QuerySampler, descending};
use crate::query::Query;
use crate::random::Rng;

/// Asks, again and again, the candidate farthest from its nearest neighbour among all asked and
/// chosen queries, by the L2 distance between the states of both segments.
///
/// The order is greedy, so that its start is the choice for any number of queries. Before
/// anything was asked, the first of the shortlist is the first choice. Candidates outside the
/// shortlist follow in its order.
///
/// Source: PEBBLE's released code, samplers `k`, `kd` and `ke`.
#[derive(Debug, Clone, Copy)]
pub struct KCenter(pub Shortlist);

/// Which candidates are compared.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Shortlist {
    /// All of them.
    All,
    /// The half on which the members are most divided.
    Divided,
    /// The half of which the members are least sure.
    Unsure,
}

impl QuerySampler for KCenter {
    fn rank(&self, candidates: &[Query], beliefs: &mut dyn Beliefs, _rng: &mut Rng) -> Vec<usize> {
        let half = candidates.len().div_ceil(2);
        let (order, n_listed) = match self.0 {
            Shortlist::All => ((0..candidates.len()).collect(), candidates.len()),
            Shortlist::Divided => (descending(&beliefs.disagreement(candidates)), half),
            Shortlist::Unsure => (descending(&beliefs.entropy(candidates)), half),
        };
        let (listed, others) = order.split_at(n_listed);
        let queries: Vec<Query> = listed.iter().map(|&i| candidates[i]).collect();
        let chosen = farthest_first(&beliefs.states(&queries), &beliefs.asked_states());
        let listed = chosen.into_iter().map(|place| listed[place]);
        listed.chain(others.iter().copied()).collect()
    }
}

/// All of `points`, each the farthest from what is `taken` and from those before it.
fn farthest_first(points: &[Vec<f32>], taken: &[Vec<f32>]) -> Vec<usize> {
    let nearest = |point: &Vec<f32>| {
        let squares = taken.iter().map(|other| squared_distance(point, other));
        squares.fold(f32::INFINITY, f32::min)
    };
    let mut distances: Vec<f32> = points.iter().map(nearest).collect();
    let mut left: Vec<usize> = (0..points.len()).collect();
    let mut chosen = Vec::with_capacity(points.len());
    while !left.is_empty() {
        let mut farthest = 0;
        for place in 1..left.len() {
            if distances[left[place]] > distances[left[farthest]] {
                farthest = place;
            }
        }
        let next = left.remove(farthest);
        chosen.push(next);
        for &index in &left {
            let square = squared_distance(&points[index], &points[next]);
            distances[index] = distances[index].min(square);
        }
    }
    chosen
}

fn squared_distance(a: &[f32], b: &[f32]) -> f32 {
    a.iter().zip(b).map(|(a, b)| (a - b) * (a - b)).sum()
}
