//! What is written is read back: every format, every stored type, on grids that are oblique, left-handed or far away.
#![allow(clippy::unwrap_used, reason = "what builds a test's files may fail it")]

use std::f64::consts::FRAC_1_SQRT_2;
use std::io::Read as _;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use ivd_core::{Exec, Grid, Reference, Scalar, Volume, VoxelCoord, VoxelType, Voxels};
use ivd_io::volume::{ByteOrder, RawLayout, ReadOptions, read, write};

use crate::notes::Notes;

const DIMS: [usize; 3] = [5, 4, 3];

fn grids() -> Vec<(&'static str, Grid)> {
    let (s, c) = 0.27_f64.sin_cos();
    let h = FRAC_1_SQRT_2;
    let lean = [0.2_f64.sin(), 0.0, 0.2_f64.cos()];
    vec![
        ("along the axes", Grid::with_spacing(DIMS, [0.5, 0.898_437, 2.0]).unwrap()),
        (
            "oblique",
            Grid::new(
                DIMS,
                [0.43, 0.43, 6.5],
                [-12.5, 20.25, 3.0],
                [[-c, -s, 0.0], [s, -c, 0.0], [0.0, 0.0, 1.0]],
            )
            .unwrap(),
        ),
        (
            "left-handed",
            Grid::new(DIMS, [1.0, 2.0, 3.0], [1.0, 2.0, 3.0], [[h, h, 0.0], [h, -h, 0.0], [0.0, 0.0, 1.0]])
                .unwrap(),
        ),
        ("sheared", Grid::new(DIMS, [1.0; 3], [0.0; 3], [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], lean]).unwrap()),
        (
            "far away",
            Grid::new(
                DIMS,
                [0.1; 3],
                [1e6 + 0.03, -1e6, 5.0],
                [[1.0, 0.0, 0.0], [0.0, 0.0, 1.0], [0.0, 1.0, 0.0]],
            )
            .unwrap(),
        ),
    ]
}

/// Values that tell every byte of a number apart, the type's limits and, in floats, NaN payloads and infinities.
fn voxels(voxel_type: VoxelType) -> Voxels {
    fn make<T: Scalar>() -> Voxels {
        let width = size_of::<T>();
        let mut bytes: Vec<u8> = (0..60 * width).map(|i| (i * 37 + i / 7) as u8).collect();
        bytes[..width].fill(0xff);
        bytes[width..2 * width].fill(0x7f);
        bytes[2 * width..3 * width].fill(0);
        bytes[3 * width..4 * width].fill(0x80);
        let values: Vec<T> = bytes.chunks_exact(width).map(bytemuck::pod_read_unaligned).collect();
        T::wrap(values.into())
    }
    match voxel_type {
        VoxelType::U8 => make::<u8>(),
        VoxelType::I8 => make::<i8>(),
        VoxelType::U16 => make::<u16>(),
        VoxelType::I16 => make::<i16>(),
        VoxelType::U32 => make::<u32>(),
        VoxelType::I32 => make::<i32>(),
        VoxelType::F32 => make::<f32>(),
        VoxelType::F64 => make::<f64>(),
    }
}

const TYPES: [VoxelType; 8] = [
    VoxelType::U8,
    VoxelType::I8,
    VoxelType::U16,
    VoxelType::I16,
    VoxelType::U32,
    VoxelType::I32,
    VoxelType::F32,
    VoxelType::F64,
];

/// Largest distance between the corners of two grids [mm].
fn apart(a: &Grid, b: &Grid) -> f64 {
    (0..8_usize)
        .map(|corner| {
            let at = nalgebra::Vector3::from_fn(|i, _| (corner >> i & 1) as f64 * (DIMS[i] - 1) as f64);
            (a.world(VoxelCoord(at)).0 - b.world(VoxelCoord(at)).0).norm()
        })
        .fold(0.0, f64::max)
}

