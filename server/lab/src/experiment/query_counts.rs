//! How many queries it takes to order the actions of every stage: formulas and a simulation.

use serde::{Deserialize, Serialize};

use super::{Artifact, ExperimentEntry, Settings, json_lines, on_threads};
use crate::figure::{self, FigureError, Request, Source};

mod bounds;
mod report;
mod simulate;

pub use bounds::{Counts, counts, log2_factorial};
pub use simulate::{World, queries_until_ordered};

pub(super) const ENTRY: ExperimentEntry = ExperimentEntry {
    name: "query-counts",
    summary: "queries to order the actions of every stage: formulas beside random queries, counted",
    run,
};

/// Stages and actions of the table.
pub const SIZES: [(usize, usize); 9] = [
    (10, 3),
    (10, 5),
    (10, 10),
    (20, 5),
    (20, 10),
    (50, 5),
    (100, 3),
    (100, 5),
    (100, 10),
];

/// Random queries that were asked until the actions of every stage were in order.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Asked {
    /// Stages.
    pub n_stages: usize,
    /// Actions in each.
    pub n_actions: usize,
    /// How queries are drawn and what the order of rewards is.
    pub world: World,
    /// Of the rewards and the queries.
    pub seed: u64,
    /// How many it took.
    pub n_queries: u64,
}

/// Every size, world and seed, in this order.
pub fn asked(settings: Settings, sizes: &[(usize, usize)]) -> Vec<Asked> {
    let mut jobs = Vec::new();
    for &(n_stages, n_actions) in sizes {
        for world in World::ALL {
            jobs.extend((0..settings.n_seeds).map(|seed| (n_stages, n_actions, world, seed)));
        }
    }
    on_threads(
        &jobs,
        settings.n_threads,
        |&(n_stages, n_actions, world, seed)| Asked {
            n_stages,
            n_actions,
            world,
            seed,
            n_queries: queries_until_ordered(n_stages, n_actions, world, seed),
        },
    )
}

fn run(settings: Settings) -> Result<Vec<Artifact>, FigureError> {
    let asked = asked(settings, &SIZES);
    let rows = json_lines(&asked);
    let sources = [Source {
        name: "query-counts.jsonl".into(),
        text: rows.clone(),
    }];
    let request = Request {
        sources: &sources,
        ..Request::default()
    };
    let svg = figure::make(figure::find("query-counts")?, &request)?;
    Ok(vec![
        Artifact::new("query-counts.jsonl", rows),
        Artifact::new("query-counts.md", report::table(&asked)),
        Artifact::new("query-counts.svg", svg),
    ])
}
