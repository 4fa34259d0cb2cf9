//! Characters that act on a display, in every text field of every format, in scenes, parameters, words and paths: a person is shown them
//! written out, a program that asks for `--json` gets them as they are.

use std::collections::BTreeMap;
use std::ffi::OsString;
use std::path::Path;
use std::process::{Command, Stdio};

use ivd_core::shown;
use serde_json::{Value, json};

use crate::hostile::case::{each_in_a_folder, every};
use crate::hostile::{artefacts, dicom, good, pictures};

/// All of them. What a reader of words may cut at stands in a text of its own, so that it can't keep the others from being read.
fn texts() -> Vec<String> {
    let acts = (0..=0xffff).filter_map(char::from_u32).filter(|c| shown(&c.to_string()).len() > c.len_utf8());
    let (alone, together): (Vec<char>, Vec<char>) =
        acts.partition(|c| c.is_whitespace() || ['\0', '\u{1c}', '\u{1d}', '\u{1e}', '\u{1f}'].contains(c));
    assert_eq!(alone.len() + together.len(), 78);
    let mut texts = vec![format!("x{}y", together.into_iter().collect::<String>())];
    texts.extend(alone.into_iter().map(|c| format!("x{c}y")));
    texts
}

/// Files, and words for the program, in which a text stands somewhere.
struct Planted {
    name: String,
    files: Vec<(String, Vec<u8>)>,
    words: Vec<String>,
    /// Whether the program must repeat the text, so that something is proved.
    told: bool,
}

fn planted(name: impl Into<String>, file: &str, bytes: impl Into<Vec<u8>>, line: &str) -> Planted {
    let words = line.split(' ').map(str::to_owned).collect();
    Planted { name: name.into(), files: vec![(file.to_owned(), bytes.into())], words, told: false }
}

impl Planted {
    fn and(mut self, file: &str, bytes: impl Into<Vec<u8>>) -> Self {
        self.files.push((file.to_owned(), bytes.into()));
        self
    }

    fn word(mut self, word: impl Into<String>) -> Self {
        self.words.push(word.into());
        self
    }

    fn told(mut self) -> Self {
        self.told = true;
        self
    }

    /// Runs it for a person and for a program; gives whether the text was repeated, or what is wrong.
    fn check(&self, at: &Path) -> Result<bool, String> {
        for (name, bytes) in &self.files {
            let path = at.join(name);
            std::fs::create_dir_all(path.parent().unwrap()).unwrap();
            std::fs::write(path, bytes).unwrap();
        }
        let wrong = |problem: &str, said: &str| Err(format!("{}: {problem}: {said:?}", self.name));
        let run = |more: &[&str]| {
            let output = Command::new(env!("CARGO_BIN_EXE_ivd"))
                .args(self.words.iter().map(OsString::from))
                .args(["--threads", "1"])
                .args(more)
                .env("IVD_CACHE", "")
                .current_dir(at)
                .stdin(Stdio::null())
                .output()
                .unwrap();
            (output.status.code(), output.stdout, output.stderr)
        };
        let (code, out, said) = run(&["-vv"]);
        let (Ok(out), Ok(said)) = (String::from_utf8(out), String::from_utf8(said)) else {
            return wrong("no text", "");
        };
        for told in [&out, &said] {
            if shown(told) != told.as_str() {
                return wrong("raw on the terminal", told);
            }
        }
        let (again, out_json, said_json) = run(&["--json", "-q"]);
        let said_json = String::from_utf8_lossy(&said_json);
        if shown(&said_json) != said_json {
            return wrong("raw on the terminal beside --json", &said_json);
        }
        if again != code || code.is_none_or(|code| code > 7) {
            return wrong(&format!("exit codes {code:?} and {again:?}"), &said_json);
        }
        let Ok(object) = serde_json::from_slice::<Value>(&out_json) else {
            return wrong("no JSON", &String::from_utf8_lossy(&out_json));
        };
        // What a person was shown is the very message.
        if let Some(message) = object["error"]["message"].as_str()
            && !said.replace('\n', "").contains(&shown(message).replace('\n', ""))
        {
            return wrong("another message", &format!("{message:?} beside {said:?}"));
        }
        let repeated = [&out, &said].iter().any(|told| told.contains("\\u{"));
        let kept = {
            let mut strings = Vec::new();
            collect(&object, &mut strings);
            strings.iter().any(|s| shown(s) != s.as_str())
        };
        if self.told && !(repeated && kept) {
            return wrong(&format!("not repeated (shown {repeated}, in --json {kept})"), &said);
        }
        Ok(repeated)
    }
}

