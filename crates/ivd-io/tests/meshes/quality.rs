//! Quality of meshes whose shapes are known.

use ivd_core::{Exec, Grid};
use ivd_lattice::figures::{ASPECT_BINS, measure, quality};
use ivd_lattice::import::{ImportParams, lattice};

use crate::meshes::{grids, solids};

#[test]
fn an_octahedron_is_equilateral_and_a_tetrahedron_has_its_right_angles() {
    let grid = Grid::with_spacing([8; 3], [1.0; 3]).unwrap();
    let (low, mid, high) = (1.25, 3.25, 5.25);
    let corners = [
        [low, mid, mid],
        [high, mid, mid],
        [mid, low, mid],
        [mid, high, mid],
        [mid, mid, low],
        [mid, mid, high],
    ];
    let faces = [[0, 2, 4], [2, 1, 4], [1, 3, 4], [3, 0, 4], [2, 0, 5], [1, 2, 5], [3, 1, 5], [0, 3, 5]];
    let mesh = solids::of(&corners, &faces);
    let cut = lattice(&mesh, &grid, &ImportParams::default(), &Exec::default()).unwrap().lattice;
    let q = quality(&cut);
    let near = |a: f64, b: f64| assert!((a - b).abs() < 1e-6, "{a} instead of {b}");
    for value in [q.aspect.min, q.aspect.mean, q.aspect.max] {
        near(value, 1.0);
    }
    near(q.smallest_angle_degrees.mean, 60.0);
    near(q.edge_mm.min, 8.0_f64.sqrt());
    near(q.edge_mm.max, 8.0_f64.sqrt());
    assert_eq!((q.valences, q.regular_share, q.flat_triangles), (vec![0, 0, 0, 0, 6], 0.0, 0));
    assert_eq!(q.components.len(), 1);
    let part = q.components[0];
    assert_eq!((part.vertices, part.triangles, part.genus), (6, 8, Some(0)));
    near(part.volume_mm3, 4.0 / 3.0 * 8.0);
    near(part.area_mm2, 8.0 * 3.0_f64.sqrt() / 4.0 * 8.0);

    let mesh = solids::of(
        &[[1.0, 1.0, 1.0], [4.0, 1.0, 1.0], [1.0, 4.0, 1.0], [1.0, 1.0, 4.0]],
        &[[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]],
    );
    let cut = lattice(&mesh, &grid, &ImportParams::default(), &Exec::default()).unwrap().lattice;
    let q = quality(&cut);
    // A right triangle with equal legs a: inradius a (2 − √2) / 2.
    near(q.aspect.max, 2.0_f64.sqrt() / (3.0_f64.sqrt() * (2.0 - 2.0_f64.sqrt())));
    near(q.smallest_angle_degrees.min, 45.0);
    near(q.smallest_angle_degrees.mean, (3.0 * 45.0 + 60.0) / 4.0);
    near(q.edge_mm.mean, (3.0 * 3.0 + 3.0 * 18.0_f64.sqrt()) / 6.0);
    assert_eq!(q.aspect_histogram, [4, 0, 0, 0, 0, 0, 0, 0]);
}

#[test]
fn parts_add_up_to_the_whole_for_any_number_of_threads() {
    for (i, grid) in grids().iter().enumerate() {
        let cut = solids::random(grid, 40 + i as u64);
        let (figures, q) = (measure(&cut), quality(&cut));
        assert_eq!(q.components.len() as u64, figures.components);
        assert_eq!(q.components.iter().map(|c| c.genus.unwrap()).sum::<u64>(), figures.genus.unwrap());
        assert_eq!(q.components.iter().map(|c| c.triangles).sum::<u64>(), figures.triangles);
        assert_eq!(q.components.iter().map(|c| c.vertices).sum::<u64>(), figures.vertices);
        let (area, volume) =
            q.components.iter().fold((0.0, 0.0), |s, c| (s.0 + c.area_mm2, s.1 + c.volume_mm3));
        assert!((area - figures.area_mm2).abs() < 1e-9 * area);
        assert!((volume - figures.volume_mm3).abs() < 1e-9 * area);
        // Twice the edges is three times the triangles, and the valences' sum.
        let ends: u64 = q.valences.iter().zip(0..).map(|(count, valence)| count * valence).sum();
        assert_eq!(ends, 3 * figures.triangles);
        assert_eq!(q.aspect_histogram.iter().sum::<u64>(), figures.triangles);
        assert!(
            q.aspect.min >= 1.0 - 1e-12
                && q.aspect.max.is_finite()
                && q.smallest_angle_degrees.max <= 60.0 + 1e-9
        );
        let one = Exec::default().with_threads(1).run(|| quality(&cut));
        assert_eq!(one, Exec::default().with_threads(5).run(|| quality(&cut)));
    }
    assert_eq!(ASPECT_BINS[0], 1.0);
}

#[test]
fn nothing_has_no_quality() {
    let cut = solids::random(&grids()[0], 3).subset(&[], vec![]).unwrap();
    let q = quality(&cut);
    assert_eq!((q.components.len(), q.regular_share, q.aspect.mean, q.edge_mm.max), (0, 0.0, 0.0, 0.0));
}
