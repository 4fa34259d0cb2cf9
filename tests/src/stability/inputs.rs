//! Volumes, handles and cases that the tables of awkward cases begin with.

use ivd_core::{ClassChoice, ErrorClass, Grid, Scalar, Volume};
use ivd_motion::handles::{Action, Anchor, Handle};

use super::case::{Case, Refused, Stage};

/// What a motion that is too much ends with.
pub(super) const TOO_MUCH: [Refused; 3] = [
    (Stage::Deform, ErrorClass::Untrusted),
    (Stage::Map, ErrorClass::Untrusted),
    (Stage::Map, ErrorClass::Limit),
];
/// A grid of `n`³ voxels of 1 mm.
pub(super) fn cube(n: usize) -> Grid {
    Grid::with_spacing([n; 3], [1.0; 3]).expect("a sound grid")
}

/// A volume of a function of the voxel's index.
pub(super) fn volume<T: Scalar>(grid: &Grid, value: impl Fn([usize; 3]) -> f64) -> Volume {
    let values: Vec<T> = (0..grid.len()).map(|i| T::from_f64(value(grid.index(i).0))).collect();
    Volume::new(grid.clone(), T::wrap(values.into())).expect("a value a voxel")
}

/// Distance (voxels) outwards from a ball in the middle of a grid.
pub(super) fn from_ball(grid: &Grid, radius: f64) -> impl Fn([usize; 3]) -> f64 {
    let centre = grid.dims().map(|n| 0.5 * (n as f64 - 1.0) + 0.12);
    move |at| (0..3).map(|a| (at[a] as f64 - centre[a]).powi(2)).sum::<f64>().sqrt() - radius
}

/// A ball whose values fall over eight voxels, 1 inside and 0 outside.
pub(super) fn soft(grid: &Grid, radius: f64) -> impl Fn([usize; 3]) -> f64 {
    let distance = from_ball(grid, radius);
    move |at| (0.5 - distance(at) / 8.0).clamp(0.0, 1.0)
}

/// A ball of bytes.
pub(super) fn ball(n: usize) -> Volume {
    let grid = cube(n);
    let value = soft(&grid, 0.3 * n as f64);
    volume::<u8>(&grid, |at| 200.0 * value(at))
}

pub(super) fn grip(vertex: u32, action: Action, radius: f64) -> Handle {
    Handle { at: Anchor::Vertex(vertex), action, radius }
}

/// A case whose first vertex is moved a little.
pub(super) fn nudged(name: &str, volume: Volume) -> Case {
    let length = volume.grid().voxel_diagonal();
    Case::new(name, volume).with(|s| {
        s.k = 2;
        s.boundary.class = Some(ClassChoice::Densest);
        s.handles = vec![grip(3, Action::Move([0.2 * length, 0.1 * length, -0.15 * length]), 4.0 * length)];
    })
}
