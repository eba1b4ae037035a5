//! Made-up runs for tests, told in rows as an experiment leaves them.

use super::RowFile;
use crate::experiment::grid::RunKey;
use crate::experiment::results::{Content, FinishedRow, Results, Row, RunResult};
use crate::message::{Evaluation, SessionClosed, SessionOffered};

/// A run with these evaluations at every thousandth step, each after ten more answers.
pub(super) struct Told {
    pub task: &'static str,
    pub method: &'static str,
    pub setting: &'static str,
    pub seed: u64,
    pub budget: u32,
    pub success: &'static [f64],
    pub same_stage: f64,
    pub oracle_agreement: Option<f64>,
}

pub(super) const STAIR: Told = Told {
    task: "go-fetch-return",
    method: "stair",
    setting: "",
    seed: 1,
    budget: 80,
    success: &[0.0, 0.5, 1.0],
    same_stage: 0.75,
    oracle_agreement: None,
};

impl Told {
    fn key(&self) -> RunKey {
        RunKey {
            task: self.task.into(),
            method: self.method.into(),
            teacher: "oracle".into(),
            setting: self.setting.into(),
            seed: self.seed,
        }
    }

    pub(super) fn end(&self) -> FinishedRow {
        FinishedRow {
            total_steps: 3_000,
            labels: 30,
            budget: self.budget,
            evaluation_episodes: 50,
            evaluation_every: 1_000,
            has_success: true,
            weights: "ab".into(),
            settings: format!("{}-{}", self.method, self.budget),
            config: toml::Table::new(),
            revision: "abc".into(),
            machine: "two cores".into(),
            wall_s: 60.0,
        }
    }

    pub(super) fn rows(&self, end: FinishedRow) -> String {
        let mut contents = vec![Content::Session(SessionOffered {
            step: 1_500,
            session: 1,
            n_queries: 5,
            disagreement_chosen: None,
            disagreement_pool: None,
            stage_gap_chosen: Some(1.0),
            stage_gap_pool: Some(4.0),
            same_stage_chosen: Some(self.same_stage),
            same_stage_pool: Some(0.5),
            stage_gap_auc: Some(0.875),
            symmetric_gap_chosen: Some(1.0),
            symmetric_gap_pool: Some(2.0),
            symmetric_gap_auc: Some(0.625),
        })];
        contents.push(Content::Answered(SessionClosed {
            session: 1,
            step: 1_500,
            labels: 15,
            epochs: 1,
            loss: 0.1,
            accuracy: 1.0,
            oracle_agreement: self.oracle_agreement,
        }));
        contents.extend(self.success.iter().enumerate().map(|(n, success)| {
            Content::Evaluation(Evaluation {
                step: 1_000 * (n as u64 + 1),
                labels: 10 * (n as u32 + 1),
                success_rate: *success,
                episodes: 50,
                return_mean: 7.0,
                return_std: 0.0,
                reward_correlation: None,
                returns: Vec::new(),
            })
        }));
        contents.push(Content::Finished(end));
        let line = |content| {
            let row = Row {
                key: self.key(),
                content,
            };
            serde_json::to_string(&row).unwrap() + "\n"
        };
        contents.into_iter().map(line).collect()
    }

    pub(super) fn text(&self) -> String {
        self.rows(self.end())
    }

    /// As a start leaves it that it could not get through.
    pub(super) fn failed(&self, reason: &str) -> String {
        let row = Row {
            key: self.key(),
            content: Content::Failed {
                reason: reason.into(),
                revision: "abc".into(),
                machine: "two cores".into(),
                config: toml::Table::new(),
            },
        };
        serde_json::to_string(&row).unwrap() + "\n"
    }

    pub(super) fn run(&self) -> RunResult {
        Results::parse("rows", &self.text()).unwrap().runs.remove(0)
    }
}

/// A run whose rows also tell the episodes' returns, before the first step and after the last.
pub(super) fn run_from(before: &[f64], after: &[f64]) -> RunResult {
    let mut run = STAIR.run();
    let first = Evaluation {
        step: 0,
        returns: before.to_vec(),
        ..run.evaluations[0].clone()
    };
    run.evaluations.insert(0, first);
    run.evaluations.last_mut().unwrap().returns = after.to_vec();
    run
}

pub(super) fn file(name: &str, text: String) -> RowFile {
    RowFile {
        name: name.into(),
        text,
        settings: Vec::new(),
    }
}

pub(super) fn three_seeds_each() -> String {
    let mut text = String::new();
    for seed in 1..=3 {
        text += &Told { seed, ..STAIR }.text();
        let success: &[f64] = if seed == 1 {
            &[0.0, 0.25, 0.5]
        } else {
            &[0.0, 0.0, 0.5]
        };
        text += &Told {
            seed,
            success,
            method: "pebble",
            same_stage: 0.25,
            ..STAIR
        }
        .text();
    }
    text
}
