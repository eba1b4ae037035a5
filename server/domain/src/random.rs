//! Random numbers that can be taken up again anywhere: keyed by (seed, stream, step).
//!
//! Nothing about a generator is ever saved. Whoever needs random numbers at step `k` makes
//! the generator of step `k`; an interrupted run therefore draws what it would have drawn.

/// Who draws: streams with different names never share a number.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[repr(u32)]
pub enum Stream {
    /// Poses drawn by an environment's reset.
    Reset = 1,
    /// Initial weights.
    Weights = 2,
    /// Seeds of a run's training episodes.
    EpisodeSeed = 3,
    /// Seeds of evaluation episodes.
    EvaluationSeed = 4,
    /// Actions while exploring (uniform, then sampled from the policy).
    Action = 5,
    /// Rows of a SAC batch.
    Batch = 6,
    /// Noise of the policy inside a SAC update.
    Policy = 7,
    /// Candidate pairs of segments.
    Candidates = 8,
    /// A sampler's own choices.
    Sampler = 9,
    /// A scripted teacher's mistakes.
    Teacher = 10,
    /// Order of the preferences while the reward ensemble is fitted.
    RewardFit = 11,
    /// Rows and positives of the temporal distance.
    Temporal = 12,
    /// Scripted or random policies outside a run, noise on experts.
    Rollout = 13,
    /// Left and right.
    Side = 14,
    /// Statistics by resampling.
    Bootstrap = 15,
    /// Order, crops and unanswered pairs of semi-supervised fitting.
    SemiSupervised = 16,
    /// Noise of the policy inside a step that steers the rewards.
    Steering = 17,
    /// Rows on which the reward ensemble is warm-started.
    WarmStart = 18,
    /// Pairs that nobody is asked about.
    Unlabeled = 19,
    /// Order of the states while the timestep classifier is fitted.
    TimestepFit = 20,
    /// Segments and pairs of a study, and in which order a labeler meets them.
    Study = 21,
    /// Tests.
    Test = 99,
}

/// Philox 4×32 with ten rounds: a counter-based generator (Salmon et al., 2011).
#[derive(Debug, Clone)]
pub struct Rng {
    key: [u32; 2],
    counter: [u32; 4],
    block: [u32; 4],
    n_used: usize,
}

impl Rng {
    /// The generator of one step of one stream of one seed.
    pub fn new(seed: u64, stream: Stream, step: u64) -> Self {
        let key = mix(seed ^ mix(u64::from(stream as u32)));
        Self {
            key: [key as u32, (key >> 32) as u32],
            counter: [0, 0, step as u32, (step >> 32) as u32],
            block: [0; 4],
            n_used: 4,
        }
    }

    /// 32 random bits.
    pub fn next_u32(&mut self) -> u32 {
        if self.n_used == 4 {
            self.block = philox(self.counter, self.key);
            let block = (u64::from(self.counter[1]) << 32 | u64::from(self.counter[0])) + 1;
            self.counter[0] = block as u32;
            self.counter[1] = (block >> 32) as u32;
            self.n_used = 0;
        }
        self.n_used += 1;
        self.block[self.n_used - 1]
    }

    /// 64 random bits.
    pub fn next_u64(&mut self) -> u64 {
        u64::from(self.next_u32()) << 32 | u64::from(self.next_u32())
    }

    /// Uniform in [0, 1), 53 bits.
    pub fn uniform(&mut self) -> f64 {
        (self.next_u64() >> 11) as f64 / (1u64 << 53) as f64
    }

    /// Uniform in [lo, hi).
    pub fn uniform_in(&mut self, lo: f64, hi: f64) -> f64 {
        lo + (hi - lo) * self.uniform()
    }

    /// Uniform in {0, …, n − 1}, without bias worth naming (n ≪ 2⁶⁴).
    ///
    /// # Panics
    /// When `n` is zero: there is nothing to draw.
    pub fn below(&mut self, n: usize) -> usize {
        assert!(n > 0, "Rng::below needs something to draw from");
        ((u128::from(self.next_u64()) * n as u128) >> 64) as usize
    }

