use std::sync::Arc;

use ivd_core::{Cancel, Class, Classified, ErrorClass, Grid, Labels, Observer, VoxelCoord};
use ivd_elastic::Tissue;
use ivd_field::fixtures::{middle, sheared_grid, voxels};
use nalgebra::{Matrix3, Rotation3, Vector3};

use super::*;
use crate::tests::{Scene, ball, scene};
use crate::{Band, Elastic, FemParams};

impl Scene {
    pub(crate) fn elastic(&self, params: &FemParams, exec: &Exec) -> Result<MapResult, Error> {
        fem(&self.lattice, None, &self.motion, 0, params, exec)
    }
}

fn elastic() -> FemParams {
    FemParams::default()
}

/// Largest and root mean square difference from `wanted` at the voxels that `within` takes (voxels).
fn apart(
    grid: &Grid,
    mapped: &MapResult,
    within: impl Fn(Vector3<f64>) -> bool,
    wanted: impl Fn(Vector3<f64>) -> Vector3<f64>,
) -> (f64, f64) {
    let to_voxel = grid.inverse_linear_part();
    let (mut most, mut squares, mut many) = (0.0_f64, 0.0, 0.0);
    for v in voxels(grid) {
        let at = grid.linear_part() * VoxelCoord::from(v).0;
        if within(at) {
            let got = Vector3::from(mapped.displacement.forward().at(v)).map(f64::from);
            let left = (to_voxel * (got - wanted(at))).norm();
            most = most.max(left);
            squares += left * left;
            many += 1.0;
        }
    }
    (most, f64::sqrt(squares / many))
}

#[test]
fn rigid_motions_of_the_whole_lattice_are_met_inside_it() {
    for (grid, size) in
        [(Grid::with_spacing([40, 36, 34], [1.0; 3]).unwrap(), 8.0), (sheared_grid([44, 36, 16]), 5.0)]
    {
        let centre = middle(&grid);
        let least = grid.spacing()[0];
        let turn = *Rotation3::new(Vector3::new(0.1, -0.2, 0.3)).matrix();
        let moves =
            |p: Vector3<f64>| turn * (p - centre) - (p - centre) + Vector3::new(0.7, 0.0, -0.4) * least;
        let all = scene(&grid, ball(centre, size), moves, &[(centre, 1.2 * size)]);
        let mapped = all.elastic(&elastic(), &Exec::default()).unwrap();
        let (most, mean) = apart(&grid, &mapped, |p| (p - centre).norm() < 0.95 * size, moves);
        assert!(most < 0.1 && mean < 0.03, "{most} {mean} voxels");
    }
}

/// A ball whose top is pushed in by `much` (mm), as a smooth dent.
fn pushed(grid: &Grid, size: f64, much: f64) -> (Scene, Vector3<f64>) {
    let centre = middle(grid);
    let top = centre + Vector3::new(0.0, 0.0, size);
    let dent = ivd_field::fixtures::bump(top, size, Vector3::new(0.0, 0.0, -much));
    (scene(grid, ball(centre, size), dent, &[(top, size)]), top)
}

#[test]
fn a_push_is_followed_moves_nothing_beyond_its_reach_and_is_the_same_for_any_number_of_threads() {
    let grid = Grid::with_spacing([36, 36, 36], [1.0; 3]).unwrap();
    let (all, top) = pushed(&grid, 10.0, 2.0);
    let params = FemParams { cell: Some(2), ..elastic() };
    let run = |threads| all.elastic(&params, &Exec::default().with_threads(threads)).unwrap();
    let mapped = run(1);
    assert_eq!(mapped.displacement, run(2).displacement);
    assert_eq!(mapped.figures.folds, 0);
    assert!(mapped.figures.followed.misfit < 0.05, "{:?}", mapped.figures.followed);
    let reach = 10.0 + 4.0 * 2.0;
    let moved: Vec<f64> = voxels(&grid)
        .filter(|v| mapped.displacement.forward().at(*v) != [0.0; 3])
        .map(|v| (grid.linear_part() * VoxelCoord::from(v).0 - top).norm())
        .collect();
    assert!(moved.len() > 1000 && moved.iter().all(|d| *d < reach), "{} voxels", moved.len());
}

