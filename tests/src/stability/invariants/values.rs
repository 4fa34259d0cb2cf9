//! Warped volumes, labels and masks.

use ivd_core::{Displacement, Labels, Mask, Scalar, Volume, VoxelCoord, VoxelIndex, VoxelType, with_voxels};
use ivd_field::warp::{Order, WarpParams, Warped};
use nalgebra::Vector3;

use super::segments::stored;
use super::{EPS, Verdict};
use crate::hold;

/// Fraction of the range by which a value may differ from the plain twin's: the warp takes a place within 2⁻¹⁷ voxel of a
/// centre for that centre, on each axis.
const SNAPPED: f64 = 3.0 / 131_072.0;

/// A warped volume: the input bit for bit where nothing moved, else a value between the input's, which a plain trilinear
/// sum confirms; a voxel without data is only where it was, never made.
///
/// # Errors
/// The first voxel that doesn't fit.
pub fn warped(volume: &Volume, moved: &Displacement, params: &WarpParams, found: &Warped<Volume>) -> Verdict {
    let (before, after) = (volume.voxels(), found.output.voxels());
    let grid = volume.grid();
    hold!(before.voxel_type() == after.voxel_type() && found.output.grid() == grid, "another type or grid");
    let size = before.voxel_type().bytes();
    let same = |i: usize| before.as_bytes()[i * size..][..size] == after.as_bytes()[i * size..][..size];
    let values = stored(volume);
    let low = values.iter().flatten().copied().fold(f64::INFINITY, f64::min);
    let high = values.iter().flatten().copied().fold(f64::NEG_INFINITY, f64::max);
    let background = params.background.map(|v| with_voxels!(before, s => rounded(s, volume.stored(v))));
    // Eight weights that sum to 1 but for rounding, each product rounded too; single precision and integers hide it.
    let most = low.abs().max(high.abs());
    let slack =
        if before.voxel_type() == VoxelType::F64 { 8.0 * EPS * most + 8.0 * f64::from_bits(1) } else { 0.0 };
    let to_voxel = grid.inverse_linear_part();
    for i in 0..grid.len() {
        let voxel = grid.index(i);
        let (vector, vacated) = (moved.inverse().at(voxel), moved.vacated().get(i).is_some_and(|v| *v != 0));
        if vector == [0.0; 3] && !vacated {
            hold!(same(i), "voxel {:?} didn't move and changed", voxel.0);
            continue;
        }
        let got = after.get(i);
        if values.iter().all(Option::is_none) {
            continue;
        }
        hold!(got.is_finite(), "voxel {:?} became {got}", voxel.0);
        if params.order == Order::Cubic {
            continue;
        }
        hold!(
            (low - slack..=high + slack).contains(&got) || Some(got) == background,
            "voxel {:?}: {got} of {low}…{high}",
            voxel.0
        );
        let x = VoxelCoord::from(voxel).0 + to_voxel * Vector3::from(vector).map(f64::from);
        if !vacated
            && params.order == Order::Linear
            && let Some(expected) = trilinear(volume, &values, x)
        {
            let rounding = if before.voxel_type().is_integer() { 0.5 } else { 1e-6 * most };
            let off = (got - expected).abs();
            let limit = rounding + (SNAPPED + 1e-9) * (high - low) + slack;
            hold!(off <= limit, "voxel {:?} became {got}, plainly {expected}", voxel.0);
        }
    }
    Ok(())
}

fn rounded<T: Scalar>(_: &[T], value: f64) -> f64 {
    T::from_f64(value).to_f64()
}

/// The trilinear sum of the eight voxels round a place well inside the volume, where all of them hold data.
fn trilinear(volume: &Volume, values: &[Option<f64>], x: Vector3<f64>) -> Option<f64> {
    let dims = volume.grid().dims();
    if (0..3).any(|a| x[a] < 0.0 || x[a] > (dims[a] - 1) as f64) {
        return None;
    }
    let base = x.map(f64::floor);
    (0..8_usize).try_fold(0.0, |sum, corner| {
        let offset = Vector3::from_fn(|a, _| (corner >> a & 1) as f64);
        let at: [usize; 3] = std::array::from_fn(|a| ((base[a] + offset[a]) as usize).min(dims[a] - 1));
        let weight: f64 = (0..3).map(|a| 1.0 - (x[a] - base[a] - offset[a]).abs()).product();
        Some(sum + weight * values[volume.grid().linear(VoxelIndex(at))]?)
    })
}

/// Warped labels: no label that wasn't there, classes that count themselves, the input where nothing moved.
///
/// # Errors
/// The first thing that doesn't fit.
pub fn labels(labels: &Labels, moved: &Displacement, found: &Warped<Labels>) -> Verdict {
    let lowest = labels.classes().first().map_or(0, |c| c.id);
    for (i, (&before, &after)) in labels.ids().iter().zip(found.output.ids()).enumerate() {
        let known = after == lowest || labels.ids().contains(&after);
        hold!(known, "voxel {i} got the new label {after}");
        if moved.is_identity() {
            hold!(before == after, "voxel {i} didn't move and changed");
        }
    }
    for class in found.output.classes() {
        let count = found.output.ids().iter().filter(|id| **id == class.id).count() as u64;
        hold!(class.voxels == count, "class {} counts {} of {count}", class.id, class.voxels);
    }
    Ok(())
}

/// A warped mask: 0 and 1, the input where nothing moved.
///
/// # Errors
/// The first thing that doesn't fit.
pub fn mask(mask: &Mask, moved: &Displacement, found: &Warped<Mask>) -> Verdict {
    for i in 0..mask.grid().len() {
        let (before, after) = (mask.inside()[i], found.output.inside()[i]);
        let still = moved.inverse().at(mask.grid().index(i)) == [0.0; 3] && moved.vacated().is_empty();
        hold!(after <= 1 && (!still || before == after), "voxel {i}: {before} became {after}");
    }
    Ok(())
}
