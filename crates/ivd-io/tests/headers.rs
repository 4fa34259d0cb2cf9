//! Headers built by hand, byte by byte: what each field means for the voxels and their places.
#![allow(clippy::unwrap_used, reason = "what builds a test's files may fail it")]

use std::io::Write;
use std::path::{Path, PathBuf};

use ivd_core::{Classified, ErrorClass, Exec, Volume, VoxelCoord, VoxelType};
use ivd_io::volume::{Error, ReadOptions, read};
use nalgebra::Vector3;

struct Folder(tempfile::TempDir);

impl Folder {
    fn new() -> Self {
        Self(tempfile::tempdir().unwrap())
    }
    fn put(&self, name: &str, bytes: &[u8]) -> PathBuf {
        let path = self.0.path().join(name);
        std::fs::write(&path, bytes).unwrap();
        path
    }
}

fn load(path: &Path) -> Result<Volume, Error> {
    read(path, &ReadOptions::default(), &Exec::default())
}

fn load_text(name: &str, header: &str, data: &[u8]) -> Result<Volume, Error> {
    load(&Folder::new().put(name, &[header.as_bytes(), data].concat()))
}

/// World position of a voxel [mm], RAS.
fn at(volume: &Volume, voxel: [f64; 3]) -> [f64; 3] {
    volume.grid().world(VoxelCoord(Vector3::from(voxel))).0.into()
}

fn near(a: [f64; 3], b: [f64; 3]) {
    assert!((Vector3::from(a) - Vector3::from(b)).norm() < 1e-6, "{a:?} is not {b:?}");
}

/// A NIfTI-1 header of 2 × 3 × 4 `i16` in either order, without any form.
fn nifti_1(big: bool) -> Fields {
    let mut f = Fields { bytes: vec![0; 352], big };
    f.i32(0, 348);
    for (i, n) in [3, 2, 3, 4, 1, 1, 1, 1].into_iter().enumerate() {
        f.i16(40 + 2 * i, n);
    }
    f.i16(70, 4);
    f.i16(72, 16);
    for (i, v) in [1.0, 0.5, 1.5, 2.5].into_iter().enumerate() {
        f.f32(76 + 4 * i, v);
    }
    f.f32(108, 352.0);
    f.bytes[344..348].copy_from_slice(b"n+1\0");
    f
}

#[derive(Clone)]
struct Fields {
    bytes: Vec<u8>,
    big: bool,
}

impl Fields {
    fn set<const N: usize>(&mut self, at: usize, mut little: [u8; N]) {
        if self.big {
            little.reverse();
        }
        self.bytes[at..at + N].copy_from_slice(&little);
    }
    fn i16(&mut self, at: usize, v: i16) {
        self.set(at, v.to_le_bytes());
    }
    fn i32(&mut self, at: usize, v: i32) {
        self.set(at, v.to_le_bytes());
    }
    fn i64(&mut self, at: usize, v: i64) {
        self.set(at, v.to_le_bytes());
    }
    fn f32(&mut self, at: usize, v: f32) {
        self.set(at, v.to_le_bytes());
    }
    fn f64(&mut self, at: usize, v: f64) {
        self.set(at, v.to_le_bytes());
    }
    /// The header with the voxels 0, 1, 2, … as `i16` behind it.
    fn file(&self, voxels: i16) -> Vec<u8> {
        let order = |v: i16| if self.big { v.to_be_bytes() } else { v.to_le_bytes() };
        [self.bytes.clone(), (0..voxels).flat_map(order).collect()].concat()
    }
    fn load(&self) -> Result<Volume, Error> {
        load(&Folder::new().put("a.nii", &self.file(24)))
    }
}

#[test]
fn nifti_1_reads_in_both_orders() {
    for big in [false, true] {
        let volume = nifti_1(big).load().unwrap();
        assert_eq!(volume.grid().dims(), [2, 3, 4]);
        assert_eq!(volume.voxels().get(23), 23.0);
        assert_eq!(volume.grid().spacing(), [0.5, 1.5, 2.5], "no form: pixdim along LPS");
        near(at(&volume, [1.0, 1.0, 1.0]), [-0.5, -1.5, 2.5]);
    }
}

