//! A part that moves alone: its inverse, and what it leaves.
//!
//! Outside the part the field isn't one-to-one (the part lands on what doesn't move), so the inverse is built forwards:
//! every cell of the part is deformed, and each voxel in it looked up in that cell. Where two pieces of the part land on
//! one voxel the first cell in memory order wins.

use ivd_core::{Exec, FieldBricks, Grid, Mask, NO_BRICK, VoxelCoord, VoxelIndex};
use nalgebra::Vector3;
use rayon::prelude::*;

use super::residual::{SolvedBrick, Worst};
use super::{Inverse, Solver, assemble, store};
use crate::Error;
use crate::sampler::{brick_at, brick_voxels};

/// Residual at which a voxel counts as lying in a cell (voxels): found by Newton inside it, up to rounding.
const IN_CELL: f64 = 1e-7;

/// The inverse of a part's own motion, and the flags of what it left behind (empty where nothing is).
///
/// # Errors
/// Cancellation.
pub fn invert_part(
    forward: &FieldBricks,
    grid: &Grid,
    inside: &Mask,
    exec: &Exec,
) -> Result<(Inverse, Vec<u8>), Error> {
    invert_pieces(forward, grid, Some(inside), exec)
}

/// The inverse of a field of which nothing beyond the grid counts, and the flags of the voxels that something from there came to.
///
/// # Errors
/// Cancellation.
pub fn invert_within(forward: &FieldBricks, grid: &Grid, exec: &Exec) -> Result<(Inverse, Vec<u8>), Error> {
    invert_pieces(forward, grid, None, exec)
}

/// Without a part: all of the grid, and none of the cells beyond it.
fn invert_pieces(
    forward: &FieldBricks,
    grid: &Grid,
    inside: Option<&Mask>,
    exec: &Exec,
) -> Result<(Inverse, Vec<u8>), Error> {
    let solver = Solver::new(forward, grid);
    let owners = crate::certificate::touched(forward);
    let found: Vec<Vec<(usize, Vector3<f64>)>> = owners
        .par_iter()
        .map(|&brick| {
            exec.check_cancelled()?;
            Ok(land(&solver, forward, grid, inside, brick))
        })
        .collect::<Result<_, Error>>()?;
    let mut found: Vec<(usize, Vector3<f64>)> = found.into_iter().flatten().collect();
    // Stable: of several origins of one voxel the first cell's stays in front.
    found.par_sort_by_key(|(voxel, _)| *voxel);
    found.dedup_by_key(|(voxel, _)| *voxel);
    let vacated = vacated(forward, grid, inside, &found);
    let inverse = into_bricks(&solver, grid, found)?;
    Ok((inverse, vacated))
}

/// The voxels that the cells owned by a brick land on, with the place that each comes from.
fn land(
    solver: &Solver<'_>,
    forward: &FieldBricks,
    grid: &Grid,
    inside: Option<&Mask>,
    brick: usize,
) -> Vec<(usize, Vector3<f64>)> {
    let dims = grid.dims();
    let at = brick_at(forward.brick_dims(), brick);
    let lo = at.map(|b| if b == 0 { -1 } else { 8 * b as i64 });
    let hi: [i64; 3] = std::array::from_fn(|a| (8 * at[a] as i64 + 8).min(dims[a] as i64));
    let mut out = Vec::new();
    for z in lo[2]..hi[2] {
        for y in lo[1]..hi[1] {
            for x in lo[0]..hi[0] {
                let cell = [x, y, z];
                let beyond = lies_beyond(dims, cell);
                let corners_inside = match inside {
                    Some(inside) => corners_inside(inside, dims, cell),
                    None => [if beyond { 0.0 } else { 1.0 }; 8],
                };
                if corners_inside.iter().all(|c| *c == 0.0)
                    || solver.sampler().corners(cell).iter().all(|u| *u == Vector3::zeros())
                {
                    continue;
                }
                solver.voxels_in(cell, |voxel| {
                    let y = VoxelCoord::from(voxel).0;
                    if let Some((x, residual)) = solver.in_cell(y, cell)
                        && residual <= IN_CELL
                        && share_inside(&corners_inside, x - Vector3::from(cell).map(|c| c as f64)) >= 0.5
                    {
                        // A corner that stays is its own origin, without the rounding of the search for it.
                        let stays = forward.at(voxel) == [0.0; 3] && (x - y).norm() <= IN_CELL;
                        out.push((grid.linear(voxel), if stays { y } else { x }));
                    }
                });
            }
        }
    }
    out
}

