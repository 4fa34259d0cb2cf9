//! Linear warps of a volume, for a comparison with other programs: `measure warp FOLDER SIDE THREADS`.
//!
//! `FOLDER/volume.f32` holds SIDE³ values, x fastest, `FOLDER/field.f32` as many vectors (voxels; deformed to rest), both little-endian.
//! Each line on stdin asks for a run; the answer is a line of JSON: wall and processor time (s) of the whole warp, then those of making
//! only the bricks anew that have a vector, as a frame of a drag does, and how many those are. The first run writes `FOLDER/ours.f32`.

use std::io::BufRead;
use std::path::Path;
use std::time::Instant;

use cpu_time::ProcessTime;
use ivd_core::{Displacement, Exec, FieldBricks, Grid, NO_BRICK, Volume, Voxels};
use ivd_field::warp::{Deformed, WarpParams, volume};

use crate::anything::Anything;
use crate::raw;

pub(crate) const USAGE: &str = "FOLDER SIDE THREADS";

/// The bricks of a dense field that have a vector.
fn bricks(side: usize, dense: &[f32]) -> Result<FieldBricks, ivd_core::Error> {
    let count = side.div_ceil(8);
    let (mut table, mut vectors) = (vec![NO_BRICK; count.pow(3)], Vec::new());
    for (b, slot) in table.iter_mut().enumerate() {
        let mut own = vec![[0.0_f32; 3]; FieldBricks::VOXELS];
        let base = [b % count, b / count % count, b / (count * count)].map(|c| 8 * c);
        for (i, vector) in own.iter_mut().enumerate() {
            let [x, y, z] = [base[0] + i % 8, base[1] + i / 8 % 8, base[2] + i / 64];
            if x < side && y < side && z < side {
                let first = 3 * (x + side * (y + side * z));
                *vector = [dense[first], dense[first + 1], dense[first + 2]];
            }
        }
        if own.iter().any(|v| *v != [0.0; 3]) {
            *slot = (vectors.len() / FieldBricks::VOXELS) as u32;
            vectors.extend(own);
        }
    }
    FieldBricks::new([side; 3], table, vectors.into())
}

pub(crate) fn run(words: &[String]) -> Anything<()> {
    let [folder, side, threads] = words else { return Err(USAGE.into()) };
    let (folder, side, threads): (&Path, usize, usize) = (folder.as_ref(), side.parse()?, threads.parse()?);
    let grid = Grid::with_spacing([side; 3], [1.0; 3])?;
    let input = Volume::new(grid.clone(), raw::voxels(folder.join("volume.f32"), "f32")?)?;
    let Voxels::F32(field) = raw::voxels(folder.join("field.f32"), "f32")? else {
        return Err("floats are read".into());
    };
    let moved = Displacement::new(grid, FieldBricks::zero([side; 3]), bricks(side, &field)?)?;
    let touched: Vec<usize> =
        (0..moved.inverse().table().len()).filter(|&b| moved.inverse().table()[b] != NO_BRICK).collect();
    let exec = Exec::default().with_threads(threads);
    let params = WarpParams { background: Some(0.0), ..WarpParams::default() };
    let mut kept = Deformed::new(&input, params.clone(), &exec)?;
    let mut first = true;
    for line in std::io::stdin().lock().lines() {
        line?;
        let (start, cpu) = (Instant::now(), ProcessTime::now());
        let warped = volume(&input, &moved, &params, &exec)?;
        let (wall, cpu) = (start.elapsed().as_secs_f64(), cpu.elapsed().as_secs_f64());
        let (start, frame_cpu) = (Instant::now(), ProcessTime::now());
        kept.update(&input, &moved, &touched, &exec)?;
        let (frame_wall, frame_cpu) = (start.elapsed().as_secs_f64(), frame_cpu.elapsed().as_secs_f64());
        if first {
            assert!(kept.output() == &warped.output, "a frame differs from the whole warp");
            std::fs::write(folder.join("ours.f32"), warped.output.voxels().as_bytes())?;
        }
        first = false;
        println!(
            "{{\"wall_s\": {wall:?}, \"cpu_s\": {cpu:?}, \"frame_wall_s\": {frame_wall:?}, \"frame_cpu_s\": {frame_cpu:?}, \
             \"bricks\": {}}}",
            touched.len()
        );
    }
    Ok(())
}
