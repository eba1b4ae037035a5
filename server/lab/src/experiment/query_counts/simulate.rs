//! Random queries, asked until what they imply orders the actions of every stage.

use domain::random::{Rng, Stream};
use serde::{Deserialize, Serialize};

/// How queries are drawn and how rewards of different stages compare.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum World {
    /// Both pairs of one stage.
    Aligned,
    /// Any two pairs; rewards of stages lie among one another.
    Conventional,
    /// Any two pairs; a stage's rewards all lie above or all below another's.
    ConventionalUnderBias,
}

impl World {
    /// All of them.
    pub const ALL: [Self; 3] = [
        Self::Aligned,
        Self::Conventional,
        Self::ConventionalUnderBias,
    ];
}

/// How many random queries, each of two different pairs and answered by the reward, it takes
/// until the order within every stage follows from the answers. Answers are remembered and
/// combined: from a < b and b < c follows a < c, through other stages too.
///
/// This is what a learner that ranks perfectly would need without choosing its queries. At
/// least one stage with two actions; with fewer there is nothing to order and it takes none.
pub fn queries_until_ordered(n_stages: usize, n_actions: usize, world: World, seed: u64) -> u64 {
    let members = ranks(n_stages, n_actions, world, seed);
    let mut known = Known::new(n_stages * n_actions);
    let mut open: Vec<(usize, usize)> = members
        .iter()
        .flat_map(|ranks| ranks.windows(2))
        .map(|neighbours| (neighbours[0], neighbours[1]))
        .collect();
    let mut rng = Rng::new(seed, Stream::Candidates, 0);
    let mut n_queries = 0;
    while !open.is_empty() {
        n_queries += 1;
        let [a, b] = draw(&members, world, &mut rng);
        if known.learn(a.min(b), a.max(b)) {
            open.retain(|&(low, high)| !known.follows(low, high));
        }
    }
    n_queries
}

/// Places of each stage's pairs in the order of all rewards, lowest first.
fn ranks(n_stages: usize, n_actions: usize, world: World, seed: u64) -> Vec<Vec<usize>> {
    let mut rng = Rng::new(seed, Stream::Reset, 0);
    if world == World::ConventionalUnderBias {
        let places = rng.permutation(n_stages).into_iter();
        return places
            .map(|place| (place * n_actions..(place + 1) * n_actions).collect())
            .collect();
    }
    let mut members: Vec<Vec<usize>> = rng
        .permutation(n_stages * n_actions)
        .chunks(n_actions)
        .map(<[usize]>::to_vec)
        .collect();
    for ranks in &mut members {
        ranks.sort_unstable();
    }
    members
}

/// Ranks of two different pairs.
fn draw(members: &[Vec<usize>], world: World, rng: &mut Rng) -> [usize; 2] {
    let n_actions = members[0].len();
    let pick = |rng: &mut Rng| (rng.below(members.len()), rng.below(n_actions));
    let first = pick(rng);
    loop {
        let mut second = pick(rng);
        if world == World::Aligned {
            second.0 = first.0;
        }
        if second != first {
            return [first, second].map(|(stage, action)| members[stage][action]);
        }
    }
}

/// Which ranks are known to be above which: the transitive closure of the answers.
struct Known {
    n_words: usize,
    /// For each rank a bit for every rank known to be above it.
    above: Vec<u64>,
}

impl Known {
    fn new(n: usize) -> Self {
        let n_words = n.div_ceil(64);
        Self {
            n_words,
            above: vec![0; n * n_words],
        }
    }

    fn follows(&self, low: usize, high: usize) -> bool {
        (self.above[low * self.n_words + high / 64] >> (high % 64)) & 1 == 1
    }

    /// Adds an answer with all that follows from it; false when it was known.
    fn learn(&mut self, low: usize, high: usize) -> bool {
        if self.follows(low, high) {
            return false;
        }
        let mut news = self.above[high * self.n_words..][..self.n_words].to_vec();
        news[high / 64] |= 1 << (high % 64);
        for rank in 0..=low {
            if rank == low || self.follows(rank, low) {
                let row = &mut self.above[rank * self.n_words..][..self.n_words];
                row.iter_mut().zip(&news).for_each(|(row, new)| *row |= new);
            }
        }
        true
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn mean_queries(n_stages: usize, n_actions: usize, world: World, n_seeds: u64) -> f64 {
        let counts = (0..n_seeds).map(|s| queries_until_ordered(n_stages, n_actions, world, s));
        counts.sum::<u64>() as f64 / n_seeds as f64
    }

    #[test]
    fn two_actions_a_stage_are_the_coupon_collectors_problem() {
        // A query of a stage settles it: S·(1 + 1/2 + … + 1/S) queries on average.
        let n_stages = 12_u32;
        let expected: f64 = (1..=n_stages)
            .map(|k| f64::from(n_stages) / f64::from(k))
            .sum();
        let found = mean_queries(12, 2, World::Aligned, 2_000);
        assert!(
            (found / expected - 1.0).abs() < 0.03,
            "{found} for {expected}"
        );
    }

    #[test]
    fn under_bias_each_stage_has_to_be_hit_by_chance() {
        // Two actions: one pair of C(2S, 2) settles a stage, and nothing else does.
        let n_stages = 6_u32;
        let n_pairs = f64::from(n_stages * (2 * n_stages - 1));
        let expected: f64 = (1..=n_stages).map(|k| n_pairs / f64::from(k)).sum();
        let found = mean_queries(6, 2, World::ConventionalUnderBias, 2_000);
        assert!(
            (found / expected - 1.0).abs() < 0.04,
            "{found} for {expected}"
        );
    }

    #[test]
    fn what_follows_from_answers_is_known_without_asking() {
        let mut known = Known::new(70);
        assert!(known.learn(3, 69) && known.learn(0, 3));
        assert!(known.follows(0, 69) && !known.follows(3, 0));
        assert!(!known.learn(0, 69), "nothing new");
    }

    #[test]
    fn random_queries_need_more_than_the_information_bound_and_most_under_bias() {
        let counts = super::super::counts(10, 5);
        let [aligned, conventional, biased] =
            World::ALL.map(|world| mean_queries(10, 5, world, 30));
        assert!(counts.aligned < aligned, "{aligned}");
        assert!(aligned < conventional && conventional < biased);
    }
}