fn collect(value: &Value, strings: &mut Vec<String>) {
    match value {
        Value::String(text) => strings.push(text.clone()),
        Value::Array(list) => list.iter().for_each(|v| collect(v, strings)),
        Value::Object(map) => map.iter().for_each(|(key, v)| {
            strings.push(key.clone());
            collect(v, strings);
        }),
        Value::Null | Value::Bool(_) | Value::Number(_) => {}
    }
}

/// Every field of a header of lines, its value and its name, and lines that are comments or nothing.
fn lines(
    ending: &str,
    first: &str,
    between: &str,
    fields: &[(&str, &str)],
    last: &str,
    text: &str,
) -> Vec<Planted> {
    let header = |change: &dyn Fn(&str, &str) -> String| -> Vec<u8> {
        let lines: String = fields.iter().map(|(key, value)| change(key, value)).collect();
        [format!("{first}{lines}{last}").into_bytes(), (0..120).collect()].concat()
    };
    let file = format!("a.{ending}");
    let info = format!("info {file}");
    let line = |key: &str, value: &str| format!("{key}{between}{value}\n");
    let mut all = Vec::new();
    for (field, _) in fields {
        for (what, change) in [
            (
                "value",
                &(|key: &str, value: &str| {
                    line(key, &if key == *field { format!("{value}{text}") } else { value.to_owned() })
                }) as &dyn Fn(&str, &str) -> String,
            ),
            ("other value", &|key, value| line(key, if key == *field { text } else { value })),
            ("name", &|key, value| {
                line(&if key == *field { format!("{key}{text}") } else { key.to_owned() }, value)
            }),
        ] {
            all.push(planted(format!("{ending} {field}: {what} {text:?}"), &file, header(change), &info));
        }
    }
    let plain = |key: &str, value: &str| line(key, value);
    for extra in [
        format!("# {text}\n"),
        format!("{text}\n"),
        format!("{text}{between}1\n"),
        format!("{text}:={text}\n"),
    ] {
        let mut bytes = header(&plain);
        bytes.splice(first.len()..first.len(), extra.bytes());
        all.push(planted(format!("{ending} line {extra:?}"), &file, bytes, &info));
    }
    all
}

fn volumes(text: &str) -> Vec<Planted> {
    let nrrd = [
        ("type", "int16"),
        ("dimension", "3"),
        ("sizes", "5 4 3"),
        ("endian", "little"),
        ("encoding", "raw"),
        ("space", "left-posterior-superior"),
        ("space directions", "(0.5,0,0) (0,0.75,0) (0,0,2)"),
        ("space origin", "(1,2,3)"),
        ("kinds", "domain domain domain"),
        ("units", "\"mm\" \"mm\" \"mm\""),
        ("labels", "\"a\" \"b\" \"c\""),
        ("content", "a scan"),
        ("line skip", "0"),
    ];
    let metaimage = [
        ("ObjectType", "Image"),
        ("NDims", "3"),
        ("Comment", "a scan"),
        ("BinaryData", "True"),
        ("BinaryDataByteOrderMSB", "False"),
        ("CompressedData", "False"),
        ("TransformMatrix", "1 0 0 0 1 0 0 0 1"),
        ("AnatomicalOrientation", "RAI"),
        ("Offset", "1 2 3"),
        ("ElementSpacing", "0.5 0.75 2"),
        ("DimSize", "5 4 3"),
        ("ElementType", "MET_SHORT"),
    ];
    let mut all = lines("nrrd", "NRRD0004\n", ": ", &nrrd, "\n", text);
    all.extend(lines("nhdr", "NRRD0004\n", ": ", &nrrd, &format!("data file: {text}.raw\n\n"), text));
    all.extend(lines("mha", "", " = ", &metaimage, "ElementDataFile = LOCAL\n", text));
    all.extend(lines("mhd", "", " = ", &metaimage, &format!("ElementDataFile = {text}.raw\n"), text));
    // NIfTI's texts lie at fixed places.
    for (field, at, length) in [
        ("data_type", 4, 10),
        ("db_name", 14, 18),
        ("descrip", 148, 80),
        ("aux_file", 228, 24),
        ("intent_name", 328, 16),
        ("magic", 344, 4),
    ] {
        let mut bytes = good::file("nii");
        for (to, from) in bytes[at..at + length].iter_mut().zip(text.bytes()) {
            *to = from;
        }
        all.push(planted(format!("nifti {field} {text:?}"), "a.nii", bytes, "info a.nii"));
    }
    // A DICOM file's texts, those that it must have and those of people.
    for (name, bytes) in dicom::with_text(text) {
        all.push(planted(format!("dicom {name} {text:?}"), "a.dcm", bytes.clone(), "info a.dcm"));
        all.push(planted(format!("dicom series {name} {text:?}"), "s/a.dcm", bytes.clone(), "info s"));
        all.push(planted(format!("dicom list {name} {text:?}"), "s/b/a.dcm", bytes, "info s --series"));
    }
    for (name, bytes) in pictures::tiff_with_text(text) {
        all.push(planted(format!("tiff {name} {text:?}"), "a.tif", bytes, "info a.tif"));
    }
    for (name, bytes) in pictures::png_with_text(text) {
        let slices = planted(format!("png {name} {text:?}"), "s/1.png", bytes.clone(), "import s -o out.ivd");
        all.push(slices.and("s/2.png", bytes));
    }
    all
}

