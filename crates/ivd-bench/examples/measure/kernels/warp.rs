//! Speed of the inverse and of the warp on a bump of 48 voxels in a volume of 192³, and of both maps for a handle of radius 25 on a
//! ball in 128³, alone and as a frame of a drag.

use ivd_core::{Displacement, Exec, FieldBricks, Grid, Volume, VoxelCoord, VoxelIndex, Voxels};
use ivd_field::inverse::invert;
use ivd_field::warp::{Order, WarpParams, volume};
use ivd_lattice::extract::{ExtractParams, Iso, extract};
use ivd_lattice::refine::{RefineParams, collapse};
use ivd_map::{Band, Biharmonic, BiharmonicParams, OctreeParams, Outside, biharmonic, octree};
use ivd_motion::handles::{Action, Anchor, Handle};
use ivd_motion::ring::{self, RingParams};
use nalgebra::Vector3;

use super::timing::Kernels;
use crate::anything::Anything;

const SIDE: usize = 192;

/// A smooth push of 9 voxels that ends 72 voxels away from the middle.
fn bump() -> Result<FieldBricks, ivd_core::Error> {
    let bricks = SIDE / 8;
    let (mut table, mut vectors) = (Vec::new(), Vec::new());
    for b in 0..bricks * bricks * bricks {
        let base = VoxelIndex([b % bricks, b / bricks % bricks, b / bricks / bricks].map(|c| 8 * c));
        let brick: Vec<[f32; 3]> = (0..FieldBricks::VOXELS)
            .map(|i| {
                let at = VoxelCoord::from(base).0 + Vector3::new(i % 8, i / 8 % 8, i / 64).map(|c| c as f64);
                let t = at.add_scalar(-95.5).norm() / 72.0;
                let u = if t < 1.0 { 9.0 * (1.0 - t * t).powi(3) } else { 0.0 };
                [u as f32, (0.5 * u) as f32, 0.0]
            })
            .collect();
        let moves = brick.iter().any(|v| *v != [0.0; 3]);
        table.push(if moves { (vectors.len() / FieldBricks::VOXELS) as u32 } else { ivd_core::NO_BRICK });
        if moves {
            vectors.extend(brick);
        }
    }
    FieldBricks::new([SIDE; 3], table, vectors.into())
}

fn warps(kernels: &Kernels<'_>) -> Anything<()> {
    let grid = Grid::with_spacing([SIDE; 3], [1.0; 3])?;
    let (forward, exec) = (bump()?, Exec::default());
    kernels.time("warp invert", || invert(&forward, &grid, &exec));
    let inverse = invert(&forward, &grid, &exec)?.field;
    let displacement = Displacement::new(grid.clone(), forward, inverse)?;
    let voxels: Vec<u8> = (0..SIDE.pow(3)).map(|i| (i % 251) as u8).collect();
    let input = Volume::new(grid, Voxels::from(voxels))?;
    for order in [Order::Nearest, Order::Linear, Order::Cubic] {
        let params = WarpParams { order, background: Some(0.0) };
        kernels.time(&format!("warp {order:?}"), || volume(&input, &displacement, &params, &exec));
    }
    Ok(())
}

/// A ball of 40 voxels whose top a handle moves.
fn maps(kernels: &Kernels<'_>) -> Anything<()> {
    let (grid, exec) = (Grid::with_spacing([128; 3], [1.0; 3])?, Exec::default());
    let from_middle = |i: usize| VoxelCoord::from(grid.index(i)).0.add_scalar(-63.5).norm();
    let voxels: Vec<u8> =
        (0..grid.len()).map(|i| (200.0 / (1.0 + (from_middle(i) - 40.0).exp())) as u8).collect();
    let ball = Volume::new(grid.clone(), Voxels::from(voxels))?;
    let cut = ExtractParams { iso: Iso::Value(100.0) };
    let lattice = extract(&ball, None, &cut, &exec)?.lattice;
    let lattice = collapse(&lattice, &RefineParams::default(), &exec)?.lattice;
    let motion = |up: f64| {
        let at = Anchor::NearestTo([63.5, 63.5, 103.5]);
        let handle = Handle { at, action: Action::Move([0.0, 0.0, up]), radius: 25.0 };
        ring::solve(&lattice, &[handle], &[], &RingParams::default(), &exec).map(|found| found.motion)
    };
    let frames: Vec<_> = (0..20).map(|i| motion(2.0 + 0.1 * f64::from(i))).collect::<Result<_, _>>()?;
    let tree = ivd_octree::build(&lattice, &ivd_octree::Params::default(), &exec)?;
    let band = Band { margin: Some(16.0), ..Band::default() };
    let params = OctreeParams { band: band.clone(), ..OctreeParams::default() };
    kernels.time("warp map octree", || octree(&lattice, &tree, &frames[10], 0, &params, &exec));
    let params = BiharmonicParams { band, ..BiharmonicParams::default() };
    kernels.time("warp map biharmonic", || biharmonic(&lattice, &frames[10], 0, &params, &exec));
    let mut kept = Biharmonic::new(&lattice, Outside::Band, &exec)?;
    let mut frame = 0;
    kernels.time("warp map biharmonic, a frame of a drag", || {
        frame += 1;
        kept.map(&frames[frame % frames.len()], 0, &params, &exec).map(drop)
    });
    Ok(())
}

pub(super) fn run(kernels: &Kernels<'_>) -> Anything<()> {
    warps(kernels)?;
    maps(kernels)
}
