//! A displacement field as other programs read it: dense, vectors first, millimetres in LPS.
#![allow(clippy::unwrap_used, reason = "what builds a test's files may fail it")]

use ivd_core::{Displacement, Exec, FieldBricks, Grid, NO_BRICK, VoxelIndex};
use ivd_volume::{Error, FieldDirection, write_field};

const DIMS: [usize; 3] = [10, 9, 3];

fn displacement() -> Displacement {
    let grid = Grid::new(
        DIMS,
        [0.5, 1.0, 2.0],
        [10.0, 20.0, 30.0],
        [[0.0, 1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]],
    )
    .unwrap();
    let vectors: Vec<[f32; 3]> = (0..512).map(|i| [i as f32, -2.0 * i as f32, 0.25]).collect();
    let table = vec![NO_BRICK, NO_BRICK, NO_BRICK, 0];
    let forward = FieldBricks::new(DIMS, table, vectors.into()).unwrap();
    Displacement {
        grid,
        time: 0.0,
        forward,
        inverse: FieldBricks::zero(DIMS),
        inverse_residual_max: 0.0,
        min_det_j: 1.0,
        vacated: Vec::new().into(),
    }
}

#[test]
fn a_field_is_dense_with_vectors_and_grid_in_lps() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("field.nrrd");
    let displacement = displacement();
    write_field(&path, &displacement, FieldDirection::Forward, &Exec::default()).unwrap();
    let bytes = std::fs::read(&path).unwrap();
    let end = bytes.windows(2).position(|w| w == b"\n\n").unwrap() + 2;
    let header = String::from_utf8_lossy(&bytes[..end]);
    for line in [
        "dimension: 4",
        "sizes: 3 10 9 3",
        "space: left-posterior-superior",
        "space directions: none (0.0,-0.5,0.0) (-1.0,0.0,0.0) (0.0,0.0,2.0)",
        "space origin: (-10.0,-20.0,30.0)",
        "kinds: vector domain domain domain",
        "type: float",
        "endian: little",
    ] {
        assert!(header.lines().any(|l| l == line), "{line} in {header}");
    }
    let numbers: Vec<f32> =
        bytes[end..].chunks_exact(4).map(|b| f32::from_le_bytes(b.try_into().unwrap())).collect();
    assert_eq!(numbers.len(), 3 * 270);
    for (voxel, vector) in numbers.chunks_exact(3).enumerate() {
        let at = VoxelIndex([voxel % 10, voxel / 10 % 9, voxel / 90]);
        let [r, a, s] = displacement.forward.at(at);
        assert_eq!(vector, [-r, -a, s], "{at:?}");
    }
}

#[test]
fn a_field_that_is_zero_is_written_whole_and_without_negative_zeros() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("field.nrrd");
    write_field(&path, &displacement(), FieldDirection::Inverse, &Exec::default()).unwrap();
    let bytes = std::fs::read(&path).unwrap();
    assert!(bytes.ends_with(&[0; 3 * 270 * 4]));
    let again = write_field(&path, &displacement(), FieldDirection::Inverse, &Exec::default()).unwrap();
    assert!(!again.touched);
}

#[test]
fn another_ending_is_refused() {
    let error = write_field("a.png".as_ref(), &displacement(), FieldDirection::Forward, &Exec::default())
        .unwrap_err();
    assert!(matches!(error, Error::Unknown { .. }), "{error}");
}