/// XML of a volume and of a mesh: every attribute's value and name, elements, and text between them.
fn xml(text: &str) -> Vec<Planted> {
    let mesh = r#"<VTKFile type="PolyData" version="1.0" byte_order="LittleEndian"><PolyData><Piece NumberOfPoints="4" NumberOfVerts="0" NumberOfLines="0" NumberOfStrips="0" NumberOfPolys="4"><Points><DataArray type="Float64" Name="Points" NumberOfComponents="3" format="ascii">0 0 0 2 0 0 0 2 0 0 0 2</DataArray></Points><Polys><DataArray type="Int64" Name="connectivity" format="ascii">0 2 1 0 1 3 0 3 2 1 2 3</DataArray><DataArray type="Int64" Name="offsets" format="ascii">3 6 9 12</DataArray></Polys></Piece></PolyData></VTKFile>"#;
    let volume = String::from_utf8_lossy(&good::file("vti")).into_owned();
    let escaped: String = text.chars().map(|c| format!("&#{};", c as u32)).collect();
    let mut all = Vec::new();
    for (ending, good, line) in
        [("vti", volume.as_str(), "info a.vti"), ("vtp", mesh, "lattice v.nrrd --mesh a.vtp -o out.ivd")]
    {
        let quotes: Vec<usize> = good.match_indices("=\"").map(|(at, _)| at).collect();
        for at in quotes {
            for (what, planted_at, text) in
                [("value", at + 2, text), ("escaped value", at + 2, escaped.as_str()), ("name", at, text)]
            {
                let mut bytes = good.to_owned();
                bytes.insert_str(planted_at, text);
                all.push((ending, format!("{what} at {at}"), bytes, line));
            }
        }
        for (at, _) in good.match_indices('>').chain(good.match_indices("</")).take(24) {
            let mut bytes = good.to_owned();
            bytes.insert_str(at + 1, text);
            all.push((ending, format!("text at {at}"), bytes, line));
        }
        all.push((ending, "comment".to_owned(), good.replacen("><", &format!("><!-- {text} --><"), 1), line));
    }
    let nrrd = good::file("nrrd");
    all.into_iter()
        .map(|(ending, name, bytes, line)| {
            planted(format!("{ending} {name} {text:?}"), &format!("a.{ending}"), bytes, line)
                .and("v.nrrd", nrrd.clone())
        })
        .collect()
}

