//! What the service gave, and what is told of it.

use std::sync::Arc;

use egui::{Align2, Area, Color32, Context, Frame, Id, Margin, Order, vec2};
use ivd_core::{Classified as _, ErrorClass};
use ivd_frames::Saved;

use crate::dialogs::Dialog;
use crate::window::Window;

/// A problem is told for so long (s).
const TOLD: f64 = 8.0;
const PROBLEM: Color32 = Color32::from_rgb(91, 52, 19);
const PROBLEM_TEXT: Color32 = Color32::from_rgb(255, 231, 207);

impl Window {
    pub(crate) fn failed(&mut self, title: &'static str, text: &str) {
        self.dialog = Some(Dialog::Problem { title, text: text.to_owned() });
    }

    /// Tells that something wasn't done, for a while.
    pub(crate) fn complain(&mut self, text: String) {
        self.complaint = Some((text, None));
    }

    /// Takes what the service gave.
    pub(crate) fn receive(&mut self, context: &Context) {
        let Some(work) = &mut self.work else { return };
        let shared = work.shared.clone();
        let mut inbox = shared.locked();
        let (scan, frame, failed) = (inbox.scan.take(), inbox.frame.take(), inbox.failed.take());
        let (problems, kept) = (std::mem::take(&mut inbox.problems), std::mem::take(&mut inbox.kept));
        self.notes.extend(inbox.notes.drain(..));
        drop(inbox);
        if let Some(scan) = scan {
            self.shown.scan(scan, context);
        }
        if let Some(frame) = frame {
            work.went_on();
            self.asked = None;
            self.shown.frame(frame, context);
        }
        for problem in problems {
            // What was to be kept and isn't comes no more.
            shared.keeping.forget();
            self.waits = None;
            self.complain(problem);
        }
        for (what, kept) in kept {
            self.kept(what, kept, context);
        }
        if let Some(error) = failed {
            self.ended(&error);
        }
    }

    fn kept(&mut self, what: Option<Saved>, kept: Result<String, String>, context: &Context) {
        let is_scene = what == Some(Saved::Scene);
        self.lost = (self.lost && !is_scene) || (is_scene && kept.is_err());
        match kept {
            Ok(place) => {
                self.notes.push(format!("written: {place}"));
                self.complain(format!("Written: {place}"));
                if let Some(then) = self.waits.take().filter(|_| is_scene) {
                    self.then(then, context);
                }
            }
            Err(problem) => {
                self.waits = None;
                self.failed("This could not be written", &problem);
            }
        }
    }

    /// The service has ended.
    fn ended(&mut self, error: &Arc<ivd_frames::Error>) {
        let had_frames = self.shown.figures().is_some();
        let left = self.work.take();
        self.clear();
        if error.error_class() == ErrorClass::Cancelled {
            if let Some(work) = left {
                work.close();
            }
            self.complain("Opening was stopped.".to_owned());
        } else if had_frames {
            // Its log stays.
            drop(left);
            self.failed(
                "The session has ended",
                &format!("{error}. Open it once more to go on from its last step."),
            );
        } else {
            if let Some(work) = left {
                work.close();
            }
            self.failed("This can't be opened", &error.to_string());
        }
    }

    /// Tells what wasn't done and why, over the pictures: nothing changes its size.
    pub(crate) fn complaints(&mut self, context: &Context) {
        let now = context.input(|input| input.time);
        if let Some((_, until)) = &mut self.complaint {
            let until = *until.get_or_insert(now + TOLD);
            if now >= until {
                self.complaint = None;
            } else {
                context.request_repaint_after_secs((until - now) as f32);
            }
        }
        let refused = self.shown.figures().and_then(|figures| figures.refused.as_ref()).map(|refused| {
            if refused.ahead_mm > 0.0 {
                return format!("The hand is {:.1} mm ahead: {}", refused.ahead_mm, refused.why);
            }
            refused.why.clone()
        });
        let Some(text) = refused.or_else(|| self.complaint.as_ref().map(|(text, _)| text.clone())) else {
            return;
        };
        let area = Area::new(Id::unique("problem")).order(Order::Middle).interactable(false);
        area.anchor(Align2::CENTER_TOP, vec2(0.0, 34.0)).show(context, |ui| {
            Frame::new().fill(PROBLEM).inner_margin(Margin::symmetric(10, 5)).show(ui, |ui| {
                ui.set_max_width(0.7 * ui.ctx().content_rect().width());
                ui.colored_label(PROBLEM_TEXT, text);
            });
        });
    }
}
