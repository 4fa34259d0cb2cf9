//! Good files of every format, and what becomes of them when they are cut or damaged.

use std::io::{Read, Write};

use ivd_core::{Exec, Grid, Volume, Voxels};

use crate::hostile::case::{BAD, Case, FINE};

/// 5 × 4 × 3 voxels of 16 bits on an oblique grid.
pub(crate) fn volume() -> Volume {
    let turned = [[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]];
    let grid = Grid::new([5, 4, 3], [0.5, 0.75, 2.0], [1.0, -2.0, 3.0], turned).unwrap();
    let values: Vec<i16> = (0..60).map(|i| i * 313 - 9000).collect();
    Volume::new(grid, Voxels::from(values)).unwrap()
}

/// The volume as our own writer writes it: the named file, and its data where they are apart.
pub(crate) fn files(ending: &str) -> Vec<(String, Vec<u8>)> {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join(format!("a.{ending}"));
    ivd_io::volume::write(&path, &volume(), &Exec::default()).unwrap();
    let mut names: Vec<_> = folder.path().read_dir().unwrap().map(|e| e.unwrap().path()).collect();
    names.sort_by_key(|p| *p != path);
    names
        .into_iter()
        .map(|p| (p.file_name().unwrap().to_string_lossy().into_owned(), std::fs::read(&p).unwrap()))
        .collect()
}

/// The first of [`files`].
pub(crate) fn file(ending: &str) -> Vec<u8> {
    files(ending).swap_remove(0).1
}

pub(crate) fn gzip(bytes: &[u8]) -> Vec<u8> {
    let mut packer = flate2::write::GzEncoder::new(Vec::new(), flate2::Compression::best());
    packer.write_all(bytes).unwrap();
    packer.finish().unwrap()
}

/// What a gzip stream holds; `None` where it doesn't unpack.
fn unpacked(bytes: &[u8]) -> Option<Vec<u8>> {
    let mut all = Vec::new();
    flate2::read::MultiGzDecoder::new(bytes).read_to_end(&mut all).ok()?;
    Some(all)
}

pub(crate) fn zlib(bytes: &[u8]) -> Vec<u8> {
    let mut packer = flate2::write::ZlibEncoder::new(Vec::new(), flate2::Compression::best());
    packer.write_all(bytes).unwrap();
    packer.finish().unwrap()
}

/// Every format cut at many places, and with bytes flipped.
pub(crate) fn damaged() -> Vec<Case> {
    let mut cases = Vec::new();
    for ending in ["nii", "nii.gz", "nrrd", "nhdr", "mha", "mhd", "vti", "tif"] {
        let files = files(ending);
        for which in 0..files.len() {
            let good = &files[which].1;
            // The newline at the end of a text header is no loss, nor is what follows the voxels of a VTI.
            let spare = match (ending, which) {
                ("nhdr" | "mhd", 0) => 1,
                ("vti", _) => 31,
                _ => 0,
            };
            let with = |name: String, codes, bytes: Vec<u8>| {
                let mut case = Case::new(name, codes);
                for (i, (name, own)) in files.iter().enumerate() {
                    case = case.file(name, if i == which { bytes.clone() } else { own.clone() });
                }
                case.import()
            };
            for part in 0..25 {
                let length = (good.len() - spare) * part / 25;
                cases.push(with(format!("{ending} {which} cut to {length}"), BAD, good[..length].to_vec()));
            }
            for part in 0..25 {
                let at = good.len() * part / 25;
                let mut bytes = good.clone();
                bytes[at] ^= 1 << (part % 8);
                // A checksum covers what the stream holds; bits of its own header and of its padding mean nothing.
                let codes = match ending {
                    "nii.gz" if unpacked(&bytes) == unpacked(good) => FINE,
                    "nii.gz" => BAD,
                    _ => DAMAGED,
                };
                cases.push(with(format!("{ending} {which} flipped at {at}"), codes, bytes));
            }
        }
    }
    for (i, value) in [0_u8, 0x7f, 0xff].into_iter().enumerate() {
        for ending in ["nii", "nrrd", "mha", "vti", "tif", "dcm", "nii.gz"] {
            let bytes = vec![value; 1000 * i + 1];
            cases.push(
                Case::new(format!("{ending} of {value}"), BAD).file(&format!("a.{ending}"), bytes).import(),
            );
        }
    }
    // A right file under another format's name is what its bytes say.
    for (from, to) in [
        ("nii", "nrrd"),
        ("nrrd", "mha"),
        ("mha", "tif"),
        ("vti", "nii.gz"),
        ("tif", "dcm"),
        ("nii.gz", "mhd"),
    ] {
        cases.push(Case::new(format!("{from} as {to}"), &[0]).file(&format!("a.{to}"), file(from)).import());
    }
    cases
}

/// A flipped bit may change a value, a size, or the name of another file.
const DAMAGED: &[i32] = &[0, 3, 4, 7];