    /// True with probability `p`.
    pub fn chance(&mut self, p: f64) -> bool {
        self.uniform() < p
    }

    /// Standard normal (Box–Muller; the second value of each pair is dropped).
    pub fn normal(&mut self) -> f64 {
        let (u, v) = (1.0 - self.uniform(), self.uniform());
        (-2.0 * u.ln()).sqrt() * (std::f64::consts::TAU * v).cos()
    }

    /// Fills with standard normals in f32, both values of each Box–Muller pair used.
    pub fn fill_normal(&mut self, out: &mut [f32]) {
        const UNIT: f32 = 1.0 / (1u32 << 24) as f32;
        for pair in out.chunks_mut(2) {
            let u = ((self.next_u32() >> 8) + 1) as f32 * UNIT;
            let v = (self.next_u32() >> 8) as f32 * UNIT;
            let radius = (-2.0 * u.ln()).sqrt();
            let (sin, cos) = (std::f32::consts::TAU * v).sin_cos();
            pair[0] = radius * cos;
            if let Some(second) = pair.get_mut(1) {
                *second = radius * sin;
            }
        }
    }

    /// A uniformly random order of {0, …, n − 1} (Fisher–Yates).
    pub fn permutation(&mut self, n: usize) -> Vec<usize> {
        let mut order: Vec<usize> = (0..n).collect();
        for i in (1..n).rev() {
            order.swap(i, self.below(i + 1));
        }
        order
    }
}

/// `SplitMix64`'s finaliser: spreads a key's bits.
fn mix(x: u64) -> u64 {
    let x = x.wrapping_add(0x9E37_79B9_7F4A_7C15);
    let x = (x ^ (x >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
    let x = (x ^ (x >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
    x ^ (x >> 31)
}

fn philox(mut c: [u32; 4], mut k: [u32; 2]) -> [u32; 4] {
    for _ in 0..10 {
        let a = u64::from(c[0]) * 0xD251_1F53;
        let b = u64::from(c[2]) * 0xCD9E_8D57;
        c = [
            (b >> 32) as u32 ^ c[1] ^ k[0],
            b as u32,
            (a >> 32) as u32 ^ c[3] ^ k[1],
            a as u32,
        ];
        k = [
            k[0].wrapping_add(0x9E37_79B9),
            k[1].wrapping_add(0xBB67_AE85),
        ];
    }
    c
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn philox_agrees_with_the_published_vectors() {
        assert_eq!(
            philox([0; 4], [0; 2]),
            [0x6627_e8d5, 0xe169_c58d, 0xbc57_ac4c, 0x9b00_dbd8]
        );
        assert_eq!(
            philox([u32::MAX; 4], [u32::MAX; 2]),
            [0x408f_276d, 0x41c8_3b0e, 0xa20b_c7c6, 0x6d54_51fd]
        );
    }

    #[test]
    fn a_step_can_be_drawn_again_and_steps_differ() {
        let draw = |step| Rng::new(7, Stream::Test, step).next_u64();
        assert_eq!(draw(3), draw(3));
        assert_ne!(draw(3), draw(4));
        assert_ne!(draw(3), Rng::new(7, Stream::Batch, 3).next_u64());
    }

    #[test]
    fn normals_have_mean_zero_and_variance_one() {
        let mut values = vec![0.0; 100_001];
        Rng::new(1, Stream::Test, 0).fill_normal(&mut values);
        let n = values.len() as f32;
        let mean = values.iter().sum::<f32>() / n;
        let variance = values.iter().map(|v| (v - mean).powi(2)).sum::<f32>() / n;
        assert!(
            mean.abs() < 0.015 && (variance - 1.0).abs() < 0.02,
            "mean {mean}, variance {variance}"
        );
    }

    #[test]
    fn a_permutation_holds_each_index_once() {
        let mut order = Rng::new(1, Stream::Test, 0).permutation(100);
        order.sort_unstable();
        assert_eq!(order, (0..100).collect::<Vec<_>>());
    }
}