/// Meshes with a text in every place of a line.
fn meshes(text: &str) -> Vec<Planted> {
    let obj = "mtllib a.mtl\no thing\ng part\nusemtl skin\nv 0 0 0\nv 2 0 0\nv 0 2 0\nv 0 0 2\ns off\nf 1 3 2\nf 1 2 4\nf 1 4 3\nf 2 3 4\n# end\n";
    let ply = "ply\nformat ascii 1.0\ncomment made by hand\nobj_info info\nelement vertex 4\nproperty double x\nproperty double y\nproperty double z\nelement face 4\nproperty list uchar int vertex_indices\nend_header\n0 0 0\n2 0 0\n0 2 0\n0 0 2\n3 0 2 1\n3 0 1 3\n3 0 3 2\n3 1 2 3\n";
    let stl = "solid thing\nfacet normal 0 0 1\nouter loop\nvertex 0 0 0\nvertex 0 2 0\nvertex 2 0 0\nendloop\nendfacet\nendsolid thing\n";
    let nrrd = good::file("nrrd");
    let mut all = Vec::new();
    for (ending, good) in [("obj", obj), ("ply", ply), ("stl", stl)] {
        let line = format!("lattice v.nrrd --mesh a.{ending} --allow-open -o out.ivd");
        let breaks = good.match_indices([' ', '\n']).map(|(at, _)| at);
        for at in breaks {
            let mut bytes = good.to_owned();
            bytes.insert_str(at, text);
            all.push(planted(format!("{ending} at {at} {text:?}"), &format!("a.{ending}"), bytes, &line));
        }
    }
    let scene = json!({ "asset": { "version": "2.0", "generator": text, "copyright": text }, "scenes": [{ "name": text }],
        "nodes": [{ "name": text, "mesh": 0 }], "meshes": [{ "name": text, "primitives": [{ "attributes": { text: 0 } }] }],
        "extensionsRequired": [text], "buffers": [{ "byteLength": 4, "uri": text }] });
    let mut json = serde_json::to_vec(&scene).unwrap();
    json.resize(json.len().next_multiple_of(4), b' ');
    let length = |n: usize| (n as u32).to_le_bytes();
    let glb =
        [&b"glTF"[..], &2_u32.to_le_bytes(), &length(20 + json.len()), &length(json.len()), b"JSON", &json]
            .concat();
    all.push(planted(format!("glb {text:?}"), "a.glb", glb, "lattice v.nrrd --mesh a.glb -o out.ivd"));
    all.into_iter().map(|case| case.and("v.nrrd", nrrd.clone())).collect()
}

/// What an artefact says of itself.
fn heads(text: &str) -> Vec<Planted> {
    let whole = |bytes| planted(format!("artefact {text:?}"), "a.ivd", bytes, "info a.ivd").told();
    let made = artefacts::with_text(text);
    let mut all = vec![whole(made.clone())];
    for line in ["export a.ivd -o out.json", "segment a.ivd -o out.ivd --k 2", "compare a.ivd a.ivd"] {
        all.push(planted(format!("artefact, {line}, {text:?}"), "a.ivd", made.clone(), line));
    }
    all
}

/// A text as TOML writes it.
fn toml(text: &str) -> String {
    let inner: String = text.chars().map(|c| format!("\\u{:04X}", c as u32)).collect();
    format!("\"{inner}\"")
}

const HEAD: &str = "schema = 1\n[input]\nphantom = \"sphere\"\nsize = 12\n";

/// Keys and values of scenes and parameters, escaped as TOML has it and as they are.
fn scenes(text: &str) -> Vec<Planted> {
    let word = toml(text);
    let dry = "pipeline scene.toml --out out --cache off --dry-run";
    let scene =
        |what: &str, body: String| planted(format!("scene, {what} {text:?}"), "scene.toml", body, dry);
    let mut all = vec![
        scene("section", format!("{HEAD}[{word}]\n")).told(),
        scene("key", format!("{HEAD}[segment]\n{word} = 1\n")).told(),
        scene("raw key", format!("{HEAD}[segment]\n{text} = 1\n")),
        scene("raw value", format!("{HEAD}[segment]\nmethod = \"{text}\"\n")),
        scene("comment", format!("{HEAD}[segment] # {text}\n")),
        scene("input", format!("schema = 1\n[input]\nfile = {word}\n[output]\nlabels = \"l.nrrd\"\n")),
        scene(
            "series",
            format!(
                "schema = 1\n[input]\nfile = \"a.nrrd\"\nseries = {word}\n[output]\nlabels = \"l.nrrd\"\n"
            ),
        ),
        scene("output", format!("{HEAD}[output]\nlabels = {word}\n")),
        scene("output's key", format!("{HEAD}[output]\n{word} = \"l.nrrd\"\n")).told(),
        scene(
            "bone",
            format!(
                "{HEAD}[deform]\nsolver = \"dynamics\"\n[[deform.rigid]]\nname = {word}\nparent = {word}\nclass = 1\nreach = 2.0\n[output]\nlattice_deformed = \"l.ply\"\n"
            ),
        ),
        scene(
            "bone's parent",
            format!(
                "{HEAD}[deform]\nsolver = \"dynamics\"\n[[deform.rigid]]\nparent = {word}\nclass = 1\nreach = 2.0\n[output]\nlattice_deformed = \"l.ply\"\n"
            ),
        ),
        scene(
            "material",
            format!(
                "{HEAD}[deform]\nsolver = \"dynamics\"\n[deform.material.{word}]\nstiffness = 1.0\n[output]\nlattice = \"l.ply\"\n"
            ),
        ),
    ];
    for (section, key) in [
        ("input", "type"),
        ("segment", "method"),
        ("boundary", "class"),
        ("lattice", "iso"),
        ("refine", "method"),
        ("deform", "solver"),
        ("map", "method"),
        ("map", "outside"),
        ("warp", "order"),
        ("render", "mode"),
        ("render", "projection"),
    ] {
        let body = if section == "input" {
            format!("{HEAD}{key} = {word}\n")
        } else {
            format!("{HEAD}[{section}]\n{key} = {word}\n")
        };
        // What a class and an isovalue may be is told without what was written.
        let case = scene(&format!("{section}.{key}"), body);
        all.push(if ["class", "iso"].contains(&key) { case } else { case.told() });
    }
    for body in [format!("{word} = 1\n"), format!("method = {word}\n"), format!("method = \"{text}\"\n")] {
        let line = "segment v.nrrd --params p.toml -o out.ivd";
        all.push(
            planted(format!("--params {body:?}"), "p.toml", body, line).and("v.nrrd", good::file("nrrd")),
        );
    }
    all
}