#[test]
fn values_come_back_bit_for_bit_and_positions_within_a_micron() {
    let folder = tempfile::tempdir().unwrap();
    let exec = Exec::default();
    for ending in ["nii", "nii.gz", "nrrd", "nhdr", "mha", "mhd"] {
        for (name, grid) in grids() {
            for voxel_type in TYPES {
                let volume = Volume::new(grid.clone(), voxels(voxel_type)).unwrap();
                let path = folder.path().join(format!("a.{ending}"));
                write(&path, &volume, &exec).unwrap();
                let back = read(&path, &ReadOptions::default(), &exec).unwrap();
                let case = format!("{ending}, {name}, {}", voxel_type.name());
                assert_eq!(back.voxel_type(), voxel_type, "{case}");
                assert_eq!(back.voxels().as_bytes(), volume.voxels().as_bytes(), "{case}");
                // NIfTI-1 has 32 bits for a place; at a kilometre that is 0.06 mm, and a note says so.
                let limit = match (ending.starts_with("nii"), name) {
                    (true, "far away") => 0.1,
                    (true, _) => 1e-3,
                    (false, _) => 1e-9,
                };
                assert!(apart(back.grid(), &grid) <= limit, "{case}: {}", apart(back.grid(), &grid));
            }
        }
    }
}

#[test]
fn a_tiff_stack_keeps_values_and_spacing_and_a_note_says_what_it_leaves_out() {
    let folder = tempfile::tempdir().unwrap();
    for ending in ["tif", "TIFF"] {
        let path = folder.path().join(format!("a.{ending}"));
        for (name, grid) in grids() {
            for voxel_type in TYPES {
                let notes = Arc::new(Notes::default());
                let exec = Exec::default().with_observer(notes.clone());
                let volume = Volume::new(grid.clone(), voxels(voxel_type)).unwrap();
                write(&path, &volume, &exec).unwrap();
                let said = std::mem::take(&mut *notes.0.lock().unwrap());
                assert!(
                    matches!(&said[..], [one] if one.contains("origin and direction")),
                    "{name}: {said:?}"
                );
                let back = read(&path, &ReadOptions::default(), &exec).unwrap();
                let case = format!("{ending}, {name}, {}", voxel_type.name());
                assert_eq!(back.voxel_type(), voxel_type, "{case}");
                assert_eq!(back.voxels().as_bytes(), volume.voxels().as_bytes(), "{case}");
                for (found, meant) in back.grid().spacing().iter().zip(grid.spacing()) {
                    assert!((found / meant - 1.0).abs() < 1e-15, "{case}: {found}, not {meant}");
                }
                // What was read lies where a file without a space lies: nothing is left out when it is written.
                write(&path, &back, &exec).unwrap();
                assert!(notes.0.lock().unwrap().is_empty(), "{case}");
            }
        }
    }
}

#[test]
fn a_tiff_of_real_values_holds_them_and_one_of_a_spacing_beyond_its_fractions_says_so() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.tif");
    let notes = Arc::new(Notes::default());
    let exec = Exec::default().with_observer(notes.clone());
    let grid = Grid::with_spacing(DIMS, [1e-12, 1.0, 1.0]).unwrap();
    let volume = Volume::with_scale(grid, voxels(VoxelType::U8), 0.5, -3.0).unwrap();
    write(&path, &volume, &exec).unwrap();
    assert!(notes.0.lock().unwrap().iter().any(|note| note.contains("a spacing of this size")));
    let back = read(&path, &ReadOptions::default(), &exec).unwrap();
    assert_eq!(back.grid().spacing(), [1.0; 3]);
    for at in 0..60 {
        assert_eq!(back.voxels().get(at), 0.5 * volume.voxels().get(at) - 3.0);
    }
}

