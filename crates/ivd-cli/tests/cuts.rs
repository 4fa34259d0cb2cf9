//! Scenes that clip and combine: what single commands make of the same values, byte for byte.
#![allow(clippy::unwrap_used, reason = "a test fails where it can't go on")]

use std::path::{Path, PathBuf};

use serde_json::Value;

use crate::call::{json, refused};

/// A head whose brightest class is a part, pressed at the front.
const SCENE: &str = "schema = 1\n[input]\nphantom = \"head\"\nsize = 32\n[segment]\nk = 4\n[boundary]\nclass = \"densest\"\n\
    [lattice]\niso = 60.0\n[render]\nsize = 96\n";
const MOVED: &str = "[[deform.handle]]\npick = [15.0, 30.0, 16.0]\nmove = [0.0, -3.0, 0.0]\nradius = 12.0\n";
const PLANES: &str = "[[clip.planes]]\npoint = [16.0, 20.0, 16.0]\nnormal = [0.2, -1.0, 0.1]\n";
const PLANE: &str = "point=16,20,16;normal=0.2,-1,0.1";

/// Runs a scene; its outputs lie in `out`.
fn run(at: &Path, parts: &[&str], output: &str, more: &[&str]) -> Value {
    let text = format!("{SCENE}{}[output]\n{output}\n", parts.concat());
    std::fs::write(at.join("scene.toml"), text).unwrap();
    json(at, &[&["pipeline", "scene.toml", "--out", "out", "--cache", "cache"][..], more].concat())
}

fn record<'a>(told: &'a Value, stage: &str) -> &'a Value {
    let all = told["stages"].as_array().unwrap();
    all.iter()
        .find(|s| s["stage"] == stage && s["output"].is_object())
        .unwrap_or_else(|| panic!("{stage}: {told}"))
}

/// The artefact that a stage of a scene gave.
fn made(at: &Path, told: &Value, stage: &str) -> PathBuf {
    at.join(record(told, stage)["output"]["path"].as_str().unwrap())
}

fn bytes(at: &Path, file: &str) -> Vec<u8> {
    std::fs::read(at.join(file)).unwrap()
}

/// What a command makes of artefacts, as the scene writes it; with the figures.
fn command(at: &Path, words: &[&str], inputs: &[&Path]) -> (Vec<u8>, Value) {
    let inputs: Vec<&str> = inputs.iter().map(|path| path.to_str().unwrap()).collect();
    let told = json(at, &[&words[..1], &inputs[..], &words[1..], &["-o", "c.ivd"]].concat());
    json(at, &["export", "c.ivd", "-o", "c.nrrd"]);
    (bytes(at, "c.nrrd"), told["metrics"].clone())
}

fn figure(told: &Value, name: &str) -> u64 {
    told[name].as_u64().unwrap_or_else(|| panic!("{name}: {told}"))
}

#[test]
fn a_scene_clips_the_deformed_volume_as_the_command_does() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    let output = "volume = \"v.nrrd\"\nmask = \"m.nrrd\"";
    let told = run(at, &[MOVED, PLANES], output, &[]);
    let [warped, displacement, part] = ["warp", "map", "boundary"].map(|stage| made(at, &told, stage));
    let displacement = displacement.to_str().unwrap();
    let (seen, figures) = command(at, &["clip", "--plane", PLANE], &[&warped]);
    assert!(bytes(at, "out/v.nrrd") == seen, "a plane lies where the deformed body is");
    assert_eq!(record(&told, "clip")["metrics"], figures);
    assert!(figure(&figures, "voxels_kept") > 1000 && figure(&figures, "voxels_clipped") > 1000);

    let told = run(at, &[MOVED, "[clip]\nspace = \"rest\"\n", PLANES], output, &[]);
    let words = ["clip", "--plane", PLANE, "--displacement", displacement];
    let (at_rest, figures) = command(at, &words, &[&warped]);
    assert!(bytes(at, "out/v.nrrd") == at_rest && at_rest != seen, "it goes along with the body");
    assert_eq!(record(&told, "clip")["metrics"], figures);

    // What the scene found lies in the body at rest, where nothing else is said.
    let told = run(at, &[MOVED, "[clip]\ntag = \"mask\"\ninvert = true\nbackground = 7\n"], output, &[]);
    let tag = part.to_str().unwrap();
    let words = ["clip", "--tag", tag, "--invert", "--background", "7", "--displacement", displacement];
    let (tagged, figures) = command(at, &words, &[&warped]);
    assert!(bytes(at, "out/v.nrrd") == tagged);
    assert_eq!(record(&told, "clip")["metrics"], figures);
    // A file is put where it says, and a box and the names of flags go too.
    std::fs::copy(&part, at.join("part.ivd")).unwrap();
    run(
        at,
        &[MOVED, "[clip]\ntag = \"part.ivd\"\n[[clip.box]]\nmin = [4, 4, 4]\nmax = [28, 28, 20]\n"],
        output,
        &[],
    );
    let words = ["clip", "--tag", tag, "--box", "min=4,4,4;max=28,28,20"];
    assert!(bytes(at, "out/v.nrrd") == command(at, &words, &[&warped]).0);
}

