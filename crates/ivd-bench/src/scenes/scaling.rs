use ivd_core::Exec;
use ivd_map::MapFigures;
use serde::{Deserialize, Serialize};

use super::place::{Content, EDGE_MM, Place, Run, settle};
use super::skipping::HANDLE;
use crate::Error;
use ivd_budget::fronts::Spread;

/// A size of the volume and what the scene took on it.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ScalePoint {
    /// Voxels along the edge of the volume.
    pub size: usize,
    /// Edge of a voxel (mm).
    pub voxel_mm: f64,
    /// From the file to the deformed volume, nothing cached.
    pub whole: Cost,
    /// The handle moved: motion and map alone, the rest from the cache.
    pub moved: Cost,
    /// Voxels that move.
    pub voxels_moved: f64,
    /// Bytes of the volume's file and of its cached voxels that were read when the handle moved.
    pub volume_bytes_read: u64,
}

/// What a run took.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Cost {
    /// Wall time (s).
    pub wall_s: Spread,
    /// Processor time of all threads (s).
    pub cpu_s: Spread,
    /// Largest resident memory of any stage (MiB).
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub peak_rss_mb: Option<f64>,
    /// Voxels looked at, by all stages that ran.
    pub visited: f64,
}

impl Cost {
    fn of(runs: &[Run]) -> Result<Self, Error> {
        let times = |of: fn(&Run) -> f64| Spread::of(&runs.iter().map(of).collect::<Vec<_>>());
        Ok(Self {
            wall_s: times(|r| r.wall_s),
            cpu_s: times(|r| r.cpu_s),
            peak_rss_mb: runs.iter().filter_map(Run::peak_rss_mb).reduce(f64::max),
            visited: runs[0].visited()?[0],
        })
    }
}

/// Runs the scene on a head without noise of `size` voxels along an edge, `repeats` times. Noise belongs to voxels: on a
/// finer grid the same noise is another surface, and another scene.
///
/// # Errors
/// [`Error::Failed`].
pub fn scaling(size: usize, repeats: usize, exec: &Exec) -> Result<ScalePoint, Error> {
    let scene = format!("[lattice]\niso = 60.0\n{HANDLE}[output]\nvolume = \"deformed.nrrd\"\n");
    let place = Place::new(&format!("the cheek at {size}³"), size, Content::SmoothHead, &scene, exec)?;
    let rounds = 0..repeats.max(1);
    let whole: Result<Vec<Run>, Error> =
        rounds.clone().map(|_| place.run(&[], Some("warp"), false, exec)).collect();
    settle();
    place.run(&[], Some("map"), true, exec)?;
    let moved: Result<Vec<Run>, Error> = rounds
        .map(|round| {
            let by = format!("deform.handle.0.move=[{:.3}, 0.0, 0.0]", -3.01 - 0.01 * round as f64);
            place.run(&[&by], Some("map"), true, exec)
        })
        .collect();
    let (whole, moved) = (whole?, moved?);
    let last = moved.last().expect("at least one round");
    // What of the import's record isn't the brick index that is always read: the source file. And what the stages that ran
    // asked for; cached lattices and the like have nothing to do with the volume.
    let index = 9 * (size as u64).div_ceil(8).pow(3);
    let source = last.record("import").map_or(0, |r| r.bytes_read).saturating_sub(index);
    let stages = ["segment", "boundary", "lattice", "deform", "map"].into_iter();
    let asked_for = stages.filter_map(|stage| last.record(stage)).filter(|r| !r.cached).map(|r| r.bytes_read);
    Ok(ScalePoint {
        size,
        voxel_mm: EDGE_MM / size as f64,
        voxels_moved: last.figures::<MapFigures>(ivd_map::STAGE.name)?.voxels_moved as f64,
        volume_bytes_read: source + asked_for.sum::<u64>(),
        whole: Cost::of(&whole)?,
        moved: Cost::of(&moved)?,
    })
}
