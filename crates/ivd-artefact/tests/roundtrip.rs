//! What is written is read back, bit for bit, and nothing is written that need not be.

use std::time::{Duration, SystemTime};

use ivd_artefact::{
    Artefact, CHUNK, Error, Kind, KindCode, content_hash, is_artefact, open, peek, read, write,
    write_with_metrics,
};
use ivd_core::{
    ByteSource as _, Classified, ErrorClass, Grid, Labels, Mask, Volume, VoxelType, Voxels, with_voxels,
};
use serde_json::json;

use crate::samples::{provenance, sample};

/// Equality that tells NaN from NaN and −0 from 0: the bytes of the bulk data.
fn same(a: &Artefact, b: &Artefact) -> bool {
    match (a, b) {
        (Artefact::Volume(a), Artefact::Volume(b)) => {
            a.voxels().as_bytes() == b.voxels().as_bytes()
                && a.grid() == b.grid()
                && (a.slope(), a.intercept()) == (b.slope(), b.intercept())
                && a.modality() == b.modality()
                && a.bricks() == b.bricks()
        }
        _ => a == b,
    }
}

#[test]
fn a_lattice_of_a_foreign_mesh_says_so() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("lattice");
    let Artefact::Lattice(lattice) = sample(Kind::Lattice) else { unreachable!("a lattice was asked for") };
    let value = Artefact::Lattice(lattice.with_source(ivd_core::LatticeSource::Foreign));
    write(&path, &value, &provenance()).unwrap();
    assert!(same(&read(&path).unwrap().artefact, &value));
}

#[test]
fn a_lattice_keeps_its_coarser_levels() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("lattice");
    let Artefact::Lattice(lattice) = sample(Kind::Lattice) else { unreachable!("a lattice was asked for") };
    let triangles = lattice.triangles()[..1].to_vec().into();
    let coarser = vec![
        ivd_core::CoarseLevel { triangles, level: 1, max_error_mm: 0.25 },
        ivd_core::CoarseLevel { triangles: Vec::new().into(), level: 3, max_error_mm: 1.5 },
    ];
    let value = Artefact::Lattice(lattice.with_coarser(coarser).unwrap());
    write(&path, &value, &provenance()).unwrap();
    assert!(same(&read(&path).unwrap().artefact, &value));
}

#[test]
fn a_motion_keeps_the_inner_points_of_its_rigid_parts() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("motion");
    let Artefact::Motion(motion) = sample(Kind::Motion) else { unreachable!("a motion was asked for") };
    let places = vec![[0.5, 1.0, 2.0], [3.0, 0.0, -1.0]].into();
    let frames = vec![vec![[0.1, -0.0, 1e-300]; 2].into(); motion.frames().len()];
    let value = Artefact::Motion(motion.with_inner(ivd_core::InteriorPoints { places, frames }).unwrap());
    write(&path, &value, &provenance()).unwrap();
    assert!(same(&read(&path).unwrap().artefact, &value));
}

#[test]
fn every_kind_comes_back_bit_for_bit_with_its_provenance() {
    let folder = tempfile::tempdir().unwrap();
    for kind in Kind::ALL {
        let path = folder.path().join(kind.name());
        let value = sample(kind);
        let written = write_with_metrics(&path, &value, &provenance(), &json!({"voxels": 7})).unwrap();
        assert!(is_artefact(&path));
        let loaded = read(&path).unwrap();
        assert!(same(&loaded.artefact, &value), "{kind}");
        assert_eq!(loaded.provenance, provenance());
        assert_eq!(loaded.metrics, json!({"voxels": 7}));
        assert_eq!((loaded.hash, loaded.kind_version), (written.hash, kind.version()));
        assert_eq!(content_hash(&value).unwrap(), written.hash, "{kind}");
        let info = peek(&path).unwrap();
        assert_eq!((info.kind, info.hash, info.file_bytes), (kind, written.hash, written.bytes));
        assert_eq!(info.file_bytes, std::fs::metadata(&path).unwrap().len());
        assert!(info.sections.iter().all(|s| s.offset % 4096 == 0));
        // A mapped value hashes and writes like the one it was made from.
        assert_eq!(content_hash(&loaded.artefact).unwrap(), written.hash);
    }
}