#[test]
fn nifti_2_reads_in_both_orders() {
    for big in [false, true] {
        let mut f = Fields { bytes: vec![0; 544], big };
        f.i32(0, 540);
        f.bytes[4..12].copy_from_slice(b"n+2\0\r\n\x1a\n");
        f.i16(12, 4);
        f.i16(14, 16);
        for (i, n) in [3, 2, 3, 4, 1, 1, 1, 1].into_iter().enumerate() {
            f.i64(16 + 8 * i, n);
        }
        f.i64(168, 544);
        f.f64(176, 3.0);
        f.f64(184, -1.0);
        f.i32(348, 1);
        for (i, v) in [0.1, 0.0, 0.0, 1e6, 0.0, 2.0, 0.0, -7.0, 0.0, 0.0, 3.0, 8.0].into_iter().enumerate() {
            f.f64(400 + 8 * i, v);
        }
        let volume = f.load().unwrap();
        assert_eq!((volume.slope(), volume.intercept()), (3.0, -1.0));
        assert_eq!(at(&volume, [1.0, 1.0, 1.0]), [1e6 + 0.1, -5.0, 11.0]);
        assert_eq!(volume.voxels().get(23), 23.0);
    }
}

#[test]
fn the_sform_goes_before_the_qform() {
    let mut f = nifti_1(false);
    f.i16(252, 1);
    // A half turn about z: x and y reversed.
    f.f32(264, 1.0);
    f.f32(268, 10.0);
    near(at(&f.load().unwrap(), [1.0, 1.0, 1.0]), [9.5, -1.5, 2.5]);
    f.f32(76, -1.0);
    near(at(&f.load().unwrap(), [1.0, 1.0, 1.0]), [9.5, -1.5, -2.5]);
    f.i16(254, 2);
    for (i, v) in [0.0, 2.0, 0.0, 1.0, 3.0, 0.0, 0.0, 2.0, 0.0, 0.0, 4.0, 3.0].into_iter().enumerate() {
        f.f32(280 + 4 * i, v);
    }
    near(at(&f.load().unwrap(), [1.0, 1.0, 1.0]), [3.0, 5.0, 7.0]);
    f.bytes[123] = 3;
    near(at(&f.load().unwrap(), [1.0, 1.0, 1.0]), [0.003, 0.005, 0.007]);
    f.bytes[123] = 1;
    near(at(&f.load().unwrap(), [1.0, 1.0, 1.0]), [3000.0, 5000.0, 7000.0]);
}

#[test]
fn a_slope_of_nothing_scales_nothing() {
    for slope in [0.0, f32::NAN, f32::INFINITY] {
        let mut f = nifti_1(true);
        f.f32(112, slope);
        f.f32(116, 5.0);
        let volume = f.load().unwrap();
        assert_eq!((volume.slope(), volume.intercept()), (1.0, 0.0));
    }
    let mut f = nifti_1(true);
    f.f32(112, 2.0);
    f.f32(116, f32::NAN);
    assert!(f.load().unwrap_err().to_string().contains("scl_inter"));
}

#[test]
fn a_frame_is_chosen_and_several_without_a_choice_are_refused() {
    let mut f = nifti_1(false);
    f.i16(40, 4);
    f.i16(48, 3);
    let folder = Folder::new();
    let mut gzip = flate2::write::GzEncoder::new(Vec::new(), flate2::Compression::fast());
    gzip.write_all(&f.file(72)).unwrap();
    for path in [folder.put("a.nii", &f.file(72)), folder.put("a.nii.gz", &gzip.finish().unwrap())] {
        let error = load(&path).unwrap_err();
        assert!(error.to_string().contains("--frame"), "{error}");
        let chosen = |frame| {
            read(&path, &ReadOptions { frame: Some(frame), ..ReadOptions::default() }, &Exec::default())
        };
        assert_eq!(chosen(2).unwrap().voxels().get(0), 48.0);
        assert!(chosen(3).is_err());
    }
    f.i16(48, 1);
    assert_eq!(f.load().unwrap().grid().dims(), [2, 3, 4], "one frame needs no choice");
}

