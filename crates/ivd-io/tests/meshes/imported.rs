//! Meshes of any origin on a grid: what is mended, what is refused, and what is promised of the result.

use ivd_core::Mesh;
use ivd_core::{Classified, ErrorClass, Exec, Grid, Lattice, LatticeSource};
use ivd_lattice::figures::measure;
use ivd_lattice::import::{ImportParams, ImportedMesh, lattice};
use ivd_lattice::refine::{RefineParams, Target, collapse};
use nalgebra::Vector3;

use crate::meshes::solids::{self, cuboid, hash, turned};

fn grid() -> Grid {
    Grid::with_spacing([12; 3], [1.0; 3]).unwrap()
}

fn put(mesh: &Mesh, grid: &Grid) -> ImportedMesh {
    lattice(mesh, grid, &ImportParams::default(), &Exec::default()).unwrap()
}

/// The message with which a mesh is refused.
fn refused(mesh: &Mesh) -> String {
    let error = lattice(mesh, &grid(), &ImportParams::default(), &Exec::default()).unwrap_err();
    assert_eq!(error.error_class(), ErrorClass::Input);
    error.to_string()
}

fn boxes(list: &[([f64; 3], [f64; 3])]) -> Mesh {
    let (mut positions, mut triangles) = (Vec::new(), Vec::new());
    for (low, high) in list {
        let (p, t) = cuboid(*low, *high, positions.len() as u32);
        positions.extend(p);
        triangles.extend(t);
    }
    solids::of(&positions, &triangles)
}

/// A closed surface of `n²` quads a side round a cube, its vertices moved to no round numbers; one triangle each corner.
fn bumpy(n: usize, low: f64, high: f64, seed: u64) -> Mesh {
    let mut positions = Vec::new();
    let mut triangles = Vec::new();
    let step = (high - low) / n as f64;
    for axis in 0..3 {
        for side in 0..2_usize {
            for i in 0..n * n {
                let quad = [[0, 0], [1, 0], [1, 1], [0, 1]].map(|[du, dv]| {
                    let mut c = [0; 3];
                    c[axis] = side * n;
                    c[(axis + 1) % 3] = i % n + du;
                    c[(axis + 2) % 3] = i / n + dv;
                    let id = (c[0] + 64 * (c[1] + 64 * c[2])) as u64;
                    let noise = |a: u64| (hash(seed ^ id << 8 ^ a) % 1000) as f64 / 1000.0 - 0.5;
                    Vector3::from_fn(|a, _| low + step * (c[a] as f64 + 0.3 * noise(a as u64)))
                });
                let order = if side == 1 { [0, 1, 2, 0, 2, 3] } else { [0, 2, 1, 0, 3, 2] };
                let first = positions.len() as u32;
                positions.extend(order.map(|k| quad[k]));
                triangles.extend([[first, first + 1, first + 2], [first + 3, first + 4, first + 5]]);
            }
        }
    }
    Mesh { positions, triangles, addresses: None }
}

#[test]
fn a_soup_of_triangles_becomes_a_closed_manifold_within_a_millionth_of_a_voxel() {
    let straight = grid();
    let (s, c) = 0.4_f64.sin_cos();
    let far = Grid::new(
        [12; 3],
        [0.5, 0.25, 1.5],
        [1e6, -1e6, 1e6],
        [[-c, -s, 0.0], [-s, c, 0.0], [0.0, 0.0, 1.0]],
    );
    for grid in [straight, far.unwrap()] {
        for seed in 0..6 {
            let mut mesh = bumpy(6, 0.4, 10.6, seed);
            for p in &mut mesh.positions {
                *p = grid.world(ivd_core::VoxelCoord(*p)).0;
            }
            let handed = if grid.linear_part().determinant() < 0.0 { mesh.triangles.len() as u64 } else { 0 };
            let imported = put(&mesh, &grid);
            let figures = measure(&imported.lattice);
            assert!(figures.is_closed_manifold() && figures.volume_mm3 > 0.0);
            assert_eq!((figures.genus, figures.components, imported.flipped), (Some(0), 1, handed));
            assert_eq!((imported.vertices_in - imported.welded, figures.vertices), (6 * 36 + 2, 6 * 36 + 2));
            assert_eq!(*imported.lattice.source(), LatticeSource::Foreign);
            let inverse = grid.inverse_linear_part();
            let corners = mesh.triangles.iter().zip(imported.lattice.triangles());
            for (t, [a, b, c]) in corners {
                let [b, c] = if handed > 0 { [c, b] } else { [b, c] };
                for (v, w) in t.iter().zip([a, b, c]) {
                    let off = imported.lattice.world(*w as usize).0 - mesh.positions[*v as usize];
                    assert!((inverse * off).norm() < 1e-6);
                }
            }
            assert!(imported.lattice.places().as_flattened().iter().all(|p| (0.0..1.0).contains(p)));
        }
    }
}

