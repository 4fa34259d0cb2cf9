//! What someone meets with a first scan of their own: where things are, what was done, and files of other programs.
#![allow(clippy::unwrap_used, reason = "a test fails where it can't go on")]

use std::path::Path;

use serde_json::Value;

use crate::call::{ivd, json};

/// A ball of radius 14 mm about (19.5, 19.5, 19.5), pressed in at the front.
const SCENE: &str = "schema = 1\n[input]\nphantom = \"sphere\"\nsize = 40\n[lattice]\niso = 128.0\n[refine]\nlevel = 1\n\
    [[deform.handle]]\npick = [20.0, 33.0, 20.0]\nmove = [0.0, -2.0, 0.0]\nradius = 12.0\n[output]\nvolume = \"out.nii.gz\"\nreport = true\n";

fn pipeline(at: &Path, scene: &str) -> std::process::Output {
    std::fs::write(at.join("scene.toml"), scene).unwrap();
    ivd(at, &["pipeline", "scene.toml", "--out", "out", "--cache", "cache", "--json"])
}

/// What `data-figure` and `data-value` say, one after the other.
fn figures(page: &str) -> Vec<(String, Value)> {
    let value = |rest: &str| rest.split_once('\'').unwrap().0.to_owned();
    page.split("data-figure='")
        .skip(1)
        .map(|rest| {
            let text = value(rest.split_once("data-value='").unwrap().1).replace("&quot;", "\"");
            (value(rest), serde_json::from_str(&text).unwrap())
        })
        .collect()
}

#[test]
fn a_lattice_that_is_coarse_for_what_it_wraps_is_noted() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    // A ball of 33.6 mm in voxels of 1 mm: what is much is more than an eighth of that, and than a voxel's diagonal.
    for (level, is_noted) in [(4, false), (5, true)] {
        let scene = format!(
            "schema = 1\n[input]\nphantom = \"sphere\"\nsize = 96\n[lattice]\niso = 128.0\n[refine]\nlevel = {level}\n[output]\nreport = true\n"
        );
        let told: Value = serde_json::from_slice(&pipeline(at, &scene).stdout).unwrap();
        let page = std::fs::read_to_string(at.join("out/report.html")).unwrap();
        let refined = told["stages"].as_array().unwrap().iter().find(|s| s["stage"] == "refine").unwrap();
        let seen = refined["metrics"]["seen_error_mm"].as_f64().unwrap();
        assert!(seen > 3.0_f64.sqrt() && (seen > 33.6 / 8.0) == is_noted, "{seen} mm");
        assert_eq!(page.contains("which is much for what it wraps"), is_noted);
        assert_eq!(page.contains("the radius of a ball, is 33.6 mm"), is_noted);
    }
}

#[test]
fn a_report_tells_the_figures_of_json_and_what_was_asked() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    let told: Value = serde_json::from_slice(&pipeline(at, SCENE).stdout).unwrap();
    let page = std::fs::read_to_string(at.join("out/report.html")).unwrap();
    let stage = |name: &str| told["stages"].as_array().unwrap().iter().find(|s| s["stage"] == name).unwrap();
    let found = figures(&page);
    assert!(found.len() >= 15, "{found:?}");
    for (key, value) in found {
        let (name, key) = key.split_once('.').unwrap();
        assert_eq!(
            stage(name)["metrics"].pointer(&format!("/{}", key.replace('.', "/"))),
            Some(&value),
            "{name}.{key}"
        );
    }
    // What the handle took is the nearest vertex of the refined lattice, and lies on the ball.
    let pick = &stage("deform")["metrics"]["handles"][0];
    let number = |key: &str| pick[key].as_f64().unwrap();
    assert_eq!(pick["asked_mm"], serde_json::json!([20.0, 33.0, 20.0]));
    let place: Vec<f64> = pick["at_mm"].as_array().unwrap().iter().map(|c| c.as_f64().unwrap()).collect();
    let away: f64 = place.iter().zip([20.0, 33.0, 20.0]).map(|(a, b)| (a - b).powi(2)).sum();
    assert!((number("away_mm") - away.sqrt()).abs() < 1e-12 && number("away_mm") < 2.0, "{pick}");
    assert!((number("away_diagonals") * 3.0_f64.sqrt() - number("away_mm")).abs() < 1e-12);
    for words in [
        "handle 0",
        "20, 33, 20",
        "0, -2, 0",
        "generated: sphere",
        "axial",
        "coronal",
        "sagittal",
        "deformed",
        "✓ <b>Trust:</b> the deformed volume follows the lattice to within ",
        "mm of the surface as cut where that was looked at",
        "and it folds nowhere",
    ] {
        assert!(page.contains(words), "{words}");
    }
    // Writing is part of the work, and the whole process's peak is at least that of each part.
    let peak = told["peak_rss_mb"].as_f64().unwrap();
    let parts = told["stages"].as_array().unwrap().iter().chain(told["outputs"].as_array().unwrap());
    let parts: Vec<f64> = parts.filter_map(|part| part["peak_rss_mb"].as_f64()).collect();
    assert!(parts.len() > 5 && parts.iter().all(|part| *part <= peak), "{parts:?} {peak}");
    assert!(told["outputs"].as_array().unwrap().iter().all(|file| file["wall_s"].as_f64().unwrap() > 0.0));
}

