//! The page itself.

use std::fmt::{Display, Write as _};

use crate::html::{escape, png_url};

const STYLE: &str = include_str!("report.css");
const SCRIPT: &str = include_str!("report.js");

/// A page that grows from top to bottom.
#[derive(Debug)]
pub struct Page {
    html: String,
}

/// PNG files of what a page shows first.
#[derive(Debug, Default)]
pub struct Pictures {
    /// What it was.
    pub before: Option<Vec<u8>>,
    /// What it has become; shown over `before`, with a slider between them.
    pub after: Option<Vec<u8>>,
    /// How far what is seen has moved; shown beside the two.
    pub moved: Option<Vec<u8>>,
    /// Their difference; shown beside the two.
    pub difference: Option<Vec<u8>>,
}

impl Page {
    /// A page under a name.
    pub fn new(name: &str) -> Self {
        let html = format!(
            "<!doctype html><html lang='en'><head><meta charset='utf-8'><meta name='viewport' content='width=device-width'>\
             <title>{0} – IVD report</title><style>{STYLE}</style></head><body><h1>{0}</h1>",
            escape(name)
        );
        Self { html }
    }

    /// Shows pictures; nothing where there is none of before.
    pub fn pictures(&mut self, pictures: &Pictures) {
        let page = &mut self.html;
        let url = |png: &Option<Vec<u8>>| png.as_deref().map(png_url);
        match (url(&pictures.before), url(&pictures.after)) {
            (Some(before), Some(after)) => {
                let _ = write!(
                    page,
                    "<div class='pictures'><figure><div class='slider'><img src='{before}' alt='before'>\
                     <img class='over' src='{after}' alt='after'><input type='range' min='0' max='100' value='50' \
                     aria-label='before to after'></div><figcaption>before · after: move the slider</figcaption></figure>"
                );
                if let Some(moved) = url(&pictures.moved) {
                    let _ = write!(
                        page,
                        "<figure><img src='{moved}' alt='how far what is seen has moved'><figcaption>how far what is seen has moved: red out of its surface, blue into it</figcaption></figure>"
                    );
                }
                if let Some(difference) = url(&pictures.difference) {
                    let _ = write!(
                        page,
                        "<figure><img src='{difference}' alt='difference'><figcaption>difference, amplified</figcaption></figure>"
                    );
                }
                page.push_str("</div>");
            }
            (Some(before), None) => {
                let _ = write!(
                    page,
                    "<div class='pictures'><figure><img src='{before}' alt='volume'></figure></div>"
                );
            }
            (None, _) => {}
        }
    }

    /// Adds a section; its body is HTML.
    pub fn section(&mut self, title: &str, body: &str) {
        let _ = write!(self.html, "<section><h2>{}</h2>{body}</section>", escape(title));
    }

    /// The whole page.
    pub fn finish(self) -> String {
        let mut page = self.html;
        let _ = writeln!(
            page,
            "<p class='foot'>Made by IVD {}. A research tool, not a medical device.</p><script>{SCRIPT}</script></body></html>",
            env!("CARGO_PKG_VERSION")
        );
        page
    }
}

/// What a section shows, or why there is nothing to show.
pub fn body_or_problem<E: Display>(body: Result<String, E>) -> String {
    body.unwrap_or_else(|problem| format!("<p>{}</p>", escape(&problem.to_string())))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn pictures_stand_under_a_slider_where_there_are_two() {
        let shown = |before: bool, after: bool, beside: bool| {
            let png = |wanted: bool| wanted.then(|| vec![0_u8]);
            let mut page = Page::new("<head>");
            let (moved, difference) = (png(beside), png(beside));
            page.pictures(&Pictures { before: png(before), after: png(after), moved, difference });
            let html = page.finish();
            (html.matches("<img").count(), html.contains("class='slider'"))
        };
        assert_eq!(shown(true, true, true), (4, true));
        assert_eq!(shown(true, true, false), (2, true));
        assert_eq!(shown(true, false, true), (1, false));
        assert_eq!(shown(false, true, true), (0, false));
        assert!(Page::new("<head>").finish().contains("<h1>&lt;head&gt;</h1>"));
    }

    #[test]
    fn a_problem_takes_the_place_of_a_body() {
        assert_eq!(body_or_problem::<String>(Ok("<b>".to_owned())), "<b>");
        assert_eq!(body_or_problem(Err("a < b")), "<p>a &lt; b</p>");
    }
}
