//! Outputs that would take the place of what a scene reads.

use std::path::{Path, PathBuf};

use crate::scene::{Loaded, Target, targets};
use crate::{Error, ending};

/// Endings of slices, which a folder of them is read by.
const SLICES: [&str; 3] = ["png", "tif", "tiff"];

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
    let targets: Vec<(PathBuf, Target)> =
        targets(&loaded.scene.output).into_iter().filter_map(in_folder).collect();
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
