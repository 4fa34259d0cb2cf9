use std::sync::Arc;

use ivd_core::{Cancel, Fault, Grid, Observer, VoxelCoord};
use nalgebra::{Rotation3, Vector3};

use super::*;
use crate::fixtures::{middle, sheared_grid, voxels};
use crate::map::MapMethod;
use crate::map::tests::{Scene, ball, scene};

impl Scene {
    pub(in crate::map) fn elastic(&self, params: &MapParams, exec: &Exec) -> Result<Mapped, Error> {
        fem(&self.lattice, &self.motion, 0, params, exec)
    }
}

fn elastic() -> MapParams {
    MapParams { method: MapMethod::Fem, ..MapParams::default() }
}

/// Largest and root mean square difference from `wanted` at the voxels that `within` takes (voxels).
fn apart(
    grid: &Grid,
    mapped: &Mapped,
    within: impl Fn(Vector3<f64>) -> bool,
    wanted: impl Fn(Vector3<f64>) -> Vector3<f64>,
) -> (f64, f64) {
    let to_voxel = grid.inverse_linear_part();
    let (mut most, mut squares, mut many) = (0.0_f64, 0.0, 0.0);
    for v in voxels(grid) {
        let at = grid.linear_part() * VoxelCoord::from(v).0;
        if within(at) {
            let got = Vector3::from(mapped.displacement.forward.at(v)).map(f64::from);
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
    let dent = crate::fixtures::bump(top, size, Vector3::new(0.0, 0.0, -much));
    (scene(grid, ball(centre, size), dent, &[(top, size)]), top)
}

#[test]
fn a_push_is_followed_moves_nothing_beyond_its_reach_and_is_the_same_for_any_number_of_threads() {
    let grid = Grid::with_spacing([36, 36, 36], [1.0; 3]).unwrap();
    let (all, top) = pushed(&grid, 10.0, 2.0);
    let params = MapParams { cell: Some(2), ..elastic() };
    let run = |threads| all.elastic(&params, &Exec::default().with_threads(threads)).unwrap();
    let mapped = run(1);
    assert_eq!(mapped.displacement, run(2).displacement);
    assert_eq!(mapped.folds, 0);
    assert!(mapped.followed.misfit < 0.05, "{:?}", mapped.followed);
    let reach = 10.0 + 4.0 * 2.0;
    let moved: Vec<f64> = voxels(&grid)
        .filter(|v| mapped.displacement.forward.at(*v) != [0.0; 3])
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
    let mapped = all.elastic(&MapParams { cell: Some(2), ..elastic() }, &Exec::default()).unwrap();
    let (most, _) = apart(&grid, &mapped, |p| (p - centre).norm() < 8.0, moves);
    // A twentieth of a cell's edge, of the 1.35 voxels that the poles move.
    assert!(most < 0.1, "{most} voxels");
    let [before, after] = mapped.followed.volume_mm3;
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

#[test]
fn what_cannot_be_is_refused_in_bounded_steps_and_cancelling_is_heard() {
    let grid = Grid::with_spacing([32, 32, 32], [1.0; 3]).unwrap();
    let (all, _) = pushed(&grid, 8.0, 60.0);
    let params = MapParams { margin_mm: Some(6.0), ..elastic() };
    let error = all.elastic(&params, &Exec::default()).unwrap_err();
    assert_eq!(error.fault(), Fault::Untrusted, "{error}");
    let exec = Exec::default();
    let exec = exec.clone().with_observer(Arc::new(Stop(exec.cancel)));
    let error = all.elastic(&params, &exec).unwrap_err();
    assert_eq!(error.fault(), Fault::Cancelled, "{error}");
}

#[test]
fn parts_that_move_alone_leave_the_rest_in_place_and_stillness_stays() {
    let grid = Grid::with_spacing([32, 32, 32], [1.0; 3]).unwrap();
    let (all, _) = pushed(&grid, 8.0, 1.5);
    let free = all.elastic(&MapParams { outside: Outside::Free, ..elastic() }, &Exec::default()).unwrap();
    assert!(free.voxels_vacated > 0 && free.followed.misfit < 0.1, "{:?}", free.followed);
    let (still, _) = pushed(&grid, 8.0, 0.0);
    let still = still.elastic(&elastic(), &Exec::default()).unwrap();
    assert_eq!((still.voxels_moved, still.solved), (0, None));
}
