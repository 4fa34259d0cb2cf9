//! Which surface is taken hold of where one is seen through another.

use ivd_core::{Grid, Volume, Voxels};
use ivd_frames::{Axis, Pane, Request};
use nalgebra::Vector3;

use super::scans::model_of;

const MIDDLE: f64 = 23.5;

#[test]
fn of_a_body_that_is_seen_through_it_is_the_skin_that_is_taken_and_pressed_in() {
    // A thin skin from 19 to 21 mm, a gap, and a ball that is brighter and more opaque: all of it is the part.
    let grid = Grid::with_spacing([48; 3], [1.0; 3]).unwrap();
    let value = |i: usize| {
        let from = Vector3::from(grid.index(i).0.map(|c| c as f64 - MIDDLE));
        let away = from.norm();
        let skin = (100.0 + 60.0 * (away - 19.0).min(21.0 - away)).clamp(0.0, 110.0);
        let ball = (200.0 + 60.0 * (15.0 - away)).clamp(0.0, 220.0);
        // They are joined at the back.
        let joined = from.y < 0.0 && from.x.hypot(from.z) < 4.0 && away < 20.0;
        if joined { 220 } else { skin.max(ball) as u8 }
    };
    let voxels: Vec<u8> = (0..grid.len()).map(value).collect();
    let volume = Volume::new(grid, Voxels::from(voxels)).unwrap();
    let text = r#"
schema = 1
[input]
file = "scan.nrrd"
[segment]
k = 3
[boundary]
above = 60
[refine]
level = 1
[render]
view = "front"
[output]
images = ["before"]
"#;
    let mut model = model_of(volume, text);
    let dim = |class, opacity| Request::Class { class, hidden: false, opacity: Some(opacity), colour: None };
    let classes = model.figures().classes;
    let by_value = |n: usize| classes[n].id;
    model.follow(&dim(by_value(classes.len() - 2), 0.04)).unwrap();
    model.follow(&dim(by_value(classes.len() - 1), 0.9)).unwrap();
    let radius = |place: [f64; 3]| (Vector3::from(place) - Vector3::repeat(MIDDLE)).norm();
    for at in [[0.5, 0.5], [0.42, 0.5], [0.5, 0.58], [0.57, 0.45]] {
        model.follow(&Request::Hover { pane: Pane::Volume, at }).unwrap();
        let hovered = model.figures().hovered.unwrap();
        assert!(
            radius(hovered.place) < 17.0,
            "what is seen is the ball: {hovered:?}, {:?}",
            model.figures().classes
        );
        assert!(radius(hovered.vertex.unwrap()) > 20.0, "{at:?} means {:?}", hovered.vertex);
        model.follow(&Request::Grab { pane: Pane::Volume, at }).unwrap();
        let held = model.figures().handles[0].clone();
        assert_eq!(Some(held.rest), hovered.vertex);
        let out = Vector3::from(held.out.unwrap());
        assert!(out.dot(&(Vector3::from(held.rest) - Vector3::repeat(MIDDLE)).normalize()) > 0.9, "{out}");
        // Up presses in where it faces who sees it.
        model.follow(&Request::Drag { to: [at[0], at[1] - 0.02], lock: Some(Axis::N) }).unwrap();
        let by = Vector3::from(model.figures().handles[0].by.unwrap());
        assert!(by.dot(&out) < -0.5, "{at:?}: {by}");
        model.follow(&Request::Abandon).unwrap();
    }
}