#[test]
fn a_scene_without_a_motion_clips_its_input_and_one_that_says_so_before_all_else() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    let told = run(at, &[PLANES], "volume = \"v.nrrd\"\nimages = [\"before\", \"after\"]", &[]);
    let input = made(at, &told, "import");
    let (clipped, figures) = command(at, &["clip", "--plane", PLANE], &[&input]);
    assert!(bytes(at, "out/v.nrrd") == clipped);
    assert_eq!(record(&told, "clip")["metrics"], figures);
    assert_ne!(bytes(at, "out/before.png"), bytes(at, "out/after.png"));

    let told = run(at, &[MOVED, "[clip]\nof = \"input\"\n", PLANES], "volume = \"v.nrrd\"", &[]);
    let clip = record(&told, "clip");
    assert_eq!((&clip["variant"], &clip["metrics"]), (&"input".into(), &figures));
    let hash = &clip["output"]["hash"];
    assert!(
        ["lattice", "warp"].iter().all(|stage| record(&told, stage)["inputs"]["volume"] == *hash),
        "{told}"
    );
    json(at, &["clip", input.to_str().unwrap(), "--plane", PLANE, "-o", "i.ivd"]);
    let displacement = made(at, &told, "map");
    assert!(bytes(at, "out/v.nrrd") == command(at, &["warp"], &[&at.join("i.ivd"), &displacement]).0);
    // Without a motion that is all that comes of it.
    run(at, &["[clip]\nof = \"input\"\n", PLANES], "volume = \"v.nrrd\"", &[]);
    assert!(bytes(at, "out/v.nrrd") == clipped);
}

#[test]
fn a_scene_combines_its_volume_with_what_it_found_and_with_files() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    let output = "volume = \"v.nrrd\"\nlabels = \"l.nrrd\"\nmask = \"m.nrrd\"";
    let of_mask = "[combine]\nop = \"intersection\"\nwith = \"mask\"\n";
    let told = run(at, &[MOVED, of_mask], output, &[]);
    let [warped, displacement, part] = ["warp", "map", "boundary"].map(|stage| made(at, &told, stage));
    let through = format!("2={}", displacement.to_str().unwrap());
    let words = ["combine", "--op", "intersection", "--displacement", &through];
    let (combined, figures) = command(at, &words, &[&warped, &part]);
    assert!(bytes(at, "out/v.nrrd") == combined);
    assert_eq!(record(&told, "combine")["metrics"], figures);
    assert!(figure(&figures, "voxels_changed") > 1000);

    let told = run(at, &[MOVED, &of_mask.replace("mask", "labels"), "space = \"deformed\"\n"], output, &[]);
    let labels = made(at, &told, "segment");
    assert!(
        bytes(at, "out/v.nrrd") == command(at, &["combine", "--op", "intersection"], &[&warped, &labels]).0
    );

    // A volume's file, windows, and a clip of what comes of it.
    json(at, &["phantom", "sphere", "--size", "32", "-o", "ball.ivd"]);
    json(at, &["export", "ball.ivd", "-o", "ball.nrrd"]);
    let of_file = "[combine]\nop = \"difference\"\nwith = \"ball.nrrd\"\nwindow = [[0, 200], [0, 255]]\n";
    let told = run(at, &[MOVED, of_file, PLANES], output, &[]);
    let words = ["combine", "--op", "difference", "--window", "0,200", "--window", "0,255"];
    let (combined, figures) = command(at, &words, &[&warped, Path::new("ball.nrrd")]);
    assert_eq!(record(&told, "combine")["metrics"], figures);
    let clipped = command(at, &["clip", "--plane", PLANE], &[&made(at, &told, "combine")]).0;
    assert!(bytes(at, "out/v.nrrd") == clipped && clipped != combined);
    // A file that changes is read again; one that doesn't, isn't.
    let again = run(at, &[MOVED, of_file, PLANES], output, &[]);
    assert!(
        ["combine", "clip", "import"].iter().all(|stage| record(&again, stage)["cached"] == true),
        "{again}"
    );
    json(at, &["phantom", "torus", "--size", "32", "-o", "ball.ivd"]);
    json(at, &["export", "ball.ivd", "-o", "ball.nrrd"]);
    let again = run(at, &[MOVED, of_file, PLANES], output, &[]);
    assert_eq!(record(&again, "combine")["cached"], false);
    assert!(bytes(at, "out/v.nrrd") != clipped);
}

