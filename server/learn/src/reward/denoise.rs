//! RIME: answers that the ensemble finds unlikely are left out, very unlikely ones are turned round.

use serde::{Deserialize, Serialize};

use super::{Labeled, Lesson, RewardEnsemble, RewardFit, RewardLearner, summary};
use crate::checkpoint::Archive;
use crate::error::LearnError;
use crate::net::matrix;

/// Settings of RIME. Defaults: its released settings for MetaWorld.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct DenoisingConfig {
    /// How much the largest trusted divergence widens the lower threshold, α.
    pub slack: f64,
    /// How much the trusted divergences' variance widens it at the start, β; the paper's text
    /// says standard deviation.
    pub doubt: f64,
    /// The same after `decay_epochs`.
    pub least_doubt: f64,
    /// Epochs over which doubt falls, k; 60 for DMControl.
    pub decay_epochs: u64,
    /// Answers of a probability below this are turned round.
    pub flip_below: f64,
    /// Epochs before the accuracy may end a fit; 15 for DMControl.
    pub least_epochs: u32,
    /// Share of right answers, mean over members, above which a fit then ends.
    pub stop_accuracy: f32,
    /// Steps towards novelty beside each exploring update.
    pub warm_start_steps: u32,
}

impl Default for DenoisingConfig {
    fn default() -> Self {
        Self {
            slack: 0.5,
            doubt: 3.0,
            least_doubt: 1.0,
            decay_epochs: 600,
            flip_below: 0.001,
            least_epochs: 5,
            stop_accuracy: 0.98,
            warm_start_steps: 5,
        }
    }
}

/// What becomes of an answer for one epoch.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Verdict {
    /// It is trained on.
    Trusted,
    /// Its opposite is trained on.
    Flipped,
    /// It is left out.
    Distrusted,
}

/// Fits on the answers that the ensemble can believe.
///
/// Source: RIME, §4, as in its released code. Differs from the code: an answer that is both
/// trusted and turned round (before the first epoch everything is trusted) is trained on once,
/// turned round, where the code does so twice; equal answers diverge by their own entropy at
/// least, as in the code.
pub struct Denoising {
    config: DenoisingConfig,
    warm_up_epochs: u64,
    trusted: TrustedMoments,
    n_epochs: u64,
}

/// Moments of the divergences of trusted answers over all epochs.
#[derive(Debug, Clone, Copy, PartialEq)]
struct TrustedMoments {
    largest: f64,
    mean: f64,
    variance: f64,
    count: f64,
}

impl TrustedMoments {
    /// The largest and the mean follow by a tenth; the variance is pooled over everything.
    fn update(&mut self, values: &[f64]) {
        const RATE: f64 = 0.1;
        let n = values.len() as f64;
        if values.is_empty() {
            return;
        }
        let mean = values.iter().sum::<f64>() / n;
        let variance = values.iter().map(|v| (v - mean).powi(2)).sum::<f64>() / n;
        let (delta, total) = (mean - self.mean, self.count + n);
        let squares =
            self.variance * self.count + variance * n + delta * delta * self.count * n / total;
        let largest = values.iter().copied().fold(f64::NEG_INFINITY, f64::max);
        self.largest += RATE * (largest - self.largest);
        self.mean += RATE * delta;
        self.variance = squares / total;
        self.count = total;
    }
}

impl Denoising {
    /// `n_sessions` are those that the budget pays for, the last one in part: the ensemble's rate
    /// rises from zero over a third of their least epochs.
    pub fn new(config: &DenoisingConfig, n_sessions: f64) -> Self {
        let least = n_sessions * f64::from(config.least_epochs);
        Self {
            config: config.clone(),
            warm_up_epochs: (least / 3.0).round() as u64,
            trusted: TrustedMoments {
                largest: 0.0,
                mean: 0.0,
                variance: 1.0,
                count: 0.0,
            },
            n_epochs: 0,
        }
    }

