//! What a reader of a folder may see while files in it are replaced.
#![allow(clippy::unwrap_used, reason = "what builds a test's files may fail it")]

use std::fs::{self, File};
use std::io::{self, Seek, SeekFrom, Write};
use std::path::{Path, PathBuf};
use std::time::{Duration, SystemTime};

use ivd_fs::{is_unfinished, remove_abandoned, replace, sweep};

fn put(path: &Path, bytes: &[u8]) -> io::Result<bool> {
    replace(path, |_, error| error, |to| to.write_all(bytes))
}

fn names(folder: &Path) -> Vec<String> {
    let mut names: Vec<_> =
        folder.read_dir().unwrap().map(|e| e.unwrap().file_name().into_string().unwrap()).collect();
    names.sort();
    names
}

fn unfinished(folder: &Path) -> PathBuf {
    let file = folder.join(".ivd-unfinished-abc");
    fs::write(&file, b"half").unwrap();
    file
}

#[test]
fn the_same_bytes_leave_the_file_alone_and_others_replace_it() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.bin");
    assert!(put(&path, b"one").unwrap());
    let then = SystemTime::now() - Duration::from_hours(5);
    File::options().append(true).open(&path).unwrap().set_modified(then).unwrap();
    let before = fs::metadata(&path).unwrap().modified().unwrap();
    assert!(!put(&path, b"one").unwrap());
    assert_eq!(fs::metadata(&path).unwrap().modified().unwrap(), before);
    for bytes in [b"two".to_vec(), vec![], b"longer".to_vec(), vec![7; 1_000_000]] {
        assert!(put(&path, &bytes).unwrap());
        assert!(!put(&path, &bytes).unwrap());
        assert_eq!(fs::read(&path).unwrap(), bytes);
    }
    let mut last = vec![7; 1_000_000];
    last[999_999] = 8;
    assert!(put(&path, &last).unwrap(), "the last byte differs");
    assert_eq!(names(folder.path()), ["a.bin"]);
}

#[test]
fn content_may_go_back_to_what_it_wrote() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.bin");
    let content = |to: &mut ivd_fs::Sink| {
        to.write_all(b"0000 and the rest")?;
        to.seek(SeekFrom::Start(0))?;
        to.write_all(b"1234")
    };
    assert!(replace(&path, |_, error| error, content).unwrap());
    assert_eq!(fs::read(&path).unwrap(), b"1234 and the rest");
}

#[test]
fn a_failure_leaves_the_old_file_and_no_litter_and_names_what_was_tried() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.bin");
    put(&path, b"old").unwrap();
    let failing = |to: &mut ivd_fs::Sink| {
        to.write_all(b"ne").unwrap();
        Err("enough")
    };
    assert_eq!(replace(&path, |_, _| "the system", failing), Err("enough"));
    assert_eq!(fs::read(&path).unwrap(), b"old");
    let tried = |path: &Path| replace(path, |what, _| what, |_| Ok(())).unwrap_err();
    let missing = folder.path().join("missing");
    let said = replace(&missing.join("a.bin"), |what, e| format!("{what}: {e}"), |_| Ok(())).unwrap_err();
    assert_eq!(said, format!("create it: there is no folder {}", missing.display()));
    fs::create_dir(folder.path().join("folder")).unwrap();
    assert_eq!(tried(&folder.path().join("folder")), "replace");
    assert_eq!(names(folder.path()), ["a.bin", "folder"]);
}

#[cfg(unix)]
#[test]
fn a_new_file_has_the_mode_of_any_new_file_and_a_replaced_one_keeps_its_own() {
    use std::os::unix::fs::PermissionsExt;
    let folder = tempfile::tempdir().unwrap();
    let (path, plain) = (folder.path().join("a.bin"), folder.path().join("plain"));
    let mode = |path: &Path| fs::metadata(path).unwrap().permissions().mode() & 0o777;
    put(&path, b"one").unwrap();
    File::create(&plain).unwrap();
    assert_eq!(mode(&path), mode(&plain));
    for kept in [0o600, 0o664, 0o640] {
        fs::set_permissions(&path, fs::Permissions::from_mode(kept)).unwrap();
        assert!(put(&path, &kept.to_le_bytes()).unwrap());
        assert_eq!(mode(&path), kept);
    }
    assert_eq!(
        put(Path::new("/dev/null"), b"x").unwrap_err().to_string(),
        "it is no regular file",
        "a device is no file to be replaced"
    );
}

