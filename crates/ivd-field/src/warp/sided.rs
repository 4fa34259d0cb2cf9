//! Reading beside a cut: voxels of the other side take no part.

use ivd_core::{Displacement, Scalar, VoxelIndex};

use super::Order;
use super::sample::{Source, split};

/// [`Source::sample`] for a deformed voxel that comes from `x` (voxels). Where the eight voxels round `x` lie on both sides of a cut, those
/// of the side that the voxel comes from count alone: the nearest of them, or, in the other orders, their trilinear weights made to sum to 1.
pub(super) fn sample<T: Scalar>(
    source: &Source<'_, T>,
    displacement: &Displacement,
    voxel: VoxelIndex,
    x: [f64; 3],
    order: Order,
) -> Option<f64> {
    let sides = displacement.sides();
    let own = if sides.is_empty() { 0 } else { sides[displacement.grid().linear(voxel)] >> 2 };
    let inside = (0..3).all(|a| (-0.5..source.dims[a] as f64 - 0.5).contains(&x[a]));
    if own == 0 || !inside {
        return source.sample(x, order);
    }
    let taps = corners(source.dims, x);
    let counts = |at: usize| [0, own].contains(&(sides[at] & 3));
    if taps.iter().all(|(at, _)| counts(*at)) || !taps.iter().any(|(at, _)| counts(*at)) {
        return source.sample(x, order);
    }
    let mine = taps.iter().filter(|(at, _)| counts(*at));
    let total: f64 = mine.clone().map(|(_, weight)| weight).sum();
    if order == Order::Nearest || total == 0.0 {
        // The heaviest corner is the nearest; of equals the first.
        let (at, _) = mine.reduce(|best, other| if other.1 > best.1 { other } else { best })?;
        let value = source.voxels[*at];
        return value.is_data().then(|| value.to_f64());
    }
    let mut sum = 0.0;
    for (at, weight) in mine.filter(|(_, weight)| *weight > 0.0) {
        let value = source.voxels[*at];
        if !value.is_data() {
            return None;
        }
        sum += weight / total * value.to_f64();
    }
    Some(sum)
}

/// The eight voxels round a place, by their linear index, with their trilinear weights.
fn corners(dims: [usize; 3], x: [f64; 3]) -> [(usize, f64); 8] {
    let [(bx, tx), (by, ty), (bz, tz)] = std::array::from_fn(|a| split(x[a], dims[a]));
    std::array::from_fn(|i| {
        let up = [i & 1, i >> 1 & 1, i >> 2];
        let at =
            [(bx + up[0]).min(dims[0] - 1), (by + up[1]).min(dims[1] - 1), (bz + up[2]).min(dims[2] - 1)];
        let weight = |up: usize, t: f64| if up == 1 { t } else { 1.0 - t };
        (
            at[0] + dims[0] * (at[1] + dims[1] * at[2]),
            weight(up[0], tx) * weight(up[1], ty) * weight(up[2], tz),
        )
    })
}
