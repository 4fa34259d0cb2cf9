//! A neck that bends: vertebrae stay rigid, the rest follows (thesis, figure 6.19).
#![allow(clippy::unwrap_used, reason = "a failed step of a test's own preparation is a failed test")]

use std::path::{Path, PathBuf};

use ivd_artefact::Artefact;
use ivd_core::{Displacement, Labels, Lattice, Motion, VoxelIndex};
use serde_json::Value;

use crate::call::{ivd, json};

type Point = [f64; 3];

fn scene() -> PathBuf {
    PathBuf::from(concat!(env!("CARGO_MANIFEST_DIR"), "/../../fixtures/scenes/neck-bend.toml"))
}

/// What the run of a scene left in its cache.
struct Left {
    lattice: Lattice,
    labels: Labels,
    motion: Motion,
    displacement: Displacement,
}

fn left(cache: &Path) -> Left {
    let mut found = (None, None, None, None);
    let mut folders = vec![cache.to_owned()];
    while let Some(folder) = folders.pop() {
        for entry in std::fs::read_dir(folder).unwrap() {
            let path = entry.unwrap().path();
            if path.is_dir() {
                folders.push(path);
            } else if path.extension().is_some_and(|e| e == "ivd") {
                let read = ivd_artefact::read(&path).unwrap();
                match (read.artefact, read.provenance.stage.as_str()) {
                    (Artefact::Lattice(lattice), "refine") => found.0 = Some(lattice),
                    (Artefact::Labels(labels), _) => found.1 = Some(labels),
                    (Artefact::Motion(motion), _) => found.2 = Some(motion),
                    (Artefact::Displacement(displacement), _) => found.3 = Some(displacement),
                    _ => {}
                }
            }
        }
    }
    let (lattice, labels) = (found.0.unwrap(), found.1.unwrap());
    Left { lattice, labels, motion: found.2.unwrap(), displacement: found.3.unwrap() }
}

/// The scene's bones, lowest first: between which heights they lie, and the height that they turn about; −6 degrees each but
/// for the lowest.
const BONES: [([f64; 2], f64); 5] = [
    ([0.0, 15.0], 0.0),
    ([15.0, 26.2], 15.1),
    ([26.3, 37.4], 26.3),
    ([37.5, 48.6], 37.5),
    ([48.7, 63.0], 48.7),
];
const PIVOT: [f64; 2] = [31.6, 27.4];

/// Where a bone takes a point: its own turn, then that of each bone below, about the places at rest.
fn carried(bone: usize, mut p: Point) -> Point {
    let (sine, cosine) = (-6.0_f64).to_radians().sin_cos();
    for (_, height) in BONES[1..=bone].iter().rev() {
        let (y, z) = (p[1] - PIVOT[1], p[2] - height);
        p = [p[0], PIVOT[1] + cosine * y - sine * z, height + sine * y + cosine * z];
    }
    p
}

fn apart(a: Point, b: Point) -> f64 {
    (0..3).map(|i| (a[i] - b[i]).powi(2)).sum::<f64>().sqrt()
}

fn moved(p: Point, by: Point) -> Point {
    std::array::from_fn(|i| p[i] + by[i])
}

/// The bone at a height.
fn bone_at(z: f64) -> Option<usize> {
    BONES.iter().position(|(between, _)| (between[0]..=between[1]).contains(&z))
}

/// Bone of each vertex: a voxel at one end of its grid edge is bone.
fn holders(left: &Left) -> Vec<Option<usize>> {
    let is_bone = |end: Point| {
        let index = VoxelIndex(end.map(|c| c as usize));
        left.labels.ids()[left.labels.grid().linear(index)] == 4
    };
    let of = |v: usize| {
        let at: Point = left.lattice.voxel(v).0.into();
        let beside = is_bone(at.map(f64::floor)) || is_bone(at.map(f64::ceil));
        bone_at(at[2]).filter(|_| beside)
    };
    (0..left.lattice.keys().len()).map(of).collect()
}

fn stage<'a>(told: &'a Value, name: &str) -> &'a Value {
    told["stages"].as_array().unwrap().iter().find(|s| s["stage"] == name).unwrap()
}

