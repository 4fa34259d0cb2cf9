//! Scenes and sessions say the same.

use std::collections::BTreeMap;
use std::path::Path;
use std::sync::{Arc, Mutex};

use ivd_core::{Exec, Grid, Image, Value as _, Volume, Voxels};
use ivd_frames::{
    Entry, Error, Model, Overlay, Pane, Request, Saved, Shows, SolverName, Subject, Tell, bare_scene,
};
use ivd_pipeline::plan::Plan;
use ivd_pipeline::{PipelineOptions, Runner, run_node, scene};
use ivd_session::MapChoice;

use super::common::{BALL, loaded, model};
use super::scripts::assert_as_piped;

#[test]
fn a_scene_goes_into_a_session_and_out_again_without_loss() {
    let moved = [
        "[[deform.handle]]\npick = [16.0, 28.0, 16.0]\nmove = [0.0, -1.0, 0.5]\nradius = 9.0\n",
        "[deform]\nsolver = \"projective\"\nstiffness = 30.0\nyoungs_kpa = 12.0\ntolerance = 0.01\n[[deform.handle]]\nvertex = 3\nforce = [0.0, 0.0, 4.0]\nradius = 9.0\n[[deform.fix]]\npick = [16.0, 4.0, 16.0]\nradius = 3.0\n",
        "[deform]\nsolver = \"dynamics\"\n[[deform.shape]]\nkind = \"twist\"\nrate = 2.0\ncentre = [16.0, 16.0, 16.0]\nradius = 9.0\n[map]\nmethod = \"biharmonic\"\nmargin = 2.0\n[warp]\norder = \"cubic\"\nbackground = 3.0\n",
        "[deform]\nsolver = \"projective\"\n[[deform.rigid]]\nname = \"C5\"\ncentre = [16.0, 16.0, 5.0]\nradius = 4.0\nreach = 6.0\npivot = [16.0, 16.0, 5.0]\naxis = [1.0, 0.0, 0.0]\nangle = 4.0\n[[deform.rigid]]\nlow = [12.0, 12.0, 25.0]\nhigh = [20.0, 20.0, 30.0]\nreach = 5.0\nmove = [0.0, 0.5, 0.0]\n",
        "[[space.step]]\nkind = \"chain\"\ncentre = [16.0, 16.0, 16.0]\ngrip = 2.0\nby = [0.0, 1.0, 0.0]\nshear = 0.3\n[[space.step]]\nkind = \"cut\"\ncentre = [16.0, 16.0, 16.0]\nnormal = [0.0, 0.0, 1.0]\nradius = 8.0\nopen = 1.5\n[[space.step]]\nkind = \"translate\"\nby = [0.0, 1.0, 0.0]\ncentre = [16.0, 20.0, 16.0]\nradius = 8.0\n",
        "[clip]\ninvert = true\nbackground = 2.0\nspace = \"rest\"\n[[clip.planes]]\npoint = [16.0, 16.0, 16.0]\nnormal = [0.0, 1.0, 0.0]\n[[clip.boxes]]\nmin = [2.0, 2.0, 2.0]\nmax = [30.0, 20.0, 30.0]\n[[clip.planes]]\npoint = [12.0, 16.0, 16.0]\nnormal = [1.0, 1.0, 0.0]\n[[deform.handle]]\npick = [16.0, 28.0, 16.0]\nmove = [0.0, -1.0, 0.5]\nradius = 9.0\n",
    ];
    for text in moved {
        let subject = Subject::open(
            &loaded(&format!("{BALL}{text}")),
            false,
            &ivd_artefact::Cache::disabled(),
            &Exec::default(),
            &Tell::default(),
        );
        let subject = match subject {
            Ok(subject) => subject,
            Err(error) => panic!("{text}: {error}"),
        };
        let written = subject.scene_of(&subject.settings).unwrap();
        let read = scene::parse(&written.to_text().unwrap(), &[]).unwrap();
        assert_eq!(read, written, "{text}");
        for stage in [
            &ivd_motion::deform::STAGE,
            &ivd_map::STAGE,
            &ivd_map::space::STAGE,
            &ivd_field::warp::STAGE,
            &ivd_field::clip::STAGE,
        ] {
            let before = subject.scene.section(stage).unwrap().job().params();
            assert_eq!(read.section(stage).unwrap().job().params(), before, "{text}: {}", stage.name);
        }
    }
}