#[test]
fn pictures_and_report_show_what_is_left_by_the_camera_of_the_whole() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    let output = "images = [\"before\", \"after\", \"difference\"]\nreport = true";
    run(at, &[MOVED], output, &[]);
    let [before, after] = ["before", "after"].map(|name| bytes(at, &format!("out/{name}.png")));
    let told = run(at, &[MOVED, PLANES], output, &[]);
    assert!(bytes(at, "out/before.png") == before, "a clip leaves the picture at rest alone");
    assert!(bytes(at, "out/after.png") != after);
    let page = String::from_utf8(bytes(at, "out/report.html")).unwrap();
    let kept = figure(&record(&told, "clip")["metrics"], "voxels_kept");
    assert!(page.contains(&format!("data-figure='clip.voxels_kept' data-value='{kept}'")));
    assert!(page.contains("what came of it"));
}

/// A picture that a scene drew, shape `[height, width]`.
fn picture(at: &Path, told: &Value, variant: &str) -> Vec<[u8; 4]> {
    let all = told["stages"].as_array().unwrap();
    let record = all.iter().find(|s| s["stage"] == "render" && s["variant"] == variant).unwrap();
    let read = ivd_artefact::read(at.join(record["output"]["path"].as_str().unwrap())).unwrap();
    let ivd_artefact::Artefact::Image(image) = read.artefact else { panic!("{record}") };
    image.rgba().chunks(4).map(|pixel| pixel.try_into().unwrap()).collect()
}

#[test]
fn half_of_a_projection_that_is_kept_has_the_pixels_of_the_whole() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    // Seen from the front the patient's left, x below 15, lies on the picture's right.
    let mip = "mode = \"mip\"\nview = \"front\"\n[[clip.planes]]\npoint = [15.0, 0.0, 0.0]\nnormal = [-1.0, 0.0, 0.0]\n";
    let told = run(at, &[mip], "images = [\"before\", \"after\"]", &[]);
    let [before, after] = ["before", "after"].map(|variant| picture(at, &told, variant));
    let columns = |from: usize, to: usize| {
        let rows = before.chunks(96).zip(after.chunks(96));
        rows.map(move |(a, b)| a[from..to].iter().zip(&b[from..to]).filter(|(a, b)| a != b).count())
            .sum::<usize>()
    };
    assert_eq!(columns(53, 96), 0, "one camera and one window");
    assert!(columns(0, 40) > 1000, "the other half is gone");
}

#[test]
fn what_a_scene_cannot_clip_or_combine_is_refused_with_the_key() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    let cases: [(&str, &str, &str); 9] = [
        ("[clip]\ninvert = true\n", "volume = \"v.nrrd\"", "nothing to clip by"),
        ("[combine]\nop = \"union\"\n", "volume = \"v.nrrd\"", "nothing to combine with"),
        (
            "[clip]\nclass = 2\n[[clip.planes]]\npoint = [1, 1, 1]\nnormal = [0, 0, 1]\n",
            "volume = \"v.nrrd\"",
            "clip.class",
        ),
        ("[clip]\ntag = \"mask\"\nof = \"input\"\n", "volume = \"v.nrrd\"", "clip.tag"),
        ("[clip]\ntag = \"nothing.nrrd\"\n", "volume = \"v.nrrd\"", "nothing.nrrd"),
        ("[clip]\ntag = \"/tmp/m.nrrd\"\n", "volume = \"v.nrrd\"", "absolute paths"),
        ("[[clip.planes]]\npoint = [1, 1, 1]\nnormal = [0, 0, 0]\n", "volume = \"v.nrrd\"", "length 0"),
        ("[combine]\nwith = \"mask\"\nwindow = [[3, 3]]\n", "volume = \"v.nrrd\"", "no opacities"),
        (
            "[clip]\nof = \"input\"\n[[clip.planes]]\npoint = [1, 1, 1]\nnormal = [0, 0, 1]\n",
            "images = [\"after\"]",
            "shows a deformation",
        ),
    ];
    for (parts, output, word) in cases {
        std::fs::write(at.join("scene.toml"), format!("{SCENE}{parts}[output]\n{output}\n")).unwrap();
        let (code, told) = refused(at, &["pipeline", "scene.toml", "--out", "out"]);
        assert!(matches!(code, 2 | 3 | 7) && told.contains(word), "{word}: {code} {told}");
    }
}

