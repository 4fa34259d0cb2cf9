//! Voxels from raw files, labels into them, and what a run has cost so far.

use std::path::Path;

use ivd_core::{Grid, Volume, Voxels};

use crate::anything::Anything;

/// Little-endian voxels of a type, x fastest.
pub(crate) fn voxels(path: impl AsRef<Path>, kind: &str) -> Anything<Voxels> {
    let bytes = std::fs::read(path)?;
    let (pairs, fours) = (bytes.as_chunks::<2>().0.iter(), bytes.as_chunks::<4>().0.iter());
    Ok(match kind {
        "i16" => pairs.map(|b| i16::from_le_bytes(*b)).collect::<Vec<_>>().into(),
        "u16" => pairs.map(|b| u16::from_le_bytes(*b)).collect::<Vec<_>>().into(),
        "i32" => fours.map(|b| i32::from_le_bytes(*b)).collect::<Vec<_>>().into(),
        "f32" => fours.map(|b| f32::from_le_bytes(*b)).collect::<Vec<_>>().into(),
        "u8" => bytes.into(),
        _ => return Err(format!("{kind}: use u8, i16, u16, i32 or f32").into()),
    })
}

/// A volume of such voxels.
pub(crate) fn volume(path: &str, kind: &str, dims: [usize; 3], spacing: [f64; 3]) -> Anything<Volume> {
    Ok(Volume::new(Grid::with_spacing(dims, spacing)?, voxels(path, kind)?)?)
}

/// Three numbers with commas between.
pub(crate) fn three<T: std::str::FromStr>(text: &str) -> Anything<[T; 3]> {
    let parts: Result<Vec<T>, _> = text.split(',').map(str::parse).collect();
    let parts = parts.map_err(|_| format!("{text}: three numbers are expected"))?;
    parts.try_into().map_err(|_| format!("{text}: three numbers are expected").into())
}

/// Little-endian labels, into a file.
pub(crate) fn write_labels(path: &str, ids: &[u16]) -> Anything<()> {
    Ok(std::fs::write(path, ids.iter().flat_map(|id| id.to_le_bytes()).collect::<Vec<u8>>())?)
}

/// Largest memory so far (MiB); 0 where the system doesn't say.
pub(crate) fn peak_mib() -> f64 {
    ivd_pipeline::resource::peak_rss_mb().unwrap_or(0.0)
}
