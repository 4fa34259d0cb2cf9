//! What someone meets who goes on: a run that fails after one that didn't, and files of other programs that don't fit.
#![allow(clippy::unwrap_used, reason = "a test fails where it can't go on")]

use std::path::Path;

use serde_json::Value;

use crate::call::{ivd, json, refused};

/// A ball of radius 14 mm about (19.5, 19.5, 19.5), pressed in at the front.
const SCENE: &str = "schema = 1\n[input]\nphantom = \"sphere\"\nsize = 40\n[lattice]\niso = 128.0\n[refine]\nlevel = 1\n\
    [[deform.handle]]\npick = [20.0, 33.0, 20.0]\nmove = [0.0, -2.0, 0.0]\nradius = 12.0\n[output]\nvolume = \"out.nii.gz\"\nreport = true\n";

/// Runs a scene; its exit code, what it says, and its JSON.
fn pipeline(at: &Path, scene: &str, words: &[&str]) -> (i32, String, Value) {
    std::fs::write(at.join("scene.toml"), scene).unwrap();
    let fixed = ["pipeline", "scene.toml", "--out", "out", "--json"];
    let output = ivd(at, &[&fixed[..], words].concat());
    let told = String::from_utf8(output.stderr).unwrap();
    (output.status.code().unwrap(), told, serde_json::from_slice(&output.stdout).unwrap())
}

#[test]
fn a_run_that_fails_names_the_outputs_of_an_earlier_one() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    let folds = SCENE.replace("-2.0", "-12.0").replace("12.0\n[output]", "3.0\n[output]");
    let wrong = SCENE.replace("radius", "raduis");
    let (code, told, object) = pipeline(at, &folds, &[]);
    assert!(code == 5 && !told.contains("earlier"), "nothing was there: {told}");
    assert!(object["error"].get("left_over").is_none(), "{object}");
    let (code, told, _) = pipeline(at, SCENE, &[]);
    assert!(code == 0 && !told.contains("earlier"), "{told}");
    for (scene, wanted) in [(&folds, 5), (&wrong, 2)] {
        let (code, told, object) = pipeline(at, scene, &[]);
        assert_eq!(code, wanted, "{told}");
        let note = told.lines().last().unwrap();
        for words in
            ["note: this run wrote none of", "out/report.html (of 2", "out/out.nii.gz (of 2", " UTC)"]
        {
            assert!(note.contains(words), "{words}: {note}");
        }
        let left = object["error"]["left_over"].as_array().unwrap();
        let names: Vec<&str> = left.iter().map(|file| file["name"].as_str().unwrap()).collect();
        assert_eq!(names, ["volume", "report"]);
        assert!(!object["error"]["message"].as_str().unwrap().contains("earlier"), "{object}");
    }
    // What a failed run wrote before it failed is its own.
    let more = folds.replace("report = true", "report = true\nimages = [\"before\"]");
    let (code, told, _) = pipeline(at, &more, &[]);
    assert!(code == 5 && told.contains("out/report.html") && !told.contains("before.png"), "{told}");
    // Who asks for no outputs, and who succeeds, isn't told of any.
    assert!(!pipeline(at, &folds, &["--until", "map"]).1.contains("earlier"));
    assert!(!pipeline(at, SCENE, &[]).1.contains("earlier"));
}

/// A ball of radius 12 among 40³ voxels, pressed in at its front, with bright voxels alone.
fn ball_with_specks(at: &Path, specks: &[[usize; 3]]) -> String {
    let mut voxels = vec![0_u8; 40 * 40 * 40];
    for (i, value) in voxels.iter_mut().enumerate() {
        let p = [i % 40, i / 40 % 40, i / 1600].map(|c| c as f64 - 19.5);
        let depth = 12.0 - p.iter().map(|c| c * c).sum::<f64>().sqrt();
        *value = (128.0 + 60.0 * depth).clamp(0.0, 255.0) as u8;
    }
    for [x, y, z] in specks {
        voxels[x + 40 * (y + 40 * z)] = 255;
    }
    std::fs::write(at.join("ball.raw"), voxels).unwrap();
    let input = "file = \"ball.raw\"\naxes = \"RAS\"\nraw = { dims = [40, 40, 40], type = \"u8\" }";
    SCENE.replace("phantom = \"sphere\"\nsize = 40", input).replace("33.0", "31.0").replace("12.0", "8.0")
}

