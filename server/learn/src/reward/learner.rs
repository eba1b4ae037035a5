//! How answers become rewards: what makes one method's fitting differ from another's.

use domain::query::Query;

use super::{Labeled, RewardEnsemble, RewardFit};
use crate::checkpoint::Archive;
use crate::error::LearnError;
use crate::replay::Replay;

/// What a fit may learn from.
#[derive(Clone, Copy)]
pub struct Lesson<'a> {
    /// Where the segments are.
    pub replay: &'a Replay,
    /// All answered queries so far, the oldest first.
    pub labeled: &'a [Labeled],
    /// Fresh pairs that nobody was asked about, as many as the learner wants.
    pub unlabeled: &'a [Query],
}

/// A way of fitting the ensemble.
pub trait RewardLearner: Send {
    /// Goes on from the ensemble's present weights.
    fn fit(&mut self, ensemble: &mut RewardEnsemble, lesson: &Lesson<'_>) -> RewardFit;

    /// Pairs that nobody is asked about, for each query of a session.
    fn unlabeled_per_query(&self) -> u32 {
        0
    }

    /// How often a fit at most takes rows of segments through the ensemble, in all answered segments'
    /// rows, a way back counting as two ways there: what it costs.
    fn ways_through(&self, max_epochs: u32) -> f64 {
        3.0 * f64::from(max_epochs)
    }

    /// Steps towards novelty that the ensemble takes beside each exploring update, before the
    /// first answer.
    fn warm_start_steps(&self) -> u32 {
        0
    }

    /// What it remembers between fits.
    fn save(&self, _archive: &mut Archive) {}

    /// What [`RewardLearner::save`] wrote.
    ///
    /// # Errors
    /// When a section is missing.
    fn load(&mut self, _archive: &Archive) -> Result<(), LearnError> {
        Ok(())
    }
}

/// All answers, as they are: B-Pref's, and the paper's.
#[derive(Debug, Clone, Copy)]
pub struct Supervised;

impl RewardLearner for Supervised {
    fn fit(&mut self, ensemble: &mut RewardEnsemble, lesson: &Lesson<'_>) -> RewardFit {
        ensemble.fit(lesson.replay, lesson.labeled)
    }
}
