//! Real scans, each with the dims, type and range that its decoding by other readers gave.
#![allow(clippy::unwrap_used, reason = "a test fails where it can't go on")]

use std::path::{Path, PathBuf};
use std::sync::Arc;

use ivd_core::{Exec, Volume, VoxelCoord, VoxelType, Voxels, World};
use ivd_io::volume::{ByteOrder, RawLayout, ReadOptions, read, sources};

use crate::notes::Notes;

fn data() -> Option<PathBuf> {
    let path = Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/../../../shared/data"));
    if path.is_dir() {
        return Some(path.to_owned());
    }
    eprintln!("skipped: no real volumes at {}", path.display());
    None
}

fn load(path: &Path) -> Volume {
    read(path, &ReadOptions::default(), &Exec::default()).expect("a real volume reads")
}

#[test]
fn each_file_has_its_dims_type_spacing_and_range() {
    let Some(data) = data() else { return };
    let table = [
        ("nucleon/nucleon.nrrd", [41, 41, 41], VoxelType::U8, [1.0; 3], [0.0, 249.0]),
        ("head_mr_tiny/HeadMRVolume.mhd", [48, 62, 42], VoxelType::U8, [4.0; 3], [0.0, 255.0]),
        ("tooth/tooth.nhdr", [103, 94, 161], VoxelType::U16, [1.0; 3], [0.0, 1300.0]),
        ("engine/engine.nii.gz", [256, 256, 128], VoxelType::U8, [1.0; 3], [0.0, 255.0]),
        ("bonsai/bonsai.nii.gz", [256, 256, 256], VoxelType::U8, [1.0; 3], [0.0, 255.0]),
        (
            "mri_head_seg3d/MR.nii.gz",
            [160, 232, 160],
            VoxelType::U8,
            [1.0, 0.898_437, 0.898_437],
            [0.0, 512.0],
        ),
        (
            "mri_head_seg3d/Brain.nrrd",
            [160, 232, 160],
            VoxelType::U8,
            [1.0, 0.898_437, 0.898_437],
            [0.0, 1.0],
        ),
        ("ct_abdomen_ts/example_ct.nii.gz", [122, 101, 112], VoxelType::I32, [3.0; 3], [-1207.0, 3382.0]),
        ("ct_abdomen_ts/example_ct_sm.nii.gz", [122, 101, 30], VoxelType::I16, [3.0; 3], [-1100.0, 1207.0]),
        ("frog_labels/frogtissue.mhd", [500, 470, 136], VoxelType::U8, [1.0, 1.0, 1.5], [0.0, 29.0]),
    ];
    for (name, dims, voxel_type, spacing, range) in table {
        let volume = load(&data.join(name));
        assert_eq!(volume.grid().dims(), dims, "{name}");
        assert_eq!(volume.voxel_type(), voxel_type, "{name}");
        for a in 0..3 {
            assert!((volume.grid().spacing()[a] - spacing[a]).abs() < 1e-6, "{name}: {:?}", volume.grid());
        }
        let [lo, hi] = volume.range().unwrap();
        assert!((lo - range[0]).abs() < 1e-3 && (hi - range[1]).abs() < 1e-3, "{name}: {lo} to {hi}");
    }
}

#[test]
fn other_pairs_of_image_and_labels_lie_on_one_grid() {
    let Some(data) = data() else { return };
    for number in ["001", "003", "004", "006", "007", "008", "011", "014", "015", "017"] {
        let image = load(&data.join(format!("hippocampus_msd/images/hippocampus_{number}.nii.gz")));
        let labels = load(&data.join(format!("hippocampus_msd/labels/hippocampus_{number}.nii.gz")));
        assert!(image.grid().matches(labels.grid()), "{number}");
        assert_eq!(labels.range(), Some([0.0, 2.0]), "{number}");
    }
    for tissue in ["t1", "gm", "wm"] {
        let name = format!("mni152/mni_icbm152_{tissue}_tal_nlin_sym_09a_converted.nii.gz");
        assert_eq!(load(&data.join(name)).grid().origin(), [-98.0, -134.0, -72.0]);
    }
    let folder = data.join("ct_abdomen_ts");
    let (image, labels) =
        (load(&folder.join("example_ct_sm.nii.gz")), load(&folder.join("example_seg.nii.gz")));
    assert!(image.grid().matches(labels.grid()));
}

