//! Planes and boxes that clip.

use egui::Ui;
use ivd_frames::{ClipPart, Cuboid, Figures, HalfSpace, Lies, Pane, Request};

use crate::handles::length;
use crate::number::number;
use crate::over::name;
use crate::side::{Scale, list, slider};
use crate::window::Window;

/// By how much a field changes when the pointer is dragged over it by a point (mm).
const SPEED: f64 = 0.25;
/// How planes and boxes differ from looking inside.
const TAKEN: &str = "These cut slices too, and exports on request:";
/// Where planes and boxes lie.
const STAY: &str =
    "Whether planes and boxes stay where they are as the body moves under them, or move with it";
/// What lies at both ends of the patient's axes.
const SIDES: [[&str; 2]; 3] = [["left", "right"], ["back", "front"], ["lower part", "upper part"]];
/// The same where a scan doesn't say how it lies in a patient.
const ENDS: [[&str; 2]; 3] = [
    ["side of smaller x", "side of greater x"],
    ["side of smaller y", "side of greater y"],
    ["side of smaller z", "side of greater z"],
];
/// Where they go; no wider than the panel.
const WAYS: [&str; 3] = ["mm, left to right", "mm, back to front", "mm, feet to head"];

/// The side of the middle on which a plane's place is above 0, by the axis that it crosses most: of the patient.
const PATIENT: [&str; 3] = ["right", "front", "up"];
/// The same where a scan doesn't say how it lies in a patient.
const AXES: [&str; 3] = ["x", "y", "z"];

impl Window {
    /// Shows what clips.
    pub(crate) fn clips(&mut self, ui: &mut Ui, figures: &Figures) {
        ui.heading("Clip");
        self.look_inside(ui, figures);
        ui.weak(TAKEN);
        ui.horizontal(|ui| {
            let menu = ui.menu_button("Clip by a plane …", |ui| self.clip_here(ui)).response;
            menu.accessible_name("Clip by a plane").on_hover_text(
                "A plane through the place where the slices meet; what lies on your side goes",
            );
            if ui.button("Keep a box").on_hover_text("What lies outside a box goes").clicked() {
                let [min, max] = figures.extent;
                self.ask(Request::ClipBox { min, max });
            }
        });
        if figures.clips.is_empty() {
            return;
        }
        self.clip_in(ui, figures);
        for one in &figures.clips {
            match self.pending.clip(one.id, one.part) {
                ClipPart::Plane(plane) => self.plane(ui, figures, one.id, &plane),
                ClipPart::Box(cuboid) => self.cuboid(ui, one.id, figures, &cuboid),
            }
        }
    }

    fn clip_here(&mut self, ui: &mut Ui) {
        for along in Pane::ALL {
            let words = match along {
                Pane::Volume => "Plane facing me".to_owned(),
                slice => format!("Plane along the {} slice", name(slice).to_lowercase()),
            };
            if ui.button(words).clicked() {
                self.ask(Request::ClipHere { along });
                ui.close();
            }
        }
    }

    /// Where planes and boxes lie.
    fn clip_in(&mut self, ui: &mut Ui, figures: &Figures) {
        let word = |space| match space {
            Lies::Deformed => "stand still",
            Lies::Rest => "go with the body",
        };
        let now = figures.clip_space;
        let all = [Lies::Deformed, Lies::Rest].map(|space| (space, word(space)));
        if let Some(space) = list(ui, ["Planes and boxes", STAY], (Some(now), word(now)), all) {
            self.ask(Request::ClipIn { space });
        }
    }

