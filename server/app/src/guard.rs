//! What every request passes: who may come in, and what every reply carries.

use std::sync::atomic::{AtomicU64, Ordering};

use axum::extract::{Request, State};
use axum::http::uri::Authority;
use axum::http::{HeaderMap, HeaderValue, Method, StatusCode, header};
use axum::middleware::Next;
use axum::response::{IntoResponse as _, Response};
use store::{RunId, TokenKind};

use crate::extract::{Cookie, bearer, host, labeler};
use crate::pages::join::nobody_here;
use crate::problem::Problem;
use crate::state::AppState;

/// Everything from this server, nothing inline, nobody frames it.
const POLICY: &str = "default-src 'none'; script-src 'self'; style-src 'self'; img-src 'self' blob: data:; \
    media-src 'self' blob:; connect-src 'self'; font-src 'self'; worker-src 'self' blob:; manifest-src 'self'; \
    form-action 'self'; base-uri 'none'; frame-ancestors 'none'";

static N_REQUESTS: AtomicU64 = AtomicU64::new(0);

/// Requests since the start.
pub fn n_requests() -> u64 {
    N_REQUESTS.load(Ordering::Relaxed)
}

/// Gives the request an id, fills it into problems, and adds the headers that every reply has.
pub async fn number(request: Request, next: Next) -> Response {
    let id = format!(
        "{:x}-{:x}",
        std::process::id(),
        N_REQUESTS.fetch_add(1, Ordering::Relaxed)
    );
    let path = request.uri().path().to_owned();
    let mut response = next.run(request).await;
    if let Some(problem) = response.extensions().get::<Problem>().cloned() {
        if problem.status >= 500 {
            tracing::warn!(request.id = %id, "{path}: {} {}", problem.status, problem.detail);
        }
        let mut told = Problem {
            instance: path,
            request_id: id.clone(),
            ..problem
        }
        .into_response();
        for (name, value) in response.headers() {
            let kept = [
                header::SET_COOKIE,
                header::RETRY_AFTER,
                header::CONTENT_RANGE,
            ];
            if kept.contains(name) {
                told.headers_mut().insert(name, value.clone());
            }
        }
        response = told;
    }
    let headers = response.headers_mut();
    headers.insert("content-security-policy", HeaderValue::from_static(POLICY));
    headers.insert(
        "x-content-type-options",
        HeaderValue::from_static("nosniff"),
    );
    headers.insert("referrer-policy", HeaderValue::from_static("same-origin"));
    headers.insert(
        "cross-origin-opener-policy",
        HeaderValue::from_static("same-origin"),
    );
    headers.insert(
        "cross-origin-resource-policy",
        HeaderValue::from_static("same-origin"),
    );
    if let Ok(id) = HeaderValue::from_str(&id) {
        headers.insert("x-request-id", id);
    }
    headers
        .entry(header::CACHE_CONTROL)
        .or_insert(HeaderValue::from_static("no-store"));
    response
}

/// Refuses requests under a foreign name (DNS rebinding), changes that another site makes
/// (CSRF), and, where the server listens on a network, requests without a token that is for them.
pub async fn admit(State(app): State<AppState>, request: Request, next: Next) -> Response {
    let is_change = !matches!(
        *request.method(),
        Method::GET | Method::HEAD | Method::OPTIONS
    );
    let checked = check_host(request.headers(), app.needs_token).and_then(|()| {
        if is_change {
            check_origin(request.headers())
        } else {
            Ok(())
        }
    });
    if let Err(problem) = checked {
        return problem.into_response();
    }
    let (method, path) = (request.method(), request.uri().path());
    if app.needs_token && !is_open(path) {
        match entry(&app, method, path, request.headers()).await {
            Ok(Entry::Granted) => {}
            Ok(Entry::BeyondTeaching) => return Problem::beyond_teaching().into_response(),
            Ok(Entry::Unknown) if is_labelers_page(method, path) => {
                return nobody_here(StatusCode::UNAUTHORIZED);
            }
            Ok(Entry::Unknown) => return Problem::token_needed().into_response(),
            Err(problem) => return problem.into_response(),
        }
    }
    next.run(request).await
}

/// On its own machine the server answers to its own machine's names only.
fn check_host(headers: &HeaderMap, is_on_network: bool) -> Result<(), Problem> {
    let host = host(headers).ok_or_else(|| Problem::foreign("The request has no Host header."))?;
    let is_local = matches!(host.host(), "localhost" | "127.0.0.1" | "[::1]");
    if is_local || is_on_network {
        return Ok(());
    }
    Err(Problem::foreign(format!(
        "This server is not {}; open it as http://127.0.0.1 or http://localhost.",
        host.host()
    )))
}

