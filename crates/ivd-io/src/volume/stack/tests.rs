use std::sync::Arc;

use ivd_core::{Classified, ErrorClass, VoxelIndex, VoxelType, Voxels};

use super::*;
use crate::notes::Notes;
use crate::volume::ByteOrder;

fn png(path: &Path, color: ::png::ColorType, depth: ::png::BitDepth, size: [u32; 2], bytes: &[u8]) {
    let mut encoder = ::png::Encoder::new(std::fs::File::create(path).unwrap(), size[0], size[1]);
    encoder.set_color(color);
    encoder.set_depth(depth);
    encoder.write_header().unwrap().write_image_data(bytes).unwrap();
}

fn grey16(path: &Path, values: &[u16; 6]) {
    let bytes: Vec<u8> = values.iter().flat_map(|v| v.to_be_bytes()).collect();
    png(path, ::png::ColorType::Grayscale, ::png::BitDepth::Sixteen, [3, 2], &bytes);
}

fn tiff_pages(path: &Path, pages: &[[f32; 6]]) {
    let mut encoder = ::tiff::encoder::TiffEncoder::new(std::fs::File::create(path).unwrap()).unwrap();
    for page in pages {
        encoder.write_image::<::tiff::encoder::colortype::Gray32Float>(3, 2, page).unwrap();
    }
}

#[test]
fn png_slices_are_ordered_by_number_and_foreign_files_are_noted() {
    let dir = tempfile::tempdir().unwrap();
    grey16(&dir.path().join("s10.png"), &[10; 6]);
    grey16(&dir.path().join("s2.png"), &[1, 2, 3, 4, 5, 60000]);
    std::fs::write(dir.path().join("README"), "words").unwrap();
    let notes = Arc::new(Notes::default());
    let exec = Exec::default().with_observer(notes.clone());
    let volume = read_folder(dir.path(), None, Some([0.5, 0.5, 3.0]), &exec).unwrap();
    assert_eq!(volume.grid().dims(), [3, 2, 2]);
    assert_eq!(volume.grid().spacing(), [0.5, 0.5, 3.0]);
    assert_eq!(volume.value(VoxelIndex([2, 1, 0])), 60000.0);
    assert_eq!(volume.value(VoxelIndex([0, 0, 1])), 10.0);
    assert!(notes.0.lock().unwrap().iter().any(|n| n.contains("README")));
    assert!(sources(dir.path(), None).unwrap()[0].ends_with("s2.png"));
}

#[test]
fn a_folder_without_pictures_tells_of_one_below_that_holds_some_but_not_its_name() {
    let dir = tempfile::tempdir().unwrap();
    let told = || read_folder(dir.path(), None, None, &Exec::default()).unwrap_err().to_string();
    for name in ["a2", "a10", ".hidden"] {
        std::fs::create_dir(dir.path().join(name)).unwrap();
    }
    grey16(&dir.path().join(".hidden/0.png"), &[0; 6]);
    assert!(told().contains("for raw slices give dims and type"), "{}", told());
    grey16(&dir.path().join("a10/0.png"), &[0; 6]);
    assert!(
        told().contains("among 0 files, but a folder below it holds some; give that folder"),
        "{}",
        told()
    );
    assert!(!told().contains("a10"), "{}", told());
}

#[test]
fn colour_and_unequal_slices_are_refused_by_name() {
    let dir = tempfile::tempdir().unwrap();
    png(&dir.path().join("a.png"), ::png::ColorType::Rgb, ::png::BitDepth::Eight, [1, 1], &[1, 2, 3]);
    let error = read_folder(dir.path(), None, None, &Exec::default()).unwrap_err();
    assert!(error.to_string().contains("Rgb"), "{error}");
    let dir = tempfile::tempdir().unwrap();
    png(&dir.path().join("a.png"), ::png::ColorType::Grayscale, ::png::BitDepth::Eight, [1, 1], &[1]);
    grey16(&dir.path().join("b.png"), &[1; 6]);
    let error = read_folder(dir.path(), None, None, &Exec::default()).unwrap_err();
    assert!(error.to_string().contains("b.png") && error.to_string().contains("size"), "{error}");
}

