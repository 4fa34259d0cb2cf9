//! Lengths and angles of what is seen.

use ivd_core::{Grid, Volume, Voxels};
use ivd_frames::{Figures, Model, Pane, Request, Ruler, Shows};
use ivd_render::Side;
use nalgebra::Vector3;

use super::common::{BALL, model};
use super::scans::model_of;
use super::scripts::assert_as_piped;

/// Sides of the voxels (mm).
const SPACING: [f64; 3] = [1.0, 1.5, 2.0];

fn follow(model: &mut Model, request: &Request) -> Figures {
    model.follow(request).unwrap();
    model.figures()
}

fn ruler(model: &mut Model, places: &[[f64; 3]]) -> Ruler {
    let told = follow(model, &Request::Ruler { ruler: None, places: places.to_vec() });
    told.rulers.last().unwrap().clone()
}

/// A ball about a place, of 10 mm where it is cut.
const CENTRE: [f64; 3] = [30.0, -12.0, 55.0];

/// A model of that ball on an oblique grid of voxels as long as they are not wide, with parts of a scene.
fn oblique(parts: &str) -> Model {
    let (a, b) = (0.3_f64, 0.2_f64);
    let axes = [
        [a.cos(), a.sin(), 0.0],
        [-a.sin() * b.cos(), a.cos() * b.cos(), b.sin()],
        [a.sin() * b.sin(), -a.cos() * b.sin(), b.cos()],
    ];
    let dims = [30, 20, 15];
    let half: Vector3<f64> =
        (0..3).map(|i| Vector3::from(axes[i]) * (SPACING[i] * (dims[i] - 1) as f64 / 2.0)).sum();
    let grid = Grid::new(dims, SPACING, (Vector3::from(CENTRE) - half).into(), axes).unwrap();
    let value = |i: usize| {
        let away = (grid.world(grid.index(i).into()).0 - Vector3::from(CENTRE)).norm();
        (127.5 + 20.0 * (10.0 - away)).clamp(0.0, 255.0) as f32
    };
    let values: Vec<f32> = (0..grid.len()).map(value).collect();
    let volume = Volume::new(grid, Voxels::from(values)).unwrap();
    let text = BALL.replace("phantom = \"sphere\"\nsize = 32", "file = \"scan.nrrd\"") + parts;
    model_of(volume, &text)
}

fn near(a: f64, b: f64, what: &str) {
    assert!((a - b).abs() < 1e-6, "{what}: {a} for {b}");
}

#[test]
fn lines_over_slices_of_an_oblique_grid_have_their_lengths_and_angles() {
    let mut model = oblique("");
    for pane in [Pane::Axial, Pane::Coronal, Pane::Sagittal] {
        let told = model.figures();
        let extent = told.slices[pane.number() - 1].extent_mm;
        // Slices of 30, 30 and 30 mm: 30 of 1, 20 of 1.5, 15 of 2.
        for side in extent {
            near(side, 30.0, "a side");
        }
        let (from, to, then) = ([0.31, 0.42], [0.62, 0.55], [0.4, 0.83]);
        let count = told.rulers.len();
        let told = follow(&mut model, &Request::Measure { pane, from, to });
        let one = told.rulers.last().unwrap();
        let way = |a: [f64; 2], b: [f64; 2]| [0, 1].map(|i| (b[i] - a[i]) * extent[i]);
        let [x, y] = way(from, to);
        near(one.mm[0], x.hypot(y), "a length");
        near(one.rest_mm[0], one.mm[0], "at rest");
        assert_eq!((one.degrees, told.rulers.len()), (None, count + 1));
        for (end, at) in one.at.iter().zip([from, to]) {
            let shown = end[pane.number()].unwrap();
            (0..2).for_each(|i| near(shown[i], at[i], "where it is shown"));
        }
        // Drawn from its second end on, another line makes an angle there.
        let told = follow(&mut model, &Request::Measure { pane, from: to, to: then });
        let one = told.rulers.last().unwrap();
        let ([a, b], [c, d]) = (way(to, from), way(to, then));
        near(one.mm[1], c.hypot(d), "the other length");
        near(one.degrees.unwrap(), (a * d - b * c).abs().atan2(a * c + b * d).to_degrees(), "an angle");
        assert_eq!((told.rulers.len(), one.now.len()), (count + 1, 3));
        // From an end of what has an angle already another begins.
        let told = follow(&mut model, &Request::Measure { pane, from: then, to: from });
        let (two, three) = (&told.rulers[count], &told.rulers[count + 1]);
        assert_eq!(three.now[0], two.now[2]);
        follow(&mut model, &Request::Unmeasure { ruler: three.id });
    }
    let told = model.figures();
    let edits = model.session().steps().count();
    assert_eq!((edits, told.unsaved, told.rulers.len()), (0, true, 3), "it is no edit, and would be missed");
}

