//! What is opened, shown meanwhile, told, recovered, and asked about.

use std::sync::Arc;

use egui_kittest::kittest::Queryable as _;
use ivd_frames::Source;

use super::common::{BALL, Here, scene};

fn folder() -> Arc<tempfile::TempDir> {
    Arc::new(tempfile::tempdir().unwrap())
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

#[test]
fn a_bare_scan_shows_slices_first_and_says_what_was_chosen() {
    let folder = folder();
    let artefact = {
        let ball = ivd_frames::Source { file: scene(folder.path(), BALL).file, ..Source::default() };
        let opened = ball.read().unwrap();
        let cache = ivd_artefact::Cache::disabled();
        let exec = ivd_core::Exec::default();
        let tell = ivd_frames::Tell::default();
        let subject = ivd_frames::Subject::open(&opened.loaded, false, &cache, &exec, &tell).unwrap();
        ivd_core::Artefact::Volume(subject.volume)
    };
    let file = folder.path().join("scan.nii.gz");
    ivd_pipeline::export(&artefact, &file, &ivd_core::Exec::default()).unwrap();
    let overrides = vec!["segment.k=3".parse().unwrap()];
    let mut here = Here::new(folder, Some(Source { file: Some(file), overrides, input: None }), None);
    here.settle();
    for chosen in ["chosen: the part", "chosen: the material", "chosen: level"] {
        assert!(here.has(chosen), "{chosen}");
    }
    let class = here.figures().classes.first().unwrap().clone();
    assert!(!class.hidden);
    here.press(&format!("Class {}", class.id));
    here.told("it is hidden", |told| told.classes[0].hidden && told.unsaved);
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
    here.until("why not", |here| here.has("This could not be written"));
    assert!(here.has("lattice.ply"));
}