/// Words and paths; a file's name can't hold NUL.
fn words(text: &str) -> Vec<Planted> {
    let whole = format!("{HEAD}[output]\nlabels = \"l.nrrd\"\n");
    if text.contains('\0') {
        return Vec::new();
    }
    let nrrd = good::file("nrrd");
    let of = |what: &str, line: &str| planted(format!("{what} {text:?}"), "v.nrrd", nrrd.clone(), line);
    let named = format!("{text}.nrrd");
    let mut all = vec![
        planted(format!("a file's name {text:?}"), &named, nrrd.clone(), "info").word(&named).told(),
        planted(format!("a bad file's name {text:?}"), &named, "NRRD0004\nx\n\n", "info").word(&named).told(),
        planted(format!("a folder's name {text:?}"), &format!("{text}/1.png"), "no picture", "info")
            .word(text)
            .told(),
        of("no such file", "info").word(&named).told(),
        of("an output's name", "import v.nrrd -o").word(format!("{text}.ivd")),
        of("an output's ending", "export v.nrrd -o").word(format!("out.{text}")),
        of("an output's folder", "import v.nrrd -o").word(format!("{text}/out.ivd")).told(),
        of("the parameters' name", "segment v.nrrd -o out.ivd --params").word(text).told(),
        of("the cache's folder", "segment v.nrrd -o out.ivd --k 2 --cache").word(text),
        of("a cache that is a file", "segment v.nrrd -o out.ivd --k 2 --cache v.nrrd/").word(text),
        of("a mesh's name", "lattice v.nrrd -o out.ivd --mesh").word(format!("{text}.obj")),
        planted(format!("a scene's name {text:?}"), &format!("{text}.toml"), HEAD, "pipeline")
            .word(format!("{text}.toml")),
    ];
    for line in ["", "segment v.nrrd -o out.ivd", "doctor"] {
        all.push(of(&format!("a word after `{line}`"), line.trim()).word(text));
        all.push(of(&format!("a flag after `{line}`"), line.trim()).word(format!("--{text}")));
    }
    for flag in ["--method", "--k", "--threads", "--memory-limit", "--backend", "--progress"] {
        all.push(of(flag, &format!("segment v.nrrd -o out.ivd {flag}")).word(text).told());
    }
    for flag in ["--handle", "--fix"] {
        all.push(of(flag, &format!("deform l.ivd -o out.ivd {flag}")).word(text).told());
    }
    let solver = "deform l.ivd -o out.ivd --handle vertex=0;move=0,0,1;radius=1 --solver";
    all.push(of("--solver", solver).word(text).told());
    for set in [
        format!("{text}=1"),
        format!("segment.{text}=1"),
        format!("segment.method={text}"),
        format!("segment.method=\"{text}\""),
    ] {
        let scene = "pipeline scene.toml --out out --cache off --dry-run --set";
        all.push(planted(format!("--set {set:?}"), "scene.toml", whole.as_str(), scene).word(set));
    }
    let until = planted(
        format!("--until {text:?}"),
        "scene.toml",
        whole.as_str(),
        "pipeline scene.toml --out out --cache off --until",
    );
    all.push(until.word(text).told());
    let force = planted(
        format!("--force {text:?}"),
        "scene.toml",
        whole.as_str(),
        "pipeline scene.toml --out out --cache off --force",
    );
    all.push(force.word(text).told());
    all.push(of("a phantom", "phantom -o out.ivd").word(text).told());
    for case in &mut all {
        case.words.retain(|word| !word.is_empty());
    }
    all
}

