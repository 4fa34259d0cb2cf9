//! A displacement field as other programs read it: dense, vectors first, millimetres in LPS.
#![allow(clippy::unwrap_used, reason = "what builds a test's files may fail it")]

use ivd_core::{Displacement, Exec, FieldBricks, Grid, NO_BRICK, VoxelIndex};
use ivd_io::volume::{Error, FieldDirection, ReadOptions, read_field, write_field};

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
    Displacement::new(grid, forward, FieldBricks::zero(DIMS)).unwrap()
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
        "displacement:=forward mm LPS",
    ] {
        assert!(header.lines().any(|l| l == line), "{line} in {header}");
    }
    let numbers: Vec<f32> =
        bytes[end..].chunks_exact(4).map(|b| f32::from_le_bytes(b.try_into().unwrap())).collect();
    assert_eq!(numbers.len(), 3 * 270);
    for (voxel, vector) in numbers.chunks_exact(3).enumerate() {
        let at = VoxelIndex([voxel % 10, voxel / 10 % 9, voxel / 90]);
        let [r, a, s] = displacement.forward().at(at);
        assert_eq!(vector, [-r, -a, s], "{at:?}");
    }
}

#[test]
fn metaimage_holds_three_channels_and_says_which_way_they_lead() {
    let folder = tempfile::tempdir().unwrap();
    let [path, other] = ["field.mha", "field.nrrd"].map(|name| folder.path().join(name));
    let displacement = displacement();
    for path in [&path, &other] {
        write_field(path, &displacement, FieldDirection::Forward, &Exec::default()).unwrap();
    }
    let bytes = std::fs::read(&path).unwrap();
    let header = String::from_utf8_lossy(&bytes);
    for line in [
        "NDims = 3",
        "DimSize = 10 9 3",
        "TransformMatrix = 0.0 -1.0 0.0 -1.0 0.0 0.0 0.0 0.0 1.0",
        "Offset = -10.0 -20.0 30.0",
        "ElementNumberOfChannels = 3",
        "ElementType = MET_FLOAT",
        "Comment = forward mm LPS",
    ] {
        assert!(header.lines().any(|l| l == line), "{line} in {header}");
    }
    // The same numbers in the same order.
    let numbers = 3 * 270 * 4;
    let theirs = std::fs::read(&other).unwrap();
    assert_eq!(bytes[bytes.len() - numbers..], theirs[theirs.len() - numbers..]);
    let read = |path| read_field(path, &Exec::default()).unwrap();
    assert_eq!(read(&path), read(&other));
    assert_eq!(read(&path).direction, Some(FieldDirection::Forward));
    // Two numbers a voxel are no field, and three no volume.
    let told = volume_error(&path);
    assert!(told.contains("--displacement"), "{told}");
    let (head, rest) = bytes.split_at(bytes.len() - numbers);
    let two = String::from_utf8_lossy(head).replace("Channels = 3", "Channels = 2");
    std::fs::write(&path, [two.as_bytes(), rest].concat()).unwrap();
    let told = read_field(&path, &Exec::default()).unwrap_err().to_string();
    assert!(told.contains("ElementNumberOfChannels") && told.contains("2 a voxel"), "{told}");
    let told = volume_error(&path);
    assert!(told.contains("one component"), "{told}");
}

fn volume_error(path: &std::path::Path) -> String {
    ivd_io::volume::read(path, &ReadOptions::default(), &Exec::default()).unwrap_err().to_string()
}

#[test]
fn nifti_holds_the_components_one_after_the_other_and_says_which_way_they_lead() {
    let folder = tempfile::tempdir().unwrap();
    let displacement = displacement();
    let plain = folder.path().join("field.nii");
    write_field(&plain, &displacement, FieldDirection::Forward, &Exec::default()).unwrap();
    let bytes = std::fs::read(&plain).unwrap();
    let i16_at = |at: usize| i16::from_le_bytes([bytes[at], bytes[at + 1]]);
    assert_eq!([40, 42, 44, 46, 48, 50].map(i16_at), [5, 10, 9, 3, 1, 3]);
    assert_eq!((i16_at(68), i16_at(70), &bytes[328..343]), (1007, 16, &b"forward mm LPS\0"[..]));
    let numbers: Vec<f32> =
        bytes[352..].chunks_exact(4).map(|b| f32::from_le_bytes(b.try_into().unwrap())).collect();
    assert_eq!(numbers.len(), 3 * 270);
    for voxel in 0..270 {
        let [r, a, s] = displacement.forward().at(VoxelIndex([voxel % 10, voxel / 10 % 9, voxel / 90]));
        assert_eq!([0, 270, 540].map(|at| numbers[voxel + at]), [0.0 - r, 0.0 - a, s]);
    }
    // More voxels along an axis than the first version of the format counts.
    let long = [2, 32_768, 1];
    let grid = Grid::with_spacing(long, [0.5; 3]).unwrap();
    let long = Displacement::new(grid, FieldBricks::zero(long), FieldBricks::zero(long)).unwrap();
    write_field(&plain, &long, FieldDirection::Inverse, &Exec::default()).unwrap();
    let bytes = std::fs::read(&plain).unwrap();
    assert_eq!((bytes[0], bytes[504], bytes[505], &bytes[508..523]), (28, 239, 3, &b"inverse mm LPS\0"[..]));
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
