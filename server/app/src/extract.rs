//! What handlers take from a request, refused with a problem where it does not fit.

use axum::extract::{FromRef, FromRequest, FromRequestParts};
use axum::http::request::Parts;
use axum::http::uri::Authority;
use axum::http::{HeaderMap, header};
use store::{Bearer, Labeler, RunId, RunRow, Secret, StudyId, StudyRow, TokenKind};

use crate::problem::Problem;
use crate::state::AppState;

/// A JSON body.
#[derive(FromRequest)]
#[from_request(via(axum::Json), rejection(Problem))]
pub struct Body<T>(pub T);

/// The fields of a form.
#[derive(FromRequest)]
#[from_request(via(axum::Form), rejection(Problem))]
pub struct Form<T>(pub T);

/// What stands behind the question mark of an address.
#[derive(FromRequestParts)]
#[from_request(via(axum::extract::Query), rejection(Problem))]
pub struct Query<T>(pub T);

/// The parts of an address that differ from one thing to the next.
#[derive(FromRequestParts)]
#[from_request(via(axum::extract::Path), rejection(Problem))]
pub struct Path<T>(pub T);

/// The run that the address names, as it is now.
pub struct Run(pub RunRow);

impl<S: Send + Sync> FromRequestParts<S> for Run
where
    AppState: FromRef<S>,
{
    type Rejection = Problem;

    async fn from_request_parts(parts: &mut Parts, state: &S) -> Result<Self, Problem> {
        let Path(id) = Path::<String>::from_request_parts(parts, state).await?;
        let app = AppState::from_ref(state);
        let number: i64 = id.parse().map_err(|_| Problem::run_not_found(&id))?;
        let run = app.store.run(RunId(number)).await?;
        run.map(Self).ok_or_else(|| Problem::run_not_found(&id))
    }
}

/// The study that the address names, as it is now.
pub struct Study(pub StudyRow);

impl<S: Send + Sync> FromRequestParts<S> for Study
where
    AppState: FromRef<S>,
{
    type Rejection = Problem;

    async fn from_request_parts(parts: &mut Parts, state: &S) -> Result<Self, Problem> {
        // Addresses of what belongs to a study have more parts than its number.
        let Path(path) = Path::<Vec<(String, String)>>::from_request_parts(parts, state).await?;
        let id = path.into_iter().find(|(key, _)| key == "id");
        let id = id.map(|(_, id)| id).unwrap_or_default();
        let number = id.parse().map_err(|_| Problem::study_not_found(&id))?;
        let app = AppState::from_ref(state);
        Ok(Self(app.store.study(StudyId(number)).await?))
    }
}

/// Whoever answers: a person by their browser's cookie, or a program by its teacher token. The
/// server's own token says nothing about who answers, so whoever brings it is known by the cookie.
pub struct Answerer {
    /// Who.
    pub labeler: Labeler,
    /// The run that a program teaches; `None` for a person.
    pub teaches: Option<RunId>,
}

impl<S: Send + Sync> FromRequestParts<S> for Answerer
where
    AppState: FromRef<S>,
{
    type Rejection = Problem;

    async fn from_request_parts(parts: &mut Parts, state: &S) -> Result<Self, Problem> {
        let app = AppState::from_ref(state);
        if let Some(secret) = bearer(&parts.headers) {
            match app.store.bearer(&secret).await? {
                Some(Bearer {
                    kind: TokenKind::Teacher(run),
                    labeler: Some(labeler),
                }) => {
                    return Ok(Self {
                        labeler,
                        teaches: Some(run),
                    });
                }
                Some(bearer) if bearer.kind == TokenKind::Access => {}
                _ => return Err(Problem::token_unknown()),
            }
        }
        match labeler(&app, &parts.headers).await? {
            Some(labeler) => Ok(Self {
                labeler,
                teaches: None,
            }),
            None => Err(Problem::who_are_you()),
        }
    }
}

/// The labeler whose browser this is, if it has said its name.
///
/// # Errors
/// When the store cannot be read.
pub async fn labeler(app: &AppState, headers: &HeaderMap) -> Result<Option<Labeler>, Problem> {
    for secret in Cookie::Labeler.brought(headers) {
        let bearer = app.store.bearer(&secret).await?;
        let found = bearer
            .filter(|bearer| bearer.kind == TokenKind::Labeler)
            .and_then(|bearer| bearer.labeler);
        if found.is_some() {
            return Ok(found);
        }
    }
    Ok(None)
}