#[test]
fn a_pick_beside_the_lattice_is_refused_before_it_is_refined_and_a_far_one_is_told() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    // Far outside the volume, nothing is found in it; beside what was found, that isn't refined.
    for (y, made) in [("90.0", &["import"][..]), ("55.0", &["import", "lattice"])] {
        let far = pipeline(at, &SCENE.replace("33.0", y));
        let told = String::from_utf8(far.stderr).unwrap();
        assert_eq!(far.status.code(), Some(2), "{told}");
        assert!(told.contains("further than 17.321 mm") && told.contains(&format!("{y}00")), "{told}");
        assert_eq!(kept(&at.join("cache")), made);
    }
    let near = pipeline(at, &SCENE.replace("33.0", "41.0"));
    let told = String::from_utf8(near.stderr).unwrap();
    assert!(
        near.status.success() && told.contains("handle.0 took vertex") && told.contains("voxel diagonals"),
        "{told}"
    );
    let page = std::fs::read_to_string(at.join("out/report.html")).unwrap();
    assert!(page.contains("▲ <b>Look at:</b> what is said below of deform, before the result is trusted."));
    assert!(page.contains("▲ Look at:</b> deform: handle.0 took"));
}

/// Stages of the entries of a cache, sorted.
fn kept(folder: &Path) -> Vec<String> {
    let mut stages = Vec::new();
    let mut folders = vec![folder.to_owned()];
    while let Some(folder) = folders.pop() {
        for entry in std::fs::read_dir(folder).unwrap() {
            let path = entry.unwrap().path();
            if path.is_dir() {
                folders.push(path);
            } else if path.extension().is_some_and(|ending| ending == "ivd") {
                let told = json(Path::new("."), &["info", path.to_str().unwrap()]);
                stages.push(told["provenance"]["stage"].as_str().unwrap().to_owned());
            }
        }
    }
    stages.sort();
    stages
}

#[test]
fn info_tells_where_a_scan_lies_and_what_is_at_a_place() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    json(at, &["phantom", "sphere", "--size", "40", "-o", "v.ivd", "--truth", "t.ivd"]);
    let grid = json(at, &["info", "v.ivd"])["content"]["grid"].clone();
    assert_eq!(
        grid["extent_mm"],
        serde_json::json!({ "low": [-0.5, -0.5, -0.5], "high": [39.5, 39.5, 39.5] })
    );
    assert_eq!(
        (&grid["centre_mm"], &grid["units"], &grid["space"]),
        (&[19.5, 19.5, 19.5].into(), &"mm".into(), &"RAS".into())
    );
    let told = json(at, &["info", "v.ivd", "--at", "20.2,19.6,18.9", "--at", "0,0,0", "--labels", "t.ivd"]);
    assert_eq!(told["at"][0]["voxel"], serde_json::json!([20, 20, 19]));
    assert!(
        told["at"][0]["value"].as_f64().unwrap() > 200.0 && told["at"][1]["value"].as_f64().unwrap() < 10.0
    );
    assert_ne!(told["at"][0]["label"], told["at"][1]["label"]);
    let beyond = ivd(at, &["info", "v.ivd", "--at", "20,20,40"]);
    let told = String::from_utf8(beyond.stderr).unwrap();
    assert!(beyond.status.code() == Some(2) && told.contains("beyond the [40, 40, 40]"), "{told}");
    json(at, &["lattice", "v.ivd", "--iso", "128", "-o", "l.ivd"]);
    let extent = json(at, &["info", "l.ivd"])["content"]["extent_mm"].clone();
    let size = extent["high"][1].as_f64().unwrap() - extent["low"][1].as_f64().unwrap();
    assert!((26.0..32.0).contains(&size), "{extent}");
}

