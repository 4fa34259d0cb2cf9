//! The body as it is beside the body at rest.

use ivd_core::{Exec, Image};
use ivd_frames::{Compared, Figures, Model, Overlay, Pane, Request, Shows};

use super::common::{self, BALL, model};

fn follow(model: &mut Model, request: &Request) -> Figures {
    model.follow(request).unwrap();
    model.figures()
}

fn show(model: &mut Model, shows: Shows, at: f64) -> Figures {
    follow(model, &Request::Compare { shows, at })
}

/// All pictures, coarse and whole.
fn pictures(model: &Model) -> Vec<Image> {
    let draw = |pane, coarser| model.draw(pane, coarser, &Exec::default()).unwrap();
    Pane::ALL.into_iter().flat_map(|pane| [draw(pane, 1), draw(pane, 3)]).collect()
}

/// A ball that is pulled at, with the slices in the middle.
fn pulled() -> Model {
    let mut model = model(BALL);
    let middle = model.figures().slices;
    follow(&mut model, &Request::Grab { pane: Pane::Volume, at: [0.5, 0.5] });
    follow(&mut model, &Request::Drag { to: [0.53, 0.46], lock: None });
    let dropped = follow(&mut model, &Request::Drop);
    assert_eq!(dropped.refused, None);
    for (was, is) in middle.iter().zip(&dropped.slices) {
        let steps = was.slice as i32 - is.slice as i32;
        follow(&mut model, &Request::Slice { pane: is.pane, steps });
    }
    model
}

#[test]
fn at_rest_is_what_was_shown_first_and_divided_pictures_are_both() {
    let first = pictures(&model(BALL));
    let mut model = pulled();
    follow(&mut model, &Request::Overlay { of: Some(Overlay::Motion) });
    let (now, told) = (pictures(&model), model.figures());
    assert!([0, 1, 2, 6].iter().all(|i| now[*i] != first[*i]), "it is moved");
    let rest = show(&mut model, Shows::Rest, 0.5);
    assert_eq!(pictures(&model), first, "bit for bit");
    assert_eq!(rest.compare.shows, Shows::Rest);
    // What a handle holds is shown where it lay.
    assert_eq!(rest.handles[0].now, told.handles[0].now);
    assert_ne!(rest.handles[0].at, told.handles[0].at);
    for at in [0.0, 0.3, 0.5, 0.77, 1.0] {
        show(&mut model, Shows::Both, at);
        for ((both, rest), now) in pictures(&model).iter().zip(&first).zip(&now) {
            let width = both.width();
            for (i, pixel) in both.rgba().chunks(4).enumerate() {
                let is_rest = (i % width) as f64 + 0.5 < at * width as f64;
                let from = if is_rest { rest } else { now };
                assert_eq!(pixel, &from.rgba()[4 * i..4 * i + 4], "column {} of {width} at {at}", i % width);
            }
        }
    }
    let again = show(&mut model, Shows::Now, 0.5);
    assert_eq!((pictures(&model), again), (now, told), "and nothing was edited");
}

#[test]
fn what_is_pointed_at_at_rest_is_told_as_it_was_and_not_edited() {
    let mut model = pulled();
    let at = [0.5, 0.5];
    let undo = show(&mut model, Shows::Rest, 0.5).undo;
    for request in [
        Request::Grab { pane: Pane::Volume, at },
        Request::Pin { pane: Pane::Axial, at },
        Request::Stroke { pane: Pane::Axial, from: [0.4, 0.5], to: [0.6, 0.5] },
    ] {
        let refused = model.follow(&request).unwrap_err().to_string();
        assert!(refused.contains("at rest") && refused.contains("deformed first"), "{refused}");
        assert_eq!(model.figures().undo, undo);
    }
    let hovered = follow(&mut model, &Request::Hover { pane: Pane::Volume, at }).hovered.unwrap();
    assert_eq!((hovered.rest, hovered.vertex, hovered.handle), (hovered.place, None, None));
    // As if nothing had been done to it.
    let first = follow(&mut common::model(BALL), &Request::Hover { pane: Pane::Volume, at }).hovered.unwrap();
    assert_eq!((hovered.place, hovered.value), (first.place, first.value));

    show(&mut model, Shows::Both, 0.5);
    assert!(model.follow(&Request::Pin { pane: Pane::Axial, at: [0.49, 0.5] }).is_err());
    assert!(model.follow(&Request::Stroke { pane: Pane::Axial, from: [0.4, 0.5], to: [0.6, 0.5] }).is_err());
    let pinned = follow(&mut model, &Request::Pin { pane: Pane::Axial, at: [0.51, 0.5] });
    assert_eq!((pinned.pins.len(), pinned.compare), (1, Compared { shows: Shows::Both, at: 0.5 }));
    // What a list does, or a key, is seen.
    show(&mut model, Shows::Rest, 0.2);
    let undone = follow(&mut model, &Request::Undo);
    assert_eq!((undone.pins.len(), undone.compare), (0, Compared { shows: Shows::Now, at: 0.2 }));
}

#[test]
fn what_is_shown_already_is_not_drawn_anew_and_a_slider_that_is_held_is_let_go_of() {
    let mut model = pulled();
    let before = model.versions();
    show(&mut model, Shows::Now, 0.5);
    assert_eq!(model.versions(), before);
    for at in [f64::NAN, -0.1, 1.1, f64::INFINITY] {
        assert!(model.follow(&Request::Compare { shows: Shows::Both, at }).is_err(), "{at}");
    }
    follow(&mut model, &Request::Grab { pane: Pane::Volume, at: [0.5, 0.6] });
    let told = show(&mut model, Shows::Rest, 0.5);
    assert_eq!((told.held, told.undo.as_deref()), (None, Some("drag a new handle")));
    assert!(model.versions().iter().zip(before).all(|(now, before)| *now > before));
}

#[test]
fn the_body_at_rest_is_clipped_as_the_other_is() {
    let mut model = pulled();
    show(&mut model, Shows::Rest, 0.5);
    let whole = pictures(&model);
    show(&mut model, Shows::Now, 0.5);
    follow(&mut model, &Request::ClipHere { along: Pane::Sagittal });
    show(&mut model, Shows::Rest, 0.5);
    let clipped = pictures(&model);
    // Half of the slices that the plane crosses is dark, and the volume is open.
    for (i, (before, after)) in whole.iter().zip(&clipped).enumerate().filter(|(i, _)| *i != 6 && *i != 7) {
        assert_ne!(before, after, "picture {i}");
    }
    // It is what a scan that never was deformed would show.
    let mut still = common::model(BALL);
    follow(&mut still, &Request::ClipHere { along: Pane::Sagittal });
    assert_eq!(pictures(&still), clipped);
    follow(&mut model, &Request::Undo);
    show(&mut model, Shows::Rest, 0.5);
    assert_eq!(pictures(&model), whole);
}
