//! A displacement from one field that is given: by another program, or by hand.

use ivd_core::{Displacement, FieldBricks, Grid, VoxelCoord, counted};

use crate::Error;
use crate::certificate::{Certificate, THIN, certify};
use crate::inverse::invert;
use crate::sampler::{Sampler, brick_at, brick_voxels};
use ivd_core::Exec;
use nalgebra::Vector3;
use rayon::prelude::*;

/// Which way a given field leads.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Leads {
    /// Rest to deformed.
    Forward,
    /// Deformed to rest, as resamplers take it.
    Inverse,
}

/// A displacement, certified, and what the certificate tells of its forward field.
#[derive(Debug, Clone, PartialEq)]
pub struct Given {
    /// The given field as it is, and the other one as its inverse.
    pub displacement: Displacement,
    /// Of the forward field.
    pub certificate: Certificate,
}

/// Makes a displacement of one field (mm) on a grid: the other one is its inverse. Both are proven free of folds.
///
/// # Errors
/// [`Error::Untrusted`] where a field folds, with the voxel, or has no inverse; a field of other dims; cancellation.
pub fn displacement(grid: Grid, field: FieldBricks, leads: Leads, exec: &Exec) -> Result<Given, Error> {
    let proven = |field: &FieldBricks, what: &'static str| {
        let proof = certify(field, &grid, THIN, |_| true, exec)?;
        match proof.worst.filter(|_| !proof.holds()) {
            None => Ok(proof),
            Some(fold) => {
                let at: [f64; 3] =
                    grid.world(VoxelCoord(Vector3::from(fold.cell.map(|c| c as f64)))).0.into();
                Err(Error::Untrusted {
                    what,
                    problem: format!(
                        "it folds in {}, worst at voxel {:?} of the grid that it lies on, at {at:.1?} mm, where det J falls to {:.3}",
                        counted(proof.folded.len(), "cell", "cells"),
                        fold.cell,
                        fold.lower
                    ),
                    remedy: "give a field that is one-to-one; check its direction and its unit (mm)",
                })
            }
        }
    };
    let given = proven(&field, "the field")?;
    let other = invert(&field, &grid, exec)?;
    other.check_residual("the field's inverse", "give a field that is one-to-one")?;
    let inverse = proven(&other.field, "the field's inverse")?;
    let (forward, back, certificate) = match leads {
        Leads::Forward => (field, other.field, given),
        Leads::Inverse => (other.field, field, inverse),
    };
    let displacement = Displacement::new(grid, forward, back)?
        .with_inverse_residual_max(other.residual_max_voxels)
        .with_min_det_j(certificate.min_det);
    Ok(Given { displacement, certificate })
}

/// The same field (mm) at the voxels of another grid, linear between its own; beyond its own grid it goes on as at its border.
///
/// - `from`: the grid of `field`; `onto`: that of the result.
///
/// # Errors
/// [`ivd_core::Error::MemoryLimit`], [`ivd_core::Error::Cancelled`].
pub fn resampled(field: &FieldBricks, from: &Grid, onto: &Grid, exec: &Exec) -> Result<FieldBricks, Error> {
    let sampler = Sampler::new(field, from);
    let to_mm = from.linear_part();
    // From voxels to voxels: no matrix is inverted for each of them.
    let first = from.voxel(onto.world(VoxelCoord(Vector3::zeros()))).0;
    let to_from = from.inverse_linear_part() * onto.linear_part();
    let size = onto.dims().map(|n| n.div_ceil(FieldBricks::SIDE));
    exec.check_memory("the field on the other grid", 36 * onto.len() as u64)?;
    let brick = |at: usize| {
        let mut vectors = [[0.0_f32; 3]; FieldBricks::VOXELS];
        for (slot, voxel) in brick_voxels(onto.dims(), brick_at(size, at)) {
            let moved = to_mm * sampler.at(first + to_from * VoxelCoord::from(voxel).0);
            vectors[slot] = moved.map(|c| c as f32 + 0.0).into();
        }
        vectors.iter().any(|v| *v != [0.0; 3]).then_some((at, vectors))
    };
    let made: Vec<_> = (0..size.iter().product())
        .into_par_iter()
        .filter_map(|at| if exec.cancel.is_cancelled() { None } else { brick(at) })
        .collect();
    exec.check_cancelled()?;
    let moving: Vec<usize> = made.iter().map(|(at, _)| *at).collect();
    let vectors: Vec<[f32; 3]> = made.into_iter().flat_map(|(_, vectors)| vectors).collect();
    FieldBricks::of_bricks(onto.dims(), &moving, vectors.into())
}

