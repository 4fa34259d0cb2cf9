use std::sync::Arc;

use ivd_core::{VoxelCoord, VoxelIndex, Voxels};
use nalgebra::Vector3;
use tempfile::TempDir;

use super::*;
use crate::notes::Notes;
use crate::volume::Offer;

mod exported;
mod made;
use made::{Made, tags, uids};

fn folder() -> TempDir {
    tempfile::tempdir().unwrap()
}

fn open(dir: &TempDir) -> Result<Volume, Error> {
    read_folder(dir.path(), &ReadOptions::default(), &Exec::default())
}

fn complaint(dir: &TempDir) -> String {
    let message = open(dir).unwrap_err().to_string();
    assert_no_patient(&message);
    message
}

fn assert_no_patient(message: &str) {
    let message = message.to_uppercase();
    assert!(
        !message.contains("FICTIONAL") && !message.contains("ID777") && !message.contains("PERSON"),
        "{message}"
    );
}

#[test]
fn slices_are_sorted_by_position_and_placed_in_ras() {
    let dir = folder();
    // Names, positions along −z … +z and file order all disagree.
    for (name, z, v) in [("a", 12.0, 2), ("b", 2.0, 0), ("c", 7.0, 1)] {
        Made::new("1.2", [10.0, 20.0, z]).pixels(&[v, 10 + v, -20, 30, 40, 50]).save(&dir, name);
    }
    std::fs::write(dir.path().join("README.md"), "words").unwrap();
    let notes = Arc::new(Notes::default());
    let volume =
        read_folder(dir.path(), &ReadOptions::default(), &Exec::default().with_observer(notes.clone()))
            .unwrap();
    let grid = volume.grid();
    assert_eq!(grid.dims(), [3, 2, 3]);
    assert_eq!(grid.spacing(), [0.25, 0.5, 5.0], "columns are 0.25 apart, rows 0.5; the thickness tag lies");
    assert_eq!(grid.origin(), [-10.0, -20.0, 2.0]);
    assert_eq!(grid.direction(), [[-1.0, 0.0, 0.0], [0.0, -1.0, 0.0], [0.0, 0.0, 1.0]]);
    let along: Vec<f64> = (0..3).map(|z| volume.value(VoxelIndex([0, 0, z]))).collect();
    assert_eq!(along, [0.0, 1.0, 2.0]);
    assert_eq!(volume.value(VoxelIndex([2, 0, 0])), -20.0);
    assert_eq!(volume.value(VoxelIndex([0, 1, 0])), 30.0);
    let notes = notes.0.lock().unwrap();
    assert!(notes.iter().any(|n| n.contains("README.md")), "{notes:?}");
    notes.iter().for_each(|n| assert_no_patient(n));
    let names: Vec<_> = sources(dir.path(), None).unwrap();
    assert_eq!(names.len(), 3);
    assert!(names[0].ends_with("a"));
}

#[test]
fn oblique_slices_step_along_their_normal() {
    let dir = folder();
    let (s, c) = 0.4_f64.sin_cos();
    let normal = Vector3::new(0.0, -s, c);
    for i in 0..4 {
        let p = Vector3::new(1.0, 2.0, 3.0) + normal * (2.5 * f64::from(i));
        Made::new("1.2", p.into())
            .text(tags::IMAGE_ORIENTATION_PATIENT, &format!("1\\0\\0\\0\\{c:.9}\\{s:.9}"))
            .save(&dir, &format!("{}", 9 - i));
    }
    let volume = open(&dir).unwrap();
    let world = volume.grid().world(VoxelCoord(Vector3::new(2.0, 1.0, 3.0))).0;
    let lps = Vector3::new(1.0, 2.0, 3.0) + normal * 7.5 + Vector3::new(0.5, 0.5 * c, 0.5 * s);
    assert!((world - Vector3::new(-lps.x, -lps.y, lps.z)).norm() < 1e-6, "{world}");
    assert!((volume.grid().spacing()[2] - 2.5).abs() < 1e-6);
}

#[test]
fn a_tilted_gantry_keeps_its_shear() {
    let dir = folder();
    for i in 0..3 {
        Made::new("1.2", [0.0, f64::from(i), 2.0 * f64::from(i)]).save(&dir, &format!("{i}"));
    }
    let volume = open(&dir).unwrap();
    let world = volume.grid().world(VoxelCoord(Vector3::new(0.0, 0.0, 2.0))).0;
    assert!((world - Vector3::new(0.0, -2.0, 4.0)).norm() < 1e-9);
}

