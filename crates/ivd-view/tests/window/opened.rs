//! What is opened, shown meanwhile, told, recovered, and asked about.

use std::path::Path;
use std::sync::Arc;

use egui::Key;
use egui_kittest::kittest::{NodeT as _, Queryable as _};
use ivd_artefact::Cache;
use ivd_core::{Artefact, Exec, Labels, Volume};
use ivd_frames::{Figures, ShownBy, Source, Subject, Tell};

use super::common::{BALL, Here, scene};
use super::keyboard::{chosen, tab_to, typed};
use super::names::assert_named;

fn folder() -> Arc<tempfile::TempDir> {
    Arc::new(tempfile::tempdir().unwrap())
}

/// The volume of the ball.
fn ball(folder: &Path) -> Volume {
    let opened = scene(folder, BALL).read().unwrap();
    let (cache, exec, tell) = (Cache::disabled(), Exec::default(), Tell::default());
    Subject::open(&opened.loaded, false, &cache, &exec, &tell).unwrap().volume
}

fn export(artefact: &Artefact, file: &Path) {
    ivd_pipeline::export(artefact, file, &Exec::default()).unwrap();
}

#[test]
fn what_cannot_be_opened_is_told_with_what_to_do() {
    let folder = folder();
    let source = scene(folder.path(), &BALL.replace("level = 1", "method = \"loop\""));
    let mut here = Here::new(folder, Some(source), None);
    here.until("why not", |here| here.has("This can't be opened"));
    assert!(here.has("`ivd pipeline` runs this scene"));
    here.press("All right");
    assert!(here.has("Drop a scan or a scene here"));
    let missing = here.folder.path().join("missing.nii");
    let mut here =
        Here::new(here.folder.clone(), Some(Source { file: Some(missing), ..Source::default() }), None);
    here.until("why not", |here| here.has("This can't be opened"));
    assert!(here.has("missing.nii"));
}

/// A NIfTI file of two frames, of which the second has half the values.
fn two_frames(volume: &Artefact, file: &Path) {
    export(volume, file);
    let mut bytes = std::fs::read(file).unwrap();
    // The number of axes, and how long the fourth is.
    for (at, value) in [(40, 4_i16), (48, 2)] {
        bytes[at..at + 2].copy_from_slice(&value.to_le_bytes());
    }
    let offset = f32::from_le_bytes(bytes[108..112].try_into().unwrap()) as usize;
    let second: Vec<u8> = bytes[offset..].iter().map(|byte| byte / 2).collect();
    bytes.extend(second);
    std::fs::write(file, bytes).unwrap();
}

#[test]
fn one_of_several_frames_is_asked_for_and_stays_chosen() {
    let folder = folder();
    let file = folder.path().join("scan.nii");
    two_frames(&Artefact::Volume(ball(folder.path())), &file);
    let overrides = vec!["lattice.iso=60".parse().unwrap()];
    let mut here = Here::new(folder, Some(Source { file: Some(file), overrides, ..Source::default() }), None);
    here.until("it is asked", |here| here.has("Which frame is to be opened?"));
    assert!(here.has("2 frames"), "why it is asked");
    tab_to(&mut here, "Frame, 0 to 1");
    typed(&mut here, "1");
    here.press("Open this frame");
    here.settle();
    let is_second = |told: &Figures| told.cross_value.is_some_and(|value| value > 0.0 && value <= 128.0);
    assert!(is_second(here.figures()), "{:?} where the first has about 255", here.figures().cross_value);
    chosen(&mut here, "Which surface was found");
    here.harness.run_ok();
    type_into(&mut here, "Value of the surface", "70");
    here.told("made again of the same frame", |told| told.made.iso == Some(70.0) && is_second(told));
}

