use std::path::Path;

use crate::volume::stored::FileType;
use crate::volume::{Error, Offer};

/// The frame to read of a file with `frames` of them; `field` is where the file says so.
pub(crate) fn choose(path: &Path, field: &str, frames: usize, chosen: Option<usize>) -> Result<usize, Error> {
    let remedy = || format!("choose one of 0 to {} with --frame, or input.frame of a scene", frames - 1);
    let offered = |problem| Error::choice(path, problem, remedy()).offering(Offer::Frames(frames));
    match chosen {
        Some(frame) if frame < frames => Ok(frame),
        Some(frame) => Err(offered(format!("there is no frame {frame}: {field} says {frames}"))),
        None if frames == 1 => Ok(0),
        None => Err(offered(format!("{frames} frames ({field})"))),
    }
}

/// Bytes before the chosen frame's first voxel.
pub(crate) fn skip(
    path: &Path,
    offset: u64,
    frame: usize,
    count: usize,
    file_type: FileType,
) -> Result<u64, Error> {
    (count as u64)
        .checked_mul(file_type.bytes() as u64)
        .and_then(|n| n.checked_mul(frame as u64))
        .and_then(|n| n.checked_add(offset))
        .ok_or_else(|| {
            Error::choice(path, format!("frame {frame} lies beyond any file"), "choose an earlier one")
        })
}
