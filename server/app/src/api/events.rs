//! `/api/v1/runs/{id}/events` and `/metrics`: what a run says, live and from the start.

use std::convert::Infallible;
use std::time::Duration;

use axum::extract::State;
use axum::http::{HeaderMap, header};
use axum::response::sse::{Event, KeepAlive, Sse};
use axum::response::{IntoResponse, Response};
use store::{EventRow, RunId, Store};
use tokio::sync::broadcast::error::RecvError;
use tokio::sync::mpsc::Sender;
use tokio_stream::wrappers::ReceiverStream;

use crate::extract::Run;
use crate::live::LiveEvent;
use crate::problem::Problem;
use crate::state::AppState;

/// Kinds of event that draw curves.
const CURVES: &[&str] = &[
    "metrics",
    "session_offered",
    "session_closed",
    "refitted",
    "evaluation",
    "finished",
];
/// Events read at once.
const PAGE: u32 = 500;

/// Follows a run by server-sent events.
///
/// First comes everything that is in the run's log above `Last-Event-ID` (from the start without
/// one), then what happens, without gaps. Passing things (`phase`) have no id.
///
/// # Errors
/// An unknown run.
#[utoipa::path(get, path = "/api/v1/runs/{id}/events", tag = "events", operation_id = "followRun",
    params(("id" = i64, Path),
        ("Last-Event-ID" = Option<u64>, Header, description = "The newest event that was received.", nullable = false)),
    responses((status = 200, content_type = "text/event-stream", description = "Events, until the reader goes away.")))]
pub async fn follow(State(app): State<AppState>, Run(run): Run, headers: HeaderMap) -> Response {
    let last = headers
        .get("last-event-id")
        .and_then(|id| id.to_str().ok())
        .and_then(|id| id.parse().ok());
    let (sender, events) = tokio::sync::mpsc::channel(64);
    tokio::spawn(feed(app, run.id, last.unwrap_or(0), sender));
    Sse::new(ReceiverStream::new(events))
        .keep_alive(KeepAlive::new().interval(Duration::from_secs(15)))
        .into_response()
}

/// Ends when the reader goes away.
async fn feed(app: AppState, run: RunId, mut last: u64, out: Sender<Result<Event, Infallible>>) {
    let mut newest = app.store.newest_event(run);
    let mut passing = app.live.events();
    loop {
        newest.mark_unchanged();
        match send_log(&app.store, run, last, &out).await {
            Ok(Some(sent)) => last = sent,
            Ok(None) => return,
            Err(error) => return tracing::error!("a run's events cannot be read: {error}"),
        }
        loop {
            tokio::select! {
                changed = newest.changed() => match changed {
                    Ok(()) => break,
                    Err(_) => return,
                },
                event = passing.recv() => match event {
                    Ok(LiveEvent { run: of, data }) if of == run => {
                        let kind = data["kind"].as_str().unwrap_or("event").to_owned();
                        if out.send(Ok(Event::default().event(kind).data(data.to_string()))).await.is_err() {
                            return;
                        }
                    }
                    Ok(_) | Err(RecvError::Lagged(_)) => {}
                    Err(RecvError::Closed) => return,
                },
                () = out.closed() => return,
            }
        }
    }
}

/// Sends the log above `after`; the last id that was sent, or `None` when the reader is gone.
async fn send_log(
    store: &Store,
    run: RunId,
    mut after: u64,
    out: &Sender<Result<Event, Infallible>>,
) -> Result<Option<u64>, store::StoreError> {
    loop {
        let page = store.events_after(run, after, PAGE).await?;
        let Some(EventRow { id, .. }) = page.last() else {
            return Ok(Some(after));
        };
        after = *id;
        for row in page {
            let event = Event::default()
                .id(row.id.to_string())
                .event(row.kind)
                .data(row.data);
            if out.send(Ok(event)).await.is_err() {
                return Ok(None);
            }
        }
    }
}

/// All that draws a run's curves, as one JSON array of events.
///
/// # Errors
/// An unknown run.
#[utoipa::path(get, path = "/api/v1/runs/{id}/metrics", tag = "events", operation_id = "readRunMetrics",
    params(("id" = i64, Path)), responses((status = 200, body = [Object])))]
pub async fn metrics(State(app): State<AppState>, Run(run): Run) -> Result<Response, Problem> {
    let rows = app.store.events_of(run.id, CURVES).await?;
    let rows: Vec<String> = rows.into_iter().map(|row| row.data).collect();
    let body = format!("[{}]", rows.join(","));
    Ok(([(header::CONTENT_TYPE, "application/json")], body).into_response())
}