#[test]
fn a_header_and_image_pair_reads_by_either_name() {
    let folder = Folder::new();
    let mut f = nifti_1(true);
    f.bytes[344..348].copy_from_slice(b"ni1\0");
    f.f32(108, 0.0);
    let header = folder.put("a.hdr", &f.bytes[..348]);
    let image = folder.put("a.img", &f.file(24)[352..]);
    for path in [&header, &image] {
        assert_eq!(load(path).unwrap().voxels().get(23), 23.0);
    }
    let both = ivd_io::volume::sources(&image, &ReadOptions::default()).unwrap();
    assert_eq!(both, [header, image]);
}

#[test]
fn each_hostile_field_of_nifti_is_named() {
    type Change = fn(&mut Fields);
    let table: [(&str, Change); 17] = [
        ("sizeof_hdr", |f| f.i32(0, 349)),
        ("dim[0]", |f| f.i16(40, 0)),
        ("dim[0]", |f| f.i16(40, 8)),
        ("dim[1]", |f| f.i16(42, -5)),
        ("dim[3]", |f| f.i16(46, 0)),
        ("bytes needed", |f| (0..3).for_each(|i| f.i16(42 + 2 * i, i16::MAX))),
        ("dim[5]", |f| {
            f.i16(40, 5);
            f.i16(50, 3);
        }),
        ("bytes needed", |f| {
            f.i16(40, 4);
            f.i16(48, i16::MAX);
        }),
        ("datatype", |f| f.i16(70, 77)),
        ("colours", |f| f.i16(70, 128)),
        ("bitpix", |f| f.i16(72, 15)),
        ("vox_offset", |f| f.f32(108, f32::NAN)),
        ("vox_offset", |f| f.f32(108, -1.0)),
        ("bytes needed", |f| f.f32(108, 1e15)),
        ("pixdim", |f| f.f32(80, f32::NAN)),
        ("srow", |f| f.i16(254, 1)),
        ("quatern", |f| {
            f.i16(252, 1);
            f.f32(256, 9.0);
        }),
    ];
    for (field, change) in table {
        let mut f = nifti_1(false);
        change(&mut f);
        let error = f.load().expect_err(field);
        assert!(error.to_string().contains(field), "{field}: {error}");
        assert!(error.to_string().contains("a.nii"), "{error}");
        assert!(matches!(error.error_class(), ErrorClass::Input | ErrorClass::Limit), "{error}");
    }
}

const NRRD: &str =
    "NRRD0004\n# a comment\ntype: unsigned short\ndimension: 3\nsizes: 2 2 1\nendian: big\nencoding: raw\n";

#[test]
fn nrrd_spaces_flip_the_axes_that_differ_from_ras() {
    let data = [0, 1, 0, 2, 0, 3, 1, 0];
    for (space, sign) in [
        ("right-anterior-superior", [1.0, 1.0, 1.0]),
        ("RAS", [1.0, 1.0, 1.0]),
        ("left-anterior-superior", [-1.0, 1.0, 1.0]),
        ("left-posterior-superior", [-1.0, -1.0, 1.0]),
        ("3D-right-handed", [-1.0, -1.0, 1.0]),
    ] {
        let header = format!(
            "{NRRD}space: {space}\nspace directions: (0,2,0) (3,0,0) (0,0,4)\nspace origin: (10,20,30)\n\n"
        );
        let volume = load_text("a.nrrd", &header, &data).unwrap();
        near(at(&volume, [1.0, 1.0, 1.0]), [13.0 * sign[0], 22.0 * sign[1], 34.0 * sign[2]]);
        assert_eq!(volume.voxels().get(3), 256.0);
    }
}

