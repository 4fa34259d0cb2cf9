//! Segments a `Vec` of voxels: no file, no pipeline.
//!
//! A ball of value 200 in a box of value 50, with a ramp of noise, on a grid of 64³ voxels of 0.5 mm.

use ivd_core::{Exec, Grid, Volume, Voxels};
use ivd_segment::{KmvsParams, kmvs};

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let n = 64_usize;
    let voxels: Vec<u8> = (0..n * n * n)
        .map(|i| {
            let [x, y, z] = [i % n, i / n % n, i / n / n].map(|v| v as f64 - 31.5);
            let inside = x * x + y * y + z * z < 20.0 * 20.0;
            (if inside { 200 } else { 50 }) + (i * 7919 % 17) as u8
        })
        .collect();

    let grid = Grid::with_spacing([n; 3], [0.5; 3])?;
    let volume = Volume::new(grid, Voxels::from(voxels))?;
    let found = kmvs(&volume, None, &KmvsParams { k: 2, ..KmvsParams::default() }, &Exec::default())?;

    for class in found.labels.classes() {
        println!(
            "class {}: mean {:.1}, spread {:.1}, {} voxels, from {:?} to {:?}",
            class.id, class.mean, class.sd, class.voxels, class.lower, class.upper
        );
    }
    let volume_mm3 = found.labels.classes()[1].voxels as f64 * volume.grid().voxel_volume();
    println!("the ball takes {volume_mm3:.0} mm³; a ball of 10 mm has 4189 mm³");
    Ok(())
}