#[cfg(unix)]
#[test]
fn what_replaces_a_private_file_is_private_while_it_is_written() {
    use std::os::unix::fs::PermissionsExt;
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.bin");
    let mode = |path: &Path| fs::metadata(path).unwrap().permissions().mode() & 0o777;
    // The mode of the unfinished file while `bytes` are written.
    let during = |bytes: &[u8]| {
        let mut seen = vec![];
        let content = |to: &mut ivd_fs::Sink| {
            to.write_all(bytes)?;
            to.flush()?;
            let all = names(folder.path()).into_iter().map(|name| folder.path().join(name));
            seen = all.filter(|path| is_unfinished(path)).map(|path| mode(&path)).collect();
            Ok(())
        };
        replace(&path, |_, error: io::Error| error, content).unwrap();
        seen
    };
    let new = during(b"new");
    assert_eq!(new, [mode(&path)], "nothing was private before");
    for kept in [0o600, 0o400, 0o644] {
        fs::set_permissions(&path, fs::Permissions::from_mode(kept)).unwrap();
        assert_eq!(during(&kept.to_le_bytes()), [0o600]);
        assert_eq!(mode(&path), kept);
    }
}

#[cfg(unix)]
#[test]
fn a_link_stays_and_the_file_that_it_leads_to_is_replaced() {
    use std::os::unix::fs::symlink;
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name);
    fs::create_dir(at("far")).unwrap();
    put(&at("far/a.bin"), b"old").unwrap();
    symlink("far/a.bin", at("link")).unwrap();
    symlink("link", at("second")).unwrap();
    unfinished(&at("far"));
    for (link, bytes) in [("link", b"one"), ("second", b"two")] {
        assert!(put(&at(link), bytes).unwrap());
        assert!(!put(&at(link), bytes).unwrap());
        assert!(at(link).is_symlink());
        assert_eq!(fs::read(at("far/a.bin")).unwrap(), bytes);
    }
    assert_eq!(names(&at("far")), ["a.bin"], "it was written there, and swept");

    symlink("nowhere", at("dangling")).unwrap();
    put(&at("dangling"), b"new").unwrap();
    assert!(!at("dangling").is_symlink() && !at("nowhere").exists());
    symlink("far", at("folder")).unwrap();
    assert_eq!(put(&at("folder"), b"x").unwrap_err().to_string(), "it is no regular file");
    assert_eq!(names(folder.path()), ["dangling", "far", "folder", "link", "second"]);
}

#[test]
fn what_a_killed_process_left_goes_at_the_next_write_and_what_a_living_one_writes_stays() {
    let folder = tempfile::tempdir().unwrap();
    unfinished(folder.path());
    put(&folder.path().join("a.bin"), b"one").unwrap();
    assert_eq!(names(folder.path()), ["a.bin"]);

    let left = unfinished(folder.path());
    put(&folder.path().join("a.bin"), b"one").unwrap();
    assert!(!left.exists(), "a write that changes nothing sweeps, too");

    let living = unfinished(folder.path());
    let writer = File::options().append(true).open(&living).unwrap();
    writer.lock().unwrap();
    assert!(!remove_abandoned(&living));
    put(&folder.path().join("a.bin"), b"two").unwrap();
    assert_eq!(names(folder.path()), [".ivd-unfinished-abc", "a.bin"]);
    drop(writer);
    sweep(folder.path());
    assert_eq!(names(folder.path()), ["a.bin"]);
}

/// The superuser may write to a read-only file: as such this test doesn't tell how the file was opened.
#[test]
fn what_was_left_read_only_goes_unless_its_writer_lives() {
    let folder = tempfile::tempdir().unwrap();
    let left = unfinished(folder.path());
    let writer = File::options().append(true).open(&left).unwrap();
    writer.lock().unwrap();
    let mut permissions = fs::metadata(&left).unwrap().permissions();
    permissions.set_readonly(true);
    fs::set_permissions(&left, permissions).unwrap();
    sweep(folder.path());
    assert_eq!(names(folder.path()).len(), 1);
    drop(writer);
    sweep(folder.path());
    assert!(names(folder.path()).is_empty());
}

#[test]
fn nothing_but_unfinished_files_is_swept() {
    let folder = tempfile::tempdir().unwrap();
    for name in ["ivd-unfinished-a", ".ivd-unfinished", "a.ivd", ".hidden"] {
        fs::write(folder.path().join(name), b"mine").unwrap();
        assert!(!is_unfinished(&folder.path().join(name)) && !remove_abandoned(&folder.path().join(name)));
    }
    fs::create_dir(folder.path().join(".ivd-unfinished-folder")).unwrap();
    sweep(folder.path());
    assert_eq!(names(folder.path()).len(), 5);
    sweep(&folder.path().join("missing"));
}

#[test]
fn writers_of_one_folder_never_sweep_each_other_and_readers_see_whole_files() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.bin");
    put(&path, &vec![0; 100_000]).unwrap();
    std::thread::scope(|scope| {
        for writer in 1..=4_u8 {
            let path = &path;
            scope.spawn(move || {
                for round in 0..50 {
                    assert!(put(path, &vec![writer * 50 + round; 100_000]).is_ok());
                    let seen = fs::read(path).unwrap();
                    assert!(seen.len() == 100_000 && seen.iter().all(|&b| b == seen[0]));
                }
            });
        }
    });
    assert_eq!(names(folder.path()), ["a.bin"]);
}
