//! Scripts of everything that is done in a window: what is shown in the end is what the pipeline makes of the scene that is saved then.

use std::collections::BTreeMap;

use ivd_artefact::Cache;
use ivd_core::{Displacement, Exec, Value as _, Volume};
use ivd_field::lies::Lies;
use ivd_field::shape::{Kind, Shape};
use ivd_frames::{Model, Request, Saved};
use ivd_map::space::Step;
use ivd_pipeline::plan::Plan;
use ivd_pipeline::scene::{Loaded, parse};
use ivd_pipeline::{PipelineOptions, Runner, run_node};
use ivd_session::{ClipRule, Event, Settings};

use super::common::{BALL, Draw, model};
use super::verbs::{BONED, Coverage, OPENED, VERBS, every, requests, verbs};

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
    let all: Vec<&str> = VERBS.into_iter().chain(["space"]).collect();
    let mut coverage = Coverage::default();
    let scripts = 200 / every(5);
    // All of them where no case is left out, else a third: the program's own tests (`hands`) walk every way, through the service.
    let tried = if scripts == 200 { scripts } else { scripts.div_ceil(3) };
    let (mut moved, mut refused, mut parts) = (0, 0, [0; 3]);
    for script in 0..tried {
        let mut model = model(&format!("{BALL}{}", ["", BONED, OPENED][script % 3]));
        let start = model.session().deformed().clone();
        let mut verbs = verbs(&all, script, scripts);
        if script % 3 == 1 {
            // Where there is a bone it is turned.
            verbs.push("bone");
        }
        coverage.take(&verbs);
        for verb in verbs {
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
    if tried == scripts {
        coverage.assert_all(&all);
    }
    assert!(parts.iter().all(|&count| 5 * count > tried), "steps, clips and bones in {parts:?} of {tried}");
    assert!(moved * 2 > tried, "{moved} of {tried} end deformed, {refused} requests refused");
}
