//! What a person does in a window, drawn by chance: verbs, and the requests that each is. Tests of the program have it, too.

use std::collections::{BTreeMap, BTreeSet};

use ivd_frames::{
    Axis, ClipPart, Cuboid, HalfSpace, Lies, MapName, Pane, Request, Shows, SolverName, WEIGHTS,
};
use ivd_render::Side;

use super::common::Draw;

/// One case of so many is tried, all where `IVD_STRESS_EVERY` is 1; `usual`: without it.
pub(crate) fn every(usual: usize) -> usize {
    std::env::var("IVD_STRESS_EVERY")
        .map_or(usual, |text| text.parse().unwrap_or_else(|_| panic!("IVD_STRESS_EVERY={text} is no number")))
}

/// Verbs, by what they are called.
pub(crate) const VERBS: [&str; 24] = [
    "orbit",
    "pan",
    "zoom",
    "look",
    "window",
    "transfer",
    "slice",
    "cross",
    "cut",
    "compare",
    "measure",
    "hover",
    "drag",
    "wheel",
    "pin",
    "undo",
    "redo",
    "escape",
    "level",
    "stiffness",
    "map",
    "incise",
    "clip",
    "bone",
];

/// A place where the ball is seen from the front, and in every slice.
fn place(draw: &mut Draw) -> [f64; 2] {
    [0, 1].map(|_| 0.35 + 0.3 * draw.unit())
}

/// A scene in which there is a bone, so that masses are on springs.
pub(crate) const BONED: &str = r#"
[deform]
solver = "projective"
tolerance = 0.01
ground = 0.01
[[deform.rigid]]
centre = [16.0, 16.0, 5.0]
radius = 4.0
reach = 6.0
"#;

/// A scene that is cut open and clipped as it begins.
pub(crate) const OPENED: &str = r#"
[[space.step]]
kind = "cut"
centre = [16.0, 16.0, 18.0]
normal = [1.0, 0.0, 0.0]
radius = 9.0
open = 1.5
[clip]
space = "rest"
[[clip.planes]]
point = [16.0, 18.0, 16.0]
normal = [0.0, -1.0, 0.0]
"#;

