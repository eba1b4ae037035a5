//! What operations have in common, put into the API's description in one place.
//!
//! A handler names its operation and says what is its own: parameters, bodies, whom it lets in
//! where that is not the researcher alone, and how it may end. What extractors and the guard
//! refuse before any handler runs is added here.

use utoipa::Modify;
use utoipa::openapi::path::{Operation, ParameterIn};
use utoipa::openapi::security::{
    ApiKey, ApiKeyValue, HttpAuthScheme, HttpBuilder, SecurityRequirement, SecurityScheme,
};
use utoipa::openapi::{Content, OpenApi, Ref, RefOr, Response};

/// What `id` is in an address, by how the address begins.
const NAMED: [(&str, &str); 4] = [
    ("/api/v1/runs/", "The run's number."),
    ("/api/v1/studies/", "The study's number."),
    (
        "/api/v1/leases/",
        "The lease's name: `lease_id` where leases are had.",
    ),
    (
        "/api/v1/queries/",
        "The query's number: `query_id` of a lease.",
    ),
];

/// Completes the description that the handlers make.
pub struct Shared;

impl Modify for Shared {
    fn modify(&self, document: &mut OpenApi) {
        let components = document.components.get_or_insert_default();
        for (name, scheme) in schemes() {
            components.add_security_scheme(name, scheme);
        }
        for (path, item) in &mut document.paths.paths {
            let operations = [
                (false, &mut item.get),
                (true, &mut item.post),
                (true, &mut item.put),
            ];
            for (is_change, operation) in operations {
                if let Some(operation) = operation {
                    name_parameters(path, operation);
                    complete(operation, is_change);
                }
            }
        }
    }
}

