//! `/api`: the HTTP interface for people, from the description that programs read.

use askama::Template;
use askama::filters::{Escaper as _, Html};
use axum::http::HeaderMap;
use axum::response::Response;
use serde_json::Value;
use utoipa::OpenApi as _;

use super::show;
use crate::api::Document;
use crate::extract::host;
use crate::problem::Problem;
use crate::worker::in_worker;

#[derive(Template)]
#[template(path = "api.html")]
struct ApiPage {
    /// Where the server is: `http://127.0.0.1:8080`.
    address: String,
    /// What a request may bring to be let in.
    keys: Vec<Line>,
    /// Operations by what they are about, then the objects in bodies.
    groups: Vec<Group>,
}

/// Entries under one heading.
struct Group {
    id: String,
    title: String,
    /// HTML.
    about: String,
    entries: Vec<Entry>,
}

/// An operation or an object.
struct Entry {
    id: String,
    /// `POST`; empty for an object.
    method: String,
    /// The path, or the object's name.
    name: String,
    /// A sentence, HTML.
    summary: String,
    /// Paragraphs, HTML.
    notes: Vec<String>,
    parts: Vec<Part>,
}

/// What an operation takes, what it answers, or what an object holds.
struct Part {
    heading: &'static str,
    lines: Vec<Line>,
}

/// A parameter, a field, a response, or a token.
struct Line {
    name: String,
    /// `integer, required`
    kind: String,
    /// HTML.
    meaning: String,
    /// The object that it holds; empty where it holds none.
    object: String,
}

/// `GET /api`
///
/// # Errors
/// A description that cannot be written as JSON.
pub async fn page(headers: HeaderMap) -> Result<Response, Problem> {
    let address = host(&headers).map_or_else(
        || "http://127.0.0.1:8080".to_owned(),
        |host| format!("http://{host}"),
    );
    let page = in_worker(move || {
        let document = serde_json::to_value(Document::openapi())?;
        Ok::<_, serde_json::Error>(ApiPage::of(&document, address))
    });
    let page = page.await?.map_err(|error| {
        tracing::error!("the API's description cannot be written: {error}");
        Problem::internal()
    })?;
    Ok(show(&page))
}

impl ApiPage {
    /// * `document` – OpenAPI, as JSON
    fn of(document: &Value, address: String) -> Self {
        let tags = document["tags"].as_array().into_iter().flatten();
        let mut groups: Vec<Group> = tags.map(|tag| group(document, tag)).collect();
        groups.push(objects(document));
        let schemes = members(&document["components"]["securitySchemes"]);
        Self {
            address,
            keys: schemes.map(key).collect(),
            groups,
        }
    }
}

/// The operations under one tag.
fn group(document: &Value, tag: &Value) -> Group {
    let name = text(&tag["name"]);
    let mut entries = Vec::new();
    for (path, methods) in members(&document["paths"]) {
        for (method, said) in members(methods) {
            if said["tags"][0] == name {
                entries.push(operation(document, method, path, said));
            }
        }
    }
    Group {
        id: name.to_owned(),
        title: capital(name),
        about: words(text(&tag["description"])),
        entries,
    }
}

/// Everything that bodies are made of, by name.
fn objects(document: &Value) -> Group {
    let schemas = members(&document["components"]["schemas"]);
    let entries = schemas.map(|(name, schema)| {
        let mut notes = paragraphs(schema);
        Entry {
            id: name.clone(),
            method: String::new(),
            name: name.clone(),
            summary: notes.next().unwrap_or_default(),
            notes: notes.collect(),
            parts: vec![Part {
                heading: "Fields",
                lines: fields(schema),
            }],
        }
    });
    Group {
        id: "objects".to_owned(),
        title: "Objects".to_owned(),
        about: "What bodies are made of.".to_owned(),
        entries: entries.collect(),
    }
}

fn operation(document: &Value, method: &str, path: &str, said: &Value) -> Entry {
    let body = &said["requestBody"]["content"]["application/json"]["schema"];
    let parameters = said["parameters"].as_array().into_iter().flatten();
    let responses = members(&said["responses"]);
    let parts = [
        Part {
            heading: "Parameters",
            lines: parameters.map(parameter).collect(),
        },
        Part {
            heading: "Body",
            lines: fields(resolved(document, body)),
        },
        Part {
            heading: "Responses",
            lines: responses.map(response).collect(),
        },
    ];
    let parts = parts.into_iter().filter(|part| !part.lines.is_empty());
    let who = format!("Open to {}.", admitted(&said["security"]));
    Entry {
        id: text(&said["operationId"]).to_owned(),
        method: method.to_uppercase(),
        name: path.to_owned(),
        summary: words(text(&said["summary"])),
        notes: paragraphs(said).chain([words(&who)]).collect(),
        parts: parts.collect(),
    }
}

