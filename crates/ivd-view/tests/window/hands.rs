//! By mouse.

use egui::{Color32, Key, Modifiers, Pos2, Shape, vec2};

use egui_kittest::kittest::Queryable as _;
use ivd_frames::MapName;

use super::common::{BALL, Here, scene};
use super::keyboard::{tab_to, typed};

/// Takes hold of the ball where it is seen, and pulls.
fn pull(here: &mut Here) -> Pos2 {
    here.harness.key_press(Key::H);
    let at = here.at("Volume", 0.5, 0.5);
    here.harness.hover_at(at);
    here.harness.step();
    here.button(at, true);
    here.told("a handle is held", |told| told.held.is_some());
    let to = at + vec2(12.0, -16.0);
    here.harness.hover_at(to);
    here.told("it went along", |told| told.largest_mm > 0.5);
    to
}

#[test]
fn a_drag_by_mouse_makes_a_displacement_and_one_step() {
    let mut here = Here::ball();
    let to = pull(&mut here);
    here.button(to, false);
    let told = here.told("it was let go", |told| told.held.is_none() && told.undo.is_some());
    assert_eq!((told.handles.len(), told.undo.as_deref()), (1, Some("drag a new handle")));
    let by = told.handles[0].by.unwrap();
    assert!(by[0].abs() > 0.3 && by[2] > 0.3 && told.min_det_j > 0.0, "{by:?}");
    assert!(told.unsaved);
    here.press("Undo");
    let told = here.told("nothing is moved", |told| told.undo.is_none());
    assert!(told.handles.is_empty() && told.redo.is_some() && told.largest_mm == 0.0);
    assert!(!told.unsaved, "nothing would be lost");
}

#[test]
fn escape_goes_back_to_before_the_drag() {
    let mut here = Here::ball();
    let to = pull(&mut here);
    here.harness.key_press(Key::Escape);
    let told = here.told("it is given up", |told| told.held.is_none());
    assert!(told.handles.is_empty() && told.undo.is_none() && told.largest_mm == 0.0);
    here.button(to, false);
    // Turning never edits.
    here.harness.key_press(Key::T);
    here.harness.step();
    let at = here.at("Volume", 0.5, 0.5);
    here.harness.hover_at(at);
    here.button(at, true);
    let before = here.figures().angles;
    here.harness.hover_at(at + vec2(60.0, 10.0));
    let told = here.told("it is turned", |told| told.angles != before);
    here.button(at, false);
    assert!(told.handles.is_empty());
}

#[test]
fn the_wheel_is_the_radius_while_a_handle_is_held_and_goes_through_slices_else() {
    let mut here = Here::ball();
    let to = pull(&mut here);
    let radius = here.figures().radius;
    here.wheel(2.0);
    let told = here.told("it is wider", |told| told.radius > radius);
    assert!((told.radius - radius * 1.21).abs() < 1e-9 && told.handles[0].radius == told.radius);
    here.button(to, false);
    // Slices go to what was let go of, a little later.
    let told = here.told("the slices meet at it", |told| {
        told.held.is_none() && told.handles[0].off.iter().all(|off| off.abs() <= 0.51)
    });
    let at = here.at("Sagittal slice", 0.1, 0.1);
    here.harness.hover_at(at);
    here.harness.step();
    here.wheel(-3.0);
    let slice = told.slices[2].slice;
    let told = here.told("another slice", |told| told.slices[2].slice != slice);
    assert_eq!(told.slices[2].slice, slice - 3);
}

#[test]
fn a_slider_that_is_dragged_is_one_step() {
    let here = Here::ball();
    assert!(here.has("Stiffness (N/m, used with springs)"), "by distance alone it shows nowhere");
    let folder = std::sync::Arc::new(tempfile::tempdir().unwrap());
    let source = scene(folder.path(), &format!("{BALL}[deform]\nsolver = \"projective\"\n"));
    let mut here = Here::new(folder, Some(source), None);
    here.settle();
    let rect = here.rect("Stiffness");
    let before = here.figures().stiffness;
    let (from, to) = (rect.left_center() + vec2(4.0, 0.0), rect.right_center() - vec2(4.0, 0.0));
    here.harness.hover_at(from);
    here.harness.step();
    here.button(from, true);
    for share in [0.3, 0.6, 1.0] {
        here.harness.hover_at(from + share * (to - from));
        here.harness.step();
    }
    here.button(to, false);
    let told = here.told("it is let go of", |told| told.undo.is_some());
    assert_ne!(told.stiffness, before);
    here.press("Undo");
    let told = here.told("as before", |told| told.undo.is_none());
    assert_eq!(told.stiffness, before);
}

/// Middles of the small white rings that are drawn.
fn rings(here: &Here) -> Vec<Pos2> {
    fn find(shape: &Shape, found: &mut Vec<Pos2>) {
        match shape {
            Shape::Vec(shapes) => shapes.iter().for_each(|shape| find(shape, found)),
            Shape::Circle(ring) if ring.radius == 3.0 && ring.stroke.color == Color32::WHITE => {
                found.push(ring.center);
            }
            _ => {}
        }
    }
    let mut found = Vec::new();
    here.harness.output().shapes.iter().for_each(|clipped| find(&clipped.shape, &mut found));
    found
}