/// What a request may bring to be let in.
fn schemes() -> [(&'static str, SecurityScheme); 4] {
    [
        (
            "accessToken",
            bearer("The server's token, which opens everything on a network."),
        ),
        (
            "teacherToken",
            bearer("A program's token, for answering one run's queries."),
        ),
        (
            "accessCookie",
            cookie(
                "stair_access",
                "The server's token in a browser that came by `/enter?token=…`. The port in the server's address follows the name: `stair_access_8080`.",
            ),
        ),
        (
            "labelerCookie",
            cookie(
                "stair_labeler",
                "Says who answers. The port in the server's address follows the name: `stair_labeler_8080`. On a network it lets in the labelers of studies; others need the server's token besides.",
            ),
        ),
    ]
}

fn bearer(told: &str) -> SecurityScheme {
    let scheme = HttpBuilder::new().scheme(HttpAuthScheme::Bearer);
    SecurityScheme::Http(scheme.description(Some(told)).build())
}

fn cookie(name: &str, told: &str) -> SecurityScheme {
    SecurityScheme::ApiKey(ApiKey::Cookie(ApiKeyValue::with_description(name, told)))
}

/// Nobody on the server's own machine needs anything; on a network it is the server's token.
fn researcher() -> Vec<SecurityRequirement> {
    let one = |name: &str| SecurityRequirement::new(name, Vec::<String>::new());
    vec![
        SecurityRequirement::default(),
        one("accessToken"),
        one("accessCookie"),
    ]
}

fn name_parameters(path: &str, operation: &mut Operation) {
    let named = NAMED
        .iter()
        .find(|(beginning, _)| path.starts_with(beginning));
    for parameter in operation.parameters.iter_mut().flatten() {
        if let (RefOr::T(parameter), Some((_, told))) = (parameter, named)
            && parameter.name == "id"
        {
            parameter.description = Some((*told).to_owned());
        }
    }
}

fn complete(operation: &mut Operation, is_change: bool) {
    for text in [&mut operation.summary, &mut operation.description] {
        let told = text.take().map(|told| plain(&told));
        *text = told.filter(|told| !told.is_empty());
    }
    operation.security.get_or_insert_with(researcher);
    let refusals = refusals(operation, is_change);
    let responses = &mut operation.responses.responses;
    for (status, told) in refusals {
        let response = responses
            .entry(status.to_owned())
            .or_insert_with(|| RefOr::T(Response::default()));
        if let RefOr::T(Response { description, .. }) = response {
            if !description.is_empty() {
                description.push(' ');
            }
            description.push_str(told);
        }
    }
    for (status, response) in responses {
        let RefOr::T(response) = response else {
            continue;
        };
        if response.description.is_empty() {
            usual(status).clone_into(&mut response.description);
        }
        if is_problem(status) {
            let problem = Content::new(Some(Ref::from_schema_name("Problem")));
            response.content.clear();
            response
                .content
                .insert("application/problem+json".to_owned(), RefOr::T(problem));
        }
    }
}

/// Documentation as readers of the API need it: paragraphs of one line each, without the section
/// on errors, which the responses tell status by status.
fn plain(documentation: &str) -> String {
    let (told, _) = documentation
        .split_once("# Errors")
        .unwrap_or((documentation, ""));
    let paragraphs = told.split("\n\n").map(|paragraph| {
        let words: Vec<&str> = paragraph.split_whitespace().collect();
        words.join(" ")
    });
    let paragraphs: Vec<String> = paragraphs.filter(|told| !told.is_empty()).collect();
    paragraphs.join("\n\n")
}

/// How a request may end whatever its handler does: statuses, each with its reason.
fn refusals(operation: &Operation, is_change: bool) -> Vec<(&'static str, &'static str)> {
    let nothing = SecurityRequirement::default();
    let needs = operation.security.as_deref().unwrap_or_default();
    let is_open = needs.iter().all(|need| *need == nothing);
    let has = |place: ParameterIn| {
        let mut parameters = operation.parameters.iter().flatten();
        parameters.any(|parameter| matches!(parameter, RefOr::T(p) if p.parameter_in == place))
    };
    let mut told = vec![
        (
            "403",
            match (is_change, is_open) {
                (false, true) => "The server is asked under a name that is not its own.",
                (true, true) => {
                    "The server is asked under a name that is not its own, or by a page of another site."
                }
                (false, false) => {
                    "The server is asked under a name that is not its own, or with a teacher token that is not for this."
                }
                (true, false) => {
                    "The server is asked under a name that is not its own, by a page of another site, or with a teacher token that is not for this."
                }
            },
        ),
        (
            "default",
            "Anything else: 500, the server failed; 503, it is closing; 507, its disk is full or cannot be written.",
        ),
    ];
    if !is_open {
        let why = if needs.contains(&nothing) {
            "The server is on a network, and the request brings nothing that opens this."
        } else {
            "The request does not say who answers, or its token is not known."
        };
        told.push(("401", why));
    }
    if has(ParameterIn::Path) {
        told.push(("404", "The address names nothing that exists."));
    }
    if has(ParameterIn::Query) {
        told.push(("400", "What follows the question mark cannot be read."));
    }
    if operation.request_body.is_some() {
        told.extend([
            ("400", "The body is not JSON."),
            ("413", "The body is larger than the server takes."),
            ("415", "The body does not come as `application/json`."),
            ("422", "The body has fields that do not fit."),
        ]);
    }
    told
}

/// What a status means where a handler says no more about it.
fn usual(status: &str) -> &'static str {
    match status {
        "200" => "What was asked for.",
        "201" => "It is made.",
        "202" => "The run is told; its state says when it is done.",
        "206" => "The part that was asked for.",
        "304" => "The copy that is there already is still right.",
        _ => "",
    }
}

