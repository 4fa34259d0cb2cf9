//! What differs from machine to machine or from run to run, hidden from snapshots.

use std::fmt::Write as _;
use std::path::Path;

use serde_json::{Map, Value};

/// Keys whose values are of the moment or of the machine; everything else is kept. Of texts, 64 hexadecimal digits (content
/// hashes, whose proof is fixtures/golden.tsv) and the test's folder are hidden too.
const OF_THE_RUN: &[&str] = &[
    "wall_s",
    "cpu_s",
    "kmvs_s",
    "msvs_s",
    "fps",
    "peak_rss_mb",
    "peak_own_mb",
    "bytes_read",
    "bytes",
    "freed_bytes",
    "memory_bytes",
    "threads",
    "processors",
    "simd",
    "script",
];

/// An object with what differs from run to run replaced by what kind of value it is. Numbers keep eight digits: the last ones of
/// a solver's residual differ with the C library's own choice of instructions.
pub(crate) fn masked(value: &Value, folder: &Path) -> Value {
    match value {
        Value::Object(members) => {
            let mut keys: Vec<&String> = members.keys().collect();
            keys.sort();
            let member = |key: &String| {
                let hidden = OF_THE_RUN.contains(&key.as_str());
                (key.clone(), if hidden { kind(&members[key]) } else { masked(&members[key], folder) })
            };
            Value::Object(keys.into_iter().map(member).collect::<Map<_, _>>())
        }
        Value::Array(items) => items.iter().map(|item| masked(item, folder)).collect(),
        Value::String(text) => text_masked(text, folder).into(),
        Value::Number(number) if number.is_f64() => {
            let rounded: f64 = format!("{:.7e}", number.as_f64().unwrap()).parse().unwrap();
            rounded.into()
        }
        other => other.clone(),
    }
}

/// As [`masked`], with no number kept at all: of what is nothing but times.
pub(crate) fn numbers_masked(value: &Value, folder: &Path) -> Value {
    match masked(value, folder) {
        Value::Object(members) => {
            members.into_iter().map(|(key, value)| (key, numbers_masked(&value, folder))).collect()
        }
        Value::Array(items) => items.iter().map(|item| numbers_masked(item, folder)).collect(),
        Value::Number(_) => "<number>".into(),
        other => other,
    }
}

/// A text with hashes and the test's folder hidden.
pub(crate) fn text_masked(text: &str, folder: &Path) -> String {
    let text = text.replace(folder.to_str().unwrap(), "<folder>");
    let (mut shown, mut digits) = (String::new(), String::new());
    for c in text.chars().chain(['\n']) {
        if c.is_ascii_digit() || ('a'..='f').contains(&c) {
            digits.push(c);
            continue;
        }
        shown += if digits.len() == 64 { "<hash>" } else { &digits };
        digits.clear();
        shown.push(c);
    }
    shown.pop();
    shown
}

/// A text with its times and amounts of memory hidden, `1.234 s` and `12.3 MiB`, and the room made for them closed up.
pub(crate) fn without_times(text: &str) -> String {
    let hidden = |line: &str| {
        let mut words: Vec<&str> = Vec::new();
        for word in line.split(' ') {
            let unit = word.trim_end_matches([',', ';', '.', ')', ':']);
            if ["s", "MiB", "GiB"].contains(&unit) && words.last().is_some_and(|w| w.parse::<f64>().is_ok()) {
                words.pop();
                while words.last().is_some_and(|w| w.is_empty()) {
                    words.pop();
                }
                words.push("<number>");
            }
            words.push(word);
        }
        words.join(" ")
    };
    text.split('\n').map(hidden).collect::<Vec<_>>().join("\n")
}

fn kind(value: &Value) -> Value {
    let kind = match value {
        Value::Null => return Value::Null,
        Value::Bool(_) => "<bool>",
        Value::Number(_) => "<number>",
        Value::String(_) => "<text>",
        Value::Array(_) => "<list>",
        Value::Object(_) => "<object>",
    };
    kind.into()
}

/// JSON to be read in a difference: a value a line where it is short, its members below one another where it is long.
pub(crate) fn pretty(value: &Value) -> String {
    let mut text = String::new();
    lay_out(value, "", &mut text);
    text + "\n"
}

fn lay_out(value: &Value, indent: &str, text: &mut String) {
    let short = value.to_string();
    let inner = format!("{indent}  ");
    match value {
        Value::Object(members) if short.len() + indent.len() > 110 => {
            text.push('{');
            for (i, (key, member)) in members.iter().enumerate() {
                *text += if i == 0 { "\n" } else { ",\n" };
                let _ = write!(text, "{inner}{}: ", Value::from(key.as_str()));
                lay_out(member, &inner, text);
            }
            let _ = write!(text, "\n{indent}}}");
        }
        Value::Array(items) if short.len() + indent.len() > 110 && !items.iter().all(Value::is_number) => {
            text.push('[');
            for (i, item) in items.iter().enumerate() {
                *text += if i == 0 { "\n" } else { ",\n" };
                *text += &inner;
                lay_out(item, &inner, text);
            }
            let _ = write!(text, "\n{indent}]");
        }
        _ => *text += &short,
    }
}

#[test]
fn hashes_folders_and_times_are_hidden_and_nothing_else() {
    let hash = "0123456789abcdef".repeat(4);
    let value = serde_json::json!({ "wall_s": 1.5, "k": 4, "peak_rss_mb": null, "in": [format!("{hash} /x/y 12ab")] });
    let hidden = masked(&value, Path::new("/x"));
    assert_eq!(
        hidden,
        serde_json::json!({ "wall_s": "<number>", "k": 4, "peak_rss_mb": null, "in": ["<hash> <folder>/y 12ab"] })
    );
    assert_eq!(
        masked(&serde_json::json!([2.0, 2.428_780_004_773_971e-6]), Path::new("/x")).to_string(),
        "[2.0,2.42878e-6]"
    );
    assert_eq!(numbers_masked(&value, Path::new("/x"))["k"], "<number>");
    assert_eq!(without_times("  a    1.5 s  in 2.0 MiB, 3 mm"), "  a <number> s  in <number> MiB, 3 mm");
    let longer = format!("{hash}0");
    assert_eq!(text_masked(&longer, Path::new("/x")), longer, "no hash");
}
