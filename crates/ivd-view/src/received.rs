//! What the service gave, and what is told of it.

use std::path::Path;
use std::sync::Arc;

use egui::{Align, Color32, Context, Frame, Label, Layout, Margin, RichText, Ui};
use ivd_core::{Classified as _, ErrorClass};
use ivd_frames::{Figures, MapName, Refused, Request, Saved};

use crate::awaited::Awaited;
use crate::dialogs::Dialog;
use crate::files::Keeps;
use crate::handles::AWAY;
use crate::offered::Offered;
use crate::window::Window;

/// What is told stays for so long (s) ...
const TOLD: f64 = 8.0;
/// ... or for as long as it takes to read it in no hurry (letters in a second).
const READ: f64 = 10.0;
const PROBLEM: Color32 = Color32::from_rgb(91, 52, 19);
const PROBLEM_TEXT: Color32 = Color32::from_rgb(255, 231, 207);

const WORD: Color32 = Color32::from_rgb(28, 58, 44);
const WORD_TEXT: Color32 = Color32::from_rgb(214, 245, 228);

/// What is told for a while.
pub(crate) struct Word {
    pub(crate) text: String,
    /// Until then, once it was shown (s).
    pub(crate) until: Option<f64>,
    pub(crate) is_problem: bool,
    /// The same with its figures.
    pub(crate) exactly: Option<String>,
    /// How voxels may follow instead.
    pub(crate) instead: Option<MapName>,
    /// Whether it is of a hand that is ahead: once it isn't, that is over.
    pub(crate) is_ahead: bool,
    /// Whether it stays until something else is told, or something is followed.
    pub(crate) stays: bool,
}

impl Word {
    fn problem(text: String) -> Self {
        Self { is_problem: true, ..Self::of(text) }
    }

    pub(crate) fn of(text: String) -> Self {
        Self {
            text,
            until: None,
            is_problem: false,
            exactly: None,
            instead: None,
            is_ahead: false,
            stays: false,
        }
    }
}

/// Where a step goes.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Way {
    /// It is undone.
    Back,
    /// It is done again.
    Forth,
}

/// That the volume's picture is to be opened.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Inside {
    /// The number of that request.
    pub(crate) number: u64,
    /// Where the slices met before.
    pub(crate) cross: [f64; 3],
}

impl Window {
    pub(crate) fn failed(&mut self, title: &'static str, text: &str) {
        self.dialog = Some(Dialog::Problem { title, text: text.to_owned() });
    }

    /// Tells that something wasn't done, for a while.
    pub(crate) fn complain(&mut self, text: String) {
        self.word = Some(Word::problem(text));
    }

    /// Tells something for a while.
    pub(crate) fn say(&mut self, text: String) {
        self.word = Some(Word::of(text));
    }

    /// What a request makes of what is told: what was said of a hand that gives up is over.
    pub(crate) fn told_of(&mut self, request: &Request) {
        match request {
            Request::Abandon => self.word = None,
            Request::Undo => self.steps = Some(Way::Back),
            Request::Redo => self.steps = Some(Way::Forth),
            _ => {}
        }
    }

    /// Names the step that was undone or done again, once it is.
    fn stepped(&mut self, now: &Figures) {
        let Some(way) = self.steps.take() else { return };
        let Some(was) = self.shown.figures() else { return };
        let (verb, name, is) = match way {
            Way::Back => ("Undone", &was.undo, &now.redo),
            Way::Forth => ("Redone", &was.redo, &now.undo),
        };
        if let Some(name) = name.as_ref().filter(|_| name == is && now.refused.is_none()) {
            let told = format!("{verb}: {name}");
            self.say(told);
        }
    }