fn check_origin(headers: &HeaderMap) -> Result<(), Problem> {
    let site = headers
        .get("sec-fetch-site")
        .and_then(|site| site.to_str().ok());
    if !matches!(site, None | Some("same-origin" | "none")) {
        return Err(Problem::foreign(
            "A page of another site tried to change something here.",
        ));
    }
    let Some(origin) = headers.get(header::ORIGIN) else {
        return Ok(());
    };
    let origin = origin.to_str().unwrap_or_default();
    let authority = origin
        .split_once("://")
        .and_then(|(_, rest)| rest.parse::<Authority>().ok());
    if authority.is_some() && authority == host(headers) {
        return Ok(());
    }
    Err(Problem::foreign(format!(
        "A page of {origin} tried to change something here."
    )))
}

/// What anybody may ask of a server on a network: whether it is up, the doors, and how they look.
fn is_open(path: &str) -> bool {
    matches!(
        path,
        "/livez" | "/enter" | "/join" | "/join/return" | "/api/v1/join"
    ) || path.starts_with("/static/")
}

/// What a labeler of a study opens: the seat, and the questions of a part of it.
fn is_labelers_page(method: &Method, path: &str) -> bool {
    is_read(method) && (path == "/seat" || run_between(path, "/runs/", "/label").is_some())
}

/// What a labeler of a study needs, who has no token of the server.
fn is_for_labelers(method: &Method, path: &str) -> bool {
    is_labelers_page(method, path)
        || is_read(method) && (path == "/api/v1/seat" || path.starts_with("/api/v1/clips/"))
        || *method == Method::POST && run_between(path, "/api/v1/runs/", "/leases").is_some()
        || path.starts_with("/api/v1/leases/")
}

/// What a program needs that answers `run`. Whose a lease is, and of which run a query, is for
/// those to see who look them up.
fn is_for_teachers(method: &Method, path: &str, run: RunId) -> bool {
    let is_truth = path.starts_with("/api/v1/queries/") && path.ends_with("/task-rewards");
    let is_run = run_between(path, "/api/v1/runs/", "") == Some(run);
    let is_leasing = run_between(path, "/api/v1/runs/", "/leases") == Some(run);
    is_read(method) && (is_run || is_truth || path.starts_with("/api/v1/clips/"))
        || *method == Method::POST && is_leasing
        || path.starts_with("/api/v1/leases/")
}

fn is_read(method: &Method) -> bool {
    matches!(*method, Method::GET | Method::HEAD)
}

/// The run's number between two ends of a path: 12 of `/runs/12/label`.
fn run_between(path: &str, before: &str, after: &str) -> Option<RunId> {
    let digits = path.strip_prefix(before)?.strip_suffix(after)?;
    let is_number = digits.bytes().all(|byte| byte.is_ascii_digit());
    digits.parse().ok().filter(|_| is_number).map(RunId)
}

/// Whether a request may come in to a server on a network.
enum Entry {
    /// Its token, or its labeler's seat, is for this.
    Granted,
    /// A program's token is for less.
    BeyondTeaching,
    /// It brought nothing that opens this.
    Unknown,
}

async fn entry(
    app: &AppState,
    method: &Method,
    path: &str,
    headers: &HeaderMap,
) -> Result<Entry, Problem> {
    let mut teaches = None;
    let secrets = bearer(headers).into_iter();
    for secret in secrets.chain(Cookie::Access.brought(headers)) {
        match app.store.bearer(&secret).await?.map(|bearer| bearer.kind) {
            Some(TokenKind::Access) => return Ok(Entry::Granted),
            Some(TokenKind::Teacher(run)) => teaches = Some(run),
            Some(TokenKind::Labeler) | None => {}
        }
    }
    if let Some(run) = teaches {
        return Ok(if is_for_teachers(method, path, run) {
            Entry::Granted
        } else {
            Entry::BeyondTeaching
        });
    }
    if is_for_labelers(method, path) && is_seated(app, path, headers).await? {
        return Ok(Entry::Granted);
    }
    Ok(Entry::Unknown)
}

