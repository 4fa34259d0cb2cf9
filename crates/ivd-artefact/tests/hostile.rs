//! Damaged, cut and hostile files: an error that names the file, never a panic, never a large allocation.

#![allow(clippy::unwrap_used, reason = "test values are sound")]

use std::path::{Path, PathBuf};

use ivd_artefact::{Error, Kind, is_artefact, open, peek, read, write};
use ivd_core::{Classified, ErrorClass, noise};

use crate::samples::{provenance, sample};

fn artefact(folder: &Path, kind: Kind) -> (PathBuf, Vec<u8>) {
    let path = folder.join(format!("{kind}.ivd"));
    write(&path, &sample(kind), &provenance()).unwrap();
    let bytes = std::fs::read(&path).unwrap();
    (path, bytes)
}

/// Makes the root right again, so that what comes after it is met.
fn seal(bytes: &mut [u8]) {
    let end = u32::from_le_bytes(bytes[20..24].try_into().unwrap()) as usize;
    let end = end.clamp(64, bytes.len());
    let root = blake3::Hasher::new().update(&bytes[..32]).update(&bytes[64..end]).finalize();
    bytes[32..64].copy_from_slice(root.as_bytes());
}

#[test]
fn every_flipped_byte_is_found() {
    let folder = tempfile::tempdir().unwrap();
    // Every byte of the smallest; a sample of those of one with several sections.
    for (kind, step) in [(Kind::Image, 1), (Kind::Lattice, 7)] {
        let (path, bytes) = artefact(folder.path(), kind);
        for at in (0..bytes.len()).step_by(step) {
            let mut bad = bytes.clone();
            bad[at] ^= 1 << (at % 8);
            std::fs::write(&path, &bad).unwrap();
            let error = read(&path).expect_err("one flipped bit");
            assert_eq!(error.error_class(), ErrorClass::Input, "byte {at}: {error}");
            assert!(error.to_string().contains(path.to_str().unwrap()), "{error}");
        }
    }
}

#[test]
fn every_cut_and_every_addition_is_found() {
    let folder = tempfile::tempdir().unwrap();
    let (path, bytes) = artefact(folder.path(), Kind::Mask);
    for end in (0..bytes.len()).filter(|end| *end < 800 || end % 5 == 0 || bytes.len() - end < 200) {
        std::fs::write(&path, &bytes[..end]).unwrap();
        let error = read(&path).unwrap_err();
        assert_eq!(error.error_class(), ErrorClass::Input, "cut at {end}: {error}");
        assert!(peek(&path).is_err());
    }
    std::fs::write(&path, &bytes[..bytes.len() - 3]).unwrap();
    let error = read(&path).unwrap_err().to_string();
    assert!(error.contains("`level`") && error.contains(&bytes.len().to_string()), "{error}");
    std::fs::write(&path, [&bytes[..], &[0]].concat()).unwrap();
    assert!(matches!(read(&path), Err(Error::Length { .. })));
}

#[test]
fn versions_and_kinds_of_the_future_are_named() {
    let folder = tempfile::tempdir().unwrap();
    let (path, bytes) = artefact(folder.path(), Kind::Image);
    let with = |at: usize, value: u16| {
        let mut bytes = bytes.clone();
        bytes[at..at + 2].copy_from_slice(&value.to_le_bytes());
        std::fs::write(&path, bytes).unwrap();
        read(&path).unwrap_err()
    };
    let error = with(4, 7);
    assert!(matches!(error, Error::Newer { what: "container", found: 7, supported: 1, .. }));
    assert!(error.to_string().contains("version 7") && error.to_string().contains("version 1"));
    assert!(matches!(with(8, 3), Error::Newer { what: "image", found: 3, .. }));
    assert!(matches!(with(6, 900), Error::UnknownKind { code: 900, .. }));
    assert!(matches!(with(0, 0x4142), Error::NotAnArtefact { .. }));
    assert!(!is_artefact(&path));
    assert!(matches!(with(12, 1), Error::Metadata { part: "prelude", .. }), "an unknown flag");
}

#[test]
fn hostile_lengths_with_a_right_root_are_refused() {
    let folder = tempfile::tempdir().unwrap();
    let (path, bytes) = artefact(folder.path(), Kind::Mask);
    let metadata = u32::from_le_bytes(bytes[16..20].try_into().unwrap()) as usize;
    for value in [0_u64, 0x7fff_ffff, 1 << 40, u64::MAX] {
        for at in (10..32).step_by(2).chain(64..64 + metadata - 8) {
            let mut bad = bytes.clone();
            let width = if at < 32 { 2 } else { 8 };
            bad[at..at + width].copy_from_slice(&value.to_le_bytes()[..width]);
            if bad == bytes {
                continue;
            }
            seal(&mut bad);
            std::fs::write(&path, &bad).unwrap();
            // Bytes of a name or of the provenance may change and still make an artefact; nothing else may.
            match read(&path) {
                Ok(_) => assert!(at >= 64),
                Err(error) => assert_eq!(error.error_class(), ErrorClass::Input, "byte {at}: {error}"),
            }
        }
    }
}

