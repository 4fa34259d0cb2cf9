use ivd_core::op::Op as _;
use ivd_core::{Displacement, Exec, Labels, Mask, NO_DATA, ParamError};

use super::{Order, WarpParams, Warped, check_grid, for_each_moved, resample, sided};
use crate::Error;
use crate::warp::sample::Source;

/// Carries labels through a displacement: nearest label, class sizes recounted (means and spreads are the rest
/// volume's: labels alone don't know values).
///
/// # Errors
/// Labels on another grid than the displacement; parameters out of their domain; the memory limit; cancellation.
pub fn labels(
    labels: &Labels,
    displacement: &Displacement,
    params: &WarpParams,
    exec: &Exec,
) -> Result<Warped<Labels>, Error> {
    params.check()?;
    check_grid(labels.grid(), displacement, "labels")?;
    exec.check_memory("the deformed labels", 2 * labels.ids().len() as u64)?;
    let background = label_background(labels, params)?;
    exec.run(|| {
        let grid = labels.grid();
        let (ids, count) =
            resample((grid, None), labels.ids(), displacement, Order::Nearest, f64::from(background), exec)?;
        let mut classes = labels.classes().to_vec();
        recount(labels.ids(), &ids, &mut classes);
        let output = Labels::new(grid.clone(), ids.into(), classes)?;
        Ok(Warped { output, voxels_resampled: count, voxels_total: grid.len() as u64 })
    })
}

/// Share of the voxels that are 0, at least, where 0 is what lies about the parts and not a few voxels without data.
const ABOUT: f64 = 0.01;

/// Whether the labels are parts in what is no part: then nothing else comes from outside.
fn have_nothing_about(labels: &Labels) -> bool {
    use rayon::prelude::*;
    let none = labels.ids().par_iter().filter(|id| **id == NO_DATA).count();
    none > 0 && none as f64 >= ABOUT * labels.ids().len() as f64
}

pub(crate) fn label_background(labels: &Labels, params: &WarpParams) -> Result<u16, Error> {
    match params.background {
        None if have_nothing_about(labels) => Ok(NO_DATA),
        None => {
            let lowest =
                labels.classes().iter().filter(|c| c.id != NO_DATA).min_by(|a, b| a.mean.total_cmp(&b.mean));
            Ok(lowest.map_or(NO_DATA, |c| c.id))
        }
        Some(id) if id.fract() == 0.0 && (0.0..=f64::from(u16::MAX)).contains(&id) => Ok(id as u16),
        Some(id) => {
            Err(ParamError::new("background", format!("{id} is no label"), "give an id, 0…65535").into())
        }
    }
}

/// Adds what changed to the classes' sizes, so that sizes that were counted over a part only stay what they were there.
pub(crate) fn recount(before: &[u16], after: &[u16], classes: &mut [ivd_core::Class]) {
    use rayon::prelude::*;
    let changes: Vec<Vec<(u16, u16)>> = before
        .par_chunks(1 << 16)
        .zip(after.par_chunks(1 << 16))
        .map(|(b, a)| b.iter().zip(a).filter(|(b, a)| a != b).map(|(&b, &a)| (b, a)).collect())
        .collect();
    let mut delta = vec![0_i64; 1 << 16];
    for (b, a) in changes.into_iter().flatten() {
        delta[usize::from(b)] -= 1;
        delta[usize::from(a)] += 1;
    }
    for class in classes {
        class.voxels = class.voxels.saturating_add_signed(delta[usize::from(class.id)]);
    }
}

/// Carries a mask through a displacement: nearest voxel; where the mask has a level function that is interpolated
/// linearly, and its sign says what is inside. What was left behind is outside.
///
/// # Errors
/// A mask on another grid than the displacement; the memory limit; cancellation.
pub fn mask(mask: &Mask, displacement: &Displacement, exec: &Exec) -> Result<Warped<Mask>, Error> {
    /// Level (voxels) of a voxel that was left behind or came from outside the volume.
    const OUTSIDE: f32 = -1.0;
    let grid = mask.grid();
    check_grid(grid, displacement, "mask")?;
    let bytes = if mask.level().is_some() { 5 } else { 1 };
    exec.check_memory("the deformed mask", bytes * grid.len() as u64)?;
    exec.run(|| {
        let (mut inside, count) =
            resample((grid, None), mask.inside(), displacement, Order::Nearest, 0.0, exec)?;
        let mut output = None;
        if let Some(level) = mask.level() {
            let source = Source { voxels: &level[..], dims: grid.dims() };
            let mut levels = level.to_vec();
            for_each_moved(grid, displacement, &mut levels, exec, |voxel, place| {
                place
                    .and_then(|x| sided::sample(&source, displacement, voxel, x, Order::Linear))
                    .map_or(OUTSIDE, |v| v as f32)
            })?;
            for (v, new) in levels.iter().enumerate() {
                let changed = new.to_bits() != level[v].to_bits() || inside[v] != mask.inside()[v];
                if changed && *new != 0.0 {
                    inside[v] = u8::from(*new > 0.0);
                }
            }
            output = Some(levels);
        }
        let mut warped = Mask::new(grid.clone(), inside.into())?;
        if let Some(levels) = output {
            warped = warped.with_level(levels.into())?;
        }
        Ok(Warped { output: warped, voxels_resampled: count, voxels_total: grid.len() as u64 })
    })
}
