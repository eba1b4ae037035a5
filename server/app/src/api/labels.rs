//! `/api/v1/runs/{id}/labels`: all answers, for statistics elsewhere.

use axum::body::{Body, Bytes};
use axum::extract::State;
use axum::http::{StatusCode, header};
use axum::response::{IntoResponse, Response};
use serde::Deserialize;
use store::LabelsOf;
use tokio::sync::mpsc;
use tokio_stream::wrappers::ReceiverStream;

use crate::extract::{Query, Run};
use crate::label_table::{self, TableError, TableFormat};
use crate::problem::Problem;
use crate::state::AppState;

/// Pages that may wait for a slow reader.
const AHEAD: usize = 2;

/// `?format=csv|jsonl|parquet`
#[derive(Deserialize, utoipa::IntoParams)]
#[into_params(parameter_in = Query)]
pub struct Format {
    /// `csv` (unless said otherwise), `jsonl` or `parquet`; the same rows and columns.
    #[serde(default)]
    format: Option<String>,
}

/// All answers of a run, in the order in which they were stored.
///
/// # Errors
/// An unknown run or format.
#[utoipa::path(get, path = "/api/v1/runs/{id}/labels", tag = "labels", operation_id = "exportRunLabels",
    params(("id" = i64, Path), Format),
    responses((status = 200, description = "The table, as a file to keep.",
            content(("text/csv"), ("application/x-ndjson"), ("application/vnd.apache.parquet"))),
        (status = 422, description = "An unknown format.")))]
pub async fn export(
    State(app): State<AppState>,
    Run(run): Run,
    Query(format): Query<Format>,
) -> Result<Response, Problem> {
    let name = format!("labels-{}", run.id);
    exported(&app, LabelsOf::Run(run.id), &name, &format)
}

/// A table as a file to keep, sent as it is written: its length is no matter of memory.
///
/// # Errors
/// An unknown format.
pub fn exported(
    app: &AppState,
    of: LabelsOf,
    name: &str,
    format: &Format,
) -> Result<Response, Problem> {
    let word = format.format.as_deref().unwrap_or("csv");
    let format = TableFormat::of(word).ok_or_else(|| {
        let detail = format!("There is no format '{word}'; there are csv, jsonl and parquet.");
        Problem::bad_request(StatusCode::UNPROCESSABLE_ENTITY, detail)
    })?;
    let (sender, pages) = mpsc::channel::<Result<Bytes, TableError>>(AHEAD);
    let store = app.store.clone();
    tokio::spawn(async move {
        let take = |bytes: Vec<u8>| {
            let sender = sender.clone();
            async move {
                let sent = sender.send(Ok(bytes.into())).await;
                sent.map_err(|_| TableError::Unwanted)
            }
        };
        if let Err(error) = label_table::write(&store, of, format, take).await {
            // The connection is cut: a table that ends early must not look whole.
            let _ = sender.send(Err(error)).await;
        }
    });
    let file = format!("attachment; filename=\"{name}.{}\"", format.word());
    let headers = [
        (header::CONTENT_TYPE, format.content_type().to_owned()),
        (header::CONTENT_DISPOSITION, file),
    ];
    let body = Body::from_stream(ReceiverStream::new(pages));
    Ok((headers, body).into_response())
}