#[test]
fn lengths_between_places_are_those_of_the_world() {
    let mut model = oblique("");
    let [a, b, c] = [[25.0, -10.0, 50.0], [28.0, -6.0, 62.0], [28.0, -6.0, 70.0]];
    let one = ruler(&mut model, &[a, b]);
    assert_eq!((one.mm.as_slice(), one.now.as_slice()), (&[13.0][..], &[a, b][..]));
    let told = follow(&mut model, &Request::Ruler { ruler: Some(one.id), places: vec![a, b, c] });
    near(told.rulers[0].degrees.unwrap(), 180.0 - (12.0_f64 / 13.0).acos().to_degrees(), "an angle");
    let right = ruler(&mut model, &[[30.0, -12.0, 55.0], [30.0, -12.0, 58.0], [34.0, -12.0, 58.0]]);
    assert_eq!((right.mm.as_slice(), right.degrees), (&[3.0, 4.0][..], Some(90.0)));
    for places in [vec![], vec![a], vec![a; 4], vec![a, a], vec![a, [f64::NAN; 3]], vec![a, [1e7, 0.0, 0.0]]]
    {
        assert!(model.follow(&Request::Ruler { ruler: None, places }).is_err());
    }
    assert!(model.follow(&Request::Ruler { ruler: Some(9), places: vec![a, b] }).is_err());
    assert!(model.follow(&Request::Unmeasure { ruler: 9 }).is_err());
    for _ in 2..64 {
        ruler(&mut model, &[a, b]);
    }
    let refused = model.follow(&Request::Ruler { ruler: None, places: vec![a, b] }).unwrap_err();
    assert!(refused.to_string().contains("remove one first"), "{refused}");
}

#[test]
fn between_two_places_of_the_volume_it_is_measured_through_space() {
    let mut model = oblique("");
    follow(&mut model, &Request::Orbit { by: [0.13, 0.06] });
    let place = |model: &mut Model, at| {
        let hovered = follow(model, &Request::Hover { pane: Pane::Volume, at }).hovered;
        Vector3::from(hovered.unwrap().place)
    };
    let (from, to) = ([0.42, 0.45], [0.6, 0.58]);
    let [first, last] = [from, to].map(|at| place(&mut model, at));
    let told = follow(&mut model, &Request::Measure { pane: Pane::Volume, from, to });
    near(told.rulers[0].mm[0], (last - first).norm(), "a chord");
    // Both ends lie on the ball's skin.
    for end in &told.rulers[0].now {
        let away = (Vector3::from(*end) - Vector3::from(CENTRE)).norm();
        assert!((away - 10.0).abs() < 0.3, "{away}");
    }
    // From the other side the ball hides it, and again not.
    let far_side = [[30.0, -20.0, 55.0], [28.0, -18.0, 58.0]];
    for (side, hidden) in [(Side::Front, false), (Side::Back, true), (Side::Front, false)] {
        let told = follow(&mut model, &Request::Look { side });
        assert_eq!(told.rulers[0].beside[0], hidden, "{side:?}");
    }
    // Each by its own ends, however many handles and pins there are: one on the far side is hidden.
    follow(&mut model, &Request::Add { place: [30.0, -2.0, 55.0], by: [0.0; 3] });
    let within = ruler(&mut model, &far_side);
    let hidden = |told: &Figures| told.rulers.iter().map(|one| one.beside[0]).collect::<Vec<_>>();
    assert_eq!(hidden(&model.figures()), [false, true]);
    // Elsewhere along the line of sight it is seen where it was, and hidden no more.
    let before = far_side.map(|[x, _, z]| [x, 40.0, z]);
    let told = follow(&mut model, &Request::Ruler { ruler: Some(within.id), places: before.to_vec() });
    assert_eq!(hidden(&told), [false, false]);
    follow(&mut model, &Request::Unmeasure { ruler: within.id });
    for (from, to) in [([0.01; 2], to), (from, [0.01; 2]), (from, from)] {
        assert!(model.follow(&Request::Measure { pane: Pane::Volume, from, to }).is_err());
    }
    assert_eq!(model.figures().rulers.len(), 1);
}

