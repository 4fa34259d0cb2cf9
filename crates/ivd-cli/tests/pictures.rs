//! Pictures as people ask for them: the same in a scene and on a command line.
#![allow(clippy::unwrap_used, reason = "a test fails where it can't go on")]

use std::path::Path;

use crate::call::{json, refused};

const SCENE: &str = r##"
schema = 1
[input]
phantom = "head"
size = 32
[segment]
k = 4
[[deform.handle]]
pick = [15.0, 30.0, 16.0]
move = [0.0, -2.0, 0.0]
radius = 12.0
[render]
view = "left"
size = 96
hide = [4]
opacity.3 = 0.2
colour.2 = "#00ff00"
"##;

/// A folder with what the scene makes of the phantom, stage by stage.
fn stages(at: &Path) {
    json(at, &["phantom", "head", "--size", "32", "-o", "v.ivd"]);
    json(at, &["segment", "v.ivd", "--k", "4", "-o", "l.ivd"]);
    json(at, &["atf", "v.ivd", "l.ivd", "-o", "t.ivd"]);
}

fn pipeline(at: &Path, images: &str, more: &[&str]) {
    std::fs::write(at.join("scene.toml"), format!("{SCENE}[output]\nimages = [{images}]\n")).unwrap();
    json(at, &[&["pipeline", "scene.toml", "--out", "out"][..], more].concat());
}

fn bytes(at: &Path, file: &str) -> Vec<u8> {
    std::fs::read(at.join(file)).unwrap()
}

#[test]
fn a_scene_and_flags_of_the_same_names_give_the_same_bytes() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    stages(at);
    let render = |transfer: &str, words: &str| {
        let all = ["render", "v.ivd", "--transfer", transfer, "-o", "p.png"];
        json(at, &[&all[..], &words.split(' ').collect::<Vec<_>>()].concat());
        bytes(at, "p.png")
    };
    pipeline(at, "\"before\"", &[]);
    let words = "--view left --size 96 --hide 4 --opacity 3=0.2";
    let picture = render("t.ivd", &format!("{words} --colour 2=#00ff00"));
    assert_eq!(bytes(at, "out/before.png"), picture);
    // By numbers and by the other name.
    let by_numbers = "--view 90,0 --size 96x96 --hide 4 --opacity 3=0.2 --color 2=#00FF00";
    assert_eq!(render("t.ivd", by_numbers), picture);
    assert_ne!(render("t.ivd", "--view left --size 96"), picture);
    // What all of a transfer function is written to is read as it is.
    json(at, &["export", "t.ivd", "-o", "t.json"]);
    assert_eq!(render("t.json", &format!("{words} --colour 2=#00ff00")), picture);
    // Other programs' files hold the function of the values to half of 1/255, of which a picture gathers some.
    let drawn = |transfer: &str, output: &str| {
        json(
            at,
            &["render", "v.ivd", "--transfer", transfer, "--view", "left", "--size", "96", "-o", output],
        );
    };
    drawn("t.ivd", "own.ivd");
    for file in ["t.vp.json", "t.paraview.json"] {
        json(at, &["export", "t.ivd", "-o", file]);
        drawn(file, "theirs.ivd");
        let apart = json(at, &["compare", "own.ivd", "theirs.ivd"]);
        assert!(apart["max"].as_f64().is_some_and(|max| max <= 8.0), "{file}: {apart}");
    }
}

#[test]
fn classes_that_are_not_known_and_values_that_do_not_fit_are_told() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    stages(at);
    json(at, &["export", "t.ivd", "-o", "t.vp.json"]);
    let of = |transfer: &str, words: &str| {
        let all = ["render", "v.ivd", "--transfer", transfer, "-o", "x.png"];
        refused(at, &[&all[..], &words.split(' ').collect::<Vec<_>>()].concat())
    };
    for (transfer, words, told) in [
        ("t.ivd", "--hide 9", &["hide", "no class 9", "1, 2, 3, 4"][..]),
        ("t.ivd", "--opacity 9=0.1", &["opacity.9", "1, 2, 3, 4"]),
        ("t.ivd", "--opacity 3=1.5", &["--opacity", "3", "0 … 1"]),
        ("t.ivd", "--opacity 3", &["--opacity", "CLASS=value"]),
        ("t.ivd", "--colour 3=red", &["--colour", "#ff8800"]),
        ("t.ivd", "--hide 3 --opacity 3=0.1", &["hide", "keep one"]),
        ("t.vp.json", "--hide 3", &["knows no classes", "ivd atf"]),
        ("t.ivd", "--view letf", &["--view", "left"]),
        ("t.ivd", "--size 12x", &["--size", "12x"]),
        ("t.ivd", "--mode mip --hide 3", &["hide", "dvr"]),
    ] {
        let (code, text) = of(transfer, words);
        assert!(code == 2 && told.iter().all(|part| text.contains(part)), "{words}: {code} {text}");
    }
}

