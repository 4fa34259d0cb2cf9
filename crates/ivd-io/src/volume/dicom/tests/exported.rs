//! Folders as archives and scanners export them: nested, with several series, uneven, with objects that are no slices.

use super::*;
use crate::volume;

const SEGMENTATION: &str = "1.2.840.10008.5.1.4.1.1.66.4";
const ENHANCED_MR: &str = "1.2.840.10008.5.1.4.1.1.4.1";
const RT_STRUCTURES: &str = "1.2.840.10008.5.1.4.1.1.481.3";

/// A folder below `dir`, there.
fn inside(dir: &TempDir, path: &str) -> PathBuf {
    let folder = dir.path().join(path);
    std::fs::create_dir_all(&folder).unwrap();
    folder
}

fn save(made: &Made, folder: &Path, name: &str) {
    made.save_as(&folder.join(name), uids::EXPLICIT_VR_LITTLE_ENDIAN);
}

/// What reading a folder gives, and what was noted on the way.
fn noted(dir: &Path, options: &ReadOptions) -> (Result<Volume, Error>, Vec<String>) {
    let notes = Arc::new(Notes::default());
    let exec = Exec::default().with_observer(notes.clone());
    let read = volume::read(dir, options, &exec);
    let said = std::mem::take(&mut *notes.0.lock().unwrap());
    for note in &said {
        assert_no_patient(&note.replace(dir.to_str().unwrap(), ""));
    }
    (read, said)
}

/// A slice at this height, all of one value.
fn slice(z: f64, value: i16) -> Made {
    let mut made = Made::new("1.2", [0.0, 0.0, z]);
    made.pixels(&[value; 6]);
    made
}

#[test]
fn a_folder_without_images_is_read_with_the_folders_below_it() {
    let dir = folder();
    let patient = inside(&dir, "DICOM/Fictional^Person");
    for (i, z) in [4.0, 0.0, 2.0].into_iter().enumerate() {
        save(
            &slice(z, z as i16),
            &inside(&dir, &format!("DICOM/Fictional^Person/S{}", i % 2)),
            &format!("{i}"),
        );
    }
    // A file of DICOM without an image lies where archives have their list.
    save(Made::new("9", [0.0; 3]).without(tags::ROWS).without(tags::PIXEL_DATA), dir.path(), "DICOMDIR");
    std::fs::write(patient.join("readme.txt"), "words").unwrap();
    let (read, said) = noted(dir.path(), &ReadOptions::default());
    let read = read.unwrap();
    let along: Vec<f64> = (0..3).map(|z| read.value(VoxelIndex([1, 1, z]))).collect();
    assert_eq!((along, read.grid().spacing()[2]), (vec![0.0, 2.0, 4.0], 2.0));
    let told = "no image in the folder itself; the 3 in 2 folders below it are taken";
    assert!(said.iter().any(|note| note.contains(told)), "{said:?}");
    assert_eq!(volume::sources(dir.path(), &ReadOptions::default()).unwrap().len(), 3);
    // Its own images come before those below.
    save(&slice(7.0, 70), dir.path(), "own");
    let (read, said) = noted(dir.path(), &ReadOptions::default());
    assert_eq!(read.unwrap().value(VoxelIndex([0; 3])), 70.0);
    assert!(!said.iter().any(|note| note.contains("below")), "{said:?}");
}

#[test]
fn pictures_of_the_folder_come_before_dicom_below_it() {
    let dir = folder();
    save(&slice(0.0, 9), &inside(&dir, "below"), "a");
    let picture = |name: &str| {
        let mut encoder = png::Encoder::new(std::fs::File::create(dir.path().join(name)).unwrap(), 2, 1);
        encoder.set_color(png::ColorType::Grayscale);
        encoder.write_header().unwrap().write_image_data(&[1, 2]).unwrap();
    };
    picture("0.png");
    picture("1.png");
    assert_eq!(noted(dir.path(), &ReadOptions::default()).0.unwrap().grid().dims(), [2, 1, 2]);
}

