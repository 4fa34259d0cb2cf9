//! Triangles turned so that neighbours agree and closed parts face outward.

use ivd_core::Exec;
use nalgebra::Vector3;
use rayon::prelude::*;

use super::nesting;
use super::part::Part;
use crate::Error;

const NONE: u32 = u32::MAX;

/// What was done.
#[derive(Debug, Default)]
pub(super) struct Turned {
    pub(super) flipped: u64,
    /// Edges whose two triangles can't agree.
    pub(super) one_sided_edges: u64,
    /// A vertex of the first of them.
    pub(super) first_one_sided: u32,
}

/// Turns triangles in place.
pub(super) fn turn(
    positions: &[Vector3<f64>],
    triangles: &mut [[u32; 3]],
    exec: &Exec,
) -> Result<Turned, Error> {
    let neighbours = neighbours(triangles);
    exec.check_cancelled()?;
    let mut turned = Turned::default();
    let mut over = vec![false; triangles.len()];
    let parts = agree(triangles, &neighbours, &mut over, &mut turned, exec)?;
    for (triangle, _) in triangles.iter_mut().zip(&over).filter(|(_, over)| **over) {
        triangle.swap(1, 2);
    }
    let depths = nesting::depths(positions, triangles, &parts, exec)?;
    for (part, depth) in parts.iter().zip(depths).filter(|(part, _)| part.closed) {
        let volume = volume(positions, triangles, part);
        if volume != 0.0 && (volume > 0.0) != (depth % 2 == 0) {
            for &t in &part.triangles {
                triangles[t as usize].swap(1, 2);
                over[t as usize] ^= true;
            }
        }
    }
    turned.flipped = over.iter().filter(|over| **over).count() as u64;
    Ok(turned)
}

/// Ends of half-edge `3 t + k`: corner `k` of triangle `t` and the next one.
fn ends(triangles: &[[u32; 3]], half: usize) -> (u32, u32) {
    let t = triangles[half / 3];
    (t[half % 3], t[(half + 1) % 3])
}

/// The half-edge on the other side of each, where there is exactly one.
fn neighbours(triangles: &[[u32; 3]]) -> Vec<u32> {
    let mut halves: Vec<(u64, u32)> = (0..3 * triangles.len())
        .into_par_iter()
        .map(|half| {
            let (a, b) = ends(triangles, half);
            (u64::from(a.min(b)) << 32 | u64::from(a.max(b)), half as u32)
        })
        .collect();
    halves.par_sort_unstable();
    let mut neighbours = vec![NONE; 3 * triangles.len()];
    for edge in halves.chunk_by(|a, b| a.0 == b.0) {
        if let [(_, a), (_, b)] = *edge {
            neighbours[a as usize] = b;
            neighbours[b as usize] = a;
        }
    }
    neighbours
}

/// Marks the triangles to be turned so that neighbours run along their edge in opposite directions; in each part the fewer.
fn agree(
    triangles: &[[u32; 3]],
    neighbours: &[u32],
    over: &mut [bool],
    turned: &mut Turned,
    exec: &Exec,
) -> Result<Vec<Part>, Error> {
    let mut seen = vec![false; triangles.len()];
    let mut parts = Vec::new();
    let mut steps = 0_usize;
    for seed in 0..triangles.len() as u32 {
        if std::mem::replace(&mut seen[seed as usize], true) {
            continue;
        }
        let mut part = Part { triangles: vec![seed], closed: true };
        let mut next = 0;
        while let Some(&t) = part.triangles.get(next) {
            next += 1;
            steps += 1;
            if steps.is_multiple_of(1 << 16) {
                exec.check_cancelled()?;
            }
            for half in 3 * t as usize..3 * t as usize + 3 {
                let other = neighbours[half];
                if other == NONE {
                    part.closed = false;
                    continue;
                }
                let u = other / 3;
                let alike = ends(triangles, half).0 == ends(triangles, other as usize).0;
                let wanted = over[t as usize] ^ alike;
                if !std::mem::replace(&mut seen[u as usize], true) {
                    over[u as usize] = wanted;
                    part.triangles.push(u);
                } else if over[u as usize] != wanted {
                    // Met from both of its triangles.
                    if turned.one_sided_edges == 0 {
                        turned.first_one_sided = ends(triangles, half).0;
                    }
                    turned.one_sided_edges += 1;
                }
            }
        }
        let flips = part.triangles.iter().filter(|&&t| over[t as usize]).count();
        if 2 * flips > part.triangles.len() {
            for &t in &part.triangles {
                over[t as usize] ^= true;
            }
        }
        parts.push(part);
    }
    turned.one_sided_edges /= 2;
    Ok(parts)
}

/// Six times the volume that a closed part encloses (mm³), positive where it faces outward.
fn volume(positions: &[Vector3<f64>], triangles: &[[u32; 3]], part: &Part) -> f64 {
    let Some(&first) = part.triangles.first() else { return 0.0 };
    let origin = positions[triangles[first as usize][0] as usize];
    let of = |&t: &u32| {
        let [a, b, c] = triangles[t as usize].map(|v| positions[v as usize] - origin);
        a.dot(&b.cross(&c))
    };
    part.triangles.iter().map(of).sum()
}