#[test]
fn slope_and_intercept_stay_in_nifti_and_become_real_values_elsewhere() {
    let folder = tempfile::tempdir().unwrap();
    let exec = Exec::default();
    let (_, grid) = grids().swap_remove(1);
    for (slope, intercept) in [(2.0, -1024.0), (-0.1, 1.0 / 3.0), (2.022_241_4, 0.0)] {
        let volume = Volume::with_scale(grid.clone(), voxels(VoxelType::I16), slope, intercept).unwrap();
        for ending in ["nii", "nii.gz"] {
            let path = folder.path().join(format!("a.{ending}"));
            write(&path, &volume, &exec).unwrap();
            let back = read(&path, &ReadOptions::default(), &exec).unwrap();
            assert_eq!(version(&path), 1, "{ending}");
            let single = |v: f64| f64::from(v as f32);
            assert_eq!((back.slope(), back.intercept()), (single(slope), single(intercept)));
            assert_eq!(back.voxels(), volume.voxels());
            let [low, high] = volume.range().unwrap();
            for i in 0..60 {
                let v = volume.voxels().get(i);
                assert!((back.real(v) - volume.real(v)).abs() <= 1e-7 * (high - low), "{slope}: {v}");
            }
        }
        for ending in ["nrrd", "nhdr", "mha", "mhd"] {
            let path = folder.path().join(format!("a.{ending}"));
            write(&path, &volume, &exec).unwrap();
            let back = read(&path, &ReadOptions::default(), &exec).unwrap();
            assert_eq!(back.voxel_type(), VoxelType::F32);
            for i in 0..60 {
                assert_eq!(back.voxels().get(i), f64::from(volume.real(volume.voxels().get(i)) as f32));
            }
        }
    }
}

#[test]
fn raw_voxels_are_read_with_a_layout() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.raw");
    for voxel_type in TYPES {
        let (_, grid) = grids().swap_remove(0);
        let volume = Volume::new(grid, voxels(voxel_type)).unwrap();
        write(&path, &volume, &Exec::default()).unwrap();
        let layout =
            RawLayout { dims: DIMS, voxel_type, spacing: [1.0; 3], order: ByteOrder::Little, skip: 0 };
        let options = ReadOptions { raw: Some(layout), ..ReadOptions::default() };
        let back = read(&path, &options, &Exec::default()).unwrap();
        assert_eq!(back.voxels().as_bytes(), volume.voxels().as_bytes());
    }
}

/// The version of a NIfTI file, by the size that its header gives itself.
fn version(path: &Path) -> u8 {
    let mut bytes = std::fs::read(path).unwrap();
    if bytes.starts_with(&[0x1f, 0x8b]) {
        let mut unpacked = Vec::new();
        flate2::read::GzDecoder::new(&bytes[..]).read_to_end(&mut unpacked).unwrap();
        bytes = unpacked;
    }
    match i32::from_le_bytes(bytes[..4].try_into().unwrap()) {
        348 => 1,
        540 => 2,
        other => panic!("sizeof_hdr {other}"),
    }
}

/// A volume as it comes back from a file of this name, what was noted on the way, and where the file is.
fn there_and_back(folder: &Path, name: &str, volume: &Volume) -> (Volume, Vec<String>, PathBuf) {
    let notes = Arc::new(Notes::default());
    let exec = Exec::default().with_observer(notes.clone());
    let path = folder.join(name);
    write(&path, volume, &exec).unwrap();
    let said = std::mem::take(&mut *notes.0.lock().unwrap());
    (read(&path, &ReadOptions::default(), &exec).unwrap(), said, path)
}

#[test]
fn nifti_is_version_1_wherever_its_sizes_allow() {
    let folder = tempfile::tempdir().unwrap();
    for (name, grid) in grids() {
        let volume = Volume::new(grid, voxels(VoxelType::U8)).unwrap();
        let (_, said, path) = there_and_back(folder.path(), "a.nii", &volume);
        assert_eq!(version(&path), 1, "{name}");
        let moved = said.iter().any(|note| note.contains("32-bit places move voxels by up to"));
        assert_eq!(
            (moved, said.len()),
            (name == "far away", usize::from(name == "far away")),
            "{name}: {said:?}"
        );
    }
    for (long, expected) in [(32_767, 1), (32_768, 2)] {
        let grid = Grid::with_spacing([1, long, 1], [0.5; 3]).unwrap();
        let values: Vec<i16> = (0..long).map(|i| i as i16).collect();
        let volume = Volume::with_scale(grid, values.into(), 0.1, -3.0).unwrap();
        let (back, said, path) = there_and_back(folder.path(), "long.nii", &volume);
        assert_eq!(version(&path), expected, "{long}");
        assert_eq!((back.voxels(), back.grid()), (volume.voxels(), volume.grid()));
        assert_eq!(said.len(), usize::from(expected == 2), "{said:?}");
        assert!(said.iter().all(|note| note.contains("NIfTI-2, which fewer programs read")), "{said:?}");
    }
}