/// Whom an operation lets in, in words.
///
/// * `security` – alternatives, each the names of all that it takes
fn admitted(security: &Value) -> String {
    let alternatives = security.as_array().into_iter().flatten();
    let alternatives: Vec<Vec<String>> = alternatives
        .map(|all| members(all).map(|(name, _)| format!("`{name}`")).collect())
        .collect();
    let named: Vec<String> = alternatives
        .iter()
        .filter(|all| !all.is_empty())
        .map(|all| all.join(" with "))
        .collect();
    let is_open = named.len() < alternatives.len();
    match (is_open, named.join(" or ")) {
        (true, named) if named.is_empty() => "everybody".to_owned(),
        (true, named) => format!("everybody on the server's own machine, on a network to {named}"),
        (false, named) => named,
    }
}

fn key((name, scheme): (&String, &Value)) -> Line {
    let place = match scheme["name"].as_str() {
        Some(cookie) => format!("cookie {cookie}"),
        None => "Authorization: Bearer".to_owned(),
    };
    Line {
        name: name.clone(),
        kind: place,
        meaning: words(text(&scheme["description"])),
        object: String::new(),
    }
}

fn parameter(parameter: &Value) -> Line {
    let place = match text(&parameter["in"]) {
        "query" => "after the question mark",
        "header" => "header",
        _ => "in the path",
    };
    Line {
        name: text(&parameter["name"]).to_owned(),
        kind: format!("{}, {place}", kind(&parameter["schema"])),
        meaning: words(text(&parameter["description"])),
        object: String::new(),
    }
}

/// The fields of an object, those first that must be there.
fn fields(schema: &Value) -> Vec<Line> {
    let required: Vec<&Value> = schema["required"]
        .as_array()
        .into_iter()
        .flatten()
        .collect();
    let is_required = |name: &str| required.iter().any(|required| **required == name);
    let line = |(name, field): (&String, &Value)| Line {
        name: name.clone(),
        kind: if is_required(name) {
            format!("{}, required", kind(field))
        } else {
            kind(field)
        },
        meaning: words(meaning(field)),
        object: object(field),
    };
    let (mut first, rest): (Vec<_>, Vec<_>) =
        members(&schema["properties"]).partition(|(name, _)| is_required(name));
    first.extend(rest);
    first.into_iter().map(line).collect()
}

fn response((status, response): (&String, &Value)) -> Line {
    let kinds: Vec<&str> = members(&response["content"])
        .map(|(kind, _)| kind.as_str())
        .collect();
    let schema = members(&response["content"]).map(|(_, content)| &content["schema"]);
    Line {
        name: status.clone(),
        kind: kinds.join(", "),
        meaning: words(text(&response["description"])),
        object: schema.map(object).next().unwrap_or_default(),
    }
}

/// What a value is: `list of objects`, `string or null`.
fn kind(schema: &Value) -> String {
    let either = schema["oneOf"].as_array().or(schema["type"].as_array());
    if let Some(either) = either {
        return either.iter().map(kind).collect::<Vec<_>>().join(" or ");
    }
    match schema["type"].as_str().or(schema.as_str()) {
        Some("array") => format!("list of {}s", kind(&schema["items"])),
        Some(word) => word.to_owned(),
        None => "object".to_owned(),
    }
}

/// What a field is for; a field that may be null has it on the other alternative.
fn meaning(field: &Value) -> &str {
    let alternatives = field["oneOf"].as_array().into_iter().flatten();
    let mut told = [field].into_iter().chain(alternatives);
    told.find_map(|schema| schema["description"].as_str())
        .unwrap_or_default()
}

/// The name of the object that a value is, or that its items are.
fn object(schema: &Value) -> String {
    let alternatives = schema["oneOf"].as_array().into_iter().flatten();
    let mut places = [schema, &schema["items"]].into_iter().chain(alternatives);
    let reference = places.find_map(|place| place["$ref"].as_str());
    let name = reference.and_then(|reference| reference.rsplit('/').next());
    name.unwrap_or_default().to_owned()
}

