use std::io::Write as _;
use std::path::PathBuf;

use base64::Engine;
use base64::engine::general_purpose::STANDARD;
use ivd_core::{VoxelCoord, VoxelIndex, Voxels};
use nalgebra::Vector3;

use super::*;

const VALUES: [i16; 24] =
    [-300, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14, 15, 16, 17, 18, 19, 20, 21, 22, 32767];

/// A file of 4 × 3 × 2 points; `array` are further attributes of the array, `body` its content.
fn file(attributes: &str, image: &str, array: &str, body: &str, tail: &[u8]) -> Vec<u8> {
    let head = format!(
        r#"<?xml version="1.0"?>
<VTKFile type="ImageData" version="1.0" {attributes}>
  <ImageData WholeExtent="1 4 2 4 0 1" {image}><Piece Extent="1 4 2 4 0 1">
  <PointData Scalars="s"><DataArray type="Float32" Name="other" format="ascii">0</DataArray>
  <DataArray type="Int16" Name="s" {array}>{body}<InformationKey name="k">no numbers</InformationKey></DataArray></PointData>
  <CellData></CellData></Piece></ImageData>
"#
    );
    [head.as_bytes(), tail].concat()
}

fn words(values: &[u64], width: usize, big: bool) -> Vec<u8> {
    values
        .iter()
        .flat_map(|v| {
            let mut bytes = v.to_le_bytes()[..width].to_vec();
            if big {
                bytes.reverse();
            }
            bytes
        })
        .collect()
}

fn plain(big: bool) -> Vec<u8> {
    VALUES.iter().flat_map(|v| if big { v.to_be_bytes() } else { v.to_le_bytes() }).collect()
}

/// Zlib blocks of 10 bytes: their header, and the blocks.
fn zlib(width: usize, big: bool) -> (Vec<u8>, Vec<u8>) {
    let packed: Vec<Vec<u8>> = plain(big)
        .chunks(10)
        .map(|block| {
            let mut encoder = flate2::write::ZlibEncoder::new(Vec::new(), flate2::Compression::default());
            encoder.write_all(block).unwrap();
            encoder.finish().unwrap()
        })
        .collect();
    let mut header = vec![packed.len() as u64, 10, 8];
    header.extend(packed.iter().map(|p| p.len() as u64));
    (words(&header, width, big), packed.concat())
}

fn appended(encoding: &str, data: &[u8]) -> Vec<u8> {
    [format!("<AppendedData encoding=\"{encoding}\">\n _").as_bytes(), data, b"\n</AppendedData></VTKFile>"]
        .concat()
}

struct Saved {
    _folder: tempfile::TempDir,
    path: PathBuf,
}

fn save(bytes: &[u8]) -> Saved {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.vti");
    std::fs::write(&path, bytes).unwrap();
    Saved { _folder: folder, path }
}

fn open(bytes: &[u8]) -> Result<Volume, Error> {
    read(&save(bytes).path, &Exec::default())
}

fn complaint(bytes: &[u8]) -> String {
    open(bytes).unwrap_err().to_string()
}

/// The same voxels in every encoding.
fn variants() -> Vec<(String, Vec<u8>)> {
    let mut all = Vec::new();
    let text = VALUES.map(|v| v.to_string()).join("\n ");
    all.push(("ascii".into(), file("", "", "format=\"ascii\"", &text, b"</VTKFile>")));
    for (order, big) in [("LittleEndian", false), ("BigEndian", true)] {
        for (header, width) in [("UInt32", 4), ("UInt64", 8)] {
            let plain_file = format!("byte_order=\"{order}\" header_type=\"{header}\"");
            let zlib_file = format!("{plain_file} compressor=\"vtkZLibDataCompressor\"");
            let one = [words(&[48], width, big), plain(big)].concat();
            let (head, blocks) = zlib(width, big);
            let apart = format!(" \n{}\n{} ", STANDARD.encode(&head), STANDARD.encode(&blocks));
            let together = STANDARD.encode(&one);
            let name = |what: &str| format!("{what} {order} {header}");
            let inline = "format=\"binary\"";
            all.push((name("inline"), file(&plain_file, "", inline, &together, b"</VTKFile>")));
            all.push((name("inline zlib"), file(&zlib_file, "", inline, &apart, b"</VTKFile>")));
            let at = "format=\"appended\" offset=\"2\"";
            let raw = |data: &[u8]| appended("raw", &[&b"<<"[..], data].concat());
            all.push((name("appended raw"), file(&plain_file, "", at, "", &raw(&one))));
            let packed = [head, blocks].concat();
            all.push((name("appended raw zlib"), file(&zlib_file, "", at, "", &raw(&packed))));
            let at = "format=\"appended\" offset=\"4\"";
            let text = |data: &str| appended("base64", format!("AAAA{data}").as_bytes());
            all.push((name("appended base64"), file(&plain_file, "", at, "", &text(&together))));
            all.push((name("appended base64 zlib"), file(&zlib_file, "", at, "", &text(apart.trim()))));
        }
    }
    all
}

