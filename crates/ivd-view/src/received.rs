//! What the service gave, and what is told of it.

use std::sync::Arc;

use egui::{Align2, Area, Color32, Context, Frame, Id, Margin, Order, vec2};
use ivd_core::{Classified as _, ErrorClass};
use ivd_frames::{Figures, Saved};

use crate::dialogs::Dialog;
use crate::files::Keeps;
use crate::window::Window;

/// A problem is told for so long (s).
const TOLD: f64 = 8.0;
const PROBLEM: Color32 = Color32::from_rgb(91, 52, 19);
const PROBLEM_TEXT: Color32 = Color32::from_rgb(255, 231, 207);

const WORD: Color32 = Color32::from_rgb(28, 58, 44);
const WORD_TEXT: Color32 = Color32::from_rgb(214, 245, 228);

/// What is told for a while, over the pictures.
pub(crate) struct Word {
    pub(crate) text: String,
    /// Until then, once it was shown (s).
    pub(crate) until: Option<f64>,
    pub(crate) is_problem: bool,
}

impl Window {
    pub(crate) fn failed(&mut self, title: &'static str, text: &str) {
        self.dialog = Some(Dialog::Problem { title, text: text.to_owned() });
    }

    /// Tells that something wasn't done, for a while.
    pub(crate) fn complain(&mut self, text: String) {
        self.word = Some(Word { text, until: None, is_problem: true });
    }

    /// Tells something for a while.
    pub(crate) fn say(&mut self, text: String) {
        self.word = Some(Word { text, until: None, is_problem: false });
    }

    /// Takes what the service gave.
    pub(crate) fn receive(&mut self, context: &Context) {
        let Some(work) = &mut self.work else { return };
        let shared = work.shared.clone();
        let mut inbox = shared.locked();
        let (scan, frame, failed) = (inbox.scan.take(), inbox.frame.take(), inbox.failed.take());
        let done_before = inbox.done_before.take();
        let (problems, kept) = (std::mem::take(&mut inbox.problems), std::mem::take(&mut inbox.kept));
        self.notes.extend(inbox.notes.drain(..));
        drop(inbox);
        if let Some(scan) = scan {
            self.shown.scan(scan, context);
        }
        if let Some(frame) = frame {
            work.is_shown(frame.figures.missed.is_empty());
            self.asked = None;
            self.made_again(&frame.figures);
            self.pending.shown(&frame.figures);
            self.recorded(&frame.pictures[0]);
            let before = self.shown.figures().map(|figures| (figures.level, figures.vertices));
            let (level, vertices) = (frame.figures.level, frame.figures.vertices);
            if let Some((was, _)) = before.filter(|(was, same)| level > *was && vertices == *same) {
                self.say(format!(
                    "Level {level} is no coarser than level {was}: {vertices} vertices are left."
                ));
            }
            if let Some(why) = refusal(&frame.figures) {
                // It can be read after the hand has let go.
                self.complain(why);
            }
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
        if let Some(done) = done_before {
            self.done_before(done, context);
        }
        if let Some(error) = failed {
            self.ended(&error, context);
        }
    }

    pub(crate) fn kept(&mut self, what: Keeps, kept: Result<String, String>, context: &Context) {
        let is_scene = what == Keeps::Asked(Saved::Scene);
        self.lost = (self.lost && !is_scene) || (is_scene && kept.is_err());
        if what == Keeps::Recording && kept.is_ok() {
            self.recording.take_if(|recording| !recording.goes_on());
        }
        match kept {
            Ok(place) => {
                self.notes.push(format!("written: {place}"));
                let clips = self.shown.figures().map_or(0, |figures| figures.clips.len());
                let without = match clips {
                    1 if what == Keeps::Asked(Saved::Volume) => ", without what the plane or box takes away",
                    2.. if what == Keeps::Asked(Saved::Volume) => ", without what planes and boxes take away",
                    _ => "",
                };
                self.say(format!("Written: {place}{without}"));
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
    fn ended(&mut self, error: &Arc<ivd_frames::Error>, context: &Context) {
        let had_frames = self.shown.figures().is_some();
        let left = self.work.take();
        self.clear();
        if had_frames {
            // Its log stays.
            drop(left);
            self.failed(
                "The session has ended",
                &format!("{error}. Open it once more to go on from its last step."),
            );
        } else if error.error_class() == ErrorClass::Cancelled {
            let is_back = self.begin_as_before(left, context);
            let back = if is_back { " It is opened as it was." } else { "" };
            self.say(format!("Opening was stopped.{back}"));
        } else if self.begin_as_before(left, context) {
            self.failed("It can't be made so", &format!("{error}. It is opened as it was."));
        } else {
            self.failed("This can't be opened", &error.to_string());
        }
    }

    /// Tells what was done, or why it wasn't, over the pictures: nothing changes its size.
    pub(crate) fn words(&mut self, context: &Context) {
        let now = context.input(|input| input.time);
        if let Some(word) = &mut self.word {
            let until = *word.until.get_or_insert(now + TOLD);
            if now >= until {
                self.word = None;
            } else {
                context.request_repaint_after_secs((until - now) as f32);
            }
        }
        let refused = self.shown.figures().and_then(refusal).map(|text| (text, true));
        let word = || self.word.as_ref().map(|word| (word.text.clone(), word.is_problem));
        let Some((text, is_problem)) = refused.or_else(word) else { return };
        let (ground, colour) = if is_problem { (PROBLEM, PROBLEM_TEXT) } else { (WORD, WORD_TEXT) };
        let area = Area::new(Id::unique("problem")).order(Order::Middle).interactable(false);
        area.anchor(Align2::CENTER_TOP, vec2(0.0, 34.0)).show(context, |ui| {
            Frame::new().fill(ground).inner_margin(Margin::symmetric(10, 5)).show(ui, |ui| {
                ui.set_max_width(0.7 * ui.ctx().content_rect().width());
                ui.colored_label(colour, text);
            });
        });
    }
}

/// Why something wasn't followed.
fn refusal(figures: &Figures) -> Option<String> {
    let refused = figures.refused.as_ref()?;
    if refused.ahead_mm > 0.0 {
        return Some(format!("The hand is {:.1} mm ahead: {}", refused.ahead_mm, refused.why));
    }
    Some(refused.why.clone())
}
