use std::path::{Path, PathBuf};

use ivd_core::Exec;

/// The slices of a folder in their order, and the files that are none.
#[derive(Debug)]
pub(super) struct Slices<K> {
    pub(super) kind: K,
    pub(super) files: Vec<PathBuf>,
    pub(super) foreign: Vec<PathBuf>,
}

/// Says which files of a folder are none of its slices.
pub(super) fn note_foreign(dir: &Path, foreign: &[PathBuf], exec: &Exec) {
    if let [first, rest @ ..] = foreign {
        let name = first.file_name().unwrap_or_default().to_string_lossy();
        let more = if rest.is_empty() { String::new() } else { format!(" and {} more", rest.len()) };
        exec.observer().note(&format!("{}: passed over {name}{more}: no slice", dir.display()));
    }
}
