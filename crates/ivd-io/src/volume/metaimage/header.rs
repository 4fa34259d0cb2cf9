use std::path::Path;

use crate::volume::Error;
use crate::volume::text_header::{Fields, Header, Lines};

/// Reads the lines up to `ElementDataFile`, which is the last. Upper and lower case of a name are the same.
pub(super) fn read(path: &Path) -> Result<Header, Error> {
    let mut lines = Lines::open(path)?;
    let mut fields = Fields::new(str::to_lowercase);
    while let Some(text) = lines.read()? {
        if text.trim().is_empty() {
            continue;
        }
        let Some((name, value)) = text.split_once('=') else {
            let shown: String = text.trim().chars().take(40).collect();
            return Err(Error::field(path, "header", format!("the line `{shown}` is no `field = value`")));
        };
        let name = name.trim();
        fields.add(path, name, value)?;
        if name.eq_ignore_ascii_case("ElementDataFile") {
            return Ok(Header { fields, length: lines.length });
        }
    }
    Err(Error::field(path, "ElementDataFile", "missing"))
}

/// `True` or `False`; MetaIO looks at the first letter alone, or at a 1.
pub(super) fn flag(header: &Header, path: &Path, name: &str) -> Result<Option<bool>, Error> {
    let Some(text) = header.fields.get(name) else { return Ok(None) };
    match text.as_bytes().first() {
        Some(b'T' | b't' | b'1') => Ok(Some(true)),
        Some(b'F' | b'f' | b'0') => Ok(Some(false)),
        _ => Err(Error::field(path, name, format!("`{text}` is neither True nor False"))),
    }
}

/// The first of several names for one thing that the header has.
pub(super) fn any<T: std::str::FromStr>(
    header: &Header,
    path: &Path,
    names: &[&str],
    count: usize,
) -> Result<Option<Vec<T>>, Error> {
    match names.iter().find(|name| header.fields.get(name).is_some()) {
        Some(name) => header.fields.numbers(path, name, count),
        None => Ok(None),
    }
}
