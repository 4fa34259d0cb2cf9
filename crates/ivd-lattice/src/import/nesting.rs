//! How many closed parts each closed part lies in.
//!
//! A tree over the parts' boxes tells which may hold a part, and a tree over the triangles of each of those what rays pass through.
//! Parts side by side cost what sorting them does; parts in each other a look at each pair of which one's box holds the other.

use ivd_core::Exec;
use nalgebra::{Vector2, Vector3};
use rayon::prelude::*;

use super::boxes::{Box, Boxes};
use super::part::Part;
use crate::Error;

/// For each part the number of other closed parts in which it lies; 0 for open parts.
///
/// It lies in those whose box holds seven of its points, in its largest triangle and furthest out along each axis, and that rays along x
/// leave from all seven. Of parts that pass through each other seldom all of them are left. The rays start at no round numbers, so
/// that they hardly ever meet an edge.
pub(super) fn depths(
    positions: &[Vector3<f64>],
    triangles: &[[u32; 3]],
    parts: &[Part],
    exec: &Exec,
) -> Result<Vec<usize>, Error> {
    if parts.iter().filter(|p| p.closed).count() < 2 {
        return Ok(vec![0; parts.len()]);
    }
    let solids: Vec<Option<Solid>> = parts
        .par_iter()
        .map(|part| {
            part.closed
                .then(|| Solid::new(positions, triangles, part))
                .filter(|_| !exec.cancel.is_cancelled())
        })
        .collect();
    exec.check_cancelled()?;
    let listed = solids.iter().enumerate().filter_map(|(i, solid)| Some((i as u32, solid.as_ref()?.around)));
    let boxes = Boxes::new(listed.collect());
    let depth = |(i, solid): (usize, &Option<Solid>)| {
        exec.check_cancelled()?;
        let Some(solid) = solid else { return Ok(0) };
        let reach = Box::round(&solid.starts);
        let mut holders = Vec::new();
        boxes.visit(|b| b.holds(&reach), |j| holders.push(j));
        let within = |j: &&u32| {
            let other = solids[**j as usize].as_ref().expect("boxes of closed parts alone are listed");
            **j as usize != i
                && solid.starts.iter().all(|start| other.is_left_by(start, positions, triangles))
        };
        Ok(holders.iter().filter(within).count())
    };
    solids.par_iter().enumerate().map(depth).collect()
}

/// A closed part.
struct Solid {
    around: Box,
    starts: [Vector3<f64>; 7],
    triangles: Boxes,
}

impl Solid {
    fn new(positions: &[Vector3<f64>], triangles: &[[u32; 3]], part: &Part) -> Self {
        let around = |t: u32| Box::round(triangles[t as usize].iter().map(|&v| &positions[v as usize]));
        let items: Vec<(u32, Box)> = part.triangles.iter().map(|&t| (t, around(t))).collect();
        Self {
            around: items.iter().fold(Box::NOTHING, |all, item| all.or(&item.1)),
            starts: starts(positions, triangles, part),
            triangles: Boxes::new(items),
        }
    }

    /// Whether a ray along x passes through an odd number of its triangles.
    fn is_left_by(&self, q: &Vector3<f64>, positions: &[Vector3<f64>], triangles: &[[u32; 3]]) -> bool {
        let ahead = |b: &Box| b.high.x >= q.x && b.low.yz() <= q.yz() && q.yz() <= b.high.yz();
        let mut odd = false;
        self.triangles.visit(ahead, |t| {
            odd ^= is_left(q, triangles[t as usize].map(|v| positions[v as usize]));
        });
        odd
    }
}

/// A point within a part's largest triangle, and one near each of the corners that are furthest down and up along the axes.
fn starts(positions: &[Vector3<f64>], triangles: &[[u32; 3]], part: &Part) -> [Vector3<f64>; 7] {
    // The corner that a point is near comes first.
    let mut best = [(f64::NEG_INFINITY, [0; 3]); 7];
    for &t in &part.triangles {
        let [u, v, w] = triangles[t as usize];
        for corners in [[u, v, w], [v, w, u], [w, u, v]] {
            let [a, b, c] = corners.map(|v| positions[v as usize]);
            let area = (b - a).cross(&(c - a)).norm();
            let scores = [area, -a.x, -a.y, -a.z, a.x, a.y, a.z];
            for (best, score) in best.iter_mut().zip(scores) {
                if score > best.0 {
                    *best = (score, corners);
                }
            }
        }
    }
    let mut share = 1.0;
    best.map(|(_, corners)| {
        let [a, b, c] = corners.map(|v| positions[v as usize]);
        let start =
            a + (b - a) * (0.271_828_182_845_904_5 * share) + (c - a) * (0.314_159_265_358_979_3 * share);
        share = 0.01;
        start
    })
}

