//! The discrete Hessian energy, as the rows of its matrix.
//!
//! `E(u) = Σ_n ⅛ Σ_o tr(G H G H)` with `G` the inverse metric of the cells, so that it is the integral of the squared second
//! derivatives in world space, whatever spacing, shear and handedness. `H` has the second differences of node `n` along each
//! axis and, of each of its eight octants `o`, the mixed differences of the three faces there. Where the axes are at right
//! angles that is `Σ_a (D_aa u)² / h_a⁴ + 2 Σ_{a<b} (D_ab u)² / (h_a² h_b²)`, with every node and every face once. A
//! difference that reaches beyond the last node is left out, which makes the border natural; affine motions have no energy.

use nalgebra::{Matrix3, Matrix6};

/// Width of a row: the nodes from −2 to 2 along each axis.
pub(super) const WIDTH: usize = 5;
/// Entries of a row, x fastest.
pub(super) type Row = [f64; WIDTH * WIDTH * WIDTH];

/// The diagonal's place in a row.
pub(super) const MIDDLE: usize = 62;

/// Axes of the six entries of `H`.
const AXES: [(usize, usize); 6] = [(0, 0), (1, 1), (2, 2), (1, 2), (0, 2), (0, 1)];

/// The rows of the energy's matrix on cells of one size.
pub(super) struct Rows {
    weights: Matrix6<f64>,
    /// What the rows are divided by.
    scale: f64,
    /// Inverse metric of the cells, over its largest entry.
    metric: Matrix3<f64>,
    /// The same of a membrane's rows, times its weight; 0 where there is none.
    tension: f64,
}

/// Where a node lies between the first and the last: nodes before and after it along each axis, 2 for more.
pub(super) type Room = [[u8; 2]; 3];

impl Rows {
    /// Rows in units of their own diagonal. `cell`: the edges of a cell (columns, mm). `tension`: weight of a membrane's energy `Σ_n ⅛ Σ_o tr(g G gᵀ)`,
    /// `g` the first differences in an octant, in units of its own diagonal: it makes the field flatter, and lets it overshoot less.
    pub(super) fn new(cell: Matrix3<f64>, tension: f64) -> Self {
        let inverse = cell.try_inverse().expect("a grid's axes span space");
        let metric = inverse * inverse.transpose();
        let metric = metric / metric.amax();
        let mut rows = Self { weights: weights(metric), scale: 1.0, metric, tension: 0.0 };
        rows.scale = rows.row([[2; 2]; 3])[MIDDLE];
        let mut membrane = [0.0; WIDTH * WIDTH * WIDTH];
        rows.add_membrane(1.0, |_| true, &mut membrane);
        rows.tension = tension / membrane[MIDDLE];
        rows
    }

    /// The row of a node: half the derivative of the energy by its value is the sum of the row's entries times the values.
    pub(super) fn row(&self, room: Room) -> Row {
        let exists =
            |at: [i32; 3]| (0..3).all(|a| at[a] >= -i32::from(room[a][0]) && at[a] <= i32::from(room[a][1]));
        let mut row = [0.0; WIDTH * WIDTH * WIDTH];
        for c in 0..27 {
            let centre = [c % 3 - 1, c / 3 % 3 - 1, c / 9 - 1];
            if !exists(centre) {
                continue;
            }
            for octant in 0..8 {
                let differences: Vec<Difference> =
                    AXES.iter().map(|axes| Difference::new(centre, octant, *axes, exists)).collect();
                let own: Vec<f64> = differences.iter().map(|d| d.at([0; 3])).collect();
                for (f, own) in own.iter().enumerate().filter(|(_, own)| **own != 0.0) {
                    for (g, other) in differences.iter().enumerate() {
                        for (at, coefficient) in &other.terms {
                            let slot = (at[0] + 2) + 5 * (at[1] + 2) + 25 * (at[2] + 2);
                            row[slot as usize] += own * self.weights[(f, g)] * coefficient / 8.0;
                        }
                    }
                }
            }
        }
        let mut row = row.map(|v| v / self.scale);
        if self.tension > 0.0 {
            self.add_membrane(self.tension, exists, &mut row);
        }
        row
    }

