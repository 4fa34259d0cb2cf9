use std::collections::BTreeMap;

use ivd_core::Exec;
use serde::{Deserialize, Serialize};

use super::place::{Content, Place, Run, settle};
use crate::Error;

/// What a scene did and didn't do.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SkipRow {
    /// What the scene asks for.
    pub scene: String,
    /// Stages that did their work.
    pub ran: Vec<String>,
    /// Stages that the scene could have.
    pub stages: usize,
    /// Voxels that these stages looked at; of pictures, samples.
    pub visited: f64,
    /// How many of them the outputs need at least.
    pub least: f64,
    /// Bytes that were read of files: the source, cached results, mapped volumes.
    pub bytes_read: u64,
    /// Processor time of all threads (s).
    pub cpu_s: f64,
    /// The same with every skip and the cache off (s).
    pub cpu_plain_s: f64,
    /// Voxels and samples looked at with every skip off.
    pub visited_plain: f64,
    /// Whether every result is the same, byte for byte, with every skip off.
    pub same: bool,
}

/// A scene, what it is run on, and what changed since a run before it.
struct Case {
    name: &'static str,
    scene: String,
    content: Content,
    before: Option<&'static str>,
    set: &'static [&'static str],
}

const ISO: &str = "[lattice]\niso = 60.0\n";
const PICTURE: &str = "[render]\nsize = [128, 128]\n";
/// A cheek of the head is pushed in.
pub(super) const HANDLE: &str =
    "[[deform.handle]]\npick = [93.0, 45.3, 43.0]\nmove = [-3.0, 0.0, 0.0]\nradius = 16.0\n";
const VOLUME: &str = "[output]\nvolume = \"deformed.nrrd\"\n";
const LATTICE: &str = "[output]\nlattice = \"lattice.ply\"\n";

fn cases() -> Vec<Case> {
    let case = |name, scene| Case { name, scene, content: Content::Head, before: None, set: &[] };
    let cheek = || format!("{ISO}{HANDLE}{VOLUME}");
    vec![
        case("a picture", format!("{ISO}{PICTURE}[output]\nimages = [\"before\"]\n")),
        case("a lattice", format!("{ISO}{LATTICE}")),
        case("one cheek touched", cheek()),
        Case { set: &["deform.handle.0.radius=400.0"], ..case("everything touched", cheek()) },
        Case { content: Content::Empty, ..case("an empty volume", format!("{ISO}{LATTICE}")) },
        case("one class isolated", format!("[boundary]\nclass = \"densest\"\n{LATTICE}")),
        Case {
            before: Some("lattice.iso=80.0"),
            ..case("a second isovalue", format!("{ISO}[output]\nlattice_extracted = \"lattice.ply\"\n"))
        },
        Case { before: Some("deform.stiffness=30.0"), ..case("only the stiffness changed", cheek()) },
    ]
}

/// Runs the scenes on a head of `size` voxels along an edge.
///
/// # Errors
/// [`Error::Failed`] names the scene.
pub fn skipping(size: usize, exec: &Exec) -> Result<Vec<SkipRow>, Error> {
    cases().iter().map(|case| row(case, size, exec)).collect()
}

fn row(case: &Case, size: usize, exec: &Exec) -> Result<SkipRow, Error> {
    let place = Place::new(case.name, size, case.content, &case.scene, exec)?;
    if let Some(before) = case.before {
        settle();
        place.run(&[case.set, &[before]].concat(), None, true, exec)?;
    }
    let run = place.run(case.set, None, true, exec)?;
    let mut everything = exec.clone();
    everything.skip = false;
    let plain = place.run(case.set, None, false, &everything)?;
    let [visited, least] = run.visited()?;
    Ok(SkipRow {
        scene: case.name.to_owned(),
        ran: run.ran(),
        // The report apart.
        stages: run.report.stages.iter().filter(|r| r.stage != "report").count(),
        visited,
        least,
        bytes_read: run.bytes_read(),
        cpu_s: run.cpu_s,
        cpu_plain_s: plain.cpu_s,
        visited_plain: plain.visited()?[0],
        same: same(&run, &plain),
    })
}

/// Whether every result of one run is that of the other.
fn same(run: &Run, plain: &Run) -> bool {
    let hashes = |run: &Run| -> BTreeMap<(String, String), String> {
        let results = run.report.stages.iter().filter(|r| r.stage != "report");
        results
            .filter_map(|r| Some(((r.stage.clone(), r.variant.clone()), r.output.as_ref()?.hash.clone())))
            .collect()
    };
    let plain = hashes(plain);
    hashes(run).iter().all(|(key, hash)| plain.get(key) == Some(hash))
}
