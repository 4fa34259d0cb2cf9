//! Writes a lattice in every format, reads it again, and puts what was read on the lattice's grid.
//!
//! `measure meshes`

use std::time::Instant;

use ivd_core::{Exec, Grid, Volume, Voxels};
use ivd_io::mesh::{Format, read, write};
use ivd_lattice::extract::{ExtractParams, Iso, extract};
use ivd_lattice::figures::{measure, quality};
use ivd_lattice::import::{ImportParams, lattice};

use crate::anything::Anything;

pub(crate) const USAGE: &str = "";

pub(crate) fn run(_: &[String]) -> Anything<()> {
    // Eight periods of a gyroid in 160³ voxels.
    let (n, exec) = (160, Exec::default());
    let grid = Grid::with_spacing([n; 3], [0.8, 0.8, 1.2])?;
    let voxels: Vec<f32> = (0..grid.len())
        .map(|i| {
            let [x, y, z] = grid.index(i).0.map(|c| (c as f32 * 0.3).sin_cos());
            x.0 * y.1 + y.0 * z.1 + z.0 * x.1
        })
        .collect();
    let volume = Volume::new(grid.clone(), Voxels::from(voxels))?;
    let cut = extract(&volume, None, &ExtractParams { iso: Iso::Value(0.1) }, &exec)?.lattice;
    println!("{} vertices, {} triangles", cut.keys().len(), cut.triangles().len());
    let folder = std::env::temp_dir();
    for format in Format::ALL {
        let path = folder.join(format!("ivd-example-{}", std::process::id())).with_extension(format.ending());
        write(&path, &cut, None)?;
        let start = Instant::now();
        let mesh = read(&path, u64::MAX);
        let (seconds, size) = (start.elapsed().as_secs_f64(), std::fs::metadata(&path)?.len());
        std::fs::remove_file(&path)?;
        let mesh = mesh?;
        let start = Instant::now();
        let put = lattice(&mesh, &grid, &ImportParams::default(), &exec);
        print!(
            "{:4}: {:6.1} MB, read in {seconds:.2} s, on the grid in {:.2} s",
            format.ending(),
            size as f64 / 1e6,
            start.elapsed().as_secs_f64()
        );
        match put {
            Ok(put) => println!(
                ": {:?} addresses, {} welded, at most {:.1e} mm moved",
                put.addresses, put.welded, put.moved_mm
            ),
            Err(error) => println!(": {error}"),
        }
    }
    let start = Instant::now();
    let figures = measure(&cut);
    let (first, start) = (start.elapsed().as_secs_f64(), Instant::now());
    let shapes = quality(&cut);
    println!("measured in {first:.2} s, quality in {:.2} s", start.elapsed().as_secs_f64());
    println!(
        "genus {:?}, aspect ratio {:.2} in the mean, {:.0} % of the vertices of valence 6",
        figures.genus,
        shapes.aspect.mean,
        100.0 * shapes.regular_share
    );
    Ok(())
}
