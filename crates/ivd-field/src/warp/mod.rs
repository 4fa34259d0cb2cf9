//! Warping: a volume, labels or a mask carried through a displacement, `out(y) = in(ψ(y))`.
//!
//! Only voxels with a vector in the inverse field, and those that a part left behind, are computed; every other voxel is
//! copied bit for bit, NaN payloads too. Values are interpolated as stored, so the result has the input's type, slope
//! and intercept; integers are rounded (ties to even) and clamped.
//!
//! Beside a cut a voxel takes part only on its own side: nothing of the other side bleeds through.
//!
//! A voxel becomes *background* where its origin lies outside the volume (further out than the border voxels' own half
//! extent, as ITK has it), where a voxel that is no data takes part in its value, or where a part moved away.

mod deformed;
mod deformed_labels;
mod labels;
mod params;
pub mod plan;
mod row;
mod sample;
mod sided;
mod slabs;
mod stage;

use ivd_core::op::Op as _;
use ivd_core::{
    Displacement, Exec, FieldBricks, Grid, NO_BRICK, Scalar, Volume, VoxelCoord, VoxelIndex, Voxels,
    parallel, with_voxels,
};
use nalgebra::Vector3;
use rayon::prelude::*;

use crate::Error;
pub use deformed::Deformed;
pub use deformed_labels::DeformedLabels;
pub(crate) use deformed_labels::ids_of;
pub(crate) use labels::{label_background, recount};
pub use labels::{labels, mask};
pub use params::{Order, WarpParams};
use plan::{Made, Moving, Warping};
use row::{LANES, Rows};
pub(crate) use sample::Source;
pub(crate) use slabs::Slabs;
pub use stage::{STAGE, WarpFigures, WarpInputs};

/// A warped value and how much of it was computed.
#[derive(Debug, Clone, PartialEq)]
pub struct Warped<V> {
    /// The deformed value.
    pub output: V,
    /// Voxels that were computed; all others are the input's.
    pub voxels_resampled: u64,
    /// Voxels of the grid.
    pub voxels_total: u64,
}

/// Carries a volume through a displacement.
///
/// Memory: one copy of the voxels, nothing else of their size.
///
/// # Errors
/// A volume on another grid than the displacement; parameters out of their domain; the memory limit; cancellation.
pub fn volume(
    volume: &Volume,
    displacement: &Displacement,
    params: &WarpParams,
    exec: &Exec,
) -> Result<Warped<Volume>, Error> {
    params.check()?;
    check_grid(volume.grid(), displacement, "volume")?;
    exec.check_memory("the deformed volume", volume.voxels().as_bytes().len() as u64)?;
    exec.run(|| {
        let background = stored_background(volume, displacement, params);
        with_voxels!(volume.voxels(), slice => {
            let (voxels, resampled) = resample((volume.grid(), Some(volume.voxels())), slice, displacement, params.order, background, exec)?;
            let output = Volume::with_scale(volume.grid().clone(), Scalar::wrap(voxels.into()), volume.slope(), volume.intercept())?;
            Ok(Warped { output, voxels_resampled: resampled, voxels_total: volume.grid().len() as u64 })
        })
    })
}

pub(crate) fn check_grid(grid: &Grid, displacement: &Displacement, what: &'static str) -> Result<(), Error> {
    grid.require(displacement.grid(), what, "displacement")
}

/// Background as a stored value. The smallest value costs a pass over the volume, so it is looked up only where some
/// voxel may need it.
pub(crate) fn stored_background(volume: &Volume, displacement: &Displacement, params: &WarpParams) -> f64 {
    let real = params.background.or_else(|| {
        let needed = !displacement.is_identity() && !volume.voxel_type().is_integer()
            || !displacement.vacated().is_empty()
            || leaves_grid(displacement);
        needed.then(|| volume.range()).flatten().map(|range| range[0])
    });
    real.map_or(0.0, |value| volume.stored(value))
}

/// Whether some voxel comes from outside the volume.
fn leaves_grid(displacement: &Displacement) -> bool {
    let (field, grid) = (displacement.inverse(), displacement.grid());
    let (dims, to_voxel) = (grid.dims(), grid.inverse_linear_part());
    (0..field.table().len()).into_par_iter().filter(|&b| field.table()[b] != NO_BRICK).any(|b| {
        let vectors = field.brick(b).expect("the brick is stored");
        crate::sampler::brick_voxels(dims, crate::sampler::brick_at(field.brick_dims(), b)).any(
            |(slot, voxel)| {
                let x = VoxelCoord::from(voxel).0 + to_voxel * Vector3::from(vectors[slot]).map(f64::from);
                vectors[slot] != [0.0; 3] && (0..3).any(|a| !(-0.5..dims[a] as f64 - 0.5).contains(&x[a]))
            },
        )
    })
}

