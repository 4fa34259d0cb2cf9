//! The program's contract: data on stdout, talk on stderr, exit codes, nothing half-written.
#![allow(clippy::unwrap_used, reason = "a test fails where it can't go on")]

use serde_json::Value;

use crate::call::{ivd, json, on_adapter, refused};

#[test]
fn single_stages_chain_through_files_from_phantom_to_picture() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    json(at, &["phantom", "sphere", "--size", "40", "-o", "v.ivd", "--truth", "truth.nrrd"]);
    let segment = json(at, &["segment", "v.ivd", "-o", "labels.ivd", "--method", "kmvs", "--k", "2"]);
    assert_eq!(segment["metrics"]["k"], 2);
    assert_eq!(segment["metrics"]["classes"].as_array().unwrap().len(), 2);
    json(at, &["boundary", "v.ivd", "--labels", "labels.ivd", "--class", "densest", "-o", "mask.ivd"]);
    let words = [
        "lattice",
        "v.ivd",
        "--labels",
        "labels.ivd",
        "--mask",
        "mask.ivd",
        "--iso",
        "boundary",
        "-o",
        "lattice.ivd",
    ];
    let lattice = json(at, &words);
    assert_eq!(lattice["metrics"]["boundary_edges"], 0);
    assert_eq!(lattice["metrics"]["euler"], 2);
    let refined =
        json(at, &["refine", "lattice.ivd", "-o", "refined.ivd", "--method", "collapse", "--level", "1"]);
    assert_eq!(refined["metrics"]["subset"], true);
    json(at, &["octree", "refined.ivd", "-o", "octree.ivd"]);
    let handle = "pick=34,20,20;move=3,0,0;radius=14";
    let motion =
        json(at, &["deform", "refined.ivd", "--handle", handle, "--solver", "ring", "-o", "motion.ivd"]);
    assert!((motion["metrics"]["max_displacement_mm"].as_f64().unwrap() - 3.0).abs() < 1e-9);
    let map =
        json(at, &["map", "refined.ivd", "octree.ivd", "motion.ivd", "-o", "d.ivd", "--method", "octree"]);
    assert_eq!(map["metrics"]["folds"], 0);
    assert!(map["metrics"]["min_det_j"].as_f64().unwrap() > 0.0);
    json(at, &["warp", "v.ivd", "d.ivd", "-o", "deformed.ivd"]);
    json(at, &["warp", "labels.ivd", "d.ivd", "-o", "deformed-labels.ivd"]);
    json(at, &["atf", "v.ivd", "labels.ivd", "-o", "t.ivd"]);
    let words = [
        "render",
        "v.ivd",
        "--transfer",
        "t.ivd",
        "--displacement",
        "d.ivd",
        "--size",
        "64x48",
        "-o",
        "p.png",
    ];
    json(at, &words);
    assert_eq!(&std::fs::read(at.join("p.png")).unwrap()[1..4], b"PNG");
    for name in ["x.nii.gz", "x.nrrd", "x.mha", "x.vti", "x.tif"] {
        json(at, &["export", "deformed.ivd", "-o", name]);
    }
    for name in ["l.ply", "l.obj", "l.stl", "l.glb", "l.vtp", "l.json"] {
        json(at, &["export", "refined.ivd", "-o", name]);
    }
    json(at, &["export", "d.ivd", "-o", "field.nrrd"]);
    let same = json(at, &["compare", "deformed.ivd", "x.nii.gz"]);
    assert_eq!(same["max"], 0.0, "an exported volume is the volume");
    let info = json(at, &["info", "labels.ivd"]);
    assert_eq!(info["kind"], "labels");
    assert_eq!(info["content"]["classes"].as_array().unwrap().len(), 2);
}

#[test]
fn a_gpu_that_is_not_there_is_an_error_where_it_is_asked_for_and_nothing_where_it_is_not() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    let words = ["phantom", "sphere", "--size", "24", "-o", "v.ivd"];
    for asked in [&["--backend", "gpu"][..], &["--require-gpu"], &["--backend", "auto", "--require-gpu"]] {
        let (code, text) = refused(at, &[&words[..], asked].concat());
        assert!(
            code == 6
                && text.contains(if asked.contains(&"--require-gpu") {
                    "--require-gpu"
                } else {
                    "--backend gpu"
                }),
            "{code} {text}"
        );
        assert!(text.contains("the CPU does the work") && text.contains("IVD_ADAPTER"), "{text}");
    }
    let (code, text) = refused(at, &[&words[..], &["--backend", "cpu", "--require-gpu"]].concat());
    assert!(code == 2 && text.contains("contradict"), "{code} {text}");
    assert_eq!(json(at, &words)["backend"], "cpu");
    assert_eq!(json(at, &["info", "v.ivd"])["provenance"]["backend"], "cpu");
    let doctor = json(at, &["doctor"]);
    assert!(doctor["adapter"].is_null() && doctor["switched_off"][0]["what"] == "gpu", "{doctor}");
}