/// MR is NIfTI in RAS, the masks are NRRD in LPS with other voxel axes: only world positions bring them together.
#[test]
fn masks_of_another_format_cover_the_brain_in_world_space() {
    let Some(data) = data() else { return };
    let image = load(&data.join("mri_head_seg3d/MR.nii.gz"));
    for (name, expected) in [("Brain", 199.0), ("Skull", 120.0)] {
        let mask = load(&data.join(format!("mri_head_seg3d/{name}.nrrd")));
        let Voxels::U8(inside) = mask.voxels() else { panic!("masks are u8") };
        let (mut sum, mut count) = (0.0, 0.0);
        for (i, _) in inside.iter().enumerate().filter(|(_, v)| **v != 0) {
            let World(at) = mask.grid().world(VoxelCoord::from(mask.grid().index(i)));
            let voxel = image.grid().voxel(World(at)).0.map(|v| v.round() as usize);
            sum += image.value(ivd_core::VoxelIndex([voxel.x, voxel.y, voxel.z]));
            count += 1.0;
        }
        let mean: f64 = sum / count;
        assert!((mean - expected).abs() < 1.0, "{name}: mean {mean}");
    }
}

#[test]
fn raw_slices_join_into_the_cadaver_head() {
    let Some(data) = data() else { return };
    let folder = tempfile::tempdir().unwrap();
    let joined = folder.path().join("head.raw");
    let mut bytes = Vec::new();
    for slice in 1..=113 {
        bytes.extend(std::fs::read(data.join(format!("ct_head_unc/CThead.{slice}"))).unwrap());
    }
    std::fs::write(&joined, bytes).unwrap();
    let layout = RawLayout {
        dims: [256, 256, 113],
        voxel_type: VoxelType::U16,
        spacing: [1.0, 1.0, 2.0],
        order: ByteOrder::Big,
        skip: 0,
    };
    let options = ReadOptions { raw: Some(layout), ..ReadOptions::default() };
    let volume = read(&joined, &options, &Exec::default()).unwrap();
    assert_eq!(volume.range(), Some([0.0, 3272.0]));
}

#[test]
fn sources_are_all_files_that_the_volume_is_made_of() {
    let Some(data) = data() else { return };
    let names = |path: &str| -> Vec<String> {
        sources(&data.join(path), &ReadOptions::default())
            .unwrap()
            .iter()
            .map(|p| p.file_name().unwrap().to_string_lossy().into_owned())
            .collect()
    };
    assert_eq!(names("nucleon/nucleon.nrrd"), ["nucleon.nrrd", "nucleon.raw"]);
    assert_eq!(names("frog_labels/frogtissue.mhd"), ["frogtissue.mhd", "frogtissue.zraw"]);
    assert_eq!(names("bonsai/bonsai.nii.gz"), ["bonsai.nii.gz"]);
    assert_eq!(names("mri_brain_dicom").len(), 22);
}

#[test]
fn raw_voxels_of_real_scans_are_suspected_in_the_wrong_order_alone() {
    let Some(data) = data() else { return };
    let mut files: Vec<PathBuf> =
        ["tooth/tooth.nhdr", "mri_brain_dicom", "ct_abdomen_ts/dicom_j2k", "engine/engine.nii.gz"]
            .iter()
            .chain(&["ct_abdomen_ts/example_ct.nii.gz", "ct_abdomen_ts/example_ct_sm.nii.gz"])
            .map(|name| data.join(name))
            .collect();
    for kind in ["images", "labels"] {
        let folder = std::fs::read_dir(data.join("hippocampus_msd").join(kind)).unwrap();
        files.extend(folder.map(|file| file.unwrap().path()));
    }
    let folder = tempfile::tempdir().unwrap();
    let noted = |path: &Path, layout: RawLayout| {
        let notes = Arc::new(Notes::default());
        let exec = Exec::default().with_observer(notes.clone());
        read(path, &ReadOptions { raw: Some(layout), ..ReadOptions::default() }, &exec).unwrap();
        notes.0.lock().unwrap().iter().any(|note| note.contains("--raw-order"))
    };
    let mut compared = 0;
    for file in files {
        let volume = load(&file);
        let (dims, voxel_type) = (volume.grid().dims(), volume.voxel_type());
        let path = folder.path().join("a.raw");
        for own in [ByteOrder::Little, ByteOrder::Big] {
            let mut bytes = volume.voxels().as_bytes().to_vec();
            if own != ByteOrder::NATIVE {
                bytes.chunks_exact_mut(voxel_type.bytes()).for_each(<[u8]>::reverse);
            }
            std::fs::write(&path, bytes).unwrap();
            for order in [ByteOrder::Little, ByteOrder::Big] {
                let layout = RawLayout { dims, voxel_type, spacing: [1.0; 3], order, skip: 0 };
                let wrong = order != own && voxel_type.bytes() > 1;
                assert_eq!(noted(&path, layout), wrong, "{}: {own:?} as {order:?}", file.display());
                compared += 1;
            }
        }
    }
    assert!(compared >= 100, "{compared}");
    // Slices of a folder.
    let slices = |order| RawLayout {
        dims: [256, 256, 0],
        voxel_type: VoxelType::U16,
        spacing: [1.0; 3],
        order,
        skip: 0,
    };
    let head = data.join("ct_head_unc");
    assert!(noted(&head, slices(ByteOrder::Little)) && !noted(&head, slices(ByteOrder::Big)));
}
