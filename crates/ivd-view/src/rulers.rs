//! What is measured, as a list.

use egui::Ui;
use ivd_frames::{Figures, Request, Ruler, Shows, Tool};

use crate::handles::place;
use crate::window::Window;

/// What a ruler can't say.
const WITH: &str = "Rulers go with the body. They edit nothing; scenes keep them.";

impl Window {
    /// Shows the list, while something is measured or may be.
    pub(crate) fn rulers(&mut self, ui: &mut Ui, figures: &Figures) {
        if figures.rulers.is_empty() && self.tool != Tool::Measure {
            return;
        }
        ui.heading("Rulers").on_hover_text(WITH);
        let places = two_places(ui, "Ruler", &mut self.ruler_from, figures.cross);
        if let Some(places) = places {
            self.ask(Request::Ruler { ruler: None, places: places.to_vec() });
        }
        for ruler in &figures.rulers {
            self.ruler(ui, figures, ruler);
        }
        ui.separator();
    }

    fn ruler(&mut self, ui: &mut Ui, figures: &Figures, ruler: &Ruler) {
        let id = ruler.id;
        let places = if is_rest(figures) { &ruler.rest } else { &ruler.now };
        ui.horizontal_wrapped(|ui| {
            let lengths: Vec<String> = (0..ruler.mm.len()).map(|leg| mm(figures, ruler, leg)).collect();
            let told = [lengths.join(" and "), degrees(figures, ruler).unwrap_or_default()];
            ui.label(format!("Ruler {id}: {}", told.join(" ").trim_end()));
            if let [first, second] = places[..] {
                let angle = ui.button("Angle").accessible_name(format!("Angle of ruler {id}"));
                if angle.on_hover_text("At its second end, to where the slices meet").clicked() {
                    let places = vec![first, second, figures.cross];
                    self.ask(Request::Ruler { ruler: Some(id), places });
                }
            }
            let remove = ui.button("×").accessible_name(format!("Remove ruler {id}"));
            if remove.on_hover_text("Remove it").clicked() {
                self.ask(Request::Unmeasure { ruler: id });
            }
        });
        let places: Vec<String> = places.iter().map(|at| place(*at)).collect();
        ui.weak(format!("{} mm", places.join(" – ")));
    }
}

/// Two places without a pointer, for what is called so: where the slices meet, and where they meet then.
pub(crate) fn two_places(
    ui: &mut Ui,
    word: &str,
    begun: &mut Option<[f64; 3]>,
    cross: [f64; 3],
) -> Option<[[f64; 3]; 2]> {
    let Some(from) = *begun else {
        let begin = ui.button(format!("{word} from where the slices meet"));
        if begin.on_hover_text("Then go elsewhere, and press it again").clicked() {
            *begun = Some(cross);
        }
        return None;
    };
    ui.weak(format!("from {} mm", place(from)));
    let [ends, gives_up] = ui
        .horizontal(|ui| {
            let ends = ui.button(format!("{word} to where the slices meet")).clicked();
            let none = ui.button("×").accessible_name(format!("No {}", word.to_lowercase()));
            [ends, none.on_hover_text("Give it up").clicked()]
        })
        .inner;
    if ends || gives_up {
        *begun = None;
    }
    ends.then_some([from, cross])
}

fn is_rest(figures: &Figures) -> bool {
    figures.compare.shows == Shows::Rest
}

/// A number as it is now, and as it was at rest where that is another; where the body is shown at rest that alone.
fn told(figures: &Figures, now: f64, rest: f64, unit: &str) -> String {
    let [now, rest] = [now, rest].map(|number| format!("{number:.1}{unit}"));
    match is_rest(figures) {
        true => rest,
        false if now == rest => now,
        false => format!("{now} (at rest {rest})"),
    }
}

/// A length of a ruler, as the body is shown (mm).
pub(crate) fn shown_mm(figures: &Figures, ruler: &Ruler, leg: usize) -> f64 {
    if is_rest(figures) { ruler.rest_mm[leg] } else { ruler.mm[leg] }
}

/// A length of a ruler, with what it was.
pub(crate) fn mm(figures: &Figures, ruler: &Ruler, leg: usize) -> String {
    told(figures, ruler.mm[leg], ruler.rest_mm[leg], " mm")
}

/// Its angle, where it has one.
pub(crate) fn degrees(figures: &Figures, ruler: &Ruler) -> Option<String> {
    Some(told(figures, ruler.degrees?, ruler.rest_degrees?, "°"))
}