#[test]
fn every_voxel_type_comes_back() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("v.ivd");
    let grid = crate::samples::grid([3, 2, 2]);
    let all: Vec<Voxels> = vec![
        Voxels::from((0..12).map(|i| i * 20).collect::<Vec<u8>>()),
        Voxels::from((0..12).map(|i| i * 11 - 60).collect::<Vec<i8>>()),
        Voxels::from((0..12).map(|i| i * 5000).collect::<Vec<u16>>()),
        Voxels::from((0..12).map(|i| i * 2500 - 20000).collect::<Vec<i16>>()),
        Voxels::from((0..12).map(|i| i * 300_000_000).collect::<Vec<u32>>()),
        Voxels::from((0..12).map(|i| i * 100_000_000 - 500_000_000).collect::<Vec<i32>>()),
        Voxels::from(
            (0..12).map(|i| if i == 3 { f32::NEG_INFINITY } else { i as f32 }).collect::<Vec<f32>>(),
        ),
        Voxels::from((0..12).map(|i| if i == 3 { f64::NAN } else { f64::from(i) }).collect::<Vec<f64>>()),
    ];
    for voxels in all {
        let volume = Artefact::from(Volume::new(grid.clone(), voxels).unwrap());
        write(&path, &volume, &provenance()).unwrap();
        assert!(same(&read(&path).unwrap().artefact, &volume));
    }
}

#[test]
fn content_hash_covers_meaning_and_not_provenance() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.ivd");
    let value = sample(Kind::Volume);
    let first = write(&path, &value, &provenance()).unwrap();
    let mut other = provenance();
    other.revision = 9;
    other.params = json!({});
    let second = write(&path, &value, &other).unwrap();
    assert!(second.touched, "the provenance is part of the file");
    assert_eq!(first.hash, second.hash);

    let grid = |origin: f64| Grid::with_spacing([2, 1, 1], [origin, 1.0, 1.0]).unwrap();
    let volume = |spacing, value: u8, slope| {
        let volume = Volume::with_scale(grid(spacing), Voxels::from(vec![value, 7]), slope, 0.0).unwrap();
        content_hash(&volume).unwrap()
    };
    let mut hashes = vec![volume(1.0, 1, 1.0), volume(2.0, 1, 1.0), volume(1.0, 2, 1.0), volume(1.0, 1, 2.0)];
    let bytes = || vec![1_u8, 0];
    hashes.push(content_hash(&Mask::new(grid(1.0), bytes().into()).unwrap()).unwrap());
    hashes.push(content_hash(&Volume::new(grid(1.0), Voxels::from(vec![1_i8, 7])).unwrap()).unwrap());
    hashes.sort_unstable();
    hashes.dedup();
    assert_eq!(hashes.len(), 6);
}

#[test]
fn a_file_that_would_not_change_keeps_its_time_and_a_damaged_one_is_replaced() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("labels.ivd");
    let value = sample(Kind::Labels);
    assert!(write(&path, &value, &provenance()).unwrap().touched);
    let old = SystemTime::now() - Duration::from_secs(5000);
    std::fs::File::options().append(true).open(&path).unwrap().set_modified(old).unwrap();
    let old = std::fs::metadata(&path).unwrap().modified().unwrap();
    assert!(!write(&path, &value, &provenance()).unwrap().touched);
    assert_eq!(std::fs::metadata(&path).unwrap().modified().unwrap(), old);

    let good = std::fs::read(&path).unwrap();
    let mut bytes = good.clone();
    *bytes.last_mut().unwrap() ^= 1;
    std::fs::write(&path, bytes).unwrap();
    assert!(write(&path, &value, &provenance()).unwrap().touched, "same root, other payload");
    assert_eq!(std::fs::read(&path).unwrap(), good);
    assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 1, "no temporary file is left");
}

