//! The object that every command prints with `--json`, on generated volumes of a few thousand voxels.

use std::collections::BTreeSet;
use std::fmt::Write as _;
use std::path::Path;

use serde_json::Value;

use crate::snapshots::masks::{masked, numbers_masked, pretty, text_masked, without_times};
use crate::snapshots::{check, check_files, help, ivd, words};

/// Snapshots by name, with the commands that print them, in this order: later ones read what earlier ones wrote.
const COMMANDS: &[(&str, &str)] = &[
    ("phantom", "phantom head --size 32 -o head.ivd --truth truth.nrrd"),
    ("phantom-f32", "phantom bars --size 16 --type f32 --noise 0.02 --seed 3 -o bars.ivd"),
    ("export-volume", "export head.ivd -o head.nii.gz"),
    ("import", "import head.nii.gz -o again.ivd"),
    ("import-labels", "import truth.nrrd --labels -o truth.ivd"),
    ("export-raw", "export head.ivd -o head.raw"),
    ("import-raw", "import head.raw --raw-dims 32,32,32 --raw-type u8 --raw-spacing 1,1,2 -o raw.ivd"),
    ("segment-emvs", "segment head.ivd --method emvs --k 3 --posteriors-out p -o emvs.ivd"),
    ("segment-msvs", "segment head.ivd --method msvs -o msvs.ivd"),
    ("segment-msvs+kmvs", "segment head.ivd --method msvs+kmvs -o both.ivd"),
    ("segment-hvs", "segment head.ivd --method hvs --k 4 --tree-out tree.ivd -o hvs.ivd"),
    ("segment-from-tree", "segment --from-tree tree.ivd --k 6 -o finer.ivd"),
    ("segment-threshold", "segment head.ivd --method threshold --values 40,90 -o threshold.ivd"),
    ("segment-spatial", "segment head.ivd --method kmvs --k 3 --spatial-weight 1.5 -o spatial.ivd"),
    ("segment-kmvs", "segment head.ivd --method kmvs --k 4 -o labels.ivd"),
    ("atf", "atf head.ivd labels.ivd -o transfer.ivd"),
    ("boundary", "boundary head.ivd --labels labels.ivd --class densest -o part.ivd"),
    ("lattice", "lattice head.ivd --labels labels.ivd --mask part.ivd --iso boundary -o lattice.ivd"),
    ("lattice-parts", "lattice truth.ivd --labels truth.ivd --parts all -o parts"),
    ("export-lattice", "export lattice.ivd -o lattice.stl"),
    ("lattice-mesh", "lattice head.ivd --mesh lattice.stl -o mesh.ivd"),
    ("refine-decimate", "refine lattice.ivd --method decimate --ratio 0.5 -o decimate.ivd"),
    ("refine-loop", "refine lattice.ivd --method loop --level 1 -o loop.ivd"),
    ("refine-merge", "refine lattice.ivd --method merge --level 1 -o merge.ivd"),
    ("refine-sample", "refine lattice.ivd --method sample --count 200 -o sample.ivd"),
    ("refine-chain", "refine lattice.ivd --chain 1,2 -o levels.ivd"),
    ("refine-collapse", "refine lattice.ivd --method collapse --level 1 -o coarse.ivd"),
    ("octree", "octree coarse.ivd -o octree.ivd"),
    (
        "deform-dynamics",
        "deform coarse.ivd --solver dynamics --frames 3 --handle 'pick=16,25,16;move=0,1,0;radius=8' -o dynamics.ivd",
    ),
    (
        "deform-xpbd",
        "deform coarse.ivd --solver xpbd --labels labels.ivd --handle 'pick=16,25,16;move=0,1,0;radius=8' -o xpbd.ivd",
    ),
    (
        "deform-bone",
        "deform coarse.ivd --solver projective --rigid 'name=jaw;low=0,0,0;high=31,31,12;pivot=16,16,12;axis=1,0,0;angle=4;reach=12' -o bone.ivd",
    ),
    (
        "deform-shape",
        "deform coarse.ivd --shape 'kind=twist;centre=16,16,16;radius=14;axis=0,0,1;rate=0.5' -o shape.ivd",
    ),
    (
        "deform-ring",
        "deform coarse.ivd --handle 'pick=16,25,16;move=0,1,0;radius=8' --fix 'pick=16,8,16;radius=3' -o motion.ivd",
    ),
    ("map-biharmonic", "map coarse.ivd octree.ivd motion.ivd --method biharmonic -o biharmonic.ivd"),
    ("map-fem", "map coarse.ivd octree.ivd motion.ivd --method fem --cell 2 -o fem.ivd"),
    ("map-octree", "map coarse.ivd octree.ivd motion.ivd -o displacement.ivd"),
    (
        "space",
        "space head.ivd --step 'kind=cut;centre=16,25,16;normal=0,0,1;radius=7;open=2' --after displacement.ivd -o space.ivd",
    ),
    ("space-chain", "space head.ivd --step 'kind=chain;centre=16,25,16;grip=2;by=0,-2,0' -o chain.ivd"),
    ("warp", "warp head.ivd displacement.ivd -o deformed.ivd"),
    ("warp-labels", "warp labels.ivd displacement.ivd -o deformed-labels.ivd"),
    ("combine", "combine head.ivd deformed.ivd --op union --window 20,200 -o union.ivd"),
    (
        "clip",
        "clip deformed.ivd --plane 'point=16,16,16;normal=0,0,1' --displacement displacement.ivd -o upper.ivd",
    ),
    (
        "render",
        "render head.ivd --transfer transfer.ivd --displacement displacement.ivd --size 24x16 -o after.png",
    ),
    ("render-image", "render head.ivd --mode iso --iso 60 --size 24x16 -o iso.ivd"),
    ("export-displacement", "export displacement.ivd --direction forward -o forward.nrrd"),
    ("export-motion", "export motion.ivd --lattice coarse.ivd -o motion.glb"),
    ("export-json", "export labels.ivd -o labels.json"),
    ("info-volume", "info head.ivd"),
    ("info-file", "info head.nii.gz"),
    ("info-labels", "info labels.ivd"),
    ("info-mask", "info part.ivd"),
    ("info-tree", "info tree.ivd"),
    ("info-lattice", "info coarse.ivd --vertex 7 --voxel 16,25,16"),
    ("info-octree", "info octree.ivd"),
    ("info-motion", "info motion.ivd"),
    ("info-displacement", "info displacement.ivd"),
    ("info-transfer", "info transfer.ivd"),
    ("info-image", "info iso.ivd"),
    ("compare-volume", "compare head.ivd deformed.ivd"),
    ("compare-labels", "compare labels.ivd truth.ivd"),
    ("compare-lattice", "compare lattice.ivd coarse.ivd"),
    ("compare-displacement", "compare displacement.ivd biharmonic.ivd"),
    ("pipeline", "pipeline scene.toml --out out"),
    ("pipeline-again", "pipeline scene.toml --out out --set refine.level=2"),
    ("pipeline-dry-run", "pipeline scene.toml --out out --dry-run --until map"),
    ("pipeline-max-error", "pipeline scene.toml --out within --cache off --max-error 0.5"),
    ("doctor", "doctor"),
    ("cache-show", "cache show"),
    ("cache-prune", "cache prune --keep 1KiB"),
    ("cache-clear", "cache clear"),
    ("completions", "completions bash"),
];

