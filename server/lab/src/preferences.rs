//! Every query that was asked and what is known of its answer.

use std::collections::BTreeMap;

use domain::answer::Preference;
use domain::query::{Query, QueryKey};
use domain::teacher::Answered;
use learn::reward::Labeled;
use serde::{Deserialize, Serialize};

/// One asked query: references only, so that answers cost next to no memory.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub(crate) struct Asked {
    /// Its name.
    pub key: QueryKey,
    /// The two segments.
    pub query: Query,
    /// What is known.
    pub state: AnswerState,
}

/// What is known of an asked query's answer.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub(crate) enum AnswerState {
    /// Nothing yet.
    Open,
    /// Refused; a replacement was asked, unless skips use up budget.
    Skipped,
    /// Trained on from the next fit.
    Preferred(Preference),
}

/// All asked queries, in the order of their keys.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
#[serde(from = "Vec<Asked>", into = "Vec<Asked>")]
pub(crate) struct Preferences(BTreeMap<QueryKey, Asked>);

impl From<Vec<Asked>> for Preferences {
    fn from(asked: Vec<Asked>) -> Self {
        Self(asked.into_iter().map(|a| (a.key, a)).collect())
    }
}

impl From<Preferences> for Vec<Asked> {
    fn from(preferences: Preferences) -> Self {
        preferences.0.into_values().collect()
    }
}

impl Preferences {
    /// Notes that a query is asked; asking it again changes nothing.
    pub(crate) fn ask(&mut self, key: QueryKey, query: Query) {
        self.0.entry(key).or_insert(Asked {
            key,
            query,
            state: AnswerState::Open,
        });
    }

    /// Takes an answer in; a later one for the same query replaces an earlier one. Says what
    /// was known before, or `None` for a query that was never asked.
    pub(crate) fn answer(&mut self, answered: &Answered) -> Option<AnswerState> {
        let asked = self.0.get_mut(&answered.key)?;
        let state = answered
            .preference
            .map_or(AnswerState::Skipped, AnswerState::Preferred);
        Some(std::mem::replace(&mut asked.state, state))
    }

    /// What is known of one query.
    pub(crate) fn state(&self, key: QueryKey) -> Option<AnswerState> {
        self.0.get(&key).map(|a| a.state)
    }

    /// All queries so far.
    pub(crate) fn asked(&self) -> Vec<Query> {
        self.0.values().map(|a| a.query).collect()
    }

    /// All queries so far with their names, in the order of these.
    pub(crate) fn keyed(&self) -> Vec<(QueryKey, Query)> {
        self.0.values().map(|a| (a.key, a.query)).collect()
    }

    /// Preferences so far: what the budget counts, beside skips where these use it up.
    pub(crate) fn n_preferred(&self) -> u32 {
        self.count(|state| matches!(state, AnswerState::Preferred(_)))
    }

    /// Queries that were refused and are so still.
    pub(crate) fn n_skipped(&self) -> u32 {
        self.count(|state| state == AnswerState::Skipped)
    }

    /// Queries that nobody has answered yet, those of sessions that are over among them.
    pub(crate) fn n_open(&self) -> u32 {
        self.count(|state| state == AnswerState::Open)
    }

    fn count(&self, is: impl Fn(AnswerState) -> bool) -> u32 {
        self.0.values().filter(|asked| is(asked.state)).count() as u32
    }

    /// What the reward ensemble trains on.
    pub(crate) fn labeled(&self, train_on_equal: bool) -> Vec<Labeled> {
        let trainable = self.0.values().filter_map(|asked| match asked.state {
            AnswerState::Preferred(preference) => Some(Labeled {
                query: asked.query,
                preference,
            }),
            AnswerState::Open | AnswerState::Skipped => None,
        });
        trainable
            .filter(|l| train_on_equal || l.preference != Preference::Equal)
            .collect()
    }
}