/// Whether a problem comes with the status.
fn is_problem(status: &str) -> bool {
    !status.starts_with(['2', '3'])
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeSet;

    use axum::http::HeaderMap;
    use serde_json::Value;
    use store::Secret;
    use utoipa::OpenApi as _;

    use super::*;
    use crate::api::Document;
    use crate::extract::Cookie;

    fn document() -> Value {
        serde_json::to_value(Document::openapi()).expect("JSON")
    }

    /// `post /api/v1/runs` and what is said about it.
    fn operations(document: &Value) -> Vec<(String, &Value)> {
        let paths = document["paths"].as_object().expect("paths");
        let operations = paths.iter().flat_map(|(path, methods)| {
            let methods = methods.as_object().expect("methods");
            methods
                .iter()
                .map(move |(method, operation)| (format!("{method} {path}"), operation))
        });
        operations.collect()
    }

    #[test]
    fn every_operation_has_a_name_of_its_own_and_tells_what_it_does_in_a_sentence() {
        let document = document();
        let tags: Vec<&Value> = document["tags"]
            .as_array()
            .expect("tags")
            .iter()
            .map(|tag| &tag["name"])
            .collect();
        let mut names = BTreeSet::new();
        for (place, operation) in operations(&document) {
            let name = operation["operationId"].as_str().expect("a name");
            assert!(names.insert(name), "{place}: {name} is taken");
            let summary = operation["summary"].as_str().expect("a summary");
            let is_sentence = summary.ends_with('.') && !summary.contains(". ");
            assert!(is_sentence && !summary.contains('\n'), "{place}: {summary}");
            assert!(tags.contains(&&operation["tags"][0]), "{place}");
        }
        assert!(!document.to_string().contains("# Errors"));
    }

    #[test]
    fn every_response_is_described_and_refusals_are_problems() {
        let document = document();
        assert!(document["components"]["schemas"]["Problem"].is_object());
        for (place, operation) in operations(&document) {
            for (status, response) in operation["responses"].as_object().expect("responses") {
                let told = response["description"].as_str().unwrap_or_default();
                assert!(told.ends_with('.'), "{place} {status}: '{told}'");
                let kinds: Vec<&String> = response["content"]
                    .as_object()
                    .into_iter()
                    .flat_map(serde_json::Map::keys)
                    .collect();
                if is_problem(status) {
                    assert_eq!(kinds, ["application/problem+json"], "{place} {status}");
                } else {
                    assert!(
                        kinds.iter().all(|kind| !kind.contains("problem")),
                        "{place} {status}: {kinds:?}"
                    );
                }
            }
        }
    }

    #[test]
    fn what_extractors_and_the_guard_refuse_is_told_where_it_can_happen() {
        let document = document();
        let statuses = |method: &str, path: &str| -> Vec<String> {
            let responses = &document["paths"][path][method]["responses"];
            let responses = responses.as_object().expect("responses");
            responses.keys().cloned().collect()
        };
        assert_eq!(
            statuses("post", "/api/v1/runs/{id}/pause"),
            ["202", "401", "403", "404", "409", "default"]
        );
        assert_eq!(
            statuses("put", "/api/v1/studies/{id}"),
            [
                "200", "400", "401", "403", "404", "409", "413", "415", "422", "default"
            ]
        );
        assert_eq!(statuses("get", "/livez"), ["200", "403", "default"]);
        assert_eq!(
            statuses("post", "/api/v1/leases/{id}/heartbeat"),
            ["200", "401", "403", "404", "410", "default"]
        );
    }

    #[test]
    fn whom_an_operation_lets_in_is_said_in_names_that_are_explained() {
        let document = document();
        let schemes = &document["components"]["securitySchemes"];
        for (place, operation) in operations(&document) {
            let needs = operation["security"].as_array().expect("alternatives");
            let names = needs.iter().filter_map(Value::as_object);
            for name in names.flat_map(serde_json::Map::keys) {
                assert!(schemes[name].is_object(), "{place}: {name}");
            }
        }
        for (scheme, kind) in [
            ("accessCookie", Cookie::Access),
            ("labelerCookie", Cookie::Labeler),
        ] {
            let set = kind.set(&HeaderMap::new(), &Secret::brought("s"));
            let name = schemes[scheme]["name"].as_str().expect("a name");
            assert!(set.starts_with(&format!("{name}=")), "{set}");
        }
    }

    #[test]
    fn documentation_loses_its_section_on_errors_and_the_ends_of_its_lines() {
        let told = "Follows a run\nlive.\n\nWithout gaps.\n\n# Errors\nAn unknown run.";
        assert_eq!(plain(told), "Follows a run live.\n\nWithout gaps.");
        assert_eq!(plain("# Errors\nAn unknown run."), "");
    }
}