#[test]
fn several_series_are_listed_without_the_patient_and_chosen() {
    let dir = folder();
    Made::new("1.2.3", [0.0; 3]).pixels(&[7; 6]).save(&dir, "a");
    Made::new("1.2.40", [0.0; 3]).pixels(&[8; 6]).save(&dir, "b");
    let message = complaint(&dir);
    for said in ["1.2.3 ", "1.2.40 ", "number 5", "number 6", "T1 OF ***", "1 slice of 3×2", "--series"] {
        assert!(message.contains(said), "{said}: {message}");
    }
    let value = |series: &str| {
        let options = ReadOptions { series: Some(series.to_owned()), ..ReadOptions::default() };
        read_folder(dir.path(), &options, &Exec::default()).map(|v| v.value(VoxelIndex([0; 3])))
    };
    assert_eq!(value("1.2.3").unwrap(), 7.0);
    assert_eq!(value("1.2.4").unwrap(), 8.0, "start of a UID");
    assert_eq!(value("6").unwrap(), 8.0, "number");
    let unclear = value("1.2").unwrap_err();
    let Some((Offer::Series { all, is_asked: false }, _)) = unclear.offer() else {
        panic!("both start so: {unclear}")
    };
    let told: Vec<_> = all.iter().map(|one| (one.series.as_str(), one.slices, one.is_readable)).collect();
    assert_eq!(told, [("5", 1, true), ("6", 1, true)], "a number of its own");
    assert!(all[1].told.contains("number 6") && all.iter().all(|one| value(&one.series).is_ok()), "{all:?}");
    assert!(!all[1].told.contains("UID"), "{all:?}");
    let unknown = value("9.9").unwrap_err();
    let (offer, why) = unknown.offer().unwrap();
    assert!(
        why.contains("no series is `9.9`") && *offer == Offer::Series { all: all.clone(), is_asked: true }
    );
    assert_eq!(sources(dir.path(), Some("6")).unwrap(), [dir.path().join("b")]);
}

#[test]
fn gaps_and_copies_are_errors_that_name_the_place() {
    let dir = folder();
    for (name, z) in [("a", 0.0), ("b", 3.0), ("c", 6.0), ("e", 12.0)] {
        Made::new("1.2", [0.0, 0.0, z]).save(&dir, name);
    }
    let message = complaint(&dir);
    assert!(message.contains("c and e are 6.0000 mm apart") && message.contains("missing"), "{message}");
    assert_eq!(open(&dir).unwrap_err().offer().map(|(offer, _)| offer), Some(&Offer::EvenSlices));
    Made::new("1.2", [0.0, 0.0, 9.0]).save(&dir, "d");
    assert_eq!(open(&dir).unwrap().grid().dims()[2], 5);
    Made::new("1.2", [0.0, 0.0, 9.0]).save(&dir, "f");
    assert!(complaint(&dir).contains("d and f lie at the same place"));
}

#[test]
fn scales_are_kept_or_made_real() {
    let dir = folder();
    let scale = |made: &mut Made, slope: &str| {
        made.text(tags::RESCALE_SLOPE, slope).text(tags::RESCALE_INTERCEPT, "-1024").pixels(&[100; 6]);
    };
    let mut first = Made::new("1.2", [0.0; 3]);
    scale(&mut first, "2");
    first.save(&dir, "a");
    let mut second = Made::new("1.2", [0.0, 0.0, 1.0]);
    scale(&mut second, "2");
    second.save(&dir, "b");
    let volume = open(&dir).unwrap();
    assert_eq!((volume.slope(), volume.intercept()), (2.0, -1024.0));
    assert_eq!(*volume.voxels(), Voxels::from(vec![100_i16; 12]));
    scale(&mut second, "3");
    second.save(&dir, "b");
    let volume = open(&dir).unwrap();
    assert_eq!((volume.slope(), volume.intercept()), (1.0, 0.0));
    assert_eq!(volume.value(VoxelIndex([0, 0, 0])), -824.0);
    assert_eq!(volume.value(VoxelIndex([0, 0, 1])), -724.0);
    scale(&mut second, "0");
    second.save(&dir, "b");
    assert!(complaint(&dir).contains("RescaleSlope"));
}

