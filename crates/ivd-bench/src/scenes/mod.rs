//! Whole scenes: what each does and doesn't do, and how work grows with the volume.
//!
//! [`skipping`] runs scenes that need little and tells what was run, looked at and read, against the least that their
//! outputs need; each again with every skip off, which must give the same. [`scaling`] runs one scene, a cheek of a head of
//! 128 mm that is pushed in, on finer and finer grids.

mod page;
mod place;
mod scaling;
mod skipping;

use serde::{Deserialize, Serialize};

pub use page::scenes_page;
pub use scaling::{ScalePoint, scaling};
pub use skipping::{SkipRow, skipping};

use ivd_core::Exec;

use crate::{Error, Options};

/// What whole scenes took.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SceneBench {
    /// Version of this layout: 1.
    pub schema: u32,
    /// Version of the program.
    pub version: String,
    /// Worker threads.
    pub threads: usize,
    /// Voxels along the edge of the volumes in `skipping`.
    pub size: usize,
    /// What scenes skip.
    pub skipping: Vec<SkipRow>,
    /// How a scene grows.
    pub scaling: Vec<ScalePoint>,
}

/// Sizes of the scaling runs; those above [`Options::size`] are left out.
const SIZES: [usize; 8] = [32, 64, 96, 128, 192, 256, 384, 512];

/// Runs the scenes; `options.size` bounds the volumes, `options.repeats` says how often each size is run.
///
/// # Errors
/// [`Error::Failed`] names the scene; cancelled.
pub fn scenes(options: &Options, exec: &Exec) -> Result<SceneBench, Error> {
    let size = options.size.clamp(32, 128);
    let sizes: Vec<usize> = SIZES.into_iter().filter(|&n| n <= options.size.max(64)).collect();
    exec.observer().begin("scenes", sizes.len() as u64 + 1);
    let skipping = skipping(size, exec)?;
    exec.observer().advance("scenes", 1);
    let mut points = Vec::new();
    for size in sizes {
        exec.check_cancelled()?;
        points.push(scaling(size, options.repeats, exec)?);
        exec.observer().advance("scenes", 1);
    }
    exec.observer().end("scenes");
    Ok(SceneBench {
        schema: 1,
        version: env!("CARGO_PKG_VERSION").to_owned(),
        threads: exec.threads(),
        size,
        skipping,
        scaling: points,
    })
}
