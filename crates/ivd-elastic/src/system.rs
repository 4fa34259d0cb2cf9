//! Energy and forces of a body: its cells, what pulls at it, and what loads it.

use nalgebra::{Matrix3, Vector3};
use rayon::prelude::*;

use crate::material::{Hexahedron, Matter};
use crate::mesh::Mesh;
use crate::slopes::Corners;
use crate::vectors::{ROWS, Triple};

/// A place that is to move by `goal`, by a spring and by the force that the spring has been relieved of.
#[derive(Debug, Clone)]
pub struct Pull {
    /// The cell that holds it.
    pub cell: u32,
    /// The vertex of a lattice that it is.
    pub vertex: u32,
    /// Of the cell's corners at the place.
    pub weights: [f64; 8],
    /// Stiffness (N/m in units of the modulus: mm).
    pub spring: f64,
    /// Motion (mm) that is asked for.
    pub goal: Vector3<f64>,
    /// Force on the body, of the augmented Lagrangian (Hestenes 1969; Powell 1969).
    pub multiplier: Vector3<f64>,
}

impl Pull {
    /// How far the place is from its goal (mm).
    pub fn left(&self, corners: &Corners) -> Vector3<f64> {
        let mut sum = -self.goal;
        for (w, u) in self.weights.iter().zip(corners) {
            sum += Vector3::from(*u) * *w;
        }
        sum
    }
}

/// A body in equilibrium, or on the way to it.
pub struct Body {
    /// Its cells and nodes.
    pub mesh: Mesh,
    /// The shape of a finest cell.
    pub element: Hexahedron,
    /// What every cell is made of.
    pub matter: Vec<Matter>,
    /// By cell.
    pulls: Vec<Pull>,
    ranges: Vec<std::ops::Range<usize>>,
    /// Forces at the nodes.
    pub loads: Vec<Triple>,
    /// Cells, corners and weights by node.
    touches: Vec<Vec<(u32, u8, f64)>>,
    /// About what each node resists being moved with (modulus · mm), by the matter that touches it.
    stiffness: Vec<f64>,
    /// Of a finest cell, about (mm).
    edge: f64,
}

/// What acts on the nodes.
pub(crate) struct Forces {
    /// Derivative of the energy; 0 at held nodes.
    pub(crate) left: Vec<Triple>,
    /// How far (mm) it would move each node against what touches it, matter that is pressed at a corner included: where matter is soft small
    /// forces count too.
    pub(crate) left_by_node: Vec<f64>,
    /// The same of the sizes of the forces that cancel, of all nodes: the root of the sum of squares.
    pub(crate) cancelled_mm: f64,
}

impl Forces {
    /// How far (mm) what is left would move the nodes: the root of the sum of squares.
    pub(crate) fn left_mm(&self) -> f64 {
        self.left_by_node.iter().map(|l| l * l).sum::<f64>().sqrt()
    }
}

impl Body {
    /// A body without loads.
    pub fn new(mesh: Mesh, element: Hexahedron, matter: Vec<Matter>, mut pulls: Vec<Pull>) -> Self {
        pulls.sort_by_key(|p| (p.cell, p.vertex));
        let mut ranges = vec![0..0; mesh.cells.len()];
        let mut start = 0;
        for run in pulls.chunk_by(|p, q| p.cell == q.cell) {
            ranges[run[0].cell as usize] = start..start + run.len();
            start += run.len();
        }
        let mut touches = vec![Vec::new(); mesh.nodes.len()];
        for cell in 0..mesh.cells.len() {
            for corner in 0..8 {
                for (node, weight) in mesh.corner(cell, corner) {
                    touches[*node as usize].push((cell as u32, corner as u8, *weight));
                }
            }
        }
        let loads = vec![[0.0; 3]; mesh.nodes.len()];
        let edge = element.volume(8.0).cbrt();
        let stiffness = |&(cell, _, weight): &(u32, u8, f64)| {
            let mu: f64 = matter[cell as usize].iter().map(|lame| lame.mu).sum::<f64>() / 8.0;
            mu * edge * f64::from(mesh.cells[cell as usize].size) * weight * weight
        };
        let stiffness = touches.iter().map(|t| t.iter().map(stiffness).sum::<f64>()).collect();
        Self { mesh, element, matter, pulls, ranges, loads, touches, stiffness, edge }
    }

    /// What pulls at it, by cell.
    pub fn pulls(&self) -> &[Pull] {
        &self.pulls
    }

    /// The same, to be changed; not the cells.
    pub fn pulls_mut(&mut self) -> &mut [Pull] {
        &mut self.pulls
    }

    pub(crate) fn pulls_of(&self, cell: usize) -> &[Pull] {
        &self.pulls[self.ranges[cell].clone()]
    }

    /// The energy, and the size of the terms that its rounding comes from; `None` where J ≤ 0 at a Gauss point.
    pub fn energy(&self, u: &[Triple]) -> Option<(f64, f64)> {
        let part = |cells: &[usize]| {
            let (mut sum, mut size) = (0.0, 0.0);
            for &cell in cells {
                let own = self.cell_energy(cell, &self.mesh.gather(cell, u))?;
                (sum, size) = (sum + own.0, size + own.1);
            }
            Some((sum, size))
        };
        let all: Vec<usize> = (0..self.mesh.cells.len()).collect();
        let parts: Vec<Option<(f64, f64)>> = all.par_chunks(ROWS).map(part).collect();
        let mut total = (0.0, 0.0);
        for part in parts {
            let (sum, size) = part?;
            total = (total.0 + sum, total.1 + size);
        }
        for (f, u) in self.loads.iter().zip(u) {
            let term = f[0] * u[0] + f[1] * u[1] + f[2] * u[2];
            total = (total.0 - term, total.1 + term.abs());
        }
        Some(total)
    }

