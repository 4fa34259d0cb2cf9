//! Exit codes and messages of wrong usage, wrong scenes and failures.

use std::fmt::Write as _;
use std::path::Path;

use crate::snapshots::masks::{text_masked, without_times};
use crate::snapshots::{check, ivd, prepare, words};

/// Volumes, labels, lattices and what goes with them, small, for commands to be wrong about.
const BEFORE: &[&str] = &[
    "phantom sphere --size 24 -o v.ivd --quiet",
    "phantom sphere --size 16 -o small.ivd --quiet",
    "segment v.ivd --k 2 -o labels.ivd --quiet",
    "boundary v.ivd --labels labels.ivd --class densest -o part.ivd --quiet",
    "lattice v.ivd --iso 127.5 -o l.ivd --quiet",
    "lattice small.ivd --iso 127.5 -o other.ivd --quiet",
    "octree l.ivd -o o.ivd --quiet",
    "deform l.ivd --handle pick=21,12,12;move=1,0,0;radius=8 -o m.ivd --quiet",
    "deform l.ivd --handle pick=21,12,12;move=-20,0,0;radius=4 -o deep.ivd --quiet",
    "map l.ivd o.ivd m.ivd -o d.ivd --quiet",
    "export v.ivd -o v.nrrd --quiet",
];

