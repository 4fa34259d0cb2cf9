//! Calls of the program that several suites make.
#![allow(clippy::unwrap_used, reason = "a test fails where it can't go on")]

use std::path::Path;
use std::process::{Command, Output};

use serde_json::Value;

/// Runs the program in a folder, which holds its cache too, as on a machine without a graphics processor.
pub(crate) fn ivd(folder: &Path, words: &[&str]) -> Output {
    let mut command = Command::new(env!("CARGO_BIN_EXE_ivd"));
    command.current_dir(folder).env("IVD_CACHE", folder.join("cache")).env("IVD_ADAPTER", "none");
    command.args(words).output().unwrap()
}

/// The same on this machine, with whatever graphics processor it has.
pub(crate) fn on_adapter(folder: &Path, words: &[&str]) -> Output {
    let mut command = Command::new(env!("CARGO_BIN_EXE_ivd"));
    command.current_dir(folder).env("IVD_CACHE", folder.join("cache")).args(words).output().unwrap()
}

/// Runs with `--json`; the exit code must be 0 and stdout one object.
pub(crate) fn json(folder: &Path, words: &[&str]) -> Value {
    let output = ivd(folder, &[words, &["--json"]].concat());
    assert!(output.status.success(), "{words:?}: {}", String::from_utf8_lossy(&output.stderr));
    let text = String::from_utf8(output.stdout).unwrap();
    assert_eq!(text.lines().count(), 1, "{words:?}: one object, one line: {text}");
    serde_json::from_str(&text).unwrap_or_else(|e| panic!("{words:?}: {e}"))
}

/// Exit code and stderr of a command that must fail.
pub(crate) fn refused(folder: &Path, words: &[&str]) -> (i32, String) {
    let output = ivd(folder, words);
    assert!(!output.status.success(), "{words:?} was taken");
    (output.status.code().unwrap(), String::from_utf8(output.stderr).unwrap())
}
