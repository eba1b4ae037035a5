//! The temporal map of a run, as a picture for its page.

use std::path::Path;

use anyhow::Context as _;
use axum::extract::State;
use axum::http::header;
use axum::response::{IntoResponse as _, Response};
use lab::figure::{self, Request, Source};
use lab::record::RunRecord;
use lab::temporal_map::{MapError, TemporalMap, is_learned_by};
use tokio::sync::Semaphore;

use crate::extract::Run;
use crate::problem::Problem;
use crate::state::AppState;
use crate::worker::in_worker;

/// A map reads all that the run has seen into memory: one at a time.
static READING: Semaphore = Semaphore::const_new(1);

/// `GET /runs/{id}/temporal-map.svg`
///
/// # Errors
/// A run without a temporal distance, or whose folder cannot be read.
pub async fn picture(State(app): State<AppState>, Run(row): Run) -> Result<Response, Problem> {
    let folder = app.store.run_folder(row.id);
    let _permit = READING.acquire().await;
    let drawn = in_worker(move || draw(&folder)).await?;
    let svg = drawn.map_err(|error| Problem::no_map(format!("{error:#}")))?;
    Ok(([(header::CONTENT_TYPE, "image/svg+xml")], svg).into_response())
}

/// Why a run has no map yet, or never will; `None` where there is one to be drawn.
pub(super) fn missing(method: &str, labels: u32) -> Option<String> {
    if !is_learned_by(method) {
        return Some(format!("{}.", MapError::not_learned(method)));
    }
    let is_early = labels == 0;
    is_early.then(|| "It is learned once the first round is answered.".to_owned())
}

fn draw(folder: &Path) -> anyhow::Result<String> {
    let map = TemporalMap::of(&RunRecord::open(folder)?, None)?;
    let sources = [Source {
        name: folder.display().to_string(),
        text: serde_json::to_string(&map).context("cannot write the map down")?,
    }];
    let request = Request {
        sources: &sources,
        ..Request::default()
    };
    Ok(figure::make(figure::find("temporal-map")?, &request)?)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_run_without_a_map_says_what_would_have_one() {
        let told = missing("pebble", 40).unwrap();
        assert!(told.contains("pebble learns no temporal distance; runs of stair"));
        assert!(missing("stair", 0).unwrap().contains("first round"));
        assert_eq!(missing("stair", 40), None);
    }

    #[test]
    fn a_folder_without_a_run_is_an_error_with_its_path() {
        let folder = tempfile::tempdir().unwrap();
        let told = format!("{:#}", draw(folder.path()).unwrap_err());
        assert!(told.contains("config.toml"), "{told}");
    }
}
