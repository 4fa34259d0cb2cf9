//! Inputs with a truth, made for the experiments.

use std::collections::BTreeMap;

use ivd_core::{Exec, Grid, Lattice, Volume, VoxelCoord, Voxels};
use ivd_lattice::extract::{ExtractParams, Iso, extract};
use nalgebra::Vector3;

use crate::experiment::{Problem, Scored};

/// Edge of every generated cube (mm), whatever its number of voxels.
pub(crate) const EDGE_MM: f64 = 128.0;
/// Radius of the ball (mm).
pub(crate) const RADIUS_MM: f64 = 40.0;

/// Fractions of the largest size.
const PARTS: [f64; 8] = [8.0, 6.0, 4.0, 3.0, 2.0, 1.5, 1.2, 1.0];

/// Voxels along an edge, from few to `size`, for what is as accurate as its grid is fine.
pub(crate) fn sizes_up_to(size: usize) -> impl Iterator<Item = usize> {
    let mut sizes = PARTS.map(|part| ((size as f64 / part) as usize).max(4)).to_vec();
    sizes.dedup();
    sizes.into_iter()
}

/// A grid of `n` voxels along each edge of the cube, its middle at the origin.
pub(crate) fn grid(n: usize) -> Result<Grid, Problem> {
    let spacing = EDGE_MM / n as f64;
    let first = -0.5 * spacing * (n - 1) as f64;
    let axes = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];
    Ok(Grid::new([n; 3], [spacing; 3], [first; 3], axes)?)
}

/// A volume of `f32` by a function of the place (mm).
pub(crate) fn sampled(grid: &Grid, value: impl Fn(Vector3<f64>) -> f64) -> Result<Volume, Problem> {
    let at = |i: usize| value(grid.world(VoxelCoord::from(grid.index(i))).0) as f32;
    let voxels: Vec<f32> = (0..grid.len()).map(at).collect();
    Ok(Volume::new(grid.clone(), Voxels::from(voxels))?)
}

/// The ball's lattice: what is nearer than its radius is inside.
pub(crate) fn ball(n: usize, exec: &Exec) -> Result<Lattice, Problem> {
    let volume = sampled(&grid(n)?, |p| RADIUS_MM - p.norm())?;
    Ok(extract(&volume, None, &ExtractParams { iso: Iso::Value(0.0) }, exec)?.lattice)
}

/// A judgement with counters.
pub(crate) fn judged<const N: usize>(error: f64, counters: [(&str, f64); N]) -> Scored {
    let counters: BTreeMap<String, f64> = counters.into_iter().map(|(n, v)| (n.to_owned(), v)).collect();
    Scored { error, counters }
}

/// Root of the mean of squares; 0 for none.
pub(crate) fn root_mean_square(squares: impl Iterator<Item = f64>) -> f64 {
    let (sum, count) = squares.fold((0.0, 0_u64), |(sum, count), s| (sum + s, count + 1));
    (sum / count.max(1) as f64).sqrt()
}

/// Pairs of knobs in order, each once.
pub(crate) fn each_once<T: PartialOrd>(pairs: impl Iterator<Item = T>) -> Vec<T> {
    let mut pairs: Vec<T> = pairs.collect();
    pairs.sort_by(|a, b| a.partial_cmp(b).expect("knobs are numbers"));
    pairs.dedup();
    pairs
}