#[test]
fn frames_of_another_file_are_not_offered_as_the_scans() {
    let folder = folder();
    let [scan, labels] = ["scan.nii", "labels.nii"].map(|name| folder.path().join(name));
    let volume = ball(folder.path());
    export(&Artefact::Volume(volume.clone()), &scan);
    two_frames(&Artefact::Volume(volume), &labels);
    let source = Source { file: Some(scan), labels: Some(labels), ..Source::default() };
    let mut here = Here::new(folder, Some(source), None);
    here.until("why not", |here| here.has("This can't be opened"));
    assert!(here.has("labels.nii: 2 frames"));
}

#[test]
fn a_bare_scan_shows_slices_first_and_says_what_was_chosen() {
    let folder = folder();
    let file = folder.path().join("scan.nii.gz");
    export(&Artefact::Volume(ball(folder.path())), &file);
    let overrides = vec!["segment.k=3".parse().unwrap()];
    let mut here = Here::new(folder, Some(Source { file: Some(file), overrides, ..Source::default() }), None);
    here.settle();
    for chosen in ["at opening: the part", "at opening: the material", "at opening: level"] {
        assert!(here.has(chosen), "{chosen}");
    }
    // Made otherwise before anything was done there is nothing to lose.
    chosen(&mut here, "Which surface was found");
    here.harness.run_ok();
    type_into(&mut here, "Smallest piece, mm³", "5");
    let told = here.told("without small pieces", |told| told.made.min_part == 5.0);
    assert!(!told.unsaved && told.made.is_body);
    here.settle();
    let class = here.figures().classes.first().unwrap().clone();
    assert!(!class.hidden);
    // By keyboard: what is tabbed to comes into sight.
    let name = format!("Class {}", class.id);
    chosen(&mut here, &name);
    assert!(here.is_in_sight(&name));
    here.told("it is hidden", |told| told.classes[0].hidden && told.unsaved);
    // Made again, it is still hidden.
    chosen(&mut here, "Part");
    here.harness.run_ok();
    here.press("the largest class");
    here.harness.run_ok();
    chosen(&mut here, "Make again");
    let told = here.told("of another part, and hidden", |told| {
        told.made.part.as_deref() == Some("largest") && told.classes[0].hidden
    });
    // Of a class's surface another value takes the place of classes: it is said before.
    assert!(!told.classes.is_empty() && !here.has("no classes are looked for"));
    tab_to(&mut here, "Value of the surface");
    here.harness.event(egui::Event::Text("140".to_owned()));
    here.harness.step();
    assert!(here.has("no classes are looked for"));
    assert!(here.has("pieces from 5 mm³ on"), "it is said what it was before");
    // And as it was before, with what is hidden.
    chosen(&mut here, "Make as before");
    here.told("of the first part, and hidden", |told| told.made.part.is_none() && told.classes[0].hidden);
    // Of all from a value on that is the value, and classes stay.
    tab_to(&mut here, "Value of the surface");
    typed(&mut here, "140");
    here.until("it is made", |here| here.harness.state().figures().is_none());
    // Meanwhile the list stays, out of use, with what was typed.
    let value = here.harness.get_by_label("Value of the surface");
    assert_eq!((value.value().as_deref(), value.accesskit_node().is_disabled()), (Some("140"), true));
    let is_so = |told: &Figures| told.made.between[0] == Some(140.0) && !told.made.is_body;
    here.told("another value", |told| is_so(told) && told.classes.first().is_some_and(|one| one.hidden));
}

#[test]
fn what_a_crash_leaves_is_gone_on_from() {
    let mut here = Here::ball();
    here.press("Handle where the slices meet");
    here.told("a handle", |told| told.handles.len() == 1);
    let folder = here.folder.clone();
    // As where the process ends: its log stays.
    drop(here);
    let file = Some(folder.path().join("scene.toml"));
    let mut here = Here::new(folder.clone(), Some(Source { file: file.clone(), ..Source::default() }), None);
    here.until("it is asked", |here| here.has("An earlier window ended"));
    here.press("Go on from there");
    let told = here.told("the handle", |told| told.handles.len() == 1);
    assert!(told.undo.is_some() && told.unsaved);
    drop(here);

    let mut here = Here::new(folder.clone(), Some(Source { file: file.clone(), ..Source::default() }), None);
    here.until("it is asked again", |here| here.has("An earlier window ended"));
    here.press("Begin anew");
    here.settle();
    assert!(here.figures().handles.is_empty());
    // Closed in order, nothing is left.
    here.press("File");
    here.press("Close");
    here.until("nothing is open", |here| here.has("Drop a scan or a scene here"));
    let mut here = Here::new(folder, Some(Source { file, ..Source::default() }), None);
    here.settle();
}

