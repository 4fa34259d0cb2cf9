//! A displacement from one field that is given: by another program, or by hand.

use ivd_core::{Displacement, FieldBricks, Grid};

use crate::Error;
use crate::certificate::{Certificate, THIN, certify};
use crate::inverse::invert;
use ivd_core::Exec;

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
        match proof.folded.first() {
            None => Ok(proof),
            Some(fold) => Err(Error::Untrusted {
                what,
                problem: format!(
                    "it folds in {} cells, the first at voxel {:?}, where det J falls to {:.3}",
                    proof.folded.len(),
                    fold.cell,
                    fold.lower
                ),
                remedy: "give a field that is one-to-one; check its direction and its unit (mm)",
            }),
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

#[cfg(test)]
mod tests {
    use super::*;
    use ivd_core::VoxelIndex;

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
