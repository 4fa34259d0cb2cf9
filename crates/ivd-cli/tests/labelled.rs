//! Scenes with labels of other programs: what single commands make of the same values, byte for byte.
#![allow(clippy::unwrap_used, reason = "a test fails where it can't go on")]

use std::path::Path;

use serde_json::Value;

use crate::call::{json, refused};

const SCENE: &str = "schema = 1\n[input]\nfile = \"v.nrrd\"\nlabels = \"organs.nii.gz\"\n[boundary]\nclass = 3\n\
    [[deform.handle]]\npick = [16.0, 27.0, 16.0]\nmove = [0.0, -3.0, 0.0]\nradius = 12.0\n";
const OUTPUT: &str = "[output]\nvolume = \"v.nrrd\"\nlabels = \"rest.nrrd\"\nlabels_deformed = \"l.nrrd\"\n\
    mask_deformed = \"m.nrrd\"\ndisplacement = \"d.nrrd\"\n";

/// A head, and its parts as another program would have labelled them.
fn begin(at: &Path) {
    json(at, &["phantom", "head", "--size", "32", "-o", "v.ivd", "--truth", "t.ivd"]);
    json(at, &["export", "v.ivd", "-o", "v.nrrd"]);
    json(at, &["export", "t.ivd", "-o", "organs.nii.gz"]);
}

fn write(at: &Path, scene: &str) {
    std::fs::write(at.join("scene.toml"), scene).unwrap();
}

fn run(at: &Path) -> Value {
    json(at, &["pipeline", "scene.toml", "--out", "out"])
}

/// The states of a stage's places, with their variants.
fn states(told: &Value, stage: &str) -> Vec<(String, String)> {
    let text = |value: &Value| value.as_str().unwrap_or_default().to_owned();
    let all = told["stages"].as_array().unwrap().iter().filter(|record| record["stage"] == stage);
    all.map(|record| (text(&record["variant"]), text(&record["state"]))).collect()
}

/// The artefact that a stage made.
fn made_by(told: &Value, stage: &str) -> String {
    let of = |record: &&Value| record["stage"] == stage && record["output"]["path"].is_string();
    let record = told["stages"].as_array().unwrap().iter().find(of).unwrap();
    record["output"]["path"].as_str().unwrap().to_owned()
}

#[test]
fn labels_of_a_file_stand_in_for_a_segmentation_and_go_along_with_the_scan() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    begin(at);
    write(at, &format!("{SCENE}{OUTPUT}"));
    let told = run(at);
    assert_eq!(states(&told, "segment"), [(String::new(), "not_needed".to_owned())], "{told}");
    let why = told["stages"].as_array().unwrap().iter().find(|record| record["stage"] == "segment").unwrap();
    assert_eq!(why["why"], "input.labels gives the labels");
    let displacement = made_by(&told, "map");
    json(at, &["import", "organs.nii.gz", "--labels", "--like", "v.ivd", "-o", "organs.ivd"]);
    json(at, &["boundary", "v.ivd", "--labels", "organs.ivd", "--class", "3", "-o", "part.ivd"]);
    let bytes = |file: &str| std::fs::read(at.join(file)).unwrap();
    for (input, output) in [("organs.ivd", "out/l.nrrd"), ("part.ivd", "out/m.nrrd"), ("v.ivd", "out/v.nrrd")]
    {
        json(at, &["warp", input, &displacement, "-o", "w.ivd"]);
        json(at, &["export", "w.ivd", "-o", "w.nrrd"]);
        assert!(bytes("w.nrrd") == bytes(output), "{output}");
    }
    json(at, &["export", "organs.ivd", "-o", "w.nrrd"]);
    assert!(bytes("w.nrrd") == bytes("out/rest.nrrd") && bytes("out/l.nrrd") != bytes("out/rest.nrrd"));
    let (code, told) = refused(at, &["pipeline", "scene.toml", "--out", "out", "--until", "segment"]);
    assert!(code == 2 && told.contains("input.labels gives the labels"), "{told}");
    // Nothing that goes along is told of where no output asks for it, and nothing is done again.
    write(at, &format!("{SCENE}[output]\nlabels_deformed = \"l.nrrd\"\n"));
    let told = run(at);
    let warps = [("", "not_needed"), ("labels", "cached")].map(|(a, b)| (a.to_owned(), b.to_owned()));
    assert_eq!(states(&told, "warp"), warps, "{told}");
}

