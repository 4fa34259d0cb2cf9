//! Tables.

use std::fmt::{Display, Write as _};

use serde::Serialize;
use serde_json::Value;

use crate::html::{escape, number};

/// Longer tables aren't read.
pub const MOST_ROWS: usize = 100;

/// A cell of a table.
#[derive(Debug, Clone, PartialEq)]
pub enum Cell {
    /// Text.
    Text(String),
    /// A patch of a colour, as CSS writes it.
    Swatch(String),
}

impl Cell {
    /// What is shown as it is written: a whole number, a name.
    pub fn plain(value: impl Display) -> Self {
        Self::Text(value.to_string())
    }

    /// A measured number, with three digits.
    pub fn number(value: f64) -> Self {
        Self::Text(number(value))
    }

    /// A measured number; a dash where there is none.
    pub fn number_or_dash(value: Option<f64>) -> Self {
        Self::Text(value.map_or_else(|| "–".to_owned(), number))
    }
}

/// A table of names and values.
pub fn pairs(rows: &[(&str, String)]) -> String {
    let mut html = String::from("<table>");
    for (name, value) in rows {
        let _ = write!(html, "<tr><th>{}</th><td>{}</td></tr>", escape(name), escape(value));
    }
    html + "</table>"
}

/// A figure with its place among those of `--json`: who reads the page by a program finds it there in full.
#[derive(Debug, Clone, PartialEq)]
pub struct Figure {
    /// What it is, with its unit.
    pub label: &'static str,
    /// Stage and key: `map.share`.
    pub key: &'static str,
    /// Its value; null where there is none.
    pub value: Value,
    /// What it means, in a clause beside it; empty where the label says it.
    pub means: &'static str,
}

impl Figure {
    /// A figure of a stage.
    pub fn new(label: &'static str, key: &'static str, value: impl Serialize) -> Self {
        Self { label, key, value: serde_json::to_value(value).unwrap_or_default(), means: "" }
    }

    /// The same, with what it means.
    #[must_use]
    pub fn meaning(self, means: &'static str) -> Self {
        Self { means, ..self }
    }
}

/// A table of figures; those that aren't there are left out.
pub fn figures(rows: &[Figure]) -> String {
    let mut html = String::from("<table>");
    for Figure { label, key, value, means } in rows.iter().filter(|row| !row.value.is_null()) {
        let means = if means.is_empty() {
            String::new()
        } else {
            format!("<td class='means'>{}</td>", escape(means))
        };
        let _ = write!(
            html,
            "<tr><th>{}</th><td data-figure='{}' data-value='{}'>{}</td>{means}</tr>",
            escape(label),
            escape(key),
            escape(&value.to_string()),
            escape(&shown(value)),
        );
    }
    html + "</table>"
}

/// A figure as text: lists without brackets, a dash where there is none.
pub fn shown(figure: impl Serialize) -> String {
    match serde_json::to_value(figure) {
        Ok(Value::Number(n)) => {
            n.as_u64().map_or_else(|| number(n.as_f64().unwrap_or(f64::NAN)), |u| u.to_string())
        }
        Ok(Value::Null) | Err(_) => "–".to_owned(),
        Ok(Value::String(s)) => s,
        Ok(Value::Array(list)) => list.iter().map(shown).collect::<Vec<_>>().join(", "),
        Ok(other) => other.to_string(),
    }
}

/// Rows under a head.
pub fn table<const N: usize>(head: [&str; N], rows: impl Iterator<Item = [Cell; N]>) -> String {
    let mut html = String::from("<table><tr>");
    for name in head {
        let _ = write!(html, "<th>{}</th>", escape(name));
    }
    html += "</tr>";
    for row in rows {
        html += "<tr>";
        for cell in row {
            let _ = match cell {
                Cell::Text(text) => write!(html, "<td>{}</td>", escape(&text)),
                Cell::Swatch(colour) => {
                    write!(html, "<td><span class='swatch' style='background:{colour}'></span></td>")
                }
            };
        }
        html += "</tr>";
    }
    html + "</table>"
}

/// As [`table`], with [`MOST_ROWS`] at most; how many more there are is said below.
pub fn shortened_table<const N: usize>(
    head: [&str; N],
    rows: impl ExactSizeIterator<Item = [Cell; N]>,
) -> String {
    let more = rows.len().saturating_sub(MOST_ROWS);
    let html = table(head, rows.take(MOST_ROWS));
    if more > 0 { html + &format!("<p>and {more} more</p>") } else { html }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn cells_are_text_or_a_patch_of_colour() {
        let row = [Cell::Text("<b>".to_owned()), Cell::Swatch("#fff".to_owned()), Cell::number_or_dash(None)];
        let html = table(["a", "b", "c"], [row].into_iter());
        let row = "<td>&lt;b&gt;</td><td><span class='swatch' style='background:#fff'></span></td><td>–</td>";
        assert_eq!(html, format!("<table><tr><th>a</th><th>b</th><th>c</th></tr><tr>{row}</tr></table>"));
    }

    #[test]
    fn a_long_table_says_how_much_it_leaves_out() {
        let rows = |count: usize| shortened_table(["n"], (0..count).map(|n| [Cell::plain(n)]));
        assert!(rows(102).ends_with("<td>99</td></tr></table><p>and 2 more</p>"));
        assert!(rows(100).ends_with("<td>99</td></tr></table>"));
    }
}
