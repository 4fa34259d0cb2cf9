//! What a picture holds at zoom 1, and how far the camera then shows to either side.

use std::f64::consts::{PI, TAU};

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
    /// These places, from the middle of the volume on (mm); at least one.
    Places(Vec<Vector3<f64>>),
}

impl Held {
    /// The corners of the bricks that are seen, and further places from the middle of the volume on (mm); the volume where nothing is seen.
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

/// Layers that what is turned is thought to be cut into, and the least corners of the rings about each.
const LAYERS: usize = 64;
const CORNERS: usize = 64;

impl Held {
    /// What is held while it is turned about an axis along the world's z through its middle, by so many equal turns: the same is seen after each of them.
    pub(crate) fn turned(self, turns: usize) -> Self {
        let Self::Places(places) = self else { return self };
        let extents = Extents::new(&places, [Vector3::x(), Vector3::y(), Vector3::z()]);
        let (axis, bottom) = (extents.middle(), extents.low.z);
        let height = (extents.high.z - bottom).max(f64::MIN_POSITIVE);
        // Of every layer its lowest and highest place, and how far from the axis any of them is.
        let mut layers = [None::<([f64; 2], f64)>; LAYERS];
        for place in &places {
            let at = ((place.z - bottom) / height * LAYERS as f64) as usize;
            let far = (place - axis).xy().norm();
            let ([low, high], radius) = layers[at.min(LAYERS - 1)].unwrap_or(([place.z; 2], 0.0));
            layers[at.min(LAYERS - 1)] = Some(([low.min(place.z), high.max(place.z)], radius.max(far)));
        }
        let corners = turns * CORNERS.div_ceil(turns);
        let ring = |z: f64, radius: f64| {
            (0..corners).map(move |corner| {
                let (sin, cos) = (TAU * corner as f64 / corners as f64).sin_cos();
                // The sides of the ring, not its corners, touch the circle.
                let radius = radius / (PI / corners as f64).cos();
                Vector3::new(axis.x + radius * cos, axis.y + radius * sin, z)
            })
        };
        let rings = |(ends, radius): ([f64; 2], f64)| ends.into_iter().flat_map(move |z| ring(z, radius));
        Self::Places(layers.into_iter().flatten().flat_map(rings).collect())
    }
}

/// Corners of the bricks from one of a row to another, from the middle of the volume on (mm). A brick's samples reach to the first voxel of the next, at the volume's faces
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

/// Places as the camera sees them: extents along the picture's right and up and towards the eye (mm).
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

    /// Half of the width and of the height (mm).
    pub(crate) fn half(&self) -> [f64; 2] {
        let half = 0.5 * (self.high - self.low);
        [half.x, half.y]
    }
}

/// Size of a pixel at which so much to either side of the picture's middle fits (mm).
pub(crate) fn pixel(half: [f64; 2], size: [usize; 2]) -> f64 {
    let free = 2.0 * MARGIN * size[0].min(size[1]) as f64;
    let needed = |a: usize| 2.0 * half[a] / (size[a] as f64 - free);
    needed(0).max(needed(1))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_turned_shows_the_same_after_each_turn_and_holds_every_place() {
        let places: Vec<Vector3<f64>> =
            [[3.0, 1.0, -2.0], [9.0, -4.0, 1.0], [4.0, 6.0, 12.0]].map(Vector3::from).to_vec();
        for turns in [2, 3, 64, 100] {
            let Held::Places(turned) = Held::Places(places.clone()).turned(turns) else {
                panic!("they are places")
            };
            let seen = |held: &[Vector3<f64>], turn: f64| {
                let (sin, cos) = (TAU * turn / turns as f64).sin_cos();
                let (across, away) = (Vector3::new(cos, sin, 0.0), Vector3::new(-sin, cos, 0.0));
                Extents::new(held, [across, Vector3::z(), away])
            };
            let first = seen(&turned, 0.0);
            for turn in 0..turns {
                let (now, own) = (seen(&turned, turn as f64), seen(&places, turn as f64));
                assert!((now.half()[0] - first.half()[0]).abs() < 1e-9 && now.half()[1] == first.half()[1]);
                assert!((0..3).all(|a| now.low[a] <= own.low[a] + 1e-9 && now.high[a] >= own.high[a] - 1e-9));
            }
        }
    }
}
