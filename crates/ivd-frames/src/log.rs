//! A log as a file of lines: first the scene that it began with, then what was done, a line each.

use std::io::{self, Read as _, Seek as _, SeekFrom, Write as _};
use std::path::{Path, PathBuf};
use std::str::FromStr;

use ivd_pipeline::scene::InputFiles;
use ivd_session::Entry;
use serde::{Deserialize, Serialize};
use tempfile::SpooledTempFile;

use crate::Error;

/// No log is longer (bytes): a line takes some hundreds.
const LONGEST: u64 = 64 << 20;

/// So much of a log that is written lies in memory (bytes); the rest lies in a file without a name.
const IN_MEMORY: usize = 64 << 10;

/// A log that is written.
pub(crate) struct Lines {
    file: SpooledTempFile,
    /// What kept a line from being written.
    failed: Option<io::Error>,
}

impl Lines {
    pub(crate) fn new() -> Self {
        Self { file: SpooledTempFile::new(IN_MEMORY), failed: None }
    }

    /// Adds a line. A disk that is full doesn't end a session: whoever wants the log is told.
    pub(crate) fn push(&mut self, line: &str) {
        if self.failed.is_none() {
            self.failed = self.file.write_all(format!("{line}\n").as_bytes()).err();
        }
    }

    /// All lines so far.
    ///
    /// # Errors
    /// Lines that couldn't be written, or can't be read again.
    pub(crate) fn text(&mut self) -> Result<String, Error> {
        let wrong = |problem: String| Error::Io { what: "the log", problem };
        if let Some(error) = &self.failed {
            return Err(wrong(format!("not all of it could be written: {error}")));
        }
        let read = self.read();
        // What is written next comes behind it, whatever was read.
        self.failed = self.file.seek(SeekFrom::End(0)).err();
        read.map_err(|error| wrong(format!("it can't be read again: {error}")))
    }

    fn read(&mut self) -> io::Result<String> {
        let mut text = String::new();
        self.file.rewind()?;
        self.file.read_to_string(&mut text)?;
        Ok(text)
    }
}

/// A log that was kept.
#[derive(Debug, Clone, PartialEq)]
pub struct Log {
    /// The scene that it began with, as TOML.
    pub scene: String,
    /// What it is of, where it says so: a scan or a scene.
    pub of: Option<PathBuf>,
    /// Where the files of its input lie, where it says so.
    pub files: InputFiles,
    /// Other values that the scene's keys were opened with, where it says so, as they are typed.
    pub with: Option<Vec<String>>,
    /// What was done, the first first.
    pub entries: Vec<Entry>,
}

/// The first line.
#[derive(Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct Head {
    begins: Beginning,
}

#[derive(Debug, Default, Serialize, Deserialize)]
struct Beginning {
    scene: String,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    of: Option<PathBuf>,
    /// As earlier versions wrote it.
    #[serde(default, skip_serializing)]
    scan: Option<PathBuf>,
    #[serde(default, skip_serializing_if = "InputFiles::is_empty")]
    files: InputFiles,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    with: Option<Vec<String>>,
}

impl Log {
    /// The first line of a log, without its end.
    pub fn head(scene: &str) -> String {
        let begins = Beginning { scene: scene.to_owned(), ..Beginning::default() };
        serde_json::to_string(&Head { begins }).unwrap_or_default()
    }

    /// A first line that says what the log is of.
    ///
    /// - `files`: where those of its input lie.
    /// - `with`: other values that the scene's keys were opened with, as they are typed; `None` where that isn't known.
    pub fn told_of(head: &str, of: Option<&Path>, files: &InputFiles, with: Option<Vec<String>>) -> String {
        let Ok(Head { begins: Beginning { scene, .. } }) = serde_json::from_str(head) else {
            return head.to_owned();
        };
        let (of, files) = (of.map(Path::to_owned), files.clone());
        let begins = Beginning { scene, of, files, with, ..Beginning::default() };
        serde_json::to_string(&Head { begins }).unwrap_or_default()
    }

    /// Reads a log. A last line without an end is one that was never written whole, and is left out.
    ///
    /// # Errors
    /// A file that can't be read, or is no log; says which line.
    pub fn read(file: &Path) -> Result<Self, Error> {
        let wrong = |problem: String| Error::Io {
            what: "the log",
            problem: format!("{}: {problem}", file.display()),
        };
        let mut text = String::new();
        let opened = std::fs::File::open(file).map_err(|error| wrong(error.to_string()))?;
        let read = opened.take(LONGEST + 1).read_to_string(&mut text);
        if read.map_err(|error| wrong(error.to_string()))? as u64 > LONGEST {
            return Err(wrong(format!("longer than {LONGEST} bytes; a log is a short text")));
        }
        text.parse().map_err(wrong)
    }

    /// The scene that a first line tells.
    pub(crate) fn scene_of(head: &str) -> Result<String, String> {
        Ok(begun(head)?.scene)
    }
}

impl FromStr for Log {
    type Err = String;

    /// Reads the text of a log; what is wrong with it says which line.
    fn from_str(text: &str) -> Result<Self, String> {
        let mut lines = (1..).zip(text.split_inclusive('\n'));
        let (_, first) = lines.next().ok_or("it is empty")?;
        let Beginning { scene, of, scan, mut files, with } = begun(first)?;
        files.file = files.file.or(scan);
        let mut entries = Vec::new();
        for (number, line) in lines {
            match serde_json::from_str(line) {
                Ok(entry) => entries.push(entry),
                Err(_) if !line.ends_with('\n') => {}
                Err(error) => return Err(format!("line {number}: {error}")),
            }
        }
        Ok(Self { scene, of, files, with, entries })
    }
}

/// What a first line says.
fn begun(head: &str) -> Result<Beginning, String> {
    let begins: Result<Head, _> = serde_json::from_str(head);
    begins.map(|begins| begins.begins).map_err(|error| {
        format!("line 1 doesn't say what scene it began with ({error}); take one that `ivd view` or `ivd serve` kept")
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_written_is_read_again_and_goes_on() {
        let (mut lines, mut all) = (Lines::new(), String::new());
        for number in 0..20_000 {
            let line = format!("line {number}");
            lines.push(&line);
            all += &(line + "\n");
            if number % 4_999 == 1 {
                assert_eq!(lines.text().unwrap(), all);
            }
        }
        assert_eq!((lines.text().unwrap(), lines.file.is_rolled()), (all, true));
        lines.failed = Some(io::ErrorKind::StorageFull.into());
        lines.push("lost");
        for _ in 0..2 {
            assert!(lines.text().is_err(), "a log with a line that is lost isn't given as whole");
        }
    }

    #[test]
    fn what_was_not_written_whole_is_left_out() {
        let head = Log::head("schema = 1");
        let log = format!("{head}\n\"undo\"\n{{\"step\":{{\"na").parse::<Log>().unwrap();
        assert_eq!(
            log,
            Log {
                scene: "schema = 1".into(),
                of: None,
                files: InputFiles::default(),
                with: None,
                entries: vec![Entry::Undo]
            }
        );
        // As earlier versions wrote it.
        let older = r#"{"begins":{"scene":"schema = 1","of":"/a.toml","scan":"/a.nii"}}"#;
        let older: Log = format!("{older}\n").parse().unwrap();
        assert_eq!(older.files, InputFiles { file: Some("/a.nii".into()), ..InputFiles::default() });
        assert!(format!("{head}\nundo\n\"redo\"\n").parse::<Log>().unwrap_err().starts_with("line 2: "));
        assert!("\"undo\"\n".parse::<Log>().unwrap_err().contains("line 1"));
    }
}
