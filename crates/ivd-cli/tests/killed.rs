//! A program that is killed or suspended in the middle of a write.
#![cfg(unix)]
#![allow(clippy::unwrap_used, reason = "a test fails where it can't go on")]

use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};

/// Times that a write is looked for before the test gives up.
const TRIES: usize = 20;

fn phantom(at: &Path, shape: &str, size: &str, to: &str) -> Command {
    let mut command = Command::new(env!("CARGO_BIN_EXE_ivd"));
    command.current_dir(at).args(["phantom", shape, "--size", size, "-o", to, "-q"]).stdout(Stdio::null());
    command
}

fn write(at: &Path, shape: &str, size: &str, to: &str) -> Vec<u8> {
    assert!(phantom(at, shape, size, to).status().unwrap().success());
    std::fs::read(at.join(to)).unwrap()
}

fn unfinished(at: &Path) -> Option<PathBuf> {
    let files = at.read_dir().unwrap().map(|entry| entry.unwrap().path());
    files.into_iter().find(|p| p.file_name().unwrap().to_string_lossy().starts_with(".ivd-unfinished-"))
}

/// Starts to write a sphere over the file and signals the program while an unfinished file lies there; the program and
/// that file, if it was still there then.
fn interrupted(at: &Path, signal: &str) -> (Child, Option<PathBuf>) {
    let mut child = phantom(at, "sphere", "200", "v.ivd").spawn().unwrap();
    while unfinished(at).is_none() && child.try_wait().unwrap().is_none() {}
    let id = child.id().to_string();
    let _ = Command::new("kill").args([signal, &id]).stderr(Stdio::null()).status().unwrap();
    if signal == "-KILL" {
        child.wait().unwrap();
    }
    (child, unfinished(at))
}

#[test]
fn a_killed_program_leaves_the_old_file_or_the_new_one_and_the_next_write_tidies_up() {
    let (folder, elsewhere) = (tempfile::tempdir().unwrap(), tempfile::tempdir().unwrap());
    let at = folder.path();
    let new = write(elsewhere.path(), "sphere", "200", "v.ivd");
    for _ in 0..TRIES {
        let old = write(at, "torus", "200", "v.ivd");
        assert_ne!(old, new);
        let (_, left) = interrupted(at, "-KILL");
        let found = std::fs::read(at.join("v.ivd")).unwrap();
        assert!(found == old || found == new, "half a file");
        if left.is_some() {
            assert!(found == old);
            write(at, "sphere", "8", "other.ivd");
            assert_eq!(unfinished(at), None, "the next write into the folder removes it");
            return;
        }
    }
    panic!("no write was caught in {TRIES} tries");
}

#[test]
fn what_a_suspended_program_writes_is_left_alone() {
    let (folder, elsewhere) = (tempfile::tempdir().unwrap(), tempfile::tempdir().unwrap());
    let at = folder.path();
    let new = write(elsewhere.path(), "sphere", "200", "v.ivd");
    for _ in 0..TRIES {
        write(at, "torus", "200", "v.ivd");
        let (mut child, left) = interrupted(at, "-STOP");
        if left.is_some() {
            write(at, "sphere", "8", "other.ivd");
            assert_eq!(unfinished(at), left, "its writer lives");
        }
        let id = child.id().to_string();
        let _ = Command::new("kill").args(["-CONT", &id]).stderr(Stdio::null()).status().unwrap();
        assert!(child.wait().unwrap().success());
        assert!(std::fs::read(at.join("v.ivd")).unwrap() == new);
        if left.is_some() {
            assert_eq!(unfinished(at), None);
            return;
        }
    }
    panic!("no write was caught in {TRIES} tries");
}
