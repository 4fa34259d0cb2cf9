//! Displacements: free of folds, inverted, and still beyond their reach.

use ivd_core::{Displacement, FieldBricks, Grid, Mask, Motion, VoxelCoord, VoxelIndex, World};
use ivd_map::{Band, MapResult, Outside};
use nalgebra::{Matrix3, Vector3};

use super::Verdict;
use crate::hold;
use crate::stability::seeded::Seeded;

/// Residual of the inverse beyond which the map's own page says that it is refused (voxels).
const RESIDUAL: f64 = 1e-2;
/// Places per cell at which the determinant is looked at, besides the corners.
const PLACES: usize = 2;

/// A map: finite, positive determinants wherever one looks and never below its certificate, an inverse that leads back,
/// nothing where nothing moves.
///
/// # Errors
/// The first thing that doesn't hold.
pub fn mapped(motion: &Motion, inside: &Mask, band: &Band, found: &MapResult) -> Verdict {
    let moved = &found.displacement;
    finite(moved.forward())?;
    finite(moved.inverse())?;
    hold!(
        found.figures.min_det_j > 0.0 && found.figures.min_det_j <= 1.0,
        "least determinant {}",
        found.figures.min_det_j
    );
    hold!(
        found.figures.min_det_j == moved.min_det_j(),
        "{} or {}",
        found.figures.min_det_j,
        moved.min_det_j()
    );
    hold!(found.figures.folds == 0, "{} folds", found.figures.folds);
    let counts = |cell: [i64; 3]| band.outside == Outside::Band || touches(inside, cell);
    determinants(moved.forward(), moved.grid(), moved.min_det_j(), counts)?;
    inverse(moved, band.outside == Outside::Band)?;
    reach(motion, band, moved)?;
    if motion.max_displacement() == 0.0 {
        hold!(
            moved.is_identity() && found.figures.voxels_moved == 0,
            "nothing moves, {} voxels do",
            found.figures.voxels_moved
        );
    }
    Ok(())
}

fn finite(field: &FieldBricks) -> Verdict {
    let at = field.vectors().iter().position(|v| !v.iter().all(|c| c.is_finite()));
    hold!(at.is_none(), "vector {at:?} isn't finite");
    Ok(())
}

/// Whether a corner of the cell lies in the part.
fn touches(inside: &Mask, cell: [i64; 3]) -> bool {
    let grid = inside.grid();
    corners(cell).any(|at| inside.inside()[grid.linear(clamped(grid, at))] != 0)
}

fn corners(cell: [i64; 3]) -> impl Iterator<Item = [i64; 3]> {
    (0..8_usize).map(move |i| std::array::from_fn(|a| cell[a] + (i >> a & 1) as i64))
}

fn clamped(grid: &Grid, at: [i64; 3]) -> VoxelIndex {
    VoxelIndex(std::array::from_fn(|a| at[a].clamp(0, grid.dims()[a] as i64 - 1) as usize))
}

/// Displacement of a voxel (voxels).
fn at(field: &FieldBricks, grid: &Grid, to_voxel: &Matrix3<f64>, voxel: [i64; 3]) -> Vector3<f64> {
    to_voxel * Vector3::from(field.at(clamped(grid, voxel))).map(f64::from)
}

/// Determinants in every cell that moves, beyond the border too, at its corners and at random places: the derivative of
/// the trilinear interpolant, written out.
fn determinants(field: &FieldBricks, grid: &Grid, least: f64, counts: impl Fn([i64; 3]) -> bool) -> Verdict {
    let (to_voxel, n) = (grid.inverse_linear_part(), grid.dims().map(|n| n as i64));
    let mut random = Seeded::new(field.stored() as u64);
    for z in -1..n[2] {
        for y in -1..n[1] {
            for x in -1..n[0] {
                let cell = [x, y, z];
                if corners(cell).all(|c| field.at(clamped(grid, c)) == [0.0; 3]) || !counts(cell) {
                    continue;
                }
                let u: Vec<Vector3<f64>> = corners(cell).map(|c| at(field, grid, &to_voxel, c)).collect();
                let most = u.iter().map(Vector3::amax).fold(1.0, f64::max);
                let ends = (0..8_usize).map(|i| Vector3::from_fn(|a, _| (i >> a & 1) as f64));
                let within: Vec<Vector3<f64>> =
                    (0..PLACES).map(|_| Vector3::from_fn(|_, _| random.unit())).collect();
                for t in ends.chain(within) {
                    let det = (Matrix3::identity() + gradient(&u, t)).determinant();
                    // A product of three sums of differences of displacements.
                    let slack = 1e-12 * (2.0 * most).powi(3);
                    hold!(det >= least - slack, "determinant {det} in cell {cell:?}, certified {least}");
                }
            }
        }
    }
    Ok(())
}

