//! What isn't a regular file: devices, folders, pipes, links that lead nowhere or in circles.

use std::os::unix::fs::symlink;
use std::path::Path;
use std::process::{Command, Stdio};
use std::time::{Duration, Instant};

use crate::hostile::good;

/// Runs the program; kills it where it waits for a pipe that nobody writes. Gives code and stderr.
fn run(at: &Path, words: &[&str]) -> (Option<i32>, String) {
    let mut child = Command::new(env!("CARGO_BIN_EXE_ivd"))
        .args(words)
        .args(["-q", "--threads", "1"])
        .current_dir(at)
        .stdin(Stdio::null())
        .stderr(Stdio::piped())
        .spawn()
        .unwrap();
    let start = Instant::now();
    while child.try_wait().unwrap().is_none() {
        if start.elapsed() > Duration::from_secs(20) {
            child.kill().unwrap();
        }
        std::thread::sleep(Duration::from_millis(2));
    }
    let output = child.wait_with_output().unwrap();
    (output.status.code(), String::from_utf8_lossy(&output.stderr).into_owned())
}

pub(crate) fn check() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    std::fs::create_dir(at.join("empty")).unwrap();
    std::fs::create_dir(at.join("text")).unwrap();
    std::fs::write(at.join("text/readme"), "no slice").unwrap();
    symlink("loop", at.join("loop")).unwrap();
    symlink("nowhere", at.join("dangling")).unwrap();
    symlink("/dev/zero", at.join("zero")).unwrap();
    assert!(Command::new("mkfifo").arg(at.join("pipe")).status().unwrap().success());
    std::fs::write(at.join("v.nrrd"), good::file("nrrd")).unwrap();
    assert_eq!(run(at, &["import", "v.nrrd", "-o", "good.ivd"]).0, Some(0));

    let targets = ["empty", "text", "loop", "dangling", "zero", "pipe", "/dev/null", "/dev/full"];
    for target in targets {
        // A folder without slices is an input of the wrong kind; the others can't be read.
        let code = if ["empty", "text"].contains(&target) { 3 } else { 7 };
        let said = run(at, &["import", target, "-o", "out.ivd"]);
        assert!(said.0 == Some(code) && said.1.contains(target), "import {target}: {said:?}");
        // A pipe may well be meant where a text is read, as in `--params <(…)`; so may an empty text.
        let text = if ["pipe", "/dev/null"].contains(&target) { "empty" } else { target };
        for words in [
            vec!["lattice", target, "--iso", "1", "-o", "out.ivd"],
            vec!["refine", target, "--level", "1", "-o", "out.ivd"],
            vec!["segment", "good.ivd", "--mask", target, "-o", "out.ivd"],
            vec!["pipeline", text],
            vec!["segment", "good.ivd", "--params", text, "-o", "out.ivd"],
            vec!["info", target],
        ] {
            let said = run(at, &words);
            let refused = said.0.is_some_and(|code| [2, 3, 7].contains(&code));
            assert!(refused && (said.1.contains(target) || said.1.contains(text)), "{words:?}: {said:?}");
        }
    }
    for name in ["/dev/zero", "pipe", "empty", "loop", "nowhere", "."] {
        for (file, header) in [
            (
                "h.nhdr",
                format!(
                    "NRRD0004\ntype: uchar\ndimension: 3\nsizes: 2 2 2\nencoding: raw\ndata file: {name}\n"
                ),
            ),
            (
                "h.mhd",
                format!("NDims = 3\nDimSize = 2 2 2\nElementType = MET_UCHAR\nElementDataFile = {name}\n"),
            ),
        ] {
            std::fs::write(at.join(file), header).unwrap();
            let said = run(at, &["import", file, "-o", "out.ivd"]);
            // One that isn't there is the header's fault, the others are what can't be read.
            let wanted = if name == "nowhere" { 3 } else { 7 };
            assert!(said.0 == Some(wanted) && said.1.contains(name), "{file} that names {name}: {said:?}");
        }
    }
    // A header that names itself holds no voxels.
    std::fs::write(
        at.join("self.nhdr"),
        "NRRD0004\ntype: uchar\ndimension: 3\nsizes: 99 9 9\nencoding: raw\ndata file: self.nhdr\n",
    )
    .unwrap();
    assert_eq!(run(at, &["import", "self.nhdr", "-o", "out.ivd"]).0, Some(3));
    assert!(!at.join("out.ivd").exists());
}