#[test]
fn nrrd_without_space_has_spacings_and_axis_minima() {
    let data = [0; 8];
    let volume = load_text("a.nrrd", &format!("{NRRD}spacings: 2 3 nan\n\n"), &data).unwrap();
    near(at(&volume, [1.0, 1.0, 1.0]), [-2.0, -3.0, 1.0]);
    let minima = format!("{NRRD}spacings: 2 4 6\naxis mins: 10 20 30\ncenters: cell cell node\n\n");
    let volume = load_text("a.nrrd", &minima, &data).unwrap();
    near(at(&volume, [0.0; 3]), [-11.0, -22.0, 30.0]);
}

#[test]
fn nrrd_skips_lines_and_bytes_or_takes_the_end_of_a_file() {
    let folder = Folder::new();
    let header = |extra: &str| format!("{NRRD}data file: d.raw\n{extra}");
    folder.put("d.raw", b"junk\nmore\nxx\0\x01\0\x02\0\x03\0\x04");
    let path = folder.put("a.nhdr", header("line skip: 2\nbyte skip: 2\n").as_bytes());
    assert_eq!(load(&path).unwrap().voxels().get(0), 1.0);
    let path = folder.put("a.nhdr", header("byteskip: -1\n").as_bytes());
    assert_eq!(load(&path).unwrap().voxels().get(3), 4.0);
    let path = folder.put("a.nhdr", header("byte skip: 12\n").as_bytes());
    assert_eq!(load(&path).unwrap().voxels().get(3), 4.0);
}

#[test]
fn nrrd_reads_text_and_gzip() {
    let text = NRRD.replace("raw", "ascii");
    let volume = load_text("a.nrrd", &format!("{text}\n"), b"1 2,\n 3 65535\n").unwrap();
    assert_eq!(volume.voxels().get(3), 65535.0);
    let error = load_text("a.nrrd", &format!("{text}\n"), b"1 2 3 65536").unwrap_err();
    assert!(error.to_string().contains("voxel 3"), "{error}");
    let mut gzip = flate2::write::GzEncoder::new(Vec::new(), flate2::Compression::best());
    gzip.write_all(&[0, 1, 0, 2, 0, 3, 0, 4]).unwrap();
    let gzip = gzip.finish().unwrap();
    let header = format!("{}\n", NRRD.replace("raw", "gzip"));
    assert_eq!(load_text("a.nrrd", &header, &gzip).unwrap().voxels().get(1), 2.0);
}

#[test]
fn nrrd_axes_beside_space_are_frames_or_have_size_one() {
    let four = |sizes: &str, kinds: &str| {
        NRRD.replace("dimension: 3", "dimension: 4").replace("2 2 1", sizes) + &format!("kinds: {kinds}\n\n")
    };
    let data = [0, 1, 0, 2, 0, 3, 0, 4];
    let one = load_text("a.nrrd", &four("1 2 2 1", "scalar domain domain domain"), &data).unwrap();
    assert_eq!(one.grid().dims(), [2, 2, 1]);
    let vector = load_text("a.nrrd", &four("2 2 1 1", "vector domain domain domain"), &data).unwrap_err();
    assert!(vector.to_string().contains("vector"), "{vector}");
    let frames = load_text("a.nrrd", &four("2 1 1 2", "domain domain domain time"), &data).unwrap_err();
    assert!(frames.to_string().contains("--frame"), "{frames}");
}