/// Whether the labeler was invited to a study; at a page with questions, to these. Leases and
/// clips see to the rest.
async fn is_seated(app: &AppState, path: &str, headers: &HeaderMap) -> Result<bool, Problem> {
    let Some(labeler) = labeler(app, headers).await? else {
        return Ok(false);
    };
    let Some((_, _, parts)) = app.store.seat_of(labeler.id).await? else {
        return Ok(false);
    };
    let page_of = run_between(path, "/runs/", "/label");
    Ok(page_of.is_none_or(|run| parts.iter().any(|part| part.run == run)))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn headers(pairs: &[(&'static str, &'static str)]) -> HeaderMap {
        pairs
            .iter()
            .map(|(name, value)| {
                (
                    header::HeaderName::from_static(name),
                    HeaderValue::from_static(value),
                )
            })
            .collect()
    }

    #[test]
    fn a_name_that_was_bound_to_this_machine_by_somebody_else_is_refused() {
        assert!(check_host(&headers(&[("host", "127.0.0.1:8080")]), false).is_ok());
        assert!(check_host(&headers(&[("host", "localhost")]), false).is_ok());
        assert!(check_host(&headers(&[("host", "evil.example:8080")]), false).is_err());
        assert!(check_host(&headers(&[]), false).is_err());
    }

    #[test]
    fn an_invited_labeler_reaches_their_pairs_and_nothing_of_the_researchers() {
        for (method, path) in [
            (Method::GET, "/seat"),
            (Method::GET, "/runs/12/label"),
            (Method::GET, "/api/v1/seat"),
            (Method::POST, "/api/v1/runs/12/leases"),
            (Method::PUT, "/api/v1/leases/ab/answer"),
            (Method::GET, "/api/v1/clips/ab.mp4"),
        ] {
            assert!(is_for_labelers(&method, path), "{method} {path}");
        }
        for (method, path) in [
            (Method::GET, "/"),
            (Method::GET, "/runs/12"),
            (Method::POST, "/runs/12/label"), // takes any name
            (Method::GET, "/runs/12/labels/label"),
            (Method::GET, "/runs//label"),
            (Method::GET, "/api/v1/runs/12"),
            (Method::GET, "/api/v1/runs/12/labels"),
            (Method::GET, "/api/v1/studies/1/labels"),
            (Method::GET, "/studies/1"),
            (Method::GET, "/api/v1/queries/1/task-rewards"),
            (Method::POST, "/api/v1/labelers"),
        ] {
            assert!(
                !is_for_labelers(&method, path) && !is_open(path),
                "{method} {path}"
            );
        }
    }

    #[test]
    fn a_program_reaches_what_teaching_its_run_takes_and_nothing_of_another() {
        for (method, path) in [
            (Method::GET, "/api/v1/runs/12"),
            (Method::POST, "/api/v1/runs/12/leases"),
            (Method::POST, "/api/v1/leases/ab/heartbeat"),
            (Method::PUT, "/api/v1/leases/ab/answer"),
            (Method::GET, "/api/v1/queries/3/task-rewards"),
            (Method::GET, "/api/v1/clips/ab.mp4"),
        ] {
            assert!(is_for_teachers(&method, path, RunId(12)), "{method} {path}");
        }
        for (method, path) in [
            (Method::GET, "/"),
            (Method::GET, "/runs/12"),
            (Method::GET, "/seat"),
            (Method::GET, "/api/v1/runs"),
            (Method::GET, "/api/v1/runs/1"),
            (Method::GET, "/api/v1/runs/12/labels"),
            (Method::POST, "/api/v1/runs/1/leases"),
            (Method::POST, "/api/v1/runs/12/stop"),
            (Method::POST, "/api/v1/runs/12/teacher-tokens"),
        ] {
            assert!(
                !is_for_teachers(&method, path, RunId(12)),
                "{method} {path}"
            );
        }
    }

    #[test]
    fn a_change_from_another_site_is_refused() {
        let own = [
            ("host", "127.0.0.1:8080"),
            ("origin", "http://127.0.0.1:8080"),
        ];
        assert!(check_origin(&headers(&own)).is_ok());
        assert!(check_origin(&headers(&own[..1])).is_ok());
        for origin in ["http://evil.example", "http://127.0.0.1:9999", "null"] {
            assert!(
                check_origin(&headers(&[own[0], ("origin", origin)])).is_err(),
                "{origin}"
            );
        }
        assert!(check_origin(&headers(&[own[0], ("sec-fetch-site", "cross-site")])).is_err());
    }
}
