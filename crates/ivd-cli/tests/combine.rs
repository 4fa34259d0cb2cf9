//! `ivd combine` and `ivd clip` through the program: numbers, records, exit codes.
#![allow(clippy::unwrap_used, reason = "a test fails where it can't go on")]

use std::path::Path;

use crate::call::{self, json};

/// What a refusal says; its exit code must be the one given.
fn refused(folder: &Path, code: i32, words: &[&str]) -> String {
    let (found, said) = call::refused(folder, words);
    assert_eq!(found, code, "{words:?}: {said}");
    assert!(!folder.join("x.ivd").exists(), "{words:?} left a file behind");
    said
}

/// A row of `u8` voxels a millimetre apart as a raw file, imported as a volume or as labels.
fn row(at: &Path, name: &str, values: &[u8], labels: bool) {
    std::fs::write(at.join("row.raw"), values).unwrap();
    let (dims, output) = (format!("{},1,1", values.len()), format!("{name}.ivd"));
    let mut words = vec!["import", "row.raw", "--raw-dims", &dims, "--raw-type", "u8", "-o", &output];
    if labels {
        words.push("--labels");
    }
    json(at, &words);
}

/// The voxels of an artefact on a row.
fn voxels(at: &Path, name: &str) -> Vec<u8> {
    let (artefact, file) = (format!("{name}.ivd"), format!("{name}.raw"));
    json(at, &["export", &artefact, "-o", &file]);
    std::fs::read(at.join(file)).unwrap()
}

#[test]
fn volumes_combine_by_opacity_and_tell_what_changed() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    row(at, "a", &[0, 100, 200, 50, 7], false);
    row(at, "b", &[10, 0, 40, 5, 0], false);
    let windows = ["--window", "0,200", "--window", "0,40"];
    for (op, expected) in [
        ("union", [10, 100, 200, 50, 7]),
        ("intersection", [0, 0, 200, 25, 0]),
        ("difference", [0, 100, 0, 50, 7]),
    ] {
        let words = [&["combine", "a.ivd", "b.ivd", "--op", op, "-o", "c.ivd"], &windows[..]].concat();
        let told = json(at, &words);
        assert_eq!(voxels(at, "c"), expected, "{op}");
        let changed = expected.iter().zip([0, 100, 200, 50, 7]).filter(|(is, was)| **is != *was).count();
        let metrics = serde_json::json!({
            "voxels_changed": changed, "voxels_total": 5, "bricks_visited": 1, "bricks_total": 1,
        });
        assert_eq!((&told["stage"], &told["metrics"]), (&"combine".into(), &metrics), "{told}");
        assert_eq!(told["params"]["op"], op);
        assert_eq!(told["params"]["windows"], serde_json::json!([[0.0, 200.0], [0.0, 40.0]]));
        assert_eq!((&told["revision"], &told["output"]["kind"]), (&2.into(), &"volume".into()));
        let inputs = told["inputs"].as_object().unwrap();
        assert_eq!(inputs.keys().collect::<Vec<_>>(), ["a", "b"]);
        // The plain twin.
        let mut plain = json(at, &[&words[..], &["--no-skip"]].concat());
        assert_eq!(plain["output"].take(), told["output"]);
    }
    // Three of them, a raw file's cousin among them: what is left of a is where neither is.
    json(at, &["export", "b.ivd", "-o", "b.nrrd"]);
    let three =
        ["combine", "a.ivd", "b.nrrd", "b.ivd", "--op", "difference", "--window", "0,200", "-o", "d.ivd"];
    json(at, &three);
    assert_eq!(voxels(at, "d"), [0, 100, 160, 50, 7]);
}

