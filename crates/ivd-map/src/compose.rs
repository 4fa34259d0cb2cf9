//! Halving: where one step folds, many small ones may not.
//!
//! `φ` is replaced by `φ₁∘φ₁∘…`, `2ᵏ` times, with `φ₁ = id + u/2ᵏ`: scaling and squaring (Arsigny et al. 2006). Each
//! doubling is resampled at the voxels and the result certified again, since a composition of fold-free maps is fold-free
//! but its trilinear interpolant need not be.

use ivd_core::{Error, Exec, FieldBricks, Grid, NO_BRICK, VoxelCoord};
use ivd_field::certificate::{Certificate, Detail, THIN, certify_bricks, touched};
use ivd_field::inverse::from_bricks;
use ivd_field::sampler::{Sampler, brick_at, brick_voxels};
use nalgebra::Vector3;
use rayon::prelude::*;

/// Most halvings.
pub(super) const HALVINGS: u32 = 6;

/// A composed field that is certified, or the certificate of the last try.
pub(super) enum Composed {
    Found { field: FieldBricks, certificate: Certificate, halvings: u32 },
    Folded(Certificate),
}

/// Halves and composes `field` until it is certified.
pub(super) fn halve(
    field: &FieldBricks,
    grid: &Grid,
    first: Certificate,
    counts: &(impl Fn([i64; 3]) -> bool + Sync),
    detail: Detail,
    exec: &Exec,
) -> Result<Composed, Error> {
    let proof = |field: &FieldBricks, detail| {
        certify_bricks(field, grid, THIN, counts, &touched(field), detail, exec)
    };
    let mut last = first;
    for halvings in 1..=HALVINGS {
        exec.check_cancelled()?;
        let mut step = scaled(field, 0.5_f32.powi(halvings as i32))?;
        let step_certificate = proof(&step, Detail::least(exec))?;
        if !step_certificate.holds() {
            last = step_certificate;
            continue;
        }
        for _ in 0..halvings {
            step = squared(&step, grid)?;
        }
        last = proof(&step, detail)?;
        if last.holds() {
            return Ok(Composed::Found { field: step, certificate: last, halvings });
        }
    }
    Ok(Composed::Folded(last))
}

fn scaled(field: &FieldBricks, factor: f32) -> Result<FieldBricks, Error> {
    let vectors: Vec<[f32; 3]> = field.vectors().iter().map(|v| v.map(|c| c * factor)).collect();
    FieldBricks::new(field.dims(), field.table().to_vec(), vectors.into())
}

/// `φ∘φ` at the voxels: `u(x) + u(x + u(x))`.
fn squared(field: &FieldBricks, grid: &Grid) -> Result<FieldBricks, Error> {
    let sampler = Sampler::new(field, grid);
    let linear = grid.linear_part();
    let stored: Vec<usize> = (0..field.table().len()).filter(|&b| field.table()[b] != NO_BRICK).collect();
    let bricks: Vec<Box<[[f32; 3]]>> = stored
        .par_iter()
        .map(|&brick| {
            let old = field.brick(brick).expect("the brick is stored");
            let mut out = vec![[0.0_f32; 3]; FieldBricks::VOXELS].into_boxed_slice();
            for (slot, voxel) in brick_voxels(field.dims(), brick_at(field.brick_dims(), brick)) {
                if old[slot] != [0.0; 3] {
                    let first = Vector3::from(old[slot]).map(f64::from);
                    let at = VoxelCoord::from(voxel).0 + grid.inverse_linear_part() * first;
                    out[slot] = (first + linear * sampler.at(at)).map(|c| c as f32).into();
                }
            }
            out
        })
        .collect();
    from_bricks(field.dims(), &stored, bricks.into_iter())
}

#[cfg(test)]
mod tests {
    use super::*;
    use ivd_field::certificate::certify;
    use ivd_field::fixtures::{bump, field, middle, sheared_grid, voxels};

    #[test]
    fn a_bump_beyond_its_fold_limit_becomes_a_flow_without_folds() {
        let grid = Grid::with_spacing([40, 40, 40], [1.0; 3]).unwrap();
        let u = field(&grid, bump(middle(&grid), 12.0, Vector3::new(0.0, 0.0, 8.0)));
        let first = certify(&u, &grid, THIN, |_| true, &Exec::default()).unwrap();
        assert!(!first.holds());
        let Composed::Found { field, certificate, halvings } =
            halve(&u, &grid, first, &|_| true, Detail::All, &Exec::default()).unwrap()
        else {
            panic!("still folded");
        };
        assert!(certificate.holds() && certificate.min_det > 0.0 && halvings <= 3, "{halvings} halvings");
        assert!(voxels(&grid).all(|v| (u.at(v) == [0.0; 3]) == (field.at(v) == [0.0; 3])));
    }

    #[test]
    fn squaring_a_linear_map_squares_its_matrix() {
        let grid = sheared_grid([24, 24, 24]);
        let centre = middle(&grid);
        let m = nalgebra::Matrix3::new(0.05, 0.1, 0.0, -0.1, -0.04, 0.03, 0.02, 0.0, 0.05);
        let twice = squared(&field(&grid, |p| m * (p - centre)), &grid).unwrap();
        let expected = field(&grid, |p| (m * m + m * 2.0) * (p - centre));
        for v in voxels(&grid).filter(|v| v.0.iter().all(|c| (8..16).contains(c))) {
            let d = Vector3::from(twice.at(v)) - Vector3::from(expected.at(v));
            assert!(d.norm() < 1e-5);
        }
    }
}