#[test]
fn what_was_taken_away_is_not_in_the_scene_any_more() {
    let opened = "[[space.step]]\nkind = \"cut\"\ncentre = [16.0, 16.0, 16.0]\nnormal = [0.0, 0.0, 1.0]\nradius = 8.0\nopen = 1.5\n[clip]\ninvert = true\n[[clip.planes]]\npoint = [16.0, 16.0, 16.0]\nnormal = [0.0, 1.0, 0.0]\n";
    let mut model = model(&format!("{BALL}{opened}"));
    assert!(model.session().deformed() != model.session().rest());
    for request in [Request::Unclip { clip: 0 }, Request::Close { space: 0 }] {
        model.follow(&request).unwrap();
    }
    assert_eq!(model.session().deformed(), model.session().rest());
    let kept = model.save(Saved::Scene, String::new(), &Exec::default()).unwrap();
    let text = String::from_utf8(kept.bytes).unwrap();
    assert!(!text.contains("clip") && !text.contains("space"), "{text}");
    assert!(scene::parse(&text, &[]).unwrap().check().is_ok());
}

#[test]
fn a_scene_that_moves_something_opens_as_it_is_moved() {
    let text = "[[deform.handle]]\npick = [16.0, 28.0, 16.0]\nmove = [0.0, -2.0, 0.0]\nradius = 9.0\n";
    let mut opened = model(&format!("{BALL}{text}"));
    let mut by_hand = model(BALL);
    by_hand.follow(&Request::Radius { handle: None, radius: 9.0 }).unwrap();
    by_hand.follow(&Request::Add { place: [16.0, 28.0, 16.0], by: [0.0, -2.0, 0.0] }).unwrap();
    let (first, second) = (opened.figures(), by_hand.figures());
    assert!(first.largest_mm > 1.0 && first.min_det_j < 1.0, "{first:?}");
    assert_eq!((first.largest_mm, first.min_det_j), (second.largest_mm, second.min_det_j));
    assert_eq!(opened.session().deformed(), by_hand.session().deformed());
}

#[test]
fn classes_are_found_where_matter_goes_by_them() {
    let handle = "[[deform.handle]]\npick = [16.0, 28.0, 16.0]\nmove = [0.0, -1.0, 0.5]\nradius = 9.0\n";
    let springs = "[deform]\nsolver = \"projective\"\n";
    let bone = "[[deform.rigid]]\nclass = 2\ncentre = [16.0, 16.0, 5.0]\nradius = 4.0\nreach = 6.0\n";
    let chain = "[[space.step]]\nkind = \"chain\"\ncentre = [16.0, 16.0, 16.0]\ngrip = 2.0\nby = [0.0, 1.0, 0.0]\n[space.step.material.2]\nshear = 0.3\n";
    for (text, stage) in [
        (format!("{springs}[deform.material.2]\nstiffness = 20.0\n{handle}"), &ivd_motion::deform::STAGE),
        (format!("{springs}{bone}{handle}"), &ivd_motion::deform::STAGE),
        (chain.to_owned(), &ivd_map::space::STAGE),
    ] {
        let loaded = loaded(&format!("{BALL}[segment]\nk = 2\n{text}"));
        let (cache, exec) = (ivd_artefact::Cache::disabled(), Exec::default());
        let subject = Subject::open(&loaded, false, &cache, &exec, &Tell::default()).unwrap();
        assert!(subject.labels.is_some(), "{text}");
        let read =
            scene::parse(&subject.scene_of(&subject.settings).unwrap().to_text().unwrap(), &[]).unwrap();
        let params = |scene: &scene::Scene| scene.section(stage).unwrap().job().params();
        assert_eq!(params(&read), params(&subject.scene));
        let model = ivd_frames::Model::new(subject, [64, 64], exec).unwrap();
        assert!(!model.session().displacement().is_identity(), "{text}");
    }
}