#[test]
fn a_stretch_of_the_lattice_is_that_of_its_inside() {
    let grid = Grid::with_spacing([36, 36, 36], [1.0; 3]).unwrap();
    let centre = middle(&grid);
    // A stretch that keeps the volume is an equilibrium: the inside follows it.
    let moves = |p: Vector3<f64>| {
        let d = p - centre;
        Vector3::new(d.x * (1.0 / f64::sqrt(1.15) - 1.0), d.y * (1.0 / f64::sqrt(1.15) - 1.0), 0.15 * d.z)
    };
    let all = scene(&grid, ball(centre, 9.0), moves, &[(centre, 11.0)]);
    let mapped = all.elastic(&FemParams { cell: Some(2), ..elastic() }, &Exec::default()).unwrap();
    let (most, _) = apart(&grid, &mapped, |p| (p - centre).norm() < 8.0, moves);
    // A twentieth of a cell's edge, of the 1.35 voxels that the poles move.
    assert!(most < 0.1, "{most} voxels");
    let [before, after] = mapped.figures.followed.volume_mm3;
    assert!((after / before - 1.0).abs() < 0.005, "{before} {after}");
}

/// Cancels the work once the equilibrium is looked for.
struct Stop(Cancel);

impl Observer for Stop {
    fn begin(&self, stage: &'static str, _: u64) {
        if stage == "equilibrium" {
            self.0.cancel();
        }
    }
}

/// Class 3 where `within`, else 0.
fn class_three(grid: &Grid, within: impl Fn(Vector3<f64>) -> bool) -> Labels {
    let at = |v| grid.linear_part() * VoxelCoord::from(v).0;
    let ids: Vec<u16> = voxels(grid).map(|v| 3 * u16::from(within(at(v)))).collect();
    let voxels = ids.iter().map(|id| u64::from(*id == 3)).sum();
    let class = Class { id: 3, name: None, mean: 1.0, sd: 0.0, voxels, lower: None, upper: None };
    Labels::new(grid.clone(), ids.into(), vec![class]).unwrap()
}

fn made_of(young: f64, poisson: f64) -> FemParams {
    let own = Elastic { young: Some(young), poisson: Some(poisson), ..Elastic::default() };
    FemParams { cell: Some(2), material: [(3, own)].into(), ..elastic() }
}

#[test]
fn a_tissue_is_as_stiff_as_it_is_beside_flesh() {
    let of = |own: Elastic| own.moduli();
    let named = |tissue| Elastic { tissue: Some(tissue), ..Elastic::default() };
    assert_eq!(of(named(Tissue::Lung)), (Some(0.185), Some(0.3)));
    assert_eq!(of(named(Tissue::Bone)), (Some(1000.0), None));
    assert_eq!(of(Elastic { young: Some(2.0), ..named(Tissue::Fat) }), (Some(2.0), Some(0.45)));
    assert_eq!(of(Elastic::default()), (None, None));
}

/// How far the motion of the voxels `within` is from turning and shifting them (voxels of 1 mm, root mean square).
fn bent(mapped: &MapResult, grid: &Grid, within: impl Fn(Vector3<f64>) -> bool) -> f64 {
    let at = |v| grid.linear_part() * VoxelCoord::from(v).0;
    let moved: Vec<(Vector3<f64>, Vector3<f64>)> = voxels(grid)
        .filter(|v| within(at(*v)))
        .map(|v| (at(v), Vector3::from(mapped.displacement.forward().at(v)).map(f64::from)))
        .collect();
    let many = moved.len() as f64;
    let from = moved.iter().map(|m| m.0).sum::<Vector3<f64>>() / many;
    let to = moved.iter().map(|m| m.0 + m.1).sum::<Vector3<f64>>() / many;
    let covariance: Matrix3<f64> =
        moved.iter().map(|m| (m.0 + m.1 - to) * (m.0 - from).transpose()).sum::<Matrix3<f64>>();
    let svd = covariance.svd(true, true);
    let turn = svd.u.unwrap() * svd.v_t.unwrap();
    let left = moved.iter().map(|m| (m.0 + m.1 - to - turn * (m.0 - from)).norm_squared());
    f64::sqrt(left.sum::<f64>() / many)
}