#[test]
fn pictures_go_by_labels_that_a_person_chose_where_one_of_them_moves() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    begin(at);
    // What lies outermost has no label.
    json(at, &["export", "t.ivd", "-o", "t.raw"]);
    let ids = std::fs::read(at.join("t.raw")).unwrap().into_iter().map(|id| if id == 1 { 0 } else { id });
    std::fs::write(at.join("inner.nrrd"), labels(32, 0, &ids.collect::<Vec<_>>())).unwrap();
    json(at, &["import", "inner.nrrd", "--labels", "--like", "v.ivd", "-o", "inner.ivd"]);
    let outputs = "[output]\nimages = [\"before\", \"after\"]\n";
    let drawn = |iso: &str, render: &str| {
        let scene = SCENE.replace("organs.nii.gz", "inner.nrrd").replace("[boundary]\nclass = 3\n", iso);
        write(at, &format!("{scene}[render]\nsize = [96, 96]\nfit = \"volume\"\n{render}{outputs}"));
        let told = run(at);
        let pictures =
            ["before", "after"].map(|name| std::fs::read(at.join(format!("out/{name}.png"))).unwrap());
        (pictures, made_by(&told, "atf"), made_by(&told, "map"))
    };
    let by_hand = |transfer: &str, more: &[&str]| {
        let said =
            ["render", "v.ivd", "--transfer", transfer, "--size", "96x96", "--fit", "volume", "-o", "p.png"];
        json(at, &[&said, more].concat());
        std::fs::read(at.join("p.png")).unwrap()
    };
    let part = "[boundary]\nclass = 3\n";
    let labelled = ["--labels", "inner.ivd"];
    let ([before, after], transfer, displacement) = drawn(part, "");
    let moved = ["--displacement", &displacement];
    assert!(before == by_hand(&transfer, &labelled));
    assert!(after == by_hand(&transfer, &[labelled, moved].concat()));
    assert!(before != by_hand(&transfer, &[]), "the skin is clear");
    // The rest is seen as well where that is asked for.
    let ([whole, _], transfer, _) = drawn(part, "unlabelled = true\n");
    assert!(whole == by_hand(&transfer, &["--labels", "inner.ivd", "--unlabelled"]) && whole != before);
    // A skin of an isovalue has no label, and steps between values know none: they are drawn without.
    let ([skin, _], transfer, _) = drawn("[lattice]\niso = 40.0\n", "");
    assert!(skin == by_hand(&transfer, &[]));
    // Nor has a part that is found by values.
    let ([dense, _], transfer, _) = drawn("[boundary]\nabove = 60.0\n", "");
    assert!(dense == by_hand(&transfer, &[]));
    // One part alone, and what it can't go together with.
    let ([alone, _], transfer, _) = drawn(part, "show = [3]\n");
    assert!(alone == by_hand(&transfer, &[&labelled[..], &["--show", "3"]].concat()) && alone != before);
    let both =
        ["render", "v.ivd", "--transfer", &transfer, "--show", "3", "--opacity", "4=0.5", "-o", "p.png"];
    let (code, told) = refused(at, &both);
    assert!(code == 2 && told.contains("without class 4"), "{told}");
    let steps = ["--classification", "pre-integrated"];
    let ([steep, _], transfer, _) = drawn(part, "classification = \"pre-integrated\"\n");
    assert!(steep == by_hand(&transfer, &steps));
}