#[test]
fn specks_of_a_lattice_warn_where_they_lie_in_what_moves_and_are_noted_elsewhere() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    let page = |specks: &[[usize; 3]]| {
        let (code, told, _) = pipeline(at, &ball_with_specks(at, specks), &[]);
        assert_eq!(code, 0, "{told}");
        let page = std::fs::read_to_string(at.join("out/report.html")).unwrap();
        // Who doesn't open it is told that it marks something.
        let marks =
            told.contains("report: marks (▲) what to look at before it is trusted: lattice and refine");
        assert_eq!(marks, page.contains('▲'), "{told}");
        page
    };
    let far = [[3, 3, 3], [6, 3, 3], [9, 3, 3], [12, 3, 3]];
    let none = page(&[]);
    assert!(none.contains("✓ <b>Trust:</b>") && !none.contains("small parts"));
    let noted = page(&far);
    assert!(noted.contains("✓ <b>Trust:</b>") && !noted.contains("▲"));
    assert!(noted.contains("<li>Note: lattice and refine: ") && noted.contains("4 small parts"));
    assert!(noted.contains("; none of them lies where something moves</li>"));
    let warned = page(&[&far[..], &[[20, 34, 20]]].concat());
    assert!(warned.contains("▲ <b>Look at:</b> what is said below of lattice and refine"), "near the handle");
    assert!(warned.contains("▲ Look at:</b> lattice and refine: ") && warned.contains("5 small parts"));
    assert!(warned.contains("; one of them lies where something moves</li>"));
    // Numbers that no one outside of the field knows are explained beside them.
    for words in [
        "hardly changed (1 is as it was, 0 is flat)</td>",
        "<td class='means'>good: nowhere does space lie on itself",
        "ring: the surface follows the handles",
        "octree: a voxel moves as the surface nearest to it",
        "Good: below a hundredth of a voxel",
    ] {
        assert!(noted.contains(words), "{words}");
    }
}

/// Voxels of an NRRD file in 12 × 10 × 8, with a header that says what is given.
fn nrrd(at: &Path, name: &str, header: &str, value: impl Fn([usize; 3]) -> u8) {
    let voxels = (0..12 * 10 * 8).map(|i| value([i % 12, i / 12 % 10, i / 120]));
    let head = format!("NRRD0004\ntype: uchar\ndimension: 3\nsizes: 12 10 8\nencoding: raw\n{header}\n");
    std::fs::write(at.join(name), head.into_bytes().into_iter().chain(voxels).collect::<Vec<u8>>()).unwrap();
}

/// Where the scans of these tests lie.
const RIGHT: &str = "space: left-posterior-superior\nspace directions: (0.5,0,0) (0,-0.75,0) (0,0.1,2)\nspace origin: (-20,30,7)\n";

fn part([x, y, z]: [usize; 3]) -> u8 {
    match (x, y, z) {
        (2..=5, 2..=6, 1..=5) => 1,
        (7..=9, 3..=8, 2..=6) => 2,
        _ => 0,
    }
}

#[test]
fn a_file_with_a_wrong_header_takes_the_grid_of_another() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    nrrd(at, "scan.nrrd", RIGHT, |p| 10 + 100 * part(p) + p[0] as u8);
    nrrd(at, "right.nrrd", RIGHT, part);
    json(at, &["import", "scan.nrrd", "-o", "scan.ivd"]);
    let hash =
        |words: &[&str]| json(at, &[&["import"], words, &["-o", "x.ivd"]].concat())["output"]["hash"].clone();
    for (name, header) in [
        ("none.nrrd", ""),
        (
            "wrong.nrrd",
            "space: left-posterior-superior\nspace directions: (1,0,0) (0,1,0) (0,0,1)\nspace origin: (0,0,0)\n",
        ),
    ] {
        nrrd(at, name, header, part);
        json(at, &["import", name, "--labels", "-o", "bad.ivd"]);
        let (code, told) =
            refused(at, &["lattice", "scan.nrrd", "--labels", "bad.ivd", "--class", "1", "-o", "l.ivd"]);
        assert!(code == 2 && told.contains("--grid-of OTHER"), "{told}");
        for kind in [&[][..], &["--labels"], &["--mask"]] {
            let right = hash(&[&["right.nrrd"], kind].concat());
            assert_ne!(hash(&[&[name], kind].concat()), right, "{name} {kind:?}");
            for other in ["scan.nrrd", "scan.ivd"] {
                assert_eq!(
                    hash(&[&[name], kind, &["--grid-of", other]].concat()),
                    right,
                    "{name} {kind:?} {other}"
                );
            }
            let output =
                ivd(at, &[&["import", name], kind, &["--grid-of", "scan.nrrd", "-o", "x.ivd"]].concat());
            let told = String::from_utf8(output.stderr).unwrap();
            for words in [
                "spacing 0.5, 0.75, 2.0025 mm instead of 1, 1, 1 mm",
                "first voxel at 20, -30, 7 mm instead of",
                "axes LAS instead of LPS",
            ] {
                assert!(told.contains(words), "{words}: {told}");
            }
        }
    }
    // An artefact of a volume as well; of labels not, whose file is to be read again.
    json(at, &["import", "none.nrrd", "-o", "none.ivd"]);
    assert_eq!(hash(&["none.ivd", "--labels", "--grid-of", "scan.ivd"]), hash(&["right.nrrd", "--labels"]));
    let (code, told) = refused(at, &["import", "bad.ivd", "--grid-of", "scan.ivd", "-o", "x.ivd"]);
    assert!(code == 2 && told.contains("import the file that it was made of again"), "{told}");
    // Where nothing is wrong, that is said.
    let output = ivd(at, &["import", "right.nrrd", "--grid-of", "scan.ivd", "-o", "x.ivd"]);
    assert!(String::from_utf8(output.stderr).unwrap().contains("on the grid of the other already"));
    json(at, &["phantom", "sphere", "--size", "16", "-o", "other.ivd"]);
    let (code, told) = refused(at, &["import", "none.nrrd", "--grid-of", "other.ivd", "-o", "x.ivd"]);
    assert!(code == 2, "{told}");
    for words in ["none.nrrd has 12 × 10 × 8 voxels", "other.ivd", "has 16 × 16 × 16", "--like"] {
        assert!(told.contains(words), "{words}: {told}");
    }
    // A scene's volume, by the key of that name.
    let scene = "schema = 1\n[input]\nfile = \"none.nrrd\"\ngrid_of = \"scan.nrrd\"\n[lattice]\niso = 0.5\n[output]\nlattice = \"l.ply\"\n";
    let (code, told, object) = pipeline(at, scene, &[]);
    assert!(code == 0 && told.contains("note: import: the grid of the other file is taken"), "{told}");
    assert_eq!(object["stages"][0]["output"]["hash"], hash(&["right.nrrd"]));
    let (code, told, _) = pipeline(at, &scene.replace("[lattice]", "axes = \"LPS\"\n[lattice]"), &[]);
    assert!(code == 2 && told.contains("grid_of says what axes does"), "{told}");
}