#[test]
fn a_hard_core_moves_as_one_and_a_class_like_the_rest_changes_nothing() {
    let grid = Grid::with_spacing([36, 36, 36], [1.0; 3]).unwrap();
    let (all, top) = pushed(&grid, 10.0, 2.0);
    let near = top - Vector3::new(0.0, 0.0, 5.0);
    let core = |p: Vector3<f64>| (p - near).norm() < 3.0;
    let labels = class_three(&grid, core);
    let exec = Exec::default();
    let run = |params: &FemParams| fem(&all.lattice, Some(&labels), &all.motion, 0, params, &exec).unwrap();
    let plain = all.elastic(&FemParams { cell: Some(2), ..elastic() }, &exec).unwrap();
    assert_eq!(run(&made_of(1.0, 0.4)).displacement, plain.displacement);
    let inner = |p: Vector3<f64>| (p - near).norm() < 2.5;
    let bends = [0.01, 1.0, 10.0, 1000.0].map(|young| bent(&run(&made_of(young, 0.3)), &grid, inner));
    assert!(bends.windows(2).all(|w| w[0] > w[1]), "{bends:?}");
    // Cells of 2 voxels: those at the core's border are of both kinds.
    assert!(bends[3] < 0.05 * bends[1], "{bends:?}");
}

#[test]
fn a_class_keeps_its_matter_outside_the_lattice() {
    let grid = Grid::with_spacing([36, 36, 36], [1.0; 3]).unwrap();
    let (all, top) = pushed(&grid, 10.0, 2.0);
    let above = |p: Vector3<f64>| (p - top - Vector3::new(0.0, 0.0, 4.0)).norm() < 3.0;
    let labels = class_three(&grid, above);
    let exec = Exec::default();
    let run = |young| {
        let mapped = fem(&all.lattice, Some(&labels), &all.motion, 0, &made_of(young, 0.3), &exec).unwrap();
        assert!(mapped.figures.followed.misfit < 0.1, "{:?}", mapped.figures.followed);
        bent(&mapped, &grid, above)
    };
    let (soft, hard) = (run(0.01), run(100.0));
    assert!(hard < 0.1 * soft, "{soft} {hard}");
}

#[test]
fn borders_of_materials_are_in_the_finest_cells() {
    let grid = Grid::with_spacing([56, 56, 56], [1.0; 3]).unwrap();
    let (all, top) = pushed(&grid, 16.0, 2.0);
    let near = top - Vector3::new(0.0, 0.0, 11.0);
    let core = |p: Vector3<f64>| (p - near).norm() < 2.6;
    let labels = class_three(&grid, core);
    let run = |young| {
        let params = FemParams {
            band: Band { margin: Some(16.0), ..made_of(young, 0.4).band },
            ..made_of(young, 0.4)
        };
        fem(&all.lattice, Some(&labels), &all.motion, 0, &params, &Exec::default()).unwrap()
    };
    let plain = FemParams { cell: Some(2), band: Band { margin: Some(16.0), ..elastic().band }, ..elastic() };
    let plain = all.elastic(&plain, &Exec::default()).unwrap();
    let [hard, soft] = [run(1000.0), run(0.01)];
    assert!(
        hard.figures.solved.unwrap().nodes > plain.figures.solved.unwrap().nodes,
        "{:?} {:?}",
        hard.figures.solved,
        plain.figures.solved
    );
    let [hard, soft] = [hard, soft].map(|mapped| bent(&mapped, &grid, |p| (p - near).norm() < 2.1));
    assert!(hard < 0.1 * soft, "{hard} {soft}");
}