#[test]
fn tiff_pages_are_slices() {
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("stack.tif");
    tiff_pages(&path, &[[1.5, 2.0, 3.0, 4.0, 5.0, 6.0], [-7.0; 6], [8.0; 6]]);
    let volume = read_tiff(&path, Some([1.0, 2.0, 3.0]), &Exec::default()).unwrap();
    assert_eq!(volume.grid().dims(), [3, 2, 3]);
    let mut expected = vec![1.5_f32, 2.0, 3.0, 4.0, 5.0, 6.0];
    expected.extend([-7.0; 6]);
    expected.extend([8.0; 6]);
    assert_eq!(*volume.voxels(), Voxels::from(expected));
    // A folder with that one file is the same stack; several files are one slice each.
    assert_eq!(read_folder(dir.path(), None, Some([1.0, 2.0, 3.0]), &Exec::default()).unwrap(), volume);
    tiff_pages(&dir.path().join("stack2.tif"), &[[0.0; 6]]);
    let error = read_folder(dir.path(), None, None, &Exec::default()).unwrap_err();
    assert!(error.to_string().contains("several pages"), "{error}");
}

#[test]
fn tiff_types_keep_their_values() {
    use ::tiff::encoder::{TiffEncoder, colortype};
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("a.tif");
    let read = || read_tiff(&path, None, &Exec::default()).unwrap();
    let create = || TiffEncoder::new(std::fs::File::create(&path).unwrap()).unwrap();
    create().write_image::<colortype::Gray8>(2, 1, &[1, 255]).unwrap();
    assert_eq!(*read().voxels(), Voxels::from(vec![1_u8, 255]));
    create().write_image::<colortype::Gray16>(2, 1, &[1, 65535]).unwrap();
    assert_eq!(*read().voxels(), Voxels::from(vec![1_u16, 65535]));
    create().write_image::<colortype::GrayI16>(2, 1, &[-1, i16::MIN]).unwrap();
    assert_eq!(*read().voxels(), Voxels::from(vec![-1_i16, i16::MIN]));
    create().write_image::<colortype::Gray32>(2, 1, &[1, u32::MAX]).unwrap();
    assert_eq!(*read().voxels(), Voxels::from(vec![1_u32, u32::MAX]));
    create().write_image::<colortype::RGB8>(1, 1, &[1, 2, 3]).unwrap();
    assert!(read_tiff(&path, None, &Exec::default()).unwrap_err().to_string().contains("RGB"));
}

#[test]
fn cut_pictures_are_errors() {
    let dir = tempfile::tempdir().unwrap();
    let (tif, one) = (dir.path().join("a.tif"), tempfile::tempdir().unwrap());
    tiff_pages(&tif, &[[1.0; 6], [2.0; 6]]);
    let bytes = std::fs::read(&tif).unwrap();
    grey16(&one.path().join("a.png"), &[1, 2, 3, 4, 5, 6]);
    let picture = std::fs::read(one.path().join("a.png")).unwrap();
    for i in 0..20 {
        std::fs::write(&tif, &bytes[..bytes.len() * i / 20]).unwrap();
        assert!(read_tiff(&tif, None, &Exec::default()).is_err(), "TIFF cut at {i}/20");
        // The last 12 bytes are the closing chunk, without pixels.
        std::fs::write(one.path().join("a.png"), &picture[..(picture.len() - 12) * i / 20]).unwrap();
        assert!(read_folder(one.path(), None, None, &Exec::default()).is_err(), "PNG cut at {i}/20");
    }
}

#[test]
fn a_flipped_byte_never_panics() {
    let dir = tempfile::tempdir().unwrap();
    let (tif, picture) = (dir.path().join("a.tif"), tempfile::tempdir().unwrap());
    tiff_pages(&tif, &[[1.0; 6], [2.0; 6]]);
    grey16(&picture.path().join("a.png"), &[1, 2, 3, 4, 5, 6]);
    let exec = Exec::default().with_memory_limit(Some(1 << 20));
    for (path, folder) in [(tif, false), (picture.path().join("a.png"), true)] {
        let bytes = std::fs::read(&path).unwrap();
        for at in 0..bytes.len() {
            for value in [[0, 0x7f], [0xff, bytes[at] ^ 1]][at % 2] {
                let mut bad = bytes.clone();
                bad[at] = value;
                std::fs::write(&path, &bad).unwrap();
                let _ = if folder {
                    read_folder(picture.path(), None, None, &exec)
                } else {
                    read_tiff(&path, None, &exec)
                };
            }
        }
    }
}