#[test]
fn landmarks_of_other_programs_are_picks_and_pins() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    // LPS: the same place as (20, 33, 20) in RAS.
    let markups = r#"{"markups":[{"type":"Fiducial","coordinateSystem":"LPS","controlPoints":[
        {"label":"front","position":[-20,-33,20]},{"label":"back","position":[-20,-6,20]}]}]}"#;
    std::fs::write(at.join("face.mrk.json"), markups).unwrap();
    json(at, &["phantom", "sphere", "--size", "40", "-o", "v.ivd"]);
    json(at, &["lattice", "v.ivd", "--iso", "128", "-o", "l.ivd"]);
    let deform = |handle: &str, fix: &str| {
        json(at, &["deform", "l.ivd", "--handle", handle, "--fix", fix, "-o", "m.ivd"])["output"]["hash"]
            .clone()
    };
    let by_numbers = deform("pick=20,33,20;move=0,-2,0;radius=12", "pick=20,6,20;radius=3");
    let by_names =
        deform("pick=face.mrk.json#front;move=0,-2,0;radius=12", "pick=face.mrk.json#back;radius=3");
    assert_eq!(by_names, by_numbers);
    let scene = SCENE.replace("[20.0, 33.0, 20.0]", "\"face.mrk.json#front\"");
    let hash = |scene: &str| {
        let told: Value = serde_json::from_slice(&pipeline(at, scene).stdout).unwrap();
        told["stages"].as_array().unwrap().iter().find(|s| s["stage"] == "deform").unwrap()["output"]["hash"]
            .clone()
    };
    assert_eq!(hash(&scene), hash(SCENE));
    let unknown = pipeline(at, &scene.replace("#front", "#nose"));
    let told = String::from_utf8(unknown.stderr).unwrap();
    assert!(unknown.status.code() == Some(2) && told.contains("nose") && told.contains("front"), "{told}");
}

