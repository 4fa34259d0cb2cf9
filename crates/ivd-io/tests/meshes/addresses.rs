//! Files that we wrote, put on their own grid again, and on others.

use ivd_core::Mesh;
use ivd_core::{Exec, Grid, Labels, Lattice};
use ivd_io::mesh::{Format, write_deformed};
use ivd_lattice::extract::extract_parts;
use ivd_lattice::import::{Addresses, ImportParams, ImportedMesh, lattice};

use crate::meshes::{file, grids, read, solids};

fn put(mesh: &Mesh, grid: &Grid) -> ImportedMesh {
    lattice(mesh, grid, &ImportParams::default(), &Exec::default()).unwrap()
}

/// The largest distance between positions, in voxels of the grid.
fn apart(a: &Lattice, mesh: &Mesh, order: impl Fn(usize) -> usize) -> f64 {
    let inverse = a.grid().inverse_linear_part();
    let off = |i: usize| (inverse * (a.world(i).0 - mesh.positions[order(i)])).norm();
    (0..a.keys().len()).map(off).fold(0.0, f64::max)
}

#[test]
fn keys_and_places_come_back_bit_for_bit_from_ply_and_vtp() {
    let mut cell_vertices = 0;
    // The first four grids lie where a scan lies, within metres of 0.
    for (i, grid) in grids().iter().take(4).enumerate() {
        for seed in 0..12 {
            let cut = solids::random(grid, 100 * i as u64 + seed);
            cell_vertices += cut.keys().iter().filter(|key| key.element() >= 6).count();
            for format in [Format::Ply, Format::Vtp] {
                let imported = put(&read(format, &file(format, &cut).0).unwrap(), grid);
                assert_eq!(imported.addresses, Addresses::Kept);
                assert_eq!(imported.lattice.keys(), cut.keys());
                let bits = |l: &Lattice| l.places().iter().map(|p| p.map(f32::to_bits)).collect::<Vec<_>>();
                assert!(bits(&imported.lattice) == bits(&cut), "places of seed {seed} on grid {i}");
                assert_eq!(imported.lattice.triangles(), cut.triangles());
                assert_eq!((imported.flipped, imported.welded, imported.moved_mm), (0, 0, 0.0));
            }
        }
    }
    assert!(cell_vertices > 100, "vertices in cells are among them");
}

#[test]
fn lattices_of_several_labels_keep_addresses_that_stand_for_a_third_vertex_of_a_cell() {
    // Three vertices of a part in the one cell between these eight voxels.
    let labels = |grid: Grid| Labels::new(grid, vec![1_u16, 2, 2, 1, 3, 4, 4, 3].into(), Vec::new()).unwrap();
    let mut thirds = 0;
    for order in [[1, 2, 3, 4], [4, 3, 2, 1], [2, 3, 1, 4], [3, 1, 4, 2]] {
        let grid = Grid::with_spacing([2; 3], [1.0; 3]).unwrap();
        for part in extract_parts(&labels(grid.clone()), &order, &Exec::default()).unwrap() {
            let cut = part.lattice;
            let names: Vec<_> = (0..cut.keys().len() as u32).map(|v| cut.describe(v)).collect();
            for further in names.iter().filter(|d| d.element == "cell, further") {
                thirds += 1;
                assert_eq!(further.voxels.len(), 8);
            }
            let imported = put(&read(Format::Ply, &file(Format::Ply, &cut).0).unwrap(), &grid);
            assert_eq!((imported.addresses, imported.lattice.keys()), (Addresses::Kept, cut.keys()));
            assert_eq!(imported.lattice.places(), cut.places());
        }
    }
    assert!(thirds > 0, "none of these orders has a third vertex in a cell");
}

