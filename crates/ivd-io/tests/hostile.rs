//! Files that are cut short, damaged or lie about their size: an error that names the file, never a panic, never more
//! memory than was declared and allowed.
#![allow(clippy::unwrap_used, reason = "what builds a test's files may fail it")]

use std::path::{Path, PathBuf};

use ivd_core::{Classified, ErrorClass, Exec, Grid, Volume, Voxels};
use ivd_io::volume::{ByteOrder, RawLayout, ReadOptions, read, write};

fn volume() -> Volume {
    let grid = Grid::with_spacing([19, 17, 13], [0.5, 0.7, 2.0]).unwrap();
    let values: Vec<i16> = (0..grid.len()).map(|i| ((i * 7919) % 2003) as i16 - 900).collect();
    Volume::new(grid, Voxels::from(values)).unwrap()
}

const ENDINGS: [&str; 6] = ["nii", "nii.gz", "nrrd", "nhdr", "mha", "mhd"];

/// The file that holds the voxels.
fn data_file(path: &Path) -> std::path::PathBuf {
    match path.extension().and_then(|e| e.to_str()) {
        Some("nhdr" | "mhd") => PathBuf::from(format!("{}.raw", path.display())),
        _ => path.to_owned(),
    }
}

fn load(path: &Path) -> Result<Volume, ivd_io::volume::Error> {
    read(path, &ReadOptions::default(), &Exec::default())
}

#[test]
fn a_file_cut_short_anywhere_is_refused_by_name() {
    let folder = tempfile::tempdir().unwrap();
    for ending in ENDINGS {
        let path = folder.path().join(format!("cut.{ending}"));
        write(&path, &volume(), &Exec::default()).unwrap();
        let data = data_file(&path);
        for file in [&path, &data] {
            let whole = std::fs::read(file).unwrap();
            // The last newline of a text header is no loss.
            let spare = usize::from(file != &data);
            for part in 0..20 {
                let length = (whole.len() - spare) * part / 20;
                std::fs::write(file, &whole[..length]).unwrap();
                check_refused(&path, &format!("{ending} cut to {length}"));
            }
            if file == &data {
                for less in 1..20 {
                    std::fs::write(file, &whole[..whole.len() - less]).unwrap();
                    check_refused(&path, &format!("{ending} short of {less}"));
                }
            }
            std::fs::write(file, &whole).unwrap();
        }
        assert!(load(&path).is_ok());
    }
}

fn check_refused(path: &Path, case: &str) {
    let error = load(path).expect_err(case);
    assert!(error.to_string().contains("cut."), "{case}: {error}");
    assert_eq!(error.error_class(), ErrorClass::Input, "{case}: {error}");
}

#[test]
fn a_flipped_byte_never_panics_and_never_passes_in_a_checked_stream() {
    let folder = tempfile::tempdir().unwrap();
    for ending in ["nii", "nii.gz", "nrrd", "mha"] {
        let path = folder.path().join(format!("a.{ending}"));
        write(&path, &volume(), &Exec::default()).unwrap();
        let whole = std::fs::read(&path).unwrap();
        // All of the header, and some of the rest.
        for at in (0..560).chain((700..whole.len()).step_by(397)) {
            let mut bytes = whole.clone();
            bytes[at] ^= 0x55;
            std::fs::write(&path, &bytes).unwrap();
            let result = load(&path);
            // The gzip header's time, flags and system mean nothing.
            if ending == "nii.gz" && at >= 10 {
                assert!(result.is_err(), "byte {at} of {ending}");
            }
        }
    }
}

#[test]
fn a_small_stream_that_declares_a_huge_volume_takes_no_memory() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("bomb.nrrd");
    let mut gzip = flate2::write::GzEncoder::new(Vec::new(), flate2::Compression::best());
    std::io::Write::write_all(&mut gzip, &vec![0; 1 << 16]).unwrap();
    let packed = gzip.finish().unwrap();
    let header = "NRRD0004\ntype: uint8\ndimension: 3\nsizes: 65536 65536 1024\nencoding: gzip\n\n";
    std::fs::write(&path, [header.as_bytes(), &packed].concat()).unwrap();
    assert_eq!(load(&path).unwrap_err().error_class(), ErrorClass::Input);
}

#[test]
fn the_memory_limit_refuses_what_a_good_header_declares() {
    let folder = tempfile::tempdir().unwrap();
    for ending in ENDINGS {
        let path = folder.path().join(format!("a.{ending}"));
        write(&path, &volume(), &Exec::default()).unwrap();
        let bytes = volume().voxels().as_bytes().len() as u64;
        let with = |limit| {
            let exec = Exec::default().with_memory_limit(Some(limit));
            read(&path, &ReadOptions::default(), &exec)
        };
        assert_eq!(with(bytes - 1).unwrap_err().error_class(), ErrorClass::Limit, "{ending}");
        assert!(with(bytes).is_ok(), "{ending}");
    }
}

#[test]
fn a_cancelled_read_stops() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.nrrd");
    write(&path, &volume(), &Exec::default()).unwrap();
    let exec = Exec::default();
    exec.cancel.cancel();
    assert_eq!(read(&path, &ReadOptions::default(), &exec).unwrap_err().error_class(), ErrorClass::Cancelled);
}

#[test]
fn files_of_no_format_are_refused_with_a_remedy() {
    let folder = tempfile::tempdir().unwrap();
    for (name, bytes) in
        [("a.bin", &b"whatever"[..]), ("empty", b""), ("a.nii", b"x"), ("a.nrrd", b""), ("a.mha", b"\0\0")]
    {
        let path = folder.path().join(name);
        std::fs::write(&path, bytes).unwrap();
        let error = load(&path).unwrap_err();
        assert!(error.to_string().contains(name), "{error}");
        assert_eq!(error.error_class(), ErrorClass::Input);
    }
    assert_eq!(load(&folder.path().join("none.nii")).unwrap_err().error_class(), ErrorClass::Io);
}

#[cfg(unix)]
#[test]
fn a_header_that_names_a_device_has_no_sources() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("endless.nhdr");
    let header = "NRRD0004\ntype: uchar\ndimension: 3\nsizes: 2 2 2\nencoding: raw\ndata file: /dev/zero\n";
    std::fs::write(&path, header).unwrap();
    let sources = |path: &Path, options: &ReadOptions| ivd_io::volume::sources(path, options).unwrap_err();
    let error = sources(&path, &ReadOptions::default());
    assert!(error.error_class() == ErrorClass::Io && error.to_string().contains("/dev/zero"), "{error}");
    let layout = RawLayout {
        dims: [2; 3],
        voxel_type: ivd_core::VoxelType::U8,
        spacing: [1.0; 3],
        order: ByteOrder::Little,
        skip: 0,
    };
    let raw = ReadOptions { raw: Some(layout), ..ReadOptions::default() };
    assert_eq!(sources(Path::new("/dev/zero"), &raw).error_class(), ErrorClass::Io);
}