#[test]
fn what_a_crash_leaves_of_a_scan_with_labels_is_gone_on_from() {
    let folder = folder();
    // Apart from the log.
    let scans = folder.path().join("scans");
    std::fs::create_dir(&scans).unwrap();
    let volume = ball(folder.path());
    let ids: Vec<u16> =
        (0..volume.grid().len()).map(|voxel| volume.real(volume.voxels().get(voxel)) as u16 / 128).collect();
    let labels = Labels::new(volume.grid().clone(), ids.into(), Vec::new()).unwrap();
    let (file, organs) = (scans.join("scan.nii.gz"), scans.join("organs.nii.gz"));
    export(&Artefact::Volume(volume), &file);
    export(&Artefact::Labels(labels), &organs);
    let overrides = vec!["segment.k=3".parse().unwrap()];
    let alone = Source { file: Some(file), overrides, ..Source::default() };
    let text = "schema = 1\n[input]\nfile = \"scan.nii.gz\"\nlabels = \"organs.nii.gz\"\n[boundary]\nclass = 1\n\
        [refine]\nlevel = 1\n[output]\nimages = [\"before\"]\n";
    let source = scene(&scans, text);
    let mut here = Here::new(folder.clone(), Some(source.clone()), None);
    here.settle();
    here.press("Hide all classes");
    here.told("none is drawn", |told| told.classes.iter().all(|class| class.hidden));
    here.press("Show all classes");
    here.told("all are drawn", |told| told.classes.iter().all(|class| !class.hidden));
    here.press("Handle where the slices meet");
    let told = here.told("a handle", |told| told.handles.len() == 1);
    drop(here);
    let mut here = Here::new(folder.clone(), Some(source), None);
    here.until("it is asked", |here| here.has("An earlier window ended"));
    here.press("Go on from there");
    let again = here.told("the handle", |told| told.handles.len() == 1);
    drop(here);
    // Of a scan that is open labels can be opened, too.
    let mut here = Here::new(Arc::new(tempfile::tempdir().unwrap()), Some(alone), None);
    here.told("values", |told| told.shown_by == ShownBy::Values);
    here.press("File");
    here.press("Open labels of this scan …");
    type_into(&mut here, "Path", &organs.display().to_string());
    here.told("labels", |told| told.shown_by == ShownBy::Labels);
    assert_eq!((&again.handles[0].rest, &again.classes), (&told.handles[0].rest, &told.classes));
}

#[test]
fn what_would_be_lost_is_asked_about() {
    let mut here = Here::ball();
    here.press("Handle where the slices meet");
    here.told("a handle", |told| told.unsaved);
    here.press("File");
    here.press("Close");
    assert!(here.has("What was done here is not saved"));
    here.press("Cancel");
    assert_eq!(here.figures().handles.len(), 1);
    here.press("File");
    here.press("Close");
    here.press("Throw it away");
    assert!(here.has("Drop a scan or a scene here"));
}

/// Types something else into a field that is called so.
fn type_into(here: &mut Here, name: &str, text: &str) {
    tab_to(here, name);
    typed(here, text);
}

