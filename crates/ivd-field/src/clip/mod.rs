//! Clipping: a volume, labels or a mask of which a part is kept, bit for bit, and the rest becomes background.
//!
//! The part is an intersection: of half spaces, of boxes along the world's axes, and of the voxels that a mask or labels tag.
//! A voxel belongs to it where its centre does. Borders belong to it: a centre no further from a plane or a face than a
//! millionth of the smallest spacing lies on it, so that rounding doesn't tell apart voxels in one plane of an oblique grid. Tags
//! on another grid are read at the nearest voxel, by world position; nothing is tagged outside them. With `invert` the rest is
//! kept and the part thrown away, exactly what would be kept otherwise.
//!
//! Data that were deformed already can be clipped by a part of rest space: with a [`Displacement`](ivd_core::Displacement) voxel `y`
//! is kept where its place at rest, `ψ(y)` as [`crate::warp`] reads it, belongs to the part. Voxels that a part of the body left
//! behind (`vacated`) have no place at rest and are left as they are: background of the warp, with or without `invert`. Clipping the deformed data
//! so is deforming the clipped data, but for what interpolation mixes within a voxel of the border.
//!
//! A part that holds no voxel, such as a box beside the volume, is no error: all becomes background.
//!
//! ```
//! use ivd_core::{Exec, Grid, Volume, Voxels};
//! use ivd_field::clip::{self, By, ClipParams, HalfSpace};
//!
//! let grid = Grid::with_spacing([4, 1, 1], [1.0; 3])?;
//! let row = Volume::new(grid, Voxels::from(vec![5_u8, 6, 7, 8]))?;
//! let right = HalfSpace { point: [2.0, 0.0, 0.0], normal: [1.0, 0.0, 0.0] };
//! let params = ClipParams { planes: vec![right], ..ClipParams::default() };
//! let clipped = clip::volume(&row, &params, &By::default(), &Exec::default())?;
//! assert_eq!(clipped.output.voxels().as_bytes(), [5, 5, 7, 8]);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

mod by;
mod kept;
mod params;
mod region;
mod stage;

use ivd_core::{Exec, Grid, Labels, Mask, NO_DATA, ParamError, Scalar, Volume, parallel, with_voxels};
use rayon::prelude::*;

use crate::Error;
use crate::combine::nearest_data;
use crate::warp::{check_grid, recount};
pub use by::{By, Tag};
pub use kept::{Kept, KeptLabels};
pub use params::{ClipParams, Cuboid, HalfSpace};
use region::{Part, Region};
pub(crate) use stage::labelled;
pub use stage::{ClipFigures, Given, STAGE, SceneClip, Whose, any};

/// Clipped data and how much is left.
#[derive(Debug, Clone, PartialEq)]
pub struct Clipped<V> {
    /// The data, background where they were thrown away.
    pub output: V,
    /// Voxels as they were.
    pub voxels_kept: u64,
    /// Voxels that became background.
    pub voxels_clipped: u64,
    /// Voxels of the grid.
    pub voxels_total: u64,
    /// Bricks of 8³ voxels that were looked at voxel by voxel.
    pub bricks_visited: u64,
    /// Bricks of the grid.
    pub bricks_total: u64,
}

/// Clips a volume; see the [module](self).
///
/// Memory: one copy of the voxels.
///
/// # Errors
/// Nothing to clip by; parameters out of their domain; a class without labels, or that none of them has; a displacement on
/// another grid; the memory limit; cancellation.
pub fn volume(
    volume: &Volume,
    params: &ClipParams,
    by: &By<'_>,
    exec: &Exec,
) -> Result<Clipped<Volume>, Error> {
    let region = prepare(volume.grid(), params, by, "volume", exec)?;
    exec.check_memory("the clipped volume", volume.voxels().as_bytes().len() as u64)?;
    exec.run(|| {
        let background = stored_background(volume, params);
        with_voxels!(volume.voxels(), slice => {
            let background = nearest_data(background);
            let (voxels, counts) = run(slice, &region, exec, |_| background)?;
            let voxels = Scalar::wrap(voxels.into());
            let output = Volume::with_scale(volume.grid().clone(), voxels, volume.slope(), volume.intercept())?;
            Ok(Clipped::new(output, counts, volume.grid()))
        })
    })
}

/// Clips labels: what is thrown away becomes the background's label, and sizes of classes follow (means and spreads stay).
///
/// # Errors
/// As [`volume`]; a background that is no label.
pub fn labels(
    labels: &Labels,
    params: &ClipParams,
    by: &By<'_>,
    exec: &Exec,
) -> Result<Clipped<Labels>, Error> {
    let region = prepare(labels.grid(), params, by, "labels", exec)?;
    let background = whole(params.background, u16::MAX, "label", "give an id, 0…65535")?.unwrap_or(NO_DATA);
    exec.check_memory("the clipped labels", 2 * labels.ids().len() as u64)?;
    exec.run(|| {
        let (ids, counts) = run(labels.ids(), &region, exec, |_| background)?;
        let mut classes = labels.classes().to_vec();
        recount(labels.ids(), &ids, &mut classes);
        let output = Labels::new(labels.grid().clone(), ids.into(), classes)?;
        Ok(Clipped::new(output, counts, labels.grid()))
    })
}