#[test]
fn a_level_that_is_asked_for_stays() {
    let file = Path::new("scan.nii");
    let level = |words: &[&str]| {
        let overrides: Vec<_> = words.iter().map(|word| word.parse().unwrap()).collect();
        let loaded = bare_scene(file, &overrides).unwrap();
        loaded.scene.param(&ivd_lattice::refine::STAGE, "level")
    };
    assert_eq!(level(&["refine.level=0"]), Some(0.into()));
    assert_eq!(level(&[]), None, "it is chosen when the lattice is there");
}

#[test]
fn what_a_session_does_not_have_is_refused_by_name() {
    for (text, part) in [
        ("[combine]\nwith = \"labels\"\n", "[combine]"),
        ("[clip]\ntag = \"labels\"\n", "clip.tag"),
        (
            "[clip]\nof = \"input\"\n[[clip.planes]]\npoint = [16.0, 16.0, 16.0]\nnormal = [0.0, 1.0, 0.0]\n",
            "clip.of",
        ),
        (
            "[deform]\nsolver = \"body\"\n[[deform.handle]]\npick = [16.0, 28.0, 16.0]\nmove = [0.0, -1.0, 0.5]\nradius = 9.0\n[map]\nmethod = \"body\"\n",
            "body",
        ),
        ("[octree]\nleaf_size = 4\n", "[octree]"),
    ] {
        let loaded = loaded(&format!("{BALL}{text}"));
        let opened = Subject::open(
            &loaded,
            false,
            &ivd_artefact::Cache::disabled(),
            &Exec::default(),
            &Tell::default(),
        );
        let error = opened.err().unwrap();
        assert!(matches!(error, Error::NotInSessions { .. }) && error.to_string().contains(part), "{error}");
    }
}

#[test]
fn a_bare_scan_is_opened_by_the_defaults_and_its_level_is_told() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("a ‘scan’.nii.gz");
    let ball = model(BALL);
    let artefact = ivd_core::Artefact::Volume(ball.session().rest().clone());
    ivd_pipeline::export(&artefact, &file, &Exec::default()).unwrap();
    let loaded = bare_scene(&file, &["lattice.iso=127.5".parse().unwrap()]).unwrap();
    let subject =
        Subject::open(&loaded, true, &ivd_artefact::Cache::disabled(), &Exec::default(), &Tell::default())
            .unwrap();
    assert_eq!(&subject.volume, ball.session().rest());
    // What isn't refined has the edges that it has.
    assert_eq!((subject.settings.level, subject.settings.max_edge), (0, None));
    assert_eq!(subject.said.len(), 4, "{:?}", subject.said);
    assert!(matches!(subject.settings.map, MapChoice::Biharmonic(_)));
    assert!(subject.transfer.is_some());
    let model = ivd_frames::Model::new(subject, [64, 64], Exec::default()).unwrap();
    let kept = model.save(Saved::Scene, String::new(), &Exec::default()).unwrap();
    let text = String::from_utf8(kept.bytes.clone()).unwrap();
    let named = kept.naming(|scan| Path::new("a").join(scan.file_name().unwrap())).unwrap();
    assert!(String::from_utf8(named.bytes).unwrap().contains("file = \"a/a ‘scan’.nii.gz\""));
    assert!(text.contains("method = \"biharmonic\"") && !text.contains("max_edge"), "{text}");
    assert!(text.contains("scan.nii.gz\"") && !text.contains('‘'), "where it lies stays untold: {text}");
    assert!(bare_scene(Path::new("x.nii"), &["lattice.isu=3".parse().unwrap()]).is_err());
}

