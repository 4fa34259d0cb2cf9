//! Scripts of everything that is done in a window: what is shown in the end is what the pipeline makes of the scene that is saved then.

use std::collections::{BTreeMap, BTreeSet};

use ivd_artefact::Cache;
use ivd_core::{Displacement, Exec, Value as _, Volume};
use ivd_frames::{Axis, MapName, Model, Pane, Request, Saved};
use ivd_pipeline::plan::Plan;
use ivd_pipeline::scene::{Loaded, parse};
use ivd_pipeline::{PipelineOptions, Runner, run_node};
use ivd_render::Side;

use super::common::{BALL, Draw, model};

/// One case of so many is tried; all where `IVD_STRESS_EVERY` is 1.
fn every() -> usize {
    std::env::var("IVD_STRESS_EVERY")
        .map_or(5, |text| text.parse().unwrap_or_else(|_| panic!("IVD_STRESS_EVERY={text} is no number")))
}

/// Verbs, by what they are called.
const VERBS: [&str; 19] = [
    "orbit",
    "pan",
    "zoom",
    "look",
    "window",
    "transfer",
    "slice",
    "cross",
    "cut",
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
];

/// A place where the ball is seen from the front, and in every slice.
fn place(draw: &mut Draw) -> [f64; 2] {
    [0, 1].map(|_| 0.35 + 0.3 * draw.unit())
}

/// What a person does for a verb, as requests.
fn requests(verb: &str, draw: &mut Draw) -> Vec<Request> {
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
        "transfer" => vec![Request::Transfer { by: way(draw, 0.1) }, Request::ResetColours],
        "slice" => vec![Request::Slice { pane: slice, steps: draw.below(7) as i32 - 3 }],
        "cross" => vec![Request::Cross { pane: slice, at: place(draw) }],
        "cut" => vec![
            Request::Cut {
                along: Some([Pane::Volume, Pane::Axial, Pane::Coronal, Pane::Sagittal][draw.below(4)]),
            },
            Request::Cut { along: None },
        ],
        "hover" => vec![Request::Hover { pane, at: place(draw) }],
        "wheel" => vec![Request::Wheel { steps: draw.below(5) as i32 - 2 }],
        "pin" => vec![Request::Pin { pane: Pane::Volume, at: place(draw) }],
        "undo" => vec![Request::Undo],
        "redo" => vec![Request::Redo],
        "level" => vec![Request::Level { level: [0, 1, 1, 2][draw.below(4)] }],
        "stiffness" => vec![Request::Stiffness { stiffness: 20.0 + 60.0 * draw.unit() }],
        "map" => vec![Request::Map { map: [MapName::Octree, MapName::Biharmonic][draw.below(2)] }],
        other => panic!("no verb {other}"),
    }
}

/// What the pipeline makes of a scene, nothing of it known before.
fn made(text: &str) -> (Option<Displacement>, Volume) {
    let scene = parse(text, &[]).unwrap();
    let loaded = Loaded { scene, folder: ".".into(), file: "scene.toml".into() };
    let (exec, cache) = (Exec::default(), Cache::disabled());
    let plan = Plan::new(&loaded, None, None).unwrap();
    let runner = Runner { exec: &exec, cache: &cache, lazy: false };
    let mut done = BTreeMap::new();
    for node in plan.nodes().iter().filter(|n| n.needed && n.id.stage != "render") {
        done.insert(node.id, run_node(node, &done, runner, &PipelineOptions::default()).unwrap());
    }
    let displacement = done.values().find_map(|result| Displacement::of(&result.artefact)).cloned();
    let volume = |stage: &str| {
        done.iter()
            .find(|(id, _)| id.stage == stage)
            .and_then(|(_, result)| Volume::of(&result.artefact))
            .cloned()
    };
    // A scene that moves nothing asks for a picture alone.
    let volume = if displacement.is_some() { volume("warp") } else { volume("import") };
    (displacement, volume.unwrap())
}

pub(crate) fn assert_as_piped(model: &Model) {
    let text = model.save(Saved::Scene, &[], &Exec::default()).unwrap();
    let text = String::from_utf8(text.bytes).unwrap();
    let (displacement, volume) = made(&text);
    match displacement {
        Some(displacement) => assert_eq!(model.session().displacement(), &displacement, "{text}"),
        None => assert!(model.session().displacement().is_identity(), "{text}"),
    }
    assert_eq!(model.session().deformed().voxels(), volume.voxels(), "{text}");
}

#[test]
fn scripts_end_where_the_pipeline_does() {
    let mut draw = Draw(11);
    let mut counts: BTreeMap<&str, usize> = BTreeMap::new();
    let mut pairs = BTreeSet::new();
    // Every ordered pair of verbs, cut into scripts.
    let all: Vec<[usize; 2]> =
        (0..VERBS.len() * VERBS.len()).map(|i| [i / VERBS.len(), i % VERBS.len()]).collect();
    let scripts = 200 / every();
    let (mut moved, mut refused) = (0, 0);
    for script in 0..scripts {
        let mut model = model(BALL);
        let start = model.session().deformed().clone();
        // Something to work on, then the pairs of this script, each verb after the one before it.
        let mut verbs = vec!["drag"];
        for pair in all.iter().skip(script).step_by(scripts) {
            verbs.extend(pair.map(|verb| VERBS[verb]));
        }
        for pair in verbs.windows(2) {
            pairs.insert([pair[0], pair[1]]);
        }
        for verb in verbs {
            *counts.entry(verb).or_insert(0) += 1;
            for request in requests(verb, &mut draw) {
                // A grab beside the ball takes nothing, and its drag moves nothing.
                if model.follow(&request).is_err() {
                    refused += 1;
                }
            }
            assert!(!model.session().in_gesture());
        }
        moved += usize::from(!model.session().displacement().is_identity());
        assert_as_piped(&model);
        while model.session().steps().next().is_some() {
            model.follow(&Request::Undo).unwrap();
        }
        assert_eq!(model.session().deformed(), &start);
    }
    assert!(pairs.len() >= all.len(), "{} of {} pairs", pairs.len(), all.len());
    assert!(counts.values().all(|&count| count >= 20), "{counts:?}");
    assert!(moved * 2 > scripts, "{moved} of {scripts} end deformed, {refused} requests refused");
}