#[test]
fn each_hostile_field_of_nrrd_is_named() {
    let table = [
        ("dimension: 3", "dimension: x", "dimension"),
        ("dimension: 3", "dimension: 99", "dimension"),
        ("dimension: 3\n", "", "dimension"),
        ("sizes: 2 2 1", "sizes: 2 2", "sizes"),
        ("sizes: 2 2 1", "sizes: -2 2 1", "sizes"),
        ("sizes: 2 2 1", "sizes: 0 2 1", "sizes"),
        ("sizes: 2 2 1", "sizes: 9223372036854775807 9223372036854775807 1", "sizes"),
        ("sizes: 2 2 1", "sizes: 99999 99999 9999", "bytes needed"),
        ("sizes: 2 2 1", "sizes: 99999999999999999999999 1 1", "sizes"),
        ("type: unsigned short", "type: quaternion", "type"),
        ("type: unsigned short", "type: block", "block"),
        ("encoding: raw", "encoding: bzip2", "bzip2"),
        ("encoding: raw", "encoding: magic", "encoding"),
        ("endian: big\n", "", "endian"),
        ("endian: big", "endian: middle", "endian"),
        ("encoding: raw", "encoding: raw\nbyte skip: -7", "byte skip"),
        ("encoding: raw", "encoding: raw\nbyte skip: 9223372036854775807", "bytes"),
        ("encoding: raw", "encoding: raw\nline skip: -1", "line skip"),
        ("encoding: raw", "encoding: raw\nline skip: 9999", "lines to skip"),
        ("encoding: raw", "encoding: raw\nspacings: 0 1 1", "spacings"),
        ("encoding: raw", "encoding: raw\nspacings: -1 1 1", "spacings"),
        ("encoding: raw", "encoding: raw\nspace directions: (1,0,0) (0,1,0)", "space directions"),
        ("encoding: raw", "encoding: raw\nspace directions: (1,0,0) (1,0,0) (0,0,1)", "space directions"),
        ("encoding: raw", "encoding: raw\nspace directions: (nan,0,0) (1,0,0) (0,0,1)", "space directions"),
        ("encoding: raw", "encoding: raw\nspace directions: (1,0,0) (0,1,0) (0,0,1)\nspace: mars", "mars"),
        (
            "encoding: raw",
            "encoding: raw\nspace directions: (1,0,0) (0,1,0) (0,0,1)\nspace origin: (",
            "space origin",
        ),
        ("encoding: raw", "encoding: raw\nspace: RAS\nspace origin: (1,2,3)", "space origin"),
        ("encoding: raw", "encoding: raw\nkinds: domain", "kinds"),
        ("encoding: raw", "encoding: raw\ndata file: nowhere.raw", "nowhere.raw"),
        ("encoding: raw", "encoding: raw\ndata file: slice%03d.raw 1 9 1", "data file"),
        ("encoding: raw", "encoding: raw\nencoding: raw", "twice"),
    ];
    for (from, to, field) in table {
        let header = format!("{}\n", NRRD.replace(from, to));
        let error = load_text("a.nrrd", &header, &[0; 8]).expect_err(to);
        assert!(error.to_string().contains(field), "{to}: {error}");
        assert!(
            matches!(error.error_class(), ErrorClass::Input | ErrorClass::Limit | ErrorClass::Io),
            "{error}"
        );
    }
}

const META: &str = "ObjectType = Image\nNDims = 3\nDimSize = 2 2 1\nElementType = MET_SHORT\nElementByteOrderMSB = True\n\
    TransformMatrix = 0 1 0 -1 0 0 0 0 1\nOffset = 10 20 30\nElementSpacing = 2 3 4\n";

#[test]
fn metaimage_says_what_it_was_made_with() {
    use ivd_core::Modality::{ComputedTomography, MagneticResonance};
    let data = [0, 1, 0, 2, 0, 3, 0, 4];
    let words = [
        ("MET_MOD_MR", Some(MagneticResonance)),
        ("MET_MOD_CT", Some(ComputedTomography)),
        ("MET_MOD_US", None),
    ];
    for (word, wanted) in words {
        let header = format!("{META}Modality = {word}\nElementDataFile = LOCAL\n");
        assert_eq!(load_text("a.mha", &header, &data).unwrap().modality(), wanted, "{word}");
    }
    assert_eq!(
        load_text("a.mha", &format!("{META}ElementDataFile = LOCAL\n"), &data).unwrap().modality(),
        None
    );
}