#[test]
fn the_densest_of_labels_is_that_of_the_highest_values_in_the_scan() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    begin(at);
    // White matter, the brightest, has the lowest number.
    json(at, &["export", "t.ivd", "-o", "t.raw"]);
    let ids = std::fs::read(at.join("t.raw")).unwrap().into_iter().map(|id| (6 - id) % 6);
    std::fs::write(at.join("turned.nrrd"), labels(32, 0, &ids.collect::<Vec<_>>())).unwrap();
    let scene = SCENE.replace("class = 3", "class = \"densest\"").replace("organs.nii.gz", "turned.nrrd");
    write(at, &format!("{scene}[output]\nmask = \"m.nrrd\"\n"));
    let told = run(at);
    let boundary = told["stages"].as_array().unwrap().iter().find(|record| record["stage"] == "boundary");
    assert_eq!(boundary.unwrap()["metrics"]["class"], 1);
}

#[test]
fn labels_that_can_not_be_meant_are_refused_with_what_to_do() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    begin(at);
    json(at, &["import", "organs.nii.gz", "--mask", "-o", "mask.ivd"]);
    std::fs::write(at.join("far.nrrd"), labels(2, 500, &[1; 8])).unwrap();
    let output = "[output]\nlabels_deformed = \"l.nrrd\"\n";
    let still = SCENE.split("[[deform").next().unwrap();
    for (scene, wanted, says) in [
        (format!("{SCENE}[segment]\nk = 4\n{output}"), 2, "[segment]"),
        (format!("{still}{output}"), 2, "output.labels_deformed"),
        (
            format!(
                "{SCENE}[clip]\nof = \"input\"\n[[clip.planes]]\npoint = [16.0, 16.0, 16.0]\nnormal = [0.0, 0.0, 1.0]\n{output}"
            ),
            2,
            "clip the result",
        ),
        (SCENE.replace("\"organs", "\"/organs") + output, 2, "input.labels"),
        (SCENE.replace("organs.nii.gz", "mask.ivd") + output, 2, "give labels"),
        (SCENE.replace("organs.nii.gz", "gone.nii.gz") + output, 7, "gone.nii.gz"),
        (SCENE.replace("organs.nii.gz", "far.nrrd") + output, 2, "share no place"),
        (format!("{SCENE}{}", output.replace("l.nrrd", "l.png")), 2, "output.labels_deformed"),
    ] {
        write(at, &scene);
        let (code, told) = refused(at, &["pipeline", "scene.toml", "--out", "out"]);
        assert!(told.contains(says), "{scene}\n{told}");
        assert_eq!(code, wanted, "{told}");
    }
}

/// A file of labels on a cube of `n` voxels of 1 mm, the first of which lies so far to the right.
fn labels(n: usize, right: usize, ids: &[u8]) -> Vec<u8> {
    let head = format!(
        "NRRD0004\ntype: uchar\ndimension: 3\nspace: right-anterior-superior\nsizes: {n} {n} {n}\n\
         space directions: (1,0,0) (0,1,0) (0,0,1)\nspace origin: ({right},0,0)\nencoding: raw\n\n"
    );
    [head.as_bytes(), ids].concat()
}

#[test]
fn what_comes_from_beyond_the_scan_is_no_part_whatever_is_said_of_its_values() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    begin(at);
    // A part that reaches the scan's top, is pressed down there, and has the highest values of two.
    let block = |x: usize, y: usize, z: usize| {
        let is_in = |c: usize| (8..24).contains(&c);
        if is_in(x) && is_in(y) && z >= 12 { 1 + u8::from(z >= 18) } else { 0 }
    };
    let ids: Vec<u8> = (0..32 * 32 * 32).map(|i| block(i % 32, i / 32 % 32, i / 1024)).collect();
    let values: Vec<u8> = ids.iter().map(|id| 90 * id).collect();
    std::fs::write(at.join("organs.nrrd"), labels(32, 0, &ids)).unwrap();
    std::fs::write(at.join("block.nrrd"), labels(32, 0, &values)).unwrap();
    let scene = "schema = 1\n[input]\nfile = \"block.nrrd\"\nlabels = \"organs.nrrd\"\n[boundary]\nclass = 2\n[lattice]\niso = 45.0\n\
        [[deform.handle]]\npick = [16.0, 16.0, 31.0]\nmove = [0.0, 0.0, -4.0]\nradius = 10.0\n";
    let output = "[output]\nvolume = \"v.nrrd\"\nlabels_deformed = \"l.nrrd\"\n";
    let count = |id: u64| {
        json(at, &["import", "out/l.nrrd", "--labels", "-o", "l.ivd"]);
        let told = json(at, &["info", "l.ivd"]);
        let classes = told["content"]["classes"].as_array().unwrap();
        let class = classes.iter().find(|class| class["id"] == id);
        class.map_or(0, |class| class["voxels"].as_u64().unwrap())
    };
    let before = |id: u8| ids.iter().map(|other| u64::from(*other == id)).sum::<u64>();
    for background in ["", "[warp]\nbackground = -40.0\n", "[warp]\nbackground = 7.0\n"] {
        write(at, &format!("{scene}{background}{output}"));
        run(at);
        assert!(count(2) < before(2), "{background}: what was pressed in has left its top");
        assert!(count(1) <= before(1), "{background}: {} of {}", count(1), before(1));
        assert_eq!(count(7), 0, "{background}");
    }
}

