//! Labels of the voxels, from the basins of their cells.

use ivd_core::{Error, Exec, Mask, NO_DATA, Scalar, SpillVec, Volume, parallel, with_voxels};
use rayon::prelude::*;

use super::ascent::{Basins, NO_BASIN};
use super::cells::Cells;
use super::modes::Peaks;
use crate::classes::{self, Described};
use crate::histogram::{Tabled, with_tabled};
use crate::labelling;

/// Rows of voxels that one task labels.
const ROWS: usize = 16;

/// Labels by class, and the classes.
pub(super) fn voxels(
    volume: &Volume,
    mask: Option<&Mask>,
    cells: &Cells,
    basins: &Basins,
    peaks: &Peaks,
    exec: &Exec,
) -> Result<Described, Error> {
    let modes: Vec<u16> = basins
        .of
        .par_iter()
        .map(|basin| if *basin == NO_BASIN { NO_DATA } else { peaks.of[*basin as usize] + 1 })
        .collect();
    if cells.dims[..3] == [1; 3] {
        return intervals(volume, mask, cells, &modes, peaks.kept.len(), exec);
    }
    let mut ids = exec.bulk::<u16>("the labels", volume.grid().len())?;
    with_tabled!(volume.voxels(), slice => {
        let table = cells.table(volume, slice);
        rows(volume, slice, mask, cells, &modes, &mut ids, exec, |v| table[v.slot()])
    }, else with_voxels!(volume.voxels(), slice => {
        rows(volume, slice, mask, cells, &modes, &mut ids, exec, |v| cells.place(volume, v))
    }))?;
    classes::by_mean(volume, ids, peaks.kept.len(), exec)
}

#[expect(clippy::too_many_arguments, reason = "one loop over what the method has found")]
fn rows<T: Scalar>(
    volume: &Volume,
    voxels: &[T],
    mask: Option<&Mask>,
    cells: &Cells,
    modes: &[u16],
    ids: &mut SpillVec<u16>,
    exec: &Exec,
    place: impl Fn(T) -> u32 + Sync,
) -> Result<(), Error> {
    let [nx, ny, _] = volume.grid().dims();
    let range = cells.dims[3];
    let chunk = ROWS * nx;
    parallel::try_for_each_piece_mut(ids, chunk, &|i, ids| {
        exec.check_cancelled()?;
        let voxels = &voxels[i * chunk..][..ids.len()];
        for (j, (ids, voxels)) in ids.chunks_mut(nx).zip(voxels.chunks(nx)).enumerate() {
            let row = i * ROWS + j;
            let [y, z] = [row % ny / cells.edge[1], row / ny / cells.edge[2]];
            let first = cells.dims[0] * (y + cells.dims[1] * z);
            let edge = cells.edge[0];
            for (x, (ids, voxels)) in ids.chunks_mut(edge).zip(voxels.chunks(edge)).enumerate() {
                let modes = &modes[(first + x) * range..][..range];
                for (id, v) in ids.iter_mut().zip(voxels) {
                    *id = modes.get(place(*v) as usize).copied().unwrap_or(NO_DATA);
                }
            }
            if let Some(mask) = mask {
                let inside = &mask.inside()[row * nx..][..nx];
                ids.iter_mut().zip(inside).for_each(|(id, inside)| *id *= u16::from(*inside));
            }
        }
        Ok::<_, Error>(())
    })
}

/// The same on values alone: classes are intervals, which meet where one cell ends and the next begins.
fn intervals(
    volume: &Volume,
    mask: Option<&Mask>,
    cells: &Cells,
    modes: &[u16],
    kept: usize,
    exec: &Exec,
) -> Result<Described, Error> {
    let reached: Vec<usize> = (0..modes.len()).filter(|c| modes[*c] != NO_DATA).collect();
    let changes: Vec<[usize; 2]> =
        reached.windows(2).filter(|w| modes[w[0]] != modes[w[1]]).map(|w| [w[0], w[1]]).collect();
    // Between basins that don't touch, the middle of what lies between; else the border of the two cells.
    let cuts: Vec<f64> = changes
        .iter()
        .map(|[a, b]| cells.range.value(*a as f64 + 0.5).midpoint(cells.range.value(*b as f64 - 0.5)))
        .collect();
    let first = reached.first().map(|c| modes[*c]);
    let mut ids: Vec<u16> = first.into_iter().chain(changes.iter().map(|[_, b]| modes[*b])).collect();
    let falling = volume.slope() < 0.0;
    // A value on a cut belongs above it, in real values; stored ones may run the other way.
    let stored = |cut: &f64| if falling { volume.stored(*cut).next_up() } else { volume.stored(*cut) };
    let mut bounds: Vec<f64> = cuts.iter().map(stored).collect();
    if falling {
        bounds.reverse();
        ids.reverse();
    }
    let labels = labelling::of(volume.voxels(), mask, &bounds, &ids, exec)?;
    let mut found = classes::by_mean(volume, labels, kept, exec)?;
    for above in 1..found.classes.len() {
        let [low, high] = [found.classes[above - 1].mean, found.classes[above].mean];
        if let Some(cut) = cuts.iter().find(|cut| low < **cut && **cut <= high) {
            found.classes[above - 1].upper = Some(*cut);
            found.classes[above].lower = Some(*cut);
        }
    }
    Ok(found)
}
