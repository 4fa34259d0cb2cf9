//! `ivd segment` by every method, as a script calls it.
#![allow(clippy::unwrap_used, reason = "a test fails where it can't go on")]

use std::path::Path;
use std::process::{Command, Output};

use serde_json::Value;

fn run(at: &Path, args: &[&str]) -> Output {
    let mut command = Command::new(env!("CARGO_BIN_EXE_ivd"));
    command.current_dir(at).args(args).args(["--progress", "never"]).output().unwrap()
}

fn json(at: &Path, args: &[&str]) -> Value {
    let done = run(at, &[args, &["--json"]].concat());
    assert!(done.status.success(), "{args:?}: {}", String::from_utf8_lossy(&done.stderr));
    serde_json::from_slice(&done.stdout).unwrap()
}

fn refused(at: &Path, code: i32, args: &[&str]) -> String {
    let done = run(at, args);
    let told = String::from_utf8_lossy(&done.stderr).into_owned();
    assert_eq!(done.status.code(), Some(code), "{args:?}: {told}");
    told
}

/// A folder with a noisy head of 40³ voxels.
fn head() -> tempfile::TempDir {
    let folder = tempfile::tempdir().unwrap();
    json(folder.path(), &["phantom", "head", "--size", "40", "-o", "head.ivd", "--truth", "truth.ivd"]);
    folder
}

fn hash(record: &Value) -> String {
    record["output"]["hash"].as_str().unwrap().to_owned()
}

const METHODS: [&[&str]; 8] = [
    &["--method", "kmvs"],
    &["--method", "kmvs", "--spatial-weight", "1.5"],
    &["--method", "emvs"],
    &["--method", "emvs", "--smoothing", "0.5"],
    &["--method", "emvs", "--covariance", "diagonal"],
    &["--method", "msvs"],
    &["--method", "msvs+kmvs"],
    &["--method", "hvs"],
];

#[test]
fn every_method_gives_classes_in_the_order_of_their_means() {
    let folder = head();
    let at = folder.path();
    for method in METHODS {
        let record = json(at, &[&["segment", "head.ivd", "-o", "l.ivd"], method].concat());
        let metrics = &record["metrics"];
        let classes = metrics["classes"].as_array().unwrap();
        assert_eq!(metrics["k"].as_u64().unwrap() as usize, classes.len(), "{method:?}");
        assert!(classes.len() >= 2, "{method:?}");
        let means: Vec<f64> = classes.iter().map(|c| c["mean"].as_f64().unwrap()).collect();
        assert!(means.is_sorted(), "{method:?} {means:?}");
        let voxels: u64 = classes.iter().map(|c| c["voxels"].as_u64().unwrap()).sum();
        assert_eq!(voxels, 40 * 40 * 40, "{method:?}");
        for key in ["iterations", "converged", "objective", "visited_fraction"] {
            assert!(!metrics[key].is_null(), "{method:?} tells no {key}");
        }
    }
}

#[test]
fn a_quarter_of_the_memory_gives_the_same_labels() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    json(at, &["phantom", "head", "--size", "64", "-o", "head.ivd"]);
    for method in METHODS {
        let whole = json(at, &[&["segment", "head.ivd", "-o", "l.ivd"], method].concat());
        // The volume has 262,144 bytes.
        let tight = [&["segment", "head.ivd", "-o", "l.ivd", "--memory-limit", "65536"], method].concat();
        assert_eq!(hash(&json(at, &tight)), hash(&whole), "{method:?}");
    }
}

#[test]
fn a_range_and_a_mask_leave_the_rest_without_a_class() {
    let folder = head();
    let at = folder.path();
    json(at, &["segment", "head.ivd", "-o", "two.ivd", "--k", "2"]);
    json(at, &["boundary", "head.ivd", "--labels", "two.ivd", "--class", "densest", "-o", "part.ivd"]);
    for method in METHODS {
        let counted = |args: &[&str]| -> u64 {
            let record = json(at, &[&["segment", "head.ivd", "-o", "l.ivd"], method, args].concat());
            record["metrics"]["classes"]
                .as_array()
                .unwrap()
                .iter()
                .map(|c| c["voxels"].as_u64().unwrap())
                .sum()
        };
        let masked = counted(&["--mask", "part.ivd"]);
        assert!(masked > 0 && masked < 64_000, "{method:?} {masked}");
        let ranged = counted(&["--range", "40,160"]);
        assert!(ranged > 0 && ranged < 64_000, "{method:?} {ranged}");
    }
}