#[test]
fn metaimage_rows_are_the_directions_of_the_axes_in_lps() {
    let header = format!("{META}ElementDataFile = LOCAL\n");
    let volume = load_text("a.mha", &header, &[0, 1, 0, 2, 0, 3, 0xff, 0xff]).unwrap();
    assert_eq!(volume.voxel_type(), VoxelType::I16);
    assert_eq!(volume.voxels().get(3), -1.0);
    near(at(&volume, [1.0, 0.0, 0.0]), [-10.0, -22.0, 30.0]);
    near(at(&volume, [0.0, 1.0, 0.0]), [-7.0, -20.0, 30.0]);
}

#[test]
fn metaimage_data_may_lie_beside_behind_a_header_compressed_or_as_text() {
    let folder = Folder::new();
    folder.put("d.raw", b"head\0\x01\0\x02\0\x03\0\x04");
    for size in [4, -1] {
        let header = format!("{META}HeaderSize = {size}\nElementDataFile = d.raw\n");
        assert_eq!(load(&folder.put("a.mhd", header.as_bytes())).unwrap().voxels().get(1), 2.0);
    }
    let mut zlib = flate2::write::ZlibEncoder::new(Vec::new(), flate2::Compression::best());
    zlib.write_all(&[0, 1, 0, 2, 0, 3, 0, 4]).unwrap();
    let header = format!("{META}CompressedData = True\nElementDataFile = LOCAL\n");
    assert_eq!(load_text("a.mha", &header, &zlib.finish().unwrap()).unwrap().voxels().get(1), 2.0);
    let header = format!("{META}BinaryData = False\nElementDataFile = LOCAL\n");
    assert_eq!(load_text("a.mha", &header, b"1 -2 3 4").unwrap().voxels().get(1), -2.0);
}

#[test]
fn each_hostile_field_of_metaimage_is_named() {
    let table = [
        ("NDims = 3", "NDims = 7", "NDims"),
        ("NDims = 3\n", "", "NDims"),
        ("DimSize = 2 2 1", "DimSize = 2 2", "DimSize"),
        ("DimSize = 2 2 1", "DimSize = 2 -2 1", "DimSize"),
        ("DimSize = 2 2 1", "DimSize = 9223372036854775807 99999 1", "DimSize"),
        ("DimSize = 2 2 1", "DimSize = 99999 99999 1", "bytes needed"),
        ("MET_SHORT", "MET_SHORT_ARRAY", "ElementType"),
        ("MET_SHORT", "MET_CHEESE", "ElementType"),
        ("MSB = True", "MSB = Perhaps", "ElementByteOrderMSB"),
        ("Spacing = 2 3 4", "Spacing = 2 3", "ElementSpacing"),
        ("Spacing = 2 3 4", "Spacing = 2 0 4", "ElementSpacing"),
        ("Spacing = 2 3 4", "Spacing = 2 nan 4", "ElementSpacing"),
        ("0 1 0 -1 0 0 0 0 1", "0 1 0 0 1 0 0 0 1", "TransformMatrix"),
        ("0 1 0 -1 0 0 0 0 1", "0 1 0", "TransformMatrix"),
        ("Offset = 10 20 30", "Offset = 10 inf 30", "Offset"),
        ("Offset = 10 20 30", "HeaderSize = -3", "HeaderSize"),
        ("Offset = 10 20 30", "HeaderSize = 9223372036854775807", "bytes"),
        ("Offset = 10 20 30", "ElementNumberOfChannels = 3", "ElementNumberOfChannels"),
        ("Offset = 10 20 30", "CompressedData = True", "damaged"),
        ("Offset = 10 20 30", "nonsense", "nonsense"),
        ("LOCAL", "LIST", "ElementDataFile"),
        ("LOCAL", "s%03d.raw 1 9 1", "ElementDataFile"),
        ("ElementDataFile = LOCAL", "", "header"),
    ];
    for (from, to, field) in table {
        let header = format!("{META}ElementDataFile = LOCAL\n").replace(from, to);
        let error = load_text("a.mha", &header, &[0, 1, 0, 2, 0, 3, 0, 4]).expect_err(to);
        assert!(error.to_string().contains(field), "{to}: {error}");
        assert_eq!(error.error_class(), ErrorClass::Input, "{error}");
    }
}