/// Column `a` is the derivative along axis `a` of the trilinear interpolant of eight corners.
fn gradient(u: &[Vector3<f64>], t: Vector3<f64>) -> Matrix3<f64> {
    Matrix3::from_columns(&std::array::from_fn::<_, 3, _>(|axis| {
        (0..8_usize).fold(Vector3::zeros(), |sum, i| {
            let weight = |a: usize| match (i >> a & 1 == 1, a == axis) {
                (true, true) => 1.0,
                (false, true) => -1.0,
                (true, false) => t[a],
                (false, false) => 1.0 - t[a],
            };
            sum + u[i] * (weight(0) * weight(1) * weight(2))
        })
    }))
}

/// Every voxel that the inverse moves is led back, within the residual that is stated, and a voxel that the map leaves in
/// place is its own origin.
fn inverse(moved: &Displacement, whole: bool) -> Verdict {
    let grid = moved.grid();
    let to_voxel = grid.inverse_linear_part();
    hold!(moved.inverse_residual_max() <= RESIDUAL, "residual {}", moved.inverse_residual_max());
    for i in 0..grid.len() {
        let voxel = grid.index(i);
        let back = moved.inverse().at(voxel);
        let y = VoxelCoord::from(voxel).0;
        if back == [0.0; 3] {
            // A motion that no coordinate shows has the voxel itself as its origin, rounded.
            let there = to_voxel * Vector3::from(moved.forward().at(voxel)).map(f64::from);
            let still = y + there == y || moved.inverse_residual_max() > 0.0 || !whole;
            hold!(still, "voxel {:?} moves by {there:?} and is its own origin", voxel.0);
            continue;
        }
        hold!(
            !whole || moved.forward().at(voxel) != [0.0; 3],
            "voxel {:?} is still and comes from afar",
            voxel.0
        );
        let x = y + to_voxel * Vector3::from(back).map(f64::from);
        leads_back(moved, voxel, x)?;
    }
    Ok(())
}

/// What is at `x` (voxels) is carried to the voxel, within the residual that is stated.
fn leads_back(moved: &Displacement, voxel: VoxelIndex, x: Vector3<f64>) -> Verdict {
    let (y, to_voxel) = (VoxelCoord::from(voxel).0, moved.grid().inverse_linear_part());
    let residual = (x + to_voxel * moved.forward().sample(x) - y).norm();
    // Both sample the same field; one in voxels, the other in millimetres.
    let most = moved.inverse_residual_max() + 1e-9 * (1.0 + (x - y).norm());
    hold!(
        residual <= most,
        "voxel {:?}: {residual} voxels off, stated {}",
        voxel.0,
        moved.inverse_residual_max()
    );
    Ok(())
}