/// Wrong words: usage that the program refuses.
const USAGE: &[&str] = &[
    "",
    "bogus",
    "segmnt v.ivd -o x.ivd",
    "segment",
    "segment v.ivd",
    "segment v.ivd -o x.ivd --bogus",
    "segment v.ivd -o x.ivd --bogus --json",
    "segment v.ivd -o x.ivd --method fastest",
    "segment v.ivd -o x.ivd --method fastest --json",
    "segment v.ivd -o x.ivd --k 0",
    "segment v.ivd -o x.ivd --k many",
    "segment v.ivd -o x.ivd --k 3 --method threshold",
    "segment v.ivd -o x.ivd --method threshold",
    "segment v.ivd -o x.ivd --method threshold --values 90,40",
    "segment v.ivd -o x.ivd --method emvs --smoothing -1",
    "segment v.ivd -o x.ivd --range 5",
    "segment v.ivd -o x.ivd --linkage single",
    "segment v.ivd -o x.ivd --order colour",
    "segment --from-tree v.ivd --k 3 -o x.ivd",
    "segment v.ivd --from-tree v.ivd -o x.ivd",
    "boundary v.ivd -o x.ivd --class thickest",
    "boundary v.ivd --labels labels.ivd -o x.ivd --class 9",
    "boundary v.ivd -o x.ivd --seed 1,2",
    "boundary v.ivd -o x.ivd --seed 500,0,0",
    "boundary v.ivd -o x.ivd --above 1e9",
    "lattice v.ivd -o x.ivd --iso high",
    "lattice v.ivd -o x.ivd --iso nan",
    "lattice v.ivd -o x.ivd --iso 1e9",
    "lattice v.ivd -o x.ivd --parts all",
    "lattice v.ivd -o x.ivd --iso 1 --mesh m.stl",
    "lattice v.ivd -o x.ivd --weld 1",
    "lattice small.ivd --labels labels.ivd --iso boundary -o x.ivd",
    "refine l.ivd -o x.ivd --level 1 --ratio 0.5",
    "refine l.ivd -o x.ivd --ratio 2",
    "refine l.ivd -o x.ivd --ratio -1",
    "refine l.ivd -o x.ivd --max-error nan",
    "refine l.ivd -o x.ivd --method melt",
    "refine l.ivd -o x.ivd --method melt --json",
    "refine l.ivd -o x.ivd --lock pick=1,2,3",
    "refine v.ivd -o x.ivd --level 1",
    "octree v.ivd -o x.ivd",
    "octree l.ivd -o x.ivd --params leaf.toml",
    "octree l.ivd -o x.ivd --params spelled.toml",
    "octree l.ivd -o x.ivd --params broken.toml",
    "deform l.ivd -o x.ivd",
    "deform l.ivd -o x.ivd --handle pick=1,2,3",
    "deform l.ivd -o x.ivd --handle pick=1,2,3;move=1,0,0;radius=0",
    "deform l.ivd -o x.ivd --handle pick=1,2,3;move=1,0,0;radius=x",
    "deform l.ivd -o x.ivd --handle pick=1,2,3;move=1,0,0;radios=4",
    "deform l.ivd -o x.ivd --handle pick=1,2,3;move=1,0,0;radius=4;radius=5",
    "deform l.ivd -o x.ivd --handle pick=500,0,0;move=1,0,0;radius=5",
    "deform l.ivd -o x.ivd --handle vertex=9999999;move=1,0,0;radius=5",
    "deform l.ivd -o x.ivd --handle pick=1,2,3;vertex=4;move=1,0,0;radius=5",
    "deform l.ivd -o x.ivd --handle pick=21,12,12;force=1,0,0;radius=5",
    "deform l.ivd -o x.ivd --handle pick=21,12,12;move=1,0,0;radius=5 --solver magic",
    "deform l.ivd -o x.ivd --handle pick=21,12,12;move=1,0,0;radius=5 --stiffness -4",
    "deform l.ivd -o x.ivd --handle pick=21,12,12;move=1,0,0;radius=5 --frames 3",
    "deform l.ivd -o x.ivd --rigid centre=12,12,12;radius=4;reach=4",
    "deform l.ivd -o x.ivd --shape kind=knot;centre=12,12,12;radius=4",
    "deform l.ivd -o x.ivd --shape kind=twist;centre=12,12,12;radius=4",
    "map l.ivd o.ivd -o x.ivd",
    "map l.ivd o.ivd v.ivd -o x.ivd",
    "map other.ivd o.ivd m.ivd -o x.ivd",
    "map l.ivd o.ivd m.ivd -o x.ivd --method rubber",
    "map l.ivd o.ivd m.ivd -o x.ivd --cell 3",
    "map l.ivd o.ivd m.ivd -o x.ivd --method fem --poisson 0.6",
    "map l.ivd o.ivd m.ivd -o x.ivd --poisson 0.3",
    "map l.ivd o.ivd m.ivd -o x.ivd --margin -1",
    "map l.ivd o.ivd m.ivd -o x.ivd --method biharmonic --weight linear",
    "map l.ivd o.ivd m.ivd -o x.ivd --outside open",
    "space v.ivd -o x.ivd",
    "space v.ivd -o x.ivd --step kind=melt",
    "space v.ivd -o x.ivd --step kind=cut;centre=12,12,12",
    "warp v.ivd l.ivd -o x.ivd",
    "warp small.ivd d.ivd -o x.ivd",
    "warp v.ivd d.ivd -o x.ivd --order quintic",
    "warp labels.ivd d.ivd -o x.ivd --order cubic",
    "combine v.ivd -o x.ivd --op union",
    "combine v.ivd v.ivd -o x.ivd",
    "combine v.ivd l.ivd -o x.ivd --op union",
    "combine v.ivd v.ivd -o x.ivd --op melt",
    "combine v.ivd v.ivd -o x.ivd --op union --displacement 3=d.ivd",
    "combine v.ivd v.ivd v.ivd -o x.ivd --op union --window 0,1 --window 0,1",
    "clip v.ivd -o x.ivd",
    "clip v.ivd -o x.ivd --plane point=1,2,3",
    "clip v.ivd -o x.ivd --box min=5,5,5;max=1,1,1",
    "clip v.ivd -o x.ivd --class 2",
    "render v.ivd -o x.png",
    "render v.ivd -o x.jpg --mode mip",
    "render v.ivd -o x.png --mode iso",
    "render v.ivd -o x.png --mode xray",
    "render v.ivd -o x.png --mode mip --size 0x5",
    "render v.ivd -o x.png --mode mip --view 5",
    "render v.ivd -o x.png --mode mip --step 0",
    "export v.ivd -o x.foo",
    "export v.ivd -o x.ply",
    "export l.ivd -o x.nrrd",
    "export l.ivd -o x.ply --level 2",
    "export m.ivd -o x.glb",
    "export v.ivd -o x.nrrd --direction forward",
    "info v.ivd --vertex 3",
    "info l.ivd --vertex 9999999",
    "info l.ivd --voxel 1,2",
    "compare v.ivd l.ivd",
    "compare v.ivd small.ivd",
    "phantom cube -o x.ivd",
    "phantom sphere --size 0 -o x.ivd",
    "phantom sphere --size 24 --type u64 -o x.ivd",
    "phantom sphere --size 24 --noise -1 -o x.ivd",
    "import v.nrrd -o x.ivd --raw-dims 2,2,2",
    "import v.nrrd -o x.ivd --raw-dims 2,2 --raw-type u8",
    "import v.nrrd -o x.ivd --frame 4",
    "bench octree",
    "bench --size 4",
    "cache prune --keep lots",
    "cache melt",
    "completions tcsh",
    "doctor --threads 0",
    "doctor --memory-limit much",
    "doctor --backend npu",
    "doctor --quiet --verbose",
    "doctor --params leaf.toml",
    "pipeline",
    "pipeline good.toml --until never",
    "pipeline good.toml --force never",
    "pipeline good.toml --set deform",
    "pipeline good.toml --set deform.stiffness=soft",
    "pipeline good.toml --set map.metod=fem",
    "pipeline good.toml --set segment.k=0",
    "pipeline good.toml --max-time 0",
    "pipeline good.toml --max-error -1",
    "view v.ivd",
    "view --set lattice.iso=1",
];

