//! Meshes a ball held in a `Vec` of voxels, then keeps a sixteenth of its vertices.
//!
//! `cargo run -p ivd-lattice --example extract_and_refine`

use ivd_core::{Exec, Grid, Lattice, Volume, Voxels};
use ivd_lattice::extract::{ExtractParams, Iso, extract};
use ivd_lattice::figures::measure;
use ivd_lattice::refine::{RefineParams, Target, collapse};

fn main() -> Result<(), Box<dyn std::error::Error>> {
    // A ball of radius 20 mm in a scan of 64 × 64 × 32 voxels, the slices twice as thick as they are wide.
    let (dims, spacing) = ([64, 64, 32], [1.0, 1.0, 2.0]);
    let mut voxels = Vec::with_capacity(64 * 64 * 32);
    for z in 0..32 {
        for y in 0..64 {
            for x in 0..64 {
                let [dx, dy, dz] = [f64::from(x) - 31.5, f64::from(y) - 31.5, 2.0 * f64::from(z) - 31.0];
                let depth = 20.0 - (dx * dx + dy * dy + dz * dz).sqrt();
                voxels.push((1000.0 + 50.0 * depth) as i16);
            }
        }
    }
    let volume = Volume::new(Grid::with_spacing(dims, spacing)?, Voxels::from(voxels))?;

    let exec = Exec::default();
    let cut = extract(&volume, None, &ExtractParams { iso: Iso::Value(1000.0) }, &exec)?;
    println!("{} of {} bricks hold the surface", cut.bricks_active, cut.bricks_total);
    print("extracted", &cut.lattice);

    let params = RefineParams { target: Target::Level(2).into(), ..RefineParams::default() };
    let refined = collapse(&cut.lattice, &params, &exec)?;
    print("refined", &refined.lattice);
    println!("at most {:.3} mm from the extracted surface", refined.lattice.max_error_mm());
    Ok(())
}

fn print(name: &str, lattice: &Lattice) {
    let figures = measure(lattice);
    println!(
        "{name}: {} vertices, {} triangles, {:.0} mm², {:.0} mm³, closed manifold: {}",
        figures.vertices,
        figures.triangles,
        figures.area_mm2,
        figures.volume_mm3,
        figures.is_closed_manifold()
    );
}