/// A series of two slices with these pixels as a file of this name says it, and what the file holds.
fn series_as(name: &str, scales: [[&str; 2]; 2], pixels: [i16; 6], signed: u16) -> (Volume, Volume, Vec<u8>) {
    let dir = folder();
    for (i, [slope, intercept]) in scales.into_iter().enumerate() {
        Made::new("1.2", [0.0, 0.0, i as f64])
            .text(tags::RESCALE_SLOPE, slope)
            .text(tags::RESCALE_INTERCEPT, intercept)
            .number(tags::PIXEL_REPRESENTATION, signed)
            .pixels(&pixels)
            .save(&dir, &format!("{i}"));
    }
    let volume = open(&dir).unwrap();
    let path = dir.path().join(name);
    crate::volume::write(&path, &volume, &Exec::default()).unwrap();
    let back = crate::volume::read(&path, &crate::volume::ReadOptions::default(), &Exec::default()).unwrap();
    (volume, back, std::fs::read(path).unwrap())
}

#[test]
fn a_ct_of_slope_1_stays_whole_numbers_in_the_volume_and_in_every_file() {
    let pixels = [0, 24, 1024, 2048, 4095, 7];
    for (signed, voxel_type) in [(1, "i16"), (0, "u16")] {
        for name in ["ct.nii", "ct.nrrd", "ct.mha"] {
            let (volume, back, bytes) = series_as(name, [["1", "-1024"]; 2], pixels, signed);
            assert_eq!(
                (volume.voxel_type().name(), volume.slope(), volume.intercept()),
                (voxel_type, 1.0, -1024.0)
            );
            let shifted: Vec<i16> = pixels.iter().chain(&pixels).map(|v| v - 1024).collect();
            assert_eq!(
                (back.voxels(), back.slope(), back.intercept()),
                (&Voxels::from(shifted), 1.0, 0.0),
                "{name}"
            );
            assert!(!name.ends_with("nii") || bytes[..4] == 348_i32.to_le_bytes(), "NIfTI-1");
        }
    }
}

#[test]
fn a_slope_that_f32_rounds_goes_into_nifti_1_within_a_millionth_of_the_range() {
    let pixels = [0, 1, 77, 1024, 4095, 32_767];
    let slope = 2.022_241_4;
    let (volume, back, bytes) = series_as("mr.nii", [["2.0222414", "0"]; 2], pixels, 1);
    assert_eq!((bytes[..4].to_vec(), volume.slope()), (348_i32.to_le_bytes().to_vec(), slope));
    assert_eq!(f32::from_le_bytes(bytes[112..116].try_into().unwrap()), slope as f32);
    assert_eq!(back.voxels(), volume.voxels(), "as stored");
    for (i, &v) in pixels.iter().enumerate() {
        let read = back.real(back.voxels().get(i));
        assert!((read - slope * f64::from(v)).abs() <= 1e-6 * slope * 32_767.0, "{v}: {read}");
    }
}

#[test]
fn slopes_that_differ_by_slice_are_each_in_what_is_written() {
    // As of a PET: the second slice's step is another.
    let pixels = [0, 1, 77, 1024, 4095, 32_767];
    for name in ["pet.nii", "pet.nii.gz", "pet.nrrd", "pet.mha"] {
        let (_, back, _) = series_as(name, [["2.0222414", "0"], ["0.3141593", "-5"]], pixels, 1);
        assert_eq!((back.voxel_type().name(), back.slope(), back.intercept()), ("f32", 1.0, 0.0));
        for (i, &v) in pixels.iter().chain(&pixels).enumerate() {
            let v = f64::from(v);
            let real = if i < 6 { 2.022_241_4 * v } else { 0.314_159_3 * v - 5.0 };
            assert_eq!(back.voxels().get(i), f64::from(real as f32), "{name}: voxel {i}");
        }
    }
}

#[test]
fn every_plain_syntax_gives_the_same_voxels() {
    let values = [-3, 2, 300, -32768, 32767, 0];
    for syntax in
        [uids::IMPLICIT_VR_LITTLE_ENDIAN, uids::EXPLICIT_VR_LITTLE_ENDIAN, uids::EXPLICIT_VR_BIG_ENDIAN]
    {
        let dir = folder();
        let path = dir.path().join("a");
        Made::new("1.2", [0.0; 3]).pixels(&values).save_as(&path, syntax);
        assert!(looks_like_dicom(&path));
        let volume = read_file(&path, &Exec::default()).unwrap();
        assert_eq!(*volume.voxels(), Voxels::from(values.to_vec()), "{syntax}");
        assert_eq!(volume.grid().spacing(), [0.25, 0.5, 99.0], "a single slice has only its thickness");
    }
}