#[test]
fn what_lies_too_deep_or_behind_a_link_is_not_searched() {
    let dir = folder();
    let deep = inside(&dir, "1/2/3/4/5/6/7/8");
    save(&slice(0.0, 9), &deep, "a");
    assert_eq!(noted(dir.path(), &ReadOptions::default()).0.unwrap().grid().dims(), [3, 2, 1]);
    let deeper = inside(&dir, "1/2/3/4/5/6/7/8/9");
    std::fs::rename(deep.join("a"), deeper.join("a")).unwrap();
    let told = noted(dir.path(), &ReadOptions::default()).0.unwrap_err().to_string();
    assert!(told.contains("no DICOM, PNG or TIFF file"), "{told}");
    #[cfg(unix)]
    {
        std::os::unix::fs::symlink(&deeper, dir.path().join("link")).unwrap();
        std::os::unix::fs::symlink(dir.path(), dir.path().join("1/round")).unwrap();
        assert!(noted(dir.path(), &ReadOptions::default()).0.is_err(), "links aren't followed");
    }
}

#[test]
fn series_are_listed_by_the_word_that_chooses_them() {
    let dir = folder();
    for z in [0.0, 2.5, 5.0] {
        save(Made::new("1.2.3", [0.0, 0.0, z]).pixels(&[7; 6]), dir.path(), &format!("a{z}"));
    }
    // Two series of one number, one of them uneven, and one that is no image.
    for (uid, heights) in [("1.5.40", [0.0, 1.0, 4.0]), ("1.5.41", [0.0, 1.0, 2.0])] {
        for z in heights {
            save(
                Made::new(uid, [0.0, 0.0, z]).text(tags::SERIES_NUMBER, "8"),
                dir.path(),
                &format!("{uid}-{z}"),
            );
        }
    }
    let mut parts = Made::new("1.9", [0.0; 3]);
    parts
        .text(tags::SOP_CLASS_UID, SEGMENTATION)
        .text(tags::NUMBER_OF_FRAMES, "12")
        .text(tags::MODALITY, "SEG");
    save(&parts, dir.path(), "seg");
    let listed = list(dir.path(), &Exec::default()).unwrap();
    let words: Vec<&str> = listed.iter().map(|s| s.series.as_str()).collect();
    assert_eq!(words, ["5", "1.5.40", "1.5.41", "3"]);
    let first = &listed[0];
    assert_eq!((first.number, first.modality.as_str(), first.slices, first.size), (Some(5), "MR", 3, [3, 2]));
    assert_eq!((first.description.as_str(), first.uneven_mm), ("T1 OF ***", None));
    assert_eq!(first.spacing, [Some(0.25), Some(0.5), Some(2.5)]);
    assert_eq!(listed[1].uneven_mm, Some(2.0));
    assert_eq!((listed[2].uneven_mm, listed[2].unreadable), (None, None));
    assert!(listed[3].unreadable.unwrap().contains("SEG"));
    for series in &listed {
        let options = ReadOptions { series: Some(series.series.clone()), ..ReadOptions::default() };
        let files = sources(dir.path(), options.series.as_deref()).unwrap();
        assert_eq!(files.len(), series.slices, "{}", series.series);
        let readable = series.uneven_mm.is_none() && series.unreadable.is_none();
        assert_eq!(noted(dir.path(), &options).0.is_ok(), readable, "{}", series.series);
    }
    assert_no_patient(&serde_json::to_string(&listed).unwrap());
}

/// Slices at these heights whose values are ten times their heights; and what reading them, resampled, gives.
fn resampled(heights: &[f64], lean: f64) -> (Volume, Vec<String>) {
    let dir = folder();
    for (i, &z) in heights.iter().enumerate() {
        let mut made = Made::new("1.2", [0.0, lean * z, z]);
        save(made.pixels(&[(10.0 * z) as i16; 6]), dir.path(), &format!("{i}"));
    }
    let refused = noted(dir.path(), &ReadOptions::default()).0.unwrap_err().to_string();
    assert!(
        refused.contains("--resample-slices") && refused.contains("input.resample_slices = true"),
        "{refused}"
    );
    let (read, said) = noted(dir.path(), &ReadOptions { resample_slices: true, ..ReadOptions::default() });
    (read.unwrap(), said)
}

