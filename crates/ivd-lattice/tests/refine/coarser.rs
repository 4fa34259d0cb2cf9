//! Marching cubes at a coarser rate.
#![allow(clippy::unwrap_used, reason = "a helper of tests fails as a test does")]

use ivd_core::{Exec, Grid, Lattice, Volume, Voxels};
use ivd_lattice::figures::measure;
use ivd_lattice::refine::{Locks, Method, RefineParams, Refined, StopReason, Target, distances, refine};
use nalgebra::Vector3;

use crate::refine::{lattices, sampled};

pub(crate) fn by(method: Method, lattice: &Lattice, target: Target) -> Refined {
    let params = RefineParams { method, target: target.into(), ..RefineParams::default() };
    refine(lattice, &params, Locks::NONE, &Exec::default()).expect("the parameters are in their domain")
}

/// Every vertex of the result is one of the input's, at its place, and errors are what they are said to be.
pub(crate) fn assert_subset(input: &Lattice, out: &Refined) {
    for (i, key) in out.lattice.keys().iter().enumerate() {
        let old = input.vertex_at(*key).expect("every vertex is one of the input's") as usize;
        assert_eq!(out.lattice.places()[i], input.places()[old], "a vertex moved");
    }
    assert_eq!((out.vertices_in, out.triangles_in), (input.keys().len(), input.triangles().len()));
    assert!(out.mean_error_mm <= out.max_error_mm && out.max_error_mm.is_finite());
    assert_eq!(out.lattice.max_error_mm(), input.max_error_mm() + out.max_error_mm);
}

/// The bound is never below what dense sampling finds in both directions, and within a fifth of it: samples miss the tips of
/// what clustering leaves by a tenth or so.
pub(crate) fn assert_certified(input: &Lattice, out: &Refined) {
    let (hausdorff, _) = sampled::hausdorff_and_mean(input, &out.lattice);
    let mean = sampled::mean_by_area(input, &out.lattice);
    assert!(out.max_error_mm >= hausdorff - 1e-9, "bound {} below {hausdorff}", out.max_error_mm);
    assert!(out.max_error_mm <= 1.2 * hausdorff + 1e-6, "bound {} far above {hausdorff}", out.max_error_mm);
    assert!(
        (out.mean_error_mm - mean).abs() <= 0.1 * mean + 1e-9,
        "mean {} against {mean}",
        out.mean_error_mm
    );
}

fn sampled_by(lattice: &Lattice, target: Target) -> Refined {
    by(Method::Sample, lattice, target)
}

#[test]
fn phantoms_are_closed_manifolds_within_a_tight_bound() {
    for lattice in [lattices::sphere(26), lattices::torus(lattices::cube(26)), lattices::gyroid(24)] {
        for level in 1..=2 {
            let out = sampled_by(&lattice, Target::Level(level));
            assert_subset(&lattice, &out);
            assert_certified(&lattice, &out);
            let figures = measure(&out.lattice);
            assert!(figures.is_closed_manifold() && figures.volume_mm3 > 0.0, "{figures:?}");
            assert_eq!((figures.unused_vertices, figures.degenerate_triangles), (0, 0));
            assert_eq!(out.reached.stopped_by, StopReason::Target);
            assert!((out.reached.level - f64::from(level)).abs() < 0.4, "{}", out.reached.level);
        }
    }
}

#[test]
fn random_fields_are_closed_manifolds_at_every_step() {
    for seed in lattices::seeds(1000) {
        let lattice = lattices::random(seed);
        let mut last = usize::MAX;
        for level in 1..=3 {
            let out = sampled_by(&lattice, Target::Level(level));
            assert_subset(&lattice, &out);
            let figures = measure(&out.lattice);
            assert!(figures.is_closed_manifold(), "seed {seed}, level {level}: {figures:?}");
            last = last.min(out.lattice.triangles().len());
        }
        assert!(last > 0);
    }
}

/// A field whose voxels are 0 or 1, on a grid of `n`, with those of `f`.
fn binary(grid: Grid, inside: impl Fn([usize; 3]) -> bool) -> Lattice {
    let voxels: Vec<u8> = (0..grid.len()).map(|i| u8::from(inside(grid.index(i).0))).collect();
    lattices::at(&Volume::new(grid, Voxels::from(voxels)).unwrap(), 0.5)
}