#[test]
fn pictures_before_and_after_have_one_camera_and_one_alone_makes_no_motion() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    stages(at);
    let explained = |images: &str, out: &str| {
        std::fs::write(at.join("scene.toml"), format!("{SCENE}[output]\nimages = [{images}]\n")).unwrap();
        let run = json(at, &["pipeline", "scene.toml", "--out", out]);
        let stages = run["stages"].as_array().unwrap().clone();
        stages
            .into_iter()
            .map(|record| (record["stage"].as_str().unwrap().to_owned(), record))
            .collect::<Vec<_>>()
    };
    let alone = explained("\"before\"", "alone");
    let map = |records: &[(String, serde_json::Value)]| {
        records.iter().find(|(stage, _)| stage == "map").unwrap().1["state"].as_str().unwrap().to_owned()
    };
    assert_eq!(map(&alone), "not_needed");
    let both = explained("\"before\", \"after\"", "both");
    assert_eq!(map(&both), "ran");
    // The picture of rest is drawn with room for the motion, which the command line names by hand.
    let before =
        both.iter().find(|(stage, record)| stage == "render" && record["variant"] == "before").unwrap();
    assert!(before.1["inputs"]["framing"].is_string(), "{}", before.1);
    let whole = ["--set", "render.fit=volume"];
    pipeline(at, "\"before\", \"after\"", &whole);
    let with_motion = bytes(at, "out/before.png");
    pipeline(at, "\"before\"", &whole);
    assert_eq!(bytes(at, "out/before.png"), with_motion, "by the volume a motion decides nothing");
}

#[test]
fn a_turntable_is_an_animation_of_single_views_by_one_scale() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    json(at, &["phantom", "head", "--size", "24", "-o", "v.ivd"]);
    let render = |words: &str, output: &str| {
        let all =
            ["render", "v.ivd", "--mode", "mip", "--size", "40x32", "--annotate", "false", "-o", output];
        json(at, &[&all[..], &words.split_whitespace().collect::<Vec<_>>()].concat())
    };
    let record = render("--turntable 4 --fit volume", "turn.ivd");
    assert_eq!(record["metrics"]["frames"], 4);
    json(at, &["export", "turn.ivd", "-o", "turn.png", "--frame", "all"]);
    for frame in 0..4 {
        // The scale of the whole volume is that of each view.
        render(&format!("--fit volume --view {},15", 30 + 90 * frame), "one.png");
        assert_eq!(bytes(at, &format!("turn_000{frame}.png")), bytes(at, "one.png"), "frame {frame}");
    }
    for (file, starts) in [("turn.gif", &b"GIF89a"[..]), ("turn.apng", b"\x89PNG"), ("turn.PNG", b"\x89PNG")]
    {
        render("--turntable 4", file);
        assert!(bytes(at, file).starts_with(starts), "{file}");
    }
    assert_eq!(bytes(at, "turn.apng"), bytes(at, "turn.PNG"));
    // What is seen is what is turned: it fits at every angle, and turning half round turns it over.
    let info = json(at, &["info", "turn.ivd"]);
    let content = &info["content"];
    assert!(content["frames"] == 4 && content["light"] == false, "{info}");
    let (code, told) = refused(at, &["export", "turn.ivd", "-o", "x.png", "--frame", "4"]);
    assert!(code == 2 && told.contains("has 4"), "{told}");
    let (code, told) = refused(at, &["render", "v.ivd", "--mode", "mip", "--turntable", "4", "-o", "x.exr"]);
    assert!(code == 2 && told.contains("--frame all"), "{told}");
    let (code, told) = refused(at, &["render", "v.ivd", "--mode", "mip", "-o", "x.jpg"]);
    assert!(code == 2 && told.contains(".apng"), "{told}");
}

#[test]
fn an_exr_holds_the_light_that_the_png_is_made_of() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    json(at, &["phantom", "head", "--size", "24", "-o", "v.ivd"]);
    let render = |words: &str| {
        let all = ["render", "v.ivd", "--mode", "mip", "--size", "16", "--annotate", "false"];
        json(at, &[&all[..], &words.split(' ').collect::<Vec<_>>()].concat())
    };
    render("-o light.exr");
    assert!(bytes(at, "light.exr").starts_with(&[0x76, 0x2f, 0x31, 0x01]));
    render("--keep-light -o light.ivd");
    json(at, &["export", "light.ivd", "-o", "again.exr"]);
    assert_eq!(bytes(at, "light.exr"), bytes(at, "again.exr"));
    render("-o plain.ivd");
    let (code, told) = refused(at, &["export", "plain.ivd", "-o", "x.exr"]);
    assert!(code == 2 && told.contains("--keep-light"), "{told}");
    assert_eq!(json(at, &["compare", "plain.ivd", "light.ivd"])["max"], 0.0);
}