#[test]
fn what_comes_from_outside_can_be_refined_and_keeps_its_keys() {
    let imported = put(&bumpy(8, 1.0, 10.0, 4), &grid());
    let params = RefineParams { target: Target::Ratio(0.4).into(), ..RefineParams::default() };
    let refined = collapse(&imported.lattice, &params, &Exec::default()).unwrap().lattice;
    assert!(measure(&refined).is_closed_manifold());
    for (key, place) in refined.keys().iter().zip(refined.places()) {
        let old = imported.lattice.vertex_at(*key).unwrap();
        assert_eq!(imported.lattice.places()[old as usize], *place);
    }
}

#[test]
fn triangles_turned_at_random_are_turned_back_through_three_levels_of_nesting() {
    let cut = solids::nested();
    assert_eq!(measure(&cut).components, 3);
    let mut mesh = solids::mesh(&cut);
    for seed in 0..4 {
        let mut turned_over = 0;
        for (t, triangle) in mesh.triangles.iter_mut().enumerate() {
            *triangle = cut.triangles()[t];
            // The last time all of them.
            if seed == 3 || hash(seed << 32 | t as u64).is_multiple_of(3) {
                triangle.swap(0, 1);
                turned_over += 1;
            }
        }
        let imported = put(&mesh, cut.grid());
        assert_eq!(imported.flipped, turned_over);
        let wanted: Vec<_> = cut.triangles().iter().map(|t| turned(*t)).collect();
        let found: Vec<_> = imported.lattice.triangles().iter().map(|t| turned(*t)).collect();
        assert!(found == wanted);
    }
}

#[test]
fn parts_that_pass_through_each_other_all_stay_outward_and_a_box_in_a_box_becomes_a_cavity() {
    let mut mesh = boxes(&[
        ([1.0; 3], [6.0; 3]),
        ([4.0, 2.0, 3.0], [9.0, 5.0, 4.0]),
        ([1.5, 0.5, 4.5], [4.5, 9.5, 5.5]),
    ]);
    assert_eq!(put(&mesh, &grid()).flipped, 0);
    // One of them inside out.
    for t in &mut mesh.triangles[12..24] {
        t.swap(0, 2);
    }
    let imported = put(&mesh, &grid());
    assert_eq!(imported.flipped, 12);
    assert!((measure(&imported.lattice).volume_mm3 - (125.0 + 15.0 + 27.0)).abs() < 1e-9);
    let nested = put(&boxes(&[([1.0; 3], [8.0; 3]), ([2.0; 3], [4.0; 3]), ([5.0; 3], [7.0; 3])]), &grid());
    assert_eq!(nested.flipped, 24);
    assert!((measure(&nested.lattice).volume_mm3 - (343.0 - 16.0)).abs() < 1e-9);
}

#[test]
fn the_result_is_the_same_for_any_number_of_threads() {
    let cut = solids::nested();
    let run = |threads| {
        let exec = Exec::default().with_threads(threads);
        lattice(&solids::mesh(&cut), cut.grid(), &ImportParams { weld: 1e-4, allow_open: false }, &exec)
            .unwrap()
    };
    assert!(run(1) == run(7));
}