/// Whether a cell lies beyond the grid's outermost voxels; along an axis with one voxel none does.
pub fn lies_beyond(dims: [usize; 3], cell: [i64; 3]) -> bool {
    (0..3).any(|a| dims[a] > 1 && (cell[a] < 0 || cell[a] + 1 >= dims[a] as i64))
}

/// 1 for the corners of a cell that lie in the part.
fn corners_inside(inside: &Mask, dims: [usize; 3], cell: [i64; 3]) -> [f64; 8] {
    std::array::from_fn(|i| {
        let at: [usize; 3] =
            std::array::from_fn(|a| (cell[a] + (i >> a & 1) as i64).clamp(0, dims[a] as i64 - 1) as usize);
        f64::from(inside.inside()[at[0] + dims[0] * (at[1] + dims[1] * at[2])])
    })
}

/// Trilinear share of the part at a place in a cell.
fn share_inside(corners: &[f64; 8], t: Vector3<f64>) -> f64 {
    (0..8)
        .map(|i| {
            corners[i] * (0..3).map(|a| if i >> a & 1 == 1 { t[a] } else { 1.0 - t[a] }).product::<f64>()
        })
        .sum()
}

/// Flags of the voxels that the part left and nothing of it came to.
fn vacated(
    forward: &FieldBricks,
    grid: &Grid,
    inside: Option<&Mask>,
    found: &[(usize, Vector3<f64>)],
) -> Vec<u8> {
    let mut flags = Vec::new();
    for (brick, _) in forward.table().iter().enumerate().filter(|(_, slot)| **slot != NO_BRICK) {
        let vectors = forward.brick(brick).expect("the brick is stored");
        for (slot, voxel) in brick_voxels(grid.dims(), brick_at(forward.brick_dims(), brick)) {
            let i = grid.linear(voxel);
            if vectors[slot] != [0.0; 3]
                && inside.is_none_or(|inside| inside.inside()[i] != 0)
                && found.binary_search_by_key(&i, |(voxel, _)| *voxel).is_err()
            {
                flags.resize(grid.len(), 0);
                flags[i] = 1;
            }
        }
    }
    flags
}

fn into_bricks(
    solver: &Solver<'_>,
    grid: &Grid,
    found: Vec<(usize, Vector3<f64>)>,
) -> Result<Inverse, Error> {
    let brick_dims = grid.dims().map(|n| n.div_ceil(8));
    let brick_of =
        |VoxelIndex([x, y, z]): VoxelIndex| x / 8 + brick_dims[0] * (y / 8 + brick_dims[1] * (z / 8));
    let mut by_brick: std::collections::BTreeMap<usize, SolvedBrick> = std::collections::BTreeMap::new();
    for (i, x) in found {
        let voxel = grid.index(i);
        let (vectors, worst) = by_brick
            .entry(brick_of(voxel))
            .or_insert_with(|| (vec![[0.0; 3]; FieldBricks::VOXELS].into_boxed_slice(), Worst::default()));
        let (vector, residual) = store(solver.sampler(), grid, VoxelCoord::from(voxel).0, x);
        vectors[voxel.0[0] % 8 + 8 * (voxel.0[1] % 8 + 8 * (voxel.0[2] % 8))] = vector;
        worst.take(residual, voxel);
    }
    let (bricks, solved): (Vec<usize>, Vec<SolvedBrick>) = by_brick.into_iter().unzip();
    assemble(grid.dims(), &bricks, solved)
}