#[test]
fn labels_and_masks_combine_as_sets() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    row(at, "a", &[0, 1, 1, 2], true);
    row(at, "b", &[3, 0, 3, 3], true);
    for (op, expected) in
        [("union", [3, 1, 1, 2]), ("intersection", [0, 0, 1, 2]), ("difference", [0, 1, 0, 0])]
    {
        let told = json(at, &["combine", "a.ivd", "b.ivd", "--op", op, "-o", "c.ivd"]);
        assert_eq!(told["output"]["kind"], "labels");
        json(at, &["export", "c.ivd", "-o", "c.raw"]);
        let bytes = std::fs::read(at.join("c.raw")).unwrap();
        let ids: Vec<u16> = bytes.chunks(bytes.len() / 4).map(|id| u16::from(id[0])).collect();
        assert_eq!(ids, expected, "{op}");
    }
    let said =
        refused(at, 2, &["combine", "a.ivd", "b.ivd", "--op", "union", "--window", "0,1", "-o", "x.ivd"]);
    assert!(said.contains("labels are there or not"), "{said}");
    // The parts above two values: one within the other.
    json(at, &["phantom", "sphere", "--size", "24", "-o", "v.ivd"]);
    let part = |above: &str, name: &str| {
        json(at, &["boundary", "v.ivd", "--above", above, "-o", name])["metrics"]["voxels"].as_u64().unwrap()
    };
    let (wide, narrow) = (part("60", "wide.ivd"), part("190", "narrow.ivd"));
    assert!(wide > narrow && narrow > 0, "{wide} {narrow}");
    let shell = json(at, &["combine", "wide.ivd", "narrow.ivd", "--op", "difference", "-o", "shell.ivd"]);
    assert_eq!(shell["metrics"]["voxels_changed"], narrow);
    let again = json(at, &["combine", "shell.ivd", "narrow.ivd", "--op", "union", "-o", "again.ivd"]);
    assert_eq!(again["metrics"]["voxels_changed"], narrow);
    let same = json(at, &["compare", "wide.ivd", "again.ivd"]);
    assert_eq!(same["dice"].as_f64(), Some(1.0), "{same}");
    json(at, &["lattice", "v.ivd", "--iso", "60", "-o", "l.ivd"]);
    let said = refused(at, 2, &["combine", "v.ivd", "l.ivd", "--op", "union", "-o", "x.ivd"]);
    assert!(said.contains("was given a lattice artefact"), "{said}");
}

/// A ball, and a displacement that shifts most of it.
fn moved(at: &Path) {
    json(at, &["phantom", "sphere", "--size", "32", "-o", "v.ivd"]);
    json(at, &["lattice", "v.ivd", "--iso", "128", "-o", "l.ivd"]);
    json(at, &["octree", "l.ivd", "-o", "o.ivd"]);
    let push = "kind=translate;centre=16,16,16;radius=15;core=0.6;by=0,2,1";
    json(at, &["deform", "l.ivd", "--shape", push, "-o", "m.ivd"]);
    json(at, &["map", "l.ivd", "o.ivd", "m.ivd", "-o", "d.ivd"]);
    json(at, &["warp", "v.ivd", "d.ivd", "-o", "w.ivd"]);
}

#[test]
fn operands_are_read_through_displacements_as_warp_deforms_them() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    moved(at);
    for op in ["union", "difference"] {
        let warped = json(at, &["combine", "v.ivd", "w.ivd", "--op", op, "-o", "one.ivd"]);
        let words = ["combine", "v.ivd", "v.ivd", "--op", op, "--displacement", "2=d.ivd", "-o", "two.ivd"];
        let through = json(at, &words);
        assert_eq!(warped["output"]["hash"], through["output"]["hash"], "{op}");
        assert!(warped["metrics"]["voxels_changed"].as_u64().unwrap() > 0);
        let inputs = through["inputs"].as_object().unwrap();
        assert_eq!(inputs.keys().collect::<Vec<_>>(), ["a", "b", "displacement_b"]);
    }
    let words = ["combine", "v.ivd", "v.ivd", "--op", "union", "-o", "x.ivd", "--displacement"];
    for (given, word) in
        [("3=d.ivd", "there are 2 operands"), ("d.ivd", "N=FILE"), ("1=v.ivd", "displacement_a")]
    {
        let said = refused(at, 2, &[&words[..], &[given]].concat());
        assert!(said.contains(word), "{given}: {said}");
    }
    let twice = [&words[..], &["2=d.ivd", "--displacement", "2=d.ivd"]].concat();
    assert!(refused(at, 2, &twice).contains("has one already"));
}

