//! What people see: one file per page, its template of the same name in `web/templates`.
//!
//! Pages work with forms and links; scripts add keys, preloading and live curves.

pub mod api;
pub mod compare;
pub mod experiment;
pub mod experiments;
pub mod guidance;
pub mod home;
pub mod join;
pub mod label;
pub mod labels;
mod markdown;
pub mod problem;
pub mod run;
pub mod seat;
pub mod studies;
pub mod study;

use askama::Template;
use axum::response::{Html, IntoResponse, Response};

use crate::problem::Problem;

/// A filled-in template as a reply; a template that fails is a problem like any other.
fn show(template: &impl Template) -> Response {
    match template.render() {
        Ok(html) => Html(html).into_response(),
        Err(error) => {
            tracing::error!("a page could not be written: {error}");
            Problem::page_failed().into_response()
        }
    }
}

/// The task as people read it; a task that this program no longer knows keeps its name out.
fn title(task: &str) -> &'static str {
    sim::tasks::task(task).map_or("A task of another version", |task| task.title)
}

/// `14:02:11` of an RFC 3339 time, UTC; scripts show the reader's own time.
fn time_of_day(at: &str) -> &str {
    at.get(11..19).unwrap_or_default()
}

/// A share as people read it: `35 %`.
fn percent(share: f64) -> String {
    format!("{:.0} %", 100.0 * share)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_share_is_told_in_whole_percent() {
        assert_eq!(percent(0.346), "35 %");
    }
}