    /// Adds a membrane's row of the node in the middle.
    fn add_membrane(&self, weight: f64, exists: impl Fn([i32; 3]) -> bool, row: &mut Row) {
        // The octants in which a difference has the middle: those of the node itself, and of its neighbours along the axes.
        let unit =
            |axis: usize, sign: i32| -> [i32; 3] { std::array::from_fn(|a| sign * i32::from(a == axis)) };
        let centres =
            std::iter::once([0; 3]).chain((0..6).map(|i| unit(i / 2, if i % 2 == 0 { 1 } else { -1 })));
        for centre in centres.filter(|c| exists(*c)) {
            for octant in 0..8_usize {
                // From the centre to its neighbour in the octant along each axis.
                let ends: [Option<[i32; 3]>; 3] = std::array::from_fn(|a| {
                    let step = unit(a, if octant >> a & 1 == 1 { 1 } else { -1 });
                    let end: [i32; 3] = std::array::from_fn(|b| centre[b] + step[b]);
                    exists(end).then_some(end)
                });
                let sign = |a: usize| if octant >> a & 1 == 1 { 1.0 } else { -1.0 };
                let own = |a: usize| match ends[a] {
                    Some(_) if centre == [0; 3] => -sign(a),
                    Some([0, 0, 0]) => sign(a),
                    _ => 0.0,
                };
                for (a, b) in (0..9).map(|i| (i / 3, i % 3)).filter(|&(a, _)| own(a) != 0.0) {
                    let Some(end) = ends[b] else { continue };
                    let much = weight * own(a) * self.metric[(a, b)] * sign(b) / 8.0;
                    for (at, side) in [(centre, -1.0), (end, 1.0)] {
                        row[((at[0] + 2) + 5 * (at[1] + 2) + 25 * (at[2] + 2)) as usize] += side * much;
                    }
                }
            }
        }
    }
}

/// `tr(G E_f G E_g)` with `E` the symmetric matrices that have one entry of `H`.
fn weights(metric: Matrix3<f64>) -> Matrix6<f64> {
    let basis = |(a, b): (usize, usize)| {
        let mut m = Matrix3::zeros();
        (m[(a, b)], m[(b, a)]) = (1.0, 1.0);
        m
    };
    Matrix6::from_fn(|f, g| (metric * basis(AXES[f]) * metric * basis(AXES[g])).trace())
}

/// A second difference: nodes and their coefficients.
struct Difference {
    terms: Vec<([i32; 3], f64)>,
}

impl Difference {
    /// Of the centre along an axis, or of the face of an octant between two.
    fn new(
        centre: [i32; 3],
        octant: usize,
        (a, b): (usize, usize),
        exists: impl Fn([i32; 3]) -> bool,
    ) -> Self {
        let sign = |axis: usize| if octant >> axis & 1 == 1 { 1 } else { -1 };
        let moved = |da: i32, db: i32| {
            let mut at = centre;
            at[a] += da;
            at[b] += db;
            at
        };
        let terms = if a == b {
            vec![(moved(-1, 0), 1.0), (centre, -2.0), (moved(1, 0), 1.0)]
        } else {
            let (sa, sb) = (sign(a), sign(b));
            let sign = f64::from(sa * sb);
            vec![(moved(sa, sb), sign), (moved(sa, 0), -sign), (moved(0, sb), -sign), (centre, sign)]
        };
        let whole = terms.iter().all(|(at, _)| exists(*at));
        Self { terms: if whole { terms } else { Vec::new() } }
    }