/// The bytes of a TIFF whose directory has one more entry.
fn with_entry(bytes: &[u8], entry: [u8; 12]) -> Vec<u8> {
    let number = |at: usize| u32::from_le_bytes(bytes[at..at + 4].try_into().unwrap()) as usize;
    let old = number(4);
    let count = u16::from_le_bytes(bytes[old..old + 2].try_into().unwrap());
    let mut all = bytes.to_vec();
    all[4..8].copy_from_slice(&(bytes.len() as u32).to_le_bytes());
    all.extend((count + 1).to_le_bytes());
    all.extend(&bytes[old + 2..old + 2 + 12 * usize::from(count)]);
    all.extend(entry);
    all.extend([0; 4]);
    all
}

#[test]
fn a_tag_of_more_values_than_the_file_has_bytes_is_refused_before_they_are_read() {
    let dir = tempfile::tempdir().unwrap();
    let tif = dir.path().join("a.tif");
    tiff_pages(&tif, &[[1.0; 6]]);
    let bytes = std::fs::read(&tif).unwrap();
    // 2^22 long words of an unused tag, as one damaged bit makes them: 128 MiB in the decoder.
    let [a, b] = 700_u16.to_le_bytes();
    std::fs::write(&tif, with_entry(&bytes, [a, b, 4, 0, 0, 0, 0x40, 0, 8, 0, 0, 0])).unwrap();
    let error = read_tiff(&tif, None, &Exec::default()).unwrap_err();
    assert!(error.to_string().contains("tag 700: 16777216 bytes"), "{error}");
    std::fs::write(&tif, with_entry(&bytes, [a, b, 4, 0, 1, 0, 0, 0, 8, 0, 0, 0])).unwrap();
    assert!(read_tiff(&tif, None, &Exec::default()).is_ok());
}

#[test]
fn pixels_that_do_not_unpack_are_the_files_fault_and_not_the_systems() {
    let dir = tempfile::tempdir().unwrap();
    let tif = dir.path().join("a.tif");
    tiff_pages(&tif, &[[1.0; 6]]);
    let mut bytes = std::fs::read(&tif).unwrap();
    // The entry of the compression: none becomes deflate.
    let at = bytes.windows(4).rposition(|w| w == [3, 1, 3, 0]).unwrap();
    bytes[at + 8] = 8;
    std::fs::write(&tif, &bytes).unwrap();
    assert_eq!(read_tiff(&tif, None, &Exec::default()).unwrap_err().error_class(), ErrorClass::Input);
}

#[test]
fn what_a_png_says_beside_its_pixels_is_not_unpacked() {
    let dir = tempfile::tempdir().unwrap();
    let file = dir.path().join("a.png");
    let mut encoder = ::png::Encoder::new(std::fs::File::create(&file).unwrap(), 2, 1);
    encoder.set_depth(::png::BitDepth::Eight);
    encoder.set_color(::png::ColorType::Grayscale);
    encoder.add_ztxt_chunk("k".into(), "a".repeat(1 << 20)).unwrap();
    encoder.write_header().unwrap().write_image_data(&[1, 2]).unwrap();
    // As much memory as the pixels need, and none for the text.
    let exec = Exec::default().with_memory_limit(Some(1 << 12));
    assert_eq!(read_folder(dir.path(), None, None, &exec).unwrap().grid().dims(), [2, 1, 1]);
}

fn layout(dims: [usize; 3]) -> RawLayout {
    RawLayout { dims, voxel_type: VoxelType::U16, spacing: [1.0, 1.0, 2.0], order: ByteOrder::Big, skip: 0 }
}

