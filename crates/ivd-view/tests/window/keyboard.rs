//! By keyboard alone: open, take a handle from the list, move it, undo, export.

use std::path::Path;

use egui::{Event, Key, Modifiers};
use egui_kittest::kittest::Queryable as _;
use ivd_frames::{Figures, Source};

use super::common::{BALL, Here, scene};

/// Goes to a part of the window by the key that does so, however long that takes.
pub(crate) fn tab_to(here: &mut Here, name: &str) {
    for _ in 0..200 {
        if here.harness.query_by_label(name).is_some_and(|node| node.is_focused()) {
            return;
        }
        here.harness.key_press(Key::Tab);
        here.harness.step();
    }
    panic!("{name} is never reached by Tab");
}

/// Goes to a button, which may have to be scrolled to, and presses it.
pub(crate) fn chosen(here: &mut Here, name: &str) {
    tab_to(here, name);
    here.harness.key_press(Key::Enter);
    here.harness.step();
    here.harness.step();
}

pub(crate) fn typed(here: &mut Here, text: &str) {
    here.harness.key_press_modifiers(Modifiers::COMMAND, Key::A);
    here.harness.event(Event::Text(text.to_owned()));
    here.harness.step();
    here.harness.key_press(Key::Enter);
    here.harness.step();
}

/// With a shortcut that asks for a path.
fn path_typed(here: &mut Here, key: Key, path: &Path) {
    here.harness.key_press_modifiers(Modifiers::COMMAND, key);
    here.harness.step();
    here.harness.step();
    tab_to(here, "Path");
    typed(here, &path.display().to_string());
}

#[test]
fn a_session_needs_no_pointer() {
    let folder = std::sync::Arc::new(tempfile::tempdir().unwrap());
    let source = scene(folder.path(), BALL);
    let mut here = Here::new(folder, None, None);
    here.harness.step();
    path_typed(&mut here, Key::O, &source.file.unwrap());
    here.settle();

    tab_to(&mut here, "Place of a new handle, at rest, mm");
    typed(&mut here, "16, 28, 16");
    let told = here.told("a handle more", |told| told.handles.len() == 1);
    let name = format!("Handle {}: y, mm from rest", told.handles[0].id);
    tab_to(&mut here, &name);
    typed(&mut here, "-1.5");
    let told = here.told("it is moved", |told| told.handles[0].by == Some([0.0, -1.5, 0.0]));
    assert!((told.largest_mm - 1.5).abs() < 0.2 && told.undo.as_deref() == Some("move a handle"), "{told:?}");

    tab_to(&mut here, "Handle 0: radius, mm");
    typed(&mut here, "6");
    here.told("it reaches further", |told| told.handles[0].radius == 6.0);

    // Out of the field first: there the keys are its own.
    here.harness.key_press(Key::Escape);
    here.harness.step();
    here.harness.key_press_modifiers(Modifiers::COMMAND, Key::Z);
    here.told("it is undone", |told| told.handles[0].radius != 6.0);
    here.harness.key_press_modifiers(Modifiers::COMMAND.plus(Modifiers::SHIFT), Key::Z);
    here.told("and done again", |told| told.handles[0].radius == 6.0);

    // A picture shows other slices by arrows.
    tab_to(&mut here, "Axial slice");
    let slice = here.figures().slices[0].slice;
    here.harness.key_press(Key::ArrowUp);
    here.told("another slice", |told| told.slices[0].slice == slice + 1);

    let kept = here.folder.path().join("kept.toml");
    path_typed(&mut here, Key::S, &kept);
    here.until("it is written", |_| kept.exists());
    let told = here.told("nothing would be lost", |told| !told.unsaved);

    let exported = here.folder.path().join("deformed.nii.gz");
    path_typed(&mut here, Key::E, &exported);
    here.until("the volume is written", |_| exported.exists());
    // What was kept is what was shown.
    let mut again =
        Here::new(here.folder.clone(), Some(Source { file: Some(kept), ..Source::default() }), None);
    again.settle();
    let place =
        |told: &Figures| told.handles.iter().map(|one| (one.rest, one.by, one.radius)).collect::<Vec<_>>();
    assert_eq!(place(again.figures()), place(&told));
}