#[test]
fn a_clip_keeps_one_side_bit_for_bit_and_its_complement_the_other() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    row(at, "a", &[9, 8, 7, 6, 5], false);
    // A raw file's axes are ITK's, so that world x runs against the voxels.
    let plane = "point=-2,0,0;normal=-1,0,0";
    let told = json(at, &["clip", "a.ivd", "--plane", plane, "-o", "c.ivd"]);
    assert_eq!(voxels(at, "c"), [5, 5, 7, 6, 5]);
    let metrics = serde_json::json!({
        "voxels_kept": 3, "voxels_clipped": 2, "voxels_total": 5, "bricks_visited": 1, "bricks_total": 1,
    });
    assert_eq!((&told["stage"], &told["metrics"]), (&"clip".into(), &metrics));
    let planes = serde_json::json!([{ "point": [-2.0, 0.0, 0.0], "normal": [-1.0, 0.0, 0.0] }]);
    assert_eq!(told["params"]["planes"], planes);
    json(at, &["clip", "a.ivd", "--plane", plane, "--invert", "--background", "0", "-o", "i.ivd"]);
    assert_eq!(voxels(at, "i"), [9, 8, 0, 0, 0]);
    let cuboid = "min=-3,-1,-1;max=-1,1,1";
    json(at, &["clip", "a.ivd", "--box", cuboid, "--background", "1", "-o", "b.ivd"]);
    assert_eq!(voxels(at, "b"), [1, 8, 7, 6, 1]);
    row(at, "tag", &[0, 2, 2, 1, 1], true);
    json(at, &["clip", "a.ivd", "--box", cuboid, "--tag", "tag.ivd", "--class", "2", "-o", "t.ivd"]);
    assert_eq!(voxels(at, "t"), [5, 8, 7, 5, 5]);
    let labels = json(at, &["clip", "tag.ivd", "--box", cuboid, "-o", "l.ivd"]);
    assert_eq!((&labels["output"]["kind"], &labels["metrics"]["voxels_kept"]), (&"labels".into(), &3.into()));
    // A box beside it keeps nothing, which is no error.
    let none = json(at, &["clip", "a.ivd", "--box", "min=50,50,50;max=60,60,60", "-o", "n.ivd"]);
    assert_eq!(none["metrics"]["voxels_kept"], 0);
}

#[test]
fn a_clip_at_rest_follows_the_body() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    moved(at);
    let plane = ["--plane", "point=16,16,16;normal=0,1,0", "--background", "0"];
    json(at, &[&["clip", "w.ivd", "--displacement", "d.ivd", "-o", "after.ivd"], &plane[..]].concat());
    json(at, &[&["clip", "v.ivd", "-o", "cut.ivd"], &plane[..]].concat());
    json(at, &["warp", "cut.ivd", "d.ivd", "-o", "before.ivd"]);
    json(at, &[&["clip", "w.ivd", "-o", "still.ivd"], &plane[..]].concat());
    let rms = |other: &str| json(at, &["compare", "after.ivd", other])["rms"].as_f64().unwrap();
    // Of a ball of 255, cut along its middle: a voxel's width of mixed values against two voxels of shift.
    assert!(rms("before.ivd") < 0.6 * rms("still.ivd"), "{} {}", rms("before.ivd"), rms("still.ivd"));
}

#[test]
fn what_is_wrong_is_refused_with_its_exit_code() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    row(at, "a", &[0, 1, 2], false);
    row(at, "constant", &[4, 4, 4], false);
    let combine = |code: i32, words: &[&str]| {
        refused(at, code, &[&["combine", "-o", "x.ivd", "--op", "union"], words].concat())
    };
    assert!(combine(2, &["a.ivd"]).contains("values required"));
    assert!(combine(2, &["a.ivd", "a.ivd", "--window", "1,1"]).contains("lo below hi"));
    assert!(combine(2, &["a.ivd", "a.ivd", "--window", "1"]).contains("low,high"));
    assert!(combine(2, &["a.ivd", "constant.ivd"]).contains("operand 2 holds one value only, 4"));
    assert!(combine(2, &[&["a.ivd"; 9][..], &[]].concat()).contains("a.ivd"));
    assert!(combine(4, &["a.ivd", "a.ivd", "--memory-limit", "2"]).contains("--memory-limit"));
    combine(7, &["a.ivd", "nowhere.ivd"]);
    refused(at, 2, &["combine", "a.ivd", "a.ivd", "--op", "sum", "-o", "x.ivd"]);
    refused(at, 2, &["combine", "a.ivd", "a.ivd", "-o", "x.ivd"]);
    let clip =
        |code: i32, words: &[&str]| refused(at, code, &[&["clip", "a.ivd", "-o", "x.ivd"], words].concat());
    assert!(clip(2, &[]).contains("nothing to clip by"));
    assert!(clip(2, &["--plane", "point=0,0,0;normal=0,0,0"]).contains("length 0"));
    assert!(clip(2, &["--plane", "point=0,0,0"]).contains("`normal` is missing"));
    assert!(clip(2, &["--box", "min=1,0,0;max=0,1,1"]).contains("above max"));
    assert!(clip(2, &["--class", "2"]).contains("--tag"));
    assert!(clip(2, &["--tag", "a.ivd"]).contains("mask or labels"));
    let parameters = at.join("p.toml");
    std::fs::write(&parameters, "op = \"union\"\n").unwrap();
    assert!(clip(2, &["--params", "p.toml"]).contains("reads none"));
}
