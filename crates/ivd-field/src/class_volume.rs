//! How much volume every class of voxels gains or loses by a deformation.

use std::collections::BTreeMap;

use ivd_core::{Displacement, Exec, Labels, NO_BRICK, VoxelIndex};
use nalgebra::{Matrix3, Vector3};
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

use crate::Error;
use crate::sampler::{Sampler, brick_at, gradient};

/// A class at rest and deformed.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct ClassVolume {
    /// Label of the class.
    pub class: u16,
    /// Volume at rest (mm³).
    pub rest_mm3: f64,
    /// What it gains, below 0 what it loses (mm³).
    pub change_mm3: f64,
}

/// Volume and change of every class that the labels list, by ascending label; of every label that occurs where one that isn't
/// listed moves.
///
/// A voxel's box gains `∫ (det ∇φ − 1)` over itself. Between eight voxels φ is trilinear, so that two Gauss points an axis give the
/// integral over their cell exactly; what a point gives goes to the voxel nearest to it. So the changes of all classes sum to that of
/// the grid, which is 0 where nothing moves at its border. Only bricks that move, and their neighbours, are looked at. What lies
/// within a voxel of a cut counts as unchanged: between the sides there is no motion to be measured.
///
/// # Errors
/// Labels on another grid, and cancelling.
pub fn by_class(
    displacement: &Displacement,
    labels: &Labels,
    exec: &Exec,
) -> Result<Vec<ClassVolume>, Error> {
    let grid = displacement.grid();
    grid.require(labels.grid(), "displacement", "labels")?;
    exec.run(|| {
        let voxel_mm3 = grid.linear_part().determinant().abs();
        let mut changes: BTreeMap<u16, f64> = BTreeMap::new();
        let bricks: Vec<BTreeMap<u16, f64>> = touched(displacement)
            .into_par_iter()
            .map(|brick| {
                exec.check_cancelled()?;
                Ok(change_in(displacement, labels, brick))
            })
            .collect::<Result<_, Error>>()?;
        // Summed in the order of bricks, whoever did which.
        for (class, change) in bricks.into_iter().flatten() {
            *changes.entry(class).or_insert(0.0) += change;
        }
        let mut voxels: BTreeMap<u16, u64> = labels.classes().iter().map(|c| (c.id, c.voxels)).collect();
        if changes.keys().any(|class| !voxels.contains_key(class)) {
            voxels = counted(labels);
        }
        let volume = |(class, voxels): (u16, u64)| ClassVolume {
            class,
            rest_mm3: voxels as f64 * voxel_mm3,
            change_mm3: changes.get(&class).copied().unwrap_or(0.0) * voxel_mm3,
        };
        Ok(voxels.into_iter().map(volume).collect())
    })
}

/// Voxels of every label that occurs.
fn counted(labels: &Labels) -> BTreeMap<u16, u64> {
    let mut counts = vec![0_u64; 1 << 16];
    for &id in labels.ids() {
        counts[usize::from(id)] += 1;
    }
    (0..=u16::MAX).zip(counts).filter(|(_, voxels)| *voxels > 0).collect()
}

/// Bricks with a cell that moves: those stored, and those before them along any axes.
fn touched(displacement: &Displacement) -> Vec<[usize; 3]> {
    let field = displacement.forward();
    let bricks = field.brick_dims();
    let stored = |at: [usize; 3]| {
        let inside = (0..3).all(|a| at[a] < bricks[a]);
        inside && field.table()[at[0] + bricks[0] * (at[1] + bricks[1] * at[2])] != NO_BRICK
    };
    let moves = |at: &[usize; 3]| {
        (0..8_usize).any(|n| stored([at[0] + (n & 1), at[1] + (n >> 1 & 1), at[2] + (n >> 2)]))
    };
    (0..field.table().len()).map(|brick| brick_at(bricks, brick)).filter(moves).collect()
}

/// What the cells of a brick give to the classes (voxels). A brick has the cells whose lowest corner it holds; those before the
/// first voxels belong to the first bricks.
fn change_in(displacement: &Displacement, labels: &Labels, brick: [usize; 3]) -> BTreeMap<u16, f64> {
    let grid = displacement.grid();
    let dims = grid.dims();
    let sampler = Sampler::new(displacement.forward(), grid);
    let range = |a: usize| {
        let first = 8 * brick[a] as i64;
        (if first == 0 { -1 } else { first })..(first + 8).min(dims[a] as i64)
    };
    let mut changes = BTreeMap::new();
    for z in range(2) {
        for y in range(1) {
            for x in range(0) {
                let corners = sampler.corners([x, y, z]);
                if corners.iter().all(|u| *u == Vector3::zeros()) || displacement.cell_is_cut([x, y, z]) {
                    continue;
                }
                for point in 0..8_usize {
                    let bit = |a: usize| point >> a & 1;
                    let voxel = [x + bit(0) as i64, y + bit(1) as i64, z + bit(2) as i64];
                    if (0..3).any(|a| !(0..dims[a] as i64).contains(&voxel[a])) {
                        continue;
                    }
                    let at = Vector3::from([0, 1, 2].map(|a| GAUSS[bit(a)]));
                    let change = (Matrix3::identity() + gradient(&corners, at)).determinant() - 1.0;
                    let class = labels.ids()[grid.linear(VoxelIndex(voxel.map(|c| c as usize)))];
                    *changes.entry(class).or_insert(0.0) += change / 8.0;
                }
            }
        }
    }
    changes
}