#[test]
fn twelve_stored_bits_are_masked_and_signed() {
    for (signed, expected) in [(1, -1.0), (0, 4095.0)] {
        let dir = folder();
        Made::new("1.2", [0.0; 3])
            .number(tags::BITS_STORED, 12)
            .number(tags::HIGH_BIT, 11)
            .number(tags::PIXEL_REPRESENTATION, signed)
            .pixels(&[0x7fff; 6])
            .save(&dir, "a");
        assert_eq!(open(&dir).unwrap().value(VoxelIndex([1, 1, 0])), expected);
    }
}

#[test]
fn what_is_not_read_is_refused_by_name() {
    type Change = fn(&mut Made) -> &mut Made;
    let cases: [(Change, &str); 12] = [
        (|m| m.text(tags::PHOTOMETRIC_INTERPRETATION, "RGB").number(tags::SAMPLES_PER_PIXEL, 3), "RGB"),
        (|m| m.text(tags::NUMBER_OF_FRAMES, "12"), "12 frames"),
        (|m| m.number(tags::BITS_ALLOCATED, 12), "BitsAllocated 12"),
        (|m| m.number(tags::BITS_STORED, 17), "BitsStored"),
        (|m| m.number(tags::ROWS, 65535), "PixelData"),
        (|m| m.number(tags::COLUMNS, 0), "Columns"),
        (|m| m.text(tags::PIXEL_SPACING, "0\\1"), "PixelSpacing"),
        (|m| m.text(tags::PIXEL_SPACING, "1"), "PixelSpacing"),
        (|m| m.text(tags::IMAGE_POSITION_PATIENT, "nan\\0\\1"), "ImagePositionPatient"),
        (|m| m.text(tags::IMAGE_ORIENTATION_PATIENT, "1\\0\\0\\1\\0\\0"), "ImageOrientationPatient"),
        (|m| m.without(tags::BITS_ALLOCATED), "BitsAllocated"),
        (|m| m.without(tags::PIXEL_DATA), "PixelData"),
    ];
    for (change, said) in cases {
        let dir = folder();
        let mut made = Made::new("1.2", [0.0; 3]);
        change(&mut made);
        made.save(&dir, "a");
        let message = complaint(&dir);
        assert!(message.contains(said), "{said}: {message}");
    }
    let dir = folder();
    Made::new("1.2", [0.0; 3]).save(&dir, "a");
    let mut second = Made::new("1.2", [0.0, 0.0, 1.0]);
    second.text(tags::IMAGE_ORIENTATION_PATIENT, "1\\0\\0\\0\\0\\1").save(&dir, "b");
    assert!(complaint(&dir).contains("several orientations"));
    second.without(tags::IMAGE_POSITION_PATIENT).text(tags::IMAGE_ORIENTATION_PATIENT, "1\\0\\0\\0\\1\\0");
    second.save(&dir, "b");
    assert!(complaint(&dir).contains("ImagePositionPatient"));
}

#[test]
fn an_unread_transfer_syntax_is_named() {
    let dir = folder();
    let path = dir.path().join("a");
    Made::new("1.2", [0.0; 3]).save(&dir, "a");
    let bytes = std::fs::read(&path).unwrap();
    let at = bytes.windows(20).position(|w| w == b"1.2.840.10008.1.2.1\0").unwrap();
    for (uid, said) in
        [(b"1.2.840.10008.1.2.99", "1.2.840.10008.1.2.99"), (b"1.2.840.10008.9.9.9\0", "unknown")]
    {
        let mut other = bytes.clone();
        other[at..at + 20].copy_from_slice(uid);
        std::fs::write(&path, &other).unwrap();
        assert!(complaint(&dir).contains(said));
    }
    assert!(
        syntax::Syntax::of(&path, uids::JPEGLS_LOSSLESS)
            .unwrap_err()
            .to_string()
            .contains("JPEG-LS Lossless")
    );
}

#[test]
fn a_pixel_representation_that_is_none_is_refused() {
    let dir = folder();
    let mut made = Made::new("1.2", [0.0; 3]);
    made.number(tags::PIXEL_REPRESENTATION, 7).save(&dir, "a");
    assert!(complaint(&dir).contains("PixelRepresentation"));
}

#[test]
fn a_file_cut_anywhere_is_an_error() {
    let dir = folder();
    let path = dir.path().join("a");
    for syntax in
        [uids::IMPLICIT_VR_LITTLE_ENDIAN, uids::EXPLICIT_VR_LITTLE_ENDIAN, uids::EXPLICIT_VR_BIG_ENDIAN]
    {
        Made::new("1.2", [0.0; 3]).save_as(&path, syntax);
        let bytes = std::fs::read(&path).unwrap();
        for i in 0..20 {
            std::fs::write(&path, &bytes[..bytes.len() * i / 20]).unwrap();
            let message = complaint(&dir);
            assert!(message.contains(dir.path().to_str().unwrap()), "{message}");
        }
    }
}

