//! The cache never trusts an entry, and never loses one that is sound.

use std::time::{Duration, SystemTime};

use ivd_artefact::{Cache, CacheKey, Kind, Lookup};
use serde_json::json;

use crate::samples::{provenance, sample};

fn key(kind: Kind) -> CacheKey {
    CacheKey::new(kind, &provenance())
}

#[test]
fn entries_come_back_with_metrics_and_without_reading_the_payload() {
    let folder = tempfile::tempdir().unwrap();
    let cache = Cache::open(folder.path()).unwrap();
    let key = key(Kind::Mask);
    assert!(matches!(cache.lookup(&key), Lookup::Absent));
    assert_eq!(cache.lookup_hash(&key), None);
    let metrics = json!({"voxels": 5});
    let written =
        cache.put_with_metrics(&key, &sample(Kind::Mask), &provenance(), &metrics).unwrap().unwrap();
    assert_eq!(cache.lookup_hash(&key), Some(written.hash));
    let kept = || cache.lookup_info(&key).hit().map(|info| info.metrics);
    assert_eq!(kept(), Some(metrics));
    assert_eq!(cache.get(&key).unwrap().artefact, sample(Kind::Mask));
    cache.put_with_metrics(&key, &sample(Kind::Mask), &provenance(), &json!({"voxels": 6})).unwrap();
    assert_eq!(kept(), Some(json!({"voxels": 6})));
    assert_eq!(cache.lookup_hash(&key), Some(written.hash), "metrics are no part of the content");
    assert!(cache.path_of(&key).unwrap().starts_with(folder.path().join("v1")));
}

#[test]
fn a_damaged_entry_is_told_removed_and_made_again() {
    let folder = tempfile::tempdir().unwrap();
    let cache = Cache::open(folder.path()).unwrap();
    let key = key(Kind::Mask);
    cache.put(&key, &sample(Kind::Mask), &provenance()).unwrap();
    let path = cache.path_of(&key).unwrap();
    let mut bytes = std::fs::read(&path).unwrap();
    *bytes.last_mut().unwrap() ^= 4;
    std::fs::write(&path, &bytes).unwrap();
    assert!(cache.lookup_hash(&key).is_some(), "the metadata alone are sound");
    let Lookup::Unusable(reason) = cache.verify(&key) else { panic!("a flipped bit must be found") };
    assert!(reason.contains("`level`"), "{reason}");
    assert!(!path.exists());
    cache.put(&key, &sample(Kind::Mask), &provenance()).unwrap();
    assert!(matches!(cache.verify(&key), Lookup::Hit(_)));
    std::fs::write(&path, b"").unwrap();
    assert!(cache.get(&key).is_none());
}

#[test]
fn an_entry_under_a_wrong_name_is_not_believed() {
    let folder = tempfile::tempdir().unwrap();
    let cache = Cache::open(folder.path()).unwrap();
    let key = key(Kind::Mask);
    cache.put(&key, &sample(Kind::Mask), &provenance()).unwrap();
    let mut other = provenance();
    other.params = json!({"k": 6});
    let other = CacheKey::new(Kind::Mask, &other);
    let path = cache.path_of(&other).unwrap();
    std::fs::create_dir_all(path.parent().unwrap()).unwrap();
    std::fs::copy(cache.path_of(&key).unwrap(), &path).unwrap();
    assert!(matches!(cache.lookup_info(&other), Lookup::Unusable(_)));
    assert!(cache.get(&key).is_some());
}

#[test]
fn pruning_keeps_what_was_used_last_and_clears_what_was_left_behind() {
    let folder = tempfile::tempdir().unwrap();
    let cache = Cache::open(folder.path()).unwrap();
    let hour = Duration::from_hours(1);
    let age = |path: &std::path::Path, hours: u32| {
        let file = std::fs::File::options().append(true).open(path).unwrap();
        file.set_modified(SystemTime::now() - hour * hours).unwrap();
    };
    for (i, kind) in [Kind::Mask, Kind::Labels, Kind::Image].into_iter().enumerate() {
        cache.put(&key(kind), &sample(kind), &provenance()).unwrap();
        age(&cache.path_of(&key(kind)).unwrap(), 10 - i as u32);
    }
    cache.get(&key(Kind::Mask)).unwrap();
    let left_behind = cache.path_of(&key(Kind::Mask)).unwrap().with_file_name(".ivd-unfinished-abc");
    let writer = std::fs::File::create(&left_behind).unwrap();
    writer.lock().unwrap();
    let entries = cache.entries().unwrap();
    assert_eq!(entries.len(), 3);
    assert_eq!(entries[0].info.as_ref().unwrap().kind, Kind::Mask, "used last");
    let keep = entries[0].bytes;
    cache.prune(keep).unwrap();
    assert!(left_behind.exists(), "another process is still writing it");
    assert!(cache.get(&key(Kind::Mask)).is_some());
    assert!(cache.get(&key(Kind::Labels)).is_none() && cache.get(&key(Kind::Image)).is_none());
    drop(writer);
    cache.clear().unwrap();
    assert!(!left_behind.exists() && cache.entries().unwrap().is_empty());
}

#[test]
fn the_first_entry_that_is_put_clears_what_killed_processes_left_anywhere() {
    let folder = tempfile::tempdir().unwrap();
    let elsewhere = Cache::open(folder.path()).unwrap().folder().unwrap().join("zz");
    std::fs::create_dir(&elsewhere).unwrap();
    let (left_behind, foreign) = (elsewhere.join(".ivd-unfinished-abc"), elsewhere.join("mine"));
    for file in [&left_behind, &foreign] {
        std::fs::write(file, b"half").unwrap();
    }
    let cache = Cache::open(folder.path()).unwrap();
    assert!(cache.get(&key(Kind::Mask)).is_none() && left_behind.exists(), "a look removes nothing");
    cache.put(&key(Kind::Mask), &sample(Kind::Mask), &provenance()).unwrap();
    assert!(!left_behind.exists() && foreign.exists());
}

#[test]
fn a_disabled_cache_keeps_nothing() {
    let cache = Cache::disabled();
    assert!(!cache.is_enabled());
    assert_eq!(cache.put(&key(Kind::Mask), &sample(Kind::Mask), &provenance()).unwrap(), None);
    assert!(cache.get(&key(Kind::Mask)).is_none() && cache.entries().unwrap().is_empty());
    assert_eq!(cache.path_of(&key(Kind::Mask)), None);
}

#[test]
fn many_writers_and_readers_of_one_entry_see_it_whole() {
    let folder = tempfile::tempdir().unwrap();
    let key = key(Kind::Lattice);
    std::thread::scope(|scope| {
        for revision in 0..4 {
            let folder = folder.path();
            scope.spawn(move || {
                let cache = Cache::open(folder).unwrap();
                for round in 0..20 {
                    let metrics = json!({"revision": revision, "round": round});
                    cache.put_with_metrics(&key, &sample(Kind::Lattice), &provenance(), &metrics).unwrap();
                    assert!(!matches!(cache.lookup(&key), Lookup::Unusable(_)));
                }
            });
        }
    });
}
