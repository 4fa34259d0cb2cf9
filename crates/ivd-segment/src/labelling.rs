//! The pass that gives each voxel its label.

use ivd_core::{Error, Exec, Mask, NO_DATA, Scalar, Voxels, with_voxels};
use rayon::prelude::*;

use crate::histogram::{Tabled, with_tabled};

/// Voxels that one task labels.
const CHUNK: usize = 1 << 16;

/// Labels by the group of each stored value: `ids(g)` for a value with `g` of the ascending `cuts` at or below it.
pub(crate) fn of(
    voxels: &Voxels,
    mask: Option<&Mask>,
    cuts: &[f64],
    ids: &[u16],
    exec: &Exec,
) -> Result<Vec<u16>, Error> {
    exec.check_cancelled()?;
    exec.check_memory("the labels", voxels.len() as u64 * 2)?;
    let labels = with_tabled!(voxels, slice => by_table(slice, mask, cuts, ids), else {
        with_voxels!(voxels, slice => by_cuts(slice, mask, cuts, ids))
    });
    exec.check_cancelled()?;
    Ok(labels)
}

fn id_of(value: f64, cuts: &[f64], ids: &[u16]) -> u16 {
    ids.get(cuts.partition_point(|cut| *cut <= value)).copied().unwrap_or(NO_DATA)
}

fn by_table<T: Tabled>(voxels: &[T], mask: Option<&Mask>, cuts: &[f64], ids: &[u16]) -> Vec<u16> {
    let table: Vec<u16> =
        (0..T::VALUES).map(|slot| id_of((T::LOWEST + slot as i64) as f64, cuts, ids)).collect();
    each(voxels, mask, |v| table[v.slot()])
}

fn by_cuts<T: Scalar>(voxels: &[T], mask: Option<&Mask>, cuts: &[f64], ids: &[u16]) -> Vec<u16> {
    each(voxels, mask, |v| if v.is_data() { id_of(v.to_f64(), cuts, ids) } else { NO_DATA })
}

fn each<T: Scalar>(voxels: &[T], mask: Option<&Mask>, label: impl Fn(T) -> u16 + Sync + Send) -> Vec<u16> {
    let voxels = voxels.par_iter().with_min_len(CHUNK);
    match mask {
        None => voxels.map(|&v| label(v)).collect(),
        Some(mask) => voxels
            .zip(mask.inside())
            .map(|(&v, &inside)| if inside == 0 { NO_DATA } else { label(v) })
            .collect(),
    }
}