#[test]
fn a_press_is_typed_as_how_far_it_goes_in_and_a_key_removes_it() {
    let mut here = Here::ball();
    tab_to(&mut here, "Place of a new handle, at rest, mm");
    typed(&mut here, "16, 28, 16");
    here.told("a handle", |told| told.handles.len() == 1);
    tab_to(&mut here, "Handle 0: into the surface, mm");
    here.harness.step();
    assert!(here.is_in_sight("Handle 0: into the surface, mm"));
    typed(&mut here, "in 1.5");
    let told = here.told("it goes in", |told| told.handles[0].by.is_some_and(|by| by[1] < -1.4));
    let (by, out) = (told.handles[0].by.unwrap(), told.handles[0].out.unwrap());
    let along: f64 = (0..3).map(|a| by[a] * out[a]).sum();
    assert!((along + 1.5).abs() < 1e-9 && by.iter().all(|c| c.abs() <= 1.5), "{by:?}");
    here.harness.step();
    assert!(here.has("1.5 mm in"), "which way it goes is told");
    // What it goes aside stays, and so does what has more digits than are written, where the keys pass by.
    tab_to(&mut here, "Handle 0: x, mm from rest");
    typed(&mut here, "0.46");
    let aside = here.told("aside", |told| told.handles[0].by.is_some_and(|by| by[0] == 0.46));
    here.harness.key_press(Key::Escape);
    here.harness.step();
    tab_to(&mut here, "Pin where the slices meet");
    tab_to(&mut here, "Handle 0: into the surface, mm");
    here.harness.key_press(Key::Tab);
    here.harness.step();
    here.settle();
    assert_eq!(here.figures().handles[0].by, aside.handles[0].by);
    tab_to(&mut here, "Handle 0: into the surface, mm");
    typed(&mut here, "1");
    let less = here.told("less far in", |told| told.handles[0].by.is_some_and(|by| by[1] > -1.1));
    assert!((less.handles[0].by.unwrap()[0] - 0.46).abs() < 0.1, "{less:?}");
    here.harness.key_press(Key::Escape);
    here.harness.step();
    for _ in 0..2 {
        let undo = here.figures().undo.clone();
        here.harness.key_press_modifiers(Modifiers::COMMAND, Key::Z);
        here.told("undone", |told| told.redo == undo);
        here.settle();
    }
    // A step back is named.
    here.harness.key_press(Key::Escape);
    here.harness.step();
    here.harness.key_press_modifiers(Modifiers::COMMAND, Key::Z);
    here.told("it is undone", |told| told.handles[0].by == Some([0.0; 3]));
    here.harness.step();
    assert!(here.has("Undone: move a handle"));
    tab_to(&mut here, "Go to handle 0");
    here.harness.key_press(Key::Delete);
    here.told("it is gone", |told| told.handles.is_empty());
}

#[test]
fn a_key_leads_to_the_handles_and_undo_goes_past_a_field_that_nothing_was_typed_into() {
    let mut here = Here::ball();
    let has_keys =
        |here: &Here, name: &str| here.harness.query_by_label(name).is_some_and(|node| node.is_focused());
    let to_handles = |here: &mut Here| {
        here.harness.key_press(Key::Escape);
        here.harness.step();
        here.harness.key_press(Key::F6);
        here.harness.step();
        here.harness.step();
    };
    here.harness.key_press(Key::F10);
    here.harness.step();
    here.harness.step();
    assert!(has_keys(&here, "File"));
    to_handles(&mut here);
    assert!(has_keys(&here, "Place of a new handle, at rest, mm"));
    typed(&mut here, "16, 28, 16");
    here.told("a handle", |told| told.handles.len() == 1);
    here.settle();
    // What is typed next takes the place of what stands there; given up, all is as it was.
    let into = "Handle 0: into the surface, mm";
    assert!(has_keys(&here, into));
    let type_two = |here: &mut Here, key| {
        here.harness.event(egui::Event::Text("2".to_owned()));
        here.harness.step();
        here.harness.key_press(key);
        here.harness.step();
        here.harness.step();
    };
    type_two(&mut here, Key::Enter);
    here.told("it goes in", |told| told.handles[0].by.is_some_and(|by| (by[1] + 2.0).abs() < 0.1));
    here.press("Undo");
    here.told("not yet", |told| told.handles[0].by == Some([0.0; 3]));
    here.settle();
    tab_to(&mut here, into);
    type_two(&mut here, Key::Escape);
    here.settle();
    assert_eq!(here.figures().undo.as_deref(), Some("add a handle"));
    to_handles(&mut here);
    assert!(has_keys(&here, "Go to handle 0"));
    tab_to(&mut here, "Handle 0: into the surface, mm");
    typed(&mut here, "1.5");
    here.told("it goes in", |told| told.handles[0].by.is_some_and(|by| by[1] < -1.4));
    here.settle();
    here.harness.key_press(Key::Escape);
    here.harness.step();
    tab_to(&mut here, "Handle 0: into the surface, mm");
    here.harness.step();
    here.harness.key_press_modifiers(Modifiers::COMMAND, Key::Z);
    here.told("it is undone", |told| told.handles[0].by == Some([0.0; 3]));
    here.settle();
    // What is typed is the field's own to take back.
    here.harness.key_press(Key::Escape);
    here.harness.step();
    tab_to(&mut here, "Handle 0: into the surface, mm");
    here.harness.key_press_modifiers(Modifiers::COMMAND, Key::A);
    here.harness.event(Event::Text("7".to_owned()));
    here.harness.step();
    here.harness.key_press_modifiers(Modifiers::COMMAND, Key::Z);
    here.harness.step();
    here.settle();
    assert_eq!(here.figures().handles.len(), 1, "nothing else is undone");
    assert_eq!(here.figures().redo.as_deref(), Some("move a handle"));
}

