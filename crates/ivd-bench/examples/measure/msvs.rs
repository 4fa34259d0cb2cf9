//! Mean shift over a raw file: `measure msvs FILE NX NY NZ TYPE [name=value …]`, TYPE u8, u16 or f32 (little endian).
//!
//! Names: those of the parameters, `threads`, `spacing=x,y,z`, `repeat` (prints the fastest) and `labels=FILE` (writes the labels, u16).
use std::time::Instant;

use ivd_core::Exec;
use ivd_segment::{Kernel, MsvsParams, msvs};

use crate::anything::Anything;
use crate::raw;

pub(crate) const USAGE: &str = "FILE NX NY NZ TYPE [name=value …]";

pub(crate) fn run(args: &[String]) -> Anything<()> {
    let [file, nx, ny, nz, kind, named @ ..] = args else { return Err(USAGE.into()) };
    let mut params = MsvsParams::default();
    let (mut exec, mut labels, mut repeat, mut spacing) = (Exec::default(), None, 1, [1.0; 3]);
    for (name, value) in named.iter().filter_map(|n| n.split_once('=')) {
        match name {
            "range_bandwidth" => params.range_bandwidth = value.parse()?,
            "spatial_bandwidth" => params.spatial_bandwidth = value.parse()?,
            "persistence" => params.persistence = value.parse()?,
            "k_max" => params.k_max = value.parse()?,
            "cells_per_bandwidth" => params.cells_per_bandwidth = value.parse()?,
            "kernel" => params.kernel = if value == "flat" { Kernel::Flat } else { Kernel::Gaussian },
            "threads" => exec = exec.with_threads(value.parse()?),
            "repeat" => repeat = value.parse()?,
            "labels" => labels = Some(value),
            "spacing" => spacing = raw::three(value)?,
            other => return Err(format!("no parameter is called {other}").into()),
        }
    }
    let volume = raw::volume(file, kind, [nx.parse()?, ny.parse()?, nz.parse()?], spacing)?;
    let mut best = f64::INFINITY;
    let mut found = None;
    for _ in 0..repeat {
        let start = Instant::now();
        found = Some(msvs(&volume, None, &params, &exec)?);
        best = best.min(start.elapsed().as_secs_f64());
    }
    let found = found.ok_or("repeat=0")?;
    println!(
        "{best:.3} s, {} classes of {} proposed, bandwidths {:.4} and {} mm, {} cells, {:.2} across",
        found.segmentation.k,
        found.k_proposed,
        found.range_bandwidth,
        found.spatial_bandwidth,
        found.cells,
        found.cells_per_bandwidth
    );
    for mode in found.modes.iter().take(12) {
        let [x, y, z] = mode.position;
        println!(
            "  class {:3}: value {:9.3} at ({x:.1}, {y:.1}, {z:.1}), density {:.3e}, persistence {:.4}, {} voxels",
            mode.class, mode.value, mode.density, mode.persistence, mode.voxels
        );
    }
    if let Some(file) = labels {
        raw::write_labels(file, found.segmentation.labels.ids())?;
    }
    Ok(())
}