#[cfg(test)]
mod tests {
    use super::*;
    use ivd_core::VoxelIndex;

    #[test]
    fn a_linear_field_is_the_same_at_the_voxels_of_a_finer_turned_grid() {
        let affine = |p: Vector3<f64>| Vector3::new(0.1 * p.x + 0.05 * p.y, 0.3 - 0.02 * p.z, 0.04 * p.x);
        let coarse = Grid::new(
            [9, 10, 8],
            [4.0, 3.0, 5.0],
            [-18.0, -15.0, -20.0],
            [[0.0, 1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]],
        );
        let coarse = coarse.unwrap();
        let field = crate::fixtures::field(&coarse, |off| affine(Vector3::from(coarse.origin()) + off));
        let (s, c) = 0.4_f64.sin_cos();
        let fine = Grid::new(
            [20, 17, 11],
            [0.7; 3],
            [-9.0, -6.0, -4.0],
            [[c, s, 0.0], [-s, c, 0.0], [0.0, 0.0, 1.0]],
        )
        .unwrap();
        let made = resampled(&field, &coarse, &fine, &Exec::default()).unwrap();
        for voxel in (0..fine.len()).map(|linear| fine.index(linear)) {
            let wanted = affine(fine.world(voxel.into()).0);
            let is = Vector3::from(made.at(voxel)).map(f64::from);
            assert!((is - wanted).norm() < 1e-5, "{voxel:?}: {is} for {wanted}");
        }
        // Beyond its own grid the field is that of the nearest border voxel.
        let beside = Grid::new([2, 2, 2], [1.0; 3], [500.0, 0.0, 0.0], coarse.direction()).unwrap();
        let far = resampled(&field, &coarse, &beside, &Exec::default()).unwrap().at(VoxelIndex([0; 3]));
        let border = affine(Vector3::new(9.0, 0.0, 0.0));
        assert!((Vector3::from(far).map(f64::from) - border).norm() < 1e-5, "{far:?} for {border}");
    }

    /// Everything is stretched along x about the left end by a share.
    fn stretched(share: f32) -> (Grid, FieldBricks) {
        let grid = Grid::with_spacing([8; 3], [0.5, 1.0, 1.0]).unwrap();
        let vectors: Vec<[f32; 3]> = (0..512).map(|i| [share * 0.5 * (i % 8) as f32, 0.0, 0.0]).collect();
        (grid, FieldBricks::new([8; 3], vec![0], vectors.into()).unwrap())
    }

    #[test]
    fn a_field_given_one_way_is_the_inverse_of_the_same_given_the_other() {
        let exec = Exec::default();
        let (grid, field) = stretched(0.25);
        let there = displacement(grid.clone(), field.clone(), Leads::Forward, &exec).unwrap();
        let back = displacement(grid, field.clone(), Leads::Inverse, &exec).unwrap();
        assert_eq!((there.displacement.forward(), back.displacement.inverse()), (&field, &field));
        assert_eq!(there.displacement.inverse(), back.displacement.forward());
        // x + x/4 = y: what comes to voxel 5, at 2.5 mm, was at 2 mm.
        let from = there.displacement.inverse().at(VoxelIndex([5, 3, 3]));
        assert!((from[0] + 0.5).abs() < 1e-6, "{from:?}");
        assert!((there.displacement.min_det_j() - 1.25).abs() < 0.3 && there.certificate.holds());
        assert!(back.displacement.min_det_j() < 0.81);
    }

    #[test]
    fn a_field_that_folds_is_refused_with_its_place() {
        let (grid, field) = stretched(-1.5);
        let error = displacement(grid, field, Leads::Inverse, &Exec::default()).unwrap_err().to_string();
        assert!(error.contains("folds in") && error.contains("direction"), "{error}");
    }
}