/// What goes wrong though the words are right.
const FAILURES: &[&str] = &[
    "import gone.nrrd -o x.ivd",
    "import junk.nrrd -o x.ivd",
    "import junk.nrrd -o x.ivd --json",
    "import text.txt -o x.ivd",
    "import . -o x.ivd",
    "segment junk.ivd -o x.ivd",
    "segment gone.ivd -o x.ivd",
    "lattice torn.ivd --iso 127.5 -o x.ivd",
    "map l.ivd o.ivd deep.ivd -o x.ivd",
    "map l.ivd o.ivd deep.ivd -o x.ivd --json",
    "phantom sphere --size 600 --memory-limit 10M -o x.ivd",
    "phantom sphere --size 24 -o no/such/folder/x.ivd",
    "phantom sphere --size 24 -o no/such/folder/x.ivd --json",
    "doctor --require-gpu",
    "doctor --backend gpu --require-gpu",
    "pipeline gone.toml",
    "pipeline good.toml --input gone.nrrd",
    "pipeline good.toml --max-time 1e-9",
    "pipeline good.toml --cache good.toml",
];

const GOOD: &str = "schema = 1
[input]
phantom = \"sphere\"
size = 24
[[deform.handle]]
pick = [21.0, 12.0, 12.0]
move = [1.0, 0.0, 0.0]
radius = 8.0
[output]
volume = \"deformed.nrrd\"
";

/// Scenes that are wrong: what a line of [`GOOD`] is replaced by.
const SCENES: &[(&str, &str)] = &[
    ("schema = 1", ""),
    ("schema = 1", "schema = 2"),
    ("schema = 1", "schema = one"),
    ("[input]", "[imput]"),
    ("phantom = \"sphere\"", "phantom = \"cube\""),
    ("phantom = \"sphere\"", "file = \"gone.nrrd\""),
    ("phantom = \"sphere\"", ""),
    ("size = 24", "size = -3"),
    ("size = 24", "size = 24\nsice = 5"),
    ("size = 24", "size = 24\n[segment]\nmethod = \"fastest\""),
    ("size = 24", "size = 24\n[segment]\nk = \"several\""),
    ("size = 24", "size = 24\n[segment]\nvalues = [1.0]"),
    ("size = 24", "size = 24\n[segment]\nmethod = \"hvs\"\nsmoothing = 1.0"),
    ("size = 24", "size = 24\n[boundary]\nclass = \"thickest\""),
    ("size = 24", "size = 24\n[boundary]\nclass = 9"),
    ("size = 24", "size = 24\n[lattice]\niso = \"border\""),
    ("size = 24", "size = 24\n[refine]\nlevel = 2\nratio = 0.5"),
    ("size = 24", "size = 24\n[refine]\nmethod = \"melt\""),
    ("size = 24", "size = 24\n[octree]\nleaf_size = 0"),
    ("size = 24", "size = 24\n[map]\nmethod = \"rubber\""),
    ("size = 24", "size = 24\n[map]\npoisson = 0.3"),
    ("size = 24", "size = 24\n[map]\nmethod = \"biharmonic\"\nweight = \"linear\""),
    ("size = 24", "size = 24\n[map]\nmethod = \"fem\"\npoisson = 0.6"),
    ("size = 24", "size = 24\n[map]\nmethod = \"fem\"\n[map.material.9]\npoisson = 0.3"),
    ("size = 24", "size = 24\n[map]\nmargin = -1.0"),
    ("size = 24", "size = 24\n[map]\ntolerance = nan"),
    ("size = 24", "size = 24\n[warp]\norder = \"quintic\""),
    ("size = 24", "size = 24\n[deform]\nsolver = \"magic\""),
    ("size = 24", "size = 24\n[deform]\nsolver = \"xpbd\"\nliteral = true"),
    ("size = 24", "size = 24\n[deform]\nstiffness = -4.0"),
    ("size = 24", "size = 24\n[deform]\ndrag = 0.5"),
    ("radius = 8.0", "radius = 0.0"),
    ("radius = 8.0", ""),
    ("radius = 8.0", "radius = 8.0\nforce = [1.0, 0.0, 0.0]"),
    ("move = [1.0, 0.0, 0.0]", "move = [1.0, 0.0]"),
    ("move = [1.0, 0.0, 0.0]\nradius = 8.0", "move = [-20.0, 0.0, 0.0]\nradius = 4.0"),
    ("[output]", "[[space.step]]\nkind = \"melt\"\n[output]"),
    ("volume = \"deformed.nrrd\"", "volume = \"../deformed.nrrd\""),
    ("volume = \"deformed.nrrd\"", "volume = \"deformed.foo\""),
    ("volume = \"deformed.nrrd\"", "lattice = \"deformed.nrrd\""),
    ("volume = \"deformed.nrrd\"", "images = [\"during\"]"),
    ("volume = \"deformed.nrrd\"", "images = [\"before\"]\n[render]\nstep = 0.0"),
    ("volume = \"deformed.nrrd\"", "images = [\"before\"]\n[render]\nmode = \"iso\""),
    ("volume = \"deformed.nrrd\"", "images = [\"before\"]\n[atf]\nmax_opacity = 2.0"),
    ("volume = \"deformed.nrrd\"", "volume = \"same.nrrd\"\nlabels = \"same.nrrd\""),
];

