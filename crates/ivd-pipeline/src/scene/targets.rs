//! Outputs that would take the place of one another.

use std::path::{Component, PathBuf};

use super::sections::{OF_FRAMES, OutputSection};
use crate::frame_file;
use crate::pictures::is_animation;

/// An output: its key, and its place below the folder as it is named.
pub(crate) struct Target {
    pub(crate) key: String,
    pub(crate) path: PathBuf,
    /// Name of its file, or of the first where there is one for every frame.
    pub(crate) name: String,
    of_frames: bool,
}

/// All outputs that a scene names.
pub(crate) fn targets(output: &OutputSection) -> Vec<Target> {
    let of_frames = output.files().into_iter().filter(|(key, _)| OF_FRAMES.contains(key));
    // An animation is one file.
    let of_frames = of_frames.map(|(key, path)| (key.to_owned(), path.to_owned(), !is_animation(path)));
    let whole = output.named().into_iter().map(|(key, path)| (key, path, false));
    let target = |(key, path, of_frames): (String, PathBuf, bool)| {
        let path: PathBuf = path.components().filter(|part| *part != Component::CurDir).collect();
        let first = if of_frames { frame_file(&path, 0) } else { path.clone() };
        let name = first.file_name().unwrap_or_default().to_string_lossy().into_owned();
        Target { key, path, name, of_frames }
    };
    whole.chain(of_frames).map(target).collect()
}

impl Target {
    /// Whether it is written to a file of that name: its own, the values beside a header, or those of a frame.
    pub(crate) fn is_written_to(&self, name: &str) -> bool {
        let is_own = |name: &str| if self.of_frames { is_frame(&self.name, name) } else { name == self.name };
        is_own(name) || name.strip_suffix(".raw").is_some_and(is_own)
    }
}

/// Whether a name is that of a frame of a series, whose first is given.
fn is_frame(first: &str, name: &str) -> bool {
    let Some((before, after)) = first.rsplit_once("_0000") else { return false };
    let number = name.strip_prefix(before).and_then(|name| name.strip_prefix('_')?.strip_suffix(after));
    number.is_some_and(|number| number.len() >= 4 && number.bytes().all(|digit| digit.is_ascii_digit()))
}

/// Refuses outputs that would be written to one file.
pub(super) fn check_outputs(output: &OutputSection) -> Result<(), String> {
    let targets = targets(output);
    for (at, one) in targets.iter().enumerate() {
        let is_same = |other: &&Target| {
            one.path.parent() == other.path.parent()
                && (one.is_written_to(&other.name) || other.is_written_to(&one.name))
        };
        if let Some(other) = targets[..at].iter().find(is_same) {
            return Err(format!(
                "output.{} and output.{} would both write {}; name two files",
                other.key,
                one.key,
                one.path.display()
            ));
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    fn told(output: &str) -> Result<(), String> {
        let text = format!(
            "schema = 1\n[input]\nfile = \"a.nii\"\n[deform]\nsolver = \"projective\"\nframes = 2\n[[deform.handle]]\npick = [0.0, 1.0, 2.0]\n\
             move = [0.0, 3.0, 0.0]\nradius = 20.0\n[output]\n{output}\n"
        );
        crate::scene::parse(&text, &[]).map(|_| ())
    }

    #[test]
    fn outputs_that_would_be_one_file_are_refused() {
        for bad in [
            "labels = \"x.nrrd\"\nmask = \"x.nrrd\"",
            "labels = \"./x.nrrd\"\nmask = \"x.nrrd\"",
            "volume = \"k.mhd\"\nmask = \"k.mhd.raw\"",
            "volume_series = \"m.nrrd\"\nlabels = \"m_0001.nrrd\"",
            "volume_series = \"m.nhdr\"\nlabels = \"m_0011.nhdr.raw\"",
            "images = [\"before\"]\npicture_series = \"before.png\"\nvolume = \"x.nii\"\nmask = \"./x.nii\"",
        ] {
            let problem = told(bad).expect_err(bad);
            assert!(problem.contains("name two files"), "{bad}: {problem}");
        }
        for good in [
            "labels = \"a/x.nrrd\"\nmask = \"x.nrrd\"",
            "volume_series = \"m.nrrd\"\nlabels = \"m.nrrd\"\nmask = \"m_01.nrrd\"",
            "volume = \"k.mhd\"\nmask = \"k.nrrd\"",
        ] {
            assert_eq!(told(good), Ok(()), "{good}");
        }
    }
}
