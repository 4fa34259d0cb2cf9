//! Constructive volume geometry: volumes, labels or masks combined by union, intersection and difference, deformed or not.
//!
//! A volume's *opacity* at a place of value `v` is `o = clamp((v − lo) / (hi − lo), 0, 1)` in a window `[lo, hi]`, by default the
//! volume's own range; what is no data (NaN, infinite) has opacity 0, and so has all that lies outside an operand's grid. Then
//!
//! ```text
//! union          max(o_A, o_B)
//! intersection   min(o_A, o_B)
//! difference     min(o_A, 1 − o_B)
//! ```
//!
//! These are the operations of fuzzy sets with the complement `1 − o`: difference is `A ∩ ¬B`, and De Morgan's laws hold. They
//! don't for `max(0, o_A − o_B)`: by that `¬(A − B)` isn't `¬A ∪ B` (both opacities ½: 1 and ½). In return `A − A` isn't empty
//! where A is half opaque.
//!
//! The result lies on the first operand's grid, in its type, slope and intercept. The value follows the operand that decides:
//! - where the opacity is A's, A's stored value, bit for bit (a NaN's payload and a value beyond the window too);
//! - else in a union the value of the first operand that is as opaque as the result;
//! - else in an intersection or a difference A's value of that opacity, `lo_A + o (hi_A − lo_A)`.
//!
//! Integers are rounded (ties to even); all types are clamped to what they can hold. More than two operands are folded from left
//! to right, on opacities, without rounding between; in a difference each of the others is taken from A.
//!
//! Operands on another grid than A's are read at A's voxel centres: volumes linearly (as [`crate::warp`] does), labels and masks
//! at the nearest voxel. On a matching grid voxels are read as they are. Each operand may come with a
//! [`Displacement`](ivd_core::Displacement), and is then read as [`crate::warp`] with its default parameters would have it, to the last bit, without a deformed copy of it.
//!
//! After Chen & Tucker 2000 (Constructive Volume Geometry, Computer Graphics Forum 19(4)); the difference as in Wang & Kaufman
//! 1994 (Volume-sampled 3D modeling, IEEE CG&A 14(5)).
//!
//! ```
//! use ivd_core::{Exec, Grid, Volume, Voxels};
//! use ivd_field::combine::{self, CombineParams, Op, Operand};
//!
//! let grid = Grid::with_spacing([3, 1, 1], [1.0; 3])?;
//! let a = Volume::new(grid.clone(), Voxels::from(vec![0_u8, 100, 200]))?;
//! let b = Volume::new(grid, Voxels::from(vec![1.0_f32, 0.75, 0.0]))?;
//! let params = CombineParams { op: Op::Difference, windows: vec![[0.0, 200.0], [0.0, 1.0]] };
//! let rest = combine::volumes(&[Operand::from(&a), Operand::from(&b)], &params, &Exec::default())?;
//! assert_eq!(rest.output.to_array().into_raw_vec_and_offset().0, [0.0, 50.0, 200.0]);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

mod blend;
mod counts;
mod kinds;
mod operand;
mod params;
mod pick;
mod read;
mod stage;

use ivd_core::{Exec, Grid, Labels, Mask, Scalar, Volume, with_voxels};

use crate::Error;
use crate::warp::{self, WarpParams, label_background};
use counts::Counts;
pub use kinds::{Given, any};
pub use operand::Operand;
pub use params::{CombineParams, Op};
use read::{Place, Read};
pub use stage::{CombineFigures, STAGE, SceneCombine};

pub(crate) use blend::nearest_data;

/// A combination and how much of it was looked at.
#[derive(Debug, Clone, PartialEq)]
pub struct Combined<V> {
    /// On the first operand's grid.
    pub output: V,
    /// Voxels whose stored value isn't the first operand's (as it is deformed).
    pub voxels_changed: u64,
    /// Voxels of the grid.
    pub voxels_total: u64,
    /// Bricks of 8³ voxels that were looked at voxel by voxel; in the others the ranges show that the first operand decides.
    pub bricks_visited: u64,
    /// Bricks of the grid.
    pub bricks_total: u64,
}

impl<V> Combined<V> {
    fn new(output: V, counts: Counts, grid: &Grid) -> Self {
        let bricks: usize = grid.dims().iter().map(|n| n.div_ceil(8)).product();
        Self {
            output,
            voxels_changed: counts.changed,
            voxels_total: grid.len() as u64,
            bricks_visited: counts.bricks,
            bricks_total: bricks as u64,
        }
    }
}