#[test]
fn what_is_made_again_otherwise_keeps_what_was_done_to_it() {
    let mut here = Here::ball();
    assert_eq!(here.figures().made.iso, Some(127.5));
    here.press("Handle where the slices meet");
    here.press("Pin where the slices meet");
    here.harness.key_press(Key::Num3);
    let was = here.told("a handle and a pin, from the left", |told| {
        told.pins.len() == 1 && told.unsaved && told.angles[0] != 0.0
    });
    let vertices = was.vertices;
    chosen(&mut here, "Which surface was found");
    here.harness.run_ok();
    assert_named(&here);
    type_into(&mut here, "Value of the surface", "140");
    let kept = |iso| move |told: &Figures| told.made.iso == Some(iso) && told.pins.len() == 1;
    let told = here.told("a smaller ball", kept(140.0));
    assert!(told.vertices < vertices && told.handles.len() == 1, "{} {vertices}", told.vertices);
    assert!(told.unsaved && told.undo.as_deref() == Some("pin") && told.missed.is_empty());
    // Seen as it was, and how far the handle has gone is told.
    assert_eq!(told.sight(), was.sight());
    here.settle();
    assert!(here.has("handles took other vertices, up to"));
    // Looking at it is no step.
    here.harness.key_press(Key::Num1);
    here.told("seen from in front", |told| told.angles[0] == 0.0);
    here.press("Undo");
    here.told("the larger ball", kept(127.5));
    here.settle();
    here.press("Redo");
    here.told("the smaller one once more", kept(140.0));
    here.settle();
    // Once something is done to it, that is the last step.
    here.press("Pin where the slices meet");
    here.told("a second pin", |told| told.pins.len() == 2);
    here.press("Undo");
    here.told("a pin less", |told| told.pins.len() == 1 && told.redo.is_some());
    here.press("Undo");
    here.told("a step less", |told| told.pins.is_empty() && told.redo.is_some());
    // What no scene takes is told, and nothing is lost.
    type_into(&mut here, "Value of the surface", "many");
    here.until("why not", |here| here.has("lattice.iso"));
    assert_eq!((here.figures().vertices, here.figures().handles.len()), (told.vertices, 1));

    // What went on from a log can be made again as well.
    let folder = here.folder.clone();
    drop(here);
    let source = Source { file: Some(folder.path().join("scene.toml")), ..Source::default() };
    let mut here = Here::new(folder.clone(), Some(source.clone()), None);
    here.until("it is asked", |here| here.has("An earlier window ended"));
    here.press("Go on from there");
    here.told("as it was made", |told| told.made.iso == Some(140.0) && told.redo.is_some());
    chosen(&mut here, "Which surface was found");
    here.harness.run_ok();
    type_into(&mut here, "Value of the surface", "110");
    here.told("a larger ball", |told| told.made.iso == Some(110.0) && told.handles.len() == 1);
    here.settle();
    let logs = std::fs::read_dir(folder.path().join("state")).unwrap().flatten();
    let logs = logs.filter(|file| file.file_name().to_string_lossy().ends_with(".jsonl"));
    assert_eq!(logs.count(), 1, "its own log, and none of those before");
}

#[test]
fn what_cannot_be_done_again_is_asked_about() {
    let folder = folder();
    let source = scene(folder.path(), &BALL.replace("size = 32", "size = 64"));
    let mut here = Here::new(folder, Some(source), None);
    here.settle();
    tab_to(&mut here, "Place of a new handle, at rest, mm");
    typed(&mut here, "32, 69, 32");
    here.told("a handle", |told| told.handles.len() == 1);
    chosen(&mut here, "Which surface was found");
    here.harness.run_ok();
    for (answer, handles, iso) in
        [("Go back to the previous surface", 1, 127.5), ("Keep the new surface", 0, 250.0)]
    {
        type_into(&mut here, "Value of the surface", "250");
        here.until("it is asked", |here| here.has("1 step can't be repeated"));
        assert!(here.has("ten voxel diagonals"));
        here.press(answer);
        let told = here.told("answered", |told| told.made.iso == Some(iso));
        assert_eq!(told.handles.len(), handles, "{answer}");
        here.settle();
    }
}