#[test]
fn a_longest_edge_goes_with_the_level_and_the_pipeline_makes_the_same() {
    let text = BALL.replace("level = 1", "level = 2\nmax_edge = 3.0");
    let mut model = model(&text);
    let coarse = model.session().lattice().keys().len();
    let add = Request::Add { place: [16.0, 28.0, 16.0], by: [0.0, -1.5, 0.0] };
    model.follow(&add).unwrap();
    assert_as_piped(&model);
    // Without it there are fewer vertices.
    let free = self::model(&BALL.replace("level = 1", "level = 2"));
    assert!(free.session().lattice().keys().len() < coarse, "{coarse}");
    for (level, mm) in [(3, 6.0), (1, 1.5), (2, 3.0)] {
        model.follow(&Request::Level { level }).unwrap();
        assert_eq!(model.session().settings().max_edge, Some(mm));
        assert_as_piped(&model);
    }
    assert_eq!(model.session().lattice().keys().len(), coarse);
}

#[test]
fn files_to_be_kept_are_what_is_shown() {
    let mut model = model(BALL);
    model.follow(&Request::Add { place: [16.0, 28.0, 16.0], by: [0.0, -1.5, 0.0] }).unwrap();
    assert_eq!(model.figures().refused, None);
    let exec = Exec::default();
    let folder = tempfile::tempdir().unwrap();
    for what in [Saved::Volume, Saved::Displacement, Saved::Lattice, Saved::Picture, Saved::Scene, Saved::Log]
    {
        let file = model.save(what, "{}".to_owned(), &exec).unwrap();
        std::fs::write(folder.path().join(file.name), &file.bytes).unwrap();
        assert!(!file.bytes.is_empty(), "{what:?}");
    }
    let read = |name: &str| {
        let folder = scene::Loaded {
            scene: scene::parse(
                &format!("schema = 1\n[input]\nfile = \"{name}\"\n[lattice]\niso = 127.5\n[output]\nimages = [\"before\"]"),
                &[],
            )
            .unwrap(),
            folder: folder.path().to_owned(),
            file: "scene.toml".into(),
        };
        Subject::open(&folder, false, &ivd_artefact::Cache::disabled(), &exec, &Tell::default())
            .unwrap()
            .volume
    };
    assert_eq!(read("deformed.nii.gz").voxels(), model.session().deformed().voxels());
}

#[test]
fn classes_look_otherwise_and_the_scene_says_so() {
    let by_classes = BALL.replace("[lattice]\niso = 127.5\n", "[segment]\nk = 3\n");
    let mut model = model(&by_classes.replace("mode = \"iso\"\niso = 127.5\n", ""));
    let class = model.figures().classes.last().unwrap().clone();
    let before = model.draw(ivd_frames::Pane::Volume, 1, &Exec::default()).unwrap();
    let colour = Some("#00ff00".to_owned());
    let look =
        |hidden| Request::Class { class: class.id, hidden, opacity: Some(0.5), colour: colour.clone() };
    model.follow(&look(false)).unwrap();
    let now = model.figures().classes.last().unwrap().clone();
    assert_eq!((now.opacity, &*now.colour, now.hidden), (0.5, "#00ff00", false));
    let green = model.draw(ivd_frames::Pane::Volume, 1, &Exec::default()).unwrap();
    assert!(green != before);
    model.follow(&look(true)).unwrap();
    let kept = model.save(Saved::Scene, String::new(), &Exec::default()).unwrap();
    let again = super::common::model(&String::from_utf8(kept.bytes).unwrap());
    let hidden =
        |model: &ivd_frames::Model| model.draw(ivd_frames::Pane::Volume, 1, &Exec::default()).unwrap();
    assert!(hidden(&model) != green);
    assert_eq!(hidden(&model), {
        let mut again = again;
        again.follow(&Request::Resize { size: [128, 128] }).unwrap();
        hidden(&again)
    });
    model.follow(&Request::ResetColours).unwrap();
    assert!(hidden(&model) == before && !model.figures().unsaved);
    assert!(model.follow(&Request::Class { class: 999, hidden: true, opacity: None, colour: None }).is_err());
}

