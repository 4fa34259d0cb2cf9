//! Scenes with labels of other programs: pictures go by these, as those of pipelines do.

use std::path::Path;
use std::sync::{Arc, Mutex};

use ivd_artefact::Cache;
use ivd_core::{Artefact, Class, Exec, Grid, Image, Labels, Volume, Voxels};
use ivd_frames::{
    Entry, Lies, Log, Model, Opened, Pane, Request, Saved, ShownBy, Shows, Source, Subject, Tell, bare_scene,
};
use ivd_render::Side;

use super::common::{loaded, patient};

/// Voxels along an edge.
const SIZE: usize = 32;
/// Where three balls lie, left to right of one who faces the front; the last has no label.
const BALLS: [[f64; 3]; 3] = [[7.0, 16.0, 16.0], [16.0, 16.0, 16.0], [25.0, 16.0, 16.0]];
const RADIUS: f64 = 4.0;

const SCENE: &str = "schema = 1\n[input]\nfile = \"Doe^John.nii.gz\"\nlabels = \"Doe^John organs.nii.gz\"\n\
    [boundary]\nclass = 2\n[render]\nview = \"front\"\nannotate = false\nfit = \"volume\"\n[output]\nimages = [\"before\"]\n";

/// Three balls of values that fall outwards, and labels 1 and 2 of two of them.
fn begin(at: &Path) {
    let grid = Grid::with_spacing([SIZE; 3], [1.0; 3]).unwrap();
    let depth = |voxel: usize, ball: &[f64; 3]| {
        let at = [voxel % SIZE, voxel / SIZE % SIZE, voxel / SIZE / SIZE].map(|c| c as f64);
        RADIUS - (0..3).map(|a| (at[a] - ball[a]).powi(2)).sum::<f64>().sqrt()
    };
    let depths = |voxel: usize| BALLS.map(|ball| depth(voxel, &ball));
    let value = |voxel: usize| {
        let deepest = depths(voxel).into_iter().fold(f64::MIN, f64::max);
        (100.0 + 50.0 * deepest).clamp(0.0, 200.0) as u8
    };
    let label =
        |voxel: usize| (0..2).find(|&ball| depths(voxel)[ball] > 0.0).map_or(0, |ball| ball as u16 + 1);
    let voxels: Vec<u8> = (0..grid.len()).map(value).collect();
    let ids: Vec<u16> = (0..grid.len()).map(label).collect();
    let volume = Volume::new(grid.clone(), Voxels::from(voxels)).unwrap();
    let labels = Labels::new(grid, ids.into(), Vec::<Class>::new()).unwrap();
    let write = |artefact: Artefact, name: &str| {
        ivd_pipeline::export(&artefact, &at.join(name), &Exec::default()).unwrap();
    };
    write(Artefact::Volume(volume), "Doe^John.nii.gz");
    write(Artefact::Labels(labels), "Doe^John organs.nii.gz");
}

fn opened(at: &Path, text: &str) -> Model {
    let mut loaded = loaded(text);
    at.clone_into(&mut loaded.folder);
    let exec = Exec::default();
    let subject = Subject::open(&loaded, false, &Cache::disabled(), &exec, &Tell::default()).unwrap();
    patient(subject, exec)
}

fn drawn(model: &Model) -> Image {
    model.draw(Pane::Volume, 1, &Exec::default()).unwrap()
}

/// Of the volume's picture in three columns, the share of pixels that show something.
fn seen(model: &Model) -> [f64; 3] {
    let image = drawn(model);
    let (width, height) = (image.width(), image.height());
    let empty = &image.rgba()[..3];
    std::array::from_fn(|third| {
        let columns = width * third / 3..width * (third + 1) / 3;
        let pixels =
            (0..height).flat_map(|row| columns.clone().map(move |column| 4 * (row * width + column)));
        let count = pixels.filter(|at| image.rgba()[*at..*at + 3] != *empty).count();
        count as f64 / (height * columns.len()) as f64
    })
}

