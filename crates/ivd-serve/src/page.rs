//! The page: three files that are part of the program.

use std::sync::LazyLock;

use axum::http::header;
use axum::response::{IntoResponse, Response};
use ivd_frames::{KEYS, NOTICE};

/// `{keys}` and `{notice}` stand for what every window says.
const HTML: &str = include_str!("page/index.html");
const SCRIPT: &str = include_str!("page/page.js");
const STYLE: &str = include_str!("page/page.css");

static PAGE: LazyLock<String> = LazyLock::new(|| {
    let keys = KEYS.map(|(keys, what)| format!("<dt>{keys}</dt><dd>{what}</dd>")).join("\n    ");
    HTML.replace("{keys}", &keys).replace("{notice}", NOTICE)
});

fn file(kind: &'static str, text: &'static str) -> Response {
    ([(header::CONTENT_TYPE, kind)], text).into_response()
}

pub(crate) async fn html() -> Response {
    file("text/html; charset=utf-8", &PAGE)
}

pub(crate) async fn script() -> Response {
    file("text/javascript; charset=utf-8", SCRIPT)
}

pub(crate) async fn style() -> Response {
    file("text/css; charset=utf-8", STYLE)
}
