//! Cuts, planes that clip and bones, by mouse and by keyboard.

use std::sync::Arc;

use egui::accesskit::Toggled;
use egui::{Key, Pos2, vec2};
use egui_kittest::kittest::{NodeT as _, Queryable as _};
use ivd_frames::{ClipPart, DepthWeight, HalfSpace, Tool};

use super::common::{BALL, Here, scene};
use super::keyboard::{tab_to, typed};
use super::names::assert_named;

/// A bone of the ball, so that masses are on springs.
const BONE: &str = "[deform]\nsolver = \"projective\"\ntolerance = 0.01\nground = 0.01\n[[deform.rigid]]\nname = \"C5\"\ncentre = [16.0, 16.0, 5.0]\nradius = 4.0\nreach = 6.0\n";

fn button(here: &mut Here, pos: Pos2, pressed: bool) {
    here.harness.hover_at(pos);
    here.harness.step();
    here.button(pos, pressed);
}

/// Draws from one place to another with the left button.
pub(crate) fn draw(here: &mut Here, from: Pos2, to: Pos2) {
    button(here, from, true);
    for share in [0.3, 0.6, 1.0] {
        here.harness.hover_at(from + share * (to - from));
        here.harness.step();
    }
    button(here, to, false);
}

#[test]
fn a_line_by_mouse_is_a_cut_that_a_slider_opens_and_undo_closes() {
    for pane in ["Axial slice", "Volume"] {
        let mut here = Here::ball();
        here.harness.key_press(Key::I);
        here.harness.step();
        let middle = here.rect(pane).center();
        let (from, to) = (middle - vec2(40.0, 10.0), middle + vec2(40.0, 10.0));
        draw(&mut here, from, to);
        let told = here.told("a cut", |told| told.incision.is_some());
        let cut = told.incision.unwrap();
        assert_eq!((told.undo.as_deref(), cut.open), (Some("cut open"), 0.25 * cut.radius), "{pane}");
        assert!(told.unsaved && here.has("Close the cut"));

        let slider = here.harness.get_all_by_label("Lips apart").next().unwrap().rect();
        draw(&mut here, slider.center(), slider.right_center() - vec2(12.0, 0.0));
        let told = here.told("it is wider open", |told| told.undo.as_deref() == Some("change a cut"));
        let wider = told.incision.clone().unwrap();
        assert!(wider.open > 1.4 * cut.open && wider.centre == cut.centre, "{}", wider.open);
        assert_eq!(told.refused, None, "all that the slider offers can be followed");
        here.press("Undo");
        let told = here.told("as it was cut", |told| told.undo.as_deref() == Some("cut open"));
        assert_eq!(told.incision.unwrap().open, cut.open);
        here.press("Undo");
        let told = here.told("it is whole", |told| told.incision.is_none());
        assert!(told.undo.is_none() && told.largest_mm == 0.0);
        here.press("Redo");
        here.told("cut again", |told| told.incision.is_some());
        here.press("Close the cut");
        here.told("closed", |told| told.incision.is_none());
    }
}

#[test]
fn a_click_with_the_tool_says_that_a_line_is_drawn_and_esc_gives_one_up() {
    let mut here = Here::ball();
    here.press("Incise");
    let at = here.rect("Axial slice").center();
    button(&mut here, at, true);
    button(&mut here, at, false);
    here.until("what to do", |here| here.has("from one end of the cut to the other"));
    button(&mut here, at, true);
    here.harness.hover_at(at + vec2(60.0, 0.0));
    here.harness.step();
    here.harness.key_press(Key::Escape);
    here.harness.step();
    button(&mut here, at + vec2(60.0, 0.0), false);
    here.harness.key_press(Key::Num3);
    let told = here.told("seen from elsewhere", |told| told.angles != [0.0, 0.0]);
    assert!(told.incision.is_none() && told.undo.is_none());
}