#[test]
fn a_picture_by_the_gpu_is_the_processors_and_recorded_as_what_it_is() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    let there = on_adapter(at, &["doctor", "--json"]);
    let there: Value = serde_json::from_slice(&there.stdout).unwrap();
    let expected = std::env::var("IVD_EXPECT_ADAPTER").ok();
    if there["adapter"].is_null() {
        assert!(expected.is_none(), "an adapter is expected: {there}");
        eprintln!("skipped: {}", there["switched_off"][0]["why"]);
        return;
    }
    json(at, &["phantom", "sphere", "--size", "40", "-o", "v.ivd"]);
    let picture = ["render", "v.ivd", "--mode", "iso", "--iso", "100", "--size", "120", "--no-skip"];
    let with = |words: &[&str]| -> Value {
        let output = on_adapter(at, &[&picture[..], words, &["--json", "--cache", "cache"]].concat());
        assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
        serde_json::from_slice(&output.stdout).unwrap()
    };
    let plain = with(&["-o", "cpu.ivd"]);
    assert_eq!((&plain["backend"], &plain["kernels"]["render/cast"]), (&"cpu".into(), &"cpu".into()));
    // One is no stand-in for the other, whatever the cache holds.
    let device = with(&["--backend", "gpu", "-o", "gpu.ivd"]);
    assert_eq!((&device["backend"], &device["kernels"]["render/cast"]), (&"gpu".into(), &"gpu".into()));
    assert_eq!(with(&["--require-gpu", "-o", "again.ivd"])["cached"], true);
    assert_eq!(with(&["-o", "cpu.ivd"])["cached"], true);
    assert_eq!(json(at, &["info", "gpu.ivd"])["provenance"]["backend"], "gpu");
    let apart = json(at, &["compare", "cpu.ivd", "gpu.ivd"]);
    assert!(apart["max"].as_f64().unwrap() <= 1.0, "{apart}");
    // What only the processor knows is its own where a GPU may help, and an error where it must.
    let ends = ["--mode", "dvr", "--transfer", "t.ivd", "--classification", "pre-integrated"];
    json(at, &["segment", "v.ivd", "--method", "kmvs", "--k", "2", "-o", "l.ivd"]);
    json(at, &["atf", "v.ivd", "l.ivd", "-o", "t.ivd"]);
    let words =
        [&["render", "v.ivd"], &ends[..], &["--size", "64", "-o", "p.png", "--backend", "gpu"]].concat();
    let output = on_adapter(at, &words);
    let told = String::from_utf8_lossy(&output.stderr).into_owned();
    assert!(output.status.success() && told.contains("pre-integrated"), "{told}");
    let output = on_adapter(at, &[&words[..], &["--require-gpu"]].concat());
    let told = String::from_utf8_lossy(&output.stderr).into_owned();
    assert!(output.status.code() == Some(6) && told.contains("render/cast"), "{told}");
}

#[test]
fn a_volume_file_serves_as_well_as_an_artefact() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    json(at, &["phantom", "torus", "--size", "32", "-o", "v.ivd"]);
    json(at, &["export", "v.ivd", "-o", "v.nrrd"]);
    let a = json(at, &["lattice", "v.ivd", "--iso", "127.5", "-o", "a.ivd"]);
    let b = json(at, &["lattice", "v.nrrd", "--iso", "127.5", "-o", "b.ivd"]);
    assert_eq!(a["metrics"], b["metrics"]);
    assert_eq!(a["metrics"]["euler"], 0, "a torus");
}