#[test]
fn a_class_without_a_modulus_has_that_of_its_place_and_round_a_free_part_there_is_none() {
    let grid = Grid::with_spacing([36, 36, 36], [1.0; 3]).unwrap();
    let (all, _) = pushed(&grid, 10.0, 2.0);
    let centre = middle(&grid);
    let labels = class_three(&grid, |p| (p - centre).norm() >= 10.5);
    let run = |params: &FemParams| {
        fem(&all.lattice, Some(&labels), &all.motion, 0, params, &Exec::default()).unwrap().displacement
    };
    let air = |young, outside| {
        let own = Elastic { young, poisson: Some(0.4), ..Elastic::default() };
        FemParams {
            cell: Some(2),
            material: [(3, own)].into(),
            band: Band { outside, ..elastic().band },
            ..elastic()
        }
    };
    assert_eq!(run(&air(None, Outside::Band)), run(&air(Some(0.01), Outside::Band)));
    assert_ne!(run(&air(None, Outside::Band)), run(&air(Some(1.0), Outside::Band)));
    assert_eq!(run(&air(None, Outside::Free)), run(&air(Some(1.0), Outside::Free)));
}

#[test]
fn classes_without_labels_and_labels_of_another_grid_are_refused() {
    let grid = Grid::with_spacing([32, 32, 32], [1.0; 3]).unwrap();
    let (all, _) = pushed(&grid, 8.0, 1.5);
    let exec = Exec::default();
    let error = all.elastic(&made_of(2.0, 0.3), &exec).unwrap_err();
    assert!(error.error_class() == ErrorClass::Usage && error.to_string().contains("labels"), "{error}");
    let other = class_three(&Grid::with_spacing([32, 32, 31], [1.0; 3]).unwrap(), |_| true);
    let error = fem(&all.lattice, Some(&other), &all.motion, 0, &elastic(), &exec).unwrap_err();
    assert!(error.error_class() == ErrorClass::Usage && error.to_string().contains("grid"), "{error}");
}

#[test]
fn what_cannot_be_is_refused_in_bounded_steps_and_cancelling_is_heard() {
    let grid = Grid::with_spacing([12, 12, 12], [1.0; 3]).unwrap();
    let (all, _) = pushed(&grid, 3.0, 22.0);
    let params = FemParams { band: Band { margin: Some(2.2), ..elastic().band }, ..elastic() };
    let error = all.elastic(&params, &Exec::default()).unwrap_err();
    assert_eq!(error.error_class(), ErrorClass::Untrusted, "{error}");
    assert!(error.to_string().contains("no balance of forces"), "{error}");
    let exec = Exec::default();
    let exec = exec.clone().with_observer(Arc::new(Stop(exec.cancel)));
    let error = all.elastic(&params, &exec).unwrap_err();
    assert_eq!(error.error_class(), ErrorClass::Cancelled, "{error}");
}

#[test]
fn parts_that_move_alone_leave_the_rest_in_place_and_stillness_stays() {
    let grid = Grid::with_spacing([32, 32, 32], [1.0; 3]).unwrap();
    let (all, _) = pushed(&grid, 8.0, 1.5);
    let free = all
        .elastic(
            &FemParams { band: Band { outside: Outside::Free, ..elastic().band }, ..elastic() },
            &Exec::default(),
        )
        .unwrap();
    assert!(
        free.figures.voxels_vacated > 0 && free.figures.followed.misfit < 0.1,
        "{:?}",
        free.figures.followed
    );
    let (still, _) = pushed(&grid, 8.0, 0.0);
    let still = still.elastic(&elastic(), &Exec::default()).unwrap();
    assert_eq!((still.figures.voxels_moved, still.figures.solved), (0, None));
}
