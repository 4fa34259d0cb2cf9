//! Files that others open, and those that others exported: the axes of meshes, folders of DICOM.
#![allow(clippy::unwrap_used, reason = "a test fails where it can't go on")]

use std::path::Path;

use tempfile::tempdir;

use crate::call::{ivd, json, refused};

fn says(file: &Path, words: &str) -> bool {
    std::fs::read(file).unwrap().windows(words.len()).any(|w| w == words.as_bytes())
}

#[test]
fn a_mesh_goes_out_in_the_space_that_is_asked_for_and_comes_back_from_it() {
    let folder = tempdir().unwrap();
    let at = folder.path();
    json(at, &["phantom", "sphere", "--size", "24", "-o", "ball.ivd"]);
    json(at, &["lattice", "ball.ivd", "--iso", "127.5", "-o", "lattice.ivd"]);
    for ending in ["ply", "obj", "stl"] {
        let files = ["", "ras", "lps"].map(|space| format!("a{space}.{ending}"));
        json(at, &["export", "lattice.ivd", "-o", &files[0]]);
        json(at, &["export", "lattice.ivd", "-o", &files[1], "--space", "ras"]);
        json(at, &["export", "lattice.ivd", "-o", &files[2], "--space", "lps"]);
        let bytes = |i: usize| std::fs::read(at.join(&files[i])).unwrap();
        assert!(bytes(0) == bytes(1) && bytes(1) != bytes(2), "{ending}");
        assert!(says(&at.join(&files[1]), "SPACE=RAS") && says(&at.join(&files[2]), "SPACE=LPS"));
        // Read again both are the same lattice.
        let hash = |i: usize| {
            let words = ["lattice", "ball.ivd", "--mesh", &files[i], "-o", "back.ivd"];
            json(at, &words)["output"]["hash"].as_str().unwrap().to_owned()
        };
        assert_eq!(hash(1), hash(2), "{ending}");
    }
    let (code, said) = refused(at, &["export", "lattice.ivd", "-o", "a.glb", "--space", "lps"]);
    assert!(code == 2 && said.contains("leave the space out"), "{said}");
    let (code, said) = refused(at, &["export", "ball.ivd", "-o", "a.nrrd", "--space", "lps"]);
    assert!(code == 2 && said.contains("--space: a volume artefact"), "{said}");
}

#[test]
fn an_artefact_has_no_name_of_another_format() {
    let folder = tempdir().unwrap();
    let at = folder.path();
    json(at, &["phantom", "sphere", "--size", "24", "-o", "ball.ivd"]);
    json(at, &["lattice", "ball.ivd", "--iso", "127.5", "-o", "lattice.ivd"]);
    let plane = "point=12,12,12;normal=0,0,1";
    for words in [
        &["import", "ball.ivd", "-o", "a.mha"][..],
        &["phantom", "sphere", "--size", "24", "-o", "a.nii.gz"],
        &["lattice", "ball.ivd", "--iso", "127.5", "-o", "a.stl"],
        &["refine", "lattice.ivd", "--level", "1", "-o", "a.PLY"],
        &["clip", "ball.ivd", "--plane", plane, "-o", "a.nrrd"],
        &["segment", "ball.ivd", "--k", "2", "-o", "a.json"],
        &["segment", "ball.ivd", "--method", "hvs", "--k", "2", "-o", "l.ivd", "--tree-out", "a.vti"],
    ] {
        let (code, said) = refused(at, words);
        let file = words.last().unwrap();
        assert!(code == 2 && said.contains("`ivd export` makes of that") && said.contains(file), "{said}");
        assert!(!at.join(file).exists(), "{file}");
    }
    // Any other name is the user's.
    json(at, &["lattice", "ball.ivd", "--iso", "127.5", "-o", "cut.surface"]);
    json(at, &["export", "cut.surface", "-o", "a.stl"]);
}

#[test]
fn a_scene_says_the_space_of_its_meshes() {
    let folder = tempdir().unwrap();
    let at = folder.path();
    let scene = |space: &str, lattice: &str| {
        let text = format!(
            "schema = 1\n[input]\nphantom = \"sphere\"\nsize = 24\n[lattice]\niso = 127.5\n[output]\nlattice = \"{lattice}\"\n{space}"
        );
        std::fs::write(at.join("scene.toml"), text).unwrap();
    };
    let run = || json(at, &["pipeline", "scene.toml", "--out", "out"])["outputs"][0]["written"].clone();
    let file = at.join("out/a.stl");
    for (space, words, written) in [
        ("", "SPACE=RAS", true),
        ("", "SPACE=RAS", false),
        ("space = \"lps\"\n", "SPACE=LPS", true),
        ("space = \"lps\"\n", "SPACE=LPS", false),
        ("space = \"ras\"\n", "SPACE=RAS", true),
    ] {
        scene(space, "a.stl");
        assert_eq!(run(), written, "{space}");
        assert!(says(&file, words), "{space}");
    }
    scene("space = \"lps\"\n", "a.glb");
    let (code, said) = refused(at, &["pipeline", "scene.toml", "--out", "out"]);
    assert!(code == 2 && said.contains("output.lattice = a.glb: glb has axes of its own"), "{said}");
}

