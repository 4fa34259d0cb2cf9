//! Files of every kind and version ever released are still read, and today's writer still writes the newest ones byte
//! for byte.
//!
//! `IVD_BLESS=1 cargo test -p ivd-artefact golden` writes the files of a new kind or version. A file that is
//! there is never written over: raise the kind's version instead, and teach its codec to read both.

use std::path::PathBuf;

use ivd_artefact::{Kind, KindCode, read, write_with_metrics};
use serde_json::json;

use crate::samples::{provenance, sample};

fn fixture(kind: Kind) -> PathBuf {
    let folder = PathBuf::from(concat!(env!("CARGO_MANIFEST_DIR"), "/../../fixtures/artefacts"));
    folder.join(format!("{kind}.v{}.ivd", kind.version()))
}

#[test]
fn golden_files_are_read_and_written_again_byte_for_byte() {
    let folder = tempfile::tempdir().unwrap();
    for kind in Kind::ALL {
        let golden = fixture(kind);
        let path = folder.path().join("again.ivd");
        let metrics = json!({"kind": kind.name()});
        write_with_metrics(&path, &sample(kind), &provenance(), &metrics).unwrap();
        let written = std::fs::read(&path).unwrap();
        let version = u16::from_le_bytes([written[8], written[9]]);
        assert_eq!(
            version,
            kind.version(),
            "{kind}: the sample in tests/samples has nothing of the newest version"
        );
        if std::env::var_os("IVD_BLESS").is_some() && !golden.exists() {
            std::fs::copy(&path, &golden).unwrap();
        }
        let stored =
            std::fs::read(&golden).unwrap_or_else(|e| panic!("{}: {e}; see the head", golden.display()));
        assert!(stored == written, "{kind}: the writer changed");
        let loaded = read(&golden).unwrap();
        write_with_metrics(&path, &loaded.artefact, &loaded.provenance, &loaded.metrics).unwrap();
        assert!(stored == std::fs::read(&path).unwrap(), "{kind}: reading and writing changes it");
    }
}

#[test]
fn files_of_older_versions_are_read_and_written_as_what_they_were() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("again.ivd");
    let fixtures = PathBuf::from(concat!(env!("CARGO_MANIFEST_DIR"), "/../../fixtures/artefacts"));
    let mut older = 0;
    for file in std::fs::read_dir(fixtures).unwrap().map(|entry| entry.unwrap().path()) {
        let loaded = read(&file).unwrap();
        let kind = loaded.artefact.kind();
        write_with_metrics(&path, &loaded.artefact, &loaded.provenance, &loaded.metrics).unwrap();
        let is_same = std::fs::read(&file).unwrap() == std::fs::read(&path).unwrap();
        assert!(is_same, "{}: reading and writing changes it", file.display());
        older += u32::from(!file.ends_with(format!("{kind}.v{}.ivd", kind.version())));
    }
    assert!(older >= 1, "transfer functions without gradients");
}