    /// Divergence below which answers are trusted now, nats:
    /// −ln(m + 1e-8) + α m + min(β v, 3).
    pub fn lower_threshold(&self) -> f64 {
        let (c, m) = (&self.config, self.trusted.largest);
        let progress = self.n_epochs as f64 / c.decay_epochs.max(1) as f64;
        let doubt = (c.doubt - (c.doubt - c.least_doubt) * progress).max(c.least_doubt);
        -(m + 1e-8).ln() + c.slack * m + (doubt * self.trusted.variance).min(3.0)
    }

    /// Divergence above which answers are turned round, nats.
    pub fn upper_threshold(&self) -> f64 {
        -self.config.flip_below.ln()
    }

    /// What becomes of answers with these divergences in this epoch.
    fn judge(&mut self, divergences: &[f64]) -> Vec<Verdict> {
        let (lower, upper) = (self.lower_threshold(), self.upper_threshold());
        let trusted: Vec<f64> = divergences.iter().copied().filter(|d| *d < lower).collect();
        self.trusted.update(&trusted);
        let verdict = |d: &f64| {
            if *d > upper {
                Verdict::Flipped
            } else if *d < lower {
                Verdict::Trusted
            } else {
                Verdict::Distrusted
            }
        };
        divergences.iter().map(verdict).collect()
    }

    /// Share of its rate with which the ensemble learns now.
    fn rate(&self) -> f64 {
        (self.n_epochs as f64 / self.warm_up_epochs.max(1) as f64).min(1.0)
    }
}

impl RewardLearner for Denoising {
    fn fit(&mut self, ensemble: &mut RewardEnsemble, lesson: &Lesson<'_>) -> RewardFit {
        let mut fit = RewardFit::default();
        if lesson.labeled.is_empty() {
            return fit;
        }
        let rates = ensemble.config.rates(ensemble.config.max_epochs as usize);
        for (epoch, falling) in (0..).zip(rates) {
            let verdicts = self.judge(&ensemble.divergences(lesson));
            let believed = believed(lesson.labeled, &verdicts);
            let rate = self.rate() * falling;
            self.n_epochs += 1;
            if !believed.is_empty() {
                let passes = ensemble.epoch(lesson.replay, &believed, rate);
                fit = summary(&passes, epoch + 1);
            }
            if fit.accuracy > self.config.stop_accuracy && epoch > self.config.least_epochs {
                break;
            }
        }
        fit
    }

    fn warm_start_steps(&self) -> u32 {
        self.config.warm_start_steps
    }

    fn save(&self, archive: &mut Archive) {
        let t = &self.trusted;
        archive.put_f64("reward.trusted", &[t.largest, t.mean, t.variance, t.count]);
        archive.put_json("reward.denoised_epochs", &self.n_epochs);
    }

    fn load(&mut self, archive: &Archive) -> Result<(), LearnError> {
        let [largest, mean, variance, count] = archive.f64("reward.trusted")?;
        self.trusted = TrustedMoments {
            largest,
            mean,
            variance,
            count,
        };
        self.n_epochs = archive.json("reward.denoised_epochs")?;
        Ok(())
    }
}

/// What is trained on for one epoch.
fn believed(labeled: &[Labeled], verdicts: &[Verdict]) -> Vec<Labeled> {
    let pairs = labeled.iter().zip(verdicts);
    pairs
        .filter_map(|(labeled, verdict)| match verdict {
            Verdict::Trusted => Some(*labeled),
            Verdict::Flipped => Some(Labeled {
                preference: labeled.preference.flipped(),
                ..*labeled
            }),
            Verdict::Distrusted => None,
        })
        .collect()
}

impl RewardEnsemble {
    /// Cross-entropy of each answer under the members' mean probability, nats: the divergence
    /// for certain answers.
    fn divergences(&self, lesson: &Lesson<'_>) -> Vec<f64> {
        let queries: Vec<_> = lesson.labeled.iter().map(|l| l.query).collect();
        let probabilities = self.probabilities(lesson.replay, &queries);
        let n_members = probabilities.len() as f64;
        let divergence = |(index, labeled): (usize, &Labeled)| {
            let of = |member: &Vec<f32>| f64::from(member[index]);
            let second = probabilities.iter().map(of).sum::<f64>() / n_members;
            let target = f64::from(labeled.preference.target());
            let part = |share: f64, p: f64| if share > 0.0 { -share * p.ln() } else { 0.0 };
            part(target, second) + part(1.0 - target, 1.0 - second)
        };
        lesson.labeled.iter().enumerate().map(divergence).collect()
    }