/// Commands of which no object is kept: `demo` prints what `pipeline` does, of a volume that takes a second, and runs with the
/// README; `schema` is kept as it is; of `bench` every number is a time or comes of one; `serve` tells links that nobody else may know, and runs on; `view` has no object.
const WITHOUT: &[&str] = &["demo", "schema", "bench", "cache", "serve", "view"];

const SCENE: &str = "schema = 1
[input]
phantom = \"head\"
size = 32
[refine]
level = 1
[[deform.handle]]
pick = [16.0, 25.0, 16.0]
move = [0.0, 1.0, 0.0]
radius = 8.0
[render]
size = [24, 16]
[output]
images = [\"before\", \"after\", \"difference\"]
volume = \"deformed.nrrd\"
labels = \"labels.nrrd\"
lattice_deformed = \"moved.ply\"
report = true
";

fn object(folder: &Path, line: &str) -> Value {
    let said = ivd(folder, &words(&format!("{line} --json --quiet")));
    assert_eq!((said.code, said.err.as_str()), (0, ""), "{line}");
    assert_eq!(said.out.lines().count(), 1, "{line}: one object, one line");
    serde_json::from_str(&said.out).unwrap()
}

#[test]
fn every_command_prints_the_object_that_is_kept() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    std::fs::write(at.join("scene.toml"), SCENE).unwrap();
    for (name, line) in COMMANDS {
        check(&format!("json/{name}.json"), &pretty(&masked(&object(at, line), at)));
    }
    let bench = object(at, "bench lattice --size 16 --repeats 1 --out bench");
    check("json/bench.json", &pretty(&numbers_masked(&bench, at)));
    let names = COMMANDS.iter().map(|(name, _)| *name).chain(["bench"]);
    check_files("json", &names.map(|name| format!("{name}.json")).collect::<BTreeSet<_>>());
}

#[test]
fn no_command_is_without_an_object() {
    for (command, _) in help::pages().iter().filter(|(c, _)| !c.is_empty() && !WITHOUT.contains(&c.as_str()))
    {
        let begins = |line: &str| {
            line.strip_prefix(command.as_str()).is_some_and(|rest| rest.is_empty() || rest.starts_with(' '))
        };
        assert!(COMMANDS.iter().any(|(_, line)| begins(line)), "COMMANDS has no line that runs {command}");
    }
}

/// What people read, where it isn't the object's figures again.
#[test]
fn what_is_said_to_people_is_as_kept() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    std::fs::write(at.join("scene.toml"), SCENE).unwrap();
    let mut told = String::new();
    for line in [
        "pipeline scene.toml --out out --explain",
        "pipeline scene.toml --out out --explain --set deform.stiffness=80",
        "pipeline scene.toml --out out --dry-run --force map",
        "pipeline scene.toml --out out --explain --max-error 0.5",
        "phantom head --size 32 -o head.ivd",
        "segment head.ivd -o labels.ivd",
        "info labels.ivd",
        "lattice head.ivd --iso 60 -o lattice.ivd",
        "info lattice.ivd --vertex 7",
        "compare head.ivd head.ivd",
    ] {
        let said = ivd(at, &words(line));
        assert_eq!(said.code, 0, "{line}: {}", said.err);
        let _ = writeln!(told, "$ ivd {line}\n{}{}", said.err, said.out);
    }
    check("talk.txt", &without_times(&text_masked(&told, at)));
}
