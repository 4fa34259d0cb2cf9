//! What a picture holds at zoom 1, and how far the camera then shows to either side.

use ivd_core::{BRICK, BrickIndex, Grid};
use nalgebra::Vector3;

/// Part of the shorter side that stays free at every edge of a picture that holds what is seen: there is room for letters.
const MARGIN: f64 = 0.04;
/// Part of the range of values that a projection shows so dark that it isn't held.
pub(crate) const DARK: f64 = 0.05;

/// What a picture holds at zoom 1.
pub(crate) enum Held {
    /// The sphere round the volume, across the shorter side.
    Volume,
    /// These places, from the middle of the volume on [mm]; at least one.
    Places(Vec<Vector3<f64>>),
}

impl Held {
    /// The corners of the bricks that are seen, and further places from the middle of the volume on [mm]; the volume where nothing is seen.
    pub(crate) fn of_bricks(grid: &Grid, seen: &[bool], more: Vec<Vector3<f64>>) -> Self {
        let dims = grid.dims();
        let [across, ..] = BrickIndex::dims_for(dims);
        let mut places = more;
        for (row, seen) in seen.chunks(across).enumerate() {
            let first = seen.iter().position(|&seen| seen);
            let last = seen.iter().rposition(|&seen| seen);
            // What lies between the two ends of a row lies within the hull of their corners.
            if let (Some(first), Some(last)) = (first, last) {
                places.extend(corners(grid, row, [first, last]));
            }
        }
        if places.is_empty() { Self::Volume } else { Self::Places(places) }
    }
}

/// Corners of the bricks from one of a row to another, from the middle of the volume on [mm]. A brick's samples reach to the first voxel of the next, at the volume's faces
/// half a voxel further.
fn corners(grid: &Grid, row: usize, [first, last]: [usize; 2]) -> impl Iterator<Item = Vector3<f64>> {
    let (dims, linear) = (grid.dims(), grid.linear_part());
    let [_, rows, _] = BrickIndex::dims_for(dims);
    let low = [first, row % rows, row / rows];
    let high = [last, row % rows, row / rows];
    let end = move |a: usize, is_high: bool| {
        if is_high {
            let to = (high[a] + 1) * BRICK;
            if to >= dims[a] { dims[a] as f64 - 0.5 } else { to as f64 }
        } else {
            (low[a] * BRICK) as f64 - if low[a] == 0 { 0.5 } else { 0.0 }
        }
    };
    let middle = move |a: usize| 0.5 * (dims[a] - 1) as f64;
    // Differences first: an origin 10⁶ mm away costs no precision.
    (0..8_usize).map(move |corner| linear * Vector3::from_fn(|a, _| end(a, corner >> a & 1 == 1) - middle(a)))
}

/// Places as the camera sees them: extents along the picture's right and up and towards the eye [mm].
pub(crate) struct Extents {
    low: Vector3<f64>,
    high: Vector3<f64>,
}

impl Extents {
    /// Those of places along three unit directions.
    pub(crate) fn new(places: &[Vector3<f64>], axes: [Vector3<f64>; 3]) -> Self {
        let along = |p: &Vector3<f64>| Vector3::from_fn(|a, _| axes[a].dot(p));
        let (mut low, mut high) = (Vector3::repeat(f64::INFINITY), Vector3::repeat(f64::NEG_INFINITY));
        for place in places {
            let at = along(place);
            (low, high) = (low.inf(&at), high.sup(&at));
        }
        Self { low, high }
    }

    /// The middle, along the axes.
    pub(crate) fn middle(&self) -> Vector3<f64> {
        0.5 * (self.low + self.high)
    }

    /// Half of the width and of the height [mm].
    pub(crate) fn half(&self) -> [f64; 2] {
        let half = 0.5 * (self.high - self.low);
        [half.x, half.y]
    }
}

/// Size of a pixel at which so much to either side of the picture's middle fits [mm].
pub(crate) fn pixel(half: [f64; 2], size: [usize; 2]) -> f64 {
    let free = 2.0 * MARGIN * size[0].min(size[1]) as f64;
    let needed = |a: usize| 2.0 * half[a] / (size[a] as f64 - free);
    needed(0).max(needed(1))
}