#[test]
fn pictures_go_by_labels_that_a_person_gave_and_follow_what_is_done() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    begin(at);
    let mut model = opened(at, SCENE);
    // The patient's right is to the left.
    let [unlabelled, moving, other] = seen(&model);
    assert!(unlabelled == 0.0 && moving > 0.05 && other > 0.01, "{:?}", [unlabelled, moving, other]);
    let first = drawn(&model);
    assert_eq!(model.figures().classes.iter().map(|class| class.id).collect::<Vec<_>>(), [1, 2]);

    // Without labels every ball is seen; the surface is one of values then.
    let by_values = SCENE.replace("labels = \"Doe^John organs.nii.gz\"\n", "");
    let by_values = opened(at, &by_values.replace("[boundary]\nclass = 2\n", "[lattice]\niso = 100.0\n"));
    assert!(seen(&by_values).iter().all(|share| *share > 0.01));
    let all = opened(at, &SCENE.replace("annotate = false", "annotate = false\nunlabelled = true"));
    assert!(
        seen(&all).iter().all(|share| *share > 0.01),
        "what has no label is seen where that is asked for"
    );

    // A part that is pulled is seen where it is.
    model.follow(&Request::Radius { handle: None, radius: 6.0 }).unwrap();
    model.follow(&Request::Add { place: [16.0, 16.0, 20.0], by: [0.0, 0.0, 2.0] }).unwrap();
    assert_eq!(model.figures().refused, None);
    assert!(seen(&model)[1] > 1.05 * moving && seen(&model)[2] == other, "{:?}", seen(&model));
    let pulled = drawn(&model);
    model.follow(&Request::Undo).unwrap();
    assert_eq!(drawn(&model), first);
    model.follow(&Request::Redo).unwrap();
    assert_eq!(drawn(&model), pulled);

    // Another part is seen and doesn't move: it is told which does.
    model.follow(&Request::Add { place: [7.0, 16.0, 16.0], by: [0.0; 3] }).unwrap();
    let told = model.figures().refused.unwrap().why;
    assert!(told.contains("class 1 lies there, and the part that moves is class 2"), "{told}");

    // A plane takes the half that it takes, of the body as it is and at rest.
    model.follow(&Request::Clip { point: [16.0; 3], normal: [1.0, 0.0, 0.0] }).unwrap();
    let kept = |model: &Model| seen(model).map(|share| share > 0.0);
    let now = seen(&model);
    assert!(now[2] == 0.0 && now[1] > 0.0 && now[1] < 0.8 * moving, "{now:?}");
    model.follow(&Request::Compare { shows: Shows::Rest, at: 0.5 }).unwrap();
    assert_eq!(kept(&model), [false, true, false]);
    model.follow(&Request::Compare { shows: Shows::Now, at: 0.5 }).unwrap();
    model.follow(&Request::Undo).unwrap();
    assert_eq!(drawn(&model), pulled);

    // A class that is hidden is clear, whatever its values are.
    let hide = |class| Request::Class { class, hidden: true, opacity: None, colour: None };
    model.follow(&hide(1)).unwrap();
    assert_eq!(kept(&model), [false, true, false]);
    model.follow(&hide(2)).unwrap();
    assert_eq!(kept(&model), [false; 3]);
    model.follow(&Request::AllClasses { hidden: false }).unwrap();
    assert_eq!(kept(&model), [false, true, true]);
    model.follow(&Request::AllClasses { hidden: true }).unwrap();
    assert_eq!(kept(&model), [false; 3]);
    assert_eq!(model.figures().undo.as_deref(), Some("hide all classes"));
    // Nothing of it can be taken hold of in the picture.
    assert!(model.follow(&Request::Grab { pane: Pane::Volume, at: [0.5; 2] }).is_err());
}