/// The resampled voxels and how many were computed; `stored` is what the voxels are the voxels of, where that is known to backends.
fn resample<T: Scalar>(
    (grid, stored): (&Grid, Option<&Voxels>),
    voxels: &[T],
    displacement: &Displacement,
    order: Order,
    background: f64,
    exec: &Exec,
) -> Result<(Vec<T>, u64), Error> {
    let source = Source { voxels, dims: grid.dims() };
    let background = T::from_f64(background);
    let value = |voxel: VoxelIndex, place: Option<[f64; 3]>| match place {
        Some(x) => sided::sample(&source, displacement, voxel, x, order).map_or(background, T::from_f64),
        None => background,
    };
    let (mut out, count) = match stored {
        Some(voxels) if order == Order::Linear && !displacement.has_cut() => {
            let rows = Rows::new(&source, grid, exec.simd);
            let (to_voxel, most) = rows.frame();
            let by = |made: Option<&Made<T>>, exec: &Exec| {
                linear_by_bricks(&rows, displacement, made, exec, value)
            };
            exec.launch::<Warping<T>>(&Moving { voxels, displacement, to_voxel, most, by: &by })?
        }
        _ => {
            let mut out = voxels.to_vec();
            let count = for_each_moved(grid, displacement, &mut out, exec, value)?;
            (out, count)
        }
    };
    if !exec.skip {
        resample_still(&source, displacement, order, &mut out);
    }
    Ok((out, count))
}

/// Computes the voxels that did not move too, where they hold data: the plain twin of leaving them alone.
fn resample_still<T: Scalar>(
    source: &Source<'_, T>,
    displacement: &Displacement,
    order: Order,
    out: &mut [T],
) {
    let (grid, vacated) = (displacement.grid(), displacement.vacated());
    let [nx, ny, _] = grid.dims();
    parallel::for_each_piece_mut(out, nx * ny, &|z, slice| {
        for (i, value) in slice.iter_mut().enumerate() {
            let at = VoxelIndex([i % nx, i / nx, z]);
            let left = vacated.get(i + nx * ny * z).is_some_and(|&v| v != 0);
            let still = displacement.inverse().at(at) == [0.0; 3] && !left;
            let sampled = still.then(|| source.sample(VoxelCoord::from(at).0.into(), order)).flatten();
            if let Some(sampled) = sampled {
                *value = T::from_f64(sampled);
            }
        }
    });
}

/// Sets every voxel that moved or was left behind: `value` gets the voxel coordinate that it comes from, or `None` where
/// it was left behind. Parallel over slices; returns how many voxels were set.
fn for_each_moved<T: Send>(
    grid: &Grid,
    displacement: &Displacement,
    out: &mut [T],
    exec: &Exec,
    value: impl Fn(VoxelIndex, Option<[f64; 3]>) -> T + Sync,
) -> Result<u64, Error> {
    let [nx, ny, _] = grid.dims();
    let counts = parallel::try_map_pieces_mut(out, nx * ny, &|z, slice| {
        exec.check_cancelled()?;
        Ok::<_, Error>(moved_slice(grid, displacement, z, slice, &value))
    })?;
    Ok(counts.iter().sum())
}

/// The same for slice `z` alone.
fn moved_slice<T>(
    grid: &Grid,
    displacement: &Displacement,
    z: usize,
    slice: &mut [T],
    value: &impl Fn(VoxelIndex, Option<[f64; 3]>) -> T,
) -> u64 {
    let (nx, to_voxel) = (grid.dims()[0], grid.inverse_linear_part());
    let mut count = 0;
    for_each_vector(displacement.inverse(), z, |voxel, vector| {
        let [x, y, _] = voxel.0;
        let from = VoxelCoord::from(voxel).0 + to_voxel * Vector3::from(vector).map(f64::from);
        slice[x + nx * y] = value(voxel, Some(from.into()));
        count += 1;
    });
    count + leave(displacement, z, slice, |voxel| value(voxel, None))
}

/// The voxels with those set that moved or were left behind, a brick at a time: what lies near in the field lies near in the
/// volume. They are computed by `rows`, or as they are made already. What either leaves gets `value`, as in [`for_each_moved`]. Returns how many voxels were set, too.
fn linear_by_bricks<T: Scalar>(
    rows: &Rows<'_, T>,
    displacement: &Displacement,
    made: Option<&Made<T>>,
    exec: &Exec,
    value: impl Fn(VoxelIndex, Option<[f64; 3]>) -> T + Sync,
) -> Result<(Vec<T>, u64), Error> {
    const SIDE: usize = FieldBricks::SIDE;
    let field = displacement.inverse();
    let [nx, ny, _] = field.dims();
    let mut out = vec![T::default(); rows.voxels().len()];
    let slab = SIDE * nx * ny;
    let counts = parallel::try_map_pieces_mut(&mut out, slab, &|bz, out| {
        exec.check_cancelled()?;
        let voxels = &rows.voxels()[slab * bz..][..out.len()];
        Ok::<_, Error>(linear_slab(rows, displacement, made, bz, voxels, out, &value))
    })?;
    Ok((out, counts.iter().sum()))
}