#[test]
fn every_kind_of_failure_has_its_code_and_names_thing_and_remedy() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    std::fs::write(
        at.join("junk.nrrd"),
        b"NRRD0004\ndimension: 3\nsizes: 2 2 2\nencoding: raw\ntype: elephant\n\n",
    )
    .unwrap();
    std::fs::write(at.join("scene.toml"), "schema = 1\n[imput]\n").unwrap();
    json(at, &["phantom", "sphere", "--size", "24", "-o", "v.ivd"]);
    json(at, &["lattice", "v.ivd", "--iso", "127.5", "-o", "l.ivd"]);

    let (code, text) = refused(at, &["segment"]);
    assert_eq!(code, 2, "{text}");
    let (code, text) = refused(at, &["pipeline", "scene.toml"]);
    assert!(code == 2 && text.contains("imput") && text.contains("input"), "{code} {text}");
    let (code, text) = refused(at, &["import", "junk.nrrd", "-o", "x.ivd"]);
    assert!(code == 3 && text.contains("junk.nrrd") && text.contains("type"), "{code} {text}");
    let (code, text) = refused(at, &["refine", "v.ivd", "--level", "1", "-o", "x.ivd"]);
    assert!(code == 2 && text.contains("volume"), "{code} {text}");
    let (code, text) =
        refused(at, &["phantom", "sphere", "--size", "600", "--memory-limit", "10M", "-o", "x.ivd"]);
    assert!(code == 4 && text.contains("memory"), "{code} {text}");
    let (code, text) = refused(at, &["doctor", "--require-gpu"]);
    assert!(code == 6 && text.contains("GPU"), "{code} {text}");
    let (code, text) = refused(at, &["doctor", "--backend", "gpu", "--require-gpu"]);
    assert!(code == 6 && text.contains("--require-gpu"), "{code} {text}");
    let (code, _) = refused(at, &["phantom", "sphere", "--size", "24", "-o", "no/such/folder/x.ivd"]);
    assert_eq!(code, 7);
    let (code, text) =
        refused(at, &["deform", "l.ivd", "--handle", "pick=500,0,0;move=1,0,0;radius=5", "-o", "x.ivd"]);
    assert!(code == 2 && text.contains("mm"), "{code} {text}");
    assert!(!at.join("x.ivd").exists(), "a failure leaves no output");
}

#[test]
fn a_flipped_byte_in_an_artefact_is_an_input_error_and_not_a_result() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    json(at, &["phantom", "sphere", "--size", "16", "-o", "v.ivd"]);
    let whole = std::fs::read(at.join("v.ivd")).unwrap();
    for place in (0..whole.len()).step_by(whole.len() / 40) {
        let mut bytes = whole.clone();
        bytes[place] ^= 1;
        std::fs::write(at.join("bad.ivd"), bytes).unwrap();
        let (code, text) = refused(at, &["lattice", "bad.ivd", "--iso", "127.5", "-o", "x.ivd"]);
        assert!(code == 3 && text.contains("bad.ivd"), "byte {place}: {code} {text}");
    }
}

#[test]
fn the_same_slices_in_another_order_are_another_volume_to_the_cache() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    // By name s10 comes before s2; stacked it comes after it.
    for (name, files) in [("one", ["s1", "s10", "s2"]), ("two", ["s1", "s2", "s3"])] {
        std::fs::create_dir(at.join(name)).unwrap();
        for (file, value) in files.iter().zip([10_u8, 20, 30]) {
            std::fs::write(at.join(name).join(file), [value; 16]).unwrap();
        }
    }
    let import = |name: &str, to: &str| {
        let raw = ["--raw-dims", "4,4,3", "--raw-type", "u8"];
        let words: Vec<&str> = [&["import", name, "-o", to, "--cache", "kept"], &raw[..]].concat();
        json(at, &words)
    };
    let (one, two) = (import("one", "one.ivd"), import("two", "two.ivd"));
    assert_eq!(two["cached"], false);
    assert_ne!(one["output"]["hash"], two["output"]["hash"]);
    assert_eq!(import("two", "again.ivd")["cached"], true);
}

#[test]
fn an_output_whose_data_file_was_emptied_is_written_again() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    let scene = "schema = 1\n[input]\nphantom = \"sphere\"\nsize = 24\n[segment]\nk = 2\n[output]\nlabels = \"l.mhd\"\n";
    std::fs::write(at.join("scene.toml"), scene).unwrap();
    json(at, &["pipeline", "scene.toml", "--out", "out"]);
    let data = at.join("out/l.mhd.raw");
    let whole = std::fs::read(&data).unwrap();
    std::fs::write(&data, b"").unwrap();
    let again = json(at, &["pipeline", "scene.toml", "--out", "out"]);
    assert_eq!(again["outputs"][0]["written"], true);
    assert_eq!(std::fs::read(&data).unwrap(), whole);
}