#[test]
fn labels_stand_for_a_volume_and_operands_of_any_kind_combine() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    json(at, &["phantom", "head", "--size", "48", "-o", "v.ivd", "--truth", "t.ivd"]);
    let class = json(at, &["info", "t.ivd"])["content"]["classes"][2].clone();
    let id = class["id"].to_string();
    // The surface of a class: the same by its labels alone, by its labels beside the volume, and from a file of another program.
    let alone = json(at, &["lattice", "t.ivd", "--class", &id, "-o", "a.ivd"]);
    json(at, &["export", "t.ivd", "-o", "t.nii.gz"]);
    let file = json(at, &["lattice", "t.nii.gz", "--class", &id, "-o", "c.ivd"]);
    assert_eq!(alone["output"]["hash"], file["output"]["hash"]);
    assert_eq!(alone["metrics"]["boundary_edges"], 0);
    json(at, &["boundary", "t.ivd", "--class", &id, "-o", "part.ivd"]);
    // A mask and labels: what comes of them is what the first is.
    let whole = json(at, &["combine", "part.ivd", "t.ivd", "--op", "union", "-o", "u.ivd"]);
    let told = json(at, &["info", "t.ivd"]);
    let classes = told["content"]["classes"].as_array().unwrap().iter();
    let labelled: u64 = classes.filter(|c| c["id"] != 0).map(|c| c["voxels"].as_u64().unwrap()).sum();
    assert_eq!(whole["output"]["kind"], "mask");
    assert_eq!(whole["metrics"]["voxels_filled"], labelled);
    let inner = json(at, &["combine", "t.ivd", "part.ivd", "--op", "intersection", "-o", "i.ivd"]);
    let part = json(at, &["info", "part.ivd"])["content"]["voxels"].clone();
    assert_eq!((&inner["output"]["kind"], &inner["metrics"]["voxels_filled"]), (&"labels".into(), &part));
    // A volume cut to a part keeps its values there and is black elsewhere.
    json(at, &["combine", "v.ivd", "part.ivd", "--op", "intersection", "-o", "cut.ivd"]);
    let value = |file: &str, place: &str| json(at, &["info", file, "--at", place])["at"][0].clone();
    let inside = "24,24,24";
    if value("part.ivd", inside)["inside"] == true {
        assert_eq!(value("cut.ivd", inside)["value"], value("v.ivd", inside)["value"]);
    }
    let least = json(at, &["info", "v.ivd"])["content"]["range"][0].clone();
    assert_eq!(value("cut.ivd", "1,1,1")["value"], least);
    // Masks among labels are classes of their own, each.
    json(at, &["clip", "part.ivd", "--plane", "point=24,24,24;normal=0,0,1", "-o", "up.ivd"]);
    json(at, &["clip", "part.ivd", "--plane", "point=24,24,24;normal=0,0,-1", "-o", "down.ivd"]);
    json(at, &["combine", "i.ivd", "up.ivd", "down.ivd", "--op", "union", "-o", "three.ivd"]);
    let ids = |file: &str| -> Vec<u64> {
        let classes = json(at, &["info", file])["content"]["classes"].as_array().unwrap().clone();
        classes.iter().map(|class| class["id"].as_u64().unwrap()).collect()
    };
    let (before, after) = (ids("i.ivd"), ids("three.ivd"));
    assert_eq!(after.len(), before.len() + 2, "{before:?} {after:?}");
    // Classes 1 and 2 of a label file are its own.
    for class in ["1", "2"] {
        let of_labels = json(at, &["boundary", "t.ivd", "--class", class, "-o", "x.ivd"]);
        let of_file = json(at, &["boundary", "t.nii.gz", "--class", class, "-o", "y.ivd"]);
        assert_eq!(of_labels["output"]["hash"], of_file["output"]["hash"], "class {class}");
    }
    // Values aren't found in a mask.
    let refused = ivd(at, &["segment", "part.ivd", "--k", "2", "-o", "x.ivd"]);
    let told = String::from_utf8(refused.stderr).unwrap();
    assert!(refused.status.code() == Some(2) && told.contains("was given a mask artefact"), "{told}");
    // A clip counts what it kept of a mask.
    let half = json(at, &["clip", "part.ivd", "--plane", "point=24,24,24;normal=0,0,1", "-o", "h.ivd"]);
    let kept = half["metrics"]["voxels_filled"].as_u64().unwrap();
    assert!(kept > 0 && kept < part.as_u64().unwrap());
    assert_eq!(json(at, &["info", "h.ivd"])["content"]["voxels"], kept);
}

#[test]
fn the_memory_limit_holds_for_what_no_stage_foresees() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    json(at, &["phantom", "head", "--size", "160", "-o", "v.ivd", "--noise", "0.1"]);
    // A tree over the voxels keeps many numbers for each, of which no array is beyond the limit by itself: once there is no room
    // beside the others they go to files, and the classes are the same.
    let words = ["segment", "v.ivd", "--method", "hvs", "--linkage", "single", "--k", "4", "-o"];
    let roomy = json(at, &[&words[..], &["l.ivd"]].concat());
    let tight = json(at, &[&words[..], &["t.ivd", "--memory-limit", "80MiB"]].concat());
    assert_eq!(roomy["output"]["hash"], tight["output"]["hash"]);
    assert!(tight["peak_own_mb"].as_f64().unwrap() <= 80.0, "{tight}");
    // Work that doesn't notice is told before anything is written.
    json(at, &["phantom", "gyroid", "--size", "200", "-o", "g.ivd"]);
    let tight = ivd(at, &["lattice", "g.ivd", "--iso", "128", "-o", "k.ivd", "--memory-limit", "64MiB"]);
    let told = String::from_utf8(tight.stderr).unwrap();
    assert!(tight.status.code() == Some(4) && told.contains("64.0 MiB"), "{told}");
    assert!(!at.join("k.ivd").exists());
    // The limit that is named does.
    let named =
        told.split("--memory-limit ").nth(2).and_then(|rest| rest.split(',').next()).unwrap().to_owned();
    json(at, &["lattice", "g.ivd", "--iso", "128", "-o", "k.ivd", "--memory-limit", &named]);
}

