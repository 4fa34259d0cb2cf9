use nalgebra::Vector3;
use rayon::prelude::*;

use super::distance::closest_on_triangle;

/// Vertices summed as one piece: the mean doesn't depend on the number of threads.
const PIECE: usize = 1024;

/// Vertices measured at most: enough to tell the mean to half a percent of the spread.
const SAMPLES: usize = 1 << 15;

/// What is left of a surface and where the rest of it went.
pub(super) trait Refining: Sync {
    /// Places of the input's vertices (mm).
    fn positions(&self) -> &[Vector3<f64>];
    /// Area of the input's triangles round each vertex (mm²).
    fn areas(&self) -> &[f32];
    /// Triangles left round a vertex.
    fn star(&self, v: usize) -> &[u32];
    /// Corners of a triangle left.
    fn corners(&self, t: u32) -> [u32; 3];
    /// The vertex left near which a vertex was removed; itself where it is left.
    fn end_of(&self, v: usize) -> usize;
    /// How often the search for the nearest triangle goes on from the corners of the nearest so far, at most.
    const STEPS: usize;
}

/// Distances of the input's vertices from the refined surface (mm).
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub(super) struct Seen {
    /// Their mean, each weighted by the area round its vertex.
    pub(super) mean: f64,
    /// The largest.
    pub(super) largest: f64,
}

/// Distances of the input's vertices from the refined surface; of a large surface every n-th vertex stands for all.
///
/// A removed vertex is measured against the triangles round the vertex that it ended on, and then round the other corners
/// of the nearest of them, and so on for as many steps as the surface says: never less than its distance from the whole surface, and rarely more.
pub(super) fn distances_seen(surface: &impl Refining) -> Seen {
    seen_of(surface, surface.areas().len().div_ceil(SAMPLES).max(1))
}

/// Those of every `step`-th vertex.
fn seen_of(surface: &impl Refining, step: usize) -> Seen {
    let samples = surface.areas().len().div_ceil(step);
    let pieces: Vec<[f64; 3]> = (0..samples.div_ceil(PIECE))
        .into_par_iter()
        .map(|piece| {
            let mut sum = [0.0; 3];
            for v in (piece * PIECE..(piece * PIECE + PIECE).min(samples)).map(|sample| sample * step) {
                let (end, area) = (surface.end_of(v), f64::from(surface.areas()[v]));
                let off = if end == v { 0.0 } else { distance_near(surface, &surface.positions()[v], end) };
                sum = [sum[0] + area * off, sum[1] + area, sum[2].max(off)];
            }
            sum
        })
        .collect();
    let joined = |sum: [f64; 3], p: [f64; 3]| [sum[0] + p[0], sum[1] + p[1], sum[2].max(p[2])];
    let [sum, area, largest] = pieces.into_iter().fold([0.0; 3], joined);
    Seen { mean: if area > 0.0 { sum / area } else { 0.0 }, largest }
}

fn distance_near<S: Refining>(surface: &S, p: &Vector3<f64>, vertex: usize) -> f64 {
    let mut best = (f64::INFINITY, 0);
    nearest_round(surface, p, vertex, &mut best);
    for _ in 0..S::STEPS {
        let last = best;
        for corner in surface.corners(last.1) {
            if corner as usize != vertex {
                nearest_round(surface, p, corner as usize, &mut best);
            }
        }
        if best.0 >= last.0 {
            break;
        }
    }
    best.0.sqrt()
}

/// Squared distance to the nearest triangle round a vertex, and which that is, if it is nearer than `best`.
fn nearest_round(surface: &impl Refining, p: &Vector3<f64>, vertex: usize, best: &mut (f64, u32)) {
    let positions = surface.positions();
    for &t in surface.star(vertex) {
        let corners = surface.corners(t).map(|v| &positions[v as usize]);
        let off = (closest_on_triangle(p, corners) - p).norm_squared();
        if off < best.0 {
            *best = (off, t);
        }
    }
}

#[cfg(test)]
mod tests {
    use ivd_core::{Exec, Grid, Volume, Voxels};

    use super::super::surface::Surface;
    use super::super::{Locks, RefineParams, Target, passes};
    use super::*;
    use crate::extract::{ExtractParams, Iso, extract};

    #[test]
    fn every_third_vertex_tells_the_mean_of_all() {
        let grid = Grid::with_spacing([32; 3], [1.0; 3]).unwrap();
        let middle = Vector3::repeat(15.6);
        let voxels: Vec<f32> = (0..grid.len())
            .map(|i| (11.0 - (Vector3::from(grid.index(i).0.map(|c| c as f64)) - middle).norm()) as f32)
            .collect();
        let volume = Volume::new(grid, Voxels::from(voxels)).unwrap();
        let exec = Exec::default();
        let lattice = extract(&volume, None, &ExtractParams { iso: Iso::Value(0.0) }, &exec).unwrap().lattice;
        let mut surface = Surface::new(&lattice, Locks::NONE, None);
        let params = RefineParams { target: Target::Ratio(0.1).into(), ..RefineParams::default() };
        passes::run(&mut surface, &params, None, &exec).unwrap();
        let (all, some) = (seen_of(&surface, 1), seen_of(&surface, 3));
        assert!(some.largest <= all.largest && all.mean < all.largest);
        let (all_seen, all, some) = (all, all.mean, some.mean);
        assert!(all > 0.01 && (some - all).abs() < 0.05 * all, "{some} against {all}");
        assert_eq!(distances_seen(&surface), all_seen, "a small surface is measured whole");
    }
}
