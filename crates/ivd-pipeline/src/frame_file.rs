//! Names of the files of frames.

use std::ffi::OsStr;
use std::path::{Path, PathBuf};

use crate::ending;

/// The file of a frame, counted from 0 as `map.frame` counts: `name_0000.nii.gz` is that of the first.
pub fn frame_file(path: &Path, frame: usize) -> PathBuf {
    let number = format!("_{frame:04}");
    let (mut stem, mut endings) = (path.to_owned(), Vec::new());
    for _ in 0..if ending(path) == "nii.gz" { 2 } else { 1 } {
        let Some(last) = stem.extension().map(OsStr::to_owned) else { break };
        endings.push(last);
        stem.set_extension("");
    }
    // Names needn't be UTF-8.
    let mut name = stem.file_name().unwrap_or_default().to_owned();
    name.push(number);
    for ending in endings.iter().rev() {
        name.push(".");
        name.push(ending);
    }
    path.with_file_name(name)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn frames_are_numbered_before_the_ending() {
        let cases = [
            ("a/b.nii.gz", 0, "a/b_0000.nii.gz"),
            ("v.1.mha", 41, "v.1_0041.mha"),
            ("İ.NRRD", 7, "İ_0007.NRRD"),
            ("volumé", 3, "volumé_0003"),
        ];
        for (path, frame, file) in cases {
            assert_eq!(frame_file(Path::new(path), frame), Path::new(file));
        }
    }
}