    /// The energy of a cell and of what pulls at it, and the size of the terms.
    pub(crate) fn cell_energy(&self, cell: usize, corners: &Corners) -> Option<(f64, f64)> {
        let edge = f64::from(self.mesh.cells[cell].size);
        let (mut sum, mut size) = self.element.energy(&self.matter[cell], edge, corners)?;
        let mut add = |term: f64| (sum, size) = (sum + term, size + term.abs());
        for pull in self.pulls_of(cell) {
            let left = pull.left(corners);
            add(0.5 * pull.spring * left.norm_squared());
            add(pull.multiplier.dot(&left));
        }
        Some((sum, size))
    }

    /// Derivative of the energy by the nodes.
    pub(crate) fn forces(&self, u: &[Triple]) -> Forces {
        let (forces, resists) = self.cell_forces(u);
        let of = |node: usize| {
            if self.mesh.held[node] {
                return ([0.0; 3], (0.0, 0.0));
            }
            let load = -Vector3::from(self.loads[node]);
            let (sum, size) = self.sum(node, &forces, load);
            let pressed = |(cell, _, weight): &(u32, u8, f64)| {
                let size = f64::from(self.mesh.cells[*cell as usize].size);
                resists[*cell as usize] * self.edge * size * weight * weight
            };
            let stiffness = self.stiffness[node] + self.touches[node].iter().map(pressed).sum::<f64>();
            (sum.into(), (sum.norm() / stiffness, size / stiffness))
        };
        let (left, lengths): (Vec<Triple>, Vec<(f64, f64)>) =
            (0..self.mesh.nodes.len()).into_par_iter().map(of).unzip();
        let (left_by_node, cancelled): (Vec<f64>, Vec<f64>) = lengths.into_iter().unzip();
        Forces { left, left_by_node, cancelled_mm: cancelled.iter().map(|l| l * l).sum::<f64>().sqrt() }
    }

    /// Forces that hold the nodes where they are against the matter (modulus · mm²).
    pub fn reactions(&self, u: &[Triple]) -> Vec<Triple> {
        let (forces, _) = self.cell_forces(u);
        let of = |node| self.sum(node, &forces, Vector3::zeros()).0.into();
        (0..self.mesh.nodes.len()).into_par_iter().map(of).collect()
    }

    /// What the cells' corners are pushed by, at the nodes; 0 at held ones.
    pub(crate) fn at_free_nodes(&self, forces: &[Corners]) -> Vec<Triple> {
        let of = |node: usize| {
            let mut sum = [0.0; 3];
            if !self.mesh.held[node] {
                for (cell, corner, weight) in &self.touches[node] {
                    let force = &forces[*cell as usize][*corner as usize];
                    sum = std::array::from_fn(|a| sum[a] + weight * force[a]);
                }
            }
            sum
        };
        (0..self.mesh.nodes.len()).into_par_iter().with_min_len(ROWS).map(of).collect()
    }

    /// Blocks of the cells' corners, summed at the nodes; 0 at held ones.
    pub(crate) fn sum_blocks(&self, blocks: &[[Matrix3<f64>; 8]]) -> Vec<Matrix3<f64>> {
        let of = |node: usize| {
            if self.mesh.held[node] {
                return Matrix3::zeros();
            }
            let own = |(cell, corner, weight): &(u32, u8, f64)| {
                blocks[*cell as usize][*corner as usize] * (weight * weight)
            };
            self.touches[node].iter().map(own).sum()
        };
        (0..self.mesh.nodes.len()).into_par_iter().map(of).collect()
    }

    /// Forces at the corners of every cell, and the most that one of these resists being pressed with.
    fn cell_forces(&self, u: &[Triple]) -> (Vec<Corners>, Vec<f64>) {
        (0..self.mesh.cells.len())
            .into_par_iter()
            .map(|cell| self.cell_force(cell, &self.mesh.gather(cell, u)))
            .unzip()
    }

    /// Forces at the corners of a cell, and the most that one of these resists being pressed with.
    pub(crate) fn cell_force(&self, cell: usize, corners: &Corners) -> (Corners, f64) {
        let edge = f64::from(self.mesh.cells[cell].size);
        let (mut out, resists) = self.element.forces(&self.matter[cell], edge, corners);
        for pull in self.pulls_of(cell) {
            let force = pull.left(corners) * pull.spring + pull.multiplier;
            for (out, w) in out.iter_mut().zip(pull.weights) {
                *out = [out[0] + w * force[0], out[1] + w * force[1], out[2] + w * force[2]];
            }
        }
        (out, resists)
    }

    /// Cells, corners and weights that a node is part of.
    pub(crate) fn touched(&self, node: usize) -> &[(u32, u8, f64)] {
        &self.touches[node]
    }

    /// The sum of forces at a node, and of their sizes, with one that acts there.
    fn sum(&self, node: usize, forces: &[Corners], own: Vector3<f64>) -> (Vector3<f64>, f64) {
        let (mut sum, mut size) = (own, own.norm());
        for (cell, corner, weight) in &self.touches[node] {
            let force = Vector3::from(forces[*cell as usize][*corner as usize]) * *weight;
            size += force.norm();
            sum += force;
        }
        (sum, size)
    }
}