/// A DICOM slice of 3 × 2 pixels (PS3.10; Explicit VR Little Endian).
fn slice(series: &str, number: &str, z: f64, value: u16) -> Vec<u8> {
    let element = |group: u16, element: u16, kind: &[u8; 2], mut value: Vec<u8>| {
        if value.len() % 2 == 1 {
            value.push(if kind == b"UI" { 0 } else { b' ' });
        }
        let head = [group.to_le_bytes(), element.to_le_bytes(), *kind].concat();
        let length = if kind == b"OW" {
            [&[0; 2][..], &(value.len() as u32).to_le_bytes()].concat()
        } else {
            (value.len() as u16).to_le_bytes().to_vec()
        };
        [head, length, value].concat()
    };
    let short = |n: u16| n.to_le_bytes().to_vec();
    let text = |words: &str| words.as_bytes().to_vec();
    let meta = element(2, 0x10, b"UI", text("1.2.840.10008.1.2.1"));
    let elements = [
        element(2, 0, b"UL", (meta.len() as u32).to_le_bytes().to_vec()),
        meta,
        element(8, 0x60, b"CS", text("CT")),
        element(8, 0x103e, b"LO", text("Thorax of Nemo")),
        element(0x10, 0x10, b"PN", text("Nemo^Nobody")),
        element(0x20, 0x0e, b"UI", text(series)),
        element(0x20, 0x11, b"IS", text(number)),
        element(0x20, 0x32, b"DS", text(&format!("0\\0\\{z}"))),
        element(0x20, 0x37, b"DS", text("1\\0\\0\\0\\1\\0")),
        element(0x28, 0x02, b"US", short(1)),
        element(0x28, 0x04, b"CS", text("MONOCHROME2")),
        element(0x28, 0x10, b"US", short(2)),
        element(0x28, 0x11, b"US", short(3)),
        element(0x28, 0x30, b"DS", text("0.5\\0.25")),
        element(0x28, 0x100, b"US", short(16)),
        element(0x28, 0x101, b"US", short(16)),
        element(0x28, 0x102, b"US", short(15)),
        element(0x28, 0x103, b"US", short(0)),
        element(0x7fe0, 0x10, b"OW", [value; 6].into_iter().flat_map(u16::to_le_bytes).collect()),
    ];
    [&[0; 128], &b"DICM"[..], &elements.concat()].concat()
}

/// A folder as a scanner exports it: series 4, evenly spaced, and series 11, which isn't, each in a folder of its own below another.
pub(crate) fn export(folder: &Path) {
    for (series, number, heights) in [("1.2.3", "4", [0.0, 2.0, 4.0]), ("1.2.9", "11", [0.0, 2.0, 6.0])] {
        let below = folder.join(format!("patient/s{number}"));
        std::fs::create_dir_all(&below).unwrap();
        for z in heights {
            std::fs::write(below.join(format!("{z}")), slice(series, number, z, 10 * z as u16)).unwrap();
        }
    }
}

