//! What a person is told of things that may not be meant, with what to do: handles at the border of a scan, specks.
#![allow(clippy::unwrap_used, reason = "a test fails where it can't go on")]

use std::path::Path;

use crate::call::{ivd, json};

/// What a command that works says on stderr.
fn noted(at: &Path, words: &[&str]) -> String {
    let output = ivd(at, words);
    let told = String::from_utf8(output.stderr).unwrap();
    assert!(output.status.success(), "{words:?}: {told}");
    told
}

#[test]
fn a_handle_at_the_border_of_the_scan_is_told_with_what_happens_there() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    // The surface of a gyroid meets every face of its volume.
    json(at, &["phantom", "gyroid", "--size", "40", "-o", "v.ivd"]);
    json(at, &["lattice", "v.ivd", "--iso", "128", "-o", "l.ivd"]);
    let deform = |handle: &str| noted(at, &["deform", "l.ivd", "--handle", handle, "-o", "m.ivd"]);
    let told = deform("pick=20,20,-0.5;move=0,0,1;radius=6");
    assert!(told.contains("handle.0 lies ") && told.contains("voxels from the border of the scan"), "{told}");
    assert!(told.contains("is cut off") && told.contains("black"), "{told}");
    assert!(!deform("pick=20,20,20;move=0,0,1;radius=6").contains("border"));
    // A ball well inside, whose front is moved out.
    json(at, &["phantom", "sphere", "--size", "40", "-o", "v.ivd"]);
    json(at, &["lattice", "v.ivd", "--iso", "128", "-o", "l.ivd"]);
    assert!(!deform("pick=20,33,20;move=0,2,0;radius=12").contains("border"));
    let told = deform("pick=20,33,20;move=0,9,0;radius=30");
    assert!(told.contains("handle.0 is moved ") && told.contains("voxels beyond the border"), "{told}");
}

#[test]
fn specks_that_a_refinement_stops_at_are_one_thing_to_know_in_a_report() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    let scene = "schema = 1\n[input]\nphantom = \"sphere\"\nsize = 40\nnoise = 0.2\n[lattice]\niso = 100.0\n[refine]\nlevel = 3\n[output]\n\
        lattice = \"l.ply\"\nreport = true\n";
    std::fs::write(at.join("scene.toml"), scene).unwrap();
    let told = noted(at, &["pipeline", "scene.toml", "--out", "out"]);
    assert!(told.contains("specks: closed parts of four vertices"), "{told}");
    assert!(told.contains("min_part of lattice leaves small parts out"), "{told}");
    let page = std::fs::read_to_string(at.join("out/report.html")).unwrap();
    assert_eq!(page.matches("▲ Look at:</b>").count(), 1);
    assert!(page.contains("reached: most of what is left are specks"));
    assert!(page.contains("▲ Look at:</b> lattice and refine:") && page.contains("leaves them out</li>"));
}
