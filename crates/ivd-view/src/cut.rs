//! The incision: how far it is open, and how to be rid of it.

use egui::Ui;
use ivd_frames::{Figures, Pane, Request};

use crate::side::{Scale, slider};
use crate::window::Window;

/// Lips further apart than this share of the radius fold what lies beside them.
const OPENEST: f64 = 0.5;

/// What a radius of a cut is.
const DISC: &str = "A cut is a disc about the middle of its line: from the skin it goes as deep as half the line is long. Make it smaller for a shallow one";

/// Planes that a cut where the slices meet may lie in: what it is called, the slice that its line is drawn over, and whether that goes across or down.
const PLANES: [(&str, Pane, [f64; 2]); 3] = [
    ("along the sagittal slice", Pane::Axial, [0.0, 1.0]),
    ("along the coronal slice", Pane::Axial, [1.0, 0.0]),
    ("along the axial slice", Pane::Coronal, [1.0, 0.0]),
];

impl Window {
    /// Shows the cut.
    pub(crate) fn incision(&mut self, ui: &mut Ui, figures: &Figures) {
        ui.heading("Incision");
        let Some(cut) = &figures.incision else {
            ui.weak("Choose the tool Incise, and draw a line over the body; or:");
            self.cut_here(ui, figures);
            return;
        };
        let space = cut.id;
        let cut = &self.pending.incision(cut);
        let mut open = self.value("Lips apart", cut.open);
        let widest = OPENEST * cut.radius;
        for response in slider(ui, "Lips apart", "mm", &mut open, 0.0..=widest, Scale::Even) {
            let radius = cut.radius;
            self.turned(&response, ("Lips apart", open), || Request::Open { space, radius, open });
        }
        let mut radius = self.value("Radius of the cut", cut.radius);
        let largest = self.extent_mm().max(1.0);
        let unit = "mm: as deep as it is long to each side";
        for response in slider(ui, "Radius of the cut", unit, &mut radius, 0.5..=largest, Scale::Ratios) {
            let response = response.on_hover_text(DISC);
            // As open for its length as it was.
            let radius = radius.max(1e-3);
            let open = cut.open / cut.radius * radius;
            self.turned(&response, ("Radius of the cut", radius), || Request::Open { space, radius, open });
        }
        ui.horizontal(|ui| {
            if ui
                .button("Close the cut")
                .on_hover_text("The cut goes; what was cut is whole again. Lips apart by 0 keep it")
                .clicked()
            {
                self.ask(Request::Close { space });
            }
            ui.weak("Another line moves it.");
        });
    }

    /// A cut without a pointer: as far as the radius reaches, where the slices meet.
    fn cut_here(&mut self, ui: &mut Ui, figures: &Figures) {
        ui.menu_button("Cut where the slices meet", |ui| {
            for (name, pane, way) in PLANES {
                if ui.button(format!("Cut {name}")).clicked() {
                    self.ask_all(line(figures, pane, way));
                    ui.close();
                }
            }
        });
    }
}

/// A line over a slice through the place where the slices meet, the radius to both sides as far as there is a picture.
fn line(figures: &Figures, pane: Pane, way: [f64; 2]) -> Option<Request> {
    let middle = figures.cross_at[pane.number()]?;
    let extent = figures.slices[pane.number() - 1].extent_mm;
    // As far to one side as to the other.
    let half = [0, 1].map(|a| {
        let room = middle[a].min(1.0 - middle[a]) - 0.001;
        way[a] * (figures.radius / extent[a]).min(room.max(0.0))
    });
    let end = |sign: f64| [0, 1].map(|a| middle[a] + sign * half[a]);
    Some(Request::Stroke { pane, from: end(-1.0), to: end(1.0) })
}
