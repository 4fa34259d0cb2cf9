//! Refinement of extracted lattices: what must hold whatever is refined, and however far.

mod awkward;
mod chain;
mod coarser;
mod decimate;
mod kept;
mod lattices;
mod levels;
mod merging;
mod repair;
mod sampled;
mod specks;
mod topology;

use ivd_core::{Classified, Exec, Grid, Lattice};
use ivd_lattice::figures::measure;
use ivd_lattice::refine::{RefineParams, Refined, StopReason, Target, collapse};

fn refined(lattice: &Lattice, target: Target) -> Refined {
    let params = RefineParams { target: target.into(), ..RefineParams::default() };
    collapse(lattice, &params, &Exec::default()).expect("the parameters are in their domain")
}

/// A closed manifold of the same topology, on a subset of the vertices, and figures that tell of it.
pub(crate) fn assert_sound(input: &Lattice, out: &Refined) {
    let (before, after) = (measure(input), measure(&out.lattice));
    assert!(after.is_closed_manifold(), "{after:?}");
    assert_eq!((after.euler, after.components, after.genus), (before.euler, before.components, before.genus));
    assert_eq!(after.unused_vertices, 0);
    for (i, key) in out.lattice.keys().iter().enumerate() {
        let old = input.vertex_at(*key).expect("every vertex is one of the input's") as usize;
        assert_eq!(out.lattice.places()[i], input.places()[old], "a vertex moved");
    }
    let mut triangles: Vec<[u32; 3]> = out.lattice.triangles().to_vec();
    for triangle in &mut triangles {
        triangle.sort_unstable();
    }
    triangles.sort_unstable();
    assert!(triangles.windows(2).all(|w| w[0] != w[1]), "two triangles on the same vertices");
    assert_eq!((out.vertices_in, out.triangles_in), (input.keys().len(), input.triangles().len()));
    assert!(out.mean_error_mm <= out.max_error_mm && out.max_error_mm.is_finite());
    assert!(out.mean_error_mm <= out.seen_error_mm + 1e-12 && out.seen_error_mm <= out.max_error_mm);
}

/// The bound is never below what sampling finds, in both directions.
pub(crate) fn assert_bounded(input: &Lattice, out: &Refined) {
    let (hausdorff, mean) = sampled::hausdorff_and_mean(input, &out.lattice);
    assert!(out.max_error_mm >= hausdorff - 1e-9, "bound {} below {hausdorff}", out.max_error_mm);
    assert!(
        out.max_error_mm <= 40.0 * hausdorff + 1e-9,
        "bound {} says nothing of {hausdorff}",
        out.max_error_mm
    );
    assert!(out.mean_error_mm <= 3.0 * mean + 1e-9, "mean {} against {mean}", out.mean_error_mm);
    // Vertices alone aren't all of a surface, and the search for the nearest triangle is local.
    let seen = out.seen_error_mm;
    assert!((0.2 * hausdorff - 1e-9..=2.0 * hausdorff + 1e-9).contains(&seen), "{seen} seen of {hausdorff}");
}

/// Phantoms stay closed and of their genus, within the bound.
pub(crate) fn assert_phantoms(refined: impl Fn(&Lattice, Target) -> Refined) {
    let lattices = [
        lattices::sphere(26),
        lattices::torus(lattices::cube(26)),
        lattices::gyroid(26),
        lattices::shell(26),
    ];
    for lattice in &lattices {
        for target in [Target::Ratio(0.5), Target::Ratio(0.1), Target::Level(3)] {
            let out = refined(lattice, target);
            assert_sound(lattice, &out);
            assert_bounded(lattice, &out);
        }
    }
}

/// Levels of a sphere are met to the vertex.
pub(crate) fn assert_levels(sphere: &Lattice, refined: impl Fn(&Lattice, Target) -> Refined) {
    let vertices = sphere.keys().len() as f64;
    for level in 0..=3_u8 {
        let out = refined(sphere, Target::Level(level));
        assert_eq!(out.lattice.keys().len(), (vertices * 0.25_f64.powi(i32::from(level))).round() as usize);
        assert_eq!((out.reached.stopped_by, out.lattice.level()), (StopReason::Target, level));
    }
}