/// Whether the ray from `q` along x passes through a triangle.
fn is_left(q: &Vector3<f64>, corners: [Vector3<f64>; 3]) -> bool {
    let flat = corners.map(|p| Vector2::new(p.y - q.y, p.z - q.z));
    let side = |i: usize| flat[i].perp(&flat[(i + 1) % 3]);
    let sides = [side(0), side(1), side(2)];
    let sum = sides[0] + sides[1] + sides[2];
    if sum == 0.0 || !(sides.iter().all(|s| *s >= 0.0) || sides.iter().all(|s| *s < 0.0)) {
        return false;
    }
    // Each corner weighs as much as the side across from it.
    let x = (sides[1] * corners[0].x + sides[2] * corners[1].x + sides[0] * corners[2].x) / sum;
    x > q.x
}

#[cfg(test)]
mod tests {
    use super::*;
    use ivd_core::noise;

    /// As it is told: every part against every other, every ray against every triangle.
    fn plain(positions: &[Vector3<f64>], triangles: &[[u32; 3]], parts: &[Part]) -> Vec<usize> {
        let corners = |t: u32| triangles[t as usize].map(|v| positions[v as usize]);
        let depth = |(i, part): (usize, &Part)| {
            let starts = starts(positions, triangles, part);
            let holds = |(j, other): &(usize, &Part)| {
                let leaves = |q: &Vector3<f64>| {
                    other.triangles.iter().filter(|&&t| is_left(q, corners(t))).count() % 2 == 1
                };
                let around = Box::round(
                    other.triangles.iter().map(|&t| corners(t)).collect::<Vec<_>>().as_flattened(),
                );
                part.closed
                    && other.closed
                    && i != *j
                    && around.holds(&Box::round(&starts))
                    && starts.iter().all(leaves)
            };
            parts.iter().enumerate().filter(holds).count()
        };
        parts.iter().enumerate().map(depth).collect()
    }

    /// An octahedron; turned and stretched, so that no two share a plane.
    fn octahedron(
        middle: Vector3<f64>,
        size: Vector3<f64>,
        mesh: &mut (Vec<Vector3<f64>>, Vec<[u32; 3]>, Vec<Part>),
    ) {
        let (first, before) = (mesh.0.len() as u32, mesh.1.len() as u32);
        for axis in 0..3 {
            for sign in [-1.0, 1.0] {
                let mut off = Vector3::zeros();
                off[axis] = sign * size[axis];
                off[(axis + 1) % 3] = 0.137 * sign * size[axis];
                mesh.0.push(middle + off);
            }
        }
        for [x, y, z] in
            [[1, 3, 5], [3, 0, 5], [0, 2, 5], [2, 1, 5], [3, 1, 4], [0, 3, 4], [2, 0, 4], [1, 2, 4]]
        {
            mesh.1.push([first + x, first + y, first + z]);
        }
        mesh.2.push(Part { triangles: (before..before + 8).collect(), closed: true });
    }

    #[test]
    fn depths_are_those_of_every_part_against_every_other() {
        let exec = Exec::default();
        let mut deepest = 0;
        for seed in 0..60 {
            let mut mesh = (Vec::new(), Vec::new(), Vec::new());
            let n = 2 + seed % 40;
            for i in 0..n {
                let of = |k: u64| noise::unit(seed, i * 8 + k);
                // Round one middle or anywhere; of like sizes or of a thousandth: nested, apart and through each other.
                let spread = [0.0, 0.2, 1.0][seed as usize % 3];
                let size = if seed % 2 == 0 { 0.02 + of(0) } else { 10.0_f64.powf(-3.0 * of(0)) };
                let middle = Vector3::new(of(1), of(2), of(3)) * spread;
                octahedron(middle, Vector3::new(1.0, 0.8 + 0.4 * of(4), 0.9 + 0.2 * of(5)) * size, &mut mesh);
            }
            for part in mesh.2.iter_mut().step_by(7).skip(1) {
                part.closed = false;
            }
            let (positions, triangles, parts) = mesh;
            let expected = plain(&positions, &triangles, &parts);
            assert_eq!(depths(&positions, &triangles, &parts, &exec).unwrap(), expected, "seed {seed}");
            deepest = deepest.max(expected.into_iter().max().unwrap_or(0));
        }
        assert!(deepest > 20, "{deepest}");
    }

    #[test]
    fn a_row_of_parts_along_the_rays_within_one_is_looked_at_part_by_part() {
        let mut mesh = (Vec::new(), Vec::new(), Vec::new());
        let n = 20_000;
        octahedron(Vector3::zeros(), Vector3::new(4.0, 4.0, 4.0) * f64::from(n), &mut mesh);
        for i in 1..n {
            octahedron(Vector3::new(f64::from(i), 0.0, 0.0), Vector3::repeat(0.3), &mut mesh);
        }
        let (positions, triangles, parts) = mesh;
        let found = depths(&positions, &triangles, &parts, &Exec::default()).unwrap();
        assert!(found[0] == 0 && found[1..].iter().all(|&depth| depth == 1));
    }
}