#[test]
fn vertebrae_stay_rigid_and_the_rest_of_the_neck_follows() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    let told = json(at, &["pipeline", scene().to_str().unwrap(), "--out", "out"]);

    // What the record says of each bone.
    let bones = stage(&told, "deform")["metrics"]["bones"].as_array().unwrap().clone();
    let names: Vec<&str> = bones.iter().map(|b| b["name"].as_str().unwrap()).collect();
    assert_eq!(names, ["C7", "C6", "C5", "C4", "C3"]);
    for (k, bone) in bones.iter().enumerate() {
        let number = |key: &str| bone[key].as_f64().unwrap();
        assert!((number("angle_deg") - 6.0 * k as f64).abs() < 1e-9, "{bone}");
        assert!(k == 0 || (bone["axis"][0].as_f64().unwrap() + 1.0).abs() < 1e-12, "{bone}");
        assert!(number("strain") < 1e-12, "{bone}");
        let vector = |key: &str| -> Point { std::array::from_fn(|a| bone[key][a].as_f64().unwrap()) };
        let centre = vector("centre_mm");
        assert!(apart(moved(centre, vector("shift_mm")), carried(k, centre)) < 1e-10, "{bone}");
    }
    let page = std::fs::read_to_string(at.join("out/report.html")).unwrap();
    let table = page.split("<th>bone</th>").nth(1).unwrap().split("</table>").next().unwrap();
    assert!(names.iter().all(|name| table.contains(&format!("<td>{name}</td>"))), "{table}");

    // Every vertex of a bone goes where the chain of turns takes it, and no distance between two of them changes.
    let left = left(&at.join("cache"));
    let holders = holders(&left);
    let last = &left.motion.frames().last().unwrap().displacement;
    let rest = |v: usize| -> Point { left.lattice.world(v).0.into() };
    for (k, bone) in bones.iter().enumerate() {
        let own: Vec<usize> = (0..holders.len()).filter(|&v| holders[v] == Some(k)).collect();
        assert_eq!(own.len() as u64, bone["vertices"].as_u64().unwrap(), "{bone}");
        assert!(own.len() > 30, "{bone}");
        let now = |v: usize| moved(rest(v), last[v]);
        for (i, &v) in own.iter().enumerate() {
            assert!(apart(now(v), carried(k, rest(v))) < 1e-11, "vertex {v} of {bone}");
            for &u in &own[..i] {
                let before = apart(rest(u), rest(v));
                assert!((apart(now(u), now(v)) / before - 1.0).abs() < 1e-12, "{u} and {v} of {bone}");
            }
        }
    }
    // The discs lie between what their two vertebrae do.
    let disc: Vec<usize> = (0..holders.len()).filter(|&v| holders[v].is_none()).collect();
    assert!(disc.len() > 20 && stage(&told, "deform")["metrics"]["residual"].as_f64().unwrap() <= 1e-3);
    for &v in &disc {
        let p = rest(v);
        let Some(above) = (1..5).find(|&k| (p[2] - BONES[k].1).abs() < 3.0) else { continue };
        let [low, high] = [above - 1, above].map(|k| carried(k, p));
        let now = moved(p, last[v]);
        let span = apart(low, high);
        assert!(
            apart(now, low) < span + 0.5 && apart(now, high) < span + 0.5,
            "vertex {v} at {p:?}: {now:?}"
        );
    }

    // The map is one-to-one, and takes the flesh along.
    let map = &stage(&told, "map")["metrics"];
    assert!(map["folds"] == 0 && map["min_det_j"].as_f64().unwrap() > 0.05, "{map}");
    let grid = left.labels.grid();
    let by = |index: VoxelIndex| -> Point { left.displacement.forward().at(index).map(f64::from) };
    let (mut worst, mut squares, mut count) = (0.0_f64, 0.0, 0.0);
    let (mut flesh, mut lag) = (0, 0.0_f64);
    for i in 0..grid.len() {
        let index = grid.index(i);
        let p = index.0.map(|c| c as f64);
        let Some(k) = bone_at(p[2]) else { continue };
        let off = apart(moved(p, by(index)), carried(k, p));
        match left.labels.ids()[i] {
            4 => {
                (worst, count) = (worst.max(off), count + 1.0);
                squares += off * off;
            }
            // The throat, in front of the highest vertebra, at the far side of the neck, goes nearly as that does.
            2 if k == 4 && p[1] > 45.0 && (p[2] - 54.0).abs() < 3.0 => {
                flesh += 1;
                lag = lag.max(off / apart(p, carried(k, p)));
            }
            _ => {}
        }
    }
    let rms = f64::sqrt(squares / count);
    // Motions are of up to 12 mm, cells of 4 voxels; vertebrae are 3 voxels apart.
    assert!(worst < 0.3 && rms < 0.05, "bone voxels are off by {worst} mm at most, {rms} rms");
    assert!(flesh > 100 && lag < 0.3, "the throat stays behind by {lag} of its motion, {flesh} voxels");
}

