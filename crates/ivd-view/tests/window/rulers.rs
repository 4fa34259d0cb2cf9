//! Lengths and angles, by mouse and by keyboard.

use egui::{Key, Pos2, vec2};

use super::common::Here;
use super::keyboard::chosen;
use super::names::assert_named;

fn button(here: &mut Here, pos: Pos2, pressed: bool) {
    here.harness.hover_at(pos);
    here.harness.step();
    here.button(pos, pressed);
}

#[test]
fn a_line_by_mouse_is_a_length_and_another_from_its_end_an_angle() {
    let mut here = Here::ball();
    here.harness.key_press(Key::M);
    here.harness.step();
    // The ball's slices are 32 mm wide and high.
    let rect = here.rect("Axial slice");
    let mm = rect.width().min(rect.height()) / 32.0;
    let (from, to) = (rect.center() - vec2(8.0, 0.0) * mm, rect.center() + vec2(4.0, 0.0) * mm);
    button(&mut here, from, true);
    button(&mut here, to, false);
    let told = here.told("a length", |told| told.rulers.len() == 1);
    assert!((told.rulers[0].mm[0] - 12.0).abs() < 1e-3, "{:?}", told.rulers);
    here.until("its row", |here| here.has("Ruler 0: 12.0 mm"));
    let last = to + vec2(0.0, 5.0) * mm;
    button(&mut here, to, true);
    button(&mut here, last, false);
    let told = here.told("an angle", |told| told.rulers[0].degrees.is_some());
    assert!((told.rulers[0].degrees.unwrap() - 90.0).abs() < 1e-3);
    here.until("its row", |here| here.has("Ruler 0: 12.0 mm and 5.0 mm 90.0°"));
    here.harness.run_ok();
    assert_named(&here);
    // Esc gives one up.
    button(&mut here, from, true);
    here.harness.hover_at(to);
    here.harness.step();
    here.harness.key_press(Key::Escape);
    here.harness.step();
    button(&mut here, to, false);
    // In the volume, too.
    let middle = here.rect("Volume").center();
    button(&mut here, middle, true);
    button(&mut here, middle + vec2(30.0, 12.0), false);
    let told = here.told("another", |told| told.rulers.len() == 2);
    assert!(told.undo.as_deref() == Some("measure") && told.unsaved && told.handles.is_empty());
    let remove = |here: &mut Here, name: &str| {
        chosen(here, name);
        here.harness.step();
    };
    remove(&mut here, "Remove ruler 0");
    let told = here.told("one is gone", |told| told.rulers.len() == 1);
    assert_eq!(told.rulers[0].id, 1);
}

#[test]
fn a_ruler_needs_no_pointer() {
    let mut here = Here::ball();
    here.harness.key_press(Key::M);
    here.harness.step();
    chosen(&mut here, "Ruler from where the slices meet");
    let slide = |here: &mut Here, pane: &str, times: usize| {
        super::keyboard::tab_to(here, pane);
        let before = here.figures().cross;
        (0..times).for_each(|_| here.harness.key_press(Key::ArrowUp));
        here.told("slices meet elsewhere", |told| {
            let way = (0..3).map(|a| (told.cross[a] - before[a]).abs()).sum::<f64>();
            (way - times as f64).abs() < 1e-9
        });
    };
    slide(&mut here, "Axial slice", 4);
    chosen(&mut here, "Ruler to where the slices meet");
    let told = here.told("a length", |told| told.rulers.len() == 1);
    assert!((told.rulers[0].mm[0] - 4.0).abs() < 1e-9);
    slide(&mut here, "Coronal slice", 4);
    chosen(&mut here, "Angle of ruler 0");
    let told = here.told("an angle", |told| told.rulers[0].degrees.is_some());
    assert!((told.rulers[0].degrees.unwrap() - 90.0).abs() < 1e-9);
    chosen(&mut here, "Remove ruler 0");
    here.told("it is gone", |told| told.rulers.is_empty());
}