#[test]
fn transitions_go_with_what_a_scene_does_not_show_and_come_back_with_all() {
    let shows = |show: &str| {
        let by_classes = BALL.replace("[lattice]\niso = 127.5\n", "[segment]\nk = 6\n");
        model(&by_classes.replace("mode = \"iso\"\niso = 127.5\n", show))
    };
    let drawn =
        |model: &ivd_frames::Model| model.draw(ivd_frames::Pane::Volume, 1, &Exec::default()).unwrap();
    let mut all = shows("");
    let (first, classes) = (drawn(&all), all.figures().classes);
    let [one, .., last] = &classes[..] else { panic!("{classes:?}") };
    let between = all.figures().transitions;
    assert!(!between.is_empty(), "{classes:?}");
    // By hand, and as a scene says it.
    all.follow(&Request::AllClasses { hidden: true }).unwrap();
    let hidden = |model: &mut Model| model.figures().classes.iter().filter(|class| class.hidden).count();
    assert_eq!(hidden(&mut all), classes.len());
    all.follow(&Request::Class { class: last.id, hidden: false, opacity: None, colour: None }).unwrap();
    let mut said = shows(&format!("show = [{}]\n", last.id));
    assert!(drawn(&all) == drawn(&said) && drawn(&said) != first);
    let kept = all.save(Saved::Scene, String::new(), &Exec::default()).unwrap();
    let kept = String::from_utf8(kept.bytes).unwrap();
    assert!(kept.contains(&format!("show = [{}]", last.id)), "{kept}");
    assert!(drawn(&super::common::model(&kept)) == drawn(&all));
    said.follow(&Request::AllClasses { hidden: false }).unwrap();
    assert!(drawn(&said) == first && one.id != last.id);
    let no_classes = "mode = \"mip\"\n";
    assert!(shows(no_classes).follow(&Request::AllClasses { hidden: true }).is_err());
}

#[test]
fn what_was_done_is_done_again_to_what_is_made_otherwise_and_what_cannot_be_is_told() {
    let large = BALL.replace("size = 32", "size = 64");
    let entries = Arc::<Mutex<Vec<Entry>>>::default();
    let mut first = model(&large);
    let kept = entries.clone();
    first.session_mut().record(move |entry| kept.lock().unwrap().push(entry.clone()));
    let (out, inside) = ([32.0, 69.0, 32.0], [32.0, 14.5, 32.0]);
    for request in [
        Request::Radius { handle: None, radius: 9.0 },
        Request::Add { place: out, by: [0.0; 3] },
        Request::Move { handle: 0, by: [0.0, -1.5, 0.0] },
        Request::Clip { point: [32.0; 3], normal: [1.0, 0.0, 0.0] },
        Request::Stroke { pane: ivd_frames::Pane::Axial, from: [0.45, 0.5], to: [0.55, 0.5] },
        Request::Undo,
        Request::Redo,
        Request::Add { place: inside, by: [0.0; 3] },
        Request::Undo,
    ] {
        first.follow(&request).unwrap();
        assert_eq!(first.figures().refused, None, "{request:?}");
    }
    let entries = entries.lock().unwrap().clone();
    // A little smaller: the handle goes to the nearest of the new lattice.
    let mut smaller = model(&large.replace("iso = 127.5\n[refine]", "iso = 140.0\n[refine]"));
    smaller.replay(&entries).unwrap();
    let (was, is) = (first.figures(), smaller.figures());
    assert_eq!(is.handles[0].by, was.handles[0].by);
    assert!(is.handles[0].rest != was.handles[0].rest && is.largest_mm > 1.0);
    assert_eq!((is.clips, is.incision, is.undo, is.redo), (was.clips, was.incision, was.undo, was.redo));
    assert_eq!(smaller.session().steps().count(), first.session().steps().count());
    // So small that nothing is near where the handle was: all else is there.
    let mut least = model(&large.replace("iso = 127.5\n[refine]", "iso = 250.0\n[refine]"));
    let told = least.replay(&entries).unwrap_err().to_string();
    let is = least.figures();
    assert!(told.contains("6 of 8 steps were done again") && told.contains("add a handle: "), "{told}");
    let missed: Vec<_> = is.missed.iter().map(|one| &*one.name).collect();
    assert_eq!(missed, ["add a handle", "move a handle"]);
    assert!(is.handles.is_empty() && is.clips.len() == 1 && is.incision.is_some());
    assert_eq!(is.redo.as_deref(), Some("add a handle"));
}

