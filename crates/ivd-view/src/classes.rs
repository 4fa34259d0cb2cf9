//! Classes of the transfer function: hidden, recoloured, made translucent.

use egui::{Button, Label, RichText, Slider, Ui};
use ivd_frames::{Class, Figures, Request, SolverName};

use crate::window::Window;

/// What classes are.
const ABOUT: &str = "Voxels with similar values, or those to which a file of labels gives one label. Here stand the values and the volume of each; the one under the pointer is underlined, and Colours over slices can show where each lies";

/// Less of the surface isn't told.
const LEAST_TOLD: f64 = 0.005;

/// What the numbers of a class are.
const ALONG: &str = "Its volume, its values, and how much of the surface that is moved is made of it: of a head the class with most of it is what lies at the skin";

/// What springs change.
const BY_SPRINGS: &str = "By distance alone the surface is equally stiff everywhere. By springs each class has a stiffness of its own, and a press squeezes more, right at the handle. To go back, choose \"distance alone\" under \"Surface follows by\"";

/// Where stiffness changes something.
const SHOWS: &str =
    "Stiffness matters where two of them lie within a handle's reach, or where a handle pulls with a force.";

/// What a transition is.
const BETWEEN: &str = "Voxels where one kind of matter passes into another: their values are a mixture of both, and no matter of their own";

impl Window {
    /// Shows a row for each class.
    pub(crate) fn classes(&mut self, ui: &mut Ui, figures: &Figures) {
        if figures.classes.is_empty() && figures.matter.is_empty() {
            return;
        }
        ui.heading("Classes").on_hover_text(ABOUT);
        if !figures.classes.is_empty() {
            ui.weak("drawn, colour, opacity, volume, values, share of the surface");
            ui.horizontal(|ui| self.all_classes(ui, figures));
        }
        if !figures.matter.is_empty() {
            ui.weak(SHOWS);
        }
        if figures.solver == "ring" && figures.knows_classes {
            ui.horizontal(|ui| {
                ui.weak("stiffness of each:");
                if ui.button("Follow by springs").on_hover_text(BY_SPRINGS).clicked() {
                    self.ask(Request::Solver { solver: SolverName::Springs });
                }
            });
        }
        let pointed = self.shown.hovered().filter(|_| self.pointed).and_then(|hovered| hovered.class);
        // Of a part its surface isn't the outermost.
        let is_body = figures.made.is_body || figures.made.is_above();
        for class in &figures.classes {
            ui.horizontal(|ui| self.class(ui, class, pointed == Some(class.id), is_body));
            self.matter_of(ui, figures, class.id);
        }
        if !figures.transitions.is_empty() {
            let ids: Vec<String> = figures.transitions.iter().map(u16::to_string).collect();
            let known = figures.classes.iter().map(|class| class.of_surface).sum::<Option<f64>>();
            let rest = known.map(|known| 1.0 - known).filter(|rest| *rest >= LEAST_TOLD);
            let rest =
                rest.map_or_else(String::new, |rest| format!("; {:.0} % of the surface", 100.0 * rest));
            let text = format!("Class {}: between others, and drawn as they are{rest}", ids.join(", "));
            ui.weak(text).on_hover_text(BETWEEN);
        }
        self.matter_of_others(ui, figures);
    }

    /// Buttons to show all classes and none, of which few are shown then.
    fn all_classes(&mut self, ui: &mut Ui, figures: &Figures) {
        for (text, name, hidden) in [("All", "Show all classes", false), ("None", "Hide all classes", true)] {
            let changes = figures.classes.iter().any(|class| class.hidden != hidden);
            let button = ui.add_enabled(changes, Button::new(text)).accessible_name(name);
            if button.on_hover_text(name).clicked() {
                self.ask(Request::AllClasses { hidden });
            }
        }
    }

    fn class(&mut self, ui: &mut Ui, class: &Class, is_pointed: bool, is_body: bool) {
        let Class { id, name, ml, of_surface, values: [low, high], hidden, opacity, colour } = class;
        ui.spacing_mut().slider_width = 44.0;
        ui.spacing_mut().item_spacing.x = 5.0;
        let mut is_seen = !hidden;
        let text = RichText::new(format!("Class {id}"));
        let seen = ui.checkbox(&mut is_seen, if is_pointed { text.strong().underline() } else { text });
        let seen = seen.on_hover_text(format!("values {low:.4} to {high:.4}"));
        let before = bytes(colour);
        let mut rgb = before;
        let coloured = ui.color_edit_button_srgb(&mut rgb).accessible_name(format!("Colour of class {id}"));
        let mut share = *opacity;
        let slider = Slider::new(&mut share, 0.0..=1.0).show_value(false);
        let slid = ui.add_enabled(is_seen, slider).accessible_name(format!("Opacity of class {id}"));
        let slid = slid.on_hover_text(format!("opacity {opacity:.3}"));
        let much = ml.map_or_else(String::new, |ml| format!("{} ml, ", rounded(ml)));
        let named = name.as_ref().map_or_else(String::new, |name| format!("{name}: "));
        let along = of_surface.filter(|share| *share >= LEAST_TOLD);
        let along = along.map_or_else(String::new, |share| {
            let outermost = if is_body && share > 0.5 { "outermost, " } else { "" };
            format!(", {outermost}{:.0} % of the surface", 100.0 * share)
        });
        let told = format!("{named}{much}{low:.0} to {high:.0}{along}");
        ui.add(Label::new(RichText::new(told).weak()).wrap()).on_hover_text(ALONG);
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

/// A volume with three digits.
fn rounded(ml: f64) -> String {
    let digits = (2.0 - ml.max(0.01).log10().floor()).clamp(0.0, 2.0) as usize;
    format!("{ml:.digits$}")
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
    fn volumes_have_three_digits_at_most_two_after_the_point() {
        assert_eq!([1234.5, 56.78, 3.456, 0.012, 0.0].map(rounded), ["1234", "56.8", "3.46", "0.01", "0.00"]);
    }

    #[test]
    fn colours_are_bytes() {
        assert_eq!(bytes("#ff8800"), [255, 136, 0]);
        assert_eq!(bytes("none"), [0, 0, 0]);
    }
}