#[test]
fn a_plane_is_put_moved_turned_and_taken_away() {
    let mut here = Here::ball();
    here.press("Clip by a plane");
    here.press("Plane along the coronal slice");
    let told = here.told("a plane", |told| told.clips.len() == 1);
    let plane = |told: &ivd_frames::Figures| match told.clips[0].part {
        ClipPart::Plane(HalfSpace { point, normal }) => (point, normal),
        ClipPart::Box(_) => panic!("no plane"),
    };
    let (point, normal) = plane(&told);
    assert!(normal[1] < 0.0 && here.has("Plane 0 keeps the back"));
    here.settle();
    let slider = here.harness.get_all_by_label("Plane 0").next().unwrap().rect();
    draw(&mut here, slider.center(), slider.center() + vec2(20.0, 0.0));
    let told = here.told("it is moved", |told| told.undo.as_deref() == Some("change a clip"));
    let (moved, same) = plane(&told);
    // To the right is to the front, whichever side is kept.
    assert!(moved[1] > point[1] + 1.0 && same == normal && moved[0] == point[0], "{moved:?} {point:?}");
    here.press("Other side of plane 0");
    let told = here.told("the other side", |told| plane(told).1[1] > 0.0);
    assert_eq!(plane(&told).0, moved);
    assert!(here.has("Plane 0 keeps the front"));
    here.press("Take plane 0 away");
    here.told("it is gone", |told| told.clips.is_empty());
    for step in 0..4 {
        here.press("Undo");
        here.told("a step back", |told| told.clips.len() == usize::from(step < 3));
    }
    assert!(here.figures().undo.is_none(), "each was one step");
}

#[test]
fn a_bone_is_turned_by_its_row() {
    let folder = Arc::new(tempfile::tempdir().unwrap());
    let source = scene(folder.path(), &format!("{BALL}{BONE}"));
    let mut here = Here::new(folder, Some(source), None);
    here.settle();
    here.harness.run_ok();
    assert_named(&here);
    tab_to(&mut here, "Bone C5: turn, degrees");
    typed(&mut here, "4");
    let told = here.told("it is turned", |told| told.bones[0].angle == 4.0);
    assert_eq!((told.refused, told.undo.as_deref()), (None, Some("turn a bone")));
    tab_to(&mut here, "Bone C5: y, mm from rest");
    typed(&mut here, "0.5");
    let told = here.told("it goes", |told| told.bones[0].by == [0.0, 0.5, 0.0]);
    assert_eq!(told.bones[0].angle, 4.0);
    here.press("Undo");
    let told = here.told("a step back", |told| told.bones[0].by == [0.0; 3]);
    assert_eq!(told.bones[0].angle, 4.0);
}

#[test]
fn a_cut_and_a_box_need_no_pointer() {
    let mut here = Here::ball();
    tab_to(&mut here, "Cut where the slices meet");
    here.harness.key_press(Key::Enter);
    here.harness.step();
    here.harness.step();
    tab_to(&mut here, "Cut along the sagittal slice");
    here.harness.key_press(Key::Enter);
    let told = here.told("a cut", |told| told.incision.is_some());
    let cut = told.incision.unwrap();
    assert!(cut.normal[0].abs() > 0.99 && (cut.radius - told.radius).abs() < 0.1, "{cut:?}");
    tab_to(&mut here, "Lips apart, as a number");
    typed(&mut here, "2");
    here.told("its lips", |told| told.incision.as_ref().is_some_and(|cut| cut.open == 2.0));
    tab_to(&mut here, "Keep a box");
    here.harness.key_press(Key::Enter);
    here.told("a box", |told| told.clips.len() == 1);
    tab_to(&mut here, "Box 0: z to, mm");
    typed(&mut here, "20");
    let told = here.told(
        "it is lower",
        |told| matches!(told.clips[0].part, ClipPart::Box(cuboid) if cuboid.max[2] == 20.0),
    );
    assert_eq!(told.refused, None);
}

#[test]
fn a_volume_that_is_clipped_is_exported_with_or_without_what_is_taken_away() {
    let mut here = Here::ball();
    here.press("Keep a box");
    here.told("a box", |told| told.clips.len() == 1);
    tab_to(&mut here, "Box 0: y to, mm");
    typed(&mut here, "16");
    here.told("it ends there", |told| told.undo.as_deref() == Some("change a clip"));
    let mut written = Vec::new();
    for (name, whole) in [("clipped.nii.gz", false), ("whole.nii.gz", true)] {
        here.press("File");
        here.press("Export deformed volume … Ctrl+E");
        let without = "cut away what planes and boxes hide, as on the screen";
        assert!(here.harness.get_by_label(without).accesskit_node().toggled() == Some(Toggled::False));
        if whole {
            here.harness.key_press(Key::Enter);
        } else {
            here.press(without);
            here.press("Choose a place …");
        }
        here.until("it is asked where", |here| here.harness.query_by_label("Path").is_some());
        let path = here.folder.path().join(name);
        let field = here.harness.get_by_label("Path");
        field.focus();
        field.set_text_value_accesskit(&path.display().to_string());
        here.harness.step();
        here.press("Save");
        here.until("it is written", |here| here.has(&format!("Written: {}", path.display())));
        assert_eq!(here.has(&format!("{name}, without what the plane or box takes away")), !whole);
        written.push(std::fs::read(&path).unwrap());
    }
    assert!(written[0].len() < written[1].len(), "half of it is empty");
}

