//! The line at the bottom: what lies under the pointer, what the last motion came to, what it took; and how opening goes on.

use egui::{Align, Layout, ProgressBar, Rect, Ui, UiBuilder, vec2};
use ivd_frames::{Figures, NOTICE};

use crate::waits::SOON;
use crate::window::Window;

/// What a figure of the line means.
const DET_J: &str = "Largest motion: of any voxel. det J: the least share of its volume that any place keeps, by a proven bound; above 0 nothing folds.";

impl Window {
    /// Shows the line.
    pub(crate) fn status(&mut self, ui: &mut Ui) {
        let waits = self.asked.filter(|_| self.shown.figures().is_some());
        if waits.is_some() {
            ui.ctx().request_repaint_after(SOON);
        }
        let works = waits.and_then(|waits| waits.told());
        ui.horizontal(|ui| {
            ui.with_layout(Layout::right_to_left(Align::Center), |ui| {
                ui.weak(NOTICE);
                ui.with_layout(Layout::left_to_right(Align::Center), |ui| {
                    let text = [works, self.under_the_pointer(), self.shown.figures().map(told)];
                    let text: Vec<String> = text.into_iter().flatten().collect();
                    let text = if text.is_empty() { self.goes_on() } else { text.join(" · ") };
                    ui.add(egui::Label::new(text).truncate()).on_hover_text(DET_J);
                });
            });
        });
    }

    fn under_the_pointer(&self) -> Option<String> {
        let hovered =
            self.shown.hovered().filter(|_| self.pointed).map(|hovered| (hovered.place, hovered.value));
        let (place, value) = hovered.or_else(|| self.shown.cross())?;
        let value = value.map_or_else(|| "–".to_owned(), |value| format!("{value:.2}"));
        Some(format!("{value} at {} mm", place.map(|c| format!("{c:.1}")).join(", ")))
    }

    /// What is done while there are no frames.
    fn goes_on(&self) -> String {
        let Some(work) = &self.work else {
            return "Open a scan or a scene: Ctrl+O, or drop a file here.".to_owned();
        };
        let inbox = work.shared.locked();
        inbox.stage.map_or_else(|| "opening …".to_owned(), |stage| format!("{stage} …"))
    }

    /// How opening goes on, in the volume's pane, with a way to stop it.
    pub(crate) fn opening(&mut self, ui: &mut Ui, rect: Rect) {
        let Some(work) = &self.work else { return };
        let (stage, done) = {
            let inbox = work.shared.locked();
            (inbox.stage, inbox.done)
        };
        let size = vec2(rect.width().min(260.0), 90.0);
        // Not over what is seen already.
        let room = match self.shown.at_rest() {
            Some(_) => Rect::from_min_size(rect.left_bottom() - vec2(-6.0, size.y), size),
            None => Rect::from_center_size(rect.center(), size),
        };
        let mut stop = false;
        ui.scope_builder(UiBuilder::new().max_rect(room), |ui| {
            ui.vertical_centered(|ui| {
                ui.label(format!("{} is opened: {} …", work.name(), stage.unwrap_or("reading")));
                let share = done.map_or(0.0, |(done, total)| done as f32 / total.max(1) as f32);
                ui.add(ProgressBar::new(share.min(1.0)).show_percentage())
                    .accessible_name("Progress of opening");
                stop = ui.button("Stop opening").clicked();
            });
        });
        if stop {
            work.stop();
        }
    }
}

/// What the last motion came to, and what it took.
fn told(figures: &Figures) -> String {
    let milli = |s: f64| format!("{:.0} ms", 1e3 * s);
    let [solve, map, warp] = figures.times;
    format!(
        "largest motion {:.2} mm · det J ≥ {:.3} · {} vertices at level {} · lattice {}, map {}, voxels {}, picture {}",
        figures.largest_mm,
        figures.min_det_j,
        figures.vertices,
        figures.level,
        milli(solve),
        milli(map),
        milli(warp),
        milli(figures.draw_s)
    )
}
