use std::cmp::Ordering;
use std::path::{Path, PathBuf};

use crate::volume::Error;

/// The regular files of a folder (hidden ones left out), in the order of [`compare`].
pub(crate) fn regular_files(dir: &Path) -> Result<Vec<PathBuf>, Error> {
    let mut files = Vec::new();
    for entry in std::fs::read_dir(dir).map_err(|e| Error::io(dir, "open", e))? {
        let entry = entry.map_err(|e| Error::io(dir, "list", e))?;
        let hidden = entry.file_name().as_encoded_bytes().starts_with(b".");
        if !hidden && entry.path().is_file() {
            files.push(entry.path());
        }
    }
    files.sort_by(|a, b| compare(&name(a), &name(b)));
    Ok(files)
}

/// Most folders below one that are looked into.
const MOST_FOLDERS: usize = 1000;

/// The folders right below one (hidden ones and links left out), in the order of [`compare`], as many as are looked into.
pub(crate) fn folders(dir: &Path) -> Result<Vec<PathBuf>, Error> {
    let mut folders = Vec::new();
    for entry in std::fs::read_dir(dir).map_err(|e| Error::io(dir, "open", e))? {
        let entry = entry.map_err(|e| Error::io(dir, "list", e))?;
        let hidden = entry.file_name().as_encoded_bytes().starts_with(b".");
        if !hidden && entry.file_type().is_ok_and(|kind| kind.is_dir()) {
            folders.push(entry.path());
        }
    }
    folders.sort_by(|a, b| compare(&name(a), &name(b)));
    folders.truncate(MOST_FOLDERS);
    Ok(folders)
}

fn name(path: &Path) -> Vec<u8> {
    path.file_name().unwrap_or_default().as_encoded_bytes().to_vec()
}

/// Byte order, but a run of digits counts by its value: `a2` before `a10`. Equal values (`02`, `2`) go by byte order.
pub(crate) fn compare(a: &[u8], b: &[u8]) -> Ordering {
    let (mut x, mut y) = (a, b);
    loop {
        match (x.first(), y.first()) {
            (Some(p), Some(q)) if p.is_ascii_digit() && q.is_ascii_digit() => {
                let (m, n) = (number(&mut x), number(&mut y));
                let order = m.len().cmp(&n.len()).then_with(|| m.cmp(n));
                if order != Ordering::Equal {
                    return order;
                }
            }
            (Some(p), Some(q)) if p == q => (x, y) = (&x[1..], &y[1..]),
            (p, q) => return p.cmp(&q).then_with(|| a.cmp(b)),
        }
    }
}

/// Takes the digits at the start of `text`; gives them without leading zeros.
fn number<'a>(text: &mut &'a [u8]) -> &'a [u8] {
    let end = text.iter().position(|c| !c.is_ascii_digit()).unwrap_or(text.len());
    let (digits, rest) = text.split_at(end);
    *text = rest;
    &digits[digits.iter().position(|&c| c != b'0').unwrap_or(digits.len())..]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_in_names_count_by_value() {
        let mut names = ["s10", "s2", "s02", "s1", "t1", "s", "s2b", "S3", "s99999999999999999999999"];
        names.sort_by(|a, b| compare(a.as_bytes(), b.as_bytes()));
        assert_eq!(names, ["S3", "s", "s1", "s02", "s2", "s2b", "s10", "s99999999999999999999999", "t1"]);
    }
}