#[test]
fn every_encoding_gives_the_same_voxels() {
    for (name, bytes) in variants() {
        let volume = open(&bytes).unwrap_or_else(|e| panic!("{name}: {e}"));
        assert_eq!(volume.grid().dims(), [4, 3, 2], "{name}");
        assert_eq!(*volume.voxels(), Voxels::from(VALUES.to_vec()), "{name}");
    }
}

#[test]
fn every_encoding_cut_anywhere_is_an_error() {
    for (name, bytes) in variants() {
        // The data end before the closing tags.
        let end = bytes.len() - b"\n</AppendedData></VTKFile>".len() - 50;
        for i in 0..20 {
            assert!(open(&bytes[..end * i / 20]).is_err(), "{name} cut at {i}/20");
        }
    }
}

#[test]
fn hostile_bytes_never_panic() {
    for (_, bytes) in variants().into_iter().filter(|(name, _)| !name.contains("BigEndian UInt64")) {
        let saved = save(&bytes);
        for at in (0..bytes.len()).step_by(17) {
            let mut bad = bytes.clone();
            bad[at] = if at % 2 == 0 { 0xff } else { b'9' };
            std::fs::write(&saved.path, &bad).unwrap();
            let _ = read(&saved.path, &Exec::default().with_memory_limit(Some(1 << 20)));
        }
    }
}

#[test]
fn the_extent_shifts_the_first_voxel_along_the_turned_axes() {
    let image = r#"Origin="10 20 30" Spacing="0.5 2 3" Direction="0 -1 0 1 0 0 0 0 1""#;
    let text = VALUES.map(|v| v.to_string()).join(" ");
    let volume = open(&file("", image, "format=\"ascii\"", &text, b"</VTKFile>")).unwrap();
    // LPS: axis x runs along +y, axis y along −x. Index (1, 2, 0) is the first voxel.
    let lps = Vector3::new(10.0 - 2.0 * 2.0, 20.0 + 0.5, 30.0);
    let first = volume.grid().world(VoxelCoord::from(VoxelIndex([0, 0, 0]))).0;
    assert!((first - Vector3::new(-lps.x, -lps.y, lps.z)).norm() < 1e-12, "{first}");
    let next = volume.grid().world(VoxelCoord::from(VoxelIndex([1, 0, 0]))).0;
    assert!((next - first - Vector3::new(0.0, -0.5, 0.0)).norm() < 1e-12);
}

#[test]
fn what_is_written_is_read_back() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.vti");
    let (s, c) = 0.3_f64.sin_cos();
    let grid = Grid::new(
        [4, 3, 2],
        [0.1, 0.2, 6.5],
        [-100.3, 1e-7, 5.0],
        [[c, s, 0.0], [-s, c, 0.0], [0.0, 0.0, -1.0]],
    )
    .unwrap();
    let exec = Exec::default();
    for voxels in [
        Voxels::from(VALUES.to_vec()),
        Voxels::from(vec![200_u8; 24]),
        Voxels::from(vec![-5_i8; 24]),
        Voxels::from(vec![60000_u16; 24]),
        Voxels::from(vec![u32::MAX; 24]),
        Voxels::from(vec![i32::MIN; 24]),
        Voxels::from(vec![0.1_f32; 24]),
        Voxels::from(vec![1e300_f64; 24]),
    ] {
        let volume = Volume::new(grid.clone(), voxels).unwrap();
        write(&path, &volume, &exec).unwrap();
        assert_eq!(read(&path, &exec).unwrap(), volume);
        assert!(!write(&path, &volume, &exec).unwrap().touched);
    }
    let scaled = Volume::with_scale(grid, Voxels::from(VALUES.to_vec()), 0.5, -7.0).unwrap();
    write(&path, &scaled, &exec).unwrap();
    let real = read(&path, &exec).unwrap();
    assert_eq!(real.value(VoxelIndex([1, 0, 0])), -6.5);
    assert_eq!(real.voxel_type(), ivd_core::VoxelType::F32);
}