/// What was come to step by step looks as what the scene of it begins with.
fn assert_as_reopened(model: &Model, at: &Path, after: &str) {
    let kept = model.save(Saved::Scene, String::new(), &Exec::default()).unwrap();
    let named = kept.naming(|file| file.strip_prefix(at).unwrap().to_owned()).unwrap();
    let again = opened(at, &String::from_utf8(named.bytes).unwrap());
    assert!(drawn(&again) == drawn(model), "after {after}");
}

#[test]
fn labels_follow_whatever_is_done_to_the_body_also_where_it_is_done_again() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    begin(at);
    let entries = Arc::<Mutex<Vec<Entry>>>::default();
    let mut model = opened(at, SCENE);
    let kept = entries.clone();
    model.session_mut().record(move |entry| kept.lock().unwrap().push(entry.clone()));
    for request in [
        Request::Radius { handle: None, radius: 6.0 },
        Request::Add { place: [16.0, 16.0, 20.0], by: [0.0, 0.0, 2.0] },
        Request::Clip { point: [16.0, 16.0, 18.0], normal: [0.0, 0.0, -1.0] },
        Request::Move { handle: 0, by: [0.0, 0.5, 1.0] },
        Request::ClipIn { space: Lies::Rest },
        Request::Move { handle: 0, by: [0.0, 0.0, 2.5] },
        Request::Level { level: 1 },
        Request::Undo,
        Request::Undo,
        Request::Redo,
        Request::ClipBox { min: [10.0; 3], max: [30.0; 3] },
        Request::Unclip { clip: 0 },
        Request::Grab { pane: Pane::Axial, at: [0.5; 2] },
        Request::Drag { to: [0.5, 0.45], lock: None },
        Request::Abandon,
        Request::Unclip { clip: 1 },
    ] {
        model.follow(&request).unwrap();
        assert_eq!(model.figures().refused, None, "{request:?}");
        if !model.session().in_gesture() {
            assert_as_reopened(&model, at, &format!("{request:?}"));
        }
    }
    model.follow(&Request::Clip { point: [16.0; 3], normal: [1.0, 0.0, 0.0] }).unwrap();
    let entries = entries.lock().unwrap().clone();
    let mut again = opened(at, SCENE);
    again.replay(&entries).unwrap();
    assert!(drawn(&again) == drawn(&model));
}

#[test]
fn what_is_kept_names_labels_where_it_may_and_else_nothing() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    begin(at);
    let mut model = opened(at, SCENE);
    model.follow(&Request::Radius { handle: None, radius: 6.0 }).unwrap();
    model.follow(&Request::Add { place: [16.0, 16.0, 20.0], by: [0.0, 0.0, 2.0] }).unwrap();
    model.follow(&Request::Look { side: Side::Left }).unwrap();
    model.follow(&Request::Cross { pane: Pane::Axial, at: [0.33, 0.41] }).unwrap();
    let kept = model.save(Saved::Scene, String::new(), &Exec::default()).unwrap();
    let text = String::from_utf8(kept.bytes.clone()).unwrap();
    assert!(text.contains("\"scan.nii.gz\"") && text.contains("\"labels.nii.gz\""), "{text}");
    assert!(!text.contains("Doe"), "{text}");
    let named = kept.naming(|file| file.strip_prefix(at).unwrap().to_owned()).unwrap();
    let again = opened(at, &String::from_utf8(named.bytes).unwrap());
    assert_eq!(again.session().displacement(), model.session().displacement());
    assert_eq!(drawn(&again), drawn(&model));
    let mut again = again;
    let (is, was) = (again.figures().cross, model.figures().cross);
    assert!((0..3).all(|a| (is[a] - was[a]).abs() < 1e-9), "{is:?}, {was:?}");

    // Labels are written as they are shown.
    let labels = model.save(Saved::Labels, String::new(), &Exec::default()).unwrap();
    std::fs::write(at.join(labels.name), &labels.bytes).unwrap();
    let beside = SCENE.replace("Doe^John organs.nii.gz", labels.name);
    let read = opened(at, &beside).subject().labels.clone().unwrap();
    assert!(Some(read.ids()) == model.session().shown_labels().map(Labels::ids));
    assert!(read.ids() != model.subject().labels.as_ref().unwrap().ids());
    let by_values = SCENE.replace("labels = \"Doe^John organs.nii.gz\"\n", "");
    let by_values = opened(at, &by_values.replace("[boundary]\nclass = 2\n", "[lattice]\niso = 100.0\n"));
    assert!(by_values.save(Saved::Labels, String::new(), &Exec::default()).is_err());
    let log = model.save(Saved::Log, format!("{}\n\"undo\"\n", Log::head(&text)), &Exec::default()).unwrap();
    let named = log.naming(|file| Path::new("..").join(file.file_name().unwrap())).unwrap();
    let log: Log = String::from_utf8(named.bytes).unwrap().parse().unwrap();
    assert!(log.scene.contains("\"../Doe^John organs.nii.gz\"") && log.entries.len() == 1, "{}", log.scene);
    // Read by somebody who has put the files beside it.
    for (name, beside) in [("Doe^John.nii.gz", "scan.nii.gz"), ("Doe^John organs.nii.gz", "labels.nii.gz")] {
        std::fs::rename(at.join(name), at.join(beside)).unwrap();
    }
    assert_eq!(drawn(&opened(at, &text)), drawn(&model));
}