/// A step in space that moves all within 5 mm of the middle by so much, and nothing beyond 10 mm.
const PUSH: &str = "[[space.step]]\nkind = \"translate\"\nby = [1.0, -0.5, 0.75]\ncentre = [30.0, -12.0, 55.0]\nradius = 10.0\ncore = 0.5\n";
const BY: [f64; 3] = [1.0, -0.5, 0.75];

#[test]
fn what_is_deformed_is_told_with_its_length_at_rest() {
    let mut model = oblique(PUSH);
    let far = [30.0, -12.0, 68.0];
    let centre = Vector3::from(CENTRE);
    let moved = centre + Vector3::from(BY);
    let one = ruler(&mut model, &[moved.into(), far]);
    assert_eq!(one.mm[0], (Vector3::from(far) - moved).norm());
    assert!((one.rest_mm[0] - 13.0).abs() < 1e-4, "{}", one.rest_mm[0]);
    // Within the core all goes alike.
    let inside = [1.0, 2.0, -1.5].map(|c| moved + Vector3::new(c, -0.3 * c, 0.5));
    let bent = ruler(&mut model, &inside.map(Into::into));
    for (now, rest) in bent.mm.iter().zip(&bent.rest_mm) {
        assert!((now - rest).abs() < 1e-4, "{now} and {rest}");
    }
    assert!((bent.degrees.unwrap() - bent.rest_degrees.unwrap()).abs() < 0.01);
    // What was measured goes with the body when that goes on, and is no step of it.
    let rest = follow(&mut model, &Request::Close { space: 0 });
    for (now, rest) in rest.rulers[0].now.iter().zip(&rest.rulers[0].rest) {
        (0..3).for_each(|a| near(now[a], rest[a], "a place"));
    }
    assert!((rest.rulers[0].mm[0] - 13.0).abs() < 1e-4);
    let again = follow(&mut model, &Request::Undo);
    assert!((again.rulers[0].mm[0] - one.mm[0]).abs() < 1e-4 && again.rulers.len() == 2);
    assert_eq!((again.undo.as_deref(), model.session().steps().count()), (Some("measure"), 0));
    // Shown at rest it is measured at rest.
    let told = follow(&mut model, &Request::Compare { shows: Shows::Rest, at: 0.5 });
    let shown = told.rulers[0].at[0][1].unwrap();
    let there = follow(&mut model, &Request::Measure { pane: Pane::Axial, from: [0.2, 0.3], to: [0.7, 0.6] });
    let last = there.rulers.last().unwrap();
    near(last.rest_mm[0], 15.0_f64.hypot(9.0), "at rest");
    assert!((last.mm[0] - last.rest_mm[0]).abs() > 0.05, "{}", last.mm[0]);
    let now = follow(&mut model, &Request::Compare { shows: Shows::Both, at: 0.5 });
    assert_ne!(now.rulers[0].at[0][1].unwrap(), shown);
    let beside = Request::Measure { pane: Pane::Axial, from: [0.2, 0.3], to: [0.7, 0.6] };
    assert!(model.follow(&beside).unwrap_err().to_string().contains("at rest"));
    follow(&mut model, &Request::Compare { shows: Shows::Now, at: 0.5 });
}

#[test]
fn what_a_pipeline_makes_has_nothing_of_a_ruler() {
    let mut model = model(BALL);
    follow(&mut model, &Request::Measure { pane: Pane::Axial, from: [0.3; 2], to: [0.6; 2] });
    assert_as_piped(&model);
}