#[test]
fn what_cannot_be_made_so_is_told_and_all_is_as_it_was() {
    let folder = folder();
    let held = "[[deform.handle]]\npick = [16.0, 28.0, 16.0]\nmove = [0.0, -1.0, 0.5]\nradius = 9.0\n";
    let source = scene(folder.path(), &format!("{BALL}{held}"));
    let mut here = Here::new(folder, Some(source), None);
    here.settle();
    chosen(&mut here, "Which surface was found");
    here.harness.run_ok();
    type_into(&mut here, "Value of the surface", "120");
    here.told("another", |told| told.made.iso == Some(120.0) && told.handles.len() == 1);
    here.settle();
    // That is a step like any other, until something else is done.
    let command = egui::Modifiers::COMMAND;
    here.harness.key_press_modifiers(command, egui::Key::Z);
    here.told("as it was", |told| told.made.iso == Some(127.5) && told.handles.len() == 1);
    here.settle();
    here.harness.key_press_modifiers(command | egui::Modifiers::SHIFT, egui::Key::Z);
    here.told("the other once more", |told| told.made.iso == Some(120.0) && told.handles.len() == 1);
    here.settle();
    // Where nothing is cut there is nothing to hold.
    type_into(&mut here, "Value of the surface", "1e9");
    here.until("why not", |here| here.has("It can't be made so"));
    here.press("All right");
    here.settle();
    assert_eq!((here.figures().made.iso, here.figures().handles.len()), (Some(120.0), 1));
    // Nor is the one before it lost, and it is said which that is.
    assert!(here.has("Make as before") && here.has("value 127.5"));
    // What was done is there again too.
    here.press("Pin where the slices meet");
    here.told("a pin", |told| told.pins.len() == 1);
    type_into(&mut here, "Value of the surface", "1e9");
    here.until("why not", |here| here.has("It can't be made so"));
    here.press("All right");
    here.told("as it was", |told| told.pins.len() == 1 && told.undo.as_deref() == Some("pin"));
}

#[test]
fn what_cannot_be_written_is_told() {
    let mut here = Here::ball();
    here.press("File");
    here.press("Export lattice …");
    let nowhere = here.folder.path().join("no/such/folder/lattice.ply");
    let field = here.harness.get_by_label("Path");
    field.focus();
    field.set_text_value_accesskit(&nowhere.display().to_string());
    here.harness.step();
    here.press("Save");
    // What was typed is there still.
    here.until("why not", |here| here.has("There is no such folder"));
    assert_eq!(here.harness.get_by_label("Path").value().as_deref(), Some(&*nowhere.display().to_string()));
    let folder = here.folder.path().join("taken.ply");
    std::fs::create_dir(&folder).unwrap();
    let field = here.harness.get_by_label("Path");
    field.focus();
    field.set_text_value_accesskit(&folder.display().to_string());
    here.harness.step();
    here.press("Save");
    here.until("asked", |here| here.has("A file of this name is there already."));
    here.press("Replace");
    here.until("why not", |here| here.has("This could not be written"));
    assert!(here.has("taken.ply"));
}

#[test]
fn a_scene_says_what_is_made_of_it_and_that_nothing_was_chosen() {
    let here = Here::ball();
    for told in [
        "in this scene: the surface: where values are 127.5",
        "in this scene: the material",
        "in this scene: level 1",
    ] {
        assert!(here.has(told), "{told}");
    }
    assert!(!here.has("at opening: "));
}

#[test]
fn what_takes_long_is_told_by_what_it_is() {
    let folder = folder();
    let source = scene(folder.path(), BALL);
    let mut here = Here::telling(folder, source);
    here.settle();
    here.press("Cut where the slices meet");
    here.harness.run_ok();
    here.press("Cut along the sagittal slice");
    here.until("what is worked on", |here| here.has("cutting"));
    here.told("a cut", |told| told.incision.is_some());
    here.settle();
    assert!(!here.has("cutting"));
}
