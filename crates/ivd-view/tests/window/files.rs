//! Paths that the system's dialog asks for; here it is one that answers by itself.

use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex};
use std::time::Duration;

use egui::{Key, Modifiers};
use ivd_view::{Chooser, Kind, Wanted};

use super::common::{BALL, Here, scene};

/// What a dialog answers, and after how long.
type Answers = Arc<Mutex<Vec<(Duration, Option<PathBuf>)>>>;

/// A window where dialogs answer so, one after another; and what they were asked.
fn window(answers: &Answers) -> (Here, Arc<Mutex<Vec<Wanted>>>) {
    let asked = Arc::<Mutex<Vec<Wanted>>>::default();
    let (answers, heard) = (answers.clone(), asked.clone());
    let chooser = Chooser::new(move |wanted| {
        heard.lock().unwrap().push(wanted.clone());
        let (after, path) = answers.lock().unwrap().remove(0);
        Box::pin(async move {
            std::thread::sleep(after);
            path
        })
    });
    let folder = Arc::new(tempfile::tempdir().unwrap());
    (Here::with_chooser(folder, None, None, chooser), asked)
}

fn press(here: &mut Here, key: Key) {
    here.harness.key_press_modifiers(Modifiers::COMMAND, key);
    here.harness.step();
    here.harness.step();
}

#[test]
fn the_systems_dialog_opens_and_keeps() {
    let answers = Answers::default();
    let (mut here, asked) = window(&answers);
    let folder = here.folder.clone();
    let file = scene(folder.path(), BALL).file;
    let kept = folder.path().join("kept.toml");
    let soon = Duration::from_millis(20);
    answers.lock().unwrap().extend([(soon, file), (soon, Some(kept.clone()))]);
    press(&mut here, Key::O);
    here.settle();
    press(&mut here, Key::S);
    here.until("it is written", |_| kept.exists());
    let asked = asked.lock().unwrap();
    let kinds: Vec<_> = asked.iter().map(|wanted| (wanted.kind, &*wanted.title)).collect();
    assert_eq!(kinds, [(Kind::File, "Open"), (Kind::New, "Save scene")]);
    assert_eq!(asked[1].at.file_name(), Some(Path::new("scene.toml").as_os_str()));
}

#[test]
fn a_path_that_is_typed_takes_the_place_of_the_one_that_is_offered() {
    let mut here = Here::ball();
    let kept = here.folder.path().join("kept.toml");
    press(&mut here, Key::S);
    here.until("a path is asked for", |here| here.has("Save scene"));
    here.harness.step();
    here.harness.event(egui::Event::Text(kept.display().to_string()));
    here.harness.step();
    here.harness.key_press(Key::Enter);
    here.until("it is written", |_| kept.exists());
}

#[test]
fn without_a_dialog_a_path_is_typed_and_one_that_is_given_up_is_asked_no_more() {
    let answers = Answers::default();
    let (mut here, _) = window(&answers);
    // None at once: there was no dialog.
    answers.lock().unwrap().push((Duration::ZERO, None));
    press(&mut here, Key::O);
    here.until("it is typed", |here| here.has("the word demo"));
    here.press("Cancel");
    // Later: it was given up.
    answers.lock().unwrap().push((Duration::from_millis(600), None));
    press(&mut here, Key::O);
    std::thread::sleep(Duration::from_millis(700));
    here.harness.step();
    here.harness.step();
    assert!(!here.has("the word demo") && here.has("Drop a scan or a scene here"));
    // One that hangs: asked again, a path is typed.
    answers.lock().unwrap().push((Duration::from_secs(3), None));
    press(&mut here, Key::O);
    assert!(!here.has("the word demo"));
    press(&mut here, Key::O);
    assert!(here.has("the word demo"));
}
