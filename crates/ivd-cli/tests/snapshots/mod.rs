//! What the program says, held against the files in fixtures/snapshots: every help page, the schema, a JSON object of every
//! command, what wrong usage and failures end with; and every command of the README runs.
//!
//! `IVD_SNAPSHOTS=write cargo test -p ivd-cli snapshots` writes the files anew. Their difference is then what a change
//! changes for those who use the program, and is read as such.
#![allow(clippy::unwrap_used, reason = "a test fails where it can't go on")]

mod failures;
mod help;
mod masks;
mod names;
mod objects;
#[cfg(unix)]
mod readme;

use std::collections::BTreeSet;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};

/// What a run of the program ended with.
struct Said {
    code: i32,
    out: String,
    err: String,
}

/// The program in a folder, away from any terminal, with a cache of its own. Help is as wide as clap makes it where there is no
/// terminal to ask.
fn program(folder: &Path) -> Command {
    let mut command = Command::new(env!("CARGO_BIN_EXE_ivd"));
    command.current_dir(folder).stdin(Stdio::null()).env("IVD_CACHE", folder.join("cache"));
    // As on a machine without a graphics processor.
    command.env("IVD_ADAPTER", "none");
    for name in ["COLUMNS", "LINES", "IVD_LOG", "RAYON_NUM_THREADS"] {
        command.env_remove(name);
    }
    command
}

fn ivd(folder: &Path, words: &[String]) -> Said {
    let output = program(folder).args(words).output().unwrap();
    let text = |bytes| String::from_utf8(bytes).unwrap();
    Said { code: output.status.code().unwrap(), out: text(output.stdout), err: text(output.stderr) }
}

/// Runs what a test needs before what it is about.
fn prepare(folder: &Path, lines: &[&str]) {
    for line in lines {
        let said = ivd(folder, &words(line));
        assert_eq!(said.code, 0, "{line}: {}", said.err);
    }
}

/// The words of a command line; '…' keeps spaces.
fn words(line: &str) -> Vec<String> {
    let mut words: Vec<String> = Vec::new();
    let (mut quoted, mut inside) = (false, false);
    for c in line.chars() {
        if c == ' ' && !quoted {
            inside = false;
            continue;
        }
        if !inside {
            words.push(String::new());
            inside = true;
        }
        if c == '\'' {
            quoted = !quoted;
        } else {
            words.last_mut().unwrap().push(c);
        }
    }
    words
}

/// The project's root folder.
fn root() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../..").canonicalize().unwrap()
}

fn snapshots() -> PathBuf {
    root().join("fixtures/snapshots")
}

/// Whether the files are to be written anew.
fn writing() -> bool {
    std::env::var_os("IVD_SNAPSHOTS").is_some_and(|word| word == "write")
}

/// Holds a text against its file; tells every line that differs.
fn check(name: &str, now: &str) {
    let file = snapshots().join(name);
    if writing() {
        std::fs::create_dir_all(file.parent().unwrap()).unwrap();
        std::fs::write(file, now).unwrap();
        return;
    }
    let kept = std::fs::read_to_string(&file);
    let kept = kept.unwrap_or_else(|e| panic!("{}: {e}; IVD_SNAPSHOTS=write makes it", file.display()));
    assert!(kept == now, "{name} (- kept, + now):\n{}", difference(&kept, now));
}

/// The lines between the first and the last that differ.
fn difference(kept: &str, now: &str) -> String {
    let (kept, now): (Vec<&str>, Vec<&str>) = (kept.split('\n').collect(), now.split('\n').collect());
    let same = |pairs: &mut dyn Iterator<Item = (&&str, &&str)>| pairs.take_while(|(a, b)| a == b).count();
    let first = same(&mut kept.iter().zip(&now));
    let shorter = kept.len().min(now.len());
    let last = same(&mut kept.iter().rev().zip(now.iter().rev())).min(shorter - first);
    let removed = kept[first..kept.len() - last].iter().map(|line| format!("- {line}"));
    let added = now[first..now.len() - last].iter().map(|line| format!("+ {line}"));
    removed.chain(added).collect::<Vec<_>>().join("\n")
}

/// Holds the files of a folder against what there should be one for: a file that nothing is compared with proves nothing.
fn check_files(folder: &str, expected: &BTreeSet<String>) {
    let there = std::fs::read_dir(snapshots().join(folder)).unwrap();
    let there: BTreeSet<String> = there.map(|f| f.unwrap().file_name().into_string().unwrap()).collect();
    assert_eq!(&there, expected, "fixtures/snapshots/{folder}");
}

#[test]
fn a_difference_shows_its_lines_and_no_others() {
    assert_eq!(difference("a\nb\nc\n", "a\nx\ny\nc\n"), "- b\n+ x\n+ y");
    assert_eq!(difference("a\na\n", "a\n"), "- a");
    assert_eq!(words("one 'two three;x' --f 'a=1,2'"), ["one", "two three;x", "--f", "a=1,2"]);
}
