//! Files of a folder and of those below it.

use std::path::{Path, PathBuf};

use super::looks_like_dicom;
use crate::volume::Error;

/// Folders inside folders that are looked into; archives nest patient, study and series.
const DEEPEST: usize = 8;
/// Most folders, …
const MOST_FOLDERS: usize = 10_000;
/// … and files below one that are looked at.
const MOST_FILES: usize = 100_000;

/// Regular files of a folder, and its folders, each in the order of their names. Links to folders aren't followed, hidden ones left out.
fn entries(dir: &Path) -> Result<[Vec<PathBuf>; 2], Error> {
    let (mut files, mut folders) = (Vec::new(), Vec::new());
    for entry in std::fs::read_dir(dir).map_err(|e| Error::io(dir, "open", e))? {
        let entry = entry.map_err(|e| Error::io(dir, "list", e))?;
        let path = entry.path();
        if entry.file_type().is_ok_and(|kind| kind.is_dir()) {
            if !entry.file_name().as_encoded_bytes().starts_with(b".") {
                folders.push(path);
            }
        } else if path.is_file() {
            files.push(path);
        }
    }
    files.sort();
    folders.sort();
    Ok([files, folders])
}

/// Regular files of a folder, in the order of their names.
pub(super) fn files(dir: &Path) -> Result<Vec<PathBuf>, Error> {
    let [files, _] = entries(dir)?;
    Ok(files)
}

/// The files of all folders below one, and of those below them, in the order of their paths.
pub(super) fn below(dir: &Path) -> Result<Vec<PathBuf>, Error> {
    let (mut found, mut seen) = (Vec::new(), 0);
    let [_, folders] = entries(dir)?;
    let mut open: Vec<(PathBuf, usize)> = folders.into_iter().map(|folder| (folder, 1)).collect();
    while let Some((folder, depth)) = open.pop() {
        seen += 1;
        // One that can't be read isn't the patient's only one.
        let Ok([files, folders]) = entries(&folder) else { continue };
        if seen + folders.len() > MOST_FOLDERS || found.len() + files.len() > MOST_FILES {
            let problem = format!(
                "it holds no image itself, and more than {MOST_FOLDERS} folders or {MOST_FILES} files lie below it"
            );
            return Err(Error::choice(dir, problem, "give a folder further in"));
        }
        found.extend(files);
        if depth < DEEPEST {
            open.extend(folders.into_iter().map(|folder| (folder, depth + 1)));
        }
    }
    found.sort();
    Ok(found)
}

/// Whether some file of a folder carries DICOM's mark.
pub(crate) fn holds_dicom(dir: &Path) -> Result<bool, Error> {
    Ok(files(dir)?.iter().any(|file| looks_like_dicom(file)))
}

/// Whether some file of the folders below one does.
pub(crate) fn holds_dicom_below(dir: &Path) -> Result<bool, Error> {
    Ok(below(dir)?.iter().any(|file| looks_like_dicom(file)))
}
