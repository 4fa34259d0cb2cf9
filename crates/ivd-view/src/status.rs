//! The line at the bottom: what lies under the pointer, what the last motion came to, what it took; and how opening goes on.

use egui::{Align, Color32, Layout, ProgressBar, Rect, Ui, UiBuilder, vec2};
use ivd_frames::{Figures, NOTICE};

use crate::window::Window;

/// What a figure of the line means.
const DET_J: &str = "Largest motion: of any voxel. det J: the least share of its volume that any place keeps, by a proven bound; above 0 nothing folds.";

impl Window {
    /// Shows the line.
    pub(crate) fn status(&mut self, ui: &mut Ui) {
        let waits = self.asked.filter(|_| self.shown.figures().is_some());
        if waits.is_some() {
            ui.ctx().request_repaint_after(self.options.soon);
        }
        let works = waits.and_then(|waits| waits.told(self.options.soon));
        ui.horizontal(|ui| {
            ui.with_layout(Layout::right_to_left(Align::Center), |ui| {
                ui.weak(NOTICE);
                ui.with_layout(Layout::left_to_right(Align::Center), |ui| {
                    let text =
                        [works, self.records(), self.under_the_pointer(), self.shown.figures().map(told)];
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
        format!("{} …", inbox.stage.map_or("opening", in_words))
    }

    /// How opening goes on, in the volume's pane, with a way to stop it.
    pub(crate) fn opening(&mut self, ui: &mut Ui, rect: Rect) {
        let Some(work) = &self.work else { return };
        let (stage, done) = {
            let inbox = work.shared.locked();
            (inbox.stage, inbox.done)
        };
        let share = done.map_or(0.0, |(done, total)| done as f32 / total.max(1) as f32).min(1.0);
        let goes_on = stage.map_or("reading", in_words);
        let told = format!("{} is opened: {goes_on} …", work.name());
        let wide = rect.width().min(300.0);
        let mut stop = false;
        if self.shown.at_rest().is_some() {
            // A line below what is seen already.
            let room = Rect::from_center_size(rect.center_bottom() - vec2(0.0, 34.0), vec2(wide, 20.0));
            ui.painter().rect_filled(room.expand(4.0), 4.0, Color32::from_black_alpha(200));
            ui.scope_builder(UiBuilder::new().max_rect(room), |ui| {
                ui.with_layout(Layout::right_to_left(Align::Center), |ui| {
                    stop = ui.button("Stop opening").clicked();
                    progress(ui, ProgressBar::new(share).text(goes_on));
                });
            });
        } else {
            let room = Rect::from_center_size(rect.center(), vec2(wide, 90.0));
            ui.scope_builder(UiBuilder::new().max_rect(room), |ui| {
                ui.vertical_centered(|ui| {
                    ui.label(told);
                    progress(ui, ProgressBar::new(share).show_percentage());
                    stop = ui.button("Stop opening").clicked();
                });
            });
        }
        if stop {
            work.stop();
        }
    }
}

/// What a stage does, for whoever waits for it.
fn in_words(stage: &'static str) -> &'static str {
    match stage {
        "import" => "reading the scan",
        "segment" => "finding classes",
        "boundary" => "finding the part",
        "lattice" => "making the lattice",
        "refine" => "coarsening the lattice",
        "atf" => "choosing colours",
        other => other,
    }
}

fn progress(ui: &mut Ui, bar: ProgressBar) {
    ui.add(bar).accessible_name("Progress of opening");
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
