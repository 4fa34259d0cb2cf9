use nalgebra::Vector3;
use rayon::prelude::*;

use super::distance::closest_on_triangle;
use super::surface::Surface;

/// Vertices summed as one piece: the mean doesn't depend on the number of threads.
const PIECE: usize = 4096;

/// Mean distance (mm) of the input's vertices from the refined surface, each weighted by the area round it.
///
/// A removed vertex is measured against the triangles round the vertex that it ended on, and then round the other corners
/// of the nearest of them: never less than its distance from the whole surface, and rarely more.
pub(super) fn mean_distance(surface: &Surface, input: &[[u32; 3]]) -> f64 {
    let weights = vertex_areas(&surface.positions, input);
    let pieces: Vec<(f64, f64)> = (0..weights.len().div_ceil(PIECE))
        .into_par_iter()
        .map(|piece| {
            let mut sum = (0.0, 0.0);
            for v in piece * PIECE..(piece * PIECE + PIECE).min(weights.len()) {
                let end = surface.end_of(v);
                let off = if end == v { 0.0 } else { distance_near(surface, &surface.positions[v], end) };
                sum = (sum.0 + weights[v] * off, sum.1 + weights[v]);
            }
            sum
        })
        .collect();
    let (sum, area) = pieces.into_iter().fold((0.0, 0.0), |sum, p| (sum.0 + p.0, sum.1 + p.1));
    if area > 0.0 { sum / area } else { 0.0 }
}

/// A third of the area round each vertex (mm²).
fn vertex_areas(positions: &[Vector3<f64>], triangles: &[[u32; 3]]) -> Vec<f64> {
    let mut areas = vec![0.0; positions.len()];
    for t in triangles {
        let [a, b, c] = t.map(|v| positions[v as usize]);
        let third = (b - a).cross(&(c - a)).norm() / 6.0;
        for &v in t {
            areas[v as usize] += third;
        }
    }
    areas
}

fn distance_near(surface: &Surface, p: &Vector3<f64>, vertex: usize) -> f64 {
    let mut best = (f64::INFINITY, 0);
    nearest_round(surface, p, vertex, &mut best);
    for corner in surface.triangles[best.1 as usize] {
        if corner as usize != vertex {
            nearest_round(surface, p, corner as usize, &mut best);
        }
    }
    best.0.sqrt()
}

/// Squared distance to the nearest triangle round a vertex, and which that is, if it is nearer than `best`.
fn nearest_round(surface: &Surface, p: &Vector3<f64>, vertex: usize, best: &mut (f64, u32)) {
    for &t in surface.stars.of(vertex) {
        let [a, b, c] = surface.triangles[t as usize].map(|v| v as usize);
        let corners = [&surface.positions[a], &surface.positions[b], &surface.positions[c]];
        let off = (closest_on_triangle(p, corners) - p).norm_squared();
        if off < best.0 {
            *best = (off, t);
        }
    }
}
