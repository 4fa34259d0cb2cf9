//! Scenes and parameters: every key with values that can't be meant, and texts that are no TOML.

use crate::hostile::case::Case;
use crate::hostile::good;

/// Wrong usage or scene.
const USAGE: &[i32] = &[2];

const HEAD: &str = "schema = 1\n[input]\nphantom = \"sphere\"\nsize = 12\n[output]\nlabels = \"l.nrrd\"\n";

/// Sections with their keys: a good value, and whether 0, −1 and a huge number are good too.
const KEYS: [(&str, &str, &str); 38] = [
    ("segment", "method", "\"kmvs\""),
    ("segment", "k", "2"),
    ("segment", "values", "[1.0]"),
    ("boundary", "class", "1"),
    ("boundary", "seed", "[1.0, 2.0, 3.0]"),
    ("boundary", "fill_holes", "true"),
    ("boundary", "above", "1.0"),
    ("lattice", "iso", "1.0"),
    ("refine", "method", "\"collapse\""),
    ("refine", "level", "1"),
    ("refine", "max_turn_degrees", "60.0"),
    ("refine", "shape_weight", "0.1"),
    ("octree", "leaf_size", "4"),
    ("deform", "solver", "\"ring\""),
    ("deform", "stiffness", "50.0"),
    ("deform", "duration", "0.2"),
    ("deform", "dt", "0.01"),
    ("deform", "ground", "1.0"),
    ("deform", "damping", "1.0"),
    ("deform", "density", "0.001"),
    ("deform", "vertex_mass", "1.0"),
    ("deform", "epsilon", "0.001"),
    ("deform", "literal", "false"),
    ("map", "weight", "\"one\""),
    ("map", "depth", "3.0"),
    ("map", "margin", "3.0"),
    ("map", "outside", "\"band\""),
    ("map", "tolerance", "0.5"),
    ("warp", "order", "\"cubic\""),
    ("warp", "background", "1.0"),
    ("atf", "resolution", "64"),
    ("atf", "max_opacity", "0.5"),
    ("atf", "softness", "0.5"),
    ("render", "mode", "\"mip\""),
    ("render", "size", "[8, 8]"),
    ("render", "zoom", "1.0"),
    ("render", "step", "0.5"),
    ("render", "background", "[0.0, 0.0, 0.0, 1.0]"),
];

/// Values of a type that no key has.
const WRONG: [&str; 4] = ["{ a = 1 }", "\"elephant\"", "[[1, 2], [3]]", "1979-05-27"];

fn scene(name: String, codes: &'static [i32], text: String) -> Case {
    Case::new(format!("scene {name}"), codes)
        .file("scene.toml", text)
        .words("pipeline scene.toml --dry-run --out out --cache off")
}

