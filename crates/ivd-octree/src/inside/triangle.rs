//! One triangle against the rows of voxels that pass through its shadow.

use std::ops::Range;

use ivd_core::Lattice;

/// Bits after the point of a fixed-point coordinate (voxels).
pub(super) const FRACTION: u32 = 34;
const ONE: f64 = (1_u64 << FRACTION) as f64;

/// A vertex in fixed point: multiples of 2⁻³⁴ voxel.
pub(super) type Fixed = [i64; 3];

/// The vertices in fixed point. An `f32` in `[MIN_EDGE_FRACTION, 1 - MIN_EDGE_FRACTION]` is such a multiple; a vertex within a face or a cell
/// may move by 2⁻³⁵ voxel.
pub(super) fn fixed_vertex(lattice: &Lattice, vertex: u32) -> Fixed {
    let voxel = lattice.keys()[vertex as usize].voxel(lattice.grid().dims());
    let place = lattice.places()[vertex as usize];
    std::array::from_fn(|a| (voxel[a] << FRACTION) + (f64::from(place[a]) * ONE).round_ties_even() as i64)
}

/// Calls `hit(y, z, x, sign)` for each row of voxel centres that crosses the triangle: `x` is the first voxel not
/// before the crossing, within `0 ..= dims[0]`; `sign` tells the side from which the ray comes. `wanted`: ranges of y and z.
pub(super) fn crossings(
    corners: [Fixed; 3],
    dims: [usize; 3],
    wanted: &[Range<usize>; 2],
    mut hit: impl FnMut(usize, usize, usize, i64),
) {
    let rows = |axis: usize| {
        let [a, b, c] = corners.map(|corner| corner[axis]);
        let first = ceil(a.min(b).min(c)).max(wanted[axis - 1].start as i64);
        let last = floor(a.max(b).max(c)).min(dims[axis].min(wanted[axis - 1].end) as i64 - 1);
        first..=last
    };
    for z in rows(2) {
        for y in rows(1) {
            let weights = edge_functions(corners, [y << FRACTION, z << FRACTION]);
            if let Some((weights, sign)) = weights {
                let x = crossing(corners, weights).clamp(0, dims[0] as i64);
                hit(y as usize, z as usize, x as usize, sign);
            }
        }
    }
}

/// Edge functions of the triangle's shadow on the y–z plane at a point moved by (ε, ε²), each opposite its corner; and
/// the turn of the shadow. `None` where the moved point isn't in it.
fn edge_functions(corners: [Fixed; 3], point: [i64; 2]) -> Option<([i128; 3], i64)> {
    let mut weights = [0; 3];
    let mut winding = 0;
    for (i, weight) in weights.iter_mut().enumerate() {
        let (a, b) = (corners[(i + 1) % 3], corners[(i + 2) % 3]);
        *weight = edge_function(a, b, point);
        // The point is moved up along z: an end on its level lies below it.
        let (a_below, b_below) = (a[2] <= point[1], b[2] <= point[1]);
        if a_below && !b_below {
            // Going up with the point strictly to its left in y. A point on it is moved to its right, along y.
            winding += i64::from(*weight > 0);
        } else if b_below && !a_below {
            winding -= i64::from(*weight < 0);
        }
    }
    (winding != 0).then_some((weights, winding))
}

/// Twice the signed area of (a, b, point) in the y–z plane, exact: differences have at most 57 bits.
fn edge_function(a: Fixed, b: Fixed, point: [i64; 2]) -> i128 {
    let wide = |v: i64, w: i64| i128::from(v - w);
    wide(b[1], a[1]) * wide(point[1], a[2]) - wide(b[2], a[2]) * wide(point[0], a[1])
}

/// First voxel centre at or after the place where the row crosses the triangle's plane. The weights are exact and none
/// is of the wrong sign, so the place is right to 10⁻¹⁵ of the triangle's size.
fn crossing(corners: [Fixed; 3], weights: [i128; 3]) -> i64 {
    let area: i128 = weights.iter().sum();
    let share = |i: usize| weights[i] as f64 / area as f64;
    let base = corners[0][0];
    let offset = share(1) * (corners[1][0] - base) as f64 + share(2) * (corners[2][0] - base) as f64;
    let low = corners.iter().map(|c| c[0]).min().unwrap_or(base);
    let high = corners.iter().map(|c| c[0]).max().unwrap_or(base);
    ceil((base + offset.round_ties_even() as i64).clamp(low, high))
}

fn floor(fixed: i64) -> i64 {
    fixed >> FRACTION
}

fn ceil(fixed: i64) -> i64 {
    -(-fixed >> FRACTION)
}
