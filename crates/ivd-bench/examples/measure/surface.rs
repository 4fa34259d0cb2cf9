//! Active surfaces in memory, for comparisons with other programs: `measure surface RAW TYPE X,Y,Z PARAMS REPEATS [MASK] [LEVEL]`.
//!
//! RAW holds voxels of TYPE (see `raw`), x fastest, PARAMS is JSON as in a scene's section. Prints a line of JSON: wall and processor time
//! (s) of each repeat on two threads, the figures, peak memory (MiB). MASK gets the part, a byte a voxel, LEVEL its level function (f32).

use std::time::Instant;

use cpu_time::ProcessTime;
use ivd_boundary::{SurfaceParams, active_surface};
use ivd_core::Exec;
use serde_json::json;

use crate::{Anything, raw};

pub(crate) const USAGE: &str = "RAW TYPE X,Y,Z PARAMS REPEATS [MASK] [LEVEL]";

pub(crate) fn run(words: &[String]) -> Anything<()> {
    let [path, kind, dims, params, repeats, files @ ..] = words else { return Err(USAGE.into()) };
    let volume = raw::volume(path, kind, raw::three(dims)?, [1.0; 3])?;
    volume.range();
    let params: SurfaceParams = serde_json::from_str(params)?;
    let exec = Exec::default().with_threads(2);
    let mut times = Vec::new();
    let mut found = None;
    for _ in 0..repeats.parse::<usize>()?.max(1) {
        let (wall, cpu) = (Instant::now(), ProcessTime::now());
        found = Some(active_surface(&volume, None, None, &params, &exec)?);
        times.push([wall.elapsed().as_secs_f64(), cpu.elapsed().as_secs_f64()]);
    }
    let found = found.expect("it ran once");
    if let Some(path) = files.first() {
        std::fs::write(path, found.mask.inside())?;
    }
    if let (Some(path), Some(level)) = (files.get(1), found.mask.level()) {
        std::fs::write(path, level.as_bytes())?;
    }
    let told = json!({
        "times": times, "voxels": found.voxels, "sweeps": found.sweeps, "updates": found.updates,
        "active_fraction": found.active_fraction, "mu": found.mu, "means": found.means, "noise": found.noise,
        "energies": found.energies, "gap": found.gap, "relaxed_gap": found.relaxed_gap, "energy": found.energy,
        "peak_mib": raw::peak_mib(),
    });
    println!("{told}");
    Ok(())
}