/// Gauss's two points on 0 … 1: a half less and more 1/√12.
const GAUSS: [f64; 2] = [0.211_324_865_405_187_1, 0.788_675_134_594_812_9];

#[cfg(test)]
mod tests {
    use ivd_core::{Buffer, Grid, Volume};

    use super::*;
    use crate::fixtures::{bump, displacement, field, middle, sheared_grid, voxels};

    fn labels(grid: &Grid, class: impl Fn(Vector3<f64>) -> u16) -> Labels {
        let ids: Vec<u16> =
            voxels(grid).map(|v| class(grid.linear_part() * ivd_core::VoxelCoord::from(v).0)).collect();
        Labels::new(grid.clone(), Buffer::from(ids), Vec::new()).unwrap()
    }

    #[test]
    fn what_one_class_gains_another_loses_where_the_border_rests() {
        let grid = sheared_grid([40, 32, 14]);
        let centre = middle(&grid);
        let moved = displacement(&grid, field(&grid, bump(centre, 6.0, Vector3::new(0.9, -0.4, 1.0))));
        let slices = labels(&grid, |p| if p.x < centre.x { 3 } else { 500 });
        let one = by_class(&moved, &slices, &Exec::default().with_threads(1)).unwrap();
        assert_eq!(one, by_class(&moved, &slices, &Exec::default().with_threads(8)).unwrap());
        let [a, b] = one[..] else { panic!("two classes: {one:?}") };
        assert_eq!((a.class, b.class), (3, 500));
        assert!(a.change_mm3.abs() > 1.0, "{a:?}");
        assert!((a.change_mm3 + b.change_mm3).abs() < 1e-6 * a.change_mm3.abs(), "{a:?} {b:?}");
        let all = grid.len() as f64 * grid.linear_part().determinant().abs();
        assert!((a.rest_mm3 + b.rest_mm3 - all).abs() < 1e-9 * all);
    }

    /// Volumes are read from where a field goes, and never from where it comes.
    fn moved(grid: &Grid, forward: ivd_core::FieldBricks) -> Displacement {
        Displacement::new(grid.clone(), forward, ivd_core::FieldBricks::zero(grid.dims())).unwrap()
    }

    #[test]
    fn a_linear_map_scales_every_class_by_its_determinant() {
        let grid = sheared_grid([24, 20, 9]);
        let matrix = Matrix3::new(0.05, 0.02, 0.0, -0.01, 0.03, 0.04, 0.0, -0.02, -0.06);
        let factor = (Matrix3::identity() + matrix).determinant() - 1.0;
        let moved = moved(&grid, field(&grid, |p| matrix * p));
        // A ball that the border is far from: there the field goes on as a constant.
        let centre = middle(&grid);
        let ball = labels(&grid, |p| u16::from((p - centre).norm() < 4.0));
        let found = by_class(&moved, &ball, &Exec::default()).unwrap();
        let inner = found[1];
        assert!((inner.change_mm3 / inner.rest_mm3 - factor).abs() < 1e-5, "{inner:?} {factor}");
    }

    #[test]
    fn nothing_changes_where_nothing_moves_and_on_one_slice_areas_do() {
        let grid = sheared_grid([9, 8, 3]);
        let still = displacement(&grid, ivd_core::FieldBricks::zero(grid.dims()));
        let sevens = Volume::new(grid.clone(), vec![7_u8; grid.len()].into()).unwrap();
        let found = by_class(&still, &Labels::from_volume(&sevens).unwrap(), &Exec::default()).unwrap();
        let all = grid.len() as f64 * grid.linear_part().determinant().abs();
        assert_eq!(found, [ClassVolume { class: 7, rest_mm3: all, change_mm3: 0.0 }]);
        let slice = Grid::with_spacing([24, 24, 1], [1.0; 3]).unwrap();
        let centre = middle(&slice);
        let wider = field(&slice, |p| Vector3::new(0.1, 0.2, 0.0).component_mul(&(p - centre)));
        let moved = moved(&slice, wider);
        let disc = labels(&slice, |p| u16::from((p - centre).norm() < 8.0));
        let inner = by_class(&moved, &disc, &Exec::default()).unwrap()[1];
        assert!((inner.change_mm3 / inner.rest_mm3 - 0.32).abs() < 1e-5, "{inner:?}");
        let other = Volume::new(Grid::with_spacing([2; 3], [1.0; 3]).unwrap(), vec![0_u8; 8].into()).unwrap();
        assert!(by_class(&moved, &Labels::from_volume(&other).unwrap(), &Exec::default()).is_err());
    }
}
