//! What the volume's pane shows, recorded.

use std::path::Path;

use egui::{Key, Modifiers, ViewportEvent, ViewportId};
use egui_kittest::kittest::Queryable as _;

use super::common::Here;
use super::keyboard::{tab_to, typed};

/// How long each picture of an animated PNG is shown (s/100).
fn shown(file: &Path) -> Vec<u16> {
    let bytes = std::fs::read(file).unwrap();
    let number = |at: usize| u16::from_be_bytes([bytes[at], bytes[at + 1]]);
    let chunks = (0..bytes.len() - 30).filter(|at| &bytes[*at..at + 4] == b"fcTL");
    // Behind the name: number, width, height, place; then the time and what it is divided by.
    chunks.map(|at| at + 24).inspect(|at| assert_eq!(number(at + 2), 100)).map(number).collect()
}

fn item(here: &mut Here, name: &str) {
    here.press("File");
    here.harness.run_ok();
    // Behind its words stands the key.
    here.harness.get_by_label_contains(name).click();
    here.harness.run_ok();
}

fn keep(here: &mut Here, path: &Path) {
    tab_to(here, "Path");
    typed(here, &path.display().to_string());
}

#[test]
fn a_turn_is_recorded_and_kept_where_one_says_and_not_before() {
    let mut here = Here::ball();
    let folder = here.folder.clone();
    let files = || std::fs::read_dir(folder.path()).unwrap().count();
    let before = files();
    item(&mut here, "Record the volume's picture");
    for key in [Key::Num3, Key::Num7, Key::Num1] {
        let version = here.figures().angles;
        here.harness.key_press(key);
        here.told("seen from elsewhere", |told| told.angles != version);
        here.settle();
    }
    here.until("it says so", |here| here.has("recording: "));
    item(&mut here, "Stop recording …");
    assert!(here.has("Save the recording"));
    here.press("Cancel");
    here.until("it is there still", |here| here.has("pictures, not kept"));
    assert_eq!(files(), before, "nothing is written yet");
    // What can't be written is not lost.
    for (wrong, why, away) in [
        ("turn.jpg", "This could not be written", "All right"),
        ("no such folder/turn.gif", "There is no such folder", "Cancel"),
    ] {
        item(&mut here, "Keep the recording …");
        keep(&mut here, &folder.path().join(wrong));
        here.until("why not", |here| here.has(why));
        here.press(away);
        here.until("it is there still", |here| here.has("pictures, not kept"));
    }
    let kept = folder.path().join("turn.png");
    here.harness.key_press_modifiers(Modifiers::COMMAND, Key::R);
    here.harness.step();
    here.harness.step();
    keep(&mut here, &kept);
    here.until("it is written", |here| here.has(&format!("written: {}", kept.display())));
    let times = shown(&kept);
    // A whole picture from each side at least, each seen for a while.
    assert!(times.len() >= 4 && times.iter().all(|time| (2..=200).contains(time)), "{times:?}");
    here.until("it is kept", |here| !here.has("not kept"));
    // Another, as a GIF.
    let kept = folder.path().join("turn.gif");
    here.harness.key_press_modifiers(Modifiers::COMMAND, Key::R);
    here.until("another", |here| here.has("recording: 1 picture"));
    here.harness.key_press_modifiers(Modifiers::COMMAND, Key::R);
    here.harness.step();
    here.harness.step();
    keep(&mut here, &kept);
    here.until("it is written", |_| kept.exists());
    assert!(std::fs::read(&kept).unwrap().starts_with(b"GIF89a"));
    assert!(here.figures().undo.is_none());
}

#[test]
fn a_recording_that_would_be_lost_is_asked_about() {
    let mut here = Here::ball();
    here.harness.key_press_modifiers(Modifiers::COMMAND, Key::R);
    here.until("it records", |here| here.has("recording: "));
    let quit = |here: &mut Here| {
        let viewport = here.harness.input_mut().viewports.entry(ViewportId::ROOT).or_default();
        viewport.events.push(ViewportEvent::Close);
        here.harness.step();
        // Asked for once.
        let viewport = here.harness.input_mut().viewports.entry(ViewportId::ROOT).or_default();
        viewport.events.clear();
        here.harness.step();
    };
    quit(&mut here);
    here.until("a question", |here| here.has("What was recorded is not kept"));
    here.harness.run_ok();
    here.press("Keep the recording …");
    here.until("where", |here| here.has("Save the recording"));
    here.harness.run_ok();
    here.press("Cancel");
    item(&mut here, "Throw the recording away");
    quit(&mut here);
    assert!(!here.has("What was recorded is not kept"));
}