#[test]
fn a_scene_keeps_where_the_volume_is_seen_from() {
    let exec = Exec::default();
    let text = |model: &Model| {
        String::from_utf8(model.save(Saved::Scene, String::new(), &exec).unwrap().bytes).unwrap()
    };
    let perspective = BALL.replace("view = \"front\"", "view = \"front\"\nprojection = \"perspective\"");
    for scene in [BALL, &perspective] {
        let mut first = model(scene);
        assert!(!text(&first).contains("zoom"), "what wasn't turned is as the scene has it");
        let moved = Request::Add { place: [16.0, 28.0, 16.0], by: [0.0, -1.5, 0.0] };
        for request in [
            moved,
            Request::Orbit { by: [0.1, 0.07] },
            Request::Zoom { factor: 1.7, at: [0.3, 0.4] },
            Request::Pan { by: [0.05, -0.02] },
        ] {
            first.follow(&request).unwrap();
        }
        let kept = text(&first);
        let mut again = model(&kept);
        let (was, is) = (first.figures(), again.figures());
        assert_eq!((is.angles, is.size, is.unsaved), (was.angles, was.size, false));
        assert!((is.zoom / was.zoom - 1.0).abs() < 1e-9 && (is.width_mm / was.width_mm - 1.0).abs() < 1e-9);
        let image = |model: &Model| model.draw(Pane::Volume, 1, &exec).unwrap();
        assert!(image(&again) == image(&first), "the same picture");
        assert_eq!(text(&again), kept);
        // The pipeline's picture of the body at rest, as large as the pane.
        let overrides = ["render.size=128", "render.annotate=false"].map(|word| word.parse().unwrap());
        let mut piped = scene::parse(&kept, &overrides).unwrap();
        piped.set_output(false);
        first.follow(&Request::Undo).unwrap();
        assert!(drawn(piped) == image(&first), "the pipeline's picture");
        again.follow(&Request::ResetView).unwrap();
        let mut anew = model(scene);
        anew.follow(&Request::Orbit { by: [0.1, 0.07] }).unwrap();
        let (whole, turned) = (again.figures(), anew.figures());
        assert_eq!(whole.angles, turned.angles);
        assert!(whole.zoom < 0.7 * is.zoom && !whole.unsaved && !turned.unsaved);
    }
}

/// The first picture that the pipeline makes: of the volume at rest.
fn drawn(scene: scene::Scene) -> Image {
    let loaded = scene::Loaded { scene, folder: ".".into(), file: "scene.toml".into() };
    let (exec, cache) = (Exec::default(), ivd_artefact::Cache::disabled());
    let runner = Runner { exec: &exec, cache: &cache, lazy: false };
    let mut done = BTreeMap::new();
    let mut image = None::<Image>;
    for node in Plan::new(&loaded, None, None).unwrap().nodes().iter().filter(|node| node.needed) {
        let result = run_node(node, &done, runner, &PipelineOptions::default()).unwrap();
        image = image.or(Image::of(&result.artefact).cloned());
        done.insert(node.id, result);
    }
    image.unwrap()
}

