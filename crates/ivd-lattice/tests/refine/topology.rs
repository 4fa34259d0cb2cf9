//! Refinement that may close tunnels: what still holds, and that it goes further.

use std::collections::HashMap;

use ivd_core::{Exec, Lattice};
use ivd_lattice::figures::measure;
use ivd_lattice::refine::{Locks, RefineParams, Refined, StopReason, Target, refine};

use crate::refine::{assert_sound, lattices, sampled};

fn run(lattice: &Lattice, target: Target, allow_topology: bool) -> Refined {
    let params = RefineParams { target: target.into(), allow_topology, ..RefineParams::default() };
    refine(lattice, &params, Locks::NONE, &Exec::default()).expect("the parameters are in their domain")
}

/// A subset of the vertices, all of them used; no degenerate and no double triangle; as many triangles along each edge one
/// way as the other; a bound that sampling doesn't exceed.
fn assert_a_cycle(input: &Lattice, out: &Refined) {
    let figures = measure(&out.lattice);
    assert_eq!((figures.degenerate_triangles, figures.unused_vertices, figures.boundary_edges), (0, 0, 0));
    for (i, key) in out.lattice.keys().iter().enumerate() {
        let old = input.vertex_at(*key).expect("every vertex is one of the input's") as usize;
        assert_eq!(out.lattice.places()[i], input.places()[old], "a vertex moved");
    }
    let mut along: HashMap<[u32; 2], i64> = HashMap::new();
    for t in out.lattice.triangles() {
        for (a, b) in [(t[0], t[1]), (t[1], t[2]), (t[2], t[0])] {
            *along.entry([a.min(b), a.max(b)]).or_default() += if a < b { 1 } else { -1 };
        }
    }
    assert!(along.values().all(|&n| n == 0), "an edge is run along one way more often than the other");
    let mut triangles = out.lattice.triangles().to_vec();
    for triangle in &mut triangles {
        triangle.sort_unstable();
    }
    triangles.sort_unstable();
    assert!(triangles.windows(2).all(|w| w[0] != w[1]), "two triangles on the same vertices");
    let (hausdorff, _) = sampled::hausdorff_and_mean(input, &out.lattice);
    assert!(out.max_error_mm >= hausdorff - 1e-9, "bound {} below {hausdorff}", out.max_error_mm);
}

#[test]
fn a_sponge_is_refined_further_than_its_genus_allows() {
    let sponge = lattices::sponge(21);
    let genus = measure(&sponge).genus.expect("it is a closed manifold");
    assert!(genus > 60, "{genus}");
    let strict = run(&sponge, Target::Ratio(0.0), false);
    assert_sound(&sponge, &strict);
    let least = strict.lattice.triangles().len();
    // A closed manifold of genus g needs more than 4 g triangles less a few.
    let out = run(&sponge, Target::Count(least / 2), true);
    assert_a_cycle(&sponge, &out);
    println!(
        "genus {genus}: {} triangles, {least} at least, {} with pinching; bound {:.2} and {:.2} mm",
        sponge.triangles().len(),
        out.lattice.triangles().len(),
        strict.max_error_mm,
        out.max_error_mm
    );
    assert!(out.lattice.triangles().len() <= least / 2, "{}", out.lattice.triangles().len());
    assert_eq!(out.reached.stopped_by, StopReason::Target);
    let after = measure(&out.lattice);
    assert_eq!(after.components, 1);
}

#[test]
fn where_the_target_is_within_reach_nothing_is_pinched() {
    let gyroid = lattices::gyroid(32);
    for target in [Target::Ratio(0.2), Target::Level(1)] {
        let out = run(&gyroid, target, true);
        assert_sound(&gyroid, &out);
        assert_eq!(out, run(&gyroid, target, false));
    }
}

#[test]
fn random_fields_refined_to_nothing_stay_cycles_within_the_bound() {
    for seed in lattices::seeds(100) {
        let lattice = lattices::random(seed);
        let components = measure(&lattice).components;
        let strict = run(&lattice, Target::Ratio(0.0), false);
        let out = run(&lattice, Target::Ratio(0.0), true);
        assert_a_cycle(&lattice, &out);
        assert!(out.lattice.triangles().len() <= strict.lattice.triangles().len());
        assert!(measure(&out.lattice).components <= components);
        let within = run(&lattice, Target::MaxError(0.4), true);
        assert_a_cycle(&lattice, &within);
        assert!(within.max_error_mm <= 0.4);
    }
}

#[test]
fn the_number_of_threads_changes_nothing_where_tunnels_close() {
    let sponge = lattices::sponge(21);
    let params =
        RefineParams { target: Target::Ratio(0.02).into(), allow_topology: true, ..RefineParams::default() };
    let with = |threads| {
        refine(&sponge, &params, Locks::NONE, &Exec::default().with_threads(threads)).expect("sound")
    };
    let one = with(1);
    for threads in [2, 3, 8] {
        assert_eq!(with(threads), one);
    }
}

#[test]
fn locked_vertices_stay_where_tunnels_close() {
    let sponge = lattices::sponge(20);
    let locked: Vec<u32> = (0..sponge.keys().len() as u32).step_by(40).collect();
    let params =
        RefineParams { target: Target::Ratio(0.0).into(), allow_topology: true, ..RefineParams::default() };
    let out = refine(&sponge, &params, Locks { vertices: &locked }, &Exec::default()).expect("sound");
    assert_a_cycle(&sponge, &out);
    assert!(locked.iter().all(|&v| out.lattice.vertex_at(sponge.keys()[v as usize]).is_some()));
}