#[test]
fn numbers_with_more_digits_than_are_written_stay_as_they_are_where_keys_pass_by() {
    let mut here = Here::ball();
    tab_to(&mut here, "Place of a new handle, at rest, mm");
    typed(&mut here, "16, 28, 16");
    here.told("a handle", |told| told.handles.len() == 1);
    tab_to(&mut here, "Handle 0: radius, mm");
    typed(&mut here, "5.0437");
    here.told("a radius", |told| told.handles[0].radius == 5.0437);
    here.settle();
    // What is typed counts, however little it is.
    here.harness.key_press(Key::Escape);
    here.harness.step();
    tab_to(&mut here, "Handle 0: radius, mm");
    typed(&mut here, "5.04");
    here.told("a radius", |told| told.handles[0].radius == 5.04);
    here.settle();
    let before = here.figures().clone();
    here.harness.key_press(Key::Escape);
    // Once round all of the window, and past the field again.
    for _ in 0..2 {
        tab_to(&mut here, "Handle 0: radius, mm");
        here.harness.key_press(Key::Tab);
        here.harness.step();
    }
    here.settle();
    let after = here.figures();
    assert_eq!((&after.handles, &after.undo), (&before.handles, &before.undo));
}

#[test]
fn each_handle_that_is_typed_has_the_keys_once_it_is_there() {
    let mut here = Here::ball();
    for (n, place) in ["16, 28, 16", "16, 4, 16"].into_iter().enumerate() {
        tab_to(&mut here, "Place of a new handle, at rest, mm");
        typed(&mut here, place);
        here.told("a handle", |told| told.handles.len() == n + 1);
        here.harness.step();
        here.harness.step();
        typed(&mut here, &format!("{}", 1.0 + n as f64));
        let into = |told: &Figures, n: usize| {
            let one = &told.handles[n];
            one.by.zip(one.out).map(|(by, out)| -(0..3).map(|a| by[a] * out[a]).sum::<f64>())
        };
        let told = here.told("it goes in", |told| into(told, n).is_some_and(|mm| mm > 0.5));
        for m in 0..=n {
            assert!((into(&told, m).unwrap() - (1.0 + m as f64)).abs() < 1e-9, "{n}, {m}");
        }
        here.harness.key_press(Key::Escape);
        here.harness.step();
    }
}

#[test]
fn the_list_of_keys_comes_by_a_key_and_goes_by_one() {
    let mut here = Here::ball();
    here.harness.key_press(Key::Questionmark);
    here.until("the list", |here| here.has("Mouse and keyboard"));
    for (keys, _) in ivd_frames::KEYS {
        assert!(here.has(keys), "{keys}");
    }
    here.harness.key_press(Key::Escape);
    here.until("the pictures", |here| !here.has("Mouse and keyboard"));
}