#[test]
fn a_report_tells_of_labels_as_of_a_segmentation() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    begin(at);
    write(at, &format!("{SCENE}[window]\nvalues = [5.0, 90.0]\n[output]\nreport = true\n"));
    run(at);
    let page = std::fs::read_to_string(at.join("out/report.html")).unwrap();
    assert!(
        page.contains("organs.nii.gz") && page.contains("another program"),
        "the file, and who found them"
    );
    assert!(page.contains("<h2>Classes</h2>"), "a table of them");
    assert!(page.contains("render.unlabelled = true"), "what the pictures leave out");
    let greys = "Black: 5 and below; white: 90 and above.";
    assert_eq!(page.matches(greys).count(), 1, "how bright slices are");
    assert!(page.contains("Lines: where the labels' classes end"), "their borders in the slices");
}

#[test]
fn no_output_takes_the_place_of_what_is_read() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    begin(at);
    json(at, &["export", "v.ivd", "-o", "scan.mhd"]);
    std::fs::create_dir(at.join("frames")).unwrap();
    json(at, &["export", "v.ivd", "-o", "frames/m_0001.nrrd"]);
    std::fs::create_dir(at.join("slices")).unwrap();
    json(at, &["export", "v.ivd", "-o", "slices/a.tif"]);
    std::fs::create_dir(at.join("linked")).unwrap();
    std::os::unix::fs::symlink(at.join("v.nrrd"), at.join("linked/x.nrrd")).unwrap();
    let own = |scene: &str, file: &str| scene.replace("v.nrrd", file);
    let moved =
        SCENE.replace("labels = \"organs.nii.gz\"\n[boundary]\nclass = 3\n", "[lattice]\niso = 60.0\n");
    let springs = moved.replace("[[deform", "[deform]\nsolver = \"projective\"\nframes = 2\n[[deform");
    let files = ["organs.nii.gz", "v.nrrd", "scan.mhd.raw", "frames/m_0001.nrrd"];
    let before = files.map(|file| std::fs::read(at.join(file)).unwrap());
    for (scene, out, output) in [
        (SCENE.to_owned(), ".", "labels_deformed = \"organs.nii.gz\""),
        (SCENE.to_owned(), ".", "volume = \"./v.nrrd\""),
        (SCENE.to_owned(), "linked", "volume = \"x.nrrd\""),
        (own(&moved, "scan.mhd"), ".", "volume = \"scan.mhd\""),
        (own(&springs, "frames/m_0001.nrrd"), ".", "volume_series = \"frames/m.nrrd\""),
        (own(&moved, "slices"), "slices", "images = [\"before\"]"),
    ] {
        write(at, &format!("{scene}[output]\n{output}\n"));
        for more in [&["--dry-run"][..], &[]] {
            let (code, told) = refused(at, &[&["pipeline", "scene.toml", "--out", out][..], more].concat());
            assert!(code == 2 && told.contains("the scene reads"), "{output}: {told}");
            assert!(!told.contains("earlier"), "{output}: {told}");
        }
    }
    assert!(files.map(|file| std::fs::read(at.join(file)).unwrap()) == before);
}
