//! A volume's voxels are verified when they are touched, and only then.
#![allow(clippy::unwrap_used, reason = "a test fails where it can't go on")]

use std::path::Path;

use ivd_artefact::{Artefact, CHUNK, Error, Loaded, Provenance, read, read_lazily, write};
use ivd_core::{Grid, Volume, Voxels};

/// Layers of 1 MiB, four of them a chunk; four chunks.
const DIMS: [usize; 3] = [1024, 1024, 14];

fn written(path: &Path) -> u64 {
    let grid = Grid::with_spacing(DIMS, [1.0; 3]).unwrap();
    let voxels: Vec<u8> = (0..grid.len()).map(|i| ((i * 7919) >> 8) as u8).collect();
    let volume = Volume::new(grid, Voxels::from(voxels)).unwrap();
    write(path, &volume, &Provenance::new("test", serde_json::json!({}))).unwrap();
    ivd_artefact::peek(path).unwrap().sections[0].offset
}

fn volume(loaded: &Loaded) -> &Volume {
    let Artefact::Volume(volume) = &loaded.artefact else { panic!("a volume was written") };
    volume
}

/// Flips a byte of the voxels in a chunk.
fn damage(path: &Path, voxels_at: u64, chunk: usize) {
    let mut bytes = std::fs::read(path).unwrap();
    bytes[voxels_at as usize + chunk * CHUNK + 5] ^= 1;
    std::fs::write(path, bytes).unwrap();
}

#[test]
fn what_is_touched_is_verified_once_and_the_rest_is_never_read() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("volume.ivd");
    written(&path);
    let loaded = read_lazily(&path).unwrap();
    let bricks = loaded.file.bytes_verified();
    assert!(bricks < CHUNK as u64, "the brick index alone");
    volume(&loaded).layers([1..3, 2..4]);
    assert_eq!(loaded.file.bytes_verified() - bricks, CHUNK as u64);
    volume(&loaded).layers(std::iter::once(3..5));
    assert_eq!(loaded.file.bytes_verified() - bricks, 2 * CHUNK as u64);
    assert_eq!(volume(&loaded).voxels().len(), volume(&loaded).grid().len());
    let all = volume(&loaded).grid().len() as u64;
    assert_eq!(loaded.file.bytes_verified() - bricks, all);
    let _ = volume(&loaded).voxels();
    assert_eq!(loaded.file.bytes_verified() - bricks, all);
    assert!(!volume(&loaded).damaged() && loaded.file.damage().is_none());
}

#[test]
fn damage_is_told_where_it_is_touched_and_not_where_it_is_not() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("volume.ivd");
    let voxels_at = written(&path);
    damage(&path, voxels_at, 2);
    assert!(matches!(read(&path), Err(Error::SectionHash { chunk: 2, .. })));
    let loaded = read_lazily(&path).unwrap();
    volume(&loaded).layers([0..8, 12..14]);
    assert!(!volume(&loaded).damaged());
    volume(&loaded).layers(std::iter::once(11..12));
    assert!(volume(&loaded).damaged());
    assert!(matches!(loaded.file.damage(), Some(Error::SectionHash { chunk: 2, .. })));
}

#[test]
fn the_other_sections_of_a_volume_are_verified_at_once() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("volume.ivd");
    written(&path);
    let mut bytes = std::fs::read(&path).unwrap();
    let last = bytes.len() - 1;
    bytes[last] ^= 1;
    std::fs::write(&path, bytes).unwrap();
    assert!(matches!(read_lazily(&path), Err(Error::SectionHash { .. })));
}