/// Combines volumes; see the [module](self) for what comes of them.
///
/// Memory: one copy of the first operand's voxels, and of an operand that has both a displacement and a grid of its own.
///
/// # Errors
/// Less than two operands; windows out of their domain; a constant volume without a window; a displacement on another grid than
/// its operand; the memory limit; cancellation.
pub fn volumes(
    operands: &[Operand<'_, Volume>],
    params: &CombineParams,
    exec: &Exec,
) -> Result<Combined<Volume>, Error> {
    params.check(operands.len())?;
    let a = operands[0].value;
    exec.check_memory("the combined volume", a.voxels().as_bytes().len() as u64)?;
    exec.run(|| {
        let reads = operands.iter().enumerate();
        let reads = reads.map(|(n, operand)| Read::new(operand, n, a.grid(), params.window(n), exec));
        let reads = reads.collect::<Result<Vec<_>, Error>>()?;
        with_voxels!(a.voxels(), slice => {
            let (voxels, counts) = blend::run(slice, &reads, params.op, exec)?;
            let voxels = Scalar::wrap(voxels.into());
            let output = Volume::with_scale(a.grid().clone(), voxels, a.slope(), a.intercept())?;
            Ok(Combined::new(output, counts, a.grid()))
        })
    })
}

/// Combines labels, 0 standing for none. Union: the first operand's label that isn't 0. Intersection: A's label where no operand
/// has 0. Difference: A's label where all others have 0.
///
/// Classes: those of A; in a union those of the others too whose ids aren't listed yet. An id means the same class in all
/// operands. Sizes are counted anew, other figures of the classes stay.
///
/// # Errors
/// Less than two operands; windows, which labels have no use for; a displacement on another grid than its operand; the memory
/// limit; cancellation.
pub fn labels(
    operands: &[Operand<'_, Labels>],
    params: &CombineParams,
    exec: &Exec,
) -> Result<Combined<Labels>, Error> {
    check_windowless(params, operands.len(), "labels")?;
    let grid = operands[0].value.grid();
    exec.check_memory("the combined labels", 2 * grid.len() as u64)?;
    exec.run(|| {
        let mut places = Vec::new();
        for Operand { value, displacement } in operands {
            let background = f64::from(label_background(value, &WarpParams::default())?);
            places.push(Place::new(grid, value.grid(), *displacement, "labels", background)?);
        }
        // Those with a displacement and a grid of their own.
        let warp = |(operand, place): (&Operand<'_, Labels>, &Place<'_>)| {
            operand.displacement.filter(|_| place.is_elsewhere()).map_or(Ok(None), |displacement| {
                warp::labels(operand.value, displacement, &WarpParams::default(), exec)
                    .map(|w| Some(w.output))
            })
        };
        let warped = operands.iter().zip(&places).map(warp).collect::<Result<Vec<_>, Error>>()?;
        let ids = operands.iter().zip(&warped).map(|(o, w)| w.as_ref().unwrap_or(o.value).ids());
        let (ids, counts) = pick::run(grid, &ids.collect::<Vec<_>>(), &places, params.op, exec)?;
        let classes = pick::classes(operands, params.op, &ids);
        Ok(Combined::new(Labels::new(grid.clone(), ids.into(), classes)?, counts, grid))
    })
}

/// Combines masks, voxel by voxel as Boolean values.
///
/// Where every operand has a level function and lies on A's grid, so has the result: the larger, the smaller, or the smaller of
/// A's and the others' negative. Else it has none.
///
/// # Errors
/// As [`labels`].
pub fn masks(
    operands: &[Operand<'_, Mask>],
    params: &CombineParams,
    exec: &Exec,
) -> Result<Combined<Mask>, Error> {
    check_windowless(params, operands.len(), "masks")?;
    let grid = operands[0].value.grid();
    let with_level = operands.iter().all(|o| o.value.level().is_some() && o.value.grid().matches(grid));
    exec.check_memory("the combined mask", if with_level { 5 } else { 1 } * grid.len() as u64)?;
    exec.run(|| {
        // A level function tells more exactly than the nearest voxel what is inside, so both are needed at once.
        let warp = |o: &Operand<'_, Mask>| {
            let whole = o.displacement.filter(|_| o.value.level().is_some() || !o.value.grid().matches(grid));
            whole.map_or(Ok(None), |d| warp::mask(o.value, d, exec).map(|w| Some(w.output)))
        };
        let warped = operands.iter().map(warp).collect::<Result<Vec<_>, Error>>()?;
        let masks: Vec<&Mask> =
            operands.iter().zip(&warped).map(|(o, w)| w.as_ref().unwrap_or(o.value)).collect();
        let places = operands.iter().zip(&warped).map(|(operand, warped)| {
            let displacement = operand.displacement.filter(|_| warped.is_none());
            Place::new(grid, operand.value.grid(), displacement, "mask", 0.0)
        });
        let places = places.collect::<Result<Vec<_>, Error>>()?;
        let inside: Vec<&[u8]> = masks.iter().map(|mask| mask.inside()).collect();
        let (inside, counts) = pick::run(grid, &inside, &places, params.op, exec)?;
        let mut output = Mask::new(grid.clone(), inside.into())?;
        let levels: Option<Vec<&[f32]>> = masks.iter().map(|mask| mask.level().map(|l| &l[..])).collect();
        if let Some(levels) = levels.filter(|_| with_level) {
            output = output.with_level(pick::level(&levels, params.op).into())?;
        }
        Ok(Combined::new(output, counts, grid))
    })
}

/// Windows are for volumes.
fn check_windowless(params: &CombineParams, operands: usize, what: &str) -> Result<(), Error> {
    params.check(operands)?;
    if params.windows.is_empty() {
        return Ok(());
    }
    let problem = format!("{what} are there or not, and have no opacity");
    Err(ivd_core::ParamError::new("window", problem, "leave it out").into())
}

#[cfg(test)]
mod tests;
