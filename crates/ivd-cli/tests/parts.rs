//! Parts: what is wrong with their flags and files is told by name.

use crate::call::{ivd, json, refused};

#[test]
fn what_a_method_does_not_read_is_wrong_usage() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    json(at, &["phantom", "sphere", "--size", "16", "-o", "v.ivd"]);
    json(at, &["boundary", "v.ivd", "--above", "100", "-o", "m.ivd"]);
    let of = |words: &str| {
        let mut all = vec!["boundary", "v.ivd", "-o", "x.ivd"];
        all.extend(words.split(' '));
        refused(at, &all)
    };
    for (words, told) in [
        ("--method surface --seeds 1,2,3=1", ["--seeds", "--method compete"]),
        ("--start m.ivd", ["--start", "--method surface or compete"]),
        ("--method surface --start m.ivd --seed 1,2,3", ["seed", "drawn"]),
        ("--method surface --class densest", ["class", "labels"]),
        ("--method surface --phi 1e-40", ["--phi", "0.999999"]),
        ("--method surface --distribution gaussian", ["--distribution", "likelihood"]),
        ("--method contour --stretch 0.1", ["--stretch", "energy = edge"]),
        ("--method compete", ["seeds", "two labels"]),
    ] {
        let (code, text) = of(words);
        assert!(code == 2 && told.iter().all(|part| text.contains(part)), "{words}: {code} {text}");
    }
}

#[test]
fn a_start_without_voxels_is_told_with_its_file() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    json(at, &["phantom", "sphere", "--size", "10", "-o", "v.ivd"]);
    std::fs::write(at.join("zeros.raw"), [0; 1000]).unwrap();
    let raw = ["--raw-dims", "10,10,10", "--raw-type", "u8", "--raw-spacing", "1,1,1"];
    let words = [&["import", "zeros.raw", "-o", "zeros.ivd"][..], &raw].concat();
    json(at, &words);
    assert!(ivd(at, &["export", "zeros.ivd", "-o", "zeros.nii"]).status.success());
    let (code, text) =
        refused(at, &["boundary", "v.ivd", "--method", "surface", "--start", "zeros.nii", "-o", "x.ivd"]);
    assert!(code == 3 && text.contains("zeros.nii") && text.contains("every voxel is 0"), "{code} {text}");
}

#[test]
fn holes_are_filled_by_both_names() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    json(at, &["phantom", "shell", "--size", "24", "-o", "v.ivd"]);
    json(at, &["boundary", "v.ivd", "--above", "100", "--keep-holes", "-o", "m.ivd"]);
    let edit = |more: &[&str]| {
        let words = [&["boundary", "v.ivd", "--method", "edit", "--part", "m.ivd", "-o", "e.ivd"][..], more];
        json(at, &words.concat())["metrics"]["voxels"].as_u64().unwrap()
    };
    let [plain, new, old] = [edit(&[]), edit(&["--fill-holes"]), edit(&["--fill"])];
    assert!(plain < new && new == old, "{plain} {new} {old}");
}

#[test]
fn a_scene_starts_a_surface_from_a_drawn_part() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    json(at, &["phantom", "spheres", "--size", "32", "-o", "v.ivd"]);
    assert!(ivd(at, &["export", "v.ivd", "-o", "v.nii"]).status.success());
    json(at, &["boundary", "v.ivd", "--above", "100", "-o", "drawn.ivd"]);
    assert!(ivd(at, &["export", "drawn.ivd", "-o", "drawn.nii"]).status.success());
    let surface = ["boundary", "v.nii", "--method", "surface", "--start", "drawn.ivd", "-o", "part.ivd"];
    let alone = json(at, &surface)["metrics"]["voxels"].as_u64().unwrap();
    let scene = |start: &str, method: &str| {
        let text = format!(
            "schema = 1\n[input]\nfile = \"v.nii\"\nstart = \"{start}\"\n[boundary]\nmethod = \"{method}\"\n\
             [output]\nmask = \"part.nrrd\"\n"
        );
        std::fs::write(at.join("scene.toml"), text).unwrap();
    };
    for start in ["drawn.ivd", "drawn.nii"] {
        scene(start, "surface");
        let run = json(at, &["pipeline", "scene.toml", "--out", "out", "--cache", "off"]);
        let stages = run["stages"].as_array().unwrap();
        let part = stages.iter().find(|stage| stage["stage"] == "boundary").unwrap();
        assert_eq!(part["metrics"]["voxels"].as_u64().unwrap(), alone, "{start}");
    }
    scene("gone.nii", "surface");
    let (code, text) = refused(at, &["pipeline", "scene.toml", "--out", "out"]);
    assert!(code == 7 && text.contains("gone.nii"), "{code} {text}");
    scene("v.ivd", "surface");
    let (code, text) = refused(at, &["pipeline", "scene.toml", "--out", "out"]);
    assert!(code == 3 && text.contains("v.ivd") && text.contains("mask"), "{code} {text}");
    scene("drawn.ivd", "component");
    let (code, text) = refused(at, &["pipeline", "scene.toml", "--out", "out"]);
    assert!(code == 2 && text.contains("input.start") && text.contains("surface"), "{code} {text}");
}