#[test]
fn a_class_is_made_stiffer_once_the_lattice_follows_by_springs() {
    let folder = Arc::new(tempfile::tempdir().unwrap());
    let by_classes = BALL.replace("[lattice]\niso = 127.5\n", "[segment]\nk = 3\n");
    let source = scene(folder.path(), &by_classes.replace("mode = \"iso\"\niso = 127.5\n", ""));
    let mut here = Here::new(folder, Some(source), None);
    here.settle();
    here.press("Surface follows by");
    here.harness.run_ok();
    here.press("springs");
    let told = here.told("by springs", |told| told.solver == "springs" && !told.matter.is_empty());
    here.harness.run_ok();
    assert_named(&here);
    let class = told.matter[0].class;
    tab_to(&mut here, &format!("Stiffness of class {class}, N/m"));
    typed(&mut here, "400");
    let told = here.told("it is stiffer", |told| told.matter[0].stiffness == Some(400.0));
    assert!(told.unsaved && told.undo.as_deref() == Some("change the stiffness of a class"));
    here.press("Undo");
    here.told("as before", |told| told.matter[0].stiffness == Some(told.stiffness));
}

#[test]
fn slices_say_that_they_are_clipped_and_lists_say_what_their_numbers_are() {
    let mut here = Here::ball();
    here.press("Handle where the slices meet");
    here.told("a handle", |told| told.handles.len() == 1);
    here.harness.run_ok();
    for told in ["place (mm)", "moved by, and radius (mm):"] {
        assert!(here.has(told), "{told}");
    }
    let is_patient = here.figures().letters.is_some();
    assert_eq!(here.harness.query_by_label("x (R)").is_some(), is_patient);
    let described = |here: &Here, pane: &str| {
        let node = here.harness.get_by_label(pane);
        node.accesskit_node().description().unwrap_or_default()
    };
    here.press("Clip by a plane");
    here.harness.run_ok();
    here.press("Plane along the axial slice");
    let told = here.told("a plane", |told| told.clips.len() == 1);
    here.harness.step();
    for (slice, pane) in told.slices.iter().zip(["Axial slice", "Coronal slice", "Sagittal slice"]) {
        assert_eq!(described(&here, pane).contains("clipped"), slice.clipped, "{pane}");
    }
    assert!(told.slices[1].clipped && told.slices[2].clipped);
}

#[test]
fn the_tool_says_how_it_is_used() {
    let mut here = Here::ball();
    for (key, tool) in
        [(Key::H, Tool::Handle), (Key::P, Tool::Pin), (Key::I, Tool::Incise), (Key::T, Tool::Turn)]
    {
        here.harness.key_press(key);
        here.harness.step();
        here.harness.step();
        assert!(here.has(tool.hint()), "{tool:?}");
    }
}

#[test]
fn how_the_motion_fades_is_chosen_where_voxels_follow_what_is_nearest() {
    let mut here = Here::ball();
    for (word, weight) in [("not at all", DepthWeight::One), ("evenly", DepthWeight::Linear)] {
        here.press("Motion fades with depth");
        here.harness.run_ok();
        here.press(word);
        here.told(word, |told| told.depth == Some(weight));
        here.harness.run_ok();
    }
    here.press("Undo");
    here.told("a step back", |told| told.depth == Some(DepthWeight::One) && told.undo.is_some());
    here.press("Voxels follow");
    here.harness.run_ok();
    here.press("smoothest");
    here.told("smoothest", |told| told.depth.is_none());
    let choice =
        |here: &Here| here.harness.get_by_label("Motion fades with depth").accesskit_node().is_disabled();
    here.until("no choice", choice);
}
