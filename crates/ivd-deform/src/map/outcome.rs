use ivd_core::{Displacement, FieldBricks, Frame};
use nalgebra::Vector3;
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

use super::carry::Part;
use crate::Error;
use crate::certificate::{Certificate, Histogram};
use crate::sampler::Sampler;

/// How well the voxels' motion follows the lattice's, at the vertices.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
pub struct Followed {
    /// Largest difference of the map's motion from a vertex's own (mm). Pieces of a lattice that stand still beside a
    /// moving one are dragged along, and count here.
    pub misfit_max_mm: f64,
    /// Root mean square of the difference over the vertices that move at least half as far as the farthest, as a
    /// fraction of their motion (no unit).
    pub misfit: f64,
    /// Volume enclosed by the lattice, at rest and deformed by the map (mm³).
    pub volume_mm3: [f64; 2],
}

/// What the map made.
#[derive(Debug, Clone, PartialEq)]
pub struct Mapped {
    /// The displacement, forward and inverse.
    pub displacement: Displacement,
    /// Voxels that move.
    pub voxels_moved: u64,
    /// Bricks (8³ voxels) with a voxel that moves.
    pub bricks_touched: u64,
    /// Bricks of the grid.
    pub bricks_total: u64,
    /// Smallest proven lower bound of det ∇φ, at most 1.
    pub min_det_j: f64,
    /// Cells that fold: 0, or there would be no map.
    pub folds: u64,
    /// Rounds of local relaxation that were needed.
    pub relaxations: u32,
    /// `k` where the map is a flow in 2ᵏ steps; 0 for the field as carried.
    pub halvings: u32,
    /// Largest `|φ(ψ(y)) − y|` (voxels).
    pub inverse_residual_max_voxel: f64,
    /// det ∇φ at the centres of the cells that move, 0 … 2.
    pub det_j: Histogram,
    /// Lengths of the voxels' motion (mm), 0 … the largest.
    pub motion_mm: Histogram,
    /// Voxels that a part moving alone left behind.
    pub voxels_vacated: u64,
    /// How well the map follows the lattice.
    pub followed: Followed,
}

impl Mapped {
    pub(super) fn new(
        displacement: Displacement,
        certificate: Certificate,
        relaxations: u32,
        halvings: u32,
        followed: Followed,
    ) -> Self {
        let (voxels_moved, motion_mm) = lengths(&displacement.forward);
        Self {
            voxels_moved,
            bricks_touched: displacement.forward.stored() as u64,
            bricks_total: displacement.forward.table().len() as u64,
            min_det_j: certificate.min_det,
            folds: certificate.folded.len() as u64,
            relaxations,
            halvings,
            inverse_residual_max_voxel: displacement.inverse_residual_max,
            det_j: certificate.histogram,
            motion_mm,
            voxels_vacated: displacement.vacated.iter().map(|&v| u64::from(v)).sum(),
            followed,
            displacement,
        }
    }
}

/// Number of vectors that aren't 0, and a histogram of their lengths.
fn lengths(field: &FieldBricks) -> (u64, Histogram) {
    let length = |v: &[f32; 3]| Vector3::from(*v).map(f64::from).norm();
    let most = field.vectors().iter().map(length).fold(0.0, f64::max);
    let mut histogram = Histogram::new(0.0, if most > 0.0 { most } else { 1.0 }, 40);
    let mut moved = 0;
    for v in field.vectors().iter().filter(|v| **v != [0.0; 3]) {
        moved += 1;
        histogram.add(length(v));
    }
    (moved, histogram)
}

impl Followed {
    pub(super) fn measure<N>(part: &Part<'_, N>, field: &FieldBricks, frame: &Frame) -> Self {
        let sampler = Sampler::new(field, &part.lattice.grid);
        let linear = part.lattice.grid.linear_part();
        let moved: Vec<Vector3<f64>> = (0..part.positions.len())
            .into_par_iter()
            .map(|i| linear * sampler.at(part.lattice.voxel(i).0))
            .collect();
        let most = super::largest(frame);
        let (mut worst, mut missed, mut asked) = (0.0_f64, 0.0, 0.0);
        for (got, want) in moved.iter().zip(&frame.displacement) {
            let want = Vector3::from(*want);
            let difference = (got - want).norm();
            worst = worst.max(difference);
            if most > 0.0 && want.norm() >= 0.5 * most {
                missed += (difference / most).powi(2);
                asked += (want.norm() / most).powi(2);
            }
        }
        let misfit = if asked > 0.0 { f64::sqrt(missed / asked) } else { 0.0 };
        let rest = volume(&part.lattice.triangles, |i| part.positions[i]);
        let deformed = volume(&part.lattice.triangles, |i| part.positions[i] + moved[i]);
        Self { misfit_max_mm: worst, misfit, volume_mm3: [rest, deformed] }
    }

    pub(super) fn check(&self, tolerance: f64) -> Result<(), Error> {
        if self.misfit <= tolerance {
            return Ok(());
        }
        Err(Error::Untrusted {
            what: "the map",
            problem: format!(
                "kept free of folds it leaves the lattice behind by {:.0} % of its motion ({:.3} mm at most), more than \
                 the tolerance of {:.0} %",
                100.0 * self.misfit,
                self.misfit_max_mm,
                100.0 * tolerance
            ),
            remedy: "move the handle less, give it a larger radius, or raise the tolerance",
        })
    }
}

/// Volume enclosed by a closed mesh (mm³): a sixth of the triangles' determinants, summed in the order of triangles.
fn volume(triangles: &[[u32; 3]], position: impl Fn(usize) -> Vector3<f64> + Sync) -> f64 {
    let Some(first) = triangles.first() else { return 0.0 };
    let base = position(first[0] as usize);
    let parts: Vec<f64> = triangles
        .par_chunks(1 << 14)
        .map(|chunk| {
            chunk
                .iter()
                .map(|t| {
                    let [a, b, c] = t.map(|v| position(v as usize) - base);
                    a.dot(&b.cross(&c)) / 6.0
                })
                .sum()
        })
        .collect();
    parts.iter().sum()
}
