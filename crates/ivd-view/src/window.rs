use std::path::PathBuf;

use egui::{CentralPanel, Color32, Context, Frame, Margin, Panel, Ui, UiBuilder};
use ivd_frames::{Figures, Pane, Request, Source, Tool};

use crate::again::{Before, Making, Meanwhile, Seen};
use crate::awaited::Awaited;
use crate::dialogs::{Dialog, Then};
use crate::gestures::Hands;
use crate::handles::Typed;
use crate::keys::Focus;
use crate::layout::Layout;
use crate::made::{AsBefore, Wish};
use crate::pane::places;
use crate::pending::Pending;
use crate::received::{Inside, Way, Word};
use crate::record::Recording;
use crate::run::Options;
use crate::shown::Shown;
use crate::system::{Asked, Purpose};
use crate::waits::{Waits, does_something, makes_step};
use crate::work::Work;
use crate::writing;

/// A picture of this many pixels is drawn soon enough; more are left to the screen.
const MOST_PIXELS: f32 = 512.0 * 512.0;
/// Height of the line that tells what was done (points).
const WORDS: f32 = 24.0;
/// A pane has its new size for so long before the volume is drawn in it (s).
const SETTLED: f64 = 0.15;

/// The window: shows frames, sends what hands do.
pub struct Window {
    pub(crate) options: Options,
    pub(crate) work: Option<Work>,
    pub(crate) shown: Shown,
    pub(crate) tool: Tool,
    pub(crate) hands: Hands,
    /// Whether the pointer is over a picture.
    pub(crate) pointed: bool,
    pub(crate) layout: Layout,
    pub(crate) dialog: Option<Dialog>,
    /// The system's dialog that is shown.
    pub(crate) chooses: Option<Asked>,
    /// What waits until something is kept.
    pub(crate) waits: Option<Then>,
    /// A slider or field that is held, and its value.
    pub(crate) turning: Option<(String, f64)>,
    /// What was asked for a part and isn't shown yet.
    pub(crate) pending: Pending,
    /// What was typed or chosen and isn't followed yet.
    pub(crate) awaited: Awaited,
    /// What the body is to be made of.
    pub(crate) wish: Option<Wish>,
    /// What is to be made again as soon as it is known what was done.
    pub(crate) making: Option<Making>,
    /// What is made again, and what was open before it, to go back to.
    pub(crate) before: Option<Before>,
    /// How it was opened before it was made otherwise.
    pub(crate) previous: Option<Box<AsBefore>>,
    /// What goes on being shown of what is made again.
    pub(crate) meanwhile: Option<Meanwhile>,
    /// How what is made again is to be seen.
    pub(crate) seen: Seen,
    /// A handle that is typed.
    pub(crate) typed: Typed,
    /// The handle that was worked on last, if it is there still.
    pub(crate) selected: Option<u32>,
    /// What has the keys, as was seen last.
    pub(crate) has_keys: Option<egui::Id>,
    /// What is to have the keys.
    pub(crate) focus: Option<Focus>,
    /// Where a ruler begins that is put by keyboard (mm, RAS).
    pub(crate) ruler_from: Option<[f64; 3]>,
    /// Where a bone begins that is made by keyboard.
    pub(crate) bone_from: Option<[f64; 3]>,
    /// Where a picture of the window goes, and from which pass on it is taken.
    pub(crate) photograph: Option<(PathBuf, u64)>,
    /// What is recorded, or was and isn't kept yet.
    pub(crate) recording: Option<Recording>,
    pub(crate) notes: Vec<String>,
    /// What is done until an answer comes, and since when.
    pub(crate) asked: Option<Waits>,
    pub(crate) word: Option<Word>,
    /// Whether a step back or forth was asked for, to be named.
    pub(crate) steps: Option<Way>,
    /// That the picture is to be opened, until it is or something else is asked for.
    pub(crate) inside: Option<Inside>,
    /// To be opened as soon as there is a window.
    first: Option<Source>,
    /// Size that the volume's pane asks for, since when, and whether it was asked for.
    pub(crate) size: ([usize; 2], f64, bool),
    /// The scene was made but could not be written.
    pub(crate) lost: bool,
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
            pointed: false,
            layout,
            dialog: None,
            chooses: None,
            waits: None,
            turning: None,
            pending: Pending::default(),
            awaited: Awaited::default(),
            wish: None,
            making: None,
            before: None,
            previous: None,
            meanwhile: None,
            seen: Seen::default(),
            typed: Typed::default(),
            selected: None,
            has_keys: None,
            focus: None,
            ruler_from: None,
            bone_from: None,
            photograph: None,
            recording: None,
            notes: Vec::new(),
            asked: None,
            word: None,
            steps: None,
            inside: None,
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
    pub fn figures(&self) -> Option<&Figures> {
        self.shown.figures()
    }

