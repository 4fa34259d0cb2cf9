//! Scripts of everything that is done in a window: what is shown in the end is what the pipeline makes of the scene that is saved then.

use std::collections::{BTreeMap, BTreeSet};

use ivd_artefact::Cache;
use ivd_core::{Displacement, Exec, Value as _, Volume};
use ivd_field::lies::Lies;
use ivd_field::shape::{Kind, Shape};
use ivd_frames::{Axis, ClipPart, Cuboid, HalfSpace, MapName, Model, Pane, Request, Saved, SolverName};
use ivd_map::space::Step;
use ivd_pipeline::plan::Plan;
use ivd_pipeline::scene::{Loaded, parse};
use ivd_pipeline::{PipelineOptions, Runner, run_node};
use ivd_render::Side;
use ivd_session::{ClipRule, Event, Settings};

use super::common::{BALL, Draw, model};

/// One case of so many is tried; all where `IVD_STRESS_EVERY` is 1.
fn every() -> usize {
    std::env::var("IVD_STRESS_EVERY")
        .map_or(5, |text| text.parse().unwrap_or_else(|_| panic!("IVD_STRESS_EVERY={text} is no number")))
}

/// Verbs, by what they are called.
const VERBS: [&str; 23] = [
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
    "incise",
    "clip",
    "bone",
    "space",
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
const OPENED: &str = r#"
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

/// What is done to a session for the verb that no request does: steps in space other than a cut, and clips of the body at rest.
fn events(draw: &mut Draw) -> Event {
    let kind = Kind::Translate { by: [0, 1, 2].map(|_| 1.6 * (draw.unit() - 0.5)) };
    let centre = [0, 1, 2].map(|_| 16.0 + 8.0 * (draw.unit() - 0.5));
    let step = Step::Shape(Shape { kind, centre, axis: [0.0, 0.0, 1.0], radius: 8.0, core: 0.3 });
    match draw.below(4) {
        0 => Event::RemoveSpace { space: draw.below(4) as u32 },
        1 => Event::ClipRule(ClipRule {
            invert: draw.below(4) == 0,
            background: [None, Some(2.0)][draw.below(2)],
            space: [None, Some(Lies::Rest)][draw.below(2)],
        }),
        _ => Event::Space { id: None, step },
    }
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
        // Where a bone is, rings are refused; classes aren't known here.
        "stiffness" => vec![
            Request::Solver { solver: [SolverName::Ring, SolverName::Springs][draw.below(2)] },
            Request::Material { class: 1, stiffness: 40.0 },
            Request::Stiffness { stiffness: 20.0 + 60.0 * draw.unit() },
        ],
        "map" => vec![Request::Map { map: [MapName::Octree, MapName::Biharmonic][draw.below(2)] }],
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

/// What the pipeline makes of a scene, nothing of it known before.
pub(crate) fn made(text: &str) -> (Option<Displacement>, Volume) {
    let scene = parse(text, &[]).unwrap();
    let loaded = Loaded { scene, folder: ".".into(), file: "scene.toml".into() };
    let (exec, cache) = (Exec::default(), Cache::disabled());
    let plan = Plan::new(&loaded, None, None).unwrap();
    let runner = Runner { exec: &exec, cache: &cache, lazy: false };
    let mut done = BTreeMap::new();
    for node in plan.nodes().iter().filter(|n| n.needed && n.id.stage != "render") {
        done.insert(node.id, run_node(node, &done, runner, &PipelineOptions::default()).unwrap());
    }
    let of_stage = |stage: &str| done.iter().find(|(id, _)| id.stage == stage).map(|(_, result)| result);
    let field = |stage| of_stage(stage).and_then(|result| Displacement::of(&result.artefact)).cloned();
    let volume = |stage| of_stage(stage).and_then(|result| Volume::of(&result.artefact)).cloned();
    // Each goes on from the one before; a scene that moves nothing asks for a picture alone.
    let displacement = field("space").or_else(|| field("map"));
    let volume = volume("clip").or_else(|| volume("warp")).or_else(|| volume("import"));
    (displacement, volume.unwrap())
}

pub(crate) fn assert_as_piped(model: &Model) {
    let text = model.save(Saved::Scene, String::new(), &Exec::default()).unwrap();
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
    let (mut moved, mut refused, mut parts) = (0, 0, [0; 3]);
    for script in 0..scripts {
        let mut model = model(&format!("{BALL}{}", ["", BONED, OPENED][script % 3]));
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
            if verb == "space" {
                // What doesn't go together changes nothing.
                refused +=
                    usize::from(model.session_mut().apply(events(&mut draw), &Exec::default()).is_err());
                continue;
            }
            for request in requests(verb, &mut draw) {
                // A grab beside the ball takes nothing, and its drag moves nothing.
                if model.follow(&request).is_err() {
                    refused += 1;
                }
            }
            assert!(!model.session().in_gesture());
        }
        moved += usize::from(!model.session().displacement().is_identity());
        let Settings { space, clip, bones, .. } = model.session().settings();
        let turned = bones.iter().any(|bone| bone.angle.is_some());
        let there = [!space.is_empty(), !clip.parts.is_empty(), turned];
        parts.iter_mut().zip(there).for_each(|(count, there)| *count += usize::from(there));
        assert_as_piped(&model);
        while model.session().steps().next().is_some() {
            model.follow(&Request::Undo).unwrap();
        }
        assert_eq!(model.session().deformed(), &start);
    }
    assert!(pairs.len() >= all.len(), "{} of {} pairs", pairs.len(), all.len());
    assert!(counts.values().all(|&count| count >= 20), "{counts:?}");
    assert!(parts.iter().all(|&count| count > 8), "steps, clips and bones in {parts:?} of {scripts}");
    assert!(moved * 2 > scripts, "{moved} of {scripts} end deformed, {refused} requests refused");
}
