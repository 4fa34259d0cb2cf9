use std::path::Path;
use std::sync::Arc;

use eframe::egui::{
    Align2, Area, CentralPanel, Color32, Context, Frame, Id, Margin, Order, Panel, Ui, ViewportCommand, vec2,
};
use ivd_core::{Classified as _, ErrorClass};
use ivd_frames::{Pane, Request, Saved, Source, Tool};

use crate::dialogs::{Dialog, Then};
use crate::files;
use crate::gestures::Hands;
use crate::journal::{Left, left_over};
use crate::layout::Layout;
use crate::pane::places;
use crate::run::Options;
use crate::shown::Shown;
use crate::work::Work;

/// A picture of this many pixels is drawn soon enough; more are left to the screen.
const MOST_PIXELS: f32 = 512.0 * 512.0;
/// A pane has its new size for so long before the volume is drawn in it (s).
const SETTLED: f64 = 0.15;
/// A problem is told for so long (s).
const TOLD: f64 = 8.0;
const PROBLEM: Color32 = Color32::from_rgb(91, 52, 19);
const PROBLEM_TEXT: Color32 = Color32::from_rgb(255, 231, 207);

/// The window: shows frames, sends what hands do.
pub struct Window {
    pub(crate) options: Options,
    pub(crate) work: Option<Work>,
    pub(crate) shown: Shown,
    pub(crate) tool: Tool,
    pub(crate) hands: Hands,
    pub(crate) layout: Layout,
    pub(crate) dialog: Option<Dialog>,
    /// What waits until something is kept.
    pub(crate) waits: Option<Then>,
    /// A slider or field that is held, and its value.
    pub(crate) turning: Option<(String, f64)>,
    /// Of a new handle, as it is typed.
    pub(crate) place: String,
    /// Where a picture of the window goes, and from which pass on it is taken.
    pub(crate) photograph: Option<(std::path::PathBuf, u64)>,
    pub(crate) notes: Vec<String>,
    complaint: Option<(String, Option<f64>)>,
    /// To be opened as soon as there is a window.
    first: Option<Source>,
    /// Size that the volume's pane asks for, since when, and whether it was asked for.
    size: ([usize; 2], f64, bool),
    /// The scene was made but could not be written.
    lost: bool,
}

impl Window {
    /// A window that opens something as soon as it is shown, or asks what to.
    pub fn new(options: Options, first: Option<Source>) -> Self {
        let layout = Layout::read(options.folder.as_deref());
        Self {
            options,
            work: None,
            shown: Shown::default(),
            tool: Tool::Turn,
            hands: Hands::default(),
            layout,
            dialog: None,
            waits: None,
            turning: None,
            place: String::new(),
            photograph: None,
            notes: Vec::new(),
            complaint: None,
            first,
            size: ([0; 2], 0.0, true),
            lost: false,
        }
    }

    /// Whether there is a picture of the volume, as fine as it gets.
    pub fn is_settled(&self) -> bool {
        self.shown.figures().is_some() && self.shown.is_whole()
    }

    /// What is told beside the pictures, once there are some.
    pub fn figures(&self) -> Option<&ivd_frames::Figures> {
        self.shown.figures()
    }

    /// Shows the window and follows what is done in it.
    pub fn show(&mut self, ui: &mut Ui) {
        let context = ui.ctx().clone();
        if let Some(source) = self.first.take() {
            self.open(source, &context);
        }
        self.receive(&context);
        self.dropped(&context);
        self.keys(&context);
        Panel::top("bar").show(ui, |ui| self.bar(ui));
        Panel::bottom("status").show(ui, |ui| self.status(ui));
        if self.layout.side && self.work.is_some() {
            Panel::right("side").default_size(260.0).show(ui, |ui| self.side(ui));
        }
        let frame = Frame::new().fill(Color32::from_rgb(22, 24, 28)).inner_margin(Margin::same(2));
        CentralPanel::default().frame(frame).show(ui, |ui| self.pictures(ui));
        self.complaints(&context);
        self.dialogs(&context);
        self.closing(&context);
        self.photographed(&context);
    }

    fn pictures(&mut self, ui: &mut Ui) {
        let rect = ui.available_rect_before_wrap();
        if self.work.is_none() {
            ui.scope(|ui| {
                ui.vertical_centered(|ui| {
                    ui.add_space(0.35 * rect.height());
                    ui.heading("Drop a scan or a scene here");
                    if ui.button("Open a file …").clicked() {
                        self.ask_what_to_open();
                    }
                    if ui.button("Try the demo").on_hover_text("A generated head with a handle").clicked() {
                        self.open(Source::default(), ui.ctx());
                    }
                });
            });
            return;
        }
        for (pane, rect) in places(rect, self.layout.alone) {
            self.pane(ui, pane, rect);
            if pane == Pane::Volume {
                self.sized(ui.ctx(), rect.size() * ui.ctx().pixels_per_point());
            }
        }
    }

