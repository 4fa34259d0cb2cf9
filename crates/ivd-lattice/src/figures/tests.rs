use super::*;
use ivd_core::{ElementKey, Grid, LatticeSource};

/// A lattice with vertex `i` at voxel `at[i]`; its triangles name vertices by their place in `at`.
fn mesh(at: &[[usize; 3]], triangles: &[[u32; 3]], spacing: [f64; 3]) -> Lattice {
    let grid = Grid::with_spacing([9; 3], spacing).unwrap();
    let mut order: Vec<usize> = (0..at.len()).collect();
    let key = |i: usize| ElementKey::new(grid.dims(), at[i].map(|c| c + 1), 6);
    order.sort_by_key(|&i| key(i));
    let rank = |i: u32| order.iter().position(|&o| o == i as usize).unwrap() as u32;
    Lattice::new(
        grid.clone(),
        order.iter().map(|&i| key(i)).collect(),
        vec![[0.0; 3]; at.len()].into(),
        triangles.iter().map(|t| t.map(rank)).collect(),
    )
    .unwrap()
    .with_source(LatticeSource::Mask)
}

/// Surface of the given unit cubes, outward, with coincident vertices shared.
fn cubes(cells: &[[usize; 3]], spacing: [f64; 3]) -> Lattice {
    let mut at: Vec<[usize; 3]> = Vec::new();
    let mut triangles = Vec::new();
    for &cell in cells {
        for axis in 0..3 {
            for side in 0..2_usize {
                let mut beyond = cell.map(|c| c as i64);
                beyond[axis] += 2 * side as i64 - 1;
                if cells.iter().any(|c| c.map(|c| c as i64) == beyond) {
                    continue;
                }
                let (u, v) = ((axis + 1) % 3, (axis + 2) % 3);
                let quad = [[0, 0], [1, 0], [1, 1], [0, 1]].map(|[du, dv]| {
                    let mut p = cell;
                    p[axis] += side;
                    p[u] += du;
                    p[v] += dv;
                    at.iter().position(|&q| q == p).unwrap_or_else(|| {
                        at.push(p);
                        at.len() - 1
                    }) as u32
                });
                let [a, b, c, d] = if side == 1 { quad } else { [quad[0], quad[3], quad[2], quad[1]] };
                triangles.extend([[a, b, c], [a, c, d]]);
            }
        }
    }
    mesh(&at, &triangles, spacing)
}

#[test]
fn a_box_has_its_area_and_volume_in_millimetres() {
    let figures = measure(&cubes(&[[1, 1, 1], [2, 1, 1]], [0.5, 2.0, 10.0]));
    assert!(figures.is_closed_manifold());
    assert_eq!((figures.euler, figures.genus, figures.components), (2, Some(0), 1));
    assert!((figures.volume_mm3 - 20.0).abs() < 1e-12);
    assert!((figures.area_mm2 - 2.0 * (2.0 + 10.0 + 20.0)).abs() < 1e-12);
}

#[test]
fn a_ring_of_cubes_has_genus_one_and_two_boxes_two_components() {
    let ring: Vec<[usize; 3]> = (0..9).filter(|&i| i != 4).map(|i| [1 + i % 3, 1 + i / 3, 1]).collect();
    let figures = measure(&cubes(&ring, [1.0; 3]));
    assert_eq!((figures.euler, figures.genus), (0, Some(1)));
    let two = measure(&cubes(&[[1, 1, 1], [5, 5, 5]], [1.0; 3]));
    assert_eq!((two.components, two.genus, two.euler), (2, Some(0), 4));
}

#[test]
fn cubes_that_share_only_an_edge_or_a_corner_are_found_out() {
    let edge = measure(&cubes(&[[1, 1, 1], [2, 2, 1]], [1.0; 3]));
    assert_eq!((edge.non_manifold_edges, edge.boundary_edges, edge.genus), (1, 0, None));
    let corner = measure(&cubes(&[[1, 1, 1], [2, 2, 2]], [1.0; 3]));
    assert_eq!((corner.non_manifold_edges, corner.bow_tie_vertices, corner.genus), (0, 1, None));
}

#[test]
fn holes_flips_repeats_coincidences_and_strays_are_counted() {
    let whole = cubes(&[[1, 1, 1]], [1.0; 3]);
    let mut triangles = whole.triangles().to_vec();
    triangles[0].swap(0, 1);
    assert_eq!(
        measure(&whole.clone().with_triangles(triangles.clone().into()).unwrap()).misoriented_edges,
        3
    );
    triangles.remove(0);
    assert_eq!(measure(&whole.with_triangles(triangles.into()).unwrap()).boundary_edges, 3);
    let stray = mesh(&[[0; 3], [1, 0, 0], [0, 1, 0], [5, 5, 5]], &[[0, 1, 2], [0, 0, 1]], [1.0; 3]);
    let figures = measure(&stray);
    assert_eq!((figures.degenerate_triangles, figures.unused_vertices, figures.components), (1, 1, 1));
    // Cell (0, 0, 0) at place 1 along x is cell (1, 0, 0) at place 0.
    let (grid, mut places) = (stray.grid().clone(), stray.places().to_vec());
    places[0] = [1.0, 0.0, 0.0];
    let coincident =
        Lattice::new(grid, stray.keys().to_vec().into(), places.into(), stray.triangles().to_vec().into())
            .unwrap();
    assert_eq!(measure(&coincident).degenerate_triangles, 2);
}

#[test]
fn an_empty_lattice_measures_zero() {
    let figures = measure(&mesh(&[], &[], [1.0; 3]));
    assert!(figures.is_closed_manifold());
    assert_eq!((figures.vertices, figures.euler, figures.components, figures.genus), (0, 0, 0, Some(0)));
    assert_eq!((figures.area_mm2, figures.volume_mm3), (0.0, 0.0));
}
