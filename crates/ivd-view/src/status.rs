//! The line at the bottom: what lies under the pointer, what the last motion came to, what it took; and how opening goes on.

use egui::{Align, Color32, Layout, ProgressBar, Rect, Ui, UiBuilder, vec2};
use ivd_frames::{Figures, NOTICE, Overlay, Request};

use crate::handles::length;
use crate::window::Window;

/// What a figure of the line means.
const MEANS: &str = "Largest motion: of any voxel. What every voxel keeps at least of its volume is a proven bound; above 0 nothing folds.";

/// What is shown of what is squeezed.
const WHERE: &str = "Takes the slices to the voxel that is squeezed most, with colours that tell how much; what it has left is told below, and is more than the bound, which holds between voxels too";
/// What it means that something is squeezed.
const IS_SQUEEZED: &str =
    "A larger radius or a smaller move squeezes less. The button to the right shows where.";
/// What it means that voxels stay behind.
const STAY_BEHIND: &str = "Where voxels would fold if they followed the surface all the way, they stay behind it, by this much at most. A larger radius or a smaller move leaves less behind.";
/// What it means that something is cut off.
const CUT_OFF: &str =
    "What is moved out of the scan is in no picture and no file: there are no voxels for it.";

/// What stopping does.
const STOPS: &str = "Nothing of what is worked on is done (Esc).";