#[test]
fn frames_of_a_motion_are_exported_each_mapped_as_the_map_does() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    json(at, &["phantom", "sphere", "--size", "40", "-o", "v.ivd"]);
    json(at, &["lattice", "v.ivd", "--iso", "128", "-o", "cut.ivd"]);
    json(at, &["refine", "cut.ivd", "--level", "1", "-o", "l.ivd"]);
    json(at, &["octree", "l.ivd", "-o", "o.ivd"]);
    let motion =
        ["deform", "l.ivd", "--solver", "xpbd", "--frames", "3", "--duration", "0.02", "-o", "m.ivd"];
    json(at, &[&motion[..], &["--handle", "pick=20,33,20;move=0,-2,0;radius=12"]].concat());
    let export = |words: &[&str]| json(at, &[&["export", "m.ivd", "--lattice", "l.ivd"], words].concat());

    let told = export(&["--frame", "all", "-o", "f.ply"]);
    let named: Vec<&str> =
        told["outputs"].as_array().unwrap().iter().map(|o| o["path"].as_str().unwrap()).collect();
    assert_eq!(named, ["f_0000.ply", "f_0001.ply", "f_0002.ply"]);
    let meshes = [0, 1, 2].map(|i| bytes(at, &format!("f_000{i}.ply")));
    assert!(meshes[0] != meshes[1] && meshes[1] != meshes[2]);
    export(&["-o", "last.ply"]);
    export(&["--frame", "1", "-o", "one.ply"]);
    assert!(bytes(at, "last.ply") == meshes[2] && bytes(at, "one.ply") == meshes[1]);

    let told = export(&["--frame", "all", "--direction", "forward", "-o", "d.nrrd"]);
    for (frame, output) in told["outputs"].as_array().unwrap().iter().enumerate() {
        let number = frame.to_string();
        let map = json(at, &["map", "l.ivd", "o.ivd", "m.ivd", "--frame", &number, "-o", "d.ivd"]);
        json(at, &["export", "d.ivd", "--direction", "forward", "-o", "d.nrrd"]);
        assert!(bytes(at, &format!("d_000{frame}.nrrd")) == bytes(at, "d.nrrd"), "frame {frame}");
        let figure = |told: &Value, name: &str| told["metrics"][name].clone();
        assert_eq!(figure(output, "folds"), 0);
        assert_eq!(figure(output, "min_det_j"), figure(&map, "min_det_j"));
    }

    for (words, word) in [
        (&["m.ivd", "--frame", "all", "-o", "x.ply"][..], "--lattice"),
        (
            &["m.ivd", "--lattice", "l.ivd", "--frame", "3", "-o", "x.ply"],
            "the motion has 3, numbered from 0",
        ),
        (
            &["m.ivd", "--lattice", "l.ivd", "--frame", "3", "-o", "x.nrrd"],
            "the motion has 3, numbered from 0",
        ),
        (&["m.ivd", "--lattice", "l.ivd", "--frame", "0", "-o", "x.pvd"], "leave --frame out"),
        (&["m.ivd", "--lattice", "l.ivd", "-o", "x.nii.gz"], "add --frame N, or --frame all"),
        (&["m.ivd", "--lattice", "l.ivd", "--frame", "last", "-o", "x.ply"], "or all"),
        (&["d.ivd", "--frame", "0", "-o", "x.nrrd"], "a displacement artefact has no frames"),
        (&["l.ivd", "--frame", "all", "-o", "x.ply"], "a lattice artefact has no frames"),
    ] {
        let (code, told) = refused(at, &[&["export"], words].concat());
        assert!(code == 2 && told.contains(word), "{words:?}: {code} {told}");
    }
}