    /// One Adam step of every member towards `targets` `[B]` for rows `[B × S]`, `[B × A]`: mean
    /// squared error, summed over members.
    pub fn regress(&mut self, observations: &[f32], actions: &[f32], targets: &[f32]) {
        let input = self.input(&super::joined(observations, actions, targets.len()));
        let (output, tape) = self.net.forward_taped(&input);
        let reward = output.tanh();
        let error = &reward - matrix(targets, 1, self.options);
        let slopes = error * (2.0 / targets.len() as f64) * (1.0 - reward.square());
        self.parameters.zero_gradient();
        self.net
            .backward(&tape, &slopes, Some(&mut self.gradient), None);
        self.parameters.step();
    }
}

#[cfg(test)]
mod tests {
    use domain::answer::{Preference, Which};
    use domain::random::{Rng, Stream};

    use super::super::tests::{labeled, replay, small};
    use super::Verdict::{Distrusted, Flipped, Trusted};
    use super::*;
    use crate::device::Device;
    use crate::reward::RewardConfig;

    fn denoising(n_sessions: f64) -> Denoising {
        Denoising::new(&DenoisingConfig::default(), n_sessions)
    }

    /// By hand: all 18.42 + 3·1 → min 3 = 21.42 at first; then m = 0.1 · 8 = 0.8 and
    /// v = var(0.1, 0.3, 2, 8) = 10.27, so −ln 0.8 + 0.4 + 3 = 3.623.
    #[test]
    fn everything_is_trusted_at_first_and_thresholds_close_in() {
        let mut denoising = denoising(10.0);
        assert!((denoising.upper_threshold() - 6.907_755).abs() < 1e-5);
        assert!((denoising.lower_threshold() - 21.420_681).abs() < 1e-5);
        let divergences = [0.1, 0.3, 2.0, 8.0];
        let verdicts = denoising.judge(&divergences);
        assert_eq!(verdicts, [Trusted, Trusted, Trusted, Flipped]);
        assert!((denoising.trusted.largest - 0.8).abs() < 1e-12);
        assert!((denoising.trusted.variance - 10.265).abs() < 1e-9);
        assert!((denoising.lower_threshold() - 3.623_144).abs() < 1e-5);
        let verdicts = denoising.judge(&[0.1, 3.5, 4.0, 8.0]);
        assert_eq!(verdicts, [Trusted, Trusted, Distrusted, Flipped]);
        assert!((denoising.trusted.largest - (0.8 + 0.1 * 2.7)).abs() < 1e-12);
    }

    /// β falls from 3 to 1 over 600 epochs; with v = 0.5 the term is 1.5, 1, 0.5.
    #[test]
    fn doubt_falls_with_the_epochs_and_the_rate_rises() {
        let mut denoising = denoising(12.0);
        denoising.trusted.variance = 0.5;
        let mut term = |epoch| {
            denoising.n_epochs = epoch;
            let calm = -1e-8_f64.ln();
            (denoising.lower_threshold() - calm, denoising.rate())
        };
        for (epoch, doubt, rate) in [(0, 1.5, 0.0), (10, 1.483_333, 0.5), (300, 1.0, 1.0)] {
            let (found, rate_found) = term(epoch); // 12 sessions of 5 epochs: 20 to warm up
            assert!((found - doubt).abs() < 1e-5 && (rate_found - rate).abs() < 1e-12);
        }
        assert!((term(9_000).0 - 0.5).abs() < 1e-9);
    }

    #[test]
    fn a_flipped_answer_is_turned_round_and_a_distrusted_one_left_out() {
        let replay = replay(6);
        let labeled = labeled(&replay, 3, |_| 5);
        let verdicts = [Verdict::Flipped, Verdict::Distrusted, Verdict::Trusted];
        let believed = believed(&labeled, &verdicts);
        assert_eq!(believed.len(), 2);
        assert_eq!(believed[0].preference, labeled[0].preference.flipped());
        assert_eq!(believed[1], labeled[2]);
        assert_eq!(Preference::Equal.flipped(), Preference::Equal);
    }