#[test]
fn repeated_degenerate_and_unused_parts_are_dropped_and_counted() {
    let mut mesh = boxes(&[([1.0; 3], [4.0, 3.0, 2.0])]);
    let first = mesh.triangles[0];
    mesh.triangles.push([first[1], first[2], first[0]]);
    mesh.triangles.push([first[1], first[0], first[2]]);
    mesh.triangles.push([3, 3, 5]);
    mesh.positions.push(Vector3::new(9.0, 9.0, 9.0));
    mesh.positions.push(Vector3::new(1.0, 1.0, 1.0));
    mesh.triangles.push([0, 9, 1]);
    let imported = put(&mesh, &grid());
    assert_eq!((imported.duplicate, imported.degenerate, imported.unused, imported.welded), (2, 2, 1, 1));
    let figures = measure(&imported.lattice);
    assert!(figures.is_closed_manifold());
    assert_eq!((figures.vertices, figures.triangles, figures.volume_mm3), (8, 12, 6.0));
}

#[test]
fn corners_that_differ_a_little_are_welded_with_a_tolerance_alone() {
    let mut mesh = bumpy(5, 1.0, 10.0, 9);
    for (i, p) in mesh.positions.iter_mut().enumerate() {
        *p += Vector3::from_fn(|a, _| (hash((3 * i + a) as u64) % 100) as f64 * 1e-7);
    }
    assert!(refused(&mesh).contains("open borders"));
    let params = ImportParams { weld: 1e-4, allow_open: false };
    let imported = lattice(&mesh, &grid(), &params, &Exec::default()).unwrap();
    assert_eq!((imported.lattice.keys().len(), measure(&imported.lattice).genus), (6 * 25 + 2, Some(0)));
}

#[test]
fn open_borders_touching_parts_and_one_sided_strips_are_refused_with_their_places() {
    let mut open = boxes(&[([1.0; 3], [2.0; 3]), ([4.0, 5.0, 6.0], [7.0; 3])]);
    open.triangles.pop();
    let message = refused(&open);
    assert!(
        message.contains("3 edges with one triangle") && message.contains("(7.000, 5.000, 6.000) mm"),
        "{message}"
    );
    assert!(message.contains("allow open"), "{message}");
    let allowed = ImportParams { allow_open: true, ..ImportParams::default() };
    let imported = lattice(&open, &grid(), &allowed, &Exec::default()).unwrap();
    assert_eq!((imported.boundary_edges, imported.lattice.triangles().len()), (3, 23));

    let edge = boxes(&[([1.0; 3], [2.0; 3]), ([2.0, 2.0, 1.0], [3.0, 3.0, 2.0])]);
    let message = refused(&edge);
    assert!(
        message.contains("1 edges with more than two") && message.contains("(2.000, 2.000, "),
        "{message}"
    );

    let corner = boxes(&[([1.0; 3], [2.0; 3]), ([2.0; 3], [3.0; 3])]);
    let message = refused(&corner);
    assert!(message.contains("1 vertices") && message.contains("(2.000, 2.000, 2.000) mm"), "{message}");

    let strip: Vec<[f64; 3]> = (0..10)
        .flat_map(|i| {
            let (turn, half) =
                (f64::from(i) * std::f64::consts::TAU / 10.0, f64::from(i) * std::f64::consts::PI / 10.0);
            [-1.0, 1.0].map(|w| {
                let r = 4.0 + w * half.cos();
                [6.0 + r * turn.cos(), 6.0 + r * turn.sin(), 6.0 + w * half.sin()]
            })
        })
        .collect();
    let sides = (0..10_u32).flat_map(|i| {
        let [a, b] = [2 * i, 2 * i + 1];
        // Half a turn later the edges have changed places.
        let [c, d] = if i == 9 { [1, 0] } else { [2 * i + 2, 2 * i + 3] };
        [[a, b, d], [a, d, c]]
    });
    let strip = solids::of(&strip, &sides.collect::<Vec<_>>());
    let imported = lattice(&strip, &grid(), &allowed, &Exec::default()).unwrap();
    assert_eq!((imported.one_sided_edges, imported.boundary_edges), (1, 20));
}