#[test]
fn labels_of_another_volume_are_refused_and_usage_errors_are_json_too() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    json(at, &["phantom", "sphere", "--size", "16", "-o", "small.ivd"]);
    json(at, &["phantom", "sphere", "--size", "24", "-o", "large.ivd"]);
    json(at, &["segment", "large.ivd", "--k", "2", "-o", "labels.ivd"]);
    let words = [
        "lattice",
        "small.ivd",
        "--labels",
        "labels.ivd",
        "--class",
        "2",
        "--iso",
        "boundary",
        "-o",
        "x.ivd",
    ];
    let (code, text) = refused(at, &words);
    assert!(code == 2 && text.contains("grid"), "{code} {text}");
    let part = json(at, &["boundary", "large.ivd", "--seed", "12,12,12", "-o", "part.ivd"]);
    assert!(
        part["metrics"]["voxels"].as_u64().unwrap() > 0,
        "a part without labels is split off by two classes"
    );
    let output = ivd(at, &["segment", "small.ivd", "--bogus", "--json"]);
    let object: Value = serde_json::from_slice(&output.stdout).unwrap();
    assert_eq!((output.status.code(), &object["error"]["exit_code"]), (Some(2), &Value::from(2)));
    let (code, text) = refused(at, &["export", "small.ivd", "-o", "x.foo"]);
    assert!(code == 2 && text.contains("nii"), "{code} {text}");
}

#[test]
fn help_schema_completions_and_doctor_speak_on_stdout() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    assert!(json(at, &["schema"])["properties"]["deform"].is_object());
    assert!(json(at, &["doctor"])["threads"].as_u64().unwrap() >= 1);
    let completions = ivd(at, &["completions", "bash"]);
    assert!(String::from_utf8(completions.stdout).unwrap().contains("pipeline"));
    let help = ivd(at, &["--help"]);
    assert!(help.status.success() && help.stderr.is_empty());
    assert_eq!(json(at, &["cache", "show"])["entries"].as_array().unwrap().len(), 0);
}

#[test]
fn parameters_come_from_a_file_where_a_command_has_a_section_and_are_refused_elsewhere() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    json(at, &["phantom", "sphere", "--size", "24", "-o", "v.ivd"]);
    json(at, &["segment", "v.ivd", "--k", "2", "-o", "labels.ivd"]);
    json(at, &["lattice", "v.ivd", "--iso", "127.5", "-o", "l.ivd"]);
    let params = |text: &str| std::fs::write(at.join("p.toml"), text).unwrap();
    let of = |object: &Value, keys: &str| keys.split('.').fold(object.clone(), |o, key| o[key].clone());

    params("min_opacity = 0.125\nsize_exponent = 0.5\nsoftness = 0.0\n");
    let atf = json(at, &["atf", "v.ivd", "labels.ivd", "-o", "t.ivd", "--params", "p.toml"]);
    assert_eq!(of(&atf, "params.min_opacity"), 0.125);
    assert_eq!(of(&atf, "params.softness"), 0.0);
    params("leaf_size = 8\n");
    let octree = json(at, &["octree", "l.ivd", "-o", "o.ivd", "--params", "p.toml"]);
    assert_eq!(of(&octree, "params.leaf_size"), 8);
    params("above = 100.0\n");
    let part = json(at, &["boundary", "v.ivd", "-o", "m.ivd", "--params", "p.toml"]);
    assert_eq!(of(&part, "params.above"), 100.0);
    let part = json(at, &["boundary", "v.ivd", "--above", "90", "-o", "m.ivd", "--params", "p.toml"]);
    assert_eq!(of(&part, "params.above"), 90.0, "what is typed wins");
    let part = json(at, &["boundary", "v.ivd", "--above", "90", "--keep-holes", "-o", "m.ivd"]);
    assert_eq!(of(&part, "params.fill_holes"), false, "the old name says the opposite");
    params("mode = \"iso\"\niso = 100.0\nsize = [8, 8]\n");
    let picture = json(at, &["render", "v.ivd", "-o", "p.png", "--params", "p.toml"]);
    assert_eq!(of(&picture, "params.iso"), 100.0, "a default gives way to the file");
    let (code, text) =
        refused(at, &["render", "v.ivd", "-o", "p.png", "--params", "p.toml", "--mode", "mip"]);
    assert!(code == 2 && text.contains("iso: mip doesn't read it; it belongs to mode iso"), "{code} {text}");
    params("mode = \"iso\"\nsize = [8, 8]\n");
    let picture = json(at, &["render", "v.ivd", "-o", "p.png", "--params", "p.toml", "--mode", "mip"]);
    assert_eq!(picture["params"]["mode"], "mip", "what is typed wins");
    params("leaf_sise = 8\n");
    let (code, text) = refused(at, &["octree", "l.ivd", "-o", "x.ivd", "--params", "p.toml"]);
    assert!(code == 2 && text.contains("leaf_sise") && text.contains("p.toml"), "{code} {text}");

    std::fs::write(at.join("scene.toml"), "schema = 1\n[input]\nphantom = \"sphere\"\n[output]\n").unwrap();
    let without: [&[&str]; 10] = [
        &["demo", "--out", "out"],
        &["pipeline", "scene.toml", "--out", "out"],
        &["import", "v.ivd", "-o", "x.ivd"],
        &["phantom", "sphere", "-o", "x.ivd"],
        &["export", "v.ivd", "-o", "x.nrrd"],
        &["info", "v.ivd"],
        &["compare", "v.ivd", "v.ivd"],
        &["doctor"],
        &["schema"],
        &["cache", "show"],
    ];
    for words in without {
        let (code, text) = refused(at, &[words, &["--params", "p.toml"]].concat());
        assert!(
            code == 2 && text.contains("--params p.toml") && text.contains("--set"),
            "{words:?}: {code} {text}"
        );
    }
    assert!(!at.join("out").exists() && !at.join("x.ivd").exists() && !at.join("x.nrrd").exists());
}

