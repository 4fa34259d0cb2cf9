//! The log, written as it grows, so that what was done is there after a crash.
//!
//! Each window writes a file of its own and holds a lock on it. The system lets go of the lock of a process that ends, whatever the reason: a file that
//! can be locked was left over. One that is closed in order is removed.

use std::fs::{File, OpenOptions};
use std::io::{self, Write as _};
use std::path::{Path, PathBuf};

use ivd_frames::{Line, Log};
use ivd_pipeline::scene::InputFiles;

/// How the names of logs begin and end.
const NAME: (&str, &str) = ("log-", ".jsonl");
/// Files that are tried, at most.
const MOST: usize = 100;

/// A log that is written.
pub(crate) struct Journal {
    path: PathBuf,
    /// Held for its lock.
    file: File,
}

/// A log that was left over.
pub(crate) struct Left {
    path: PathBuf,
    /// What it is of: a scan or a scene.
    pub(crate) of: Option<PathBuf>,
    /// Where the files of its scene's input lie.
    pub(crate) files: InputFiles,
    /// Other values that the scene's keys were opened with, where that is known.
    pub(crate) with: Option<Vec<String>>,
    /// Steps in it.
    pub(crate) steps: usize,
    /// Held for its lock.
    _file: File,
}

impl Journal {
    /// Begins a log in a folder; gives what writes its lines.
    ///
    /// - `of`, `files`: told in its first line, so that the log is found by what it is of, and the files of its input are found.
    /// - `with`: other values that the scene's keys were opened with, so that it can be made again.
    ///
    /// # Errors
    /// What the system says.
    pub(crate) fn begin(
        folder: &Path,
        of: Option<&Path>,
        files: InputFiles,
        mut with: Option<Vec<String>>,
    ) -> io::Result<(Self, Line)> {
        std::fs::create_dir_all(folder)?;
        let (path, file) = fresh(folder)?;
        file.try_lock().map_err(io::Error::from)?;
        let mut writer = file.try_clone()?;
        let of = of.map(Path::to_owned);
        let mut is_first = true;
        let line = move |line: &str| {
            let head =
                std::mem::take(&mut is_first).then(|| Log::told_of(line, of.as_deref(), &files, with.take()));
            let line = head.as_deref().unwrap_or(line);
            // A disk that is full doesn't end a session; what is kept by hand says so.
            let _ = writer.write_all(format!("{line}\n").as_bytes());
        };
        Ok((Self { path, file }, Box::new(line)))
    }

    /// Leaves it to what goes on from it.
    pub(crate) fn leave(self, of: Option<PathBuf>, files: InputFiles, steps: usize) -> Left {
        Left { path: self.path, of, files, with: None, steps, _file: self.file }
    }

    /// Removes it: nothing is lost any more.
    pub(crate) fn close(self) {
        let _ = std::fs::remove_file(&self.path);
    }
}

/// A new file of the folder.
fn fresh(folder: &Path) -> io::Result<(PathBuf, File)> {
    for number in 0..MOST {
        let path = folder.join(format!("{}{number}{}", NAME.0, NAME.1));
        match OpenOptions::new().append(true).create_new(true).open(&path) {
            Ok(file) => return Ok((path, file)),
            Err(error) if error.kind() == io::ErrorKind::AlreadyExists => {}
            Err(error) => return Err(error),
        }
    }
    Err(io::Error::other(format!("{MOST} logs lie in {} already", folder.display())))
}

/// The logs that were left over in a folder, those with steps alone; the others are removed.
pub(crate) fn left_over(folder: &Path) -> Vec<Left> {
    let entries = std::fs::read_dir(folder).into_iter().flatten().flatten();
    let logs = entries.map(|entry| entry.path()).filter(|path| {
        let name = path.file_name().unwrap_or_default().to_string_lossy();
        name.starts_with(NAME.0) && name.ends_with(NAME.1)
    });
    logs.filter_map(|path| {
        let file = File::open(&path).ok()?;
        file.try_lock().ok()?;
        match Log::read(&path) {
            Ok(log) if !log.entries.is_empty() => {
                let Log { of, files, with, entries, .. } = log;
                Some(Left { path, of, files, with, steps: entries.len(), _file: file })
            }
            _ => {
                let _ = std::fs::remove_file(&path);
                None
            }
        }
    })
    .collect()
}

impl Left {
    /// The file.
    pub(crate) fn path(&self) -> &Path {
        &self.path
    }

    /// Removes it.
    pub(crate) fn remove(self) {
        let _ = std::fs::remove_file(&self.path);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_a_crash_leaves_is_found_and_what_is_closed_is_gone() {
        let folder = tempfile::tempdir().unwrap();
        let of = Path::new("/scans/a.nii");
        let files = InputFiles { file: Some(of.to_owned()), ..InputFiles::default() };
        let (journal, mut line) =
            Journal::begin(folder.path(), Some(of), files.clone(), Some(vec!["lattice.iso=3".to_owned()]))
                .unwrap();
        line(&Log::head("schema = 1"));
        line("\"undo\"");
        assert!(left_over(folder.path()).is_empty(), "another window still writes it");
        // As where the process ends.
        drop((journal, line));
        let left = left_over(folder.path());
        let found: Vec<_> = left
            .iter()
            .map(|left| (left.of.as_deref(), &left.files, left.with.as_deref(), left.steps))
            .collect();
        assert_eq!(found, [(Some(of), &files, Some(&["lattice.iso=3".to_owned()][..]), 1)]);
        left.into_iter().for_each(Left::remove);

        let (journal, mut line) = Journal::begin(folder.path(), None, InputFiles::default(), None).unwrap();
        line(&Log::head("schema = 1"));
        drop(line);
        journal.close();
        assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 0);
    }
}