#[test]
fn phantoms_stay_closed_and_of_their_genus_within_the_bound() {
    assert_phantoms(refined);
}

#[test]
fn targets_are_met_exactly_where_nothing_is_in_the_way() {
    let sphere = lattices::sphere(32);
    assert_levels(&sphere, refined);
    let out = refined(&sphere, Target::Ratio(0.1));
    let kept = out.lattice.triangles().len() as f64;
    assert!((kept - 0.1 * sphere.triangles().len() as f64).abs() <= 1.0);
    assert!((out.reached.ratio - 0.1).abs() < 1e-3);
}

#[test]
fn levels_follow_levels_and_errors_add_up() {
    let input = lattices::torus(lattices::cube(32));
    let first = refined(&input, Target::Level(1));
    let second = refined(&first.lattice, Target::Level(1));
    assert_eq!(second.lattice.level(), 2);
    assert_eq!(second.lattice.max_error_mm(), first.max_error_mm + second.max_error_mm);
    let (hausdorff, _) = sampled::hausdorff_and_mean(&input, &second.lattice);
    assert!(second.lattice.max_error_mm() >= hausdorff);
}

#[test]
fn random_fields_refined_to_nothing_keep_every_speck_and_tunnel() {
    for seed in lattices::seeds(1000) {
        let lattice = lattices::random(seed);
        let out = refined(&lattice, Target::Ratio(0.0));
        assert_sound(&lattice, &out);
        assert_ne!(out.reached.stopped_by, StopReason::Target);
    }
}

#[test]
fn random_fields_stay_within_the_bound() {
    for seed in lattices::seeds(30) {
        let lattice = lattices::random(seed);
        for target in [Target::Ratio(0.6), Target::Ratio(0.0)] {
            let out = refined(&lattice, target);
            let (hausdorff, _) = sampled::hausdorff_and_mean(&lattice, &out.lattice);
            assert!(out.max_error_mm >= hausdorff - 1e-9, "{} below {hausdorff}", out.max_error_mm);
        }
    }
}

#[test]
fn a_speck_ends_as_a_tetrahedron_and_says_so() {
    let grid = lattices::cube(5);
    let speck = lattices::cut(grid, |p| f64::from(u8::from(p.x == 2.0 && p.y == 2.0 && p.z == 2.0)));
    assert_eq!(speck.keys().len(), 6);
    let out = refined(&speck, Target::Level(4));
    assert_sound(&speck, &out);
    assert_eq!((out.lattice.keys().len(), out.reached.stopped_by), (4, StopReason::Specks));
}

#[test]
fn a_ball_among_thousands_of_specks_is_refined_to_the_target() {
    let lattice = lattices::ball_and_specks(72);
    let components = measure(&lattice).components;
    assert!(components > 4000, "{components}");
    // Most of what ratios this small ask for is the ball's.
    let specks_left = 4.0 * components as f64 / lattice.triangles().len() as f64;
    for ratio in [0.7, 0.44, specks_left + 0.03, specks_left + 0.01] {
        let out = refined(&lattice, Target::Ratio(ratio));
        assert_sound(&lattice, &out);
        let (kept, wanted) = (out.lattice.triangles().len() as f64, ratio * lattice.triangles().len() as f64);
        assert!((kept - wanted).abs() < 2.0, "{kept} triangles where {wanted} were asked for");
        assert_eq!(out.reached.stopped_by, StopReason::Target);
    }
}

#[test]
fn specks_that_are_done_keep_nothing_else_from_going() {
    let lattice = lattices::ball_and_specks(72);
    let first = refined(&lattice, Target::MaxError(0.03)).lattice;
    for ratio in [0.999, 0.95, 0.9] {
        let out = refined(&first, Target::Ratio(ratio));
        let (kept, wanted) = (out.lattice.triangles().len() as f64, ratio * first.triangles().len() as f64);
        assert!((kept - wanted).abs() < 2.0, "{kept} triangles where {wanted} were asked for");
        assert_eq!(out.reached.stopped_by, StopReason::Target);
    }
}