#[test]
fn a_missing_input_file_has_one_exit_code_in_every_command() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    json(at, &["phantom", "sphere", "--size", "24", "-o", "v.ivd"]);
    json(at, &["segment", "v.ivd", "--k", "2", "-o", "labels.ivd"]);
    json(at, &["lattice", "v.ivd", "--iso", "127.5", "-o", "l.ivd"]);
    json(at, &["octree", "l.ivd", "-o", "o.ivd"]);
    let scene =
        |input: &str| format!("schema = 1\n[input]\nfile = \"{input}\"\n[output]\nlabels = \"l.nrrd\"\n");
    std::fs::write(at.join("scene.toml"), scene("gone")).unwrap();
    std::fs::write(at.join("good.toml"), scene("v.ivd")).unwrap();
    let handle = "vertex=1;move=1,0,0;radius=5";
    let missing: [&[&str]; 28] = [
        &["import", "gone", "-o", "x.ivd"],
        &["import", "gone", "-o", "x.ivd", "--raw-dims", "2,2,2", "--raw-type", "u8"],
        &["segment", "gone", "-o", "x.ivd"],
        &["segment", "v.ivd", "--mask", "gone", "-o", "x.ivd"],
        &["segment", "v.ivd", "--params", "gone", "-o", "x.ivd"],
        &["atf", "gone", "labels.ivd", "-o", "x.ivd"],
        &["atf", "v.ivd", "gone", "-o", "x.ivd"],
        &["boundary", "gone", "-o", "x.ivd"],
        &["boundary", "v.ivd", "--labels", "gone", "-o", "x.ivd"],
        &["lattice", "gone", "--iso", "1", "-o", "x.ivd"],
        &["lattice", "v.ivd", "--mask", "gone", "-o", "x.ivd"],
        &["refine", "gone", "-o", "x.ivd"],
        &["octree", "gone", "-o", "x.ivd"],
        &["deform", "gone", "--handle", handle, "-o", "x.ivd"],
        &["deform", "l.ivd", "--labels", "gone", "--handle", handle, "-o", "x.ivd"],
        &["map", "gone", "o.ivd", "o.ivd", "-o", "x.ivd"],
        &["map", "l.ivd", "gone", "o.ivd", "-o", "x.ivd"],
        &["map", "l.ivd", "o.ivd", "gone", "-o", "x.ivd"],
        &["warp", "gone", "v.ivd", "-o", "x.ivd"],
        &["warp", "v.ivd", "gone", "-o", "x.ivd"],
        &["render", "gone", "-o", "x.png"],
        &["render", "v.ivd", "--transfer", "gone", "-o", "x.png"],
        &["export", "gone", "-o", "x.nrrd"],
        &["info", "gone"],
        &["compare", "gone", "v.ivd"],
        &["compare", "v.ivd", "gone"],
        &["pipeline", "gone"],
        &["pipeline", "scene.toml"],
    ];
    for words in missing {
        let (code, text) = refused(at, words);
        assert!(code == 7 && text.contains("gone"), "{words:?}: {code} {text}");
    }
    let (code, text) = refused(at, &["pipeline", "good.toml", "--input", "gone"]);
    assert!(code == 7 && text.contains("gone"), "{code} {text}");
}
