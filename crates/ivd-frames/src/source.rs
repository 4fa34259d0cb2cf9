//! What a window is told to open.

use std::fs::File;
use std::io::Read as _;
use std::path::{Path, PathBuf};

use ivd_pipeline::scene::{self, InputFiles, Loaded, Override};
use ivd_session::Entry;

use crate::{Error, Log, bare_scene};

/// The scene of `ivd demo`.
const DEMO: &str = include_str!("../../../fixtures/scenes/bust.toml");

/// What to open, as it was told.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Source {
    /// A scan, a scene (.toml) or a log that was kept (.jsonl); `None` for the generated head of `ivd demo`.
    pub file: Option<PathBuf>,
    /// A scan in the place of the scene's.
    pub input: Option<PathBuf>,
    /// Labels of it that another program made, in the place of the scene's.
    pub labels: Option<PathBuf>,
    /// Other values of the scene's keys.
    pub overrides: Vec<Override>,
}

/// What was read of it.
#[derive(Debug, Clone)]
pub struct Opened {
    /// The scene.
    pub loaded: Loaded,
    /// Whether the scene is that of a bare scan.
    pub is_bare: bool,
    /// What was done to it, to be done again.
    pub entries: Vec<Entry>,
}

/// The scene of the demo.
///
/// # Errors
/// An override that doesn't fit.
pub fn demo_scene(overrides: &[Override]) -> Result<Loaded, Error> {
    in_memory(DEMO, "demo.toml".into(), overrides)
}

impl Source {
    /// Reads the scene, not yet what it works on.
    ///
    /// # Errors
    /// A file that can't be read, or isn't what its name says.
    pub fn read(&self) -> Result<Opened, Error> {
        let ends =
            |file: &Path, ending: &str| file.extension().is_some_and(|e| e.eq_ignore_ascii_case(ending));
        let (mut loaded, is_bare, entries) = match &self.file {
            None => (demo_scene(&self.overrides)?, false, Vec::new()),
            Some(file) if ends(file, "toml") => (scene::load(file, &self.overrides)?, false, Vec::new()),
            Some(file) if ends(file, "jsonl") => {
                let log = Log::read(file)?;
                let mut loaded = in_memory(&log.scene, file.clone(), &self.overrides)?;
                if !log.files.is_empty() {
                    loaded.scene.set_input_files(log.files);
                }
                (loaded, false, log.entries)
            }
            Some(file) if is_scene(file) => (scene::load(file, &self.overrides)?, false, Vec::new()),
            Some(file) => (bare_scene(file, &self.overrides)?, true, Vec::new()),
        };
        // From here on they lie where they lie, not beside the scene.
        if let Some(input) = &self.input {
            let file = Some(absolute(input, "the scan")?);
            let files = loaded.scene.input_files();
            loaded.scene.set_input_files(InputFiles { file, ..files });
        }
        if let Some(labels) = &self.labels {
            loaded.scene.set_labels(absolute(labels, "the labels")?)?;
        }
        Ok(Opened { loaded, is_bare, entries })
    }
}

/// Where a file lies.
fn absolute(file: &Path, what: &'static str) -> Result<PathBuf, Error> {
    let problem = |error: std::io::Error| format!("{}: {error}", file.display());
    std::path::absolute(file).map_err(|error| Error::Io { what, problem: problem(error) })
}

/// Whether a file of any name is a scene by its text: it says its schema before any section.
fn is_scene(file: &Path) -> bool {
    if !file.is_file() {
        return false;
    }
    let mut head = Vec::new();
    let read = File::open(file).and_then(|file| file.take(4096).read_to_end(&mut head));
    // A character that is cut in two at its end makes no difference.
    let text = String::from_utf8_lossy(&head);
    let lines = text
        .trim_start_matches('\u{feff}')
        .lines()
        .map(str::trim)
        .filter(|line| !line.is_empty() && !line.starts_with('#'));
    let mut before_sections = lines.take_while(|line| !line.starts_with('['));
    read.is_ok()
        && before_sections
            .any(|line| line.split('=').next().is_some_and(|key| key.trim().trim_matches('"') == "schema"))
}

/// A scene that lies in no file, or in another's.
fn in_memory(text: &str, file: PathBuf, overrides: &[Override]) -> Result<Loaded, Error> {
    let folder = file.parent().map_or_else(PathBuf::new, Path::to_owned);
    let scene = scene::parse(text, overrides)
        .map_err(|problem| ivd_pipeline::Error::Scene { file: file.clone(), problem })?;
    Ok(Loaded { scene, folder, file })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_demo_scene_is_right() {
        let scene = demo_scene(&[]).unwrap().scene;
        assert!(scene.output.report && scene.asked().is_some());
    }

    #[test]
    fn what_is_to_be_opened_is_told_by_its_name() {
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join("a.NII");
        let scan = Source { file: Some(file.clone()), ..Source::default() }.read().unwrap();
        assert!(scan.is_bare && scan.loaded.folder == folder.path());
        let log = folder.path().join("kept.jsonl");
        std::fs::write(&log, format!("{}\n\"undo\"\n", crate::Log::head(DEMO))).unwrap();
        let log = Source { file: Some(log), input: Some(file.clone()), ..Source::default() }.read().unwrap();
        assert!(!log.is_bare && log.entries.len() == 1);
        assert_eq!((log.loaded.scene.input.file, log.loaded.scene.input.phantom), (Some(file), None));
        // A scene of another name is told by its text.
        for (text, is_scene) in [(DEMO, true), ("[input]\nschema = 1\n", false), ("schematic = 1\n", false)] {
            let kept = folder.path().join("kept");
            std::fs::write(&kept, text).unwrap();
            let read = Source { file: Some(kept), ..Source::default() }.read();
            assert_eq!(read.is_ok_and(|read| !read.is_bare), is_scene, "{text:?}");
        }
    }
}