    fn plane(&mut self, ui: &mut Ui, figures: &Figures, id: u32, plane: &HalfSpace) {
        let normal = unit(plane.normal);
        let [low, high] = figures.extent;
        let middle: [f64; 3] = std::array::from_fn(|a| f64::midpoint(low[a], high[a]));
        let half: f64 = (0..3).map(|a| 0.5 * (high[a] - low[a]) * normal[a].abs()).sum();
        // Counted along the axis that it crosses, whichever side is kept.
        let axis = (0..3).fold(0, |best, a| if normal[a].abs() > normal[best].abs() { a } else { best });
        let way = normal[axis].signum();
        let there: f64 = (0..3).map(|a| (plane.point[a] - middle[a]) * way * normal[a]).sum();
        let sides = if figures.letters.is_some() { PATIENT } else { AXES };
        let words = format!("mm from the scan's middle, + is {}", sides[axis]);
        ui.strong(format!("Plane {id} keeps the {}", side(normal, figures.letters.is_some())));
        let full = format!("Plane {id}");
        let mut at = self.value(&full, there);
        for response in slider(ui, &full, &words, &mut at, -half..=half, Scale::Even) {
            let point = std::array::from_fn(|a| plane.point[a] + (at - there) * way * normal[a]);
            let part = ClipPart::Plane(HalfSpace { point, ..*plane });
            self.turned(&response, (&full, at), || Request::MoveClip { clip: id, part });
        }
        ui.horizontal(|ui| {
            let other = ui.button("Other side").accessible_name(format!("Other side of plane {id}"));
            if other.on_hover_text("What was kept goes, and what went is kept").clicked() {
                let part = ClipPart::Plane(HalfSpace { normal: plane.normal.map(|c| -c), ..*plane });
                self.ask(Request::MoveClip { clip: id, part });
            }
            self.take_away(ui, id, "plane");
        });
    }

    fn cuboid(&mut self, ui: &mut Ui, id: u32, figures: &Figures, cuboid: &Cuboid) {
        ui.strong(format!("Box {id} keeps what lies in it"));
        for (a, axis) in AXES.into_iter().enumerate() {
            ui.horizontal(|ui| {
                for (end, word) in ["from", "to"].into_iter().enumerate() {
                    ui.weak(if end == 0 { format!("{axis} {word}") } else { word.to_owned() });
                    let full = format!("Box {id}: {axis} {word}, mm");
                    let mut ends = [cuboid.min[a], cuboid.max[a]];
                    // No end goes beyond the other.
                    let range = if end == 0 { -1e6..=ends[1] } else { ends[0]..=1e6 };
                    ends[end] = self.value(&full, ends[end]);
                    let field = number(ui, &full, &mut ends[end], 1, |field| field.speed(SPEED).range(range));
                    let mut moved = *cuboid;
                    (moved.min[a], moved.max[a]) = (ends[0], ends[1]);
                    let part = ClipPart::Box(moved);
                    self.turned(&field, (&full, ends[end]), || Request::MoveClip { clip: id, part });
                }
                ui.weak(if figures.letters.is_some() { WAYS[a] } else { "mm" });
            });
        }
        ui.horizontal(|ui| self.take_away(ui, id, "box"));
    }

    fn take_away(&mut self, ui: &mut Ui, id: u32, what: &str) {
        let away = ui.button("Take away").accessible_name(format!("Take {what} {id} away"));
        if away.on_hover_text("What it takes away is there again").clicked() {
            self.ask(Request::Unclip { clip: id });
        }
    }
}

fn unit(way: [f64; 3]) -> [f64; 3] {
    way.map(|c| c / length(way).max(f64::MIN_POSITIVE))
}

/// The side that a direction goes to most: of the patient, where it is known how they lie.
fn side(way: [f64; 3], is_patient: bool) -> &'static str {
    let axis = (0..3).fold(0, |best, a| if way[a].abs() > way[best].abs() + 1e-9 { a } else { best });
    let words = if is_patient { SIDES } else { ENDS };
    words[axis][usize::from(way[axis] > 0.0)]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sides_are_the_patients() {
        assert_eq!([true, false].map(|known| side([0.9, -0.2, 0.1], known)), ["right", "side of greater x"]);
        assert_eq!([side([0.0, -1.0, 0.5], true), side([0.0, 0.1, -0.5], true)], ["back", "lower part"]);
        assert_eq!(unit([0.0, 3.0, 4.0]), [0.0, 0.6, 0.8]);
    }
}
