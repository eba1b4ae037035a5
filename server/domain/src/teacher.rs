//! Whoever answers queries: a person, a program over HTTP, or a script inside the run.

use serde::{Deserialize, Serialize};

use crate::answer::{Preference, Which};
use crate::episode::SegmentRecord;
use crate::query::{OfferedQuery, QueryKey};
use crate::random::{Rng, Stream};

mod equal;
mod inconsistent;
mod mistaken;
mod myopic;
mod noisy;
mod oracle;
mod skip;
mod threshold;

pub use equal::Equal;
pub use inconsistent::Inconsistent;
pub use mistaken::Mistaken;
pub use myopic::Myopic;
pub use noisy::Noisy;
pub use oracle::Oracle;
pub use skip::Skip;
pub use threshold::Threshold;

/// An answer as a run receives it.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Answered {
    /// Which query.
    pub key: QueryKey,
    /// `None` for a skip: no budget is used and a replacement is asked.
    ///
    /// Differs from B-Pref, where a skipped query uses the budget and is not replaced
    /// (`queries.bpref_skips`).
    pub preference: Option<Preference>,
    /// Gap-free number of the answer in its run, from 1; a later one supersedes an earlier
    /// one for the same query.
    pub sequence: u64,
}

/// A mailbox for queries. Neither method ever blocks.
pub trait Teacher: Send {
    /// Puts queries to the teacher. Asking the same key again changes nothing.
    ///
    /// # Errors
    /// When the queries could not be kept; the run stops rather than wait for an answer that
    /// cannot come.
    fn ask(&mut self, queries: &[OfferedQuery]) -> Result<(), TeacherError>;

    /// Answers with a sequence number above `after`, in order.
    ///
    /// # Errors
    /// When the answers cannot be read.
    fn collect(&mut self, after: u64) -> Result<Vec<Answered>, TeacherError>;
}

/// Why a teacher cannot go on.
#[derive(Debug, Clone, thiserror::Error)]
#[error("{0}")]
pub struct TeacherError(pub String);

/// A rule that answers one query; what makes one scripted teacher differ from another.
pub trait Judge: Send {
    /// The preference for a query, a pure function of it and the judge's seed.
    fn judge(&self, query: &OfferedQuery) -> Option<Preference>;
}

/// A script inside the run: answers as soon as it is asked.
pub struct Scripted {
    judge: Box<dyn Judge>,
    answered: Vec<Answered>,
    n_before: u64,
}

impl Scripted {
    /// `n_before`: answers that the run has already consumed (it is resuming).
    pub fn new(judge: Box<dyn Judge>, n_before: u64) -> Self {
        Self {
            judge,
            answered: Vec::new(),
            n_before,
        }
    }
}

impl Teacher for Scripted {
    fn ask(&mut self, queries: &[OfferedQuery]) -> Result<(), TeacherError> {
        for query in queries {
            if self.answered.iter().any(|a| a.key == query.key) {
                continue;
            }
            let sequence = self.n_before + self.answered.len() as u64 + 1;
            self.answered.push(Answered {
                key: query.key,
                preference: self.judge.judge(query),
                sequence,
            });
        }
        Ok(())
    }

    fn collect(&mut self, after: u64) -> Result<Vec<Answered>, TeacherError> {
        Ok(self
            .answered
            .iter()
            .filter(|a| a.sequence > after)
            .copied()
            .collect())
    }
}

/// How irregular the scripted teachers are; each reads what its name says. Defaults: B-Pref's
/// presets, and the paper's for the inconsistent teacher.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct TeacherSettings {
    /// β of `noisy`: how surely the larger sum of task rewards is preferred.
    pub rationality: f64,
    /// γ of `myopic` and `inconsistent`, (0, 1]: how much less a step counts than the next.
    pub discount: f64,
    /// ε of `mistaken`: chance of a flip.
    pub mistake: f64,
    /// ε of the mistaken half of `inconsistent`.
    pub inconsistent_mistake: f64,
    /// ε of `equal`: sums closer than this share of a typical segment's are equal.
    pub equal: f64,
    /// ε of `skip`: two sums below this share of a typical segment's are skipped.
    pub skip: f64,
    /// Whether the shares carry the slip of all B-Pref forks, which square them from the second
    /// session on: 0.1 then acts as 0.01.
    pub teacher_eps_squared: bool,
}

impl Default for TeacherSettings {
    fn default() -> Self {
        Self {
            rationality: 1.0,
            discount: 0.9,
            mistake: 0.1,
            inconsistent_mistake: 0.2,
            equal: 0.1,
            skip: 0.1,
            teacher_eps_squared: false,
        }
    }
}

/// Names that `--teacher` takes, with what each does.
pub const SCRIPTED: &[(&str, &str)] = &[
    ("oracle", "prefers the segment with the larger task return"),
    ("mistaken", "the oracle, with every tenth answer flipped"),
    (
        "noisy",
        "the surer, the larger the difference in task return",
    ),
    ("myopic", "looks more at a segment's end than at its start"),
    ("equal", "calls close segments equal"),
    ("skip", "skips a query when both segments are poor"),
    ("inconsistent", "by a coin's choice myopic or mistaken"),
    (
        "coin",
        "answers at random: a control that must not teach anything",
    ),
];

/// The scripted teacher of that name, with its part of the settings.
pub fn judge(name: &str, seed: u64, settings: &TeacherSettings) -> Option<Box<dyn Judge>> {
    let threshold = |share| Threshold {
        share,
        is_squared: settings.teacher_eps_squared,
    };
    Some(match name {
        "oracle" => Box::new(Oracle),
        "mistaken" => Box::new(Mistaken {
            probability: settings.mistake,
            seed,
        }),
        "noisy" => Box::new(Noisy {
            rationality: settings.rationality,
            seed,
        }),
        "myopic" => Box::new(Myopic {
            discount: settings.discount,
        }),
        "equal" => Box::new(Equal {
            threshold: threshold(settings.equal),
        }),
        "skip" => Box::new(Skip {
            threshold: threshold(settings.skip),
        }),
        "inconsistent" => Box::new(Inconsistent {
            discount: settings.discount,
            mistake: settings.inconsistent_mistake,
            seed,
        }),
        "coin" => Box::new(Mistaken {
            probability: 0.5,
            seed,
        }),
        _ => return None,
    })
}

/// The random numbers with which a teacher answers one query.
fn rng(seed: u64, key: QueryKey) -> Rng {
    let step = u64::from(key.session) << 32 | u64::from(key.index);
    Rng::new(seed, Stream::Teacher, step)
}

/// Sum of a segment's task rewards.
pub fn task_return(segment: &SegmentRecord) -> f64 {
    segment.task_rewards.iter().map(|r| r.0).sum()
}

/// The larger one; a tie goes to the first, as in B-Pref's released code (β ≤ 0).
fn prefer_larger(first: f64, second: f64) -> Preference {
    Preference::Prefer(if first < second {
        Which::Second
    } else {
        Which::First
    })
}

#[cfg(test)]
mod tests;