/// The same for slab `bz`, eight slices, alone.
fn linear_slab<T: Scalar>(
    rows: &Rows<'_, T>,
    displacement: &Displacement,
    made: Option<&Made<T>>,
    bz: usize,
    voxels: &[T],
    out: &mut [T],
    value: &impl Fn(VoxelIndex, Option<[f64; 3]>) -> T,
) -> u64 {
    let field = displacement.inverse();
    let ([nx, ny, _], bricks) = (field.dims(), field.brick_dims());
    let mut count = 0;
    let layer = bricks[0] * bricks[1];
    if field.table()[layer * bz..][..layer].contains(&NO_BRICK) {
        out.copy_from_slice(voxels);
    }
    for (by, bx) in (0..bricks[1]).flat_map(|by| (0..bricks[0]).map(move |bx| (by, bx))) {
        let brick = bx + bricks[0] * by + layer * bz;
        let Some(vectors) = field.brick(brick) else { continue };
        for_each_row(field.dims(), [bx, by, bz], |start, row, range| {
            let made = made.map(|made| made.row(field.table()[brick] as usize, row / LANES));
            let (row, _) = vectors[row..].split_first_chunk::<LANES>().expect("a brick's row");
            count += linear_row(rows, (start, row, made), &voxels[range.clone()], &mut out[range], value);
        });
    }
    for (z, slice) in out.chunks_mut(nx * ny).enumerate() {
        count += leave(displacement, FieldBricks::SIDE * bz + z, slice, |voxel| value(voxel, None));
    }
    count
}

/// Calls `each` with every row of a brick that lies in the grid: its first voxel, its first vector in the brick, and its voxels in
/// the brick's slab of eight slices.
pub(crate) fn for_each_row(
    [nx, ny, nz]: [usize; 3],
    [bx, by, bz]: [usize; 3],
    mut each: impl FnMut([usize; 3], usize, std::ops::Range<usize>),
) {
    const SIDE: usize = FieldBricks::SIDE;
    for z in 0..SIDE.min(nz - SIDE * bz) {
        for y in 0..SIDE.min(ny - SIDE * by) {
            let start = [SIDE * bx, SIDE * by + y, SIDE * bz + z];
            let first = nx * (start[1] + ny * z);
            each(start, SIDE * (y + SIDE * z), first + start[0]..first + (start[0] + SIDE).min(nx));
        }
    }
}

/// A row of a brick as it is made already, and a bit for each of its voxels that is left.
type MadeRow<'a, T> = (&'a [T; LANES], u8);

/// A row of a brick, those voxels set that move; how many there are.
fn linear_row<T: Scalar>(
    rows: &Rows<'_, T>,
    (start, row, made): ([usize; 3], &[[f32; 3]; LANES], Option<MadeRow<'_, T>>),
    from: &[T],
    to: &mut [T],
    value: &impl Fn(VoxelIndex, Option<[f64; 3]>) -> T,
) -> u64 {
    let [moves, rest] = if let (Some(to), Some(from)) = (to.first_chunk_mut(), from.first_chunk()) {
        match made {
            Some((values, left)) => row::take(row, values, left, from, to),
            None => rows.fill(start, row, from, to),
        }
    } else {
        to.copy_from_slice(from);
        let moves = row::moving(row) & ((1 << to.len()) - 1);
        [moves, moves]
    };
    for i in (0..LANES).filter(|i| rest >> i & 1 == 1) {
        to[i] = value(VoxelIndex([start[0] + i, start[1], start[2]]), Some(rows.place(start, i, row[i])));
    }
    u64::from(moves.count_ones())
}

/// Sets the voxels of slice `z` that were left behind; returns how many of them have no vector, which nobody counted yet.
fn leave<T>(displacement: &Displacement, z: usize, slice: &mut [T], value: impl Fn(VoxelIndex) -> T) -> u64 {
    let mut count = 0;
    if !displacement.vacated().is_empty() {
        let (first, nx) = (z * slice.len(), displacement.grid().dims()[0]);
        let flags = &displacement.vacated()[first..][..slice.len()];
        for (i, to) in slice.iter_mut().enumerate().filter(|(i, _)| flags[*i] != 0) {
            let voxel = VoxelIndex([i % nx, i / nx, z]);
            *to = value(voxel);
            count += u64::from(displacement.inverse().at(voxel) == [0.0; 3]);
        }
    }
    count
}

/// Calls `each` with every voxel of slice `z` whose vector isn't 0.
fn for_each_vector(field: &FieldBricks, z: usize, mut each: impl FnMut(VoxelIndex, [f32; 3])) {
    let (dims, bricks) = (field.dims(), field.brick_dims());
    for by in 0..bricks[1] {
        for bx in 0..bricks[0] {
            let Some(vectors) = field.brick(bx + bricks[0] * (by + bricks[1] * (z / 8))) else { continue };
            for y in 8 * by..(8 * by + 8).min(dims[1]) {
                for x in 8 * bx..(8 * bx + 8).min(dims[0]) {
                    let vector = vectors[x % 8 + 8 * (y % 8 + 8 * (z % 8))];
                    if vector != [0.0; 3] {
                        each(VoxelIndex([x, y, z]), vector);
                    }
                }
            }
        }
    }
}

#[cfg(test)]
mod tests;