#[test]
fn a_tree_is_cut_again_without_its_volume() {
    let folder = head();
    let at = folder.path();
    let method = ["--method", "hvs", "--k", "5"];
    let straight = json(at, &[&["segment", "head.ivd", "-o", "a.ivd"][..], &method].concat());
    let kept =
        json(at, &[&["segment", "head.ivd", "-o", "b.ivd", "--tree-out", "tree.ivd"][..], &method].concat());
    let cut = json(at, &["segment", "--from-tree", "tree.ivd", "--k", "5", "-o", "c.ivd"]);
    assert_eq!([hash(&straight), hash(&kept)], [hash(&cut), hash(&cut)]);
    assert!(straight["metrics"]["regions"].as_u64().unwrap() > 5);
    assert_eq!(cut["metrics"]["regions"], straight["metrics"]["regions"]);
    let finer = json(at, &["segment", "--from-tree", "tree.ivd", "--k", "9", "-o", "d.ivd"]);
    assert_eq!(finer["metrics"]["k"], 9);
    let level = json(at, &["segment", "--from-tree", "tree.ivd", "--level", "4", "-o", "e.ivd"]);
    assert!(level["metrics"]["k"].as_u64().unwrap() >= 1);
    let info = json(at, &["info", "tree.ivd"]);
    assert_eq!(info["kind"], "tree");
}

