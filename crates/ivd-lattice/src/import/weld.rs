//! Which vertices are one, and the triangles that are left.

use std::collections::HashMap;

use ivd_core::{Exec, Grid, VoxelCoord};
use nalgebra::Vector3;
use rayon::prelude::*;

use crate::Error;

/// The vertex that each vertex is welded onto (itself, where it stays), and how many aren't themselves.
///
/// Vertices at exactly one place become the first of them. With a tolerance, a vertex then joins the nearest earlier one
/// that stays and isn't further away (mm).
pub(super) fn onto(
    positions: &[Vector3<f64>],
    tolerance: f64,
    grid: &Grid,
    exec: &Exec,
) -> Result<(Vec<u32>, u64), Error> {
    // Adding 0 makes −0 and 0 one.
    let bits = |v: u32| -> [u64; 3] {
        let p = positions[v as usize];
        [p.x, p.y, p.z].map(|c| (c + 0.0).to_bits())
    };
    let mut order: Vec<u32> = (0..positions.len() as u32).collect();
    order.par_sort_unstable_by_key(|&v| (bits(v), v));
    let mut onto: Vec<u32> = (0..positions.len() as u32).collect();
    for same in order.chunk_by(|&a, &b| bits(a) == bits(b)) {
        for &v in same {
            onto[v as usize] = same[0];
        }
    }
    drop(order);
    exec.check_cancelled()?;
    if tolerance > 0.0 {
        near(positions, tolerance, grid, &mut onto, exec)?;
    }
    let welded = onto.iter().enumerate().filter(|&(v, &to)| v as u32 != to).count();
    Ok((onto, welded as u64))
}

/// Joins vertices to earlier ones within the tolerance, found in cubes of its size.
fn near(
    positions: &[Vector3<f64>],
    tolerance: f64,
    grid: &Grid,
    onto: &mut [u32],
    exec: &Exec,
) -> Result<(), Error> {
    let origin = Vector3::from(grid.origin());
    let corner = VoxelCoord(Vector3::from(grid.dims().map(|n| n as f64)));
    // Smaller cubes than this could not be counted exactly.
    let side = tolerance.max(1e-12 * (grid.world(corner).0 - origin).norm());
    let cube = |p: &Vector3<f64>| -> [i64; 3] { ((p - origin) / side).map(|c| c.floor() as i64).into() };
    // The last vertex that stays in a cube, and the one before each.
    let mut last: HashMap<[i64; 3], u32> = HashMap::new();
    let mut before = vec![u32::MAX; positions.len()];
    for v in 0..positions.len() {
        if v % (1 << 14) == 0 {
            exec.check_cancelled()?;
        }
        if onto[v] != v as u32 {
            // The first at its place comes earlier.
            onto[v] = onto[onto[v] as usize];
            continue;
        }
        let p = positions[v];
        let here = cube(&p);
        let mut best: Option<(f64, u32)> = None;
        for i in 0..27_i64 {
            let step = [i % 3 - 1, i / 3 % 3 - 1, i / 9 - 1];
            let at = std::array::from_fn(|a| here[a].saturating_add(step[a]));
            let mut other = last.get(&at).copied().unwrap_or(u32::MAX);
            while other != u32::MAX {
                let candidate = ((positions[other as usize] - p).norm(), other);
                if candidate.0 <= tolerance && best.is_none_or(|b| candidate < b) {
                    best = Some(candidate);
                }
                other = before[other as usize];
            }
        }
        match best {
            Some((_, other)) => onto[v] = other,
            None => before[v] = last.insert(here, v as u32).unwrap_or(u32::MAX),
        }
    }
    Ok(())
}

/// Triangles that are left, on the vertices that stay.
pub(super) struct Cleaned {
    pub(super) triangles: Vec<[u32; 3]>,
    pub(super) degenerate: u64,
    pub(super) duplicate: u64,
}

/// Drops triangles that name a vertex twice, and all but the first of those with the same corners.
pub(super) fn clean(triangles: &[[u32; 3]], onto: &[u32], exec: &Exec) -> Result<Cleaned, Error> {
    let welded: Vec<[u32; 3]> = triangles.par_iter().map(|t| t.map(|v| onto[v as usize])).collect();
    let whole = |[a, b, c]: [u32; 3]| a != b && b != c && c != a;
    let mut sorted: Vec<([u32; 3], u32)> = (0_u32..)
        .zip(&welded)
        .filter(|(_, t)| whole(**t))
        .map(|(i, t)| {
            let mut t = *t;
            t.sort_unstable();
            (t, i)
        })
        .collect();
    let degenerate = (triangles.len() - sorted.len()) as u64;
    sorted.par_sort_unstable();
    exec.check_cancelled()?;
    sorted.dedup_by_key(|entry| entry.0);
    let mut left: Vec<u32> = sorted.into_iter().map(|(_, i)| i).collect();
    left.par_sort_unstable();
    let duplicate = triangles.len() as u64 - degenerate - left.len() as u64;
    let triangles = left.into_iter().map(|i| welded[i as usize]).collect();
    Ok(Cleaned { triangles, degenerate, duplicate })
}

/// Vertices that stay, ascending: those that aren't welded onto another and that one of `triangles` names, if given.
pub(super) fn kept(vertices: usize, onto: &[u32], triangles: Option<&[[u32; 3]]>) -> Vec<u32> {
    let mut used = vec![triangles.is_none(); vertices];
    for &v in triangles.unwrap_or_default().as_flattened() {
        used[v as usize] = true;
    }
    (0..vertices as u32).filter(|&v| onto[v as usize] == v && used[v as usize]).collect()
}
