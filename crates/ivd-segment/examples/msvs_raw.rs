//! Mean shift over a raw file: `msvs_raw FILE NX NY NZ TYPE [name=value …]`, TYPE u8, u16 or f32 (little endian).
//!
//! Names: those of the parameters, `threads`, `spacing=x,y,z`, `repeat` (prints the fastest) and `labels=FILE` (writes the labels, u16).
use std::time::Instant;

use ivd_core::{Exec, Grid, Volume, Voxels};
use ivd_segment::{Kernel, MsvsParams, msvs};

fn voxels(bytes: &[u8], name: &str) -> Voxels {
    match name {
        "u8" => bytes.to_vec().into(),
        "u16" => bytes.chunks_exact(2).map(|b| u16::from_le_bytes([b[0], b[1]])).collect::<Vec<_>>().into(),
        _ => bytes
            .chunks_exact(4)
            .map(|b| f32::from_le_bytes([b[0], b[1], b[2], b[3]]))
            .collect::<Vec<_>>()
            .into(),
    }
}

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let args: Vec<String> = std::env::args().skip(1).collect();
    let [file, nx, ny, nz, kind, named @ ..] = &args[..] else {
        return Err("FILE NX NY NZ TYPE [name=value …]".into());
    };
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
            "spacing" => {
                for (to, part) in spacing.iter_mut().zip(value.split(',')) {
                    *to = part.parse()?;
                }
            }
            other => return Err(format!("no parameter is called {other}").into()),
        }
    }
    let grid = Grid::with_spacing([nx.parse()?, ny.parse()?, nz.parse()?], spacing)?;
    let volume = Volume::new(grid, voxels(&std::fs::read(file)?, kind))?;
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
        let ids = found.segmentation.labels.ids();
        std::fs::write(file, ids.iter().flat_map(|id| id.to_le_bytes()).collect::<Vec<u8>>())?;
    }
    Ok(())
}
