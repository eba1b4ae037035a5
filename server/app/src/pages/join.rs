//! `/join`: what a study asks of a labeler, their agreement, and the way back in.

use askama::Template;
use axum::extract::State;
use axum::http::{HeaderMap, StatusCode, header};
use axum::response::{IntoResponse as _, Redirect, Response};
use serde::Deserialize;
use store::{LinkTrouble, Secret, StoreError, now_ms};

use super::markdown::to_html;
use super::{show, title};
use crate::api::seats;
use crate::extract::{Cookie, Form, Query};
use crate::live::parse_study;
use crate::problem::Problem;
use crate::state::AppState;

#[derive(Template)]
#[template(path = "join.html")]
struct JoinPage {
    code: String,
    title: String,
    /// HTML.
    consent: String,
    /// HTML.
    guidance: String,
    has_guidance: bool,
    tasks: String,
    n_pairs: u32,
}

/// What the cookie says by which a browser shows that it keeps them.
const KEPT: &str = "yes";

#[derive(Template)]
#[template(path = "return.html")]
struct ReturnPage {
    heading: &'static str,
    /// What is wrong with the link; empty without one.
    told: String,
    /// Somebody may have begun in this browser.
    can_go_on: bool,
}

#[derive(Template)]
#[template(path = "welcome.html")]
struct WelcomePage {
    return_code: String,
}

/// `?code=…`
#[derive(Deserialize)]
pub struct Door {
    code: Option<String>,
}

/// `GET /join?code=…`: opening a link uses nothing up. Without a code that works, the place to
/// enter a return code.
///
/// # Errors
/// A store that cannot be read.
pub async fn page(
    State(app): State<AppState>,
    headers: HeaderMap,
    Query(door): Query<Door>,
) -> Result<Response, Problem> {
    let Some(code) = door.code else {
        return Ok(show(&ReturnPage {
            heading: "Go on where you were",
            told: String::new(),
            can_go_on: true,
        }));
    };
    let entrance = match app.store.entrance(&Secret::brought(&code), now_ms()).await {
        Ok(entrance) => entrance,
        Err(StoreError::Link(trouble)) => return Ok(show(&turned_away(trouble))),
        Err(error) => return Err(error.into()),
    };
    let row = app.store.study(entrance.study).await?;
    let file = parse_study(&row).map_err(|error| Problem::unusable_study(error.to_string()))?;
    let tasks: Vec<&str> = file.tasks.iter().map(|task| title(task)).collect();
    let (counted, practice, extra) = file.n_pairs();
    let kept = Cookie::Kept.set(&headers, &Secret::brought(KEPT));
    let page = show(&JoinPage {
        code,
        consent: to_html(&file.consent),
        guidance: to_html(&file.guidance),
        has_guidance: !file.guidance.trim().is_empty(),
        tasks: tasks.join(", "),
        n_pairs: counted + practice + extra,
        title: file.title,
    });
    Ok(([(header::SET_COOKIE, kept)], page).into_response())
}

fn turned_away(trouble: LinkTrouble) -> ReturnPage {
    let heading = match trouble {
        LinkTrouble::Unknown => "This link leads nowhere",
        LinkTrouble::Used => "This link was used already",
        LinkTrouble::Expired => "This link has run out",
        LinkTrouble::NotYet => "Not yet",
        LinkTrouble::Closed => "This study is over",
    };
    let mut told = trouble.to_string();
    if let Some(first) = told.get(..1).map(str::to_uppercase) {
        told.replace_range(..1, &first);
    }
    ReturnPage {
        heading,
        told: told + ".",
        can_go_on: true,
    }
}

/// For a browser in which nobody takes part: the place to enter a return code.
///
/// * `status` – 404, or 401 where a token of the server would open the page too
pub fn nobody_here(status: StatusCode) -> Response {
    let mut told = "You take part in no study in this browser. Open the link that you were sent, or come back with your return code.".to_owned();
    if status == StatusCode::UNAUTHORIZED {
        told += " If you were given this server's token instead, open /enter?token=… first.";
    }
    let page = ReturnPage {
        heading: "Go on where you were",
        told,
        can_go_on: false,
    };
    (status, show(&page)).into_response()
}

/// The code of a link, with the labeler's agreement.
#[derive(Deserialize)]
pub struct EnterForm {
    code: String,
    #[serde(default)]
    agrees: Option<String>,
}

/// `POST /join`: uses the link up, and shows the return code. Not for a browser that did not keep
/// the cookie of the page before: it would be forgotten at once, and the link be used up.
///
/// # Errors
/// No agreement; a store that cannot be written.
pub async fn enter(
    State(app): State<AppState>,
    headers: HeaderMap,
    Form(form): Form<EnterForm>,
) -> Result<Response, Problem> {
    if Cookie::Kept.brought(&headers).is_empty() {
        return Ok(show(&ReturnPage {
            heading: "This browser keeps no cookies",
            told: "Without them your answers would have no name, so nothing was begun and your link still works. Allow cookies for this site and open the link again, or open it in another browser.".to_owned(),
            can_go_on: true,
        }));
    }
    let entered = seats::enter(&app, &form.code, form.agrees.is_some()).await?;
    let cookie = Cookie::Labeler.set(&headers, &entered.browser);
    let page = show(&WelcomePage {
        return_code: seats::shown(&entered.return_code),
    });
    Ok(([(header::SET_COOKIE, cookie)], page).into_response())
}

/// A return code as it was typed.
#[derive(Deserialize)]
pub struct ReturnForm {
    code: String,
}

/// `POST /join/return`
///
/// # Errors
/// A store that cannot be written.
pub async fn come_back(
    State(app): State<AppState>,
    headers: HeaderMap,
    Form(form): Form<ReturnForm>,
) -> Result<Response, Problem> {
    match app.store.come_back(&Secret::typed(&form.code)).await {
        Ok(browser) => {
            let cookie = [(header::SET_COOKIE, Cookie::Labeler.set(&headers, &browser))];
            Ok((cookie, Redirect::to("/seat")).into_response())
        }
        Err(StoreError::Link(LinkTrouble::Unknown)) => Ok(show(&ReturnPage {
            heading: "Go on where you were",
            told: "That is no return code. It has twelve letters and digits; dashes and capitals do not matter.".to_owned(),
            can_go_on: true,
        })),
        Err(StoreError::Link(trouble)) => Ok(show(&turned_away(trouble))),
        Err(error) => Err(error.into()),
    }
}