#[test]
fn a_class_is_made_stiffer_in_one_step_and_the_scene_says_so() {
    let by_classes = BALL.replace("[lattice]\niso = 127.5\n", "[segment]\nk = 3\n");
    let mut model = model(&by_classes.replace("mode = \"iso\"\niso = 127.5\n", ""));
    let follow = |model: &mut Model, request: Request| {
        model.follow(&request).unwrap();
        let told = model.figures();
        assert_eq!(told.refused, None, "{request:?}");
        told
    };
    let add = Request::Add { place: [16.0, 28.0, 16.0], by: [0.0; 3] };
    follow(&mut model, add);
    let rings = model.figures();
    assert!(rings.solver == "ring" && rings.matter.is_empty() && rings.knows_classes);
    let refused = Request::Material { class: 1, stiffness: 9.0 };
    model.follow(&refused).unwrap();
    assert!(model.figures().refused.unwrap().why.contains("rings know no classes"));

    let springs = follow(&mut model, Request::Solver { solver: SolverName::Springs });
    assert_eq!((springs.solver, springs.stiffness), ("springs", rings.stiffness));
    let class = springs.matter.last().unwrap().class;
    assert!(springs.matter.iter().all(|one| one.stiffness == Some(springs.stiffness)), "{springs:?}");
    let pulled = follow(&mut model, Request::Pull { handle: 0, with: [0.0, 40.0, 0.0] });
    let steps = model.session().steps().count();
    model.follow(&Request::Adjust).unwrap();
    for stiffness in [100.0, 300.0, 900.0] {
        follow(&mut model, Request::Material { class, stiffness });
    }
    let stiff = follow(&mut model, Request::Drop);
    assert_eq!(stiff.matter.last().unwrap().stiffness, Some(900.0));
    assert!(stiff.largest_mm < 0.8 * pulled.largest_mm, "{} {}", stiff.largest_mm, pulled.largest_mm);
    assert_eq!(
        (model.session().steps().count(), stiff.undo.as_deref()),
        (steps + 1, Some("change the stiffness of a class"))
    );
    assert_eq!(model.session().steps().last().unwrap().events.len(), 1, "the last of it alone");
    assert_as_piped(&model);
    let kept = model.save(Saved::Scene, String::new(), &Exec::default()).unwrap();
    let mut again = super::common::model(&String::from_utf8(kept.bytes).unwrap());
    assert_eq!(again.figures().matter, stiff.matter);
    assert_eq!(again.session().deformed(), model.session().deformed());
    let undone = follow(&mut model, Request::Undo);
    assert_eq!((undone.matter, undone.largest_mm), (springs.matter, pulled.largest_mm));
    for wrong in
        [Request::Material { class: 999, stiffness: 9.0 }, Request::Material { class, stiffness: f64::NAN }]
    {
        assert!(model.follow(&wrong).is_err());
    }
    model.follow(&Request::Material { class, stiffness: -1.0 }).unwrap();
    assert!(model.figures().refused.is_some());
}

#[test]
fn a_scene_keeps_what_windows_show() {
    let exec = Exec::default();
    let text = |model: &Model| {
        String::from_utf8(model.save(Saved::Scene, String::new(), &exec).unwrap().bytes).unwrap()
    };
    let by_classes = BALL.replace("[lattice]\niso = 127.5\n", "[segment]\nk = 3\n");
    let mut first = model(&by_classes.replace("mode = \"iso\"\niso = 127.5\n", ""));
    assert!(!text(&first).contains("[window]"), "what nobody changed isn't said");
    for request in [
        Request::Add { place: [16.0, 28.0, 16.0], by: [0.0, -1.5, 0.0] },
        Request::Slice { pane: Pane::Axial, steps: 3 },
        Request::Window { by: [0.1, 0.05] },
        Request::Transfer { by: [0.05, 0.1] },
        Request::Radius { handle: None, radius: 7.5 },
        Request::Cut { along: Some(Pane::Sagittal) },
        Request::Overlay { of: Some(Overlay::Motion) },
        Request::Ruler {
            ruler: None,
            places: vec![[16.0, 26.5, 16.0], [16.0, 4.0, 16.0], [4.0, 16.0, 16.0]],
        },
        Request::Compare { shows: Shows::Both, at: 0.3 },
    ] {
        first.follow(&request).unwrap();
    }
    let was = first.figures();
    assert!(was.unsaved && was.rulers.len() == 1);
    let kept = text(&first);
    let mut again = model(&kept);
    let is = again.figures();
    assert!(!is.unsaved, "it is as it was kept");
    assert_eq!(
        (is.cross, is.window, is.radius, is.cut, is.overlay, is.compare),
        (was.cross, was.window, was.radius, was.cut, was.overlay, was.compare)
    );
    assert_eq!((is.rulers[0].rest_mm.clone(), is.rulers[0].mm.len()), (was.rulers[0].rest_mm.clone(), 2));
    for (a, b) in is.rulers[0].now.iter().flatten().zip(was.rulers[0].now.iter().flatten()) {
        assert!((a - b).abs() < 0.01, "{a} {b}: it goes with the body");
    }
    again.follow(&Request::Resize { size: [128, 128] }).unwrap();
    for pane in Pane::ALL {
        assert!(again.draw(pane, 1, &exec).unwrap() == first.draw(pane, 1, &exec).unwrap(), "{pane:?}");
    }
    assert_eq!(text(&again), kept);
    // A log that goes on from it takes the rulers along.
    let entries = Arc::<Mutex<Vec<Entry>>>::default();
    let keeps = entries.clone();
    again.session_mut().record(move |entry| keeps.lock().unwrap().push(entry.clone()));
    again.follow(&Request::Move { handle: 0, by: [0.0, -2.5, 0.0] }).unwrap();
    let mut replayed = model(&kept);
    replayed.replay(&entries.lock().unwrap()).unwrap();
    assert_ne!(again.figures().rulers[0].now, is.rulers[0].now);
    assert_eq!(replayed.figures().rulers[0].now, again.figures().rulers[0].now);
    again.follow(&Request::Unmeasure { ruler: 0 }).unwrap();
    assert!(again.figures().unsaved, "a ruler that is gone would be missed, too");
}

