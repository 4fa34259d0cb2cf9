//! What our writers write comes back.

use ivd_core::{Classified, Lattice};
use ivd_core::{Mesh, MeshAddress as Address};
use ivd_io::mesh::Format;
use nalgebra::Vector3;

use crate::meshes::{file, grids, read, solids};

fn lattices() -> impl Iterator<Item = Lattice> {
    (0_u64..).zip(grids()).flat_map(|(i, grid)| (0..3).map(move |j| solids::random(&grid, 7 * i + j)))
}

fn addresses(lattice: &Lattice) -> Vec<Address> {
    let dims = lattice.grid().dims();
    lattice.keys().iter().map(|key| (key.voxel(dims), key.element())).collect()
}

#[test]
fn ply_and_vtp_give_every_bit_back_and_the_addresses() {
    for lattice in lattices() {
        for format in [Format::Ply, Format::Vtp] {
            let mesh = read(format, &file(format, &lattice).0).unwrap();
            let wanted = Mesh {
                positions: lattice.positions(),
                triangles: lattice.triangles().to_vec(),
                addresses: Some(addresses(&lattice)),
            };
            assert!(mesh == wanted, "{format:?} on {:?}", lattice.grid());
        }
    }
}

#[test]
fn obj_gives_every_bit_back() {
    for lattice in lattices() {
        assert!(read(Format::Obj, &file(Format::Obj, &lattice).0).unwrap() == solids::mesh(&lattice));
    }
}

#[test]
fn stl_gives_the_corners_back_as_f32() {
    for lattice in lattices() {
        let mesh = read(Format::Stl, &file(Format::Stl, &lattice).0).unwrap();
        let (positions, corners) = (lattice.positions(), lattice.triangles().as_flattened());
        let rounded = |v: &u32| positions[*v as usize].map(|c| f64::from(c as f32));
        assert!(mesh.positions.iter().copied().eq(corners.iter().map(rounded)));
        assert!(mesh.triangles.as_flattened().iter().copied().eq(0..corners.len() as u32));
        assert_eq!(mesh.addresses, None);
    }
}

#[test]
fn glb_gives_the_triangles_back_and_the_positions_within_what_the_writer_says() {
    for lattice in lattices() {
        let (bytes, rounding) = file(Format::Glb, &lattice);
        let mesh = read(Format::Glb, &bytes).unwrap();
        assert_eq!(mesh.triangles, lattice.triangles());
        assert!(rounding < 1e-5);
        for (read, wanted) in mesh.positions.iter().zip(lattice.positions()) {
            let bound = rounding + 4.0 * f64::EPSILON * wanted.amax();
            assert!((read - wanted).amax() <= bound, "{read} instead of {wanted}");
        }
    }
}

#[test]
fn a_glb_whose_generator_is_another_is_turned_back_by_the_standard() {
    let lattice = solids::random(&grids()[3], 5);
    let (bytes, _) = file(Format::Glb, &lattice);
    let at = bytes.windows(5).position(|w| w == b"\"ivd\"").unwrap();
    let mut other = bytes.clone();
    other[at..at + 5].copy_from_slice(b"\"xyz\"");
    let (ours, others) = (read(Format::Glb, &bytes).unwrap(), read(Format::Glb, &other).unwrap());
    assert_eq!(ours.triangles, others.triangles);
    let apart = ours.positions.iter().zip(&others.positions).map(|(a, b)| (a - b).norm());
    assert!(apart.fold(0.0, f64::max) < 1e-10, "the same but for the rounding of the two turns");
}

#[test]
fn an_empty_lattice_comes_back_empty() {
    let lattice = solids::random(&grids()[0], 1).subset(&[], vec![]).unwrap();
    for format in Format::ALL {
        let mesh = read(format, &file(format, &lattice).0).unwrap();
        assert_eq!((mesh.positions, mesh.triangles), (Vec::<Vector3<f64>>::new(), Vec::new()), "{format:?}");
    }
}

#[test]
fn a_file_is_read_by_its_path_and_within_its_limit() {
    let lattice = solids::random(&grids()[1], 2);
    let folder = tempfile::tempdir().unwrap();
    for format in Format::ALL {
        let path = folder.path().join("mesh").with_extension(format.ending());
        ivd_io::mesh::write(&path, &lattice, None).unwrap();
        let mesh = ivd_io::mesh::read(&path, 10 << 20).unwrap();
        assert_eq!(mesh.triangles.len(), lattice.triangles().len());
        let size = std::fs::metadata(&path).unwrap().len();
        for limit in [0, size - 1, size + 100] {
            let error = ivd_io::mesh::read(&path, limit).unwrap_err();
            assert_eq!(error.error_class(), ivd_core::ErrorClass::Limit, "{format:?}: {error}");
        }
    }
    let class = |path: &std::path::Path| ivd_io::mesh::read(path, u64::MAX).unwrap_err().error_class();
    assert_eq!(class(&folder.path().join("mesh.vtk")), ivd_core::ErrorClass::Usage);
    assert_eq!(class(&folder.path().join("none.ply")), ivd_core::ErrorClass::Io);
    std::fs::create_dir(folder.path().join("folder.ply")).unwrap();
    assert_eq!(class(&folder.path().join("folder.ply")), ivd_core::ErrorClass::Io);
}