#[test]
fn a_ring_is_drawn_about_the_vertex_that_would_be_taken_and_none_when_the_pointer_has_left() {
    let folder = std::sync::Arc::new(tempfile::tempdir().unwrap());
    let source = scene(folder.path(), &BALL.replace("level = 1", "level = 3"));
    let mut here = Here::new(folder, Some(source), None);
    here.settle();
    here.harness.key_press(Key::H);
    let at = here.at("Volume", 0.53, 0.43);
    here.harness.hover_at(at);
    let told = here.told("a vertex", |told| told.hovered.as_ref().is_some_and(|one| one.vertex.is_some()));
    assert!(told.hovered.unwrap().away_mm.unwrap() > 1.0, "the lattice is coarse");
    here.harness.step();
    let drawn = rings(&here);
    here.button(at, true);
    let taken = here.told("it is taken", |told| told.held.is_some());
    here.button(at, false);
    here.told("it is let go of", |told| told.held.is_none());
    let (pane, share) = (here.rect("Volume"), taken.handles[0].at[0].unwrap());
    let ratio = taken.size[0] as f32 / taken.size[1] as f32;
    let width = pane.width().min(pane.height() * ratio);
    let room = egui::Rect::from_center_size(pane.center(), vec2(width, width / ratio));
    let vertex = room.min + vec2(share[0] as f32 * room.width(), share[1] as f32 * room.height());
    assert!(drawn.iter().any(|ring| ring.distance(vertex) < 0.5), "{drawn:?} but not {vertex:?}");
    assert!(vertex.distance(at) > 3.0);
    let at = here.at("Volume", 0.4, 0.6);
    here.harness.hover_at(at);
    here.until("another vertex", |here| !rings(here).is_empty());
    let aside = here.rect("Stiffness").center();
    here.harness.hover_at(aside);
    here.harness.step();
    assert_eq!(rings(&here), [], "the pointer has left the pictures");
}

#[test]
fn the_side_panel_is_as_wide_whatever_it_holds() {
    let mut here = Here::ball();
    let width = here.rect("Volume").width();
    let same = |here: &Here, when: &str| assert_eq!(here.rect("Volume").width(), width, "{when}");
    let to = pull(&mut here);
    same(&here, "a handle is held");
    for far in [40.0, 4000.0] {
        here.harness.hover_at(to + vec2(far, -far));
        here.harness.step();
        here.harness.step();
        same(&here, "it is dragged far");
    }
    here.button(to, false);
    let id = here.told("it is let go of", |told| told.held.is_none()).handles[0].id;
    tab_to(&mut here, &format!("Handle {id}: y, mm from rest"));
    typed(&mut here, "-123456.78");
    here.told("it is refused", |told| told.refused.is_some());
    here.harness.run_ok();
    same(&here, "a move is refused");
    for (what, letter) in [("Export log …", "x"), ("Export lattice …", "y")] {
        here.press("File");
        here.press(what);
        let path = here.folder.path().join(letter.repeat(200));
        let field = here.harness.get_by_label("Path");
        field.focus();
        field.set_text_value_accesskit(&path.display().to_string());
        here.harness.step();
        here.press("Save");
        here.until("it is written", |here| here.has(&format!("written: {}", path.display())));
    }
    here.harness.run_ok();
    same(&here, "notes are long");
    assert_eq!(here.rect("Volume").width(), here.rect("Axial slice").width());
}

#[test]
fn a_level_that_is_no_coarser_says_so() {
    let mut here = Here::ball();
    for level in [15, 16] {
        tab_to(&mut here, "Level, as a number");
        typed(&mut here, &level.to_string());
        here.told("the level", |told| told.level == level);
    }
    here.until("it is told", |here| here.has("Level 16 is no coarser than level 15"));
}

#[test]
fn a_push_that_goes_too_far_says_so_in_a_line_and_offers_what_may_come_further() {
    let mut here = Here::ball();
    here.press("Handle where the slices meet");
    here.told("a handle", |told| told.handles.len() == 1);
    here.harness.run_ok();
    let panes = |here: &Here| here.harness.get_by_label("Axial slice").rect();
    let before = panes(&here);
    super::keyboard::tab_to(&mut here, "Handle 0: y, mm from rest");
    super::keyboard::typed(&mut here, "-25");
    let told = here.told("refused", |told| told.refused.is_some()).refused.unwrap();
    assert!(
        told.instead == Some(MapName::Biharmonic)
            && told.why.contains("fold")
            && !told.why.contains("tolerance"),
        "{told:?}"
    );
    assert!(told.exactly.is_some_and(|exactly| exactly.contains("the map")));
    here.harness.step();
    assert!(here.has(&told.why));
    assert_eq!(panes(&here), before, "no picture gives way");
    here.press("Follow smoothest");
    here.told("smoothest", |told| told.map == "biharmonic" && told.refused.is_none());
}

#[test]
fn what_is_written_after_a_refusal_is_told() {
    let mut here = Here::ball();
    here.press("Handle where the slices meet");
    here.told("a handle", |told| told.handles.len() == 1);
    tab_to(&mut here, "Handle 0: y, mm from rest");
    typed(&mut here, "-25");
    let why = here.told("refused", |told| told.refused.is_some()).refused.unwrap().why;
    here.until("it is told why", |here| here.has(&why));
    here.harness.key_press_modifiers(Modifiers::COMMAND, Key::S);
    here.until("it is asked where", |here| here.harness.query_by_label("Path").is_some());
    let path = here.folder.path().join("kept.toml");
    let field = here.harness.get_by_label("Path");
    field.focus();
    field.set_text_value_accesskit(&path.display().to_string());
    here.harness.step();
    here.press("Save");
    here.until("it is written", |here| here.has(&format!("Written: {}", path.display())) && !here.has(&why));
    // What only looks tells no more of it.
    here.harness.key_press(Key::Num0);
    here.harness.run_ok();
    assert!(here.has("Written: ") && !here.has(&why));
}
