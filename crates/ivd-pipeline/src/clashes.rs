//! Outputs that would take the place of one another, or of what a scene reads.

use std::path::{Component, Path, PathBuf};

use crate::outputs::named;
use crate::pictures::is_animation;
use crate::plan::OF_FRAMES;
use crate::scene::{Loaded, Scene};
use crate::series::file_of;
use crate::{Error, ending};

/// Endings of slices, which a folder of them is read by.
const SLICES: [&str; 3] = ["png", "tif", "tiff"];

/// An output: its key, and its place below the folder as it is named.
struct Target {
    key: String,
    path: PathBuf,
    /// Name of its file, or of the first where there is one for every frame.
    name: String,
    of_frames: bool,
}

fn targets(scene: &Scene) -> Vec<Target> {
    let of_frames = scene.output.files().into_iter().filter(|(key, _)| OF_FRAMES.contains(key));
    // An animation is one file.
    let of_frames = of_frames.map(|(key, path)| (key.to_owned(), path.to_owned(), !is_animation(path)));
    let whole = named(scene).into_iter().map(|(key, path)| (key, path, false));
    let target = |(key, path, of_frames): (String, PathBuf, bool)| {
        let path: PathBuf = path.components().filter(|part| *part != Component::CurDir).collect();
        let first = if of_frames { file_of(&path, 0) } else { path.clone() };
        let name = first.file_name().unwrap_or_default().to_string_lossy().into_owned();
        Target { key, path, name, of_frames }
    };
    whole.chain(of_frames).map(target).collect()
}

impl Target {
    /// Whether it is written to a file of that name: its own, the values beside a header, or those of a frame.
    fn is_written_to(&self, name: &str) -> bool {
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
pub(crate) fn check_outputs(scene: &Scene) -> Result<(), String> {
    let targets = targets(scene);
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

/// Refuses an output that would take the place of one of the files that are read, or lie among slices that are.
///
/// - `input`: stands in for the scene's.
pub(crate) fn check_sources(
    loaded: &Loaded,
    input: Option<&Path>,
    out: &Path,
    sources: impl Iterator<Item = PathBuf>,
) -> Result<(), Error> {
    // Where a folder isn't there yet nothing is read from it.
    let in_folder = |target: Target| {
        let folder = out.join(target.path.parent().unwrap_or(Path::new("")));
        Some((folder.canonicalize().ok()?, target))
    };
    let targets: Vec<(PathBuf, Target)> = targets(&loaded.scene).into_iter().filter_map(in_folder).collect();
    let refuse = |target: &Target, what: String| {
        Err(Error::usage("pipeline", format!("output.{} = {} {what}", target.key, target.path.display())))
    };
    let file =
        input.map(Path::to_owned).or_else(|| Some(loaded.folder.join(loaded.scene.input.file.as_ref()?)));
    if let Some(slices) = file.filter(|file| file.is_dir()).and_then(|file| file.canonicalize().ok()) {
        let is_slice = |target: &Target| SLICES.contains(&&*ending(&target.path));
        if let Some((_, target)) =
            targets.iter().find(|(folder, target)| *folder == slices && is_slice(target))
        {
            return refuse(
                target,
                "would lie among the slices that the scene reads; choose another --out".to_owned(),
            );
        }
    }
    for source in sources.filter_map(|source| source.canonicalize().ok()) {
        let name = source.file_name().unwrap_or_default().to_string_lossy();
        let is_taken = |(folder, target): &&(PathBuf, Target)| {
            Some(&**folder) == source.parent() && target.is_written_to(&name)
        };
        let linked = |(folder, target): &&(PathBuf, Target)| {
            folder.join(&target.name).canonicalize().is_ok_and(|there| there == source)
        };
        if let Some((_, target)) = targets.iter().find(|target| is_taken(target) || linked(target)) {
            return refuse(
                target,
                format!(
                    "would take the place of {}, which the scene reads; name another file",
                    source.display()
                ),
            );
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
