//! The body as it is beside the body at rest.

use egui::{Pos2, Rect, Response, Slider, Ui};
use ivd_frames::{Compared, Figures, Request, Shows};

use crate::side::list;
use crate::window::Window;

/// Which states there are.
const STATES: &str = "The body at rest is the scan as it was read, whatever was pulled or cut open since";
/// The line that divides pictures is taken hold of from so far away (points).
const NEAR: f32 = 5.0;

impl Window {
    /// What the panes show, or will in a moment, of the body's two states.
    pub(crate) fn compared(&self) -> Option<Compared> {
        self.shown.figures().map(|figures| self.pending.compared(figures.compare))
    }

    /// Shows a state of the body, or what is as it is again.
    pub(crate) fn toggle(&mut self, shows: Shows) {
        let Some(compared) = self.compared() else { return };
        let shows = if compared.shows == shows { Shows::Now } else { shows };
        self.ask(Request::Compare { shows, at: compared.at });
    }

    /// What of both is shown, and where the line lies between them.
    pub(crate) fn compare(&mut self, ui: &mut Ui, figures: &Figures) {
        let Compared { shows, at } = self.pending.compared(figures.compare);
        let all = Shows::ALL.map(|shows| (shows, shows.word()));
        if let Some(shows) = list(ui, ["Body shown", STATES], (Some(shows), shows.word()), all) {
            self.ask(Request::Compare { shows, at });
        }
        if shows != Shows::Both {
            return;
        }
        let mut percent = 100.0 * at;
        let slider = Slider::new(&mut percent, 0.0..=100.0).show_value(false);
        let slid = ui.horizontal(|ui| {
            ui.weak("at rest up to");
            ui.add(slider).accessible_name("At rest up to, % of each picture's width")
        });
        let slid = slid.inner;
        if slid.on_hover_text("At rest left of the line, which can be dragged in the pictures too").changed()
        {
            self.ask(Request::Compare { shows, at: (0.01 * percent).clamp(0.0, 1.0) });
        }
    }

    /// Whether the line that divides the pictures lies there.
    pub(crate) fn is_line_at(&self, room: Rect, pos: Pos2) -> bool {
        let Some(Compared { shows: Shows::Both, at }) = self.compared() else { return false };
        let line = room.left() + at as f32 * room.width();
        (pos.x - line).abs() <= NEAR && room.y_range().contains(pos.y)
    }

    /// Whether the pointer is over that line.
    pub(crate) fn is_over_line(&self, ui: &Ui, response: &Response, room: Rect) -> bool {
        let pos = ui.input(|input| input.pointer.hover_pos());
        response.hovered() && pos.is_some_and(|pos| self.is_line_at(room, pos))
    }

    /// Which state a pane shows, for those who read the window by ear.
    pub(crate) fn spoken_state(&self) -> String {
        match self.shown.figures().map(|figures| figures.compare) {
            Some(Compared { shows: Shows::Rest, .. }) => ", the body at rest".to_owned(),
            Some(Compared { shows: Shows::Both, at }) => {
                format!(", the body at rest up to {:.0} % of the width, beyond that deformed", 100.0 * at)
            }
            _ => String::new(),
        }
    }
}
