//! How many closed parts each closed part lies in.

use ivd_core::Exec;
use nalgebra::{Vector2, Vector3};
use rayon::prelude::*;

use super::orient::Part;
use crate::Error;

/// Most cells along a side of the table.
const SIDE: usize = 1024;

/// For each part the number of other closed parts in which it lies; 0 for open parts.
///
/// It lies in those that rays along x leave, from seven of its points: in its largest triangle and furthest out along each axis. Of
/// parts that pass through each other seldom all of them are left. Triangles are looked up in a table of cells across y and z. The
/// rays start at no round numbers, so that they hardly ever meet an edge.
pub(super) fn depths(
    positions: &[Vector3<f64>],
    triangles: &[[u32; 3]],
    parts: &[Part],
    exec: &Exec,
) -> Result<Vec<usize>, Error> {
    if parts.iter().filter(|p| p.closed).count() < 2 {
        return Ok(vec![0; parts.len()]);
    }
    let mut part_of = vec![u32::MAX; triangles.len()];
    for (i, part) in parts.iter().enumerate().filter(|(_, part)| part.closed) {
        for &t in &part.triangles {
            part_of[t as usize] = i as u32;
        }
    }
    let table = Table::new(positions, triangles, &part_of);
    let round = |start: &Vector3<f64>, own: u32| {
        let mut left: Vec<u32> = table
            .at(start)
            .iter()
            .filter(|&&t| part_of[t as usize] != own)
            .filter(|&&t| is_left(start, triangles[t as usize].map(|v| positions[v as usize])))
            .map(|&t| part_of[t as usize])
            .collect();
        left.sort_unstable();
        let odd = left.chunk_by(|a, b| a == b).filter(|crossings| crossings.len() % 2 == 1);
        odd.map(|crossings| crossings[0]).collect::<Vec<u32>>()
    };
    let depth = |(i, part): (usize, &Part)| {
        exec.check_cancelled()?;
        if !part.closed {
            return Ok(0);
        }
        let starts = starts(positions, triangles, part);
        let mut common = round(&starts[0], i as u32);
        for start in &starts[1..] {
            if common.is_empty() {
                break;
            }
            let other = round(start, i as u32);
            common.retain(|part| other.binary_search(part).is_ok());
        }
        Ok(common.len())
    };
    parts.par_iter().enumerate().map(depth).collect()
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

/// Triangles of closed parts by the cells across y and z that their boxes touch.
struct Table {
    low: Vector2<f64>,
    scale: Vector2<f64>,
    side: usize,
    starts: Vec<usize>,
    triangles: Vec<u32>,
}

impl Table {
    fn new(positions: &[Vector3<f64>], triangles: &[[u32; 3]], part_of: &[u32]) -> Self {
        let listed: Vec<u32> =
            (0..triangles.len() as u32).filter(|&t| part_of[t as usize] != u32::MAX).collect();
        let bounds = |t: u32| {
            let flat = triangles[t as usize].map(|v| positions[v as usize].yz());
            (flat[0].inf(&flat[1]).inf(&flat[2]), flat[0].sup(&flat[1]).sup(&flat[2]))
        };
        let (low, high) = listed.iter().map(|&t| bounds(t)).fold(
            (Vector2::repeat(f64::INFINITY), Vector2::repeat(f64::NEG_INFINITY)),
            |(low, high), (l, h)| (low.inf(&l), high.sup(&h)),
        );
        let mut side = ((listed.len() as f64).sqrt() as usize).clamp(1, SIDE);
        let mut table =
            Self { low, scale: Vector2::zeros(), side, starts: Vec::new(), triangles: Vec::new() };
        // Long triangles lie in many cells: fewer, larger ones until they don't matter.
        loop {
            table.side = side;
            table.scale = (high - low).map(|extent| if extent > 0.0 { side as f64 / extent } else { 0.0 });
            let cells = |t: u32| {
                let (low, high) = bounds(t);
                let ([y0, z0], [y1, z1]) = (table.cell(&low), table.cell(&high));
                (z0..=z1).flat_map(move |z| (y0..=y1).map(move |y| y + side * z))
            };
            let entries: usize = listed
                .iter()
                .map(|&t| {
                    let (low, high) = bounds(t);
                    let ([y0, z0], [y1, z1]) = (table.cell(&low), table.cell(&high));
                    (y1 - y0 + 1) * (z1 - z0 + 1)
                })
                .sum();
            if entries > 8 * listed.len() && side > 1 {
                side /= 2;
                continue;
            }
            let mut starts = vec![0; side * side + 1];
            for cell in listed.iter().flat_map(|&t| cells(t)) {
                starts[cell + 1] += 1;
            }
            for cell in 0..side * side {
                starts[cell + 1] += starts[cell];
            }
            let (mut next, mut sorted) = (starts.clone(), vec![0; entries]);
            for &t in &listed {
                for cell in cells(t) {
                    sorted[next[cell]] = t;
                    next[cell] += 1;
                }
            }
            (table.starts, table.triangles) = (starts, sorted);
            return table;
        }
    }

    fn cell(&self, flat: &Vector2<f64>) -> [usize; 2] {
        let cell = (flat - self.low).component_mul(&self.scale);
        [cell.x, cell.y].map(|c| (c.max(0.0) as usize).min(self.side - 1))
    }

    /// Triangles that a ray along x from `q` may meet.
    fn at(&self, q: &Vector3<f64>) -> &[u32] {
        let [y, z] = self.cell(&q.yz());
        let cell = y + self.side * z;
        &self.triangles[self.starts[cell]..self.starts[cell + 1]]
    }
}