#[test]
fn bones_are_moved_from_the_command_line_or_refused_by_name() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    json(at, &["phantom", "sphere", "--size", "32", "-o", "v.ivd"]);
    json(at, &["lattice", "v.ivd", "--iso", "128", "-o", "l.ivd"]);
    json(at, &["refine", "l.ivd", "--level", "1", "-o", "r.ivd"]);
    let cap = "name=cap;low=0,0,22;high=32,32,32;move=0,0,2;reach=40";
    let base = "name=base;low=0,0,0;high=32,32,9;reach=0";
    let deform = |more: &[&str]| -> Vec<String> {
        let words = ["deform", "r.ivd", "--solver", "projective", "-o", "m.ivd"];
        words.iter().chain(more).map(|word| (*word).to_owned()).collect()
    };
    let told = |more: &[&str]| {
        let words = deform(more);
        json(at, &words.iter().map(String::as_str).collect::<Vec<_>>())["metrics"].clone()
    };
    let pulled = told(&["--rigid", cap, "--rigid", base]);
    assert_eq!(pulled["bones"][0]["shift_mm"], serde_json::json!([0.0, 0.0, 2.0]));
    assert!(pulled["residual"].as_f64().unwrap() <= 1e-3 && pulled["bones"][0]["angle_deg"] == 0.0);
    assert!(pulled["bones"][0]["force_mn"][2].as_f64().unwrap() > 0.0, "{pulled}");
    assert_eq!(pulled["bones"][1]["shift_mm"], serde_json::json!([0.0, 0.0, 0.0]));
    // The same by a handle on it, and a bone that stays moves nothing.
    let fitted = cap.replace("move=0,0,2", "fit=true");
    let handle = "pick=16,16,27;move=0,0,2;radius=3";
    let again = told(&["--rigid", &fitted, "--rigid", base, "--handle", handle]);
    assert!(again["bones"][0]["left_mm"].as_f64().unwrap() < 1e-12, "{again}");
    assert_eq!(again["bones"][0]["shift_mm"], pulled["bones"][0]["shift_mm"]);
    assert_eq!(told(&["--rigid", base])["vertices_moved"], 0);

    for (more, word) in [
        (vec!["--rigid", cap, "--solver", "ring"], "rigid: ring doesn't read it"),
        (
            vec!["--rigid", cap, "--rigid", "name=cap;centre=16,16,5;radius=4;reach=3"],
            "two bones are called cap",
        ),
        (vec!["--rigid", cap, "--rigid", "low=0,0,20;high=32,32,24;reach=3"], "both hold vertex"),
        (vec!["--rigid", "low=0,0,90;high=32,32,94;reach=3"], "holds no vertex"),
        (vec!["--rigid", "class=4;move=0,0,1;reach=3"], "labels"),
        (vec!["--rigid", &fitted], "no handle lies on it"),
        (vec!["--rigid", cap, "--handle", handle], "whose motion is given"),
        (vec!["--rigid", "centre=16,16,16;reach=3"], "radius"),
        (
            vec!["--rigid", "name=a;parent=b;centre=16,16,5;radius=4;pivot=1,2,3;angle=4;reach=3"],
            "isn't there",
        ),
        (vec!["--rigid", cap, "--fix", "pick=16,16,27;radius=3"], "is fixed"),
    ] {
        let mut words: Vec<&str> = vec!["deform", "r.ivd", "-o", "x.ivd"];
        if !more.contains(&"--solver") {
            words.extend(["--solver", "projective"]);
        }
        words.extend(&more);
        let output = ivd(at, &words);
        let said = String::from_utf8_lossy(&output.stderr).into_owned();
        assert_eq!(output.status.code(), Some(2), "{more:?}: {said}");
        assert!(said.contains(word), "{more:?}: {said}");
        assert!(!at.join("x.ivd").exists());
    }
}