#[test]
fn the_body_of_a_bare_scan_is_all_that_is_drawn_of_it() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("scan.nii.gz");
    // A core in a thinner layer, with a speck beside: the largest class is the core.
    let grid = Grid::with_spacing([40; 3], [1.0; 3]).unwrap();
    let from = |at: [usize; 3], middle: [f64; 3]| {
        (0..3).map(|a| (at[a] as f64 - middle[a]).powi(2)).sum::<f64>().sqrt()
    };
    let value = |i: usize| {
        let at = grid.index(i).0;
        let ball = |radius: f64, inside: f64| inside * (radius + 0.5 - from(at, [20.0; 3])).clamp(0.0, 1.0);
        let speck = 100.0 * (2.5 - from(at, [3.0; 3])).clamp(0.0, 1.0);
        (ball(15.0, 100.0) + ball(12.0, 120.0) + speck) as u8
    };
    let voxels: Vec<u8> = (0..grid.len()).map(value).collect();
    let volume = Volume::new(grid.clone(), Voxels::from(voxels)).unwrap();
    ivd_pipeline::export(&volume.into_artefact(), &file, &Exec::default()).unwrap();
    let open = |words: &[&str]| {
        let overrides: Vec<_> = words.iter().map(|word| word.parse().unwrap()).collect();
        let loaded = bare_scene(&file, &overrides).unwrap();
        let (cache, exec) = (ivd_artefact::Cache::disabled(), Exec::default());
        Subject::open(&loaded, true, &cache, &exec, &Tell::default()).unwrap()
    };
    let farthest = |subject: &Subject, pick: fn(f64, f64) -> f64| {
        let away = |v| (subject.lattice.world(v).0 - nalgebra::Vector3::repeat(20.0)).norm();
        (0..subject.lattice.keys().len()).map(away).reduce(pick).unwrap()
    };
    let body = open(&["segment.k=3"]);
    let [least, most] = [farthest(&body, f64::min), farthest(&body, f64::max)];
    assert!(least > 14.0 && most < 16.0, "its surface lies {least} to {most} from the middle");
    assert!(body.said[0].starts_with("the part: values of "), "{:?}", body.said);
    let said = open(&["segment.k=3", "boundary.class=densest"]);
    assert!(farthest(&said, f64::max) < 13.5, "what is said is taken");
    let maps =
        [&body, &open(&["segment.k=3", "map.method=octree"])].map(|subject| subject.settings.map.clone());
    assert!(matches!(maps, [MapChoice::Biharmonic(_), MapChoice::Octree(_)]), "{maps:?}");
    // The scene that is kept says it.
    let again = scene::parse(&body.scene_of(&body.settings).unwrap().to_text().unwrap(), &[]).unwrap();
    assert_eq!(again.param(&ivd_boundary::STAGE, "above"), body.scene.param(&ivd_boundary::STAGE, "above"));
}