#[test]
fn a_klein_bottle_has_one_side_and_is_refused() {
    // A torus of quads whose last column is glued on upside down: closed, every edge of two triangles, and not orientable.
    let n = 8_u32;
    let at = |i: u32, j: u32| if i == n { (n - j) % n } else { i * n + j % n };
    let positions: Vec<[f64; 3]> = (0..n * n)
        .map(|v| {
            [1.0 + f64::from(v % n), 1.0 + f64::from(v / n), 1.0 + f64::from(hash(v.into()) as u8) / 40.0]
        })
        .collect();
    let quads = (0..n * n).flat_map(|q| {
        let (i, j) = (q / n, q % n);
        let [a, b, c, d] = [at(i, j), at(i + 1, j), at(i + 1, j + 1), at(i, j + 1)];
        [[a, b, c], [a, c, d]]
    });
    let message = refused(&solids::of(&positions, &quads.collect::<Vec<_>>()));
    assert!(message.contains("one side alone"), "{message}");
}

#[test]
fn a_mesh_outside_the_grid_or_crowded_in_a_voxel_is_refused_with_the_remedy() {
    let message = refused(&boxes(&[([1.0; 3], [3.0, 20.5, 3.0])]));
    assert!(
        message.contains("4 of 8 vertices") && message.contains("vertex 2 is at (1.000, 20.500, 1.000) mm"),
        "{message}"
    );
    assert!(message.contains("from (-1.000, -1.000, -1.000) mm to (12.000, 12.000, 12.000) mm"), "{message}");
    assert!(message.contains("unit"), "{message}");
    // The border layer belongs to it.
    let edge = put(&boxes(&[([-1.0; 3], [12.0; 3])]), &grid()).lattice;
    assert_eq!((edge.keys()[0].voxel([12; 3]), edge.keys()[7].voxel([12; 3])), ([-1; 3], [12; 3]));

    let message = refused(&bumpy(4, 5.1, 5.9, 1));
    assert!(message.contains("1 voxel holds more than 8 vertices, the first 98 of them"), "{message}");
    assert!(message.contains("voxel [5, 5, 5]") && message.contains("finer grid"), "{message}");
    let fine = Grid::new([40; 3], [0.05; 3], [4.9; 3], [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]]);
    assert!(measure(&put(&bumpy(4, 5.1, 5.9, 1), &fine.unwrap()).lattice).is_closed_manifold());
}

#[test]
fn eight_vertices_share_a_voxel_and_all_of_them_are_found_there() {
    let cut: Lattice = put(&boxes(&[([3.2; 3], [3.8; 3])]), &grid()).lattice;
    assert_eq!(cut.vertices_of_voxel([3; 3]), 0..8);
    let elements: Vec<u8> = cut.keys().iter().map(|k| k.element()).collect();
    assert_eq!(elements, [0, 1, 2, 3, 4, 5, 6, 7]);
    assert!((measure(&cut).volume_mm3 - 0.216).abs() < 1e-6);
}

#[test]
fn hand_made_meshes_that_make_no_sense_are_refused() {
    let mut mesh = boxes(&[([1.0; 3], [2.0; 3])]);
    mesh.triangles[3][1] = 8;
    assert!(refused(&mesh).contains("triangle 3 names a vertex beyond 8"));
    let mut mesh = boxes(&[([1.0; 3], [2.0; 3])]);
    mesh.positions[5].y = f64::NAN;
    assert!(refused(&mesh).contains("vertex 5"));
    mesh.positions[5].y = 1e300;
    assert!(refused(&mesh).contains("vertex 5"));
    for weld in [-1.0, f64::NAN, f64::INFINITY] {
        let params = ImportParams { weld, allow_open: false };
        let error = lattice(&Mesh::default(), &grid(), &params, &Exec::default()).unwrap_err();
        assert_eq!(error.error_class(), ErrorClass::Usage);
    }
    let empty = put(&Mesh::default(), &grid());
    assert!(empty.lattice.keys().is_empty() && empty.moved_mm == 0.0);
    let exec = Exec::default();
    exec.cancel.cancel();
    let error =
        lattice(&boxes(&[([1.0; 3], [2.0; 3])]), &grid(), &ImportParams::default(), &exec).unwrap_err();
    assert_eq!(error.error_class(), ErrorClass::Cancelled);
    let exec = Exec::default().with_memory_limit(Some(100));
    let error =
        lattice(&boxes(&[([1.0; 3], [2.0; 3])]), &grid(), &ImportParams::default(), &exec).unwrap_err();
    assert_eq!(error.error_class(), ErrorClass::Limit);
}