#[test]
fn every_coarse_voxel_is_where_it_was() {
    // Winding numbers of the coarse surface at coarse voxels are the signs of the field there.
    for seed in lattices::seeds(40) {
        let n = 9;
        let inside = |at: [usize; 3]| {
            lattices::hash(seed * 8192 + (at[0] + 16 * (at[1] + 16 * at[2])) as u64).is_multiple_of(3)
        };
        let lattice = binary(lattices::cube(n), inside);
        let out = sampled_by(&lattice, Target::Level(1));
        let positions = out.lattice.local_positions();
        // Padded voxels 0, 2, 4 … are voxels -1, 1, 3 …
        for z in (1..n).step_by(2) {
            for y in (1..n).step_by(2) {
                for x in (1..n).step_by(2) {
                    let p = Vector3::new(x as f64, y as f64, z as f64);
                    let winding: f64 = out
                        .lattice
                        .triangles()
                        .iter()
                        .map(|t| solid_angle(t.map(|v| positions[v as usize] - p)))
                        .sum::<f64>()
                        / (4.0 * std::f64::consts::PI);
                    assert_eq!(
                        winding.round() as i64,
                        i64::from(inside([x, y, z])),
                        "seed {seed}: {winding}"
                    );
                }
            }
        }
    }
}

fn solid_angle([a, b, c]: [Vector3<f64>; 3]) -> f64 {
    let (x, y, z) = (a.norm(), b.norm(), c.norm());
    let below = x * y * z + a.dot(&b) * z + b.dot(&c) * x + c.dot(&a) * y;
    2.0 * a.dot(&b.cross(&c)).atan2(below)
}

#[test]
fn gaps_close_and_specks_vanish_as_a_coarser_rate_would_have_it() {
    // Two slabs a voxel apart, and a speck between the coarse voxels.
    let lattice = binary(lattices::cube(24), |[x, y, z]| {
        let across = (4..20).contains(&x) && (4..20).contains(&y);
        across && ((4..9).contains(&z) || (10..15).contains(&z)) || [x, y, z] == [2, 2, 20]
    });
    assert_eq!(measure(&lattice).components, 3);
    let out = sampled_by(&lattice, Target::Level(1));
    // Voxel 9 is a coarse one and keeps the slabs apart; the speck at 2, 2, 20 isn't hit.
    assert_eq!(measure(&out.lattice).components, 2);
    let out = sampled_by(&lattice, Target::Level(2));
    assert_eq!(measure(&out.lattice).components, 1);
}

#[test]
fn ratio_count_and_error_choose_the_step_that_meets_them() {
    let sphere = lattices::sphere(40);
    let triangles = sphere.triangles().len();
    for keep in [triangles, triangles / 3, triangles / 10, triangles / 40] {
        let out = sampled_by(&sphere, Target::Count(keep));
        assert_subset(&sphere, &out);
        assert!(out.lattice.triangles().len() <= keep && out.lattice.triangles().len() * 3 > keep);
        assert_eq!(out.reached.stopped_by, StopReason::Target);
        let same = sampled_by(&sphere, Target::Ratio(keep as f64 / triangles as f64));
        assert_eq!(same, out);
    }
    let mut last = usize::MAX;
    for mm in [0.0, 0.2, 0.6, 1.5] {
        let out = sampled_by(&sphere, Target::MaxError(mm));
        assert!(out.max_error_mm <= mm && out.reached.stopped_by == StopReason::MaxError);
        assert!(out.lattice.keys().len() < last);
        last = out.lattice.keys().len();
    }
    for target in [Target::Count(0), Target::Level(60), Target::Ratio(0.0)] {
        let out = sampled_by(&sphere, target);
        assert!(!out.lattice.triangles().is_empty() && out.reached.stopped_by == StopReason::Vanishing);
        assert!(measure(&out.lattice).is_closed_manifold());
    }
    let out = sampled_by(&sphere, Target::Level(0));
    assert_eq!((out.lattice, out.max_error_mm, out.mean_error_mm), (sphere, 0.0, 0.0));
}