    /// One answer in five is wrong. Plain fitting learns the wrong ones by heart; the denoising
    /// one leaves them out or turns them round.
    #[test]
    fn wrong_answers_do_less_harm() {
        let replay = replay(40);
        let right: Vec<Labeled> = labeled(&replay, 300, |_| 10)
            .into_iter()
            .filter(|l| l.preference != Preference::Equal)
            .collect();
        let mut told = right.clone();
        for labeled in told.iter_mut().step_by(5) {
            labeled.preference = labeled.preference.flipped();
        }
        let config = RewardConfig {
            learning_rate: 3e-3,
            max_epochs: 60,
            stop_accuracy: 1.0,
            ..small()
        };
        let lesson = Lesson {
            replay: &replay,
            labeled: &told,
            unlabeled: &[],
        };
        let share_right = |ensemble: &RewardEnsemble| {
            let queries: Vec<_> = right.iter().map(|l| l.query).collect();
            let probabilities = ensemble.probabilities(&replay, &queries);
            let is_right = |(p, l): (&f32, &Labeled)| {
                (*p > 0.5) == (l.preference == Preference::Prefer(Which::Second))
            };
            let pairs = probabilities[0].iter().zip(&right);
            pairs.filter(|pair| is_right(*pair)).count() as f64 / right.len() as f64
        };
        let new = || RewardEnsemble::new(&config, 3, 2, 1, Device::CPU);
        let (mut plain, mut denoised) = (new(), new());
        plain.fit(&replay, &told);
        denoising(1.0).fit(&mut denoised, &lesson);
        let (plain, denoised) = (share_right(&plain), share_right(&denoised));
        assert!(
            denoised > plain + 0.02,
            "denoised {denoised}, plain {plain}"
        );
    }

    #[test]
    fn a_warm_start_brings_the_members_to_the_targets() {
        let config = RewardConfig {
            learning_rate: 3e-3,
            ..small()
        };
        let mut ensemble = RewardEnsemble::new(&config, 3, 2, 1, Device::CPU);
        let mut rng = Rng::new(8, Stream::Test, 0);
        let mut values = vec![0.0; 50 * 5];
        rng.fill_normal(&mut values);
        let (observations, actions) = values.split_at(50 * 3);
        let targets: Vec<f32> = observations
            .chunks(3)
            .map(|s| (0.5 * s[0]).clamp(-1.0, 1.0))
            .collect();
        let error = |ensemble: &RewardEnsemble| {
            let predicted = ensemble.predict(observations, actions);
            let squares = predicted.iter().zip(&targets).map(|(p, t)| (p - t).powi(2));
            squares.sum::<f32>() / 50.0
        };
        let before = error(&ensemble);
        for _ in 0..100 {
            ensemble.regress(observations, actions, &targets);
        }
        let after = error(&ensemble);
        assert!(after < 0.2 * before, "{before} {after}");
    }

    #[test]
    fn an_interrupted_learner_goes_on_bit_for_bit() {
        let replay = replay(6);
        let labeled = labeled(&replay, 40, |_| 5);
        let lesson = Lesson {
            replay: &replay,
            labeled: &labeled,
            unlabeled: &[],
        };
        let new = || RewardEnsemble::new(&small(), 3, 2, 1, Device::CPU);
        let (mut ensemble, mut whole, mut archive) = (new(), denoising(3.0), Archive::new());
        whole.fit(&mut ensemble, &lesson);
        ensemble.save(&mut archive);
        whole.save(&mut archive);
        let (mut other, mut resumed) = (new(), denoising(3.0));
        other.load(&archive).expect("loads");
        resumed.load(&archive).expect("loads");
        let expected = whole.fit(&mut ensemble, &lesson);
        assert_eq!(resumed.fit(&mut other, &lesson), expected);
        assert_eq!(resumed.trusted, whole.trusted);
    }
}
