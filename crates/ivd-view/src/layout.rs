//! How the window looked last, as a file of its own. What can't be read means the defaults.

use std::io::Write as _;
use std::path::{Path, PathBuf};

use ivd_frames::Pane;
use serde::{Deserialize, Serialize};

/// The file.
const NAME: &str = "layout.json";
/// A window isn't smaller or larger than this (points).
const SIDES: [f32; 2] = [320.0, 16_000.0];

/// How the window looks.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub(crate) struct Layout {
    /// Width and height (points).
    pub(crate) size: [f32; 2],
    /// Whether the side panel is shown.
    pub(crate) side: bool,
    /// Whether the surface is drawn over slices.
    pub(crate) outline: bool,
    /// The pane that is shown alone.
    pub(crate) alone: Option<Pane>,
    /// Folder that was read from last, ...
    pub(crate) folder: Option<PathBuf>,
    /// ... and the one that was written into.
    pub(crate) kept: Option<PathBuf>,
}

impl Default for Layout {
    fn default() -> Self {
        Self { size: [1200.0, 800.0], side: true, outline: true, alone: None, folder: None, kept: None }
    }
}

impl Layout {
    /// Reads it.
    pub(crate) fn read(folder: Option<&Path>) -> Self {
        let text = folder.and_then(|folder| std::fs::read_to_string(folder.join(NAME)).ok());
        let read: Option<Self> = text.and_then(|text| serde_json::from_str(&text).ok());
        read.filter(|layout| layout.size.iter().all(|side| (SIDES[0]..=SIDES[1]).contains(side)))
            .unwrap_or_default()
    }

    /// Writes it. A window whose looks can't be kept is none the worse.
    pub(crate) fn write(&self, folder: Option<&Path>) {
        let (Some(folder), Ok(text)) = (folder, serde_json::to_string(self)) else { return };
        let _ = std::fs::create_dir_all(folder);
        let write = |sink: &mut ivd_fs::Sink| sink.write_all(text.as_bytes());
        let _ = ivd_fs::replace(&folder.join(NAME), |_, error| error, write);
    }
}

/// The folder of what a person's windows keep: the system's usual place for the state of programs.
pub(crate) fn state_folder() -> Option<PathBuf> {
    let folder = |name: &str| std::env::var_os(name).filter(|v| !v.is_empty()).map(PathBuf::from);
    folder("XDG_STATE_HOME")
        .map(|folder| folder.join("ivd"))
        .or_else(|| folder("LOCALAPPDATA").map(|folder| folder.join("ivd").join("state")))
        .or_else(|| folder("HOME").map(|folder| folder.join(".local").join("state").join("ivd")))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_can_not_be_read_means_the_defaults() {
        let folder = tempfile::tempdir().unwrap();
        let there = Some(folder.path());
        let layout = Layout { side: false, outline: false, alone: Some(Pane::Axial), ..Layout::default() };
        layout.write(there);
        assert_eq!(Layout::read(there), layout);
        for bad in ["", "{\"size\":[1,1e9]}", "{\"side\":\"no\"}", "{\"other\":1}"] {
            std::fs::write(folder.path().join(NAME), bad).unwrap();
            assert_eq!(Layout::read(there), Layout::default(), "{bad}");
        }
    }
}
