//! Every operation on a file of every kind of command fails in turn: afterwards each output is the old file, the new one
//! or none, and the next run gives what it always gives.
#![cfg(all(target_os = "linux", target_env = "gnu", target_arch = "x86_64"))]
#![allow(clippy::unwrap_used, reason = "a test fails where it can't go on")]

mod job;

use std::process::Command;

use ivd_faults::{Fault, run};
use job::{Job, Verdict, words};

const ENOSPC: Fault = Fault::Error(28);
const EIO: Fault = Fault::Error(5);
const EINTR: Fault = Fault::Error(4);

const SCENE: &str = "schema = 1\n[input]\nfile = \"v.nrrd\"\n[segment]\nk = 2\n[lattice]\niso = 127.5\n[refine]\nlevel = 1\n\
    [[deform.handle]]\npick = [10, 6, 6]\nmove = [1, 0, 0]\nradius = 4\n\
    [output]\nlabels = \"l.nii.gz\"\nlattice = \"l.ply\"\nlattice_deformed = \"d.obj\"\nvolume = \"v.mhd\"\n";

/// A sphere as an artefact, and what stages make of it.
fn inputs(job: &Job) {
    for line in [
        "phantom sphere --size 12 -o v.ivd",
        "phantom torus --size 12 -o w.ivd",
        "lattice v.ivd --iso 127.5 -o lattice.ivd",
        "export v.ivd -o v.nrrd",
    ] {
        job.must(&words(line));
    }
    std::fs::write(job.path("scene.toml"), SCENE).unwrap();
}

/// Tries every fault at every operation of the command; the outputs exist before, with other content.
fn try_all(name: &str, old: &str, new: &str, faults: &[Fault]) -> Verdict {
    let job = Job::new(name);
    inputs(&job);
    job.must(&words(old));
    job.try_all(&words(new), faults)
}

#[test]
fn a_stage_replaces_its_output_whole_whatever_fails() {
    let found = try_all(
        "a stage",
        "lattice w.ivd --iso 100 -o out/l.ivd",
        "lattice v.ivd --iso 127.5 -o out/l.ivd",
        &[ENOSPC, EIO, Fault::Kill],
    );
    assert!(found.runs >= 15 && found.untouched > 0 && found.replaced > 0, "{found:?}");
}

#[test]
fn an_export_in_one_file_or_two_is_replaced_file_by_file() {
    for ending in ["nii.gz", "nrrd", "mhd", "vti", "tif"] {
        let found = try_all(
            ending,
            &format!("export w.ivd -o out/x.{ending}"),
            &format!("export v.ivd -o out/x.{ending}"),
            &[ENOSPC, EIO, Fault::Kill],
        );
        assert!(found.runs >= 12, "{found:?}");
    }
    for ending in ["ply", "glb"] {
        let found = try_all(
            ending,
            &format!("export lattice.ivd -o out/x.{ending}"),
            &format!("export lattice.ivd -o out/x.{ending}"),
            &[ENOSPC, Fault::Kill],
        );
        assert!(found.untouched == found.runs, "the same bytes: the file isn't touched: {found:?}");
    }
}

#[test]
fn a_pipeline_goes_on_without_its_cache_and_not_without_its_outputs() {
    let found = try_all(
        "pipeline",
        "pipeline scene.toml --out out --cache off --set segment.k=3 --set lattice.iso=100",
        "pipeline scene.toml --out out --cache cache",
        &[ENOSPC, EIO],
    );
    assert!(found.uncached > 20, "writes of the cache that failed and didn't matter: {found:?}");
    assert!(found.refused > 20 && found.runs > 50, "{found:?}");
}

#[test]
fn a_killed_pipeline_leaves_no_half_file_and_no_poisoned_cache() {
    let found = try_all(
        "killed",
        "pipeline scene.toml --out out --cache off --set segment.k=3 --set lattice.iso=100",
        "pipeline scene.toml --out out --cache cache",
        &[Fault::Kill],
    );
    assert!(found.killed > 50, "{found:?}");
}

#[test]
fn interrupted_and_short_writes_are_tried_again_and_nobody_notices() {
    for new in [
        "lattice v.ivd --iso 127.5 -o out/l.ivd",
        "export v.ivd -o out/x.mhd",
        "pipeline scene.toml --out out --cache cache",
    ] {
        let job = Job::new("interrupted");
        inputs(&job);
        let found = job.try_writes(&words(new), &[Fault::Short, EINTR]);
        assert!(found.runs > 1 && found.replaced == found.runs, "{new}: {found:?}");
    }
}

#[test]
fn a_bench_that_can_not_be_written_leaves_whole_files() {
    let job = Job::new("bench");
    let line = "bench lattice --size 16 --repeats 1 --out out";
    job.must(&words(line));
    let found = job.try_whole(&words(line), &[ENOSPC, EIO, Fault::Kill], &|name, bytes| match name {
        "bench.json" => serde_json::from_slice::<serde_json::Value>(bytes).is_ok(),
        "bench.csv" => bytes.ends_with(b"\n"),
        _ => bytes.ends_with(b"</html>\n"),
    });
    assert!(found.runs >= 30 && found.refused > 0, "{found:?}");
}

/// A program that writes in place must be caught, or this harness proves nothing.
#[test]
fn a_writer_in_place_is_caught() {
    let folder = tempfile::tempdir().unwrap();
    let (source, target) = (folder.path().join("source"), folder.path().join("target"));
    std::fs::write(&source, vec![7; 4096]).unwrap();
    let mut halves = 0;
    for at in 1..12 {
        std::fs::write(&target, vec![1; 4096]).unwrap();
        let mut command = Command::new("dd");
        command.arg(format!("if={}", source.display())).arg(format!("of={}", target.display())).arg("bs=512");
        let outcome = run(&mut command, folder.path(), Some((at, ENOSPC))).unwrap();
        if outcome.operations.len() < at {
            break;
        }
        let found = std::fs::read(&target).unwrap();
        halves += usize::from(found != vec![1; 4096] && found != vec![7; 4096]);
    }
    assert!(halves >= 7, "only {halves} half files");
}

#[test]
fn the_faults_are_those_that_were_asked_for() {
    let job = Job::new("faults");
    job.must(&words("phantom sphere --size 12 -o v.ivd"));
    let seen = job.trace(&words("phantom torus --size 12 -o out/w.ivd"), None);
    let what: Vec<&str> = seen.operations.iter().map(|o| o.what).collect();
    assert_eq!(seen.code, Some(0), "{}", seen.stderr);
    assert!(["create", "write", "sync", "rename"].iter().all(|w| what.contains(w)), "{what:?}");
    let rename = 1 + what.iter().position(|w| *w == "rename").unwrap();
    std::fs::remove_file(job.path("out/w.ivd")).unwrap();
    let denied = job.trace(&words("phantom torus --size 12 -o out/w.ivd"), Some((rename, EIO)));
    assert_eq!(denied.code, Some(7), "{}", denied.stderr);
    assert!(denied.stderr.contains("w.ivd") && !job.path("out/w.ivd").exists(), "{}", denied.stderr);
}