/// Clips a mask. Its level function, where it has one, is a voxel beyond the border at least where the mask was thrown away, on
/// the background's side.
///
/// # Errors
/// As [`volume`]; a background that is neither 0 nor 1.
pub fn mask(mask: &Mask, params: &ClipParams, by: &By<'_>, exec: &Exec) -> Result<Clipped<Mask>, Error> {
    let region = prepare(mask.grid(), params, by, "mask", exec)?;
    let inside = whole(params.background, 1, "value of a mask", "give 0 or 1")?.unwrap_or(0) as u8;
    let bytes = if mask.level().is_some() { 5 } else { 1 };
    exec.check_memory("the clipped mask", bytes * mask.grid().len() as u64)?;
    exec.run(|| {
        let (voxels, counts) = run(mask.inside(), &region, exec, |_| inside)?;
        let mut output = Mask::new(mask.grid().clone(), voxels.into())?;
        if let Some(level) = mask.level() {
            let beyond = |level: f32| if inside == 0 { level.min(-1.0) } else { level.max(1.0) };
            output = output.with_level(run(&level[..], &region, exec, beyond)?.0.into())?;
        }
        Ok(Clipped::new(output, counts, mask.grid()))
    })
}

/// The value of what is thrown away of a volume, as a stored one.
fn stored_background(volume: &Volume, params: &ClipParams) -> f64 {
    let real = params.background.or_else(|| volume.range().map(|range| range[0]));
    real.map_or(0.0, |real| volume.stored(real))
}

/// A background that is a whole number up to `most`.
fn whole(
    background: Option<f64>,
    most: u16,
    what: &str,
    remedy: &'static str,
) -> Result<Option<u16>, ParamError> {
    match background {
        Some(value) if value.fract() != 0.0 || !(0.0..=f64::from(most)).contains(&value) => {
            Err(ParamError::new("background", format!("{value} is no {what}"), remedy))
        }
        value => Ok(value.map(|v| v as u16)),
    }
}

/// Checks what is asked for, and gives the part that stays.
fn prepare<'a>(
    grid: &Grid,
    params: &ClipParams,
    by: &By<'a>,
    what: &'static str,
    exec: &Exec,
) -> Result<Region<'a>, Error> {
    params.check()?;
    if params.planes.is_empty() && params.boxes.is_empty() && by.tag.is_none() {
        let problem = "there is nothing to clip by".to_owned();
        return Err(ParamError::new("plane", problem, "give a plane, a box or a tag").into());
    }
    if let Some(displacement) = by.displacement {
        check_grid(grid, displacement, what)?;
    }
    if let Some(class) = params.class {
        let Some(Tag::Labels(labels)) = by.tag else {
            let problem = format!("{class} is a class of no labels");
            return Err(ParamError::new("class", problem, "give labels as the tag, or leave it out").into());
        };
        let occurs = || exec.run(|| labels.ids().par_iter().any(|id| *id == class));
        if labels.class(class).is_none() && !occurs() {
            let problem = format!("no voxel of the tag has label {class}");
            return Err(ParamError::new("class", problem, "give a label that occurs in it").into());
        }
    }
    Ok(Region::new(grid, params, by))
}

/// What a kernel counts.
#[derive(Debug, Clone, Copy, Default)]
struct Counts {
    clipped: u64,
    bricks: u64,
}

impl<V> Clipped<V> {
    fn new(output: V, counts: Counts, grid: &Grid) -> Self {
        let (total, bricks) =
            (grid.len() as u64, grid.dims().iter().map(|n| n.div_ceil(8)).product::<usize>());
        Self {
            output,
            voxels_kept: total - counts.clipped,
            voxels_clipped: counts.clipped,
            voxels_total: total,
            bricks_visited: counts.bricks,
            bricks_total: bricks as u64,
        }
    }
}

/// The voxels with those `discarded` that are thrown away. Bricks that lie wholly on one side are decided at once.
fn run<T: Scalar>(
    voxels: &[T],
    region: &Region<'_>,
    exec: &Exec,
    discarded: impl Fn(T) -> T + Sync,
) -> Result<(Vec<T>, Counts), Error> {
    let [nx, ny, _] = region.dims();
    let mut out = vec![T::default(); voxels.len()];
    let counts = parallel::try_map_pieces_mut(&mut out, 8 * nx * ny, &|bz, out| {
        exec.check_cancelled()?;
        out.copy_from_slice(&voxels[8 * nx * ny * bz..][..out.len()]);
        let mut counts = Counts::default();
        for (by, bx) in (0..ny.div_ceil(8)).flat_map(|by| (0..nx.div_ceil(8)).map(move |bx| (by, bx))) {
            discard(region, [bx, by, bz], exec.skip, out, &discarded, &mut counts);
        }
        Ok::<_, Error>(counts)
    })?;
    let sum = |a: Counts, b: Counts| Counts { clipped: a.clipped + b.clipped, bricks: a.bricks + b.bricks };
    Ok((out, counts.into_iter().fold(Counts::default(), sum)))
}

/// Discards what isn't kept of a brick.
///
/// - `out`: the slab of eight slices that it lies in.
fn discard<T: Scalar>(
    region: &Region<'_>,
    [bx, by, bz]: [usize; 3],
    skip: bool,
    out: &mut [T],
    discarded: &impl Fn(T) -> T,
    counts: &mut Counts,
) {
    let [nx, ny, nz] = region.dims();
    let part = if skip { region.brick([bx, by, bz]) } else { Part::Some };
    counts.bricks += u64::from(part == Part::Some);
    if part == Part::All {
        return;
    }
    for (z, y) in (8 * bz..nz.min(8 * bz + 8)).flat_map(|z| (8 * by..ny.min(8 * by + 8)).map(move |y| (z, y)))
    {
        for x in 8 * bx..nx.min(8 * bx + 8) {
            if part == Part::None || !region.keeps([x, y, z]) {
                let value = &mut out[x + nx * (y + ny * (z - 8 * bz))];
                *value = discarded(*value);
                counts.clipped += 1;
            }
        }
    }
}

#[cfg(test)]
mod tests;