/// What a command ends with, as text: its exit code, what it says on stderr (!) and on stdout (>). Of a command that is taken
/// the code alone; of one that isn't nothing may be left behind.
fn told(folder: &Path, line: &str) -> String {
    let said = ivd(folder, &words(line));
    let left =
        ["x.ivd", "x.png", "x.jpg"].iter().filter(|file| std::fs::remove_file(folder.join(file)).is_ok());
    let left = left.count();
    if said.code == 0 {
        return format!("$ ivd {line}\n= 0\n");
    }
    assert_eq!(left, 0, "`ivd {line}` left something");
    let marked = |mark: char, text: &str| {
        text.lines().map(|l| format!("{mark} {l}").trim_end().to_owned() + "\n").collect::<String>()
    };
    let text = format!("$ ivd {line}\n= {}\n{}{}", said.code, marked('!', &said.err), marked('>', &said.out));
    without_times(&text_masked(&text, folder))
}

fn prepared() -> tempfile::TempDir {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    prepare(at, BEFORE);
    let mut torn = std::fs::read(at.join("v.ivd")).unwrap();
    torn.truncate(torn.len() / 2);
    let files: [(&str, &[u8]); 8] = [
        ("good.toml", GOOD.as_bytes()),
        ("leaf.toml", b"leaf_size = 0\n"),
        ("spelled.toml", b"leaf_sise = 8\n"),
        ("broken.toml", b"leaf_size = \n"),
        ("junk.nrrd", b"NRRD0004\ndimension: 3\nsizes: 2 2 2\nencoding: raw\ntype: elephant\n\n"),
        ("junk.ivd", b"this is no artefact"),
        ("text.txt", b"this is no volume"),
        ("torn.ivd", &torn),
    ];
    for (name, bytes) in files {
        std::fs::write(at.join(name), bytes).unwrap();
    }
    folder
}

#[test]
fn wrong_words_are_refused_as_kept() {
    let folder = prepared();
    let text: Vec<String> = USAGE.iter().map(|line| told(folder.path(), line)).collect();
    check("usage.txt", &text.join("\n"));
}

#[test]
fn failures_end_as_kept() {
    let folder = prepared();
    let text: Vec<String> = FAILURES.iter().map(|line| told(folder.path(), line)).collect();
    check("failures.txt", &text.join("\n"));
}

#[test]
fn wrong_scenes_are_refused_as_kept() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    let mut text = String::new();
    for (line, instead) in SCENES {
        assert!(GOOD.contains(line), "{line}");
        std::fs::write(at.join("scene.toml"), GOOD.replace(line, instead)).unwrap();
        let _ = writeln!(text, "# {} → {}", line.replace('\n', " | "), instead.replace('\n', " | "));
        text += &told(at, "pipeline scene.toml --out out --cache off --quiet");
        text += "\n";
    }
    check("scenes.txt", &text);
}
