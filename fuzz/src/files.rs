//! Volume files.

use std::path::PathBuf;
use std::sync::OnceLock;

use ivd_core::Volume;
use ivd_io::volume::ReadOptions;
use tempfile::TempDir;

use crate::{MEMORY, exec};

/// A folder in memory where there is one: the readers want paths, and a disk would be the bottleneck.
fn folder() -> &'static TempDir {
    static FOLDER: OnceLock<TempDir> = OnceLock::new();
    FOLDER.get_or_init(|| {
        let memory = PathBuf::from("/dev/shm");
        let made = if memory.is_dir() { tempfile::tempdir_in(memory) } else { tempfile::tempdir() };
        made.expect("a temporary folder")
    })
}

/// A path in the folder of this process.
pub fn path(name: &str) -> PathBuf {
    folder().path().join(name)
}

/// Reads the bytes as a file of a format's ending. A header may name `x.raw` beside it, which holds 512 bytes.
pub fn read(ending: &str, bytes: &[u8]) {
    static DATA: OnceLock<()> = OnceLock::new();
    DATA.get_or_init(|| {
        let data: Vec<u8> = (0..512_u32).map(|i| (i * 37) as u8).collect();
        std::fs::write(path("x.raw"), data).expect("the temporary folder is writable");
    });
    let file = path(&format!("x.{ending}"));
    std::fs::write(&file, bytes).expect("the temporary folder is writable");
    let read = |frame| {
        let options = ReadOptions { frame, ..ReadOptions::default() };
        ivd_io::volume::read(&file, &options, exec())
    };
    let whole = read(None);
    if whole.is_err() {
        let _ = read(Some(1)).map(|volume| check(&volume));
    }
    let _ = whole.map(|volume| check(&volume));
    let _ = ivd_io::volume::sources(&file, &ReadOptions::default());
}

/// Reads the bytes as every one of two slices in a folder.
pub fn read_slices(ending: &str, bytes: &[u8]) {
    let slices = path("slices");
    std::fs::create_dir_all(&slices).expect("the temporary folder is writable");
    for name in ["a1", "a2"] {
        std::fs::write(slices.join(name).with_extension(ending), bytes).expect("it is writable");
    }
    let _ = ivd_io::volume::read(&slices, &ReadOptions::default(), exec()).map(|volume| check(&volume));
}

/// What a volume promises.
fn check(volume: &Volume) {
    let grid = volume.grid();
    assert_eq!(grid.len(), volume.voxels().len());
    assert!(volume.voxels().as_bytes().len() as u64 <= MEMORY, "more voxels than the limit allows");
    assert!(grid.spacing().iter().all(|s| s.is_finite() && *s > 0.0));
    assert!(grid.origin().iter().all(|o| o.is_finite()));
    assert!(grid.direction().as_flattened().iter().all(|d| d.is_finite()));
    assert!(volume.slope().is_finite() && volume.slope() != 0.0 && volume.intercept().is_finite());
}