#[test]
fn where_refinement_gives_up_no_vertex_can_go() {
    for lattice in lattices::seeds(300).map(lattices::random).chain([lattices::gyroid(48)]) {
        let out = refined(&lattice, Target::Ratio(0.0));
        assert_ne!(out.reached.stopped_by, StopReason::Target);
        let again = refined(&out.lattice, Target::Ratio(0.0));
        assert_eq!(again.lattice.keys().len(), out.lattice.keys().len());
    }
    // A little more is asked for than can go: ball and specks all end as tetrahedra.
    let lattice = lattices::ball_and_specks(72);
    let tetrahedra = 4 * measure(&lattice).components as usize;
    let out = refined(&lattice, Target::Ratio(0.99 * tetrahedra as f64 / lattice.triangles().len() as f64));
    assert_eq!((out.lattice.triangles().len(), out.reached.stopped_by), (tetrahedra, StopReason::Specks));
}

#[test]
fn the_number_of_threads_changes_nothing_among_specks() {
    let lattice = lattices::ball_and_specks(72);
    for ratio in [0.0, 0.44] {
        let params = RefineParams { target: Target::Ratio(ratio).into(), ..RefineParams::default() };
        let one = collapse(&lattice, &params, &Exec::default().with_threads(1)).unwrap();
        for threads in [2, 5] {
            assert_eq!(collapse(&lattice, &params, &Exec::default().with_threads(threads)).unwrap(), one);
        }
    }
}

#[test]
fn ratio_one_and_level_zero_change_nothing() {
    let sphere = lattices::sphere(16);
    for target in [Target::Ratio(1.0), Target::Level(0)] {
        let out = refined(&sphere, target);
        assert_eq!(out.lattice, sphere);
        assert_eq!(
            (out.max_error_mm, out.mean_error_mm, out.reached.stopped_by),
            (0.0, 0.0, StopReason::Target)
        );
    }
}

#[test]
fn an_empty_lattice_stays_empty() {
    let empty = lattices::cut(lattices::cube(4), |_| 0.0);
    for target in [Target::Ratio(0.0), Target::Ratio(1.0), Target::Level(3), Target::MaxError(1.0)] {
        let out = refined(&empty, target);
        assert!(out.lattice.keys().is_empty() && out.lattice.triangles().is_empty());
        assert_eq!((out.max_error_mm, out.mean_error_mm), (0.0, 0.0));
    }
}

#[test]
fn an_error_asked_for_is_kept_and_used() {
    let torus = lattices::torus(lattices::cube(32));
    let mut last = usize::MAX;
    for mm in [0.0, 0.05, 0.3] {
        let out = refined(&torus, Target::MaxError(mm));
        assert_sound(&torus, &out);
        assert_bounded(&torus, &out);
        assert!(out.max_error_mm <= mm && out.reached.stopped_by == StopReason::MaxError);
        assert!(out.lattice.keys().len() < last, "a wider bound removes more");
        last = out.lattice.keys().len();
    }
}

#[test]
fn a_box_loses_all_but_its_shape_without_any_error() {
    let grid = lattices::cube(24);
    let block = lattices::cut(grid, |p| f64::from(u8::from(p.iter().all(|c| (4.0..20.0).contains(c)))));
    let out = refined(&block, Target::MaxError(1e-9));
    assert_sound(&block, &out);
    assert!(
        out.lattice.keys().len() * 20 < block.keys().len(),
        "{} of {}",
        out.lattice.keys().len(),
        block.keys().len()
    );
}

#[test]
fn the_number_of_threads_changes_nothing() {
    // Large enough for many blocks in the first passes.
    let lattice = lattices::gyroid(112);
    let params = RefineParams { target: Target::Ratio(0.1).into(), ..RefineParams::default() };
    let one = collapse(&lattice, &params, &Exec::default().with_threads(1)).unwrap();
    assert_sound(&lattice, &one);
    for threads in [2, 3] {
        assert_eq!(collapse(&lattice, &params, &Exec::default().with_threads(threads)).unwrap(), one);
    }
}

