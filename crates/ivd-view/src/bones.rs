//! Bones as a list: what each holds, how far it is turned, and how far it goes.

use egui::{ComboBox, Grid, Ui};
use ivd_frames::{Bone, Figures, Request, Tool};

use crate::handles::place;
use crate::number::number;
use crate::rulers::two_places;
use crate::window::Window;

/// By how much a field changes when the pointer is dragged over it by a point (degrees, mm).
const SPEED: f64 = 0.1;
/// What distance alone can't.
const DISTANCE: &str = "Distance alone knows no bones: let the surface follow by springs.";
/// How one is made.
const DRAW: &str = "With the tool Bone draw a line along it, from its joint on. What of the surface lies round it moves as one, and what is within reach of that follows.";
/// What a bone may turn about.
const AXES: [(&str, [f64; 3]); 3] =
    [("left–right", [1.0, 0.0, 0.0]), ("back–front", [0.0, 1.0, 0.0]), ("feet–head", [0.0, 0.0, 1.0])];

impl Window {
    /// Shows the list, where there are any or may be.
    pub(crate) fn bones(&mut self, ui: &mut Ui, figures: &Figures) {
        if figures.bones.is_empty() && self.tool != Tool::Bone {
            return;
        }
        ui.heading("Bones").on_hover_text(DRAW);
        if figures.solver == "ring" {
            ui.weak(DISTANCE);
        } else if self.tool == Tool::Bone {
            let places = two_places(ui, "Bone", &mut self.bone_from, figures.cross);
            if let Some([from, to]) = places {
                self.ask(Request::Bone { from, to });
            }
        }
        for bone in &figures.bones {
            self.bone(ui, &self.pending.bone(bone));
        }
        ui.separator();
    }

    fn bone(&mut self, ui: &mut Ui, bone: &Bone) {
        let Bone { id, name, pivot, .. } = bone;
        ui.horizontal(|ui| {
            ui.label(format!("Bone {name}"));
            if bone.carried {
                ui.weak("is carried by another");
            } else if bone.fitted {
                ui.weak("goes with its handles");
            }
            let remove = ui.button("×").accessible_name(format!("Remove bone {name}"));
            if remove.on_hover_text("Make it soft again").clicked() {
                self.ask(Request::RemoveBone { bone: *id });
            }
        });
        self.holds(ui, bone);
        match pivot {
            Some(pivot) if !bone.fitted => self.motion_of(ui, bone, *pivot),
            Some(_) => {}
            None => _ = ui.weak("to turn it, give it a pivot in the scene"),
        }
    }

    /// What it holds, where that goes by a radius.
    fn holds(&mut self, ui: &mut Ui, bone: &Bone) {
        let Bone { id, name, radius: Some(radius), reach, .. } = bone else { return };
        ui.horizontal(|ui| {
            let set = |radius, reach| Request::SetBone { bone: *id, radius, reach };
            ui.weak("holds");
            let full = format!("Bone {name}: holds within, mm");
            let held = self.length(ui, &full, *radius, 1e-3);
            self.turned(&held.1, (&full, held.0), || set(held.0, *reach));
            ui.weak("mm, reaches");
            let full = format!("Bone {name}: reaches, mm");
            let reached = self.length(ui, &full, *reach, 0.0);
            self.turned(&reached.1, (&full, reached.0), || set(*radius, reached.0));
            ui.weak("mm");
        });
    }

    fn length(&self, ui: &mut Ui, full: &str, shown: f64, least: f64) -> (f64, egui::Response) {
        let mut value = self.value(full, shown);
        let field = number(ui, full, &mut value, 1, |field| field.speed(SPEED).range(least..=1e6));
        (value, field)
    }

    /// How far it is turned about its joint, and how far that goes.
    fn motion_of(&mut self, ui: &mut Ui, bone: &Bone, pivot: [f64; 3]) {
        let Bone { id, name, axis, angle, by, carried, .. } = bone;
        let turn = |pivot, axis, angle, by| Request::Turn { bone: *id, pivot, axis, angle, by };
        Grid::new(("bone", id)).num_columns(4).show(ui, |ui| {
            let full = format!("Bone {name}: turn, degrees");
            let mut turned = self.value(&full, *angle);
            let field =
                number(ui, &full, &mut turned, 1, |field| field.speed(SPEED).range(-1e6..=1e6).suffix("°"));
            let about =
                format!("about {} mm along {}", place(pivot), axis.map(|c| format!("{c:.2}")).join(", "));
            let field = field.on_hover_text(about);
            self.turned(&field, (&full, turned), || turn(pivot, *axis, turned, *by));
            if *carried {
                return;
            }
            let mut gone = *by;
            for (a, along) in ["x", "y", "z"].into_iter().enumerate() {
                let full = format!("Bone {name}: {along}, mm from rest");
                gone[a] = self.value(&full, gone[a]);
                let field = number(ui, &full, &mut gone[a], 2, |field| {
                    field.speed(SPEED).range(-1e6..=1e6).prefix(format!("{along} ")).suffix(" mm")
                });
                self.turned(&field, (&full, gone[a]), || turn(pivot, *axis, *angle, gone));
            }
        });
        ui.horizontal(|ui| {
            let word = AXES.iter().find(|(_, along)| along == axis).map_or("as drawn", |(word, _)| word);
            let choice = ComboBox::from_id_salt(("axis", id)).selected_text(word).show_ui(ui, |ui| {
                for (word, along) in AXES {
                    if ui.selectable_label(along == *axis, word).clicked() {
                        self.ask(turn(pivot, along, *angle, *by));
                    }
                }
            });
            choice.response.accessible_name(format!("Bone {name}: turns about"));
            let joint =
                ui.button("Joint here").accessible_name(format!("Bone {name}: joint where the slices meet"));
            if joint.on_hover_text("It turns about where the slices meet").clicked() {
                self.ask(Request::Joint { bone: *id });
            }
        });
    }
}