    /// Asks for a picture of the pane's size once that stays.
    fn sized(&mut self, context: &Context, pixels: eframe::egui::Vec2) {
        let scale = (MOST_PIXELS / (pixels.x * pixels.y).max(1.0)).sqrt().min(1.0);
        let wanted = [pixels.x, pixels.y].map(|side| ((side * scale).round() as usize).clamp(32, 2048));
        let now = context.input(|input| input.time);
        if self.size.0 != wanted {
            self.size = (wanted, now, false);
        }
        let (size, since, is_asked) = self.size;
        if !is_asked && now - since >= SETTLED {
            self.size.2 = true;
            self.ask(Request::Resize { size });
        } else if !is_asked {
            context.request_repaint_after_secs((SETTLED - (now - since)) as f32);
        }
    }

    /// Asks the service.
    pub(crate) fn ask(&self, request: Request) {
        if let Some(work) = &self.work {
            work.ask(request);
        }
    }

    /// Opens something, after what would be lost was asked about.
    pub(crate) fn open(&mut self, source: Source, context: &Context) {
        if self.is_unsaved() {
            self.dialog = Some(Dialog::Unsaved(Then::Open(source)));
            return;
        }
        if let Some(work) = self.work.take() {
            work.close();
        }
        self.clear();
        let of =
            source.file.as_deref().map(|file| std::path::absolute(file).unwrap_or_else(|_| file.to_owned()));
        let folder = self.options.folder.as_deref();
        let left = folder.map(left_over).unwrap_or_default().into_iter().find(|left| left.of == of);
        match left {
            Some(left) => self.dialog = Some(Dialog::Recover { left, source }),
            None => self.begin(&source, None, context),
        }
    }

    /// Opens something in the background.
    pub(crate) fn begin(&mut self, source: &Source, left: Option<Left>, context: &Context) {
        match Work::open(source, left, &self.options, context) {
            Ok(work) => {
                context.send_viewport_cmd(ViewportCommand::Title(format!("{} — IVD", work.name())));
                let folder = source.file.as_deref().and_then(Path::parent).filter(|folder| folder.is_dir());
                if work.of.is_some() && work.scan.is_some() {
                    self.layout.folder = folder.map(Path::to_owned).or(self.layout.folder.take());
                }
                self.work = Some(work);
            }
            Err(error) => self.failed("This can't be opened", &error.to_string()),
        }
    }

    /// Closes what is open, after what would be lost was asked about.
    pub(crate) fn close(&mut self, context: &Context) {
        if self.is_unsaved() {
            self.dialog = Some(Dialog::Unsaved(Then::Close));
        } else {
            self.then(Then::Close, context);
        }
    }

    /// Nothing is shown.
    pub(crate) fn clear(&mut self) {
        (self.shown, self.hands) = (Shown::default(), Hands::default());
        (self.turning, self.complaint, self.waits) = (None, None, None);
        self.notes.clear();
        self.size = ([0; 2], 0.0, true);
        self.lost = false;
    }

    /// Whether something would be lost.
    pub(crate) fn is_unsaved(&self) -> bool {
        let figures = self.shown.figures();
        self.work.is_some() && figures.is_some_and(|figures| figures.unsaved || self.lost)
    }

    fn failed(&mut self, title: &'static str, text: &str) {
        self.dialog = Some(Dialog::Problem { title, text: text.to_owned() });
    }

    /// Tells that something wasn't done, for a while.
    pub(crate) fn complain(&mut self, text: String) {
        self.complaint = Some((text, None));
    }

    /// Takes what the service gave.
    fn receive(&mut self, context: &Context) {
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

    /// Opens what is dropped into the window.
    fn dropped(&mut self, context: &Context) {
        let (dropped, hovers) =
            context.input(|input| (input.raw.dropped_files.clone(), !input.raw.hovered_files.is_empty()));
        if let Some(file) = dropped.first() {
            self.open(Source { file: Some(file.path().to_owned()), ..Source::default() }, context);
        }
        if hovers {
            self.complaint = Some(("Let go to open it.".to_owned(), Some(context.input(|i| i.time) + 0.3)));
            context.request_repaint_after_secs(0.3);
        }
    }

    /// Tells what wasn't done and why, over the pictures: nothing changes its size.
    fn complaints(&mut self, context: &Context) {
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

    /// Asks before the window is closed with what would be lost.
    fn closing(&mut self, context: &Context) {
        if !context.input(|input| input.viewport().close_requested()) {
            return;
        }
        if self.is_unsaved() {
            context.send_viewport_cmd(ViewportCommand::CancelClose);
            self.dialog = Some(Dialog::Unsaved(Then::Quit));
        }
    }

    /// Takes a picture of the window.
    fn photographed(&mut self, context: &Context) {
        let Some((_, from)) = &self.photograph else { return };
        if context.cumulative_pass_nr() < *from {
            context.request_repaint();
            return;
        }
        if let (Some((path, _)), Some(work)) = (self.photograph.take(), &self.work) {
            files::screenshot(context, work.shared.clone(), path);
        }
    }

    /// Ends in order: nothing is to be recovered, and the layout is kept.
    pub(crate) fn end(&mut self, context_size: Option<[f32; 2]>) {
        if let Some(work) = self.work.take() {
            work.close();
        }
        self.layout.size = context_size.unwrap_or(self.layout.size);
        self.layout.write(self.options.folder.as_deref());
    }
}