/// The JSON of a GLB file: its first chunk.
fn glb_json(bytes: &[u8]) -> Value {
    let length = u32::from_le_bytes(bytes[12..16].try_into().unwrap()) as usize;
    serde_json::from_slice(&bytes[20..20 + length]).unwrap()
}

/// The last frame is what a scene without frames makes, bit for bit; a shorter motion leaves none of a longer one's, and a member of a series of
/// meshes that is gone is written again.
fn still_and_shorter(at: &Path, scene: &str, last: &[u8]) {
    let run = |scene: &str| {
        let done = pipeline(at, scene);
        assert!(done.status.success(), "{}", String::from_utf8_lossy(&done.stderr));
    };
    let there = |name: &str| at.join("out").join(name).exists();
    let alone = scene.replace("volume_series = \"frames/at.nii.gz\"\n", "");
    let alone = alone.replace("picture_series = \"drawn/at.png\"\n", "");
    let drawn = |name: &str| std::fs::read(at.join("out").join(name)).unwrap();
    let series = [0, 2].map(|i| drawn(&format!("drawn/at_000{i}.png")));
    let of_volume = |scene: &str| scene.replace("[render]\n", "[render]\nfit = \"volume\"\n");
    run(&alone.replace("[output]", "[map]\nframe = 2\n[output]"));
    assert_eq!(last, drawn("out.nii.gz"));
    assert_eq!(series[1], drawn("after.png"));
    // Where the motion doesn't choose the camera, the first frame drawn alone is the first of the series.
    run(&of_volume(&alone).replace("[output]", "[map]\nframe = 0\n[output]"));
    let first = drawn("after.png");
    run(&of_volume(scene));
    assert_eq!(first, drawn("drawn/at_0000.png"));
    run(&scene.replace("at.png", "at.gif"));
    assert!(drawn("drawn/at.gif").starts_with(b"GIF89a") && !there("drawn/at_0000.gif"));
    run(scene);
    run(&scene.replace("frames = 3", "frames = 2"));
    assert!(there("frames/at_0001.nii.gz") && !there("frames/at_0002.nii.gz"));
    let meshes = alone.replace("move.glb", "move.pvd");
    run(&meshes);
    assert!([0, 1, 2, 3].iter().all(|i| there(&format!("move_000{i}.vtp"))));
    std::fs::remove_file(at.join("out/move_0002.vtp")).unwrap();
    run(&meshes);
    assert!(there("move_0002.vtp"));
}

