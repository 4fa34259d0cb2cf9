//! Labels and masks of other programs, on grids of their own, beside a scan.
#![allow(clippy::unwrap_used, reason = "a test fails where it can't go on")]

use std::path::Path;

use crate::call::{json, refused};

/// Voxels of one byte on a cube of `n` voxels, whose x axis runs to the patient's left, from the far face on.
fn write_flipped(at: &Path, n: usize, voxels: &[u8]) {
    let flipped = voxels.chunks(n).flat_map(|row| row.iter().rev().copied());
    let head = format!(
        "NRRD0004\ntype: uchar\ndimension: 3\nspace: right-anterior-superior\nsizes: {n} {n} {n}\n\
         space directions: (-1,0,0) (0,1,0) (0,0,1)\nspace origin: ({},0,0)\nencoding: raw\n\n",
        n - 1
    );
    std::fs::write(at, [head.into_bytes(), flipped.collect()].concat()).unwrap();
}

#[test]
fn labels_of_a_flipped_file_are_refused_with_the_command_that_puts_them_onto_the_scan() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    json(at, &["phantom", "head", "--size", "32", "-o", "v.ivd", "--truth", "t.ivd"]);
    json(at, &["export", "t.ivd", "-o", "t.nii.gz"]);
    json(at, &["export", "t.ivd", "-o", "t.raw"]);
    write_flipped(&at.join("flipped.nrrd"), 32, &std::fs::read(at.join("t.raw")).unwrap());
    let hash = |words: &[&str]| json(at, words)["output"]["hash"].clone();
    let own = hash(&["import", "t.nii.gz", "--labels", "-o", "own.ivd"]);
    let flipped = hash(&["import", "flipped.nrrd", "--labels", "-o", "flipped.ivd"]);
    assert_ne!(own, flipped);
    for words in [
        ["lattice", "v.ivd", "--labels", "flipped.ivd", "--class", "2", "-o", "x.ivd"],
        ["boundary", "v.ivd", "--labels", "flipped.nrrd", "--class", "2", "-o", "x.ivd"],
    ] {
        let (code, told) = refused(at, &words);
        assert!(code == 2 && told.contains("axes differ"), "{told}");
        assert!(told.contains("`ivd import LABELS --labels --like VOLUME`"), "{told}");
    }
    // As the message says: the same labels, from the file and from the artefact of it.
    let put = json(at, &["import", "flipped.nrrd", "--labels", "--like", "t.nii.gz", "-o", "put.ivd"]);
    assert_eq!(put["output"]["hash"], own);
    // On a scan they are told of what it holds there.
    let put = json(at, &["import", "flipped.nrrd", "--labels", "--like", "v.ivd", "-o", "put.ivd"]);
    assert_eq!(json(at, &["compare", "put.ivd", "own.ivd"])["differing"], 0);
    let [told, truth] =
        ["put.ivd", "t.ivd"].map(|file| json(at, &["info", file])["content"]["classes"].clone());
    for told in told.as_array().unwrap() {
        let truth = truth.as_array().unwrap().iter().find(|truth| truth["id"] == told["id"]).unwrap();
        let [told, truth] = [told, truth].map(|class| class["mean"].as_f64().unwrap());
        assert!((told - truth).abs() < 1e-9 * truth.abs(), "{told} {truth}");
    }
    assert_eq!(put["metrics"]["voxels_without_source"], 0);
    assert_eq!(put["metrics"]["voxels_left_out"], 0);
    assert_eq!(hash(&["import", "flipped.ivd", "--like", "t.ivd", "-o", "put.ivd"]), own);
    json(at, &["lattice", "v.ivd", "--labels", "put.ivd", "--class", "2", "-o", "l.ivd"]);
    // A mask of it is the same voxels.
    json(at, &["import", "flipped.nrrd", "--mask", "--like", "v.ivd", "-o", "mask.ivd"]);
    let dice = json(at, &["compare", "mask.ivd", "t.nii.gz"])["dice"].clone();
    assert_eq!(dice, 1.0);
}

#[test]
fn what_has_no_counterpart_is_counted_and_what_is_no_label_is_refused() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    json(at, &["phantom", "sphere", "--size", "24", "-o", "v.ivd", "--truth", "t.ivd"]);
    json(at, &["phantom", "sphere", "--size", "16", "-o", "small.ivd"]);
    let put = json(at, &["import", "t.ivd", "--like", "small.ivd", "-o", "put.ivd"]);
    let classes = json(at, &["info", "put.ivd"])["content"]["classes"].as_array().unwrap().clone();
    let labelled = classes.iter().filter(|class| class["id"] != 0);
    let filled: u64 = labelled.map(|class| class["voxels"].as_u64().unwrap()).sum();
    let figures = &put["metrics"];
    assert_eq!(figures["voxels_filled"], filled);
    let left_out = figures["voxels_left_out"].as_u64().unwrap();
    assert!(left_out > 0 && put["remark"].as_str().unwrap().contains(&format!("{left_out} voxels")), "{put}");
    json(at, &["export", "t.ivd", "-o", "t.nii.gz"]);
    for (words, says) in [
        (
            &["import", "v.ivd", "--like", "small.ivd", "-o", "x.ivd"][..],
            "--labels, --mask or --displacement",
        ),
        (&["import", "t.nii.gz", "--like", "small.ivd", "-o", "x.ivd"], "--labels, --mask or --displacement"),
        (&["import", "t.ivd", "-o", "x.ivd"], "`ivd export t.ivd"),
        (&["import", "t.ivd", "--mask", "-o", "x.ivd"], "holds labels"),
        (&["import", "t.ivd", "--like", "small.ivd", "--axes", "RAS", "-o", "x.ivd"], "--axes"),
    ] {
        let (code, told) = refused(at, words);
        assert!(code == 2 && told.contains(says), "{told}");
    }
}

