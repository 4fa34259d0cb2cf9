use std::collections::BTreeMap;
use std::io::{BufRead, BufReader, Read};
use std::path::Path;

use crate::volume::numbers::numbers;
use crate::volume::{Error, bounded};

/// Most bytes that a header may take; real ones take a few hundred.
const MOST: u64 = 1 << 20;

/// The fields of a header as text, by their names in lower case.
#[derive(Debug)]
pub(super) struct Header {
    fields: BTreeMap<String, String>,
    /// Bytes up to the data that may follow.
    pub(super) length: u64,
}

impl Header {
    /// Reads the lines up to `ElementDataFile`, which is the last.
    pub(super) fn read(path: &Path) -> Result<Self, Error> {
        let (file, _) = bounded::open(path)?;
        let mut reader = BufReader::new(file.take(MOST));
        let mut header = Self { fields: BTreeMap::new(), length: 0 };
        loop {
            let mut bytes = Vec::new();
            let got = reader.read_until(b'\n', &mut bytes).map_err(|e| Error::io(path, "read", e))?;
            if got == 0 {
                return Err(Error::field(path, "ElementDataFile", "missing"));
            }
            header.length += got as u64;
            let text = String::from_utf8_lossy(&bytes);
            if text.trim().is_empty() {
                continue;
            }
            let Some((key, value)) = text.split_once('=') else {
                let shown: String = text.trim().chars().take(40).collect();
                return Err(Error::field(
                    path,
                    "header",
                    format!("the line `{shown}` is no `field = value`"),
                ));
            };
            let key = key.trim().to_lowercase();
            let last = key == "elementdatafile";
            if header.fields.insert(key, value.trim().to_owned()).is_some() {
                return Err(Error::field(
                    path,
                    text.split('=').next().unwrap_or_default().trim(),
                    "given twice",
                ));
            }
            if last {
                return Ok(header);
            }
        }
    }

    /// A field's text.
    pub(super) fn get(&self, name: &str) -> Option<&str> {
        self.fields.get(&name.to_lowercase()).map(String::as_str)
    }

    pub(super) fn need(&self, path: &Path, name: &str) -> Result<&str, Error> {
        self.get(name).ok_or_else(|| Error::field(path, name, "missing"))
    }

    /// `True` or `False`; MetaIO looks at the first letter alone, or at a 1.
    pub(super) fn flag(&self, path: &Path, name: &str) -> Result<Option<bool>, Error> {
        let Some(text) = self.get(name) else { return Ok(None) };
        match text.as_bytes().first() {
            Some(b'T' | b't' | b'1') => Ok(Some(true)),
            Some(b'F' | b'f' | b'0') => Ok(Some(false)),
            _ => Err(Error::field(path, name, format!("`{text}` is neither True nor False"))),
        }
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

    /// The first of several names for one thing that the header has.
    pub(super) fn any<T: std::str::FromStr>(
        &self,
        path: &Path,
        names: &[&str],
        count: usize,
    ) -> Result<Option<Vec<T>>, Error> {
        match names.iter().find(|name| self.get(name).is_some()) {
            Some(name) => self.numbers(path, name, count),
            None => Ok(None),
        }
    }
}