/// Beyond the handles' balls and the margin nothing moves, bit for bit, either way.
fn reach(motion: &Motion, band: &Band, moved: &Displacement) -> Verdict {
    let grid = moved.grid();
    let least = 2.0 * grid.voxel_diagonal();
    let margin = band.margin.unwrap_or((4.0 * motion.max_displacement()).max(least));
    for i in 0..grid.len() {
        let voxel = grid.index(i);
        let World(place) = grid.world(voxel.into());
        let out = motion.reach().iter().all(|b| {
            let slack = 1e-9 * (place.amax() + b.radius + margin);
            b.distance(World(place)) > margin + slack
        });
        if out && !motion.reach().is_empty() {
            let still = moved.forward().at(voxel) == [0.0; 3] && moved.inverse().at(voxel) == [0.0; 3];
            let vacated = moved.vacated().get(i).is_some_and(|v| *v != 0);
            let beyond = motion
                .reach()
                .iter()
                .map(|b| b.distance(World(place)) - margin)
                .fold(f64::INFINITY, f64::min);
            let (there, back) = (moved.forward().at(voxel), moved.inverse().at(voxel));
            hold!(
                still && !vacated,
                "voxel {:?} is {beyond} mm out of reach (margin {margin}) and moves: {there:?} and {back:?}, left {vacated}",
                voxel.0
            );
        }
    }
    Ok(())
}

/// What steps in space made: finite, positive determinants in every cell that isn't torn and never below the certificate, an inverse
/// that leads back to the side that it says.
///
/// # Errors
/// The first thing that doesn't hold.
pub fn displaced(made: &ivd_map::space::Made) -> Verdict {
    let moved = &made.displacement;
    finite(moved.forward())?;
    finite(moved.inverse())?;
    hold!(
        made.figures.min_det_j > 0.0 && made.figures.min_det_j <= 1.0,
        "least determinant {}",
        made.figures.min_det_j
    );
    hold!(
        made.figures.folds == 0 && made.figures.parts >= 1,
        "{} folds in {} parts",
        made.figures.folds,
        made.figures.parts
    );
    hold!(
        made.figures.parts > 1 || made.figures.short_mm == 0.0,
        "{} mm short at once",
        made.figures.short_mm
    );
    let grid = moved.grid();
    let n = grid.dims().map(|n| n as i64);
    let left = !moved.vacated().is_empty() && !moved.has_cut();
    let beyond = |cell: [i64; 3]| (0..3).any(|a| cell[a] < 0 || cell[a] + 1 >= n[a]);
    determinants(moved.forward(), grid, made.figures.min_det_j, |cell| {
        !(moved.cell_is_cut(cell) || left && beyond(cell))
    })?;
    hold!(moved.inverse_residual_max() <= RESIDUAL, "residual {}", moved.inverse_residual_max());
    let to_voxel = grid.inverse_linear_part();
    for i in 0..grid.len() {
        let voxel = grid.index(i);
        let back = moved.inverse().at(voxel);
        let vacated = moved.vacated().get(i).is_some_and(|flag| *flag != 0);
        if back == [0.0; 3] || vacated {
            continue;
        }
        let y = VoxelCoord::from(voxel).0;
        let x = y + to_voxel * Vector3::from(back).map(f64::from);
        let cell: [i64; 3] = std::array::from_fn(|a| (x[a].floor() as i64).clamp(-1, n[a] - 1));
        // Beyond the grid each side of a cut goes on in its own way, of which the field has one only.
        if moved.cell_is_cut(cell) || (left || moved.has_cut()) && beyond(cell) {
            continue;
        }
        leads_back(moved, voxel, x)?;
        let from = moved.sides().get(i).map_or(0, |side| side >> 2);
        let others = corners(cell)
            .map(|c| moved.sides().get(grid.linear(clamped(grid, c))).map_or(0, |side| side & 3));
        let other = others.into_iter().find(|side| from != 0 && *side != 0 && *side != from);
        hold!(other.is_none(), "voxel {:?} comes from side {from}, out of a cell of side {other:?}", voxel.0);
    }
    Ok(())
}

/// An inverse of a field by itself: finite, and what the map gave.
///
/// # Errors
/// The first thing that doesn't hold.
pub fn inverted(found: &ivd_field::inverse::Inverse, moved: &Displacement) -> Verdict {
    finite(&found.field)?;
    hold!(found.residual_max_voxels.is_finite(), "residual {}", found.residual_max_voxels);
    hold!(found.field == *moved.inverse(), "another inverse than the map's");
    hold!(found.residual_max_voxels == moved.inverse_residual_max(), "another residual than the map's");
    Ok(())
}
