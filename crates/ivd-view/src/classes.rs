//! Classes of the transfer function: hidden, recoloured, made translucent.

use egui::{Slider, Ui};
use ivd_frames::{Class, Figures, Request};

use crate::window::Window;

impl Window {
    /// Shows a row for each class.
    pub(crate) fn classes(&mut self, ui: &mut Ui, figures: &Figures) {
        if figures.classes.is_empty() {
            return;
        }
        ui.heading("Classes");
        for class in &figures.classes {
            ui.horizontal(|ui| self.class(ui, class));
        }
    }

    fn class(&mut self, ui: &mut Ui, class: &Class) {
        let Class { id, values: [low, high], hidden, opacity, colour } = class;
        let mut is_seen = !hidden;
        let seen = ui.checkbox(&mut is_seen, format!("Class {id}"));
        let seen = seen.on_hover_text(format!("values {low:.4} to {high:.4}"));
        let before = bytes(colour);
        let mut rgb = before;
        let coloured = ui.color_edit_button_srgb(&mut rgb).accessible_name(format!("Colour of class {id}"));
        let mut share = *opacity;
        let slider = Slider::new(&mut share, 0.0..=1.0).show_value(false);
        let slid = ui.add_enabled(is_seen, slider).accessible_name(format!("Opacity of class {id}"));
        let slid = slid.on_hover_text(format!("opacity {opacity:.3}"));
        if seen.changed() || coloured.changed() || slid.changed() {
            let [red, green, blue] = rgb;
            let colour =
                if rgb == before { colour.clone() } else { format!("#{red:02x}{green:02x}{blue:02x}") };
            self.ask(Request::Class {
                class: *id,
                hidden: !is_seen,
                opacity: Some(share),
                colour: Some(colour),
            });
        }
    }
}

/// The bytes of `#rrggbb`; black for what is none.
fn bytes(colour: &str) -> [u8; 3] {
    let byte = |at: usize| colour.get(at..at + 2).and_then(|hex| u8::from_str_radix(hex, 16).ok());
    [1, 3, 5].map(|at| byte(at).unwrap_or(0))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn colours_are_bytes() {
        assert_eq!(bytes("#ff8800"), [255, 136, 0]);
        assert_eq!(bytes("none"), [0, 0, 0]);
    }
}