    /// Shows the window and follows what is done in it.
    pub fn show(&mut self, ui: &mut Ui) {
        let context = ui.ctx().clone();
        if let Some(source) = self.first.take() {
            self.open(source, &context);
        }
        self.receive(&context);
        self.chosen(&context);
        self.dropped(&context);
        self.keys(&context);
        Panel::top("bar").show(ui, |ui| self.bar(ui));
        Panel::bottom("status").show(ui, |ui| self.status(ui));
        Panel::bottom("words").exact_size(WORDS).show_separator_line(false).show(ui, |ui| self.words(ui));
        if self.layout.side && self.work.is_some() {
            Panel::right("side").default_size(310.0).show(ui, |ui| {
                // As wide as it was made by hand, whatever it holds.
                let room = ui.available_rect_before_wrap();
                let mut inside = ui.new_child(UiBuilder::new().max_rect(room));
                inside.shrink_clip_rect(room);
                self.side(&mut inside);
                ui.advance_cursor_after_rect(room);
            });
        }
        let frame = Frame::new().fill(Color32::from_rgb(22, 24, 28)).inner_margin(Margin::same(2));
        CentralPanel::default().frame(frame).show(ui, |ui| self.pictures(ui));
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
                        self.ask_for(Purpose::Open { folder: false }, ui.ctx());
                    }
                    if ui.button("Try the demo").on_hover_text("A generated head with a handle").clicked() {
                        self.open(Source::default(), ui.ctx());
                    }
                });
            });
            return;
        }
        let pointer = ui.input(|input| input.pointer.hover_pos());
        let places = places(rect, self.layout.alone);
        self.pointed = places.iter().any(|(pane, rect)| {
            let room = self.shown.ratio(*pane).map(|ratio| self.room(*pane, *rect, ratio));
            room.zip(pointer).is_some_and(|(room, at)| room.contains(at))
        });
        for (pane, rect) in places {
            self.pane(ui, pane, rect);
            if pane == Pane::Volume {
                self.sized(ui.ctx(), rect.size() * ui.ctx().pixels_per_point());
            }
        }
    }

    /// Asks for a picture of the pane's size once that stays.
    fn sized(&mut self, context: &Context, pixels: egui::Vec2) {
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
    pub(crate) fn ask(&mut self, request: Request) {
        self.told_of(&request);
        if let Some(work) = &self.work {
            self.pending.ask(&request);
            self.awaited.ask(&request);
            if let Some(making) = &mut self.making {
                making.ask(&request);
            }
            let waits = self.asked.get_or_insert_with(Waits::begin);
            let changes = waits.ask(&request);
            let (is_more, is_step) = (does_something(&request), makes_step(&request));
            let opens = matches!(request, Request::Cut { along: Some(_) });
            let number = work.ask(request);
            if let Some(previous) = self.previous.as_mut().filter(|_| is_step) {
                previous.step = None;
            }
            if is_more {
                let cross = self.shown.figures().filter(|_| opens).map(|figures| figures.cross);
                self.inside = cross.map(|cross| Inside { number, cross });
            }
            if changes {
                waits.until(number);
            }
        }
    }

    /// Asks the service for all of it, in its order.
    pub(crate) fn ask_all(&mut self, requests: impl IntoIterator<Item = Request>) {
        for request in requests {
            self.ask(request);
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
            writing::screenshot(context, work.shared.clone(), path);
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