/// Matter that may have less of its volume left is squeezed so that one sees it.
const SQUEEZED: f64 = 0.5;
/// What has moved less far isn't told (mm).
const GONE: f64 = 0.05;
/// Voxels that are left behind by more than this share of what moves them are told of.
const BEHIND: f64 = 0.1;

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
                if self.can_stop() && ui.small_button("Stop").on_hover_text(STOPS).clicked() {
                    self.ask(Request::Stop);
                }
                ui.with_layout(Layout::left_to_right(Align::Center), |ui| {
                    let text =
                        [works, self.records(), self.under_the_pointer(), self.shown.figures().map(told)];
                    let text: Vec<String> = text.into_iter().flatten().collect();
                    let text = if text.is_empty() { self.goes_on() } else { text.join(" · ") };
                    let line = ui.add(egui::Label::new(text).truncate());
                    line.on_hover_ui(|ui| {
                        ui.label(explained(self.shown.figures()));
                    });
                });
            });
        });
    }

    /// Whether something is worked on for so long that it may be stopped.
    pub(crate) fn can_stop(&self) -> bool {
        let shown = self.shown.figures().is_some();
        self.asked.is_some_and(|waits| shown && waits.changes() && waits.told(self.options.soon).is_some())
    }

    /// Whether there is something to be warned of.
    pub(crate) fn is_warned(&self) -> bool {
        self.shown.figures().is_some_and(|figures| warned(figures, true).iter().any(Option::is_some))
    }

    /// What is to be known before what is seen is trusted, above the line.
    ///
    /// - `in_short`: without what helps, where something else is told beside it.
    pub(crate) fn warning(&self, ui: &mut Ui, in_short: bool) {
        let Some([squeezed, left, cut_off]) = self.shown.figures().map(|told| warned(told, in_short)) else {
            return;
        };
        let colour = ui.visuals().warn_fg_color;
        let all = [(squeezed, IS_SQUEEZED), (cut_off, CUT_OFF), (left, STAY_BEHIND)];
        for (one, means) in all {
            if let Some(one) = one {
                ui.add(egui::Label::new(egui::RichText::new(one).color(colour)).truncate())
                    .on_hover_text(means);
            }
        }
    }

    /// A button that shows what is squeezed most, wherever something has moved.
    pub(crate) fn show_squeezed(&mut self, ui: &mut Ui) {
        let has_moved = self.shown.figures().is_some_and(|figures| figures.largest_mm > GONE);
        if has_moved && ui.small_button("Show most squeezed").on_hover_text(WHERE).clicked() {
            self.ask(Request::ShowSqueezed);
        }
    }

    fn under_the_pointer(&self) -> Option<String> {
        let hovered = self.shown.hovered().filter(|_| self.pointed);
        let class = hovered.and_then(|hovered| hovered.class).filter(|class| *class > 0);
        let gone = hovered.map_or(0.0, |told| length(std::array::from_fn(|a| told.place[a] - told.rest[a])));
        let moved = if gone > GONE { format!(", moved {gone:.1} mm") } else { String::new() };
        let is_told = self.shown.figures().is_some_and(|figures| figures.overlay == Some(Overlay::Volume));
        let at_cross = || self.shown.figures().and_then(|figures| figures.cross_times);
        let times = hovered.map_or_else(at_cross, |hovered| hovered.times).filter(|_| is_told);
        let times = times.map_or_else(String::new, |times| format!(", {} % of its volume", percent(times)));
        let hovered = hovered.map(|hovered| (hovered.place, hovered.value));
        let of = if hovered.is_none() { "cross hair: " } else { "" };
        let (place, value) = hovered.or_else(|| self.shown.cross())?;
        let value = value.map_or_else(|| "–".to_owned(), |value| format!("{value:.2}"));
        let class = class.map_or_else(String::new, |class| format!(", class {class}"));
        Some(
            format!("{of}{value} at {} mm{class}", place.map(|c| format!("{c:.1}")).join(", "))
                + &moved
                + &times,
        )
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

/// What the last motion came to.
fn told(figures: &Figures) -> String {
    format!(
        "largest motion {:.2} mm · every voxel keeps at least {} % of its volume · {} vertices at level {}",
        figures.largest_mm,
        percent(figures.min_det_j),
        figures.vertices,
        figures.level
    )
}

/// What is to be known before what is seen is trusted: how much is squeezed, how far voxels stay behind, and how far what moves leaves the scan.
fn warned(figures: &Figures, in_short: bool) -> [Option<String>; 3] {
    // Springs squeeze more than any way that voxels follow by.
    let less = match (figures.solver, figures.map) {
        _ if in_short => "",
        ("ring", "octree") => " (smoothest squeezes less)",
        ("ring", _) => "",
        _ => " (by distance alone it is squeezed less)",
    };
    let squeezed = (figures.min_det_j < SQUEEZED).then(|| {
        format!("squeezed: at least {} % of its volume is left everywhere{less}", percent(figures.min_det_j))
    });
    let left = (figures.behind > BEHIND)
        .then(|| format!("voxels up to {:.1} mm behind the surface that is pulled", figures.left_mm));
    let cut_off = (figures.cut_off_mm > GONE)
        .then(|| format!("cut off at the scan's edge: the surface goes {:.1} mm beyond", figures.cut_off_mm));
    [squeezed, left, cut_off]
}

/// A share that is proven, in percent: never more than it is, and by two digits.
fn percent(share: f64) -> String {
    let percent = 100.0 * share.max(0.0);
    let digits =
        if percent >= 10.0 || percent == 0.0 { 0 } else { (1.0 - percent.log10().floor()).min(9.0) as usize };
    let ten = 10.0_f64.powi(digits as i32);
    format!("{:.digits$}", (percent * ten * (1.0 + 1e-12)).floor() / ten)
}

/// What the numbers of the line mean, and what the last motion took.
fn explained(figures: Option<&Figures>) -> String {
    let Some(figures) = figures else { return MEANS.to_owned() };
    let milli = |s: f64| format!("{:.0} ms", 1e3 * s);
    let [lattice, map, voxels] = figures.times.map(milli);
    let picture = milli(figures.draw_s);
    format!("{MEANS} It took: lattice {lattice}, map {map}, voxels {voxels}, picture {picture}.")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_proven_is_never_told_to_be_more() {
        let told = [1.0, 0.9999, 0.196, 0.29, 0.0518, 0.0071, 0.00042, 0.0].map(percent);
        assert_eq!(told, ["100", "99", "19", "29", "5.1", "0.71", "0.042", "0"]);
    }
}
