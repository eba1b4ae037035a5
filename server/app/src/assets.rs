//! The files of `web/static`, inside the program.

use axum::http::{HeaderMap, HeaderValue, StatusCode, header};
use axum::response::{IntoResponse, Response};
use sha2::{Digest, Sha256};

use crate::extract::Path;
use crate::problem::Problem;

/// `(path below web/static, bytes)`, sorted by path; written by the build script.
const FILES: &[(&str, &[u8])] = include!(concat!(env!("OUT_DIR"), "/static_files.rs"));

/// `GET /static/{path}`: revalidated by its hash, so that a new program's pages never meet an
/// old program's scripts.
pub async fn file(Path(path): Path<String>, headers: HeaderMap) -> Result<Response, Problem> {
    let found = FILES.binary_search_by_key(&path.as_str(), |(name, _)| name);
    let Ok(index) = found else {
        return Err(Problem::no_such_page(&format!("/static/{path}")));
    };
    let bytes = FILES[index].1;
    let tag = format!("\"{:x}\"", Sha256::digest(bytes));
    let is_known = headers
        .get(header::IF_NONE_MATCH)
        .is_some_and(|known| known.as_bytes() == tag.as_bytes());
    let tag = HeaderValue::from_str(&tag).expect("hexadecimal digits are a header value");
    let common = [
        (header::ETAG, tag),
        (header::CACHE_CONTROL, HeaderValue::from_static("no-cache")),
        (
            header::CONTENT_TYPE,
            HeaderValue::from_static(content_type(&path)),
        ),
    ];
    if is_known {
        return Ok((StatusCode::NOT_MODIFIED, common).into_response());
    }
    Ok((common, bytes).into_response())
}

/// Whether there is such a file below `web/static`.
pub fn contains(path: &str) -> bool {
    FILES.binary_search_by_key(&path, |(name, _)| name).is_ok()
}

fn content_type(path: &str) -> &'static str {
    match path.rsplit_once('.').map(|(_, extension)| extension) {
        Some("js" | "mjs") => "text/javascript; charset=utf-8",
        Some("css") => "text/css; charset=utf-8",
        Some("svg") => "image/svg+xml",
        Some("png") => "image/png",
        Some("webp") => "image/webp",
        Some("ico") => "image/x-icon",
        Some("json") => "application/json",
        Some("mp4") => "video/mp4",
        Some("woff2") => "font/woff2",
        Some("txt") => "text/plain; charset=utf-8",
        _ => "application/octet-stream",
    }
}