#[test]
fn label_files_of_other_programs_are_compared_by_label() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    let label = |[x, y, z]: [usize; 3]| match (x, y, z) {
        (1..=10, 1..=8, 1..=3) => 1,
        (1..=10, 1..=8, 4..=6) => 2,
        _ => 0,
    };
    nrrd(at, "a.nrrd", RIGHT, label);
    // The second label lacks its last layer: 160 voxels of 240 are left.
    nrrd(at, "b.nrrd", RIGHT, |p| if p[2] == 6 { 0 } else { label(p) });
    let told = json(at, &["compare", "a.nrrd", "b.nrrd", "--labels"]);
    let dice = |class: usize| told["classes"][class]["dice"].as_f64().unwrap();
    assert_eq!((told["classes"][1]["a"].clone(), dice(1)), (1.into(), 1.0));
    assert!((dice(2) - 2.0 * 160.0 / (240.0 + 160.0)).abs() < 1e-12, "{told}");
    // The same as of artefacts, of one and of both.
    json(at, &["import", "a.nrrd", "--labels", "-o", "a.ivd"]);
    json(at, &["import", "b.nrrd", "-o", "b.ivd"]);
    for words in [["a.ivd", "b.nrrd"], ["a.ivd", "b.ivd"], ["a.nrrd", "b.ivd"]] {
        let found = json(at, &["compare", words[0], words[1], "--labels"]);
        assert_eq!(found["classes"], told["classes"], "{words:?}");
    }
    let noted = |a: &str, b: &str| {
        let output = ivd(at, &["compare", a, b]);
        assert!(output.status.success());
        String::from_utf8(output.stderr).unwrap()
    };
    // As numbers, with a hint; also where the numbers are real ones.
    assert!(noted("a.nrrd", "b.nrrd").contains("--labels tells how far each label"));
    json(at, &["phantom", "sphere", "--size", "16", "-o", "v.ivd"]);
    json(at, &["phantom", "sphere", "--size", "16", "--noise", "0.1", "-o", "w.ivd"]);
    assert!(!noted("v.ivd", "w.ivd").contains("--labels"), "scans");
    assert!(!noted("a.ivd", "a.nrrd").contains("--labels"), "labels already");
    json(at, &["boundary", "a.ivd", "--class", "1", "-o", "mask.ivd"]);
    let (code, told) = refused(at, &["compare", "mask.ivd", "a.nrrd", "--labels"]);
    assert!(code == 2 && told.contains("mask.ivd: a mask artefact"), "{told}");
}

