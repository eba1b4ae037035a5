//! `/api/v1/runs/{id}/labels`: all answers, for statistics elsewhere.

use axum::body::Body;
use axum::extract::{Query, State};
use axum::http::{StatusCode, header};
use axum::response::{IntoResponse, Response};
use serde::Deserialize;
use serde_json::Value;
use store::Label;

use crate::extract::Run;
use crate::problem::Problem;
use crate::state::AppState;

/// `?format=csv|jsonl`
#[derive(Deserialize, utoipa::IntoParams)]
pub struct Format {
    /// `csv` (unless said otherwise) or `jsonl`; the same rows and columns.
    #[serde(default)]
    format: Option<String>,
}

/// All answers of a run, in the order in which they were stored.
///
/// # Errors
/// An unknown run or format.
#[utoipa::path(get, path = "/api/v1/runs/{id}/labels", tag = "labels", params(("id" = i64, Path), Format),
    responses((status = 200, content_type = "text/csv"), (status = 404, body = Problem), (status = 422, body = Problem)))]
pub async fn export(
    State(app): State<AppState>,
    Run(run): Run,
    Query(format): Query<Format>,
) -> Result<Response, Problem> {
    let labels = app.store.labels(run.id).await?;
    let (content_type, extension, text) = match format.format.as_deref() {
        None | Some("csv") => ("text/csv; charset=utf-8", "csv", csv(&labels)),
        Some("jsonl") => ("application/x-ndjson", "jsonl", json_lines(&labels)),
        Some(other) => {
            let detail = format!("There is no format '{other}'; there are csv and jsonl.");
            return Err(Problem::bad_request(
                StatusCode::UNPROCESSABLE_ENTITY,
                detail,
            ));
        }
    };
    let name = format!("attachment; filename=\"labels-{}.{extension}\"", run.id);
    let headers = [
        (header::CONTENT_TYPE, content_type.to_owned()),
        (header::CONTENT_DISPOSITION, name),
    ];
    Ok((headers, Body::from(text)).into_response())
}

/// One object a line.
pub fn json_lines(labels: &[Label]) -> String {
    labels
        .iter()
        .filter_map(|label| serde_json::to_string(label).ok())
        .fold(String::new(), |text, line| text + &line + "\n")
}

/// RFC 4180 with a header line; a value that does not exist is empty.
pub fn csv(labels: &[Label]) -> String {
    let mut text = String::new();
    let columns = Label::COLUMNS;
    text.push_str(&columns.join(","));
    text.push_str("\r\n");
    for label in labels {
        let row = serde_json::to_value(label).unwrap_or_default();
        let cells: Vec<String> = columns.iter().map(|column| cell(&row[*column])).collect();
        text.push_str(&cells.join(","));
        text.push_str("\r\n");
    }
    text
}

fn cell(value: &Value) -> String {
    let text = match value {
        Value::Null => return String::new(),
        Value::String(text) => text.clone(),
        other => other.to_string(),
    };
    if text.contains([',', '"', '\n', '\r']) {
        format!("\"{}\"", text.replace('"', "\"\""))
    } else {
        text
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_reason_with_commas_and_quotes_stays_one_cell() {
        assert_eq!(
            cell(&Value::from("left, \"or\" right")),
            "\"left, \"\"or\"\" right\""
        );
        assert_eq!(cell(&Value::Null), "");
        assert_eq!(cell(&Value::from(3)), "3");
    }
}