/// What a schema refers to, or itself.
fn resolved<'d>(document: &'d Value, schema: &'d Value) -> &'d Value {
    let place = schema["$ref"].as_str().and_then(|at| at.strip_prefix('#'));
    let found = place.and_then(|place| document.pointer(place));
    found.unwrap_or(schema)
}

fn members(value: &Value) -> impl Iterator<Item = (&String, &Value)> {
    value.as_object().into_iter().flatten()
}

fn text(value: &Value) -> &str {
    value.as_str().unwrap_or_default()
}

/// The paragraphs of a description, as HTML.
fn paragraphs(said: &Value) -> impl Iterator<Item = String> {
    let told = text(&said["description"]).split("\n\n");
    told.filter(|paragraph| !paragraph.is_empty()).map(words)
}

/// Words as HTML; what stands between backticks is code.
fn words(text: &str) -> String {
    let mut html = String::new();
    for (n, part) in text.split('`').enumerate() {
        let is_code = n % 2 == 1;
        html.push_str(if is_code { "<code>" } else { "" });
        let _ = Html.write_escaped_str(&mut html, part); // a string takes everything
        html.push_str(if is_code { "</code>" } else { "" });
    }
    html
}

/// A heading of a word.
fn capital(word: &str) -> String {
    let mut letters = word.chars();
    let first = letters.next().map(|letter| letter.to_ascii_uppercase());
    first.into_iter().chain(letters).collect()
}

#[cfg(test)]
mod tests {
    use serde_json::json;

    use super::*;

    fn rendered() -> (Value, String) {
        let document = serde_json::to_value(Document::openapi()).unwrap();
        let page = ApiPage::of(&document, "http://127.0.0.1:8080".into());
        let html = page.render().unwrap();
        (document, html)
    }

    #[test]
    fn everything_in_the_description_is_on_the_page() {
        let (document, html) = rendered();
        for (path, methods) in members(&document["paths"]) {
            assert!(html.contains(&format!("<code>{path}</code>")), "{path}");
            for (method, said) in members(methods) {
                let id = format!("id=\"{}\"", text(&said["operationId"]));
                assert_eq!(html.matches(&id).count(), 1, "{method} {path}");
            }
        }
        for (name, schema) in members(&document["components"]["schemas"]) {
            for (field, _) in members(&schema["properties"]) {
                let told = format!("<code>{field}</code>");
                assert!(html.contains(&told), "{name}: {field}");
            }
        }
    }

    #[test]
    fn every_link_inside_the_page_leads_somewhere() {
        let (_, html) = rendered();
        let targets: Vec<&str> = html.split("href=\"#").skip(1).collect();
        assert!(targets.len() > 50, "{}", targets.len());
        for target in targets {
            let (id, _) = target.split_once('"').unwrap();
            assert!(html.contains(&format!("id=\"{id}\"")), "{id}");
        }
    }

    #[test]
    fn a_value_is_told_in_words() {
        let list = json!({ "type": "array", "items": { "$ref": "#/components/schemas/RunView" } });
        assert_eq!(
            (kind(&list).as_str(), object(&list).as_str()),
            ("list of objects", "RunView")
        );
        assert_eq!(
            kind(&json!({ "type": ["string", "null"] })),
            "string or null"
        );
        let optional = json!({ "oneOf": [
            { "$ref": "#/components/schemas/PhaseView", "description": "What it is doing." },
            { "type": "null" },
        ] });
        assert_eq!(
            (kind(&optional).as_str(), object(&optional).as_str()),
            ("object or null", "PhaseView")
        );
        assert_eq!(meaning(&optional), "What it is doing.");
    }

    #[test]
    fn whom_an_operation_lets_in_is_told_in_words() {
        assert_eq!(admitted(&json!([{}])), "everybody");
        assert_eq!(
            admitted(&json!([{}, { "accessToken": [] }])),
            "everybody on the server's own machine, on a network to `accessToken`"
        );
        assert_eq!(
            admitted(&json!([{ "teacherToken": [] }, { "labelerCookie": [] }])),
            "`teacherToken` or `labelerCookie`"
        );
    }

    #[test]
    fn words_are_escaped_and_code_is_marked() {
        let html = words("`skip` & <b>");
        assert!(html.starts_with("<code>skip</code> "), "{html}");
        assert!(!html.contains("<b>"), "{html}");
    }
}