#[test]
fn what_a_mask_has_at_a_place_is_told() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    nrrd(at, "scan.nrrd", RIGHT, |p| 10 + part(p));
    nrrd(at, "mask.nrrd", RIGHT, |p| u8::from(part(p) == 2));
    json(at, &["import", "mask.nrrd", "--mask", "-o", "mask.ivd"]);
    json(at, &["import", "scan.nrrd", "-o", "scan.ivd"]);
    let place = |voxel: [usize; 3]| {
        let [x, y, z] = voxel.map(|c| c as f64);
        format!("{},{},{}", 20.0 - 0.5 * x, -30.0 + 0.75 * y - 0.1 * z, 7.0 + 2.0 * z)
    };
    for (voxel, inside) in [([8, 5, 4], true), ([3, 4, 3], false)] {
        let place = place(voxel);
        for (flag, file) in [("--mask", "mask.ivd"), ("--mask", "mask.nrrd"), ("--labels", "mask.ivd")] {
            let told = json(at, &["info", "scan.nrrd", "--at", &place, flag, file]);
            assert_eq!(told["at"][0]["voxel"], serde_json::json!(voxel));
            assert_eq!(told["at"][0]["inside_mask"], inside, "{flag} {file} {told}");
        }
    }
    let (code, told) = refused(at, &["info", "scan.nrrd", "--at", &place([1, 1, 1]), "--labels", "scan.ivd"]);
    assert!(code == 2 && told.contains("a volume artefact, not labels or a mask"), "{told}");
}

#[test]
fn what_a_format_rounds_of_a_grid_is_told_in_mm() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    nrrd(at, "scan.nrrd", &RIGHT.replace("-20,30,7", "-20.1,30.7,7.3"), |p| 10 + part(p));
    json(at, &["import", "scan.nrrd", "-o", "scan.ivd"]);
    nrrd(at, "other.nrrd", &RIGHT.replace("-20,30,7", "-20.1,30.7,7.3"), |p| 11 + part(p));
    let ranges = [("scan.nii", true, 1e-9..1e-4), ("other.nrrd", false, 0.0..f64::MIN_POSITIVE)];
    for (name, is_rounded, range) in ranges {
        if is_rounded {
            json(at, &["export", "scan.ivd", "-o", name]);
        }
        let output = ivd(at, &["compare", "scan.ivd", name, "--json"]);
        let told = String::from_utf8(output.stderr).unwrap();
        let found: Value = serde_json::from_slice(&output.stdout).unwrap();
        assert_eq!(found["max"], if is_rounded { 0.0 } else { 1.0 });
        assert_eq!(told.contains("which counts as the same place"), is_rounded, "{told}");
        assert!(range.contains(&found["apart_mm"].as_f64().unwrap()), "{found}");
    }
}

#[test]
fn an_error_that_is_kept_is_no_target_that_is_missed() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    json(at, &["phantom", "head", "--size", "40", "-o", "v.ivd"]);
    json(at, &["lattice", "v.ivd", "--iso", "40", "-o", "l.ivd"]);
    let refine = |target: [&str; 2]| {
        let output = ivd(at, &["refine", "l.ivd", target[0], target[1], "-o", "r.ivd", "--json"]);
        let told = String::from_utf8(output.stderr).unwrap();
        assert!(output.status.success(), "{told}");
        (told, serde_json::from_slice::<Value>(&output.stdout).unwrap()["metrics"].clone())
    };
    // As far as it goes: what stops it is told, and that the error holds.
    let (told, found) = refine(["--max-error", "30"]);
    assert!(!told.contains("isn't as coarse as asked for"), "{told}");
    assert!(told.contains("within 30 mm, as asked for, it gets no coarser: "), "{told}");
    assert_eq!(found["within_mm"], 30.0);
    let (told, found) = refine(["--level", "9"]);
    assert!(told.contains("isn't as coarse as asked for") && found.get("within_mm").is_none(), "{told}");
}

#[test]
fn pixels_are_asked_for_one_or_several_at_a_time() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    json(at, &["phantom", "sphere", "--size", "24", "-o", "v.ivd"]);
    let drawn = |picks: &str| {
        let words = [
            "render", "v.ivd", "--mode", "iso", "--iso", "50", "--size", "40", "--picks", picks, "-o",
            "p.png",
        ];
        json(at, &words)["metrics"]["picks"].clone()
    };
    let both = drawn("20:20,0:0");
    assert_eq!(both[0], drawn("20,20")[0]);
    assert_eq!(both[1], serde_json::json!({ "pixel": [0, 0] }), "nothing is seen there");
    let place = both[0]["place_mm"].as_array().unwrap();
    let radius: f64 = place.iter().map(|c| (c.as_f64().unwrap() - 11.5).powi(2)).sum::<f64>().sqrt();
    assert!(radius < 12.0 && (both[0]["value"].as_f64().unwrap() - 50.0).abs() < 0.1, "{both}");
}
