use std::path::Path;

use crate::volume::Error;
use crate::volume::text_header::{Fields, Header, Lines, MOST};

/// Reads the lines up to the empty one, which belongs to the header, or the end of a detached one. Spaces in a name, upper and lower case are
/// the same to every reader (`datafile` and `data file`, `space directions` and `spacedirections`).
pub(super) fn read(path: &Path) -> Result<Header, Error> {
    let mut lines = Lines::open(path)?;
    if !lines.read()?.unwrap_or_default().starts_with("NRRD000") {
        return Err(Error::field(path, "magic", "the first line is not `NRRD000…`"));
    }
    let mut fields = Fields::new(|name| name.split_whitespace().collect::<String>().to_lowercase());
    while let Some(text) = lines.read()? {
        if text.is_empty() {
            return Ok(Header { fields, length: lines.length });
        }
        if let Some((name, value)) = field(path, &text)? {
            fields.add(path, name, value)?;
        }
    }
    if lines.length >= MOST {
        return Err(Error::field(path, "header", format!("no empty line within {MOST} bytes")));
    }
    Ok(Header { fields, length: lines.length })
}

/// Name and value of a line; `None` for a line that isn't the format's.
fn field<'t>(path: &Path, text: &'t str) -> Result<Option<(&'t str, &'t str)>, Error> {
    // `key:=value` pairs are the writer's own: one of ours says which way a displacement field leads. `#` opens a comment.
    if let Some(direction) = text.strip_prefix("displacement:=") {
        return Ok(Some(("displacement", direction)));
    }
    if text.starts_with('#') || text.find(":=").is_some_and(|at| text.find(": ").is_none_or(|f| at < f)) {
        return Ok(None);
    }
    text.split_once(':').map(Some).ok_or_else(|| {
        let shown: String = text.chars().take(40).collect();
        Error::field(path, "header", format!("the line `{shown}` is no `field: value`"))
    })
}

/// A vector `(a,b,c)`, or `none`.
pub(super) fn vectors(path: &Path, name: &str, text: &str) -> Result<Vec<Option<Vec<f64>>>, Error> {
    let mut found = Vec::new();
    let mut rest = text.trim_start();
    while !rest.is_empty() {
        if let Some(after) = rest.strip_prefix("none") {
            found.push(None);
            rest = after.trim_start();
            continue;
        }
        let (inside, after) = rest
            .strip_prefix('(')
            .and_then(|r| r.split_once(')'))
            .ok_or_else(|| Error::field(path, name, format!("`{text}` is no list of vectors `(x,y,z)`")))?;
        let numbers = inside
            .split(',')
            .map(|word| word.trim().parse::<f64>().ok().filter(|v| v.is_finite()))
            .collect::<Option<Vec<f64>>>()
            .ok_or_else(|| {
                Error::field(path, name, format!("`({inside})` is no vector of finite numbers"))
            })?;
        found.push(Some(numbers));
        rest = after.trim_start();
    }
    Ok(found)
}
