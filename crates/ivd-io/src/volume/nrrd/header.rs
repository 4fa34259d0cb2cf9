use std::collections::BTreeMap;
use std::fs::File;
use std::io::{BufRead, BufReader, Read};
use std::path::Path;

use crate::volume::numbers::numbers;
use crate::volume::{Error, bounded};

/// Most bytes that a header may take; real ones take a few hundred.
const MOST: u64 = 1 << 20;

/// The fields of a header as text, by their names in lower case without spaces (`datafile`, `space directions` and
/// `spacedirections` are one field to every reader).
#[derive(Debug)]
pub(super) struct Header {
    fields: BTreeMap<String, String>,
    /// Bytes of the header, the empty line at its end included.
    pub(super) length: u64,
}

impl Header {
    /// Reads the lines up to the empty one, or the end of a detached header.
    pub(super) fn read(path: &Path) -> Result<Self, Error> {
        let (file, _) = bounded::open(path)?;
        let mut reader = BufReader::new(file.take(MOST));
        let magic = line(&mut reader, path)?.unwrap_or_default();
        if !magic.1.starts_with("NRRD000") {
            return Err(Error::field(path, "magic", "the first line is not `NRRD000…`"));
        }
        let mut header = Self { fields: BTreeMap::new(), length: magic.0 };
        while let Some((bytes, text)) = line(&mut reader, path)? {
            header.length += bytes;
            if text.is_empty() {
                return Ok(header);
            }
            header.add(path, &text)?;
        }
        if header.length >= MOST {
            return Err(Error::field(path, "header", format!("no empty line within {MOST} bytes")));
        }
        Ok(header)
    }

    fn add(&mut self, path: &Path, text: &str) -> Result<(), Error> {
        // `key:=value` pairs are the writer's own; `#` opens a comment.
        if text.starts_with('#') || text.find(":=").is_some_and(|at| text.find(": ").is_none_or(|f| at < f)) {
            return Ok(());
        }
        let Some((name, value)) = text.split_once(':') else {
            let shown: String = text.chars().take(40).collect();
            return Err(Error::field(path, "header", format!("the line `{shown}` is no `field: value`")));
        };
        let key: String = name.chars().filter(|c| !c.is_whitespace()).collect::<String>().to_lowercase();
        if self.fields.insert(key, value.trim().to_owned()).is_some() {
            return Err(Error::field(path, name, "given twice"));
        }
        Ok(())
    }

    /// A field's text; `name` as the format writes it.
    pub(super) fn get(&self, name: &str) -> Option<&str> {
        self.fields.get(&name.replace(' ', "")).map(String::as_str)
    }

    pub(super) fn need(&self, path: &Path, name: &str) -> Result<&str, Error> {
        self.get(name).ok_or_else(|| Error::field(path, name, "missing"))
    }

    /// Numbers separated by white space: exactly `count` of them.
    pub(super) fn numbers<T: std::str::FromStr>(
        &self,
        path: &Path,
        name: &str,
        count: usize,
    ) -> Result<Option<Vec<T>>, Error> {
        self.get(name).map(|text| numbers(path, name, text, count)).transpose()
    }
}

/// A line without its end, and its length with it. Bytes that aren't UTF-8 are replaced: no field needs them.
fn line(reader: &mut BufReader<std::io::Take<File>>, path: &Path) -> Result<Option<(u64, String)>, Error> {
    let mut bytes = Vec::new();
    let got = reader.read_until(b'\n', &mut bytes).map_err(|e| Error::io(path, "read", e))?;
    let text = String::from_utf8_lossy(&bytes);
    Ok((got > 0).then(|| (got as u64, text.trim_end_matches(['\n', '\r']).to_owned())))
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