#[test]
fn every_frame_of_a_motion_is_written_and_the_last_is_the_still_one() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    for solver in ["dynamics", "projective", "xpbd"] {
        let own = format!("[deform]\nsolver = \"{solver}\"\nframes = 3\nduration = 0.02\n[[deform.handle]]");
        let outputs = "animation = \"move.glb\"\nvolume_series = \"frames/at.nii.gz\"\nvolume = \"out.nii.gz\"\n\
            picture_series = \"drawn/at.png\"\nimages = [\"after\"]";
        let scene = SCENE.replace("[[deform.handle]]", &own).replace("volume = \"out.nii.gz\"", outputs);
        let scene = scene.replace("[output]", "[render]\nsize = 96\n[output]");
        let done = pipeline(at, &scene);
        assert!(done.status.success(), "{solver}: {}", String::from_utf8_lossy(&done.stderr));
        let read = |name: &str| std::fs::read(at.join("out").join(name)).unwrap();
        let frames = [0, 1, 2].map(|i| read(&format!("frames/at_000{i}.nii.gz")));
        assert!(frames[0] != frames[1] && frames[1] != frames[2], "{solver}: frames differ");
        assert!(frames[2] == read("out.nii.gz"), "{solver}: the last is the still one");
        let drawn = [0, 1, 2].map(|i| read(&format!("drawn/at_000{i}.png")));
        assert!(drawn[0] != drawn[1] && drawn[1] != drawn[2], "{solver}: pictures differ");
        assert!(drawn[2] == read("after.png"), "{solver}: the last is the still one");
        let told: Value = serde_json::from_slice(&done.stdout).unwrap();
        let maps: Vec<&Value> =
            told["stages"].as_array().unwrap().iter().filter(|s| s["stage"] == "map").collect();
        assert_eq!(maps.len(), 3, "{solver}: each frame is mapped");
        assert!(maps.iter().all(|map| map["metrics"]["folds"] == 0), "{solver}: and certified");
        let glb = glb_json(&read("move.glb"));
        let targets = &glb["meshes"][0]["primitives"][0]["targets"];
        assert_eq!(targets.as_array().unwrap().len(), 3, "{solver}");
        let times =
            &glb["accessors"][glb["animations"][0]["samplers"][0]["input"].as_u64().unwrap() as usize];
        assert!((times["max"][0].as_f64().unwrap() - 0.02).abs() < 1e-6, "{solver}: {times}");
        if solver == "dynamics" {
            still_and_shorter(at, &scene, &frames[2]);
        }
        std::fs::remove_dir_all(at.join("out")).unwrap();
    }
    // A solver that knows no time gives the end alone, and says so where all frames are asked for.
    let done = pipeline(at, &SCENE.replace("volume = \"out.nii.gz\"", "animation = \"move.glb\""));
    let told = String::from_utf8(done.stderr).unwrap();
    assert!(done.status.success() && told.contains("output.animation: the motion has one frame"), "{told}");
    assert!(told.contains("deform.frames gives more"), "{told}");
    // What stands still can't be an animation, and one frame isn't all.
    let with = |outputs: &str| SCENE.replace("volume = \"out.nii.gz\"", outputs);
    for (scene, word) in [
        (with("animation = \"move.stl\""), ".glb or .pvd"),
        (with("volume_series = \"volumé\""), "voxels are written as"),
        (with("displacement = \"field.ivd\""), "a displacement field is written as .nrrd"),
        (with("labels = \"labels.png\""), "voxels are written as"),
        (with("lattice_extracted = \"cut.3mf\""), "a lattice is written as .ply"),
        (with("picture_series = \"at.jpg\""), "pictures are written as .png"),
        (with("picture_series = \"at.exr\""), "keep_light"),
        (
            with("picture_series = \"at.gif\"").replace("[output]", "[render]\nturntable = 3\n[output]"),
            "an animation of turntables",
        ),
        (
            with("picture_series = \"at.png\"").replace("[output]", "[map]\nframe = 0\n[output]"),
            "output.picture_series is of every frame",
        ),
        (
            with("volume_series = \"at.nii.gz\"").replace("[output]", "[map]\nframe = 0\n[output]"),
            "map.frame",
        ),
    ] {
        let refused = pipeline(at, &scene);
        let told = String::from_utf8(refused.stderr).unwrap();
        assert!(refused.status.code() == Some(2) && told.contains(word), "{told}");
    }
}