#[test]
fn a_million_millimetres_away_keys_come_back_and_places_as_far_as_the_file_has_them() {
    let axes = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];
    let straight = Grid::new([6; 3], [0.1; 3], [1e6, 1e6, -1e6], axes).unwrap();
    let (mut same, mut all) = (0, 0);
    for grid in grids().iter().skip(4).chain([&straight]) {
        (same, all) = (0, 0);
        for seed in 0..8 {
            let cut = solids::random(grid, 900 + seed);
            for format in [Format::Ply, Format::Vtp] {
                let (bytes, _) = file(format, &cut);
                let mesh = read(format, &bytes).unwrap();
                let imported = put(&mesh, grid);
                assert_eq!(imported.addresses, Addresses::Kept);
                assert_eq!(
                    (imported.lattice.keys(), imported.lattice.triangles()),
                    (cut.keys(), cut.triangles())
                );
                assert!(apart(&imported.lattice, &mesh, |i| i) < 1e-8);
                assert!(file(format, &imported.lattice).0 == bytes, "the same file is written again");
                same += imported.lattice.places().iter().zip(cut.places()).filter(|(a, b)| a == b).count();
                all += cut.places().len();
            }
        }
        assert!(same as f64 > 0.9 * all as f64);
    }
    // 10⁶ mm leave 10⁻¹⁰ mm, a billionth of these voxels. A place of f32 near its voxel can be finer than that, and the file
    // doesn't tell such places apart.
    assert!(same < all, "a file so far away on a grid so straight can't hold every place");
}

#[test]
fn keys_come_back_from_obj_without_addresses_and_positions_from_every_format() {
    for grid in grids() {
        let cut = solids::random(&grid, 31);
        for format in Format::ALL {
            let (bytes, rounding) = file(format, &cut);
            let mesh = Mesh { addresses: None, ..read(format, &bytes).unwrap() };
            if rounding > 1e-3 * grid.spacing()[0] {
                // So far away f32 can't tell the corners of small triangles apart.
                continue;
            }
            let imported = put(&mesh, &grid);
            assert_eq!(imported.addresses, Addresses::Absent);
            let bound = 1e-6 * grid.voxel_diagonal();
            assert!(imported.moved_mm <= bound, "{} mm in {format:?}", imported.moved_mm);
            assert_eq!(imported.lattice.triangles().len(), cut.triangles().len());
            if format == Format::Obj {
                assert_eq!(
                    (imported.lattice.keys(), imported.lattice.triangles()),
                    (cut.keys(), cut.triangles())
                );
                assert!(apart(&imported.lattice, &mesh, |i| i) < 1e-6);
            }
        }
    }
}

#[test]
fn addresses_that_do_not_fit_are_replaced() {
    let grid = &grids()[0];
    let cut = solids::random(grid, 8);
    let mesh = read(Format::Ply, &file(Format::Ply, &cut).0).unwrap();
    let other = Grid::with_spacing([9, 9, 9], [0.9; 3]).unwrap();
    let imported = put(&mesh, &other);
    assert_eq!(imported.addresses, Addresses::Replaced);
    assert!(imported.moved_mm < 1e-6);

    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("moved.ply");
    write_deformed(&path, &cut, &vec![[0.1, -0.2, 0.3]; cut.keys().len()], None).unwrap();
    let mesh = ivd_io::mesh::read(&path, u64::MAX).unwrap();
    assert_eq!(put(&mesh, grid).addresses, Addresses::Replaced);

    let mut twice = read(Format::Ply, &file(Format::Ply, &cut).0).unwrap();
    let addresses = twice.addresses.as_mut().unwrap();
    addresses[1] = addresses[0];
    assert_eq!(put(&twice, grid).addresses, Addresses::Replaced);
    for address in [([i64::MAX; 3], 0), ([-2, 0, 0], 0), ([1, 1, 1], 9)] {
        let mut bad = mesh.clone();
        bad.addresses.as_mut().unwrap()[0] = address;
        assert_eq!(put(&bad, grid).addresses, Addresses::Replaced);
    }
}