/// The secret in `Authorization: Bearer …`.
pub fn bearer(headers: &HeaderMap) -> Option<Secret> {
    let value = headers.get(header::AUTHORIZATION)?.to_str().ok()?;
    Some(Secret::brought(value.strip_prefix("Bearer ")?.trim()))
}

/// Under which name and port the server is asked, as the browser has it in its address bar.
pub fn host(headers: &HeaderMap) -> Option<Authority> {
    headers.get(header::HOST)?.to_str().ok()?.parse().ok()
}

/// A cookie of this server.
///
/// A browser sends a host's cookies to every port of the host. The port by which the server is
/// asked is therefore in the name: a second server on the machine has cookies of its own.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Cookie {
    /// Of a labeler's browser.
    Labeler,
    /// Of a browser that may use a server on a network.
    Access,
    /// Of any browser that keeps cookies; says nothing else.
    Kept,
}

impl Cookie {
    /// The secrets that a request brings, the likelier one first: that of its port, and the one
    /// without a port, which earlier versions gave. A server does not know the secrets of
    /// another, so whoever reads takes the first that is known.
    pub fn brought(self, headers: &HeaderMap) -> Vec<Secret> {
        let name = self.name(headers);
        let values = [name.as_str(), self.stem()].map(|name| cookie(headers, name));
        let mut secrets: Vec<Secret> = values.into_iter().flatten().map(Secret::brought).collect();
        secrets.dedup();
        secrets
    }

    /// What `Set-Cookie` says in the reply to a request: for a year, out of the reach of scripts
    /// and of other sites, but for a link there that leads here.
    pub fn set(self, headers: &HeaderMap, secret: &Secret) -> String {
        format!(
            "{}={}; Path=/; Max-Age=31536000; HttpOnly; SameSite=Lax",
            self.name(headers),
            secret.reveal()
        )
    }

    /// `stair_labeler_8080`; without a number where the address has none, as behind a proxy.
    fn name(self, headers: &HeaderMap) -> String {
        match host(headers).and_then(|host| host.port_u16()) {
            Some(port) => format!("{}_{port}", self.stem()),
            None => self.stem().to_owned(),
        }
    }

    fn stem(self) -> &'static str {
        match self {
            Self::Labeler => "stair_labeler",
            Self::Access => "stair_access",
            Self::Kept => "stair_kept",
        }
    }
}

/// The value of a cookie.
fn cookie<'h>(headers: &'h HeaderMap, name: &str) -> Option<&'h str> {
    headers
        .get_all(header::COOKIE)
        .iter()
        .filter_map(|value| value.to_str().ok())
        .flat_map(|value| value.split(';'))
        .filter_map(|pair| pair.trim().split_once('='))
        .find(|(key, _)| *key == name)
        .map(|(_, value)| value)
}

#[cfg(test)]
mod tests {
    use axum::http::HeaderValue;

    use super::*;

    fn asked(host: &'static str, cookies: &'static str) -> HeaderMap {
        HeaderMap::from_iter([
            (header::HOST, HeaderValue::from_static(host)),
            (header::COOKIE, HeaderValue::from_static(cookies)),
        ])
    }

    fn brought(host: &'static str, cookies: &'static str) -> Vec<String> {
        let secrets = Cookie::Labeler.brought(&asked(host, cookies));
        secrets.iter().map(|s| s.reveal().to_owned()).collect()
    }

    #[test]
    fn a_cookie_is_named_by_the_port_in_the_address_and_plainly_without_one() {
        let name = |host| {
            let set = Cookie::Access.set(&asked(host, ""), &Secret::brought("s"));
            set.split_once('=').map(|(name, _)| name.to_owned())
        };
        for (host, wanted) in [
            ("127.0.0.1:8080", "stair_access_8080"),
            ("[::1]:9000", "stair_access_9000"),
            ("[::1]", "stair_access"),
            ("stair.example", "stair_access"),
        ] {
            assert_eq!(name(host).as_deref(), Some(wanted), "{host}");
        }
    }

    #[test]
    fn of_all_cookies_of_a_machine_a_server_reads_its_own_and_then_that_of_earlier_versions() {
        let jar = "stair_labeler=old; stair_labeler_9000=other; stair_labeler_8080=own";
        assert_eq!(brought("localhost:8080", jar), ["own", "old"]);
        assert_eq!(brought("localhost:7000", jar), ["old"]);
        assert_eq!(brought("localhost", jar), ["old"]);
        assert!(brought("localhost:80", "stair_labeler_8080=own").is_empty());
    }
}