#[test]
fn a_displacement_goes_out_and_comes_back() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    json(at, &["phantom", "sphere", "--size", "40", "-o", "v.ivd"]);
    json(at, &["lattice", "v.ivd", "--iso", "128", "-o", "l.ivd"]);
    json(at, &["octree", "l.ivd", "-o", "o.ivd"]);
    let handle = "pick=20,33,20;move=0,-3,1;radius=12";
    json(at, &["deform", "l.ivd", "--handle", handle, "-o", "m.ivd"]);
    let map = json(at, &["map", "l.ivd", "o.ivd", "m.ivd", "-o", "d.ivd"]);
    json(at, &["warp", "v.ivd", "d.ivd", "-o", "warped.ivd"]);
    for format in ["nrrd", "nii.gz"] {
        for (direction, exact) in [("inverse", true), ("forward", false)] {
            let file = format!("field-{direction}.{format}");
            json(at, &["export", "d.ivd", "-o", &file, "--direction", direction]);
            let back = json(at, &["import", &file, "--displacement", "-o", "back.ivd"]);
            let told = &back["metrics"];
            assert_eq!((&told["direction"], &told["folds"]), (&direction.into(), &0.into()), "{file}");
            let largest = told["largest_mm"].as_f64().unwrap();
            // Of the way that the file gives: as it is told of the file.
            let file_told = json(at, &["info", &file])["content"].clone();
            let moved = ["largest_mm", "voxels_moved"].map(|key| (file_told[key].clone(), told[key].clone()));
            assert!(moved.iter().all(|(file, back)| file == back), "{moved:?}");
            assert!(
                (largest / map["metrics"]["largest_mm"].as_f64().unwrap() - 1.0).abs() < 0.02,
                "{file}: {told}"
            );
            json(at, &["warp", "v.ivd", "back.ivd", "-o", "again.ivd"]);
            let off = json(at, &["compare", "warped.ivd", "again.ivd"])["max"].as_f64().unwrap();
            // The field that pulls is the same to the last bit; the other one's inverse is found anew.
            assert!(if exact { off == 0.0 } else { off <= 1.0 }, "{file}: {off}");
            let other =
                if direction == "inverse" { "--displacement=forward" } else { "--displacement=inverse" };
            let refused = ivd(at, &["import", &file, other, "-o", "x.ivd"]);
            let told = String::from_utf8(refused.stderr).unwrap();
            assert!(refused.status.code() == Some(2) && told.contains("the file says"), "{told}");
        }
    }
    // What a header keeps apart is part of what the result is made of.
    let detached = |scale: f32| {
        let bytes: Vec<u8> = (0..3 * 4096).flat_map(|_| (scale).to_le_bytes()).collect();
        std::fs::write(at.join("a.raw"), bytes).unwrap();
        let header = "NRRD0004\ntype: float\ndimension: 4\nsizes: 3 16 16 16\nkinds: vector domain domain domain\nspace: left-posterior-superior\n\
            space directions: none (1,0,0) (0,1,0) (0,0,1)\nendian: little\nencoding: raw\ndata file: a.raw\n\n";
        std::fs::write(at.join("a.nhdr"), header).unwrap();
        let words = ["import", "a.nhdr", "--displacement=inverse", "-o", "a.ivd", "--cache", "kept"];
        json(at, &words)["metrics"]["largest_mm"].as_f64().unwrap()
    };
    let (small, large) = (detached(0.25), detached(0.5));
    assert!((large / small - 2.0).abs() < 1e-5, "{small} {large}");
    // A volume is no field, and is told so.
    json(at, &["export", "v.ivd", "-o", "v.nrrd"]);
    let refused = ivd(at, &["import", "v.nrrd", "--displacement=inverse", "-o", "x.ivd"]);
    assert_eq!(refused.status.code(), Some(3), "{}", String::from_utf8_lossy(&refused.stderr));
}

#[test]
fn what_is_empty_or_left_behind_is_told_where_the_commands_run() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    let noted = |words: &[&str]| {
        let output = ivd(at, words);
        assert!(output.status.success(), "{words:?}");
        String::from_utf8(output.stderr).unwrap()
    };
    json(at, &["phantom", "sphere", "--size", "32", "-o", "s.ivd"]);
    let beyond = "point=16,16,500;normal=0,0,1";
    assert!(noted(&["clip", "s.ivd", "--plane", beyond, "-o", "none.ivd"]).contains("nothing is left"));
    let below = "point=16,16,-500;normal=0,0,1";
    assert!(noted(&["clip", "s.ivd", "--plane", below, "-o", "all.ivd"]).contains("nothing is clipped"));
    let half = "point=16,16,16;normal=0,0,1";
    assert!(!noted(&["clip", "s.ivd", "--plane", half, "-o", "half.ivd"]).contains("note"));
    assert!(noted(&["lattice", "s.ivd", "--iso", "30000", "-o", "l.ivd"]).contains("the lattice is empty"));
    // A push that is far too far for its reach: what is missed is said, with the place.
    let scene = SCENE.replace("move = [0.0, -2.0, 0.0]", "move = [0.0, -24.0, 0.0]");
    let scene = scene.replace("[output]", "[map]\nlimit = \"stop\"\n[output]");
    let output = pipeline(at, &scene);
    let told = String::from_utf8(output.stderr).unwrap();
    assert!(told.contains("note: map:"), "{told}");
    // A clip of the result, where the lattice alone is asked for.
    let scene = "schema = 1\n[input]\nphantom = \"sphere\"\nsize = 32\n[lattice]\niso = 128.0\n[[clip.planes]]\n\
        point = [16.0, 16.0, 16.0]\nnormal = [0.0, 0.0, 1.0]\n[output]\nlattice = \"l.ply\"\n";
    let told = String::from_utf8(pipeline(at, scene).stderr).unwrap();
    assert!(told.contains("note: clip: not done"), "{told}");
}