#[test]
fn far_thick_slanted_and_mirrored_grids_lose_nothing() {
    let (s, c) = 0.4_f64.sin_cos();
    let axes = [[c, s, 0.0], [-s, c, 0.0], [0.0, 0.0, -1.0]];
    let near = Grid::new([28; 3], [0.5, 0.5, 5.0], [0.0; 3], axes).unwrap();
    let far = Grid::new([28; 3], [0.5, 0.5, 5.0], [1e6, -1e6, 1e6], axes).unwrap();
    let (near, far) = (lattices::torus(near), lattices::torus(far));
    let (a, b) = (refined(&near, Target::Ratio(0.2)), refined(&far, Target::Ratio(0.2)));
    assert_sound(&near, &a);
    assert_bounded(&near, &a);
    assert_eq!((a.lattice.keys(), a.lattice.triangles()), (b.lattice.keys(), b.lattice.triangles()));
    assert!(measure(&a.lattice).volume_mm3 > 0.0);
    assert_eq!(a.max_error_mm, b.max_error_mm);
}

#[test]
fn borders_and_broken_places_stay_as_they_are() {
    let open = lattices::open_sphere(24, 14.0);
    let border = |lattice: &Lattice| {
        let mut sides: Vec<_> = lattice
            .triangles()
            .iter()
            .flat_map(|t| [[t[0], t[1]], [t[1], t[2]], [t[2], t[0]]])
            .map(|e| e.map(|v| lattice.keys()[v as usize]))
            .collect();
        let all = sides.clone();
        sides.retain(|[a, b]| !all.contains(&[*b, *a]));
        sides.sort_unstable();
        sides
    };
    let out = refined(&open, Target::Ratio(0.1));
    assert!(!border(&open).is_empty());
    assert_eq!(border(&out.lattice), border(&open));
    let (before, after) = (measure(&open), measure(&out.lattice));
    assert_eq!((after.non_manifold_edges, after.bow_tie_vertices), (0, 0));
    assert_eq!(after.euler - after.unused_vertices as i64, before.euler - before.unused_vertices as i64);
}

#[test]
fn parameters_outside_their_domain_are_named_and_a_stop_is_heard() {
    let sphere = lattices::sphere(16);
    for (target, field) in [
        (Target::Ratio(1.5), "ratio"),
        (Target::Ratio(f64::NAN), "ratio"),
        (Target::MaxError(-1.0), "max_error"),
        (Target::MaxError(f64::INFINITY), "max_error"),
    ] {
        let params = RefineParams { target: target.into(), ..RefineParams::default() };
        let error = collapse(&sphere, &params, &Exec::default()).unwrap_err();
        assert!(error.to_string().contains(field), "{error}");
    }
    let exec = Exec::default();
    exec.cancel.cancel();
    assert!(collapse(&sphere, &RefineParams::default(), &exec).is_err());
    let tight = Exec::default().with_memory_limit(Some(1000));
    assert!(collapse(&sphere, &RefineParams::default(), &tight).is_err());
}

/// Asks for a stop as soon as the first pass has ended.
struct StopAfterAPass(ivd_core::Cancel);

impl ivd_core::Observer for StopAfterAPass {
    fn iteration(&self, _: ivd_core::Iteration) {
        self.0.cancel();
    }
}

#[test]
fn a_stop_in_the_midst_is_an_error_and_no_half_refined_lattice() {
    let cancel = ivd_core::Cancel::default();
    let mut exec = Exec::default().with_observer(std::sync::Arc::new(StopAfterAPass(cancel.clone())));
    exec.cancel = cancel;
    let params = RefineParams { target: Target::Level(3).into(), ..RefineParams::default() };
    let stopped = collapse(&lattices::sphere(48), &params, &exec).expect_err("it was stopped");
    assert_eq!(stopped.error_class(), ivd_core::ErrorClass::Cancelled);
}
