//! Numbers by place: vertices and triangles that are near in space become near in memory.
//!
//! Extraction numbers row by row, so that what surrounds a vertex lies slices apart. Along a Morton curve (Morton 1966) it
//! lies together, and a block of space fits a cache.

use nalgebra::Vector3;
use rayon::prelude::*;

/// Bits of the code along an axis.
const BITS: u32 = 5;

/// A surface numbered by place.
pub(super) struct Numbering {
    /// Number that each vertex has in the input.
    pub(super) vertices: Vec<u32>,
    /// Number that each triangle has in the input.
    pub(super) triangles: Vec<u32>,
    /// Corners of the triangles, by the new numbers, in the new order.
    pub(super) corners: Vec<[u32; 3]>,
}

impl Numbering {
    /// Numbers vertices by the cell that they lie in and triangles by that of their first corner; within a cell the
    /// input's order stays.
    ///
    /// - `positions`: places (mm) about the middle of their box.
    pub(super) fn new(positions: &[Vector3<f64>], input: &[[u32; 3]]) -> Self {
        let half = positions.par_iter().map(Vector3::amax).reduce(|| 0.0, f64::max);
        let scale = if half > 0.0 { f64::from(1_u32 << BITS) / (2.0 * half) } else { 0.0 };
        let codes: Vec<u16> = positions
            .par_iter()
            .map(|p| morton(p.map(|c| (((c + half) * scale) as u32).min((1 << BITS) - 1))))
            .collect();
        let corner_codes: Vec<u16> = input.par_iter().map(|t| codes[t[0] as usize]).collect();
        let (vertices, triangles) = rayon::join(|| by_code(&codes), || by_code(&corner_codes));
        let mut rank = vec![0; positions.len()];
        for (new, &old) in vertices.iter().enumerate() {
            rank[old as usize] = new as u32;
        }
        let corners = triangles.par_iter().map(|&t| input[t as usize].map(|v| rank[v as usize])).collect();
        Self { vertices, triangles, corners }
    }
}

/// Interleaves the bits of a cell's coordinates.
fn morton(cell: Vector3<u32>) -> u16 {
    let mut code = 0;
    for bit in 0..BITS {
        for axis in 0..3 {
            code |= (cell[axis] >> bit & 1) << (3 * bit + axis as u32);
        }
    }
    code as u16
}

/// Indices in the order of their codes, equal ones ascending: a counting sort.
fn by_code(codes: &[u16]) -> Vec<u32> {
    let mut next = vec![0_u32; 1 << (3 * BITS)];
    for &code in codes {
        next[code as usize] += 1;
    }
    let mut sum = 0;
    for slot in &mut next {
        sum += std::mem::replace(slot, sum);
    }
    let mut order = vec![0; codes.len()];
    for (i, &code) in codes.iter().enumerate() {
        let slot = &mut next[code as usize];
        order[*slot as usize] = i as u32;
        *slot += 1;
    }
    order
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn cells_follow_one_another_along_the_curve() {
        let corners = (0..8).map(|i| morton(Vector3::new(i & 1, i >> 1 & 1, i >> 2)));
        assert_eq!(corners.collect::<Vec<_>>(), (0..8).collect::<Vec<_>>());
        assert_eq!(morton(Vector3::repeat(31)), (1 << 15) - 1);
    }

    #[test]
    fn every_number_is_given_once_and_triangles_keep_their_corners() {
        let positions: Vec<_> = (0..1000)
            .map(|i| {
                Vector3::new((i * 37 % 101) as f64 - 50.0, (i * 53 % 97) as f64 - 48.0, (i % 7) as f64 - 3.0)
            })
            .collect();
        let input: Vec<_> = (0..998).map(|i| [i, (i * 7 + 1) % 1000, i + 2]).collect();
        let numbering = Numbering::new(&positions, &input);
        let mut seen = numbering.vertices.clone();
        seen.sort_unstable();
        assert!(seen.iter().enumerate().all(|(i, &v)| i as u32 == v));
        for (corners, &t) in numbering.corners.iter().zip(&numbering.triangles) {
            assert_eq!(corners.map(|v| numbering.vertices[v as usize]), input[t as usize]);
        }
        let near = numbering.vertices.windows(2).map(|w| positions[w[0] as usize] - positions[w[1] as usize]);
        let steps: f64 = near.map(|d| d.norm()).sum::<f64>() / 999.0;
        assert!(steps < 12.0, "neighbours in number are {steps} mm apart");
    }
}