#[test]
fn a_lattice_that_is_not_as_extracted_is_refused_with_the_remedy() {
    let sphere = lattices::sphere(24);
    let exec = Exec::default();
    let params = RefineParams { method: Method::Sample, ..RefineParams::default() };
    let refused = |lattice: &Lattice| refine(lattice, &params, Locks::NONE, &exec).unwrap_err().to_string();
    let coarse = by(Method::Collapse, &sphere, Target::Level(1)).lattice;
    assert!(refused(&coarse).contains("extract the lattice anew"), "{}", refused(&coarse));
    // A few vertices less: the level is 0 still, and the parities tell.
    let fewer = by(Method::Collapse, &sphere, Target::Ratio(0.97)).lattice;
    assert_eq!(fewer.level(), 0);
    assert!(refused(&fewer).contains("extract the lattice anew"), "{}", refused(&fewer));
    for axis in 0..3 {
        let gone = sphere.keys().iter().position(|k| k.element() == axis).unwrap() as u32;
        let kept: Vec<u32> = (0..sphere.keys().len() as u32).filter(|&v| v != gone).collect();
        let one = sphere.subset(&kept, vec![]).unwrap();
        assert!(refused(&one).contains("extract the lattice anew"), "{}", refused(&one));
    }
    let locks = Locks { vertices: &[5] };
    let error = refine(&sphere, &params, locks, &exec).unwrap_err().to_string();
    assert!(error.contains("locks") && error.contains("collapse"), "{error}");
}

#[test]
fn empty_far_sheared_and_mirrored_lattices_are_sampled_too() {
    let empty = lattices::cut(lattices::cube(4), |_| 0.0);
    for target in [Target::Ratio(0.0), Target::Level(3), Target::MaxError(1.0), Target::Count(0)] {
        let out = sampled_by(&empty, target);
        assert!(out.lattice.keys().is_empty() && out.max_error_mm == 0.0 && out.mean_error_mm == 0.0);
    }
    for out in awkward(Method::Sample, Target::Level(1)) {
        assert!(measure(&out.lattice).is_closed_manifold());
    }
}

/// A torus on thick, slanted and left-handed grids, near and far: the same result near and far, seen from outside.
pub(crate) fn awkward(method: Method, target: Target) -> Vec<Refined> {
    let (s, c) = 0.4_f64.sin_cos();
    let axes =
        [[[c, s, 0.0], [-s, c, 0.0], [0.0, 0.0, -1.0]], [[1.0, 0.0, 0.0], [0.6, 0.8, 0.0], [0.0, 0.0, 1.0]]];
    let mut all = Vec::new();
    for axes in axes {
        let grid = |origin| Grid::new([28; 3], [0.5, 0.5, 2.0], origin, axes);
        let Ok(near) = grid([0.0; 3]) else { continue };
        let (near, far) = (lattices::torus(near), lattices::torus(grid([1e6, -1e6, 1e6]).unwrap()));
        let (a, b) = (by(method, &near, target), by(method, &far, target));
        assert_subset(&near, &a);
        assert_certified(&near, &a);
        assert_eq!((a.lattice.keys(), a.lattice.triangles()), (b.lattice.keys(), b.lattice.triangles()));
        assert_eq!(a.max_error_mm, b.max_error_mm);
        assert!(measure(&a.lattice).volume_mm3 > 0.0);
        all.push(a);
    }
    assert!(!all.is_empty());
    all
}

/// The same bytes for any number of threads.
pub(crate) fn assert_threads_change_nothing(lattice: &Lattice, params: &RefineParams) {
    let run = |threads| refine(lattice, params, Locks::NONE, &Exec::default().with_threads(threads)).unwrap();
    let one = run(1);
    for threads in [2, 3, 8] {
        assert_eq!(run(threads), one, "{threads} threads");
    }
}

#[test]
fn the_number_of_threads_changes_nothing() {
    let lattice = lattices::gyroid(48);
    for target in [Target::Level(1), Target::Ratio(0.1), Target::MaxError(1.0)] {
        let params =
            RefineParams { method: Method::Sample, target: target.into(), ..RefineParams::default() };
        assert_threads_change_nothing(&lattice, &params);
    }
}

#[test]
fn the_distance_is_the_same_both_ways_and_none_to_itself() {
    let (a, exec) = (lattices::gyroid(32), Exec::default());
    let b = by(Method::Collapse, &a, Target::Level(2));
    let there = distances(&a, &b.lattice, &exec).unwrap();
    let back = distances(&b.lattice, &a, &exec).unwrap();
    assert!((there.max_mm - back.max_mm).abs() <= 0.04 * there.max_mm, "{there:?} {back:?}");
    assert!(there.max_mm <= b.max_error_mm * 1.04, "the bound carried along is no less");
    let (hausdorff, _) = sampled::hausdorff_and_mean(&a, &b.lattice);
    assert!(there.max_mm >= hausdorff && there.max_mm <= 1.1 * hausdorff, "{there:?} {hausdorff}");
    let none = distances(&a, &a, &exec).unwrap();
    assert_eq!((none.max_mm, none.mean_mm), (0.0, 0.0));
    exec.cancel.cancel();
    assert!(distances(&a, &b.lattice, &exec).is_err());
}