#[test]
fn a_png_of_16_bits_is_of_light_that_was_kept() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    json(at, &["phantom", "head", "--size", "24", "-o", "v.ivd"]);
    let kept = ["render", "v.ivd", "--mode", "mip", "--size", "16", "--keep-light", "-o", "light.ivd"];
    json(at, &kept);
    let export =
        |depth: &str, output: &str| json(at, &["export", "light.ivd", "--depth", depth, "-o", output]);
    export("8", "eight.png");
    export("16", "sixteen.png");
    // The depth of a PNG is byte 24 of the file.
    assert_eq!([bytes(at, "eight.png")[24], bytes(at, "sixteen.png")[24]], [8, 16]);
    json(at, &["render", "v.ivd", "--mode", "mip", "--size", "16", "-o", "plain.ivd"]);
    for (words, told) in [
        ("export plain.ivd --depth 16 -o x.png", "--keep-light"),
        ("export light.ivd --depth 12 -o x.png", "8 or 16"),
        ("export light.ivd --depth 16 -o x.gif", "--depth"),
        ("export v.ivd --depth 16 -o x.nii", "--depth"),
    ] {
        let (code, text) = refused(at, &words.split(' ').collect::<Vec<_>>());
        assert!(code == 2 && text.contains(told), "{words}: {code} {text}");
    }
}

#[test]
fn before_and_after_are_put_side_by_side_and_wiped() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    let run = |output: &str, more: &[&str]| {
        std::fs::write(at.join("scene.toml"), format!("{SCENE}[output]\n{output}\n")).unwrap();
        json(at, &[&["pipeline", "scene.toml", "--out", "out"][..], more].concat())
    };
    let sides = "side_by_side = \"both.png\"\nwipe = \"wipe.gif\"";
    let record = run(sides, &[]);
    // A PNG's width and height are its words from byte 16 on.
    let both = bytes(at, "out/both.png");
    let word = |at: usize| u32::from_be_bytes(both[at..at + 4].try_into().unwrap());
    assert_eq!([word(16), word(20)], [2 * 96 + 2, 96]);
    assert!(bytes(at, "out/wipe.gif").starts_with(b"GIF89a"));
    let written: Vec<&str> =
        record["outputs"].as_array().unwrap().iter().map(|o| o["name"].as_str().unwrap()).collect();
    assert_eq!(written, ["side_by_side", "wipe"], "nothing that wasn't asked for: {record}");
    // What is there already isn't made again; another view makes it anew.
    assert!(run(sides, &[])["outputs"].as_array().unwrap().iter().all(|o| o["written"] == false));
    run(sides, &["--set", "render.view=right"]);
    assert_ne!(bytes(at, "out/both.png"), both);
    let refused_with = |output: &str, more: &[&str]| {
        std::fs::write(at.join("scene.toml"), format!("{SCENE}[output]\n{output}\n")).unwrap();
        refused(at, &[&["pipeline", "scene.toml", "--out", "out"][..], more].concat())
    };
    for (output, more, told) in [
        ("wipe = \"a.exr\"", &[][..], "written as .gif, .apng, .png"),
        ("side_by_side = \"a.jpg\"", &[], "written as .gif, .apng, .png"),
        ("wipe = \"a.gif\"", &["--set", "render.turntable=3"], "render.turntable"),
        ("wipe = \"a.gif\"\nside_by_side = \"a.gif\"", &[], "would both write"),
    ] {
        let (code, text) = refused_with(output, more);
        assert!(code == 2 && text.contains(told), "{output}: {code} {text}");
    }
    let still = SCENE.split("[[deform.handle]]").next().unwrap();
    std::fs::write(at.join("scene.toml"), format!("{still}[output]\nwipe = \"a.gif\"\n")).unwrap();
    let (code, text) = refused(at, &["pipeline", "scene.toml", "--out", "out"]);
    assert!(code == 2 && text.contains("output.wipe shows a deformation"), "{text}");
}

#[test]
fn marks_that_a_picture_cannot_have_are_refused() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    stages(at);
    let (code, text) =
        refused(at, &["render", "v.ivd", "--mode", "iso", "--iso", "90", "--legend", "-o", "x.png"]);
    assert!(code == 2 && text.contains("legend"), "{text}");
    let asked = ["--transfer", "t.ivd", "--legend", "--cube", "--antialias", "2"];
    let background = ["--background", "1,1,1,1", "--background-bottom", "0.2,0.2,0.3,1", "--size", "96"];
    json(at, &[&["render", "v.ivd", "-o", "marked.png"][..], &asked, &background].concat());
    json(at, &["atf", "v.ivd", "l.ivd", "--axes", "value-gradient", "-o", "steep.ivd"]);
    let steep = ["render", "v.ivd", "--transfer", "steep.ivd", "--legend", "-o", "x.png"];
    let (code, text) = refused(at, &steep);
    assert!(code == 2 && text.contains("axes = \"value\""), "{text}");
}
