//! What every request passes: who may come in, and what every reply carries.

use std::sync::atomic::{AtomicU64, Ordering};

use axum::extract::{Request, State};
use axum::http::uri::Authority;
use axum::http::{HeaderMap, HeaderValue, Method, header};
use axum::middleware::Next;
use axum::response::{IntoResponse as _, Response};
use store::{Secret, TokenKind};

use crate::extract::{ACCESS_COOKIE, bearer, cookie, labeler};
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
            if name == header::SET_COOKIE || name == header::RETRY_AFTER {
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
/// (CSRF), and, where the server listens on a network, requests without a token.
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
    let path = request.uri().path();
    if app.needs_token && !is_open(path) {
        match may_enter(&app, request.headers(), path).await {
            Ok(true) => {}
            Ok(false) => return Problem::token_needed().into_response(),
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

fn host(headers: &HeaderMap) -> Option<Authority> {
    headers.get(header::HOST)?.to_str().ok()?.parse().ok()
}

/// What anybody may ask of a server on a network: whether it is up, the doors, and how they look.
fn is_open(path: &str) -> bool {
    matches!(
        path,
        "/livez" | "/enter" | "/join" | "/join/return" | "/api/v1/join"
    ) || path.starts_with("/static/")
}

/// What a labeler of a study needs, who has no token of the server.
fn is_for_labelers(path: &str) -> bool {
    let is_own = matches!(path, "/seat" | "/api/v1/seat");
    let is_of_run = |path: &str, end| {
        let number = path.strip_suffix(end).unwrap_or_default();
        !number.is_empty() && number.bytes().all(|byte| byte.is_ascii_digit())
    };
    let page = path.strip_prefix("/runs/");
    let leases = path.strip_prefix("/api/v1/runs/");
    is_own
        || page.is_some_and(|rest| is_of_run(rest, "/label"))
        || leases.is_some_and(|rest| is_of_run(rest, "/leases"))
        || path.starts_with("/api/v1/leases/")
        || path.starts_with("/api/v1/clips/")
}

async fn may_enter(app: &AppState, headers: &HeaderMap, path: &str) -> Result<bool, Problem> {
    let access = cookie(headers, ACCESS_COOKIE).map(Secret::brought);
    for secret in bearer(headers).into_iter().chain(access) {
        let kind = app.store.bearer(&secret).await?.map(|bearer| bearer.kind);
        if matches!(kind, Some(TokenKind::Access | TokenKind::Teacher(_))) {
            return Ok(true);
        }
    }
    if !is_for_labelers(path) {
        return Ok(false);
    }
    // Whoever was invited, to what the study asks of them; leases and pages see to the rest.
    match labeler(app, headers).await? {
        Some(labeler) => Ok(app.store.seat_of(labeler.id).await?.is_some()),
        None => Ok(false),
    }
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
        for path in [
            "/seat",
            "/runs/12/label",
            "/api/v1/runs/12/leases",
            "/api/v1/leases/ab/answer",
            "/api/v1/clips/ab.mp4",
        ] {
            assert!(is_for_labelers(path), "{path}");
        }
        for path in [
            "/",
            "/runs/12",
            "/runs/12/labels/label",
            "/api/v1/runs/12",
            "/api/v1/runs/12/labels",
            "/api/v1/studies/1/labels",
            "/studies/1",
            "/api/v1/queries/1/task-rewards",
        ] {
            assert!(!is_for_labelers(path) && !is_open(path), "{path}");
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