#[test]
fn a_value_can_replace_the_file_that_it_views() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("volume.ivd");
    write(&path, &sample(Kind::Volume), &provenance()).unwrap();
    let loaded = read(&path).unwrap();
    let mut other = provenance();
    other.revision = 2;
    write(&path, &loaded.artefact, &other).unwrap();
    assert!(same(&loaded.artefact, &sample(Kind::Volume)), "the old map is still whole");
    assert!(same(&read(&path).unwrap().artefact, &loaded.artefact));
}

#[test]
fn chunks_are_verified_as_they_are_touched() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("long.ivd");
    let n = 2 * CHUNK + 1000;
    let grid = Grid::with_spacing([n, 1, 1], [1.0; 3]).unwrap();
    let inside: Vec<u8> = (0..n).map(|i| (i / 7 % 2) as u8).collect();
    let mask = Mask::new(grid, inside.clone().into()).unwrap();
    write(&path, &mask, &provenance()).unwrap();

    // Damage in the last chunk doesn't touch the others.
    let offset = peek(&path).unwrap().sections[0].offset as usize;
    let mut bytes = std::fs::read(&path).unwrap();
    bytes[offset + 2 * CHUNK + 5] ^= 1;
    std::fs::write(&path, bytes).unwrap();
    let opened = open(&path).unwrap();
    assert_eq!(opened.bytes_verified(), 0);
    let range = offset + CHUNK - 10..offset + CHUNK + 10;
    opened.touch(range.clone());
    assert_eq!(opened.bytes()[range.clone()], inside[CHUNK - 10..CHUNK + 10]);
    assert_eq!(opened.bytes_verified(), 2 * CHUNK as u64);
    opened.touch(range);
    assert_eq!(opened.bytes_verified(), 2 * CHUNK as u64, "remembered");
    assert!(!opened.damaged() && opened.damage().is_none());
    opened.touch(offset..offset + n);
    let error = opened.damage().unwrap();
    assert!(matches!(&error, Error::SectionHash { section, chunk: 2, .. } if section == "inside"), "{error}");
    assert!(opened.damaged());
    assert!(matches!(read(&path), Err(Error::SectionHash { chunk: 2, .. })));
}

#[test]
fn values_that_are_no_numbers_are_refused_when_written() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("labels.ivd");
    let Artefact::Labels(labels) = sample(Kind::Labels) else { unreachable!() };
    let mut classes = labels.classes().to_vec();
    classes[0].mean = f64::NAN;
    let labels = Labels::new(labels.grid().clone(), labels.buffer().clone(), classes).unwrap();
    let error = write(&path, &labels, &provenance()).unwrap_err();
    assert_eq!(error.error_class(), ErrorClass::Untrusted);
    assert!(error.to_string().contains("labels.ivd"));
    assert!(!path.exists());
}

#[test]
fn a_folder_that_cannot_be_written_to_is_an_io_error_that_names_it() {
    let folder = tempfile::tempdir().unwrap();
    let error = write(folder.path().join("no/such/a.ivd"), &sample(Kind::Image), &provenance()).unwrap_err();
    assert_eq!(error.error_class(), ErrorClass::Io);
    assert!(error.to_string().contains("no/such"));
    assert_eq!(read(folder.path().join("gone.ivd")).unwrap_err().error_class(), ErrorClass::Io);
    assert!(!is_artefact(folder.path()));
}

#[test]
fn mapped_voxels_view_the_file() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("v.ivd");
    write(&path, &sample(Kind::Volume), &provenance()).unwrap();
    let Artefact::Volume(volume) = read(&path).unwrap().artefact else { panic!("a volume was written") };
    assert_eq!(volume.voxel_type(), VoxelType::F32);
    let address = with_voxels!(volume.voxels(), slice => slice.as_ptr() as usize);
    assert_eq!(address % 4096, 0, "sections are aligned to pages");
}
