//! Every recipe of docs/recipes.md, word for word, each in a folder of its own.
#![allow(clippy::unwrap_used, reason = "a test fails where it can't go on")]

use std::path::Path;
use std::process::Command;

use serde_json::Value;

use crate::call::json;

/// The page's sections: title and text.
fn recipes(page: &str) -> Vec<(&str, &str)> {
    page.split("\n## ").skip(1).map(|section| section.split_once('\n').unwrap()).collect()
}

/// Blocks between fences of a language.
fn blocks<'a>(text: &'a str, language: &str) -> Vec<&'a str> {
    let blocks = text.split("```").skip(1).step_by(2).filter_map(|block| block.split_once('\n'));
    blocks.filter(|(found, _)| *found == language).map(|(_, block)| block).collect()
}

/// The files that recipes begin with: a generated head in MR and in something like CT, and its labels.
fn begin(folder: &Path) {
    json(folder, &["phantom", "head", "--size", "96", "--noise", "0.02", "-o", "h.ivd", "--truth", "t.ivd"]);
    json(folder, &["export", "h.ivd", "-o", "head.nii.gz"]);
    json(folder, &["export", "h.ivd", "-o", "slices.tif"]);
    json(folder, &["export", "t.ivd", "-o", "organs.nii.gz"]);
    // A shell of 5 mm with 1000 inside of it and −1000 outside, as bone in air.
    json(folder, &["phantom", "shell", "--size", "96", "-o", "s.ivd"]);
    json(folder, &["export", "s.ivd", "-o", "s.nrrd"]);
    let bytes = std::fs::read(folder.join("s.nrrd")).unwrap();
    let at = bytes.windows(2).position(|two| two == b"\n\n").unwrap();
    let values: Vec<u8> =
        bytes[at + 2..].iter().flat_map(|v| (i16::from(*v) * 10 - 1000).to_le_bytes()).collect();
    std::fs::write(folder.join("ct.raw"), values).unwrap();
    let words = ["import", "ct.raw", "--raw-dims", "96,96,96", "--raw-type", "i16", "-o", "ct.ivd"];
    json(folder, &words);
    json(folder, &["export", "ct.ivd", "-o", "ct.nii.gz"]);
}

fn run(folder: &Path, block: &str) {
    let program = Path::new(env!("CARGO_BIN_EXE_ivd"));
    let path = std::env::var("PATH").unwrap();
    let path = format!("{}:{path}", program.parent().unwrap().display());
    let mut shell = Command::new("sh");
    shell.env("PATH", path).env("IVD_CACHE", folder.join("cache")).current_dir(folder);
    let output = shell.args(["-euc", block]).output().unwrap();
    assert!(output.status.success(), "{block}\n{}", String::from_utf8_lossy(&output.stderr));
}

#[test]
fn every_recipe_runs_and_gives_what_it_says() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("../..");
    let page = std::fs::read_to_string(root.join("docs/recipes.md")).unwrap();
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    begin(at);
    for block in blocks(page.split("\n## ").next().unwrap(), "sh") {
        run(at, block);
    }
    let found = recipes(&page);
    assert_eq!(found.len(), 6);
    for (title, text) in found {
        for scene in blocks(text, "toml") {
            let name = scene.lines().next().unwrap().trim_start_matches("# ");
            std::fs::write(at.join(name), scene).unwrap();
        }
        let commands = blocks(text, "sh");
        assert!(!commands.is_empty(), "{title}");
        for block in commands {
            run(at, block);
        }
    }
    let there = |name: &str| assert!(at.join(name).is_file(), "{name}");
    let files = ["nose/pressed.nii.gz", "nose/report.html", "frames/press.glb", "skull.stl", "to-rest.nrrd"];
    for name in files.iter().chain(&[
        "deformed-organs.nii.gz",
        "organs/deformed-organs.nii.gz",
        "to-deformed.nrrd",
        "pressed.ply",
        "moved.nii.gz",
    ]) {
        there(name);
    }
    (0..10).for_each(|i| there(&format!("frames/volumes/press_{i:04}.nii.gz")));
    (0..10).for_each(|i| there(&format!("frames/pictures/press_{i:04}.png")));
    // The nose went in by what each command asked for; smoothest, voxels go up to 2 % further.
    for (page, wanted) in [("nose/report.html", 5.0), ("nose-3/report.html", 3.0)] {
        let page = std::fs::read_to_string(at.join(page)).unwrap();
        let told = page.split("data-figure='map.largest_mm' data-value='").nth(1).unwrap().split('\'').next();
        let largest = told.unwrap().parse::<f64>().unwrap();
        assert!((wanted - 0.05..=1.02 * wanted).contains(&largest), "{told:?}");
        assert!(!page.contains('▲'), "a recipe to trust");
    }
    // The skull lies above the plane at 60 mm, and ends within a voxel of 1 mm beyond it, as the page says.
    let skull = json(at, &["info", "skull.ivd"])["content"]["extent_mm"].clone();
    let lowest = skull["low"][2].as_f64().unwrap();
    assert!((59.0..60.0).contains(&lowest), "{skull}");
    // What is written for other programs can be told again: the mesh, and which way the field leads and how far.
    let stl = json(at, &["info", "skull.stl"]);
    assert_eq!((&stl["kind"], &stl["content"]["space"]), (&"mesh file".into(), &"RAS".into()));
    let top = |told: &Value| told["high"][2].as_f64().unwrap();
    assert!((top(&stl["content"]["extent_mm"]) - top(&skull)).abs() < 1.0, "{stl}");
    for (file, way) in
        [("to-rest.nrrd", "inverse"), ("to-deformed.nrrd", "forward"), ("nose/to-rest.nrrd", "inverse")]
    {
        let told = json(at, &["info", file]);
        assert_eq!(
            (&told["kind"], &told["content"]["direction"]),
            (&"displacement field file".into(), &way.into())
        );
        assert!((told["content"]["largest_mm"].as_f64().unwrap() - 5.0).abs() < 0.1, "{told}");
    }
    // Deformed labels are the same classes, of about as many voxels.
    let voxels = |file: &str| -> Vec<(Value, f64)> {
        let told = json(at, &["info", file]);
        let classes = told["content"]["classes"].as_array().unwrap().clone();
        classes.iter().map(|c| (c["id"].clone(), c["voxels"].as_f64().unwrap())).collect()
    };
    json(at, &["import", "organs/deformed-organs.nii.gz", "--labels", "-o", "scene-organs.ivd"]);
    for deformed in ["deformed-organs.ivd", "scene-organs.ivd"] {
        for ((id, rest), (same, moved)) in voxels("organs.ivd").iter().zip(voxels(deformed)) {
            assert_eq!(*id, same);
            assert!((moved / rest - 1.0).abs() < 0.05, "{deformed}, class {id}: {rest} → {moved}");
        }
    }
    // The way that a field was written comes back as it was, and the other as closely as the page says.
    let told = json(at, &["compare", "skin-displacement.ivd", "field.ivd"]);
    let figure = |way: &str, key: &str| told[way][key].as_f64().unwrap();
    assert!(told["equal"] == false && figure("inverse", "max") == 0.0, "{told}");
    assert!(figure("forward", "p95") < 0.001 && figure("forward", "max") < 0.4, "{told}");
    // Through formats and back nothing is lost.
    for format in ["nii", "nrrd", "mha", "vti"] {
        let told = json(at, &["compare", "scan.ivd", &format!("scan.{format}")]);
        assert_eq!(told["max"], 0.0, "{format}: {told}");
    }
}