/// What a person does for a verb, as requests.
pub(crate) fn requests(verb: &str, draw: &mut Draw) -> Vec<Request> {
    let way = |draw: &mut Draw, most: f64| [0, 1].map(|_| most * (2.0 * draw.unit() - 1.0));
    let slices = [Pane::Axial, Pane::Coronal, Pane::Sagittal];
    let pane = [Pane::Volume, Pane::Axial, Pane::Coronal][draw.below(3)];
    let slice = slices[draw.below(3)];
    let mut drag = |ends: Request| {
        let at = place(draw);
        let by = way(draw, 0.03);
        let lock = [None, None, Some(Axis::Y)][draw.below(3)];
        let to = |share: f64| [at[0] + share * by[0], at[1] + share * by[1]];
        let mut all = vec![Request::Grab { pane, at }];
        all.extend([0.4, 0.8, 1.0].map(|share| Request::Drag { to: to(share), lock }));
        all.push(ends);
        all
    };
    match verb {
        "drag" => drag(Request::Drop),
        "escape" => drag(Request::Abandon),
        "orbit" => vec![Request::Orbit { by: way(draw, 0.2) }],
        "pan" => vec![Request::Pan { by: way(draw, 0.05) }],
        "zoom" => vec![Request::Zoom { factor: 0.8 + 0.5 * draw.unit(), at: place(draw) }],
        "look" => vec![
            Request::Look { side: [Side::Front, Side::Left, Side::Top][draw.below(3)] },
            Request::ResetView,
        ],
        "window" => vec![Request::Window { by: way(draw, 0.1) }],
        "transfer" => vec![
            Request::Transfer { by: way(draw, 0.1) },
            Request::AllClasses { hidden: true },
            Request::ResetColours,
        ],
        "slice" => vec![Request::Slice { pane: slice, steps: draw.below(7) as i32 - 3 }],
        "cross" => vec![Request::Cross { pane: slice, at: place(draw) }],
        "cut" => vec![
            Request::Cut {
                along: Some([Pane::Volume, Pane::Axial, Pane::Coronal, Pane::Sagittal][draw.below(4)]),
            },
            Request::Cut { along: None },
        ],
        // What is pointed at meanwhile is at rest, or is not.
        "compare" => vec![
            Request::Compare { shows: [Shows::Rest, Shows::Both][draw.below(2)], at: draw.unit() },
            Request::Pin { pane, at: place(draw) },
            Request::Compare { shows: Shows::Now, at: 0.5 },
        ],
        "measure" => vec![
            Request::Measure { pane, from: place(draw), to: place(draw) },
            Request::Unmeasure { ruler: draw.below(20) as u32 },
        ],
        "hover" => vec![Request::Hover { pane, at: place(draw) }],
        "wheel" => vec![Request::Wheel { steps: draw.below(5) as i32 - 2 }],
        "pin" => vec![Request::Pin { pane: Pane::Volume, at: place(draw) }],
        "undo" => vec![Request::Undo],
        "redo" => vec![Request::Redo],
        "level" => vec![Request::Level { level: [0, 1, 1, 2][draw.below(4)] }],
        // Where a bone is, rings are refused; classes aren't known here.
        "stiffness" => vec![
            Request::Solver { solver: [SolverName::Ring, SolverName::Springs][draw.below(2)] },
            Request::Material { class: 1, stiffness: 40.0 },
            Request::Stiffness { stiffness: 20.0 + 60.0 * draw.unit() },
        ],
        // Where voxels follow smoothest there is no depth to be chosen.
        "map" => vec![
            Request::Depth { weight: WEIGHTS[draw.below(4)].0 },
            Request::Map { map: [MapName::Octree, MapName::Biharmonic][draw.below(2)] },
        ],
        // A cut that opens, one that changes, and one that closes.
        "incise" => {
            let centre = [0, 1, 2].map(|_| 16.0 + 6.0 * (draw.unit() - 0.5));
            let normal = [draw.unit() + 0.1, draw.unit() - 0.5, draw.unit() - 0.5];
            let cut = Request::Incise { centre, normal, radius: 8.0, open: 2.0 * draw.unit() };
            let space = draw.below(4) as u32;
            match draw.below(5) {
                0 => vec![Request::Close { space }, cut],
                1 => vec![cut],
                2 => vec![cut, Request::Open { space, radius: 7.0, open: 2.0 * draw.unit() }],
                _ => vec![Request::Stroke { pane, from: place(draw), to: place(draw) }],
            }
        }
        "clip" => {
            let point = [0, 1, 2].map(|_| 16.0 + 8.0 * (draw.unit() - 0.5));
            let normal = [draw.unit() - 0.5, draw.unit() - 0.5, 0.1];
            let clip = draw.below(3) as u32;
            let cuboid = Cuboid { min: point.map(|c| c - 12.0), max: point.map(|c| c + 9.0) };
            let part = [ClipPart::Plane(HalfSpace { point, normal }), ClipPart::Box(cuboid)][draw.below(2)];
            match draw.below(5) {
                0 => vec![Request::Clip { point, normal }, Request::Unclip { clip }],
                1 => vec![Request::Clip { point, normal }],
                2 => vec![Request::ClipHere { along: pane }, Request::MoveClip { clip, part }],
                3 => vec![Request::ClipBox { min: cuboid.min, max: cuboid.max }],
                _ => vec![Request::ClipIn { space: [Lies::Rest, Lies::Deformed][draw.below(2)] }],
            }
        }
        "bone" => vec![Request::Turn {
            bone: 0,
            pivot: [16.0, 16.0, 6.0],
            axis: [1.0, draw.unit(), 0.0],
            angle: 6.0 * (draw.unit() - 0.5),
            by: [0.0, 0.0, draw.unit() - 0.5],
        }],
        other => panic!("no verb {other}"),
    }
}

/// The verbs of a script, one after the other: something to work on, then its share of a walk on which each follows each once.
///
/// - `scripts`: how many share it.
pub(crate) fn verbs(all: &[&'static str], script: usize, scripts: usize) -> Vec<&'static str> {
    let walk = walk(all.len());
    let pairs = walk.len() - 1;
    let [from, to] = [script, script + 1].map(|script| (script * pairs.div_ceil(scripts)).min(pairs));
    ["drag"].into_iter().chain(walk[from..=to].iter().map(|verb| all[*verb])).collect()
}

/// A walk over so many places from each to each, itself too, by every way once (Hierholzer).
fn walk(places: usize) -> Vec<usize> {
    let mut draw = Draw(7);
    let mut ways: Vec<Vec<usize>> = Vec::new();
    for _ in 0..places {
        let mut to: Vec<usize> = (0..places).collect();
        (1..places).for_each(|i| to.swap(i, draw.below(i + 1)));
        ways.push(to);
    }
    let (mut stack, mut walk) = (vec![0], Vec::new());
    while let Some(&at) = stack.last() {
        match ways[at].pop() {
            Some(to) => stack.push(to),
            None => walk.extend(stack.pop()),
        }
    }
    walk
}

/// Which verbs were done, and which after which.
#[derive(Default)]
pub(crate) struct Coverage {
    counts: BTreeMap<&'static str, usize>,
    pairs: BTreeSet<[&'static str; 2]>,
}

impl Coverage {
    pub(crate) fn take(&mut self, verbs: &[&'static str]) {
        for verb in verbs {
            *self.counts.entry(verb).or_insert(0) += 1;
        }
        self.pairs.extend(verbs.windows(2).map(|pair| [pair[0], pair[1]]));
    }

    /// Each verb at least twenty times, each ordered pair once.
    pub(crate) fn assert_all(&self, all: &[&'static str]) {
        assert!(self.pairs.len() >= all.len() * all.len(), "{} pairs", self.pairs.len());
        assert!(all.iter().all(|verb| self.counts.get(verb) >= Some(&20)), "{:?}", self.counts);
    }
}
