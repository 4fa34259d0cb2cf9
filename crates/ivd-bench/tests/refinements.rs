//! The page of refinements, on a small given volume.
#![allow(clippy::unwrap_used, reason = "a test fails where it can't go on")]

use std::sync::Arc;

use ivd_bench::{Given, Options, RefinementRow, refinements, refinements_page};
use ivd_core::Exec;
use ivd_lattice::refine::StopReason;
use ivd_phantom::Shape;

#[test]
fn every_row_has_its_figures_and_its_pictures_and_counts_are_what_was_asked_for() {
    let params = ivd_phantom::Params {
        size: 24,
        shape: Shape::Torus,
        noise: Some(0.0),
        ..ivd_phantom::Params::default()
    };
    let volume = Arc::new(ivd_phantom::generate(&params, &Exec::default()).unwrap().volume);
    let middle = volume.range().map(|[low, high]| 0.5 * (low + high));
    let given = Given { name: "a torus".to_owned(), volume };
    let options = Options { input: Some(given), repeats: 1, ..Options::default() };
    let bench = refinements(&options, middle, &Exec::default()).unwrap();
    let [lattice] = &bench.lattices[..] else { panic!("one lattice of one volume") };
    assert_eq!((lattice.shape.genus, lattice.shape.components), (Some(1), 1));
    assert!(lattice.input.contains("a torus"), "{}", lattice.input);

    let whole = &lattice.levels[0];
    assert_eq!((whole.ratio, whole.max_mm, whole.bound_mm), (1.0, 0.0, 0.0));
    let all = || lattice.shares.iter().chain(&lattice.same_counts).chain(&lattice.levels);
    for row in all() {
        let figures = [row.ratio, row.bound_mm, row.max_mm, row.mean_mm, row.crease_mm, row.seconds];
        assert!(figures.iter().all(|f| f.is_finite() && *f >= 0.0), "{figures:?}");
        // What is measured may be a thirty-second above the truth, the bound may not be below that.
        assert!(row.bound_mm * 33.0 / 32.0 + 1e-6 >= row.max_mm && row.max_mm >= row.mean_mm, "{figures:?}");
        assert_eq!(row.new_vertices, 0, "{} {}", row.method, row.asked);
        assert!(row.method == "sample" || row.shape == lattice.shape, "{} {}", row.method, row.asked);
        let drawn = |at: usize| row.pictures[at].rgba().chunks(4).any(|p| p != [255; 4]);
        assert!((0..3).all(drawn), "{} {}: all pictures show something", row.method, row.asked);
    }
    counts(&lattice.shares, whole.triangles);
    for same in lattice.same_counts.chunks(3) {
        let [subdivided, decimated, default] = same else { panic!("three methods a level") };
        assert_eq!((subdivided.method.as_str(), decimated.method.as_str()), ("loop", "decimate"));
        let reached =
            |r: &RefinementRow| r.stopped_by != StopReason::Target || r.vertices == subdivided.vertices;
        assert!(reached(decimated) && reached(default), "{same:?}");
    }
    assert_eq!(lattice.reach.len(), 5);
    assert!(lattice.reach.iter().all(|r| r.least > 3 && r.levels[0].is_some()), "{:?}", lattice.reach);
    assert!(lattice.claims.len() == 5 && lattice.claims.iter().all(|c| c.holds[0] <= c.holds[1]));

    let page = refinements_page(&bench).unwrap();
    assert_eq!(page.matches("<img").count(), 3 * all().count());
    assert!(page.matches("<tr").count() > all().count(), "a row of figures each");
    // Pictures are letters, and may spell anything.
    let words: String = page.split("<img ").map(|p| p.split_once("'>").map_or(p, |(_, rest)| rest)).collect();
    assert!(
        !words.contains("NaN") && !words.contains("inf") && !words.contains("http"),
        "finite, self-contained"
    );
    let sheet = bench.sheet();
    assert_eq!(sheet.width() * 2, sheet.height() * 5, "five methods, two pictures each");
}

/// Every method keeps what it was asked for: sampling no more, as it has few rates; the others that many, less a few where
/// merging doesn't come out even.
fn counts(rows: &[RefinementRow], triangles: usize) {
    assert_eq!(rows.len(), 20);
    for row in rows.iter().filter(|row| row.stopped_by == StopReason::Target) {
        let share: f64 = row.asked.trim_end_matches(" %").parse().unwrap();
        let asked = (0.01 * share * triangles as f64).round();
        let left = row.triangles as f64;
        assert!(left <= asked + 1.0, "{} {}: {left} of {asked}", row.method, row.asked);
        assert!(
            row.method == "sample" || left >= asked - 2.0,
            "{} {}: {left} of {asked}",
            row.method,
            row.asked
        );
    }
    assert!(rows.iter().filter(|row| row.stopped_by == StopReason::Target).count() > 12);
}
