//! What handlers take from a request, refused with a problem where it does not fit.

use axum::extract::{FromRef, FromRequest, FromRequestParts, Path};
use axum::http::request::Parts;
use axum::http::{HeaderMap, header};
use store::{Bearer, Labeler, RunId, RunRow, Secret, StudyId, StudyRow, TokenKind};

use crate::problem::Problem;
use crate::state::AppState;

/// The cookie of a labeler's browser.
pub const LABELER_COOKIE: &str = "stair_labeler";
/// The cookie of a browser that may use a server on a network.
pub const ACCESS_COOKIE: &str = "stair_access";

/// A JSON body.
#[derive(FromRequest)]
#[from_request(via(axum::Json), rejection(Problem))]
pub struct Body<T>(pub T);

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

/// Whoever answers: a person by their browser's cookie, or a program by its teacher token.
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
            return match app.store.bearer(&secret).await? {
                Some(Bearer {
                    kind: TokenKind::Teacher(run),
                    labeler: Some(labeler),
                }) => Ok(Self {
                    labeler,
                    teaches: Some(run),
                }),
                _ => Err(Problem::who_are_you()),
            };
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
    let Some(secret) = cookie(headers, LABELER_COOKIE) else {
        return Ok(None);
    };
    let bearer = app.store.bearer(&Secret::brought(secret)).await?;
    Ok(bearer
        .filter(|bearer| bearer.kind == TokenKind::Labeler)
        .and_then(|bearer| bearer.labeler))
}

/// The secret in `Authorization: Bearer …`.
pub fn bearer(headers: &HeaderMap) -> Option<Secret> {
    let value = headers.get(header::AUTHORIZATION)?.to_str().ok()?;
    Some(Secret::brought(value.strip_prefix("Bearer ")?.trim()))
}

/// The value of a cookie.
pub fn cookie<'h>(headers: &'h HeaderMap, name: &str) -> Option<&'h str> {
    headers
        .get_all(header::COOKIE)
        .iter()
        .filter_map(|value| value.to_str().ok())
        .flat_map(|value| value.split(';'))
        .filter_map(|pair| pair.trim().split_once('='))
        .find(|(key, _)| *key == name)
        .map(|(_, value)| value)
}

/// A cookie for a year that scripts cannot read and other sites cannot send.
pub fn set_cookie(name: &str, secret: &Secret) -> String {
    format!(
        "{name}={}; Path=/; Max-Age=31536000; HttpOnly; SameSite=Strict",
        secret.reveal()
    )
}
