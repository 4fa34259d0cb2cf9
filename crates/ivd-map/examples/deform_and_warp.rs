//! Deforms a ball of voxels: cut its lattice, pull one vertex, carry the motion to the voxels, warp them.
//!
//! Run with `cargo run -p ivd-map --example deform_and_warp`.

use ivd_core::{Exec, Grid, Volume, VoxelCoord, Voxels};
use ivd_field::warp::{self, WarpParams};
use ivd_lattice::extract::{ExtractParams, Iso, extract};
use ivd_map::OctreeParams;
use ivd_motion::handles::{Action, Anchor, Handle};
use ivd_motion::ring::{self, RingParams};

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let exec = Exec::default();

    // A ball of radius 18 mm in the middle of 64³ voxels of 1 mm, bright inside, with a soft border.
    let grid = Grid::with_spacing([64; 3], [1.0; 3])?;
    let brightness = |i: usize| {
        let from_middle = (VoxelCoord::from(grid.index(i)).0.add_scalar(-31.5)).norm();
        (200.0 / (1.0 + (from_middle - 18.0).exp())) as u8
    };
    let voxels: Vec<u8> = (0..grid.len()).map(brightness).collect();
    let volume = Volume::new(grid, Voxels::from(voxels))?;

    // Its lattice, and a handle that pulls the top of it up by 4 mm.
    let lattice = extract(&volume, None, &ExtractParams { iso: Iso::Value(100.0) }, &exec)?.lattice;
    let top = [31.5, 31.5, 49.5];
    let handle = Handle { at: Anchor::NearestTo(top), action: Action::Move([0.0, 0.0, 4.0]), radius: 32.0 };
    let solved = ring::solve(&lattice, &[handle], &[], &RingParams::default(), &exec)?;

    // The motion of the voxels, proven free of folds.
    let octree = ivd_octree::build(&lattice, &ivd_octree::Params::default(), &exec)?;
    let mapped = ivd_map::octree(&lattice, &octree, &solved.motion, 0, &OctreeParams::default(), &exec)?;
    let warped = warp::volume(&volume, &mapped.displacement, &WarpParams::default(), &exec)?;

    println!(
        "{} vertices, {} voxels moved in {} of {} bricks; det J at least {:.2}",
        lattice.keys().len(),
        mapped.figures.voxels_moved,
        mapped.figures.bricks_touched,
        mapped.figures.bricks_total,
        mapped.figures.min_det_j
    );
    let above_the_ball = ivd_core::VoxelIndex([31, 31, 52]);
    println!(
        "3 mm above the ball: {} before, {} after",
        volume.value(above_the_ball),
        warped.output.value(above_the_ball)
    );
    Ok(())
}