#[test]
fn a_section_that_lies_about_its_shape_is_refused() {
    let folder = tempfile::tempdir().unwrap();
    let (path, bytes) = artefact(folder.path(), Kind::Image);
    let find = |needle: &[u8]| bytes.windows(needle.len()).position(|w| w == needle).unwrap();
    let shape: Vec<u8> = [2_u64, 3, 4].iter().flat_map(|n| n.to_le_bytes()).collect();
    let at = find(&shape);
    for lie in [[3_u64, 2, 4], [24, 1, 1], [u64::MAX, 3, 4], [0, 3, 4]] {
        let mut bad = bytes.clone();
        bad[at..at + 24].copy_from_slice(&lie.iter().flat_map(|n| n.to_le_bytes()).collect::<Vec<u8>>());
        seal(&mut bad);
        std::fs::write(&path, &bad).unwrap();
        assert_eq!(read(&path).unwrap_err().error_class(), ErrorClass::Input);
    }
    let mut bad = bytes.clone();
    let at = find(b"\"width\":3");
    bad[at + 8] = b'4';
    seal(&mut bad);
    std::fs::write(&path, &bad).unwrap();
    let error = read(&path).unwrap_err().to_string();
    assert!(error.contains("`rgba`"), "{error}");
}

#[test]
fn content_that_breaks_a_value_is_refused_by_its_own_check() {
    let folder = tempfile::tempdir().unwrap();
    let (path, bytes) = artefact(folder.path(), Kind::Mask);
    let at = bytes.windows(8).position(|w| w == b"[0.4,0.5").unwrap();
    let mut bad = bytes.clone();
    bad[at + 1] = b'-';
    bad[at + 2] = b'1';
    bad[at + 3] = b' ';
    seal(&mut bad);
    std::fs::write(&path, &bad).unwrap();
    let error = read(&path).unwrap_err();
    assert!(matches!(error, Error::Content { .. }), "{error}");
    assert!(error.to_string().contains("spacing"));
}

#[cfg(target_os = "linux")]
#[test]
fn a_pipe_that_nobody_writes_is_not_waited_for() {
    let folder = tempfile::tempdir().unwrap();
    let pipe = folder.path().join("pipe");
    assert!(std::process::Command::new("mkfifo").arg(&pipe).status().unwrap().success());
    assert!(!is_artefact(&pipe));
    for error in [read(&pipe).unwrap_err(), peek("/dev/zero").unwrap_err()] {
        assert!(matches!(error, Error::NotAnArtefact { .. }), "{error}");
    }
}

/// Bytes without a pattern: fewer than `most` of them.
fn random_bytes(case: u64, most: u64) -> Vec<u8> {
    (0..noise::below(case, 0, most)).map(|i| noise::bits(case, 16 + i) as u8).collect()
}

#[test]
fn any_prelude_over_any_bytes_is_an_error_and_no_panic() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("h.ivd");
    let mut sealed = 0;
    for case in 0..200 {
        let mut bytes = random_bytes(case, 120);
        if noise::below(case, 1, 2) == 0 && bytes.len() >= 64 {
            bytes[..16].copy_from_slice(&[b'I', b'V', b'D', b'A', 1, 0, 3, 0, 1, 0, 2, 0, 0, 0, 0, 0]);
            if noise::below(case, 2, 2) == 0 {
                seal(&mut bytes);
                sealed += 1;
            }
        }
        std::fs::write(&path, &bytes).unwrap();
        assert!(read(&path).is_err(), "case {case}");
        assert!(peek(&path).is_err(), "case {case}");
    }
    assert!(sealed > 10, "{sealed} of 200 have a right root");
}

#[test]
fn any_metadata_under_a_right_root_is_an_error_and_no_panic() {
    let folder = tempfile::tempdir().unwrap();
    let (path, good) = artefact(folder.path(), Kind::Mask);
    for case in 200..400 {
        let (junk, mut bytes) = (random_bytes(case, 400), good.clone());
        let at = 64 + noise::below(case, 1, 636) as usize;
        let end = (at + junk.len()).min(4096);
        bytes[at..end].copy_from_slice(&junk[..end - at]);
        if noise::below(case, 2, 3) == 0 {
            bytes.truncate(64 + noise::below(case, 3, bytes.len() as u64 - 64) as usize);
        }
        seal(&mut bytes);
        std::fs::write(&path, &bytes).unwrap();
        // Noise may leave an artefact whole; what counts is that it is told.
        if let Ok(opened) = open(&path) {
            let _ = opened.verify();
        }
        let _ = read(&path);
    }
}
