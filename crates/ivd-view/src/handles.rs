//! Handles and pins as a list: what a pointer does, by keyboard.

use egui::{Button, DragValue, Grid, TextEdit, Ui};
use ivd_frames::{Figures, Pane, Request, Spot};

use crate::gestures::go_to;
use crate::window::Window;

/// The axes, ...
const AXES: [&str; 3] = ["x", "y", "z"];
/// ... and the sides of the patient that they go to, in a letter and in words.
const SIDES: [(&str, &str); 3] = [
    ("R", "to the right; less than 0: to the left"),
    ("A", "to the front; less than 0: to the back"),
    ("S", "to the head; less than 0: to the feet"),
];
/// By how much a field changes when the pointer is dragged over it by a point (mm, mN).
const SPEED: f64 = 0.1;

impl Window {
    /// Shows the list.
    pub(crate) fn handles(&mut self, ui: &mut Ui, figures: &Figures) {
        ui.heading("Handles");
        self.new_handle(ui, figures);
        if !figures.handles.is_empty() {
            ui.weak("moved by, and reach (mm):");
        }
        Grid::new("handles").num_columns(6).show(ui, |ui| {
            if !figures.handles.is_empty() {
                ui.weak("");
                ui.weak("");
                for (axis, (side, way)) in AXES.into_iter().zip(SIDES) {
                    if figures.letters.is_some() {
                        ui.weak(format!("{axis} ({side})")).on_hover_text(way);
                    } else {
                        ui.weak(axis);
                    }
                }
                ui.weak("reach");
                ui.end_row();
            }
            for one in &figures.handles {
                self.handle(ui, figures, one);
                ui.end_row();
            }
        });
        for pin in &figures.pins {
            ui.horizontal(|ui| {
                if ui.button(format!("Pin {}", pin.id)).on_hover_text("The slices go there").clicked() {
                    self.ask_all(go_to(pin));
                }
                ui.weak(format!("{:.1} mm about {}", pin.radius, place(pin.rest)));
                let release = ui.button("×").accessible_name(format!("Release pin {}", pin.id));
                if release.on_hover_text("Release it").clicked() {
                    self.ask(Request::Release { fix: pin.id });
                }
            });
        }
    }

    /// A handle more, at a place that is typed or where the slices meet.
    fn new_handle(&mut self, ui: &mut Ui, figures: &Figures) {
        ui.horizontal(|ui| {
            ui.label("place (mm)");
            let field = TextEdit::singleline(&mut self.place).hint_text("x, y, z").desired_width(110.0);
            let field = ui.add(field).accessible_name("Place of a new handle, at rest, mm");
            let entered = field.lost_focus() && ui.input(|input| input.key_pressed(egui::Key::Enter));
            if ui.button("Add").on_hover_text("A handle at that place").clicked() || entered {
                match read(&self.place) {
                    Some(place) => self.ask(Request::Add { place, by: [0.0; 3] }),
                    None => {
                        self.complain("A place is three numbers, x, y, z, in mm: 10, -4.5, 32.".to_owned());
                    }
                }
            }
        });
        ui.horizontal(|ui| {
            ui.weak("Where the slices meet:");
            let add = ui.add(Button::new("Handle")).accessible_name("Handle where the slices meet");
            if add.on_hover_text("A handle at the lattice's nearest vertex").clicked() {
                self.ask(Request::Add { place: figures.cross, by: [0.0; 3] });
            }
            let pin = ui.add(Button::new("Pin")).accessible_name("Pin where the slices meet");
            if pin.on_hover_text("What is there stays").clicked()
                && let Some(at) = figures.cross_at[Pane::Axial.number()]
            {
                self.ask(Request::Pin { pane: Pane::Axial, at });
            }
        });
    }

    /// A row: the handle, how far it moves or with what force it pulls, and how to be rid of it.
    fn handle(&mut self, ui: &mut Ui, figures: &Figures, one: &Spot) {
        let id = one.id;
        let held = figures.held == Some(id);
        let go =
            ui.add(Button::new(id.to_string()).selected(held)).accessible_name(format!("Go to handle {id}"));
        if go.on_hover_text(format!("At {} mm; the slices go there", place(one.now))).clicked() {
            self.ask_all(go_to(one));
        }
        let remove = ui.button("×").accessible_name(format!("Remove handle {id}"));
        if remove.on_hover_text("Remove it").clicked() {
            self.ask(Request::Remove { handle: id });
        }
        let pulls = one.with.is_some();
        let unit = if pulls { "mN" } else { "mm from rest" };
        let mut told = one.with.or(one.by).unwrap_or_default();
        for (axis, name) in AXES.into_iter().enumerate() {
            let full = format!("Handle {id}: {name}, {unit}");
            told[axis] = self.value(&full, told[axis]);
            let field = DragValue::new(&mut told[axis]).speed(SPEED).max_decimals(2).range(-1e6..=1e6);
            let field = if pulls { field.suffix(" mN") } else { field };
            let field = ui.add(field.update_while_editing(false));
            let field = field.accessible_name(full.clone());
            self.turned(&field, (&full, told[axis]), || {
                if pulls {
                    Request::Pull { handle: id, with: told }
                } else {
                    Request::Move { handle: id, by: told }
                }
            });
        }
        let full = format!("Handle {id}: radius, mm");
        let mut radius = self.value(&full, one.radius);
        let field = DragValue::new(&mut radius).speed(SPEED).max_decimals(1).range(1e-3..=1e6);
        let field = ui.add(field.update_while_editing(false)).accessible_name(full.clone());
        self.turned(&field, (&full, radius), || Request::Radius { handle: Some(id), radius });
    }
}

/// A place, as it is read.
pub(crate) fn place(at: [f64; 3]) -> String {
    at.map(|c| format!("{c:.1}")).join(", ")
}

/// Three numbers with commas or spaces between them.
fn read(text: &str) -> Option<[f64; 3]> {
    let words = text.split([',', ' ', ';']).filter(|word| !word.is_empty());
    let numbers: Option<Vec<f64>> = words.map(|word| word.parse().ok()).collect();
    <[f64; 3]>::try_from(numbers?).ok().filter(|place| place.iter().all(|c| c.is_finite()))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_place_is_three_numbers() {
        assert_eq!(read("1, -2.5,3"), Some([1.0, -2.5, 3.0]));
        assert_eq!(read("1 2 3"), Some([1.0, 2.0, 3.0]));
        for bad in ["", "1, 2", "1,2,3,4", "a, b, c", "1, 2, inf"] {
            assert_eq!(read(bad), None, "{bad}");
        }
    }
}