#[test]
fn labels_are_given_to_a_scan_alone_too() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    begin(at);
    let words = ["input.labels=Doe^John organs.nii.gz", "boundary.class=1", "render.annotate=false"];
    let overrides: Vec<_> = words.iter().map(|word| word.parse().unwrap()).collect();
    let subject = |overrides| {
        let loaded = bare_scene(&at.join("Doe^John.nii.gz"), overrides).unwrap();
        let exec = Exec::default();
        Subject::open(&loaded, true, &Cache::disabled(), &exec, &Tell::default()).unwrap()
    };
    let of_class = subject(&overrides);
    assert!(
        of_class.shown_by == ShownBy::Labels && of_class.said[0].contains("class 1"),
        "{:?}",
        of_class.said
    );
    // Which of them moves may be left open, but not which parts there are.
    let of_any = subject(&overrides[..1]);
    assert!(of_any.shown_by == ShownBy::Labels && of_any.made.class.is_some() && !of_any.made.is_body);

    // By a word of its own, whatever would find parts otherwise; what is saved of it can be read.
    let source = |overrides: &[&str]| Source {
        file: Some(at.join("Doe^John.nii.gz")),
        labels: Some(at.join("Doe^John organs.nii.gz")),
        overrides: overrides.iter().map(|word| word.parse().unwrap()).collect(),
        ..Source::default()
    };
    let open = |source: Source| {
        let exec = Exec::default();
        let Opened { loaded, is_bare, .. } = source.read().unwrap();
        Subject::open(&loaded, is_bare, &Cache::disabled(), &exec, &Tell::default()).unwrap()
    };
    let subject = open(source(&["segment.k=3", "boundary.class=2"]));
    assert_eq!(subject.shown_by, ShownBy::Labels);
    let model = patient(subject, Exec::default());
    let kept = model.save(Saved::Scene, String::new(), &Exec::default()).unwrap();
    let named = kept.naming(|file| file.strip_prefix(at).unwrap().to_owned()).unwrap();
    let again = opened(at, &String::from_utf8(named.bytes).unwrap());
    assert!(drawn(&again) == drawn(&model));
    // A surface of values shows none of them, and says so.
    let by_value = open(source(&["lattice.iso=100"]));
    assert_eq!(by_value.shown_by, ShownBy::Values);
    assert!(by_value.notes().any(|note| note.contains("its labels aren't shown")));
}
