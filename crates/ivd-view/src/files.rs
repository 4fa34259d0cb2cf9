//! Files that are kept: written where the person said, as whole files or not at all.

use std::io::Write as _;
use std::path::{Component, Path, PathBuf};
use std::sync::{Mutex, PoisonError};

use ivd_frames::{File, Saved};

/// What is kept in a file.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Keeps {
    /// What the service makes.
    Asked(Saved),
    /// A picture of the window.
    Window,
    /// What was recorded.
    Recording,
}

impl Keeps {
    /// How it is called.
    pub(crate) fn word(self) -> &'static str {
        match self {
            Self::Asked(what) => what.word(),
            Self::Window => "a picture of the window",
            Self::Recording => "the recording",
        }
    }

    /// What its file may be called.
    pub(crate) fn name(self) -> &'static str {
        match self {
            Self::Asked(what) => what.name(),
            Self::Window => "window.png",
            Self::Recording => "recording.gif",
        }
    }

    /// A path with the ending of what it is: by that it is known again. A recording may have another that is given.
    pub(crate) fn with_ending(self, path: PathBuf) -> PathBuf {
        let (Some(name), Some((_, ending))) = (path.file_name(), self.name().split_once('.')) else {
            return path;
        };
        let lower = name.to_string_lossy().to_lowercase();
        let other = self == Self::Recording && path.extension().is_some();
        if other || lower.ends_with(&format!(".{ending}")) {
            return path;
        }
        // Of `.nii.gz` the first half may be there.
        let (first, rest) = ending.split_once('.').unwrap_or(("", ending));
        let rest = if !first.is_empty() && lower.ends_with(&format!(".{first}")) { rest } else { ending };
        let mut name = name.to_owned();
        name.push(format!(".{rest}"));
        path.with_file_name(name)
    }
}

/// Where what was asked for is to be written.
#[derive(Default)]
pub(crate) struct Keeping(Mutex<Vec<(Saved, PathBuf)>>);

impl Keeping {
    /// Something is asked for, to be written there.
    pub(crate) fn expect(&self, what: Saved, path: PathBuf) {
        self.0.lock().unwrap_or_else(PoisonError::into_inner).push((what, path));
    }

    /// Writes what came; says where it lies, or why it doesn't.
    pub(crate) fn write(&self, file: &File) -> Result<String, String> {
        let mut expected = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        let place = expected.iter().position(|(what, _)| *what == file.what);
        let (_, path) = place.map(|at| expected.remove(at)).ok_or("nobody asked for it")?;
        drop(expected);
        let named = file.clone().naming(|scan| beside(scan, &path)).map_err(|error| error.to_string())?;
        write(&path, &named.bytes)?;
        Ok(path.display().to_string())
    }

    /// Nothing is expected any more of a kind that was refused.
    pub(crate) fn forget(&self) {
        self.0.lock().unwrap_or_else(PoisonError::into_inner).clear();
    }
}

/// How a scene in the place of a file names a scan: by its way from there.
fn beside(scan: &Path, file: &Path) -> PathBuf {
    let folder = std::path::absolute(ivd_fs::folder_of(file)).unwrap_or_default();
    let same = scan.components().zip(folder.components()).take_while(|(a, b)| a == b).count();
    if same == 0 {
        // On another drive; its name alone. Of a scan --input says where it lies, and what else there is is put beside the scene.
        return PathBuf::from(scan.file_name().unwrap_or_default());
    }
    let up = folder.components().skip(same).map(|_| Component::ParentDir);
    up.chain(scan.components().skip(same)).collect()
}

pub(crate) fn write(path: &Path, bytes: &[u8]) -> Result<(), String> {
    let failed = |tried: &'static str, error: std::io::Error| {
        format!("{}: {tried}: {error}; choose another place", path.display())
    };
    ivd_fs::replace(path, failed, |sink| sink.write_all(bytes).map_err(|error| failed("write", error)))?;
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_scene_names_its_scan_from_where_it_is_written() {
        let told = |file: &str| beside(Path::new("/a/b/c.nii"), Path::new(file));
        assert_eq!(told("/a/scene.toml"), Path::new("b/c.nii"));
        assert_eq!(told("/a/b/scene.toml"), Path::new("c.nii"));
        assert_eq!(told("/elsewhere/x/scene.toml"), Path::new("../../a/b/c.nii"));
    }

    #[test]
    fn what_is_kept_has_the_ending_of_what_it_is() {
        let ended = |what: Keeps, name: &str| what.with_ending(Path::new("/a.b").join(name));
        for (what, name, expected) in [
            (Keeps::Asked(Saved::Scene), "head", "head.toml"),
            (Keeps::Asked(Saved::Scene), "head.v2", "head.v2.toml"),
            (Keeps::Asked(Saved::Scene), "head.TOML", "head.TOML"),
            (Keeps::Asked(Saved::Volume), "head", "head.nii.gz"),
            (Keeps::Asked(Saved::Volume), "head.nii", "head.nii.gz"),
            (Keeps::Asked(Saved::Volume), "head.nii.gz", "head.nii.gz"),
            (Keeps::Asked(Saved::Log), "head", "head.jsonl"),
            (Keeps::Window, "seen", "seen.png"),
            (Keeps::Recording, "drag", "drag.gif"),
            (Keeps::Recording, "drag.apng", "drag.apng"),
        ] {
            assert_eq!(ended(what, name), Path::new("/a.b").join(expected));
        }
    }
}
