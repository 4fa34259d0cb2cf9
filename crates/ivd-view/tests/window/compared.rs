//! The body as it is beside the body at rest, by keys, by the menu and by mouse.

use egui::{Key, vec2};
use egui_kittest::kittest::{NodeT as _, Queryable as _};
use ivd_frames::Shows;

use super::common::Here;
use super::keyboard::tab_to;
use super::names::assert_named;

/// What is said of a pane to those who read the window by ear.
fn said(here: &Here, pane: &str) -> String {
    let node = here.harness.get_by_label(pane);
    node.accesskit_node().data().description().unwrap_or_default().to_owned()
}

#[test]
fn keys_show_the_body_at_rest_and_as_it_is_again() {
    let mut here = Here::ball();
    for (key, shows, says) in
        [(Key::O, Shows::Rest, "the body at rest"), (Key::W, Shows::Both, "up to 50 % of the width")]
    {
        here.harness.key_press(key);
        here.told("another state", |told| told.compare.shows == shows);
        here.harness.step();
        for pane in ["Volume", "Axial slice", "Coronal slice", "Sagittal slice"] {
            assert!(said(&here, pane).contains(says), "{pane}: {}", said(&here, pane));
        }
        here.harness.run_ok();
        assert_named(&here);
    }
    here.harness.key_press(Key::W);
    here.told("deformed", |told| told.compare.shows == Shows::Now);
    here.harness.step();
    assert!(!said(&here, "Volume").contains("rest"));
    // By the menu.
    for (item, shows) in [
        ("Show the body at rest", Shows::Rest),
        ("Show the deformed body", Shows::Now),
        ("Divide the pictures: at rest, deformed", Shows::Both),
        ("Pictures not divided", Shows::Now),
    ] {
        here.press("View");
        here.harness.run_ok();
        here.harness.get_by_label_contains(item).click();
        here.told(item, |told| told.compare.shows == shows);
        here.harness.run_ok();
    }
}

#[test]
fn the_line_is_dragged_in_any_pane_and_moved_by_keyboard_and_nothing_is_edited() {
    let mut here = Here::ball();
    here.harness.key_press(Key::H);
    here.harness.key_press(Key::W);
    here.told("both", |told| told.compare.shows == Shows::Both);
    here.settle();
    for pane in ["Volume", "Coronal slice"] {
        let before = here.figures().compare.at;
        let rect = here.rect(pane);
        // The ball's pictures are as wide as they are high, or the pane's.
        let side = if pane == "Volume" { rect.width() } else { rect.width().min(rect.height()) };
        let from = rect.center() + vec2((before as f32 - 0.5) * side, 20.0);
        here.harness.hover_at(from);
        here.harness.step();
        here.button(from, true);
        here.harness.hover_at(from + vec2(30.0, 4.0));
        here.harness.step();
        here.button(from + vec2(30.0, 4.0), false);
        let told = here.told("the line is elsewhere", |told| told.compare.at > before);
        assert!((told.compare.at - before - f64::from(30.0 / side)).abs() < 0.02, "{}", told.compare.at);
        assert!(told.handles.is_empty() && told.held.is_none() && told.undo.is_none());
    }
    let before = here.figures().compare.at;
    tab_to(&mut here, "At rest up to, % of each picture's width");
    here.harness.key_press(Key::ArrowLeft);
    here.told("moved by a key", |told| told.compare.at < before);
}