    fn at(&self, node: [i32; 3]) -> f64 {
        self.terms.iter().filter(|(at, _)| *at == node).map(|(_, c)| c).sum()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use ivd_field::fixtures::sheared_grid;
    use nalgebra::Vector3;

    #[test]
    fn affine_motions_have_no_energy_at_any_border() {
        let rows = Rows::new(sheared_grid([4; 3]).linear_part(), 0.0);
        for code in 0..729_u32 {
            let room: Room = std::array::from_fn(|a| {
                let digit = code / 9_u32.pow(a as u32) % 9;
                [digit as u8 % 3, digit as u8 / 3]
            });
            let row = rows.row(room);
            for affine in [[1.0, 0.0, 0.0, 0.0], [0.0, 1.0, 2.0, -0.5], [3.0, 0.2, 0.7, 1.9]] {
                let sum: f64 = (0..125)
                    .map(|i| {
                        let at = [i % 5, i / 5 % 5, i / 25].map(|c| c as f64 - 2.0);
                        row[i] * (affine[0] + affine[1] * at[0] + affine[2] * at[1] + affine[3] * at[2])
                    })
                    .sum();
                assert!(sum.abs() < 1e-12, "{room:?}: {sum}");
            }
        }
    }

    #[test]
    fn unit_cells_give_the_stencil_of_the_biharmonic_operator() {
        let row = Rows::new(Matrix3::identity(), 0.0).row([[2; 2]; 3]);
        let at = |x: i32, y: i32, z: i32| row[((x + 2) + 5 * (y + 2) + 25 * (z + 2)) as usize] * 42.0;
        let expected =
            [([0, 0, 0], 42.0), ([1, 0, 0], -12.0), ([2, 0, 0], 1.0), ([1, -1, 0], 2.0), ([1, 1, 1], 0.0)];
        for ([x, y, z], value) in expected {
            for [x, y, z] in [[x, y, z], [y, z, x], [-z, -x, -y]] {
                assert!((at(x, y, z) - value).abs() < 1e-12);
            }
        }
    }

    #[test]
    fn unit_cells_give_a_membrane_the_stencil_of_the_laplacian_and_borders_pull_nothing() {
        let (with, without) = (Rows::new(Matrix3::identity(), 6.0), Rows::new(Matrix3::identity(), 0.0));
        let room = [[2; 2]; 3];
        let at = |x: i32, y: i32, z: i32| {
            let slot = ((x + 2) + 5 * (y + 2) + 25 * (z + 2)) as usize;
            with.row(room)[slot] - without.row(room)[slot]
        };
        for ([x, y, z], value) in
            [([0, 0, 0], 6.0), ([1, 0, 0], -1.0), ([0, -1, 0], -1.0), ([1, 1, 0], 0.0), ([2, 0, 0], 0.0)]
        {
            assert!((at(x, y, z) - value).abs() < 1e-12, "{x} {y} {z}: {}", at(x, y, z));
        }
        // A constant motion has no energy, whatever there is beside a node.
        let rows = Rows::new(sheared_grid([4; 3]).linear_part(), 0.3);
        for code in 0..729_u32 {
            let room: Room = std::array::from_fn(|a| {
                let digit = code / 9_u32.pow(a as u32) % 9;
                [digit as u8 % 3, digit as u8 / 3]
            });
            assert!(rows.row(room).iter().sum::<f64>().abs() < 1e-12, "{room:?}");
        }
    }

    #[test]
    fn energy_of_a_quadratic_motion_is_that_of_its_second_derivatives_in_world_space() {
        // A sheared cell and an upright one of the same world: the same quadratic, the same energy a volume.
        let second = Matrix3::new(1.0, 0.4, -0.3, 0.4, -2.0, 0.7, -0.3, 0.7, 0.5);
        for cell in [
            sheared_grid([4; 3]).linear_part(),
            Matrix3::identity(),
            Matrix3::from_diagonal(&Vector3::new(1.0, 2.0, 9.0)),
        ] {
            let rows = Rows::new(cell, 0.0);
            let inverse = cell.try_inverse().unwrap();
            let largest = (inverse * inverse.transpose()).amax();
            // Σ_n ⅛ Σ_o tr(G H G H), from the differences themselves.
            let index = cell.transpose() * second * cell;
            let h =
                [index[(0, 0)], index[(1, 1)], index[(2, 2)], index[(1, 2)], index[(0, 2)], index[(0, 1)]];
            let sum: f64 = (0..6)
                .flat_map(|f| (0..6).map(move |g| (f, g)))
                .map(|(f, g)| h[f] * rows.weights[(f, g)] * h[g])
                .sum();
            assert!((sum * largest * largest / (second * second).trace() - 1.0).abs() < 1e-10);
        }
    }
}