#[test]
fn series_below_a_folder_are_listed_and_taken_by_the_word_that_is_shown() {
    let folder = tempdir().unwrap();
    let at = folder.path();
    export(&at.join("scan"));
    let listed = json(at, &["info", "scan", "--series"]);
    assert_eq!((&listed["kind"], listed["series"].as_array().unwrap().len()), (&"dicom folder".into(), 2));
    let words: Vec<&str> =
        listed["series"].as_array().unwrap().iter().map(|s| s["series"].as_str().unwrap()).collect();
    assert_eq!(words, ["4", "11"]);
    assert_eq!((&listed["series"][0]["slices"], &listed["series"][1]["uneven_mm"]), (&3.into(), &2.0.into()));
    let output = ivd(at, &["info", "scan", "--series"]);
    let text = String::from_utf8([output.stdout, output.stderr].concat()).unwrap();
    let line = "4: CT, `THORAX OF ***`, 3 slices of 3×2, 0.2500 × 0.5000 × 2.0000 mm";
    assert!(text.contains(line) && !text.to_lowercase().contains("nemo"), "{text}");
    let described = json(at, &["info", "scan", "--series=4"]);
    assert_eq!(described["content"]["grid"]["dims"], serde_json::json!([3, 2, 3]));
    for words in [["info", "scan/patient/s4/0", "--series"], ["info", "scan/patient/s4/0", "--series=4"]] {
        let (code, said) = refused(at, &words);
        assert!(code == 2 && said.contains("--series is of a folder"), "{said}");
    }
    let (code, said) = refused(at, &["import", "scan", "-o", "a.ivd"]);
    assert!(code == 3 && said.contains("2 series fit") && said.contains("--series"), "{said}");
    let (code, said) = refused(at, &["import", "scan", "--series", "11", "-o", "a.ivd"]);
    assert!(
        code == 3 && said.contains("--resample-slices") && !said.to_lowercase().contains("nemo"),
        "{said}"
    );
    let even = json(at, &["import", "scan", "--series", "11", "--resample-slices", "-o", "a.ivd"]);
    assert_eq!(even["metrics"]["dims"], serde_json::json!([3, 2, 4]));
    assert_eq!(even["params"]["file"]["resample_slices"], true);
    let plain = json(at, &["import", "scan", "--series", "4", "-o", "b.ivd"]);
    assert!(plain["params"]["file"].get("resample_slices").is_none(), "keys of before stay what they were");
    std::fs::write(
        at.join("scene.toml"),
        "schema = 1\n[input]\nfile = \"scan\"\nseries = \"11\"\nresample_slices = true\n[segment]\nmethod = \"threshold\"\nvalues = [30]\n\
         [output]\nlabels = \"l.nrrd\"\n",
    )
    .unwrap();
    let ran = json(at, &["pipeline", "scene.toml", "--out", "out"]);
    assert_eq!(ran["stages"][0]["output"]["hash"], even["output"]["hash"]);
}

#[test]
fn raw_slices_are_laid_as_they_are_said_to_lie() {
    let folder = tempdir().unwrap();
    let at = folder.path();
    // One bright voxel, at 1 of 5 along x, 0 of 4 along y, 2 of 3 along z.
    let mut bytes = vec![0_u8; 60];
    bytes[1 + 5 * (4 * 2)] = 200;
    std::fs::write(at.join("a.raw"), bytes).unwrap();
    let raw = ["import", "a.raw", "--raw-dims", "5,4,3", "--raw-type", "u8", "--raw-spacing", "2,1,1"];
    for (axes, place, letters) in [("", "-2,0,2", false), ("RAS", "2,0,2", true), ("lpi", "-2,0,-2", true)] {
        let given = if axes.is_empty() { vec![] } else { vec!["--axes", axes] };
        let told = json(at, &[&raw[..], &given, &["-o", "a.ivd"]].concat());
        assert_eq!(told["metrics"]["patient_space"], letters, "{axes}");
        let there = json(at, &["info", "a.ivd", "--at", place]);
        assert_eq!(there["at"][0]["value"], 200.0, "{axes}: {there}");
    }
    let (code, said) = refused(at, &[&raw[..], &["--axes", "LLS", "-o", "b.ivd"]].concat());
    assert!(code == 2 && said.contains("R and L"), "{said}");
    let scene = "schema = 1\n[input]\nfile = \"a.raw\"\naxes = \"RAS\"\n[input.raw]\ndims = [5, 4, 3]\ntype = \"u8\"\nspacing = [2.0, 1.0, 1.0]\n\
                 [lattice]\niso = 100.0\n[output]\nlattice = \"b.ply\"\n";
    std::fs::write(at.join("scene.toml"), scene).unwrap();
    let run = json(at, &["pipeline", "scene.toml", "--out", "out"]);
    let import = &run["stages"].as_array().unwrap().iter().find(|stage| stage["stage"] == "import").unwrap();
    assert_eq!(
        (&import["params"]["file"]["axes"], &import["metrics"]["patient_space"]),
        (&"RAS".into(), &true.into())
    );
    std::fs::write(at.join("bad.toml"), scene.replace("RAS", "RRS")).unwrap();
    let (code, said) = refused(at, &["pipeline", "bad.toml", "--out", "out"]);
    assert!(code == 2 && said.contains("axes"), "{said}");
}