#[test]
fn a_scale_that_32_bits_would_spoil_is_written_decoded_with_a_note() {
    let folder = tempfile::tempdir().unwrap();
    let grid = Grid::with_spacing([4, 1, 1], [1.0; 3]).unwrap();
    // Whole numbers up to 2³¹, one apart: neither a slope in f32 nor an f32 value tells them apart.
    let stored = vec![i32::MIN, -1, 7, i32::MAX];
    let volume = Volume::with_scale(grid.clone(), stored.clone().into(), 1.0 + 1e-9, 0.5).unwrap();
    let (back, said, path) = there_and_back(folder.path(), "fine.nii", &volume);
    assert_eq!((version(&path), back.voxel_type(), back.slope()), (1, VoxelType::F64, 1.0));
    let real: Vec<f64> = stored.iter().map(|&v| (1.0 + 1e-9) * f64::from(v) + 0.5).collect();
    assert_eq!((0..4).map(|i| back.voxels().get(i)).collect::<Vec<_>>(), real);
    assert!(matches!(&said[..], [one] if one.contains("as f64") && one.contains("1.000000001")), "{said:?}");
    // A slope below what f32 has, values that f32 has.
    let volume = Volume::with_scale(grid, vec![0_i16, 3, 5, -9].into(), 1e-39, 1.0).unwrap();
    let (back, said, path) = there_and_back(folder.path(), "tiny.nii.gz", &volume);
    assert_eq!((version(&path), back.voxel_type(), said.len()), (1, VoxelType::F64, 1));
    assert_eq!(back.voxels().get(1), 3e-39 + 1.0);
}

#[test]
fn a_ct_goes_out_as_whole_numbers_in_every_format() {
    let folder = tempfile::tempdir().unwrap();
    let grid = Grid::with_spacing([2, 2, 1], [0.7, 0.7, 2.0]).unwrap();
    for stored in [Voxels::from(vec![0_u16, 24, 1024, 4095]), Voxels::from(vec![0_i16, 24, 1024, 4095])] {
        let volume = Volume::with_scale(grid.clone(), stored, 1.0, -1024.0).unwrap();
        for ending in ["nii", "nii.gz", "nrrd", "nhdr", "mha", "mhd", "vti", "tif"] {
            let (back, said, _) = there_and_back(folder.path(), &format!("ct.{ending}"), &volume);
            assert_eq!(back.voxels(), &Voxels::from(vec![-1024_i16, -1000, 0, 3071]), "{ending}");
            assert_eq!((back.slope(), back.intercept()), (1.0, 0.0), "{ending}");
            let expected = usize::from(ending == "tif");
            assert_eq!(said.iter().filter(|note| note.contains("TIFF")).count(), expected, "{said:?}");
            assert_eq!(said.len(), expected, "{ending}: {said:?}");
        }
    }
}

#[test]
fn the_same_volume_gives_the_same_bytes_and_leaves_the_file_alone() {
    let folder = tempfile::tempdir().unwrap();
    let (_, grid) = grids().swap_remove(1);
    let volume = Volume::new(grid, voxels(VoxelType::F32)).unwrap();
    for ending in ["nii", "nii.gz", "nrrd", "nhdr", "mha", "mhd", "vti", "tif", "raw"] {
        let (a, b) = (
            folder.path().join(format!("{ending}-a.{ending}")),
            folder.path().join(format!("{ending}-b.{ending}")),
        );
        assert!(write(&a, &volume, &Exec::default()).unwrap().touched);
        assert!(!write(&a, &volume, &Exec::default()).unwrap().touched, "{ending}");
        std::thread::sleep(std::time::Duration::from_millis(5));
        write(&b, &volume, &Exec::default()).unwrap();
        if !["nhdr", "mhd"].contains(&ending) {
            assert_eq!(
                std::fs::read(a).unwrap(),
                std::fs::read(b).unwrap(),
                "{ending}: no name, no time inside"
            );
        }
    }
}

#[test]
fn an_ending_of_no_format_is_refused_with_those_that_are() {
    let (_, grid) = grids().swap_remove(0);
    let volume = Volume::new(grid, voxels(VoxelType::U8)).unwrap();
    let error = write("a.docx".as_ref(), &volume, &Exec::default()).unwrap_err();
    assert!(error.to_string().contains(".nrrd"), "{error}");
}

