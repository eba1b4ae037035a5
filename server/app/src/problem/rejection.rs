//! Bodies, forms and addresses that cannot be read, as problems.

use axum::extract::path::ErrorKind;
use axum::extract::rejection::{FormRejection, JsonRejection, PathRejection, QueryRejection};
use axum::http::StatusCode;
use lab::config::plainly;

use super::Problem;

impl From<JsonRejection> for Problem {
    fn from(rejection: JsonRejection) -> Self {
        let told = rejection.body_text();
        let detail = match rejection {
            JsonRejection::JsonDataError(_) => misfit(&told),
            _ => told,
        };
        Self::bad_request(rejection.status(), detail)
    }
}

/// A body that is JSON but not what was asked for: where, what stands there, and what to write.
fn misfit(told: &str) -> String {
    let told = told
        .strip_prefix("Failed to deserialize the JSON body into the target type: ")
        .unwrap_or(told);
    match told.rsplit_once(" at line ") {
        Some((message, place)) => format!("{} (line {place})", plainly(message)),
        None => plainly(told),
    }
}

impl From<PathRejection> for Problem {
    fn from(rejection: PathRejection) -> Self {
        let told = match &rejection {
            PathRejection::FailedToDeserializePathParams(failed) => unfit_part(failed.kind()),
            _ => None,
        };
        let detail = told.unwrap_or_else(|| rejection.body_text());
        Self::bad_request(StatusCode::NOT_FOUND, detail)
    }
}

/// A part of an address that is not what belongs there.
fn unfit_part(kind: &ErrorKind) -> Option<String> {
    match kind {
        ErrorKind::ParseError { value, .. }
        | ErrorKind::ParseErrorAtKey { value, .. }
        | ErrorKind::ParseErrorAtIndex { value, .. } => Some(format!(
            "'{value}' stands in the address where a whole number belongs."
        )),
        _ => None,
    }
}

impl From<QueryRejection> for Problem {
    fn from(rejection: QueryRejection) -> Self {
        let (status, told) = (rejection.status(), rejection.body_text());
        let detail = match rejection {
            QueryRejection::FailedToDeserializeQueryString(_) => unfit("The address", &told),
            _ => told,
        };
        Self::bad_request(status, detail)
    }
}

impl From<FormRejection> for Problem {
    fn from(rejection: FormRejection) -> Self {
        let (status, told) = (rejection.status(), rejection.body_text());
        let detail = match rejection {
            FormRejection::FailedToDeserializeForm(_)
            | FormRejection::FailedToDeserializeFormBody(_) => unfit("The form", &told),
            _ => told,
        };
        Self::bad_request(status, detail)
    }
}

/// Fields that are not what was asked for: which, what stands there, and what to write. Every
/// number in a form or an address counts something or names it.
///
/// * `place` – where the fields stand: `The form`
/// * `told` – `Failed to deserialize form body: count: invalid digit found in string`
fn unfit(place: &str, told: &str) -> String {
    let told = told.split_once(": ").map_or(told, |(_, told)| told);
    if let Some((_, field)) = told.split_once("missing field ") {
        return format!("{place} lacks {field}.");
    }
    let Some((field, reason)) = told.split_once(": ") else {
        return format!("{place} cannot be read: {told}.");
    };
    let reason = match reason {
        "cannot parse integer from empty string" => "is empty",
        "invalid digit found in string" => "is something else",
        "number too large to fit in target type" => "is too large",
        other => return format!("{place} has a `{field}` that does not fit: {other}."),
    };
    format!("`{field}` must be a whole number, 0 or more; it {reason}.")
}

#[cfg(test)]
mod tests {
    use axum::body::Body;
    use axum::extract::{Form, FromRequest as _};
    use axum::http::{Request, header};
    use serde::Deserialize;

    use super::*;

    #[derive(Debug, PartialEq, Deserialize)]
    struct Fields {
        token: String,
        count: Option<u32>,
    }

    async fn read(fields: &'static str) -> Result<Fields, Problem> {
        let request = Request::post("/")
            .header(header::CONTENT_TYPE, "application/x-www-form-urlencoded")
            .body(Body::from(fields))
            .expect("a request");
        let Form(read) = Form::<Fields>::from_request(request, &()).await?;
        Ok(read)
    }

    #[tokio::test]
    async fn a_field_that_does_not_fit_is_named_with_what_belongs_there() {
        for (fields, told) in [
            ("count=1", "The form lacks `token`."),
            (
                "token=a&count=",
                "`count` must be a whole number, 0 or more; it is empty.",
            ),
            (
                "token=a&count=-1",
                "`count` must be a whole number, 0 or more; it is something else.",
            ),
            (
                "token=a&count=99999999999",
                "`count` must be a whole number, 0 or more; it is too large.",
            ),
            (
                "token=a&token=b",
                "The form cannot be read: duplicate field `token`.",
            ),
        ] {
            let refused = read(fields).await.expect_err(fields);
            assert_eq!((refused.status, refused.detail.as_str()), (422, told));
        }
        let (token, count) = ("a".to_owned(), Some(3));
        let fits = read("token=a&count=3").await.expect("what was asked for");
        assert_eq!(fits, Fields { token, count });
    }
}