#[test]
fn a_file_of_another_program_is_compared_as_what_lies_beside_it_is() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    json(at, &["phantom", "head", "--size", "24", "-o", "v.ivd", "--truth", "t.ivd"]);
    json(at, &["export", "t.ivd", "-o", "t.nii.gz"]);
    for words in [["t.ivd", "t.nii.gz"], ["t.nii.gz", "t.ivd"]] {
        let told = json(at, &["compare", words[0], words[1]]);
        assert_eq!((&told["ari"], &told["differing"]), (&1.0.into(), &0.into()), "{told}");
        // What the truth knows of its classes no file of another program does.
        assert_eq!(told["differs_in"], serde_json::json!(["figures of classes"]));
    }
    json(at, &["lattice", "v.ivd", "--iso", "60", "-o", "l.ivd"]);
    json(at, &["export", "l.ivd", "-o", "l.ply"]);
    json(at, &["phantom", "head", "--size", "16", "-o", "small.ivd", "--truth", "small.nii.gz"]);
    for (a, b, says) in [
        ("l.ivd", "l.ply", "`ivd lattice VOLUME --mesh l.ply"),
        ("t.ivd", "v.ivd", "`ivd import VOLUME --labels`"),
        ("t.ivd", "small.nii.gz", "`ivd import LABELS --labels --like VOLUME`"),
    ] {
        let (code, told) = refused(at, &["compare", a, b]);
        assert!(code == 2 && told.contains(says), "{told}");
    }
}

#[test]
fn a_scene_takes_a_volume_that_is_an_artefact_already() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    json(at, &["phantom", "sphere", "--size", "24", "-o", "v.ivd", "--truth", "t.ivd"]);
    let run = |file: &str, more: &str| {
        let scene = format!(
            "schema = 1\n[input]\nfile = \"{file}\"\n{more}[lattice]\niso = 128.0\n[output]\nlattice = \"l.ply\"\n"
        );
        std::fs::write(at.join("scene.toml"), scene).unwrap();
        ["pipeline", "scene.toml", "--out", "out"]
    };
    let told = json(at, &run("v.ivd", ""));
    let hash = |stage: &str| {
        let found = told["stages"].as_array().unwrap().iter().find(|record| record["stage"] == stage);
        found.unwrap()["output"]["hash"].clone()
    };
    let alone = json(at, &["lattice", "v.ivd", "--iso", "128", "-o", "l.ivd"]);
    assert_eq!(hash("lattice"), alone["output"]["hash"]);
    assert_eq!(hash("import"), json(at, &["info", "v.ivd"])["hash"]);
    for (file, more, says) in [("t.ivd", "", "kind labels"), ("v.ivd", "axes = \"RAS\"\n", "leave out")] {
        let (code, told) = refused(at, &run(file, more));
        assert!(code == 2 && told.contains(says), "{told}");
    }
}

/// Masks of another program whose axes run the other way, beside the MR that they were drawn on: the mean there is known.
#[test]
fn a_brain_drawn_in_another_program_lies_on_its_scan() {
    let data = Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/../../../shared/data/mri_head_seg3d"));
    if !data.is_dir() {
        return;
    }
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    let file = |name: &str| data.join(name).to_str().unwrap().to_owned();
    for (mask, wanted) in [("Brain.nrrd", 199.0), ("Skull.nrrd", 120.0)] {
        json(at, &["import", &file(mask), "--mask", "--like", &file("MR.nii.gz"), "-o", "mask.ivd"]);
        json(at, &["export", "mask.ivd", "-o", "mask.raw"]);
        json(at, &["import", &file("MR.nii.gz"), "-o", "mr.ivd"]);
        json(at, &["export", "mr.ivd", "-o", "mr.raw"]);
        let read = |name: &str| std::fs::read(at.join(name)).unwrap();
        // Real values, four bytes each.
        let values = read("mr.raw")
            .as_chunks::<4>()
            .0
            .iter()
            .map(|v| f64::from(f32::from_le_bytes(*v)))
            .collect::<Vec<f64>>();
        let both = values.into_iter().zip(read("mask.raw"));
        let inside: Vec<f64> = both.filter(|(_, inside)| *inside != 0).map(|(value, _)| value).collect();
        let mean = inside.iter().sum::<f64>() / inside.len() as f64;
        assert!((mean - wanted).abs() < 1.0, "{mask}: {mean}");
    }
}
