//! What went wrong, for people: the same problem that a program receives, with a way forward.

use askama::Template;
use axum::extract::Request;
use axum::http::header;
use axum::middleware::Next;
use axum::response::{Html, IntoResponse as _, Response};

use crate::problem::Problem;

/// The page of a problem.
#[derive(Template)]
#[template(path = "problem.html")]
struct ProblemPage<'a> {
    /// HTTP status.
    status: u16,
    /// The kind in a few words.
    title: &'a str,
    /// This case.
    detail: &'a str,
    /// Where to go from here.
    forward_href: String,
    /// What is there.
    forward_words: &'static str,
}

/// Turns a problem into a page where a browser asked for a page.
pub async fn as_page(request: Request, next: Next) -> Response {
    let path = request.uri().path().to_owned();
    let wants_page = request
        .headers()
        .get(header::ACCEPT)
        .and_then(|accept| accept.to_str().ok())
        .is_some_and(|accept| accept.contains("text/html"));
    let response = next.run(request).await;
    if !wants_page || path.starts_with("/api/") {
        return response;
    }
    let Some(problem) = response.extensions().get::<Problem>().cloned() else {
        return response;
    };
    let (forward_href, forward_words) = forward(&path, problem.status);
    let page = ProblemPage {
        status: problem.status,
        title: problem.title,
        detail: &problem.detail,
        forward_href,
        forward_words,
    };
    match page.render() {
        Ok(html) => (response.status(), Html(html)).into_response(),
        Err(_) => response,
    }
}

/// Back to the form where something else must be typed, to the run where it exists, and to the
/// list of what was looked for otherwise.
fn forward(path: &str, status: u16) -> (String, &'static str) {
    let mut parts = path.split('/').skip(1);
    match (parts.next(), parts.next(), parts.next()) {
        (Some("runs"), Some(run), Some("label")) if status == 422 => {
            (format!("/runs/{run}/label"), "Back to the name")
        }
        (Some("studies"), Some(study), Some(_)) if status != 404 => {
            (format!("/studies/{study}"), "Back to the study")
        }
        (Some("runs"), Some(run), Some(_)) if status != 404 => {
            (format!("/runs/{run}"), "Back to the run")
        }
        (Some("join" | "seat"), _, _) => ("/join".to_owned(), "Enter a return code"),
        (Some("experiments"), Some(_), _) => ("/experiments".to_owned(), "Experiments"),
        (Some("labels"), None, _) => ("/labels".to_owned(), "All answers"),
        _ => ("/".to_owned(), "Tasks and runs"),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_name_that_is_not_taken_leads_back_to_where_it_was_typed() {
        assert_eq!(forward("/runs/7/label", 422).0, "/runs/7/label");
        assert_eq!(forward("/runs/7/label", 401).0, "/runs/7");
        assert_eq!(forward("/join/return", 422).0, "/join");
    }

    #[test]
    fn a_command_that_failed_leads_back_to_its_run() {
        assert_eq!(forward("/runs/7/pause", 409).0, "/runs/7");
        assert_eq!(forward("/runs/7/pause", 404).0, "/");
        assert_eq!(forward("/studies/3/invitations", 422).0, "/studies/3");
        assert_eq!(forward("/nowhere", 404).0, "/");
        assert_eq!(forward("/experiments/nowhere", 404).0, "/experiments");
        assert_eq!(forward("/labels", 422).0, "/labels");
    }
}