#[test]
fn info_tells_the_values_of_a_volume_and_the_places_of_classes() {
    let folder = tempdir().unwrap();
    let at = folder.path();
    json(at, &["phantom", "sphere", "--size", "32", "--truth", "truth.ivd", "-o", "ball.ivd"]);
    let told = json(at, &["info", "ball.ivd"])["content"]["distribution"].clone();
    let voxels: u64 =
        told["histogram"]["voxels"].as_array().unwrap().iter().map(|n| n.as_u64().unwrap()).sum();
    assert_eq!(voxels, 32_u64.pow(3));
    // Less than a quarter of the cube is the ball's.
    assert_eq!(told["quantiles"][2], serde_json::json!({ "share": 0.25, "value": 0.0 }));
    let shown = String::from_utf8(ivd(at, &["info", "ball.ivd"]).stdout).unwrap();
    assert_eq!(
        shown.lines().filter(|line| line.contains(" … ") && line.ends_with('%')).count(),
        24,
        "{shown}"
    );
    let classes = json(at, &["info", "truth.ivd"])["content"]["classes"].clone();
    let ball = classes.as_array().unwrap().iter().find(|class| class["id"] == 1).unwrap().clone();
    let (voxels, ml) = (ball["voxels"].as_f64().unwrap(), ball["ml"].as_f64().unwrap());
    assert!((ml - voxels / 1000.0).abs() < 1e-9);
    let (low, high) = (&ball["extent_mm"]["low"], &ball["extent_mm"]["high"]);
    for a in 0..3 {
        let [low, high, middle] = [low, high, &ball["centre_mm"]].map(|list| list[a].as_f64().unwrap());
        // A ball of radius 0.35 size.
        assert!((high - low - 22.4).abs() < 2.0 && (f64::midpoint(low, high) - middle).abs() < 0.6, "{ball}");
    }
}

#[test]
fn the_values_of_a_scan_are_no_labels() {
    let folder = tempdir().unwrap();
    let at = folder.path();
    json(
        at,
        &["phantom", "head", "--size", "32", "--type", "u16", "--truth", "truth.nrrd", "-o", "head.ivd"],
    );
    let (code, said) = refused(at, &["lattice", "head.ivd", "--class", "3", "-o", "x.ivd"]);
    assert!(code == 2 && said.contains("looks like a scan") && said.contains("--labels"), "{said}");
    json(at, &["lattice", "truth.nrrd", "--class", "3", "-o", "grey.ivd"]);
}

#[test]
fn a_coarse_displacement_is_put_onto_the_grid_of_the_scan() {
    let folder = tempdir().unwrap();
    let at = folder.path();
    json(at, &["phantom", "sphere", "--size", "40", "-o", "v.ivd"]);
    json(at, &["export", "v.ivd", "-o", "v.nrrd"]);
    // Everything goes to the left by 3 mm, on a grid of 11³ voxels of 4 mm (LPS).
    let header = "NRRD0004\ntype: float\ndimension: 4\nsizes: 3 11 11 11\nkinds: vector domain domain domain\nspace: left-posterior-superior\n\
                  space directions: none (-4,0,0) (0,-4,0) (0,0,4)\nspace origin: (0,0,0)\nendian: little\nencoding: raw\n\n";
    let vectors = (0..11 * 11 * 11).flat_map(|_| [3.0_f32, 0.0, 0.0]).flat_map(f32::to_le_bytes);
    std::fs::write(at.join("field.nrrd"), header.bytes().chain(vectors).collect::<Vec<_>>()).unwrap();
    let import = ["import", "field.nrrd", "--displacement=forward", "-o", "d.ivd"];
    json(at, &import);
    let (code, said) = refused(at, &["warp", "v.ivd", "d.ivd", "-o", "x.ivd"]);
    assert!(code == 2 && said.contains("--like"), "{said}");
    for like in ["v.ivd", "v.nrrd"] {
        let told = json(at, &[&import[..], &["--like", like]].concat());
        assert_eq!(told["metrics"]["voxels_moved"], 64_000);
        json(at, &["warp", "v.ivd", "d.ivd", "-o", "moved.ivd"]);
        let value =
            |file: &str, place: &str| json(at, &["info", file, "--at", place])["at"][0]["value"].clone();
        for [before, after] in [["20,20,20", "17,20,20"], ["7,19,22", "4,19,22"], ["31,15,20", "28,15,20"]] {
            assert_eq!(value("v.ivd", before), value("moved.ivd", after));
        }
    }
    // A field isn't a volume, and is said to be none.
    let (code, said) = refused(at, &["import", "field.nrrd", "-o", "x.ivd"]);
    assert!(code == 3 && said.contains("--displacement"), "{said}");
}