#[test]
fn what_shaped_a_tree_is_refused_beside_it() {
    let folder = head();
    let at = folder.path();
    json(at, &["segment", "head.ivd", "-o", "a.ivd", "--method", "hvs", "--tree-out", "tree.ivd"]);
    let cut = |args: &[&'static str]| [&["segment", "--from-tree", "tree.ivd", "-o", "l.ivd"], args].concat();
    for option in [
        ["--linkage", "single"],
        ["--linkage", "ward"],
        ["--range", "40,160"],
        ["--alpha", "3"],
        ["--max-regions", "500"],
    ] {
        let told = refused(at, 2, &cut(&option));
        assert!(
            told.contains(option[0]) && told.contains("leave it out") && told.contains("--tree-out"),
            "{told}"
        );
    }
    assert!(refused(at, 2, &cut(&["--method", "kmvs"])).contains("--method: \"kmvs\""));
    assert!(refused(at, 2, &cut(&["--smoothing", "1"])).contains("smoothing"));
    std::fs::write(at.join("tree.toml"), "method = \"hvs\"\nmax_regions = 500\n").unwrap();
    let told = refused(at, 2, &cut(&["--params", "tree.toml"]));
    assert!(told.contains("--params tree.toml: max_regions"), "{told}");
    assert!(!at.join("l.ivd").exists());
    json(at, &cut(&["--method", "hvs", "--ranking", "height"]));
}

#[test]
fn posterior_maps_are_kept_on_request_and_sum_to_one() {
    let folder = head();
    let at = folder.path();
    let args =
        ["segment", "head.ivd", "-o", "l.ivd", "--method", "emvs", "--k", "3", "--posteriors-out", "p"];
    json(at, &args);
    let maps: Vec<_> = (1..=3)
        .map(|i| match ivd_artefact::read(at.join(format!("p-{i}.ivd"))).unwrap().artefact {
            ivd_artefact::Artefact::Volume(volume) => volume,
            other => panic!("{:?}", other.kind()),
        })
        .collect();
    for i in 0..maps[0].voxels().len() {
        let sum: f64 = maps.iter().map(|m| m.voxels().get(i)).sum();
        assert!((sum - 1.0).abs() < 1e-5, "voxel {i}: {sum}");
    }
}

#[test]
fn small_parts_are_given_to_their_surroundings_and_ids_can_follow_sizes() {
    let folder = head();
    let at = folder.path();
    let plain = json(at, &["segment", "head.ivd", "-o", "a.ivd", "--k", "4"]);
    let tidy = json(at, &["segment", "head.ivd", "-o", "b.ivd", "--k", "4", "--smallest", "50"]);
    assert_ne!(hash(&plain), hash(&tidy));
    let sized = json(at, &["segment", "head.ivd", "-o", "c.ivd", "--k", "4", "--order", "size"]);
    let mut classes = sized["metrics"]["classes"].as_array().unwrap().clone();
    classes.sort_by_key(|c| c["id"].as_u64());
    let sizes: Vec<u64> = classes.iter().map(|c| c["voxels"].as_u64().unwrap()).collect();
    assert!(sizes.is_sorted_by(|a, b| a >= b), "{sizes:?}");
}

#[test]
fn times_are_told_and_kept_in_no_file() {
    let folder = head();
    let at = folder.path();
    let segment = |to: &str| {
        let with_cache = ["segment", "head.ivd", "-o", to, "--method", "msvs+kmvs", "--cache", "kept"];
        json(at, &with_cache)["metrics"].clone()
    };
    let told = segment("a.ivd");
    assert!(told["msvs_s"].as_f64().unwrap() > 0.0 && told["kmvs_s"].as_f64().unwrap() > 0.0);
    let again = segment("b.ivd");
    let kept = json(at, &["info", "a.ivd"])["metrics"].clone();
    assert_eq!([&kept["k_kept"], &again["k_kept"]], [&told["k_kept"]; 2]);
    for time in ["msvs_s", "kmvs_s"] {
        assert!(kept[time].is_null(), "{time} would make every run's file another one");
        assert!(again[time].is_null(), "{time} of another run, where the cache did the work");
    }
    let file = |name: &str| std::fs::read(at.join(name)).unwrap();
    json(at, &["segment", "head.ivd", "-o", "c.ivd", "--method", "msvs+kmvs"]);
    assert!(file("a.ivd") == file("b.ivd") && file("b.ivd") == file("c.ivd"));
}

#[test]
fn what_does_not_fit_together_is_said() {
    let folder = head();
    let at = folder.path();
    let segment = |args: &[&'static str]| [&["segment", "head.ivd", "-o", "l.ivd"], args].concat();
    assert!(refused(at, 2, &segment(&["--k", "auto"])).contains("is for emvs"));
    assert!(refused(at, 2, &segment(&["--smoothing", "1"])).contains("emvs"));
    assert!(refused(at, 2, &segment(&["--k-min", "3"])).contains("msvs+kmvs"));
    assert!(refused(at, 2, &segment(&["--method", "msvs+kmvs", "--k-min", "0"])).contains("--k-min: 0"));
    assert!(refused(at, 2, &segment(&["--method", "emsv"])).contains("emsv"));
    assert!(refused(at, 2, &segment(&["--tree-out", "t.ivd"])).contains("--method hvs"));
    assert!(refused(at, 2, &segment(&["--posteriors-out", "p"])).contains("--method emvs"));
    assert!(refused(at, 2, &segment(&["--range", "9,1"])).contains("range"));
    assert!(refused(at, 2, &segment(&["--method", "emvs", "--tolerance=-1"])).contains("tolerance"));
    assert!(refused(at, 2, &["segment", "--from-tree", "head.ivd", "-o", "l.ivd"]).contains("volume"));
    refused(at, 2, &["segment", "-o", "l.ivd"]);
    assert!(!at.join("l.ivd").exists() && !at.join("t.ivd").exists());
}

#[test]
fn a_number_of_classes_that_ends_at_its_limit_is_told() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    json(at, &["phantom", "head", "--size", "40", "--noise", "0.03", "-o", "v.ivd"]);
    let found = |most: &str| {
        let words = ["segment", "v.ivd", "--method", "emvs", "--k", "auto", "--k-max", most, "-o", "l.ivd"];
        let told = json(at, &words);
        (told["metrics"]["at_limit"].clone(), told["remark"].as_str().map(str::to_owned))
    };
    let (limited, remark) = found("3");
    assert!(limited == true && remark.unwrap().contains("k_max"));
    let (limited, remark) = found("12");
    assert!(limited == false && remark.is_none_or(|told| !told.contains("k_max")));
}
