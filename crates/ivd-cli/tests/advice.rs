//! What a person is told of things that may not be meant, with what to do: picks beside a volume, handles at its border, specks.
#![allow(clippy::unwrap_used, reason = "a test fails where it can't go on")]

use std::path::Path;

use crate::call::{ivd, json, refused};

/// What a command that works says on stderr.
fn noted(at: &Path, words: &[&str]) -> String {
    let output = ivd(at, words);
    let told = String::from_utf8(output.stderr).unwrap();
    assert!(output.status.success(), "{words:?}: {told}");
    told
}

#[test]
fn a_pick_of_a_file_without_a_space_is_told_with_the_signs_that_may_be_meant() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    json(at, &["phantom", "sphere", "--size", "40", "-o", "v.ivd"]);
    json(at, &["export", "v.ivd", "-o", "v.tif"]);
    // Taken for LPS: what lies at voxel (20, 33, 20) is at x = -20, y = -33 in RAS.
    let hint = json(at, &["info", "v.tif"])["content"]["grid"]["hint"].clone();
    assert!(hint.as_str().unwrap().contains("RAS"), "{hint}");
    assert!(json(at, &["info", "v.ivd"])["content"]["grid"].get("hint").is_none());
    json(at, &["lattice", "v.tif", "--iso", "128", "-o", "l.ivd"]);
    for words in [
        &["info", "v.tif", "--at", "20,33,20"][..],
        &["deform", "l.ivd", "--handle", "pick=20,33,20;move=0,1,0;radius=8", "-o", "m.ivd"],
        &["boundary", "v.tif", "--method", "surface", "--seed", "20,33,20", "-o", "m.ivd"],
    ] {
        let (code, told) = refused(at, words);
        assert!(code == 2 && told.contains("did you mean x = -20, y = -33, z = 20?"), "{told}");
        assert!(
            told.contains("the volume spans x -39.5 to 0.5, y -39.5 to 0.5, z -0.5 to 39.5 mm"),
            "{told}"
        );
    }
    json(at, &["deform", "l.ivd", "--handle", "pick=-20,-33,20;move=0,1,0;radius=8", "-o", "m.ivd"]);
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
    assert!(page.contains("as coarse as asked for: most of what is left are specks"));
    assert!(
        page.contains("▲ Look at:</b> lattice and refine:")
            && page.contains("leaves them out (`ivd lattice --min-part")
    );
}

#[test]
fn what_is_left_of_a_raw_file_is_noted_and_what_is_whole_isnt() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    json(at, &["phantom", "sphere", "--size", "24", "-o", "v.ivd"]);
    json(at, &["export", "v.ivd", "-o", "v.raw"]);
    let import = |dims: &str| {
        let words = ["import", "v.raw", "--raw-dims", dims, "--raw-type", "u8", "-o", "r.ivd"];
        noted(at, &words)
    };
    let told = import("24,24,23");
    assert!(told.contains("576 bytes are left over") && told.contains("--raw-dims"), "{told}");
    let told = import("24,24,24");
    assert!(!told.contains("left over"), "{told}");
}

#[test]
fn labels_of_another_program_are_noted_before_their_numbers_are_mixed() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    json(at, &["phantom", "head", "--size", "40", "-o", "v.ivd"]);
    json(at, &["segment", "v.ivd", "--method", "kmvs", "--k", "4", "-o", "l.ivd"]);
    json(at, &["export", "l.ivd", "-o", "l.nii.gz"]);
    let step = "kind=translate;centre=20,20,20;by=2,0,0;core=0.3;radius=9";
    noted(at, &["space", "v.ivd", "--step", step, "-o", "d.ivd"]);
    let note = |file: &str| noted(at, &["warp", file, "d.ivd", "-o", "w.ivd"]);
    assert!(note("l.nii.gz").contains("looks like labels"), "{}", note("l.nii.gz"));
    assert!(!note("v.ivd").contains("looks like labels") && !note("l.ivd").contains("looks like labels"));
}
