//! Voxels, means and spreads of the leaves.

use ivd_core::{Error, Exec, LeafMeans, Scalar, SpillVec, Volume, parallel};

use crate::moments::Frame;

/// Voxels that one task looks at.
const CHUNK: usize = 1 << 16;

/// Figures of the leaves, real units; leaf `i + 1` is at `i`.
pub(super) struct Figures {
    pub(super) counts: SpillVec<u32>,
    pub(super) means: LeafMeans,
    /// `None` where every leaf has one value.
    pub(super) squares: Option<SpillVec<f64>>,
}

/// The leaf of every voxel, 1 to `count`; 0 for none.
pub(super) struct Leaves<'a, T> {
    pub(super) volume: &'a Volume,
    pub(super) voxels: &'a [T],
    pub(super) ids: &'a [u32],
    pub(super) count: usize,
}

/// Figures of leaves of one value each.
pub(super) fn flat<T: Scalar>(of: &Leaves<'_, T>, exec: &Exec) -> Result<Figures, Error> {
    let Leaves { volume, voxels, ids: leaves, count } = *of;
    let real = |v: T| volume.real(v.to_f64()).clamp(f64::MIN, f64::MAX);
    let pieces = parallel::pieces(voxels.len(), CHUNK);
    let short = parallel::try_for_each(pieces, &|i| {
        let piece = parallel::piece(voxels.len(), CHUNK, i);
        let mut pairs = voxels[piece.clone()].iter().zip(&leaves[piece]);
        let fits = pairs.all(|(v, leaf)| *leaf == 0 || f64::from(real(*v) as f32) == real(*v));
        if fits { Ok(()) } else { Err(()) }
    });
    let short = short.is_ok();
    let mut counts: SpillVec<u32> = exec.bulk("the sizes of the leaves", count)?;
    let means = if short {
        let mut means: SpillVec<f32> = exec.bulk("the means of the leaves", count)?;
        each(voxels, leaves, exec, |leaf, v| {
            counts[leaf] += 1;
            if counts[leaf] == 1 {
                means[leaf] = real(v) as f32;
            }
        })?;
        LeafMeans::F32(means.into_buffer())
    } else {
        let mut means: SpillVec<f64> = exec.bulk("the means of the leaves", count)?;
        each(voxels, leaves, exec, |leaf, v| {
            counts[leaf] += 1;
            means[leaf] = real(v);
        })?;
        LeafMeans::F64(means.into_buffer())
    };
    Ok(Figures { counts, means, squares: None })
}

/// Figures of leaves of any values: the means first, then the deviations from them, in the order of the voxels.
pub(super) fn spread<T: Scalar>(of: &Leaves<'_, T>, exec: &Exec) -> Result<Figures, Error> {
    let Leaves { volume, voxels, ids: leaves, count } = *of;
    let mut counts: SpillVec<u32> = exec.bulk("the sizes of the leaves", count)?;
    each(voxels, leaves, exec, |leaf, _| counts[leaf] += 1)?;
    let mut means: SpillVec<f64> = exec.bulk("the means of the leaves", count)?;
    // Stored values are summed from one of their leaf on: whole numbers stay exact, and offsets don't cost digits.
    let mut first: SpillVec<f64> = exec.bulk("a value of each leaf", count)?;
    each(voxels, leaves, exec, |leaf, v| first[leaf] = v.to_f64())?;
    let scale = Frame::of(volume).scale();
    each(voxels, leaves, exec, |leaf, v| {
        means[leaf] += (v.to_f64() / 2.0 - first[leaf] / 2.0) * (2.0 * scale);
    })?;
    for leaf in 0..count {
        let beyond = means[leaf] / f64::from(counts[leaf]) / scale;
        means[leaf] = volume.real(first[leaf] + beyond).clamp(f64::MIN, f64::MAX);
    }
    drop(first);
    let mut squares: SpillVec<f64> = exec.bulk("the spreads of the leaves", count)?;
    each(voxels, leaves, exec, |leaf, v| {
        let deviation = volume.real(v.to_f64()) - means[leaf];
        squares[leaf] = (squares[leaf] + deviation * deviation).min(f64::MAX);
    })?;
    let flat = squares.iter().all(|s| *s == 0.0);
    Ok(Figures { counts, means: LeafMeans::F64(means.into_buffer()), squares: (!flat).then_some(squares) })
}

/// Calls `look` with the leaf, from 0, and the value of each voxel that has one.
fn each<T: Scalar>(
    voxels: &[T],
    leaves: &[u32],
    exec: &Exec,
    mut look: impl FnMut(usize, T),
) -> Result<(), Error> {
    for (voxels, leaves) in voxels.chunks(CHUNK).zip(leaves.chunks(CHUNK)) {
        exec.check_cancelled()?;
        for (v, leaf) in voxels.iter().zip(leaves) {
            if *leaf > 0 {
                look(*leaf as usize - 1, *v);
            }
        }
    }
    Ok(())
}