/// Runs the cases of a group; gives how many there were and in how many the text was repeated.
fn run(cases: &[Planted]) -> (usize, usize) {
    let repeated = each_in_a_folder(cases, Planted::check);
    (repeated.len(), repeated.into_iter().filter(|told| *told).count())
}

/// Runs a group over all texts; some of it must have been repeated, or nothing was proved.
pub(crate) fn check(group: &str) {
    let groups: BTreeMap<&str, fn(&str) -> Vec<Planted>> = BTreeMap::from([
        ("volumes", volumes as fn(&str) -> Vec<Planted>),
        ("xml", xml),
        ("meshes", meshes),
        ("artefacts", heads),
        ("scenes", scenes),
        ("words", words),
    ]);
    // The text of most characters stands in every field, those of one character in every eighth, other eighths each.
    let every = every(8);
    let of_text = |(i, text): (usize, &String)| {
        let fields = groups[group](text).into_iter().enumerate();
        fields.filter(move |(field, _)| i == 0 || (i + field) % every == 0).map(|(_, case)| case)
    };
    let cases: Vec<Planted> = texts().iter().enumerate().flat_map(of_text).collect();
    let (all, repeated) = run(&cases);
    eprintln!("{group}: {all} cases, the text repeated in {repeated}");
    assert!(repeated * 20 >= all, "{group}: repeated in {repeated} of {all} cases only");
}

/// Pages: the scene's file, its bones, its paths, and what changed since the last run.
pub(crate) fn check_page() {
    for text in texts().iter().filter(|text| !text.contains('\0')) {
        let folder = tempfile::tempdir().unwrap();
        let scene = folder.path().join(format!("{text}.toml"));
        let word = toml(text);
        let run = |angle: f64| {
            let body = format!(
                "schema = 1\n[input]\nfile = {}\n[segment]\nk = 2\n[lattice]\niso = 127.5\n[refine]\nlevel = 0\n[deform]\nsolver = \"projective\"\n\
                 [[deform.rigid]]\nname = {word}\ncentre = [6.0, 6.0, 9.5]\nradius = 3.5\npivot = [6.0, 6.0, 6.0]\nangle = {angle:.1}\nreach = 6.0\n\
                 [render]\nsize = [8, 8]\n[output]\nreport = true\n",
                toml(&format!("{text}.nrrd"))
            );
            std::fs::write(&scene, body).unwrap();
            let words = [
                "pipeline".into(),
                scene.clone().into_os_string(),
                "--out".into(),
                folder.path().join(text).into(),
            ];
            let cache = folder.path().join("cache");
            let program = || Command::new(env!("CARGO_BIN_EXE_ivd"));
            let volume = folder.path().join(format!("{text}.nrrd"));
            let ball = folder.path().join("v.ivd");
            for (words, out) in [("phantom sphere --size 12 -o", &ball), ("export v.ivd -o", &volume)] {
                let at =
                    program().current_dir(folder.path()).args(words.split(' ')).arg(out).output().unwrap();
                assert!(at.status.success(), "{at:?}");
            }
            let done = program().args(words).arg("--cache").arg(cache).arg("-q").output().unwrap();
            assert!(done.status.success(), "{}", String::from_utf8_lossy(&done.stderr));
            std::fs::read_to_string(folder.path().join(text).join("report.html")).unwrap()
        };
        for angle in [3.0, 4.0] {
            let page = run(angle);
            assert!(page.matches("\\u{").count() >= 3, "title, heading and bone");
            for (n, line) in page.lines().enumerate() {
                assert_eq!(shown(line), line, "line {n} of the page for {text:?}");
            }
        }
    }
}