#[test]
fn whether_a_file_says_where_the_patient_lies_outlives_every_format_that_can_say_it() {
    let folder = tempfile::tempdir().unwrap();
    for (name, grid) in grids() {
        for in_patient in [true, false] {
            let volume =
                Volume::new(grid.clone(), voxels(VoxelType::I16)).unwrap().with_patient_space(in_patient);
            for file in ["a.nii", "a.nii.gz", "a.nrrd", "a.nhdr", "a.mha", "a.mhd", "a.vti"] {
                let (back, ..) = there_and_back(folder.path(), file, &volume);
                assert_eq!(back.grid().in_patient(), in_patient, "{name}, {file}");
            }
        }
    }
}

#[test]
fn the_space_that_a_nifti_names_is_named_by_what_is_written_of_it() {
    let folder = tempfile::tempdir().unwrap();
    let (_, grid) = grids().swap_remove(0);
    for (code, reference) in [
        (1_i16, Reference::Patient),
        (2, Reference::Aligned),
        (3, Reference::Talairach),
        (4, Reference::Mni),
        (5, Reference::Template),
    ] {
        let volume = Volume::new(grid.clone(), voxels(VoxelType::I16)).unwrap().with_reference(reference);
        let (back, ..) = there_and_back(folder.path(), "a.nii", &volume);
        assert_eq!(back.grid().reference(), reference);
        let header = std::fs::read(folder.path().join("a.nii")).unwrap();
        // `qform_code` and `sform_code`.
        let codes = [252, 254].map(|at| i16::from_le_bytes([header[at], header[at + 1]]));
        assert_eq!(codes, [code; 2], "{reference:?}");
    }
}

#[test]
fn axes_that_are_said_are_those_of_the_grid_and_leave_values_and_the_first_voxel_in_place() {
    let folder = tempfile::tempdir().unwrap();
    let volume = Volume::with_scale(grids().swap_remove(1).1, voxels(VoxelType::U8), 2.0, -7.0).unwrap();
    for (file, stated) in [("a.nrrd", true), ("a.nrrd", false), ("a.nii.gz", true)] {
        let path = folder.path().join(file);
        write(&path, &volume.clone().with_patient_space(stated), &Exec::default()).unwrap();
        let notes = Arc::new(Notes::default());
        let exec = Exec::default().with_observer(notes.clone());
        let options = ReadOptions { axes: Some("PSL".parse().unwrap()), ..ReadOptions::default() };
        let (plain, laid) =
            (read(&path, &ReadOptions::default(), &exec).unwrap(), read(&path, &options, &exec).unwrap());
        assert_eq!(laid.grid().direction(), [[0.0, -1.0, 0.0], [0.0, 0.0, 1.0], [-1.0, 0.0, 0.0]]);
        assert_eq!(laid.grid().origin(), plain.grid().origin());
        assert_eq!(
            (laid.voxels(), laid.slope(), laid.grid().in_patient()),
            (plain.voxels(), plain.slope(), true)
        );
        // Only a file that says otherwise is contradicted.
        assert_eq!(notes.0.lock().unwrap().iter().any(|note| note.contains("axes = PSL")), stated, "{file}");
    }
}

#[test]
fn headers_of_one_stem_and_raw_voxels_each_have_voxels_of_their_own() {
    let folder = tempfile::tempdir().unwrap();
    let files = ["a.mhd", "a.nhdr", "a.raw"].map(|name| folder.path().join(name));
    let grid = Grid::with_spacing([2, 1, 1], [1.0; 3]).unwrap();
    let volume = |value: u8| Volume::new(grid.clone(), Voxels::from(vec![value, value + 1])).unwrap();
    for (file, value) in files.iter().zip([1, 3, 5]) {
        write(file, &volume(value), &Exec::default()).unwrap();
    }
    for (file, value) in files.iter().zip([1, 3]) {
        let back = read(file, &ReadOptions::default(), &Exec::default()).unwrap();
        assert_eq!(back.voxels(), volume(value).voxels());
    }
    assert_eq!(std::fs::read(&files[2]).unwrap(), [5, 6]);
}
