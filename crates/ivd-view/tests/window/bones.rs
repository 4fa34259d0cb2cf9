//! Bones that are drawn, by mouse and by keyboard.

use super::common::{BALL, Here, scene};
use super::keyboard::{chosen, tab_to, typed};
use super::names::assert_named;
use super::parts::draw;
use egui::{Key, vec2};

/// A ball on springs.
fn springs() -> Here {
    let folder = std::sync::Arc::new(tempfile::tempdir().unwrap());
    let source = scene(folder.path(), &format!("{BALL}[deform]\nsolver = \"projective\"\n"));
    let mut here = Here::new(folder, Some(source), None);
    here.settle();
    here
}

#[test]
fn a_bone_is_drawn_turned_changed_and_made_soft_again() {
    let mut here = springs();
    here.harness.key_press(Key::J);
    here.harness.step();
    let slice = here.rect("Axial slice");
    let at = |share: f32| slice.center() + vec2(0.0, (share - 0.5) * slice.height());
    draw(&mut here, at(0.35), at(0.15));
    let told = here.told("a bone", |told| told.bones.len() == 1);
    assert_eq!(told.undo.as_deref(), Some("add a bone"));
    here.harness.run_ok();
    assert_named(&here);
    let name = told.bones[0].name.clone();
    tab_to(&mut here, &format!("Bone {name}: turn, degrees"));
    typed(&mut here, "5");
    let told = here.told("it is turned", |told| told.bones[0].angle == 5.0);
    assert!(told.refused.is_none() && told.largest_mm > 0.2, "{}", told.largest_mm);
    tab_to(&mut here, &format!("Bone {name}: holds within, mm"));
    typed(&mut here, "4");
    here.told("it holds more", |told| told.bones[0].radius == Some(4.0));
    chosen(&mut here, &format!("Bone {name}: joint where the slices meet"));
    let told = here.told("it turns about another joint", |now| now.bones[0].pivot != told.bones[0].pivot);
    assert_eq!(told.bones[0].angle, 5.0);
    here.press(&format!("Remove bone {name}"));
    here.told("it is soft again", |told| told.bones.is_empty() && told.largest_mm == 0.0);
}

#[test]
fn a_bone_needs_springs_and_no_pointer() {
    let mut here = Here::ball();
    here.harness.key_press(Key::J);
    here.harness.step();
    assert!(here.has("Distance alone knows no bones"));
    let mut here = springs();
    here.harness.key_press(Key::J);
    here.harness.step();
    tab_to(&mut here, "Bone from where the slices meet");
    chosen(&mut here, "Bone from where the slices meet");
    here.settle();
    tab_to(&mut here, "Axial slice");
    for _ in 0..14 {
        here.harness.key_press(Key::ArrowUp);
        here.harness.step();
    }
    let told = here.told("it goes up", |told| told.slices[0].slice == 30);
    assert!(told.bones.is_empty());
    chosen(&mut here, "Bone to where the slices meet");
    let told = here.told("a bone", |told| told.bones.len() == 1);
    assert!((told.bones[0].radius.unwrap() - 3.5).abs() < 1e-9 && !told.bones[0].carried);
}