#[test]
fn what_is_not_read_is_named() {
    let with = |from: &str, to: &str| {
        let text = VALUES.map(|v| v.to_string()).join(" ");
        let bytes = file("compressor=\"\"", "Spacing=\"1 1 1\"", "format=\"ascii\"", &text, b"</VTKFile>");
        String::from_utf8(bytes).unwrap().replace(from, to).into_bytes()
    };
    assert!(open(&with("x", "x")).is_ok());
    for (from, to, said) in [
        ("\"ImageData\"", "\"UnstructuredGrid\"", "UnstructuredGrid"),
        ("compressor=\"\"", "compressor=\"vtkLZ4DataCompressor\"", "vtkLZ4DataCompressor"),
        ("Name=\"s\"", "Name=\"s\" NumberOfComponents=\"3\"", "3 components"),
        ("Int16", "Int64", "Int64"),
        ("Int16", "Bits", "Bits"),
        ("Int16", "UInt16", "-300"),
        ("PointData", "CellData", "CellData"),
        ("Extent=\"1 4", "Extent=\"1 400000000000", "DataArray"),
        ("Extent=\"1 4", "Extent=\"4 1", "Extent"),
        ("Extent=\"1 4", "Extent=\"-9223372036854775808 9223372036854775807", "Extent"),
        ("<Piece Extent=\"1 4", "<Piece Extent=\"1 3", "whole extent"),
        ("Spacing=\"1 1 1\"", "Spacing=\"1 0 1\"", "spacing"),
        ("Spacing=\"1 1 1\"", "Spacing=\"1 1\"", "Spacing"),
        ("Spacing=\"1 1 1\"", "Origin=\"NaN 1 1\"", "origin"),
        ("Spacing=\"1 1 1\"", "Direction=\"1 0 0 1 0 0 0 0 1\"", "direction"),
        (" 22 ", " 2x2 ", "2x2"),
        (" 22 ", " ", "23 numbers"),
        ("format=\"ascii\">-300", "format=\"appended\" offset=\"0\">", "AppendedData"),
        ("format=\"ascii\">-300", "format=\"appended\">", "offset"),
        ("Spacing=\"1 1 1\"", &format!("Spacing=\"1 1 1{}\"", " ".repeat(1024)), "1029 bytes"),
        ("Spacing=\"1 1 1\"", "Spacing=\"1 1 1\" Spacing=\"1 1 1\"", "duplicated attribute"),
        ("<CellData>", &"<CellData>".repeat(65), "more than 64 deep"),
    ] {
        let message = complaint(&with(from, to));
        assert!(message.contains(said) && message.contains("a.vti"), "{from} → {to}: {message}");
    }
}

#[test]
fn block_headers_that_lie_are_refused() {
    let attributes = "byte_order=\"LittleEndian\" compressor=\"vtkZLibDataCompressor\"";
    let (_, blocks) = zlib(4, false);
    for header in [
        vec![u64::from(u32::MAX), 10, 8, 1],
        vec![0, 0, 0],
        vec![1, 48, 49, 18],
        vec![1, 48, 0, u64::from(u32::MAX)],
        vec![5, 10, 8, 18, 18, 18, 18, u64::from(u32::MAX)],
        vec![5, 10, 9, 18, 18, 18, 18, 16],
    ] {
        let data = [words(&header, 4, false), blocks.clone()].concat();
        let bytes = file(attributes, "", "format=\"appended\" offset=\"0\"", "", &appended("raw", &data));
        assert!(open(&bytes).is_err(), "{header:?}");
    }
}

#[test]
fn the_vase_reads_as_its_notes_say() {
    let path = Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/../../../shared/data/vase/vase_1comp.vti"));
    if !path.is_file() {
        eprintln!("skipped: no {}", path.display());
        return;
    }
    let volume = read(path, &Exec::default()).unwrap();
    assert_eq!(volume.grid().dims(), [115, 101, 75]);
    assert_eq!(volume.range(), Some([0.0, 239.0]));
    assert_eq!(volume.grid().spacing(), [1.0; 3]);
}