fn scenes() -> Vec<Case> {
    let mut cases = Vec::new();
    for (section, key, good) in KEYS {
        for value in WRONG {
            cases.push(scene(
                format!("{section}.{key} = {value}"),
                USAGE,
                format!("{HEAD}[{section}]\n{key} = {value}\n"),
            ));
        }
        let misspelt = format!("{HEAD}[{section}]\n{key}x = {good}\n");
        cases.push(scene(format!("{section}.{key}x"), USAGE, misspelt));
        let twice = format!("{HEAD}[{section}]\n{key} = {good}\n{key} = {good}\n");
        cases.push(scene(format!("{section}.{key} twice"), USAGE, twice));
    }
    for (name, text) in [
        ("empty", String::new()),
        ("not TOML", "what is this".into()),
        ("not UTF-8 would be binary", "schema = \u{0}".into()),
        ("schema 2", HEAD.replace("schema = 1", "schema = 2")),
        ("schema −1", HEAD.replace("schema = 1", "schema = -1")),
        ("no schema", HEAD.replace("schema = 1\n", "")),
        ("no input", "schema = 1\n[output]\n".into()),
        ("no output", "schema = 1\n[input]\nphantom = \"head\"\n".into()),
        ("two inputs", HEAD.replace("size = 12", "file = \"a.nrrd\"")),
        ("an absolute input", HEAD.replace("phantom = \"sphere\"", "file = \"/etc/passwd\"")),
        ("an output above", HEAD.replace("\"l.nrrd\"", "\"../l.nrrd\"")),
        ("an absolute output", HEAD.replace("\"l.nrrd\"", "\"/tmp/l.nrrd\"")),
        ("an unknown phantom", HEAD.replace("sphere", "elephant")),
        ("deeply nested lists", format!("{HEAD}x = {}", "[".repeat(100_000))),
        ("deeply nested tables", format!("{HEAD}x = {}", "{a=".repeat(100_000))),
        ("deeply dotted keys", format!("{HEAD}{}x = 1\n", "a.".repeat(100_000))),
        ("a very long key", format!("{HEAD}{} = 1\n", "a".repeat(8 << 20))),
        (
            "very many keys",
            HEAD.to_owned() + &(0..100_000).map(|i| format!("k{i} = 1\n")).collect::<String>(),
        ),
        ("a string without an end", format!("{HEAD}x = \"{}", "a".repeat(8 << 20))),
        (
            "a handle without a radius",
            format!("{HEAD}[[deform.handle]]\npick = [0, 0, 0]\nmove = [0, 0, 1]\n"),
        ),
        (
            "a handle with two places",
            format!(
                "{HEAD}[[deform.handle]]\npick = [0, 0, 0]\nvertex = 1\nmove = [0, 0, 1]\nradius = 1.0\n"
            ),
        ),
        (
            "a handle that moves to nan",
            format!("{HEAD}[[deform.handle]]\nvertex = 1\nmove = [0, nan, 1]\nradius = 1.0\n"),
        ),
        (
            "a handle with radius −1",
            format!("{HEAD}[[deform.handle]]\nvertex = 1\nmove = [0, 0, 1]\nradius = -1.0\n"),
        ),
        (
            "a handle with radius nan",
            format!("{HEAD}[[deform.handle]]\nvertex = 1\nmove = [0, 0, 1]\nradius = nan\n"),
        ),
        (
            "a shape without its keys",
            format!("{HEAD}[[deform.shape]]\nkind = \"twist\"\ncentre = [0, 0, 0]\nradius = 1.0\n"),
        ),
        (
            "a shape that is nothing",
            format!(
                "{HEAD}[[deform.shape]]\nkind = \"scale\"\ncentre = [0, 0, 0]\nradius = 1.0\nalong = 0.0\n"
            ),
        ),
        ("vertex −1", format!("{HEAD}[[deform.handle]]\nvertex = -1\nmove = [0, 0, 1]\nradius = 1.0\n")),
    ] {
        cases.push(scene(name.to_owned(), USAGE, text));
    }
    cases.push(scene("of bytes that are no text".into(), USAGE, String::new()));
    cases
}

/// Parameters of stages that can be run on a small volume alone, with values out of every domain.
fn params() -> Vec<Case> {
    let volume = good::file("nrrd");
    let mut cases = Vec::new();
    for (words, keys) in [
        (
            "segment",
            &[
                "k = 0",
                "k = -1",
                "k = 1000000",
                "k = 1e300",
                "method = \"threshold\"\nvalues = [nan]",
                "method = \"threshold\"\nvalues = [2.0, 1.0]",
                "method = \"threshold\"\nvalues = [inf]",
            ][..],
        ),
        (
            "boundary",
            &[
                "class = -1",
                "class = 70000",
                "class = \"heaviest\"",
                "seed = [nan, 0.0, 0.0]",
                "seed = [1.0]",
                "seed = [1e300, 0.0, 0.0]",
                "above = nan",
                "above = inf",
                "above = 1.0\nclass = 1",
            ][..],
        ),
        ("lattice", &["iso = nan", "iso = inf", "iso = -inf", "iso = \"border\""][..]),
        (
            "render",
            &[
                "size = [0, 4]",
                "size = [4, 100000]",
                "size = [-1, 4]",
                "view = [nan, 0.0]",
                "view = [0.0, 91.0]",
                "zoom = 0.0",
                "zoom = nan",
                "zoom = -1.0",
                "step = 0.0",
                "step = 1e9",
                "step = nan",
                "termination = 0.0",
                "termination = nan",
                "background = [2.0, 0.0, 0.0, 1.0]",
                "background = [0.0]",
                "surface = [nan, 0.0, 0.0]",
                "mode = \"iso\"",
                "mode = \"iso\"\niso = nan",
                "size = [4, 4]\nx = 1",
            ][..],
        ),
    ] {
        for key in keys {
            let end = if words == "render" { "png" } else { "ivd" };
            cases.push(
                Case::new(format!("--params of {words}: {key}"), USAGE)
                    .file("p.toml", *key)
                    .file("v.nrrd", volume.clone())
                    .words(&format!("{words} v.nrrd --params p.toml -o out.{end}"))
                    .says(":"),
            );
        }
        for text in ["what is this", "[a]\nb = 1", "k = ", "\u{0}", "k = 1\nk = 1"] {
            cases.push(
                Case::new(format!("--params of {words}: {text}"), USAGE)
                    .file("p.toml", text)
                    .file("v.nrrd", volume.clone())
                    .words(&format!("{words} v.nrrd --params p.toml -o out.ivd"))
                    .says("p.toml"),
            );
        }
    }
    cases
}