    /// Tells that looking inside took the slices elsewhere, once it is followed.
    fn opened_inside(&mut self, now: &Figures, followed: u64) {
        if let Some(Inside { cross, .. }) = self.inside.take_if(|inside| followed >= inside.number)
            && now.cross != cross
        {
            self.say("The slices went to the body's middle: where they met, the cut would have shown next to nothing.".to_owned());
        }
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
            let answered = self.asked.take_if(|waits| waits.is_answered(frame.followed));
            let answers = answered.is_some_and(|waits| waits.changes());
            if answers {
                self.stepped(&frame.figures);
            }
            self.opened_inside(&frame.figures, frame.followed);
            self.made_again(&frame.figures);
            self.pending.shown(&frame.figures);
            if self.asked.is_none() {
                self.awaited = Awaited::default();
            }
            self.recorded(&frame.pictures[0]);
            let before = self.shown.figures().map(|figures| (figures.level, figures.vertices));
            let (level, vertices) = (frame.figures.level, frame.figures.vertices);
            if let Some((was, _)) = before.filter(|(was, same)| level > *was && vertices == *same) {
                self.say(format!(
                    "Level {level} is no coarser than level {was}: {vertices} vertices are left."
                ));
            }
            let known =
                |id: u32| self.shown.figures().is_none_or(|was| was.handles.iter().any(|one| one.id == id));
            let added = frame.figures.handles.iter().map(|one| one.id).find(|id| !known(*id));
            // Of what is opened with handles the last is worked on.
            let last =
                frame.figures.handles.last().filter(|_| self.shown.figures().is_none()).map(|one| one.id);
            if let Some(far) = frame.figures.handles.iter().find(|one| one.away_mm > AWAY && !known(one.id)) {
                self.say(format!(
                    "Handle {} took the surface's nearest vertex, {:.1} mm away: a lower level has a closer one.",
                    far.id, far.away_mm
                ));
            }
            let is_there = |id: &u32| frame.figures.handles.iter().any(|one| one.id == *id);
            self.selected = frame.figures.held.or(added).or(self.selected).or(last).filter(is_there);
            let before = self.shown.figures().and_then(refusal).map(|word| word.text);
            match refusal(&frame.figures) {
                // What was told already isn't told again for what only looks.
                Some(word) if answers || before.as_ref() != Some(&word.text) => self.word = Some(word),
                Some(_) => {}
                // It can be read after the hand has let go.
                None => {
                    self.word.take_if(|word| word.is_ahead);
                    self.word.iter_mut().for_each(|word| word.stays = false);
                }
            }
            self.shown.frame(frame, context);
        }
        for problem in problems {
            self.awaited = Awaited::default();
            self.typed.no_more();
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
                if is_scene {
                    // It is opened from there again.
                    let folder = Path::new(&place).parent().filter(|folder| folder.is_dir());
                    self.layout.folder = folder.map(Path::to_owned).or(self.layout.folder.take());
                }
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
        let source = left.as_ref().map(|work| work.source.clone());
        // What was open before is made again.
        let meanwhile = self.meanwhile.take();
        self.clear();
        if had_frames {
            // Its log stays.
            drop(left);
            self.failed(
                "The session has ended",
                &format!("{error}. Open it once more to go on from its last step."),
            );
        } else if error.error_class() == ErrorClass::Cancelled {
            let is_back = self.begin_as_before(left, meanwhile, context);
            let back = if is_back { " It is opened as it was." } else { "" };
            self.say(format!("Opening was stopped.{back}"));
        } else if self.begin_as_before(left, meanwhile, context) {
            self.failed("It can't be made so", &format!("{error}. It is opened as it was."));
        } else if let Some((source, (offer, why))) = source.zip(error.offer()) {
            self.dialog = Some(Dialog::Offered(Offered::of(source, offer.clone(), why)));
        } else {
            self.failed("This can't be opened", &error.to_string());
        }
    }

    /// Tells what was done, or why it wasn't, else what there is to be warned of, in a line that is always there: it hides nothing, and nothing changes its size.
    pub(crate) fn words(&mut self, ui: &mut Ui) {
        let now = ui.input(|input| input.time);
        if let Some(word) = &mut self.word {
            let until = *word.until.get_or_insert(now + TOLD.max(word.text.chars().count() as f64 / READ));
            if now < until {
                ui.ctx().request_repaint_after_secs((until - now) as f32);
            } else if !word.stays {
                self.word = None;
            }
        }
        ui.with_layout(Layout::right_to_left(Align::Center), |ui| {
            // Where it is always, whatever is told.
            self.show_squeezed(ui);
            ui.with_layout(Layout::left_to_right(Align::Center), |ui| self.word_or_warning(ui));
        });
    }

    fn word_or_warning(&mut self, ui: &mut Ui) {
        // While a hand is ahead that is what is told; while something else is worked on, not why the last wasn't followed.
        let is_held = self.shown.figures().is_some_and(|figures| figures.held.is_some());
        let refused = self.shown.figures().filter(|_| is_held).and_then(refusal);
        let is_past = |word: &&Word| word.stays && !is_held && self.can_stop();
        let Some(word) = refused.as_ref().or(self.word.as_ref().filter(|word| !is_past(word))) else {
            self.warning(ui, false);
            return;
        };
        let (ground, colour) = if word.is_problem { (PROBLEM, PROBLEM_TEXT) } else { (WORD, WORD_TEXT) };
        let (text, exactly) = (word.text.clone(), word.exactly.clone());
        let now = self.shown.figures().map_or("", |figures| figures.map);
        let instead = word.instead.filter(|map| map.key() != now);
        let chosen = instead.filter(|map| ui.button(format!("Follow {}", map.word())).clicked());
        // A warning has room beside it.
        let share = if self.is_warned() { 0.6 } else { 1.0 };
        let room = share * ui.available_width();
        Frame::new().fill(ground).inner_margin(Margin::symmetric(6, 2)).show(ui, |ui| {
            ui.set_max_width(room - 12.0);
            let line = ui.add(Label::new(RichText::new(&text).color(colour)).truncate());
            if let Some(exactly) = exactly {
                line.on_hover_text(exactly);
            }
        });
        self.warning(ui, true);
        if let Some(map) = chosen {
            self.word = None;
            self.ask(Request::Map { map });
        }
    }
}

/// Why something wasn't followed.
fn refusal(figures: &Figures) -> Option<Word> {
    let Refused { why, exactly, instead, ahead_mm } = figures.refused.as_ref()?;
    let is_ahead = *ahead_mm > 0.0;
    let ahead = if is_ahead { format!("The hand is {ahead_mm:.1} mm ahead: ") } else { String::new() };
    let word = Word::problem(format!("{ahead}{why}"));
    Some(Word { exactly: exactly.clone(), instead: *instead, is_ahead, stays: true, ..word })
}