#[test]
fn raw_slices_are_counted_and_swapped() {
    let dir = tempfile::tempdir().unwrap();
    for (name, value) in [("h.10", 3_u16), ("h.2", 2), ("h.1", 1)] {
        std::fs::write(dir.path().join(name), [value.to_be_bytes(); 6].concat()).unwrap();
    }
    std::fs::write(dir.path().join("README.md"), "foreign").unwrap();
    let volume = read_folder(dir.path(), Some(&layout([3, 2, 0])), None, &Exec::default()).unwrap();
    assert_eq!(volume.grid().dims(), [3, 2, 3]);
    assert_eq!(volume.grid().spacing(), [1.0, 1.0, 2.0]);
    let values: Vec<f64> = (0..3).map(|z| volume.value(VoxelIndex([1, 1, z]))).collect();
    assert_eq!(values, [1.0, 2.0, 3.0]);
    let error = read_folder(dir.path(), Some(&layout([3, 2, 4])), None, &Exec::default()).unwrap_err();
    assert!(error.to_string().contains("4 slices declared"), "{error}");
    let error = read_folder(dir.path(), Some(&layout([9, 2, 0])), None, &Exec::default()).unwrap_err();
    assert_eq!(error.error_class(), ErrorClass::Input);
    assert!(read_folder(dir.path(), Some(&layout([usize::MAX, 9, 1])), None, &Exec::default()).is_err());
}

#[test]
fn the_unc_head_reads_as_its_notes_say() {
    let dir = Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/../../../shared/data/ct_head_unc"));
    if !dir.is_dir() {
        eprintln!("skipped: no {}", dir.display());
        return;
    }
    let volume = read_folder(dir, Some(&layout([256, 256, 113])), None, &Exec::default()).unwrap();
    assert_eq!(volume.grid().dims(), [256, 256, 113]);
    assert_eq!(volume.range(), Some([0.0, 3272.0]));
    let first = std::fs::read(dir.join("CThead.1")).unwrap();
    let second = std::fs::read(dir.join("CThead.2")).unwrap();
    let word = |bytes: &[u8], i: usize| f64::from(u16::from_be_bytes([bytes[2 * i], bytes[2 * i + 1]]));
    for i in [0, 30_000, 40_077, 65_535] {
        assert_eq!(volume.voxels().get(i), word(&first, i));
        assert_eq!(volume.voxels().get(65_536 + i), word(&second, i));
    }
}

#[test]
fn a_tiff_of_imagej_is_measured_in_its_unit() {
    use ::tiff::encoder::{Rational, TiffEncoder, colortype};
    use ::tiff::tags::{ResolutionUnit, Tag};
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("a.tif");
    let said = [
        ("unit=mm\nspacing=2.5\n", ResolutionUnit::None, [0.5, 0.25, 2.5]),
        ("unit=micron\nspacing=4\n", ResolutionUnit::None, [5e-4, 2.5e-4, 4e-3]),
        ("unit=furlong\nspacing=4\n", ResolutionUnit::None, [1.0; 3]),
        ("spacing=3\n", ResolutionUnit::Centimeter, [5.0, 2.5, 30.0]),
        ("unit=mm\nspacing=-3\n", ResolutionUnit::None, [0.5, 0.25, 1.0]),
        ("unit=mm\nspacing=much\n", ResolutionUnit::None, [0.5, 0.25, 1.0]),
    ];
    for (description, unit, spacing) in said {
        let mut encoder = TiffEncoder::new(std::fs::File::create(&path).unwrap()).unwrap();
        let mut image = encoder.new_image::<colortype::Gray8>(2, 1).unwrap();
        image.resolution_unit(unit);
        image.x_resolution(Rational { n: 2, d: 1 });
        image.y_resolution(Rational { n: 4, d: 1 });
        let text = format!("ImageJ=1.54f\nimages=1\n{description}");
        image.encoder().write_tag(Tag::ImageDescription, text.as_str()).unwrap();
        image.write_data(&[1, 2]).unwrap();
        let notes = Arc::new(Notes::default());
        let exec = Exec::default().with_observer(notes.clone());
        assert_eq!(read_tiff(&path, None, &exec).unwrap().grid().spacing(), spacing, "{description}");
        assert_eq!(
            notes.0.lock().unwrap().is_empty(),
            spacing[2] != 1.0,
            "a distance that is guessed is said"
        );
    }
}