/// Arguments that can't be meant.
fn arguments() -> Vec<Case> {
    let mut cases = Vec::new();
    for handle in [
        "",
        ";",
        "pick",
        "pick=",
        "pick=1,2",
        "pick=1,2,3,4",
        "pick=a,b,c",
        "pick=nan,0,0;move=0,0,1;radius=1",
        "vertex=-1;move=0,0,1;radius=1",
        "vertex=99999999999;move=0,0,1;radius=1",
        "vertex=0;radius=1",
        "vertex=0;move=0,0,1",
        "vertex=0;move=0,0,1;radius=nan",
        "vertex=0;move=0,0,1;radius=-1",
        "vertex=0;move=0,0,inf;radius=1",
        "vertex=0;move=0,0,1;force=0,0,1;radius=1",
        "vertex=0;push=0,0,1;radius=1",
    ] {
        cases.push(
            Case::new(format!("--handle {handle}"), USAGE)
                .words("deform l.ivd -o out.ivd --handle")
                .word(handle)
                .says("--handle"),
        );
    }
    for fix in [
        "",
        "pick=1,2,3",
        "radius=1",
        "pick=1,2,3;radius=0",
        "pick=1,2,3;radius=nan",
        "pick=1,2,3;radius=1;x=1",
    ] {
        cases.push(
            Case::new(format!("--fix {fix}"), USAGE)
                .words("deform l.ivd -o out.ivd --handle vertex=0;move=0,0,1;radius=1 --fix")
                .word(fix)
                .says("--fix"),
        );
    }
    for set in [
        "",
        "=",
        "a",
        ".=1",
        "segment.k",
        "segment..k=1",
        "nothing.at.all=1",
        "segment=1",
        "input.phantom.x=1",
        "output=3",
    ] {
        cases.push(
            Case::new(format!("--set {set}"), USAGE)
                .file("scene.toml", HEAD)
                .words("pipeline scene.toml --dry-run --out out --cache off --set")
                .word(set)
                .says(":"),
        );
    }
    for limit in ["", "-1", "nan", "elephant", "1 parsec", "1e400", "--"] {
        let word = format!("--memory-limit={limit}");
        cases.push(Case::new(word.clone(), USAGE).words("doctor").word(word).says("--memory-limit"));
    }
    for dims in ["0,1,1", "1,1", "-1,1,1", "9999999999,9999999999,9999999999", "a,b,c"] {
        cases.push(
            Case::new(format!("--raw-dims {dims}"), &[2, 3])
                .file("v.raw", vec![0; 64])
                .words(&format!("import v.raw -o out.ivd --raw-type u8 --raw-dims={dims}"))
                .says(":"),
        );
    }
    cases
}

pub(crate) fn cases() -> Vec<Case> {
    [scenes(), params(), arguments()].concat()
}
