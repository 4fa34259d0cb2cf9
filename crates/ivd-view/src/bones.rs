//! Bones as a list: how far each is turned, and how far it goes.

use egui::{DragValue, Grid, Ui};
use ivd_frames::{Bone, Figures, Request};

use crate::window::Window;

/// By how much a field changes when the pointer is dragged over it by a point (degrees, mm).
const SPEED: f64 = 0.1;

impl Window {
    /// Shows the list, where there are any.
    pub(crate) fn bones(&mut self, ui: &mut Ui, figures: &Figures) {
        if figures.bones.is_empty() {
            return;
        }
        ui.heading("Bones");
        Grid::new("bones").num_columns(5).show(ui, |ui| {
            for word in ["", "turn (°)", "x (mm)", "y (mm)", "z (mm)"] {
                ui.weak(word);
            }
            ui.end_row();
            for bone in &figures.bones {
                self.bone(ui, &self.pending.bone(bone));
                ui.end_row();
            }
        });
        ui.separator();
    }

    /// A row: degrees about the bone's axis, and mm along the patient's axes.
    fn bone(&mut self, ui: &mut Ui, bone: &Bone) {
        let Bone { id, name, pivot, axis, angle, by, .. } = bone;
        let Some(pivot) = pivot else {
            ui.label(format!("Bone {name}"));
            ui.weak("give it a pivot in the scene");
            return;
        };
        let about = format!(
            "turns about {} along {}",
            pivot.map(|c| format!("{c:.1}")).join(", "),
            axis.map(|c| format!("{c:.2}")).join(", ")
        );
        ui.label(format!("Bone {name}")).on_hover_text(about);
        if bone.fitted {
            ui.weak("with its handles");
            return;
        }
        let turn = |angle, by| Request::Turn { bone: *id, pivot: *pivot, axis: *axis, angle, by };
        let full = format!("Bone {name}: turn, degrees");
        let mut turned = self.value(&full, *angle);
        let field = DragValue::new(&mut turned).speed(SPEED).max_decimals(1).range(-1e6..=1e6).suffix("°");
        let field = ui.add(field.update_while_editing(false)).accessible_name(full.clone());
        self.turned(&field, (&full, turned), || turn(turned, *by));
        if bone.carried {
            return;
        }
        let mut gone = *by;
        for (a, along) in ["x", "y", "z"].into_iter().enumerate() {
            let full = format!("Bone {name}: {along}, mm from rest");
            gone[a] = self.value(&full, gone[a]);
            let field = DragValue::new(&mut gone[a]).speed(SPEED).max_decimals(2).range(-1e6..=1e6);
            let field = ui.add(field.update_while_editing(false)).accessible_name(full.clone());
            self.turned(&field, (&full, gone[a]), || turn(*angle, gone));
        }
    }
}
