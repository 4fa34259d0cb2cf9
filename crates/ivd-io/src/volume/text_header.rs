//! Headers of text: lines of fields, each with a name and a value.

use std::collections::BTreeMap;
use std::fs::File;
use std::io::{BufRead, BufReader, Read, Take};
use std::path::Path;
use std::str::FromStr;

use crate::volume::{Error, bounded};

/// Most bytes that a header may take; real ones take a few hundred.
pub(crate) const MOST: u64 = 1 << 20;

/// The lines at the front of a file.
pub(crate) struct Lines<'p> {
    path: &'p Path,
    reader: BufReader<Take<File>>,
    /// Bytes of the lines so far, their ends included.
    pub(crate) length: u64,
}

impl<'p> Lines<'p> {
    pub(crate) fn open(path: &'p Path) -> Result<Self, Error> {
        let (file, _) = bounded::open(path)?;
        Ok(Self { path, reader: BufReader::new(file.take(MOST)), length: 0 })
    }

    /// The next line without its end; `None` at the end of the file, or where a header would have to end. Bytes that aren't
    /// UTF-8 are replaced: no field needs them.
    pub(crate) fn read(&mut self) -> Result<Option<String>, Error> {
        let mut bytes = Vec::new();
        let got = self.reader.read_until(b'\n', &mut bytes).map_err(|e| Error::io(self.path, "read", e))?;
        self.length += got as u64;
        let text = String::from_utf8_lossy(&bytes);
        Ok((got > 0).then(|| text.trim_end_matches(['\n', '\r']).to_owned()))
    }
}

/// A header that was read.
#[derive(Debug)]
pub(crate) struct Header {
    pub(crate) fields: Fields,
    /// Bytes of the header: up to the data that may follow.
    pub(crate) length: u64,
}

/// The fields of a header as text, by their names.
#[derive(Debug)]
pub(crate) struct Fields {
    /// What the format makes of a name: where it gives the same, the field is the same.
    key: fn(&str) -> String,
    values: BTreeMap<String, String>,
}

impl Fields {
    pub(crate) fn new(key: fn(&str) -> String) -> Self {
        Self { key, values: BTreeMap::new() }
    }

    /// Takes a field in.
    ///
    /// # Errors
    /// [`Error::Field`] where it is there already.
    pub(crate) fn add(&mut self, path: &Path, name: &str, value: &str) -> Result<(), Error> {
        match self.values.insert((self.key)(name), value.trim().to_owned()) {
            Some(_) => Err(Error::field(path, name, "given twice")),
            None => Ok(()),
        }
    }

    /// A field's text.
    pub(crate) fn get(&self, name: &str) -> Option<&str> {
        self.values.get(&(self.key)(name)).map(String::as_str)
    }

    /// The text of a field that must be there.
    ///
    /// # Errors
    /// [`Error::Field`] where it is missing.
    pub(crate) fn need(&self, path: &Path, name: &str) -> Result<&str, Error> {
        self.get(name).ok_or_else(|| Error::field(path, name, "missing"))
    }

    /// Numbers separated by white space: exactly `count` of them; `None` where the field is missing.
    ///
    /// # Errors
    /// [`Error::Field`] names the word that is no number, or tells how many there are.
    pub(crate) fn numbers<T: FromStr>(
        &self,
        path: &Path,
        name: &str,
        count: usize,
    ) -> Result<Option<Vec<T>>, Error> {
        self.get(name).map(|text| numbers(path, name, text, count)).transpose()
    }
}

fn numbers<T: FromStr>(path: &Path, name: &str, text: &str, count: usize) -> Result<Vec<T>, Error> {
    let numbers = text
        .split_whitespace()
        .map(|word| {
            word.parse().map_err(|_| Error::field(path, name, format!("`{word}` is no number of its kind")))
        })
        .collect::<Result<Vec<T>, _>>()?;
    if numbers.len() != count {
        return Err(Error::field(path, name, format!("{} numbers where {count} are due", numbers.len())));
    }
    Ok(numbers)
}