#[test]
fn hostile_bytes_never_panic_nor_name_the_patient() {
    let dir = folder();
    let path = dir.path().join("a");
    let notes = Arc::new(Notes::default());
    let exec = Exec::default().with_memory_limit(Some(1 << 24)).with_observer(notes.clone());
    for syntax in [uids::IMPLICIT_VR_LITTLE_ENDIAN, uids::EXPLICIT_VR_BIG_ENDIAN] {
        Made::new("1.2", [0.0; 3]).save_as(&path, syntax);
        let bytes = std::fs::read(&path).unwrap();
        for at in (128..bytes.len()).step_by(3) {
            let mut bad = bytes.clone();
            bad[at] = [0xff, 0, bytes[at] ^ 0x10][at % 4 % 3];
            std::fs::write(&path, &bad).unwrap();
            if let Err(error) = read_file(&path, &exec) {
                assert_no_patient(&error.to_string());
            }
        }
    }
    notes.0.lock().unwrap().iter().for_each(|n| assert_no_patient(n));
}

fn data(name: &str) -> Option<PathBuf> {
    let dir = Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/../../../shared/data")).join(name);
    if dir.is_dir() {
        return Some(dir);
    }
    eprintln!("skipped: no {}", dir.display());
    None
}

#[test]
fn the_oblique_brain_series_lies_where_its_tags_say() {
    let Some(dir) = data("mri_brain_dicom") else { return };
    let volume = read_folder(&dir, &ReadOptions::default(), &Exec::default()).unwrap();
    let grid = volume.grid();
    assert_eq!(grid.dims(), [512, 512, 22]);
    let expected = [0.4297, 0.4297, 6.5];
    assert!(grid.spacing().iter().zip(expected).all(|(s, e)| (s - e).abs() < 1e-3), "{:?}", grid.spacing());
    assert_eq!(volume.range(), Some([0.0, 9774.0]));
    let tilt = grid.direction()[2][2].acos().to_degrees();
    assert!((tilt - 15.5).abs() < 0.1, "{tilt}");
}

#[test]
fn the_compressed_abdomen_decodes() {
    let Some(dir) = data("ct_abdomen_ts/dicom_j2k") else { return };
    let volume = read_folder(&dir, &ReadOptions::default(), &Exec::default()).unwrap();
    assert_eq!(volume.grid().dims(), [512, 512, 20]);
    assert_eq!(volume.grid().spacing(), [0.976_562_5, 0.976_562_5, 2.0]);
    assert_eq!(volume.range(), Some([-1024.0, 1839.0]));
    assert_eq!((volume.slope(), volume.intercept()), (1.0, -1024.0));
}

#[test]
fn a_compressed_slice_with_damage_never_panics() {
    let Some(dir) = data("ct_abdomen_ts/dicom_j2k") else { return };
    let mut files: Vec<PathBuf> = std::fs::read_dir(dir).unwrap().map(|e| e.unwrap().path()).collect();
    files.sort();
    let bytes = std::fs::read(&files[0]).unwrap();
    let copy = folder();
    let path = copy.path().join("a");
    let exec = Exec::default().with_memory_limit(Some(1 << 24));
    for i in 0..20 {
        std::fs::write(&path, &bytes[..bytes.len() * i / 20]).unwrap();
        assert!(read_file(&path, &exec).is_err(), "cut at {i}/20");
    }
    for i in 1..8 {
        let mut bad = bytes.clone();
        let at = bytes.len() - 1 - i * bytes.len() / 50;
        bad[at] ^= 0xff;
        std::fs::write(&path, &bad).unwrap();
        let _ = read_file(&path, &exec);
    }
}

#[test]
fn what_a_series_was_made_with_is_kept() {
    use ivd_core::Modality::{ComputedTomography, MagneticResonance};
    for (text, wanted) in [("MR", Some(MagneticResonance)), ("CT", Some(ComputedTomography)), ("US", None)] {
        let dir = folder();
        for (name, z) in [("a", 0.0), ("b", 1.0)] {
            Made::new("1.2", [0.0, 0.0, z])
                .text(tags::MODALITY, text)
                .pixels(&[1, 2, 3, 4, 5, 6])
                .save(&dir, name);
        }
        assert_eq!(open(&dir).unwrap().modality(), wanted, "{text}");
    }
}