#[test]
fn uneven_slices_are_resampled_on_request_and_a_straight_line_stays_one() {
    // A slice is missing; the spacing changes; both, and it doesn't divide the way.
    for (heights, layers, kept) in [
        (vec![0.0, 3.0, 6.0, 12.0], 5, 4),
        (vec![0.0, 1.0, 2.0, 5.0, 8.0], 9, 5),
        (vec![0.0, 4.0, 9.0], 3, 2),
    ] {
        let (read, said) = resampled(&heights, 0.0);
        let (top, grid) = (heights[heights.len() - 1], read.grid());
        assert_eq!((grid.dims()[2], read.voxel_type().name()), (layers, "i16"), "{heights:?}");
        let step = top / (layers - 1) as f64;
        assert!((grid.spacing()[2] - step).abs() < 1e-12, "{heights:?}: {:?}", grid.spacing());
        for z in 0..layers {
            let expected = (10.0 * step * z as f64).round_ties_even();
            assert_eq!(read.value(VoxelIndex([2, 1, z])), expected, "{heights:?}: layer {z}");
        }
        let told = format!("{kept} of those are slices as they were");
        assert!(matches!(&said[..], [one] if one.contains(&told)), "{said:?}");
    }
}

#[test]
fn a_resampled_stack_lies_where_its_slices_do_leaning_too() {
    for lean in [0.0, 0.3] {
        let heights = [0.0, 3.0, 6.0, 12.0, 15.0];
        let (read, _) = resampled(&heights, lean);
        assert_eq!(read.grid().dims()[2], 6);
        for z in heights {
            let layer = (z / 3.0).round();
            let world = read.grid().world(VoxelCoord(Vector3::new(0.0, 0.0, layer))).0;
            assert!((world - Vector3::new(0.0, -lean * z, z)).norm() < 1e-9, "{lean}: {world}");
            assert_eq!(read.value(VoxelIndex([0, 0, layer as usize])), 10.0 * z);
        }
    }
}

#[test]
fn a_single_narrow_gap_does_not_make_a_thousand_layers() {
    let (read, _) = resampled(&[0.0, 10.0, 10.01, 20.0, 30.0], 0.0);
    assert_eq!(read.grid().dims()[2], 17, "four times the gaps, and the first slice");
}

#[test]
fn even_slices_are_never_resampled() {
    let dir = folder();
    for z in 0..4 {
        save(&slice(f64::from(z) * 2.0, z as i16), dir.path(), &format!("{z}"));
    }
    let even = noted(dir.path(), &ReadOptions::default()).0.unwrap();
    let (asked, said) = noted(dir.path(), &ReadOptions { resample_slices: true, ..ReadOptions::default() });
    assert_eq!((asked.unwrap(), said.len()), (even, 0));
}

#[test]
fn objects_that_are_no_slices_are_named_with_what_to_do() {
    for (class, frames, image, said) in [
        (SEGMENTATION, "12", true, ["a segmentation (SEG)", "(12 frames)", "ivd import --labels"]),
        (ENHANCED_MR, "40", true, ["an Enhanced MR image", "(40 frames)", "dcm2niix"]),
        (ENHANCED_MR, "1", true, ["an Enhanced MR image", "a series in one file", "dcm2niix"]),
        (RT_STRUCTURES, "", false, ["an RT structure set", "contours", "ivd import --labels"]),
    ] {
        let dir = folder();
        let mut made = Made::new("1.2", [0.0; 3]);
        made.text(tags::SOP_CLASS_UID, class);
        if image {
            made.text(tags::NUMBER_OF_FRAMES, frames).without(tags::IMAGE_POSITION_PATIENT);
        } else {
            made.without(tags::ROWS).without(tags::PIXEL_DATA);
        }
        made.save(&dir, "a");
        let of_file = read_file(&dir.path().join("a"), &Exec::default()).unwrap_err().to_string();
        for told in [complaint(&dir), of_file] {
            assert_no_patient(&told);
            assert!(said.iter().all(|part| told.contains(part)), "{said:?}: {told}");
        }
    }
}
