//! What is opened and closed, and what would be lost by it.

use std::path::{Path, PathBuf};

use egui::{Context, ViewportCommand};
use ivd_frames::Source;
use ivd_pipeline::scene::Override;

use crate::again::Seen;
use crate::awaited::Awaited;
use crate::dialogs::{Dialog, Then};
use crate::gestures::Hands;
use crate::handles::Typed;
use crate::journal::left_over;
use crate::received::Word;
use crate::shown::Shown;
use crate::window::Window;
use crate::work::{Begins, Work};

impl Window {
    /// Opens something, after what would be lost was asked about.
    pub(crate) fn open(&mut self, source: Source, context: &Context) {
        // What was offered of something else isn't asked about any more.
        self.dialog.take_if(|dialog| matches!(dialog, Dialog::Offered(_)));
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
        let left = folder.map(left_over).unwrap_or_default().into_iter().filter(|left| left.of == of);
        // Of several the one with most: others went on from it, not to the end.
        let left = left.max_by_key(|left| left.steps);
        match left {
            Some(left) => self.dialog = Some(Dialog::Recover { left, source }),
            None => self.begin(&source, Begins::Anew, context),
        }
    }

    /// Opens what is open once more, with labels of it.
    pub(crate) fn open_labels(&mut self, labels: PathBuf, context: &Context) {
        let Some(work) = &self.work else { return };
        // What was said of parts that values gave isn't of these.
        let of_values = ["segment", "boundary"];
        let is_of_values = |one: &&Override| {
            let stage = one.path.first().map_or("", String::as_str);
            of_values.contains(&stage) || ["lattice.iso", "lattice.min_part"].contains(&&*one.path.join("."))
        };
        let mut source = Source { labels: Some(labels), ..work.source.clone() };
        source.overrides.retain(|one| !is_of_values(&one));
        let made = self.shown.figures().map(|figures| figures.made.clone()).unwrap_or_default();
        for (key, is_said) in [
            ("boundary.class=", made.part.is_some()),
            ("boundary.above=", made.is_above() && !made.is_body),
            ("lattice.iso=", made.iso.is_some()),
        ] {
            if is_said {
                source.overrides.extend(key.parse::<Override>());
            }
        }
        self.open(source, context);
    }

    /// Opens something in the background.
    pub(crate) fn begin(&mut self, source: &Source, begins: Begins, context: &Context) {
        match Work::open(source, begins, &self.options, context) {
            Ok(work) => {
                context.send_viewport_cmd(ViewportCommand::Title(format!("{} — IVD", work.name())));
                let folder = source.file.as_deref().and_then(Path::parent).filter(|folder| folder.is_dir());
                if work.of.is_some() && work.files.file.is_some() {
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
        (self.turning, self.word, self.waits, self.chooses) = (None, None, None, None);
        self.notes.clear();
        (self.wish, self.making, self.previous) = (None, None, None);
        (self.inside, self.meanwhile) = (None, None);
        self.seen = Seen::default();
        (self.ruler_from, self.bone_from) = (None, None);
        (self.typed, self.selected) = (Typed::default(), None);
        self.asked = None;
        self.awaited = Awaited::default();
        self.size = ([0; 2], 0.0, true);
        self.lost = false;
    }

    /// Whether something would be lost.
    pub(crate) fn is_unsaved(&self) -> bool {
        let figures = self.shown.figures();
        let is_lost = figures.is_some_and(|figures| figures.unsaved || self.lost);
        // What is made again has nothing to show of what was done before.
        self.work.is_some() && (is_lost || self.before.is_some())
    }

    /// Whether something is asked that can't be left open.
    fn must_answer(&self) -> bool {
        matches!(self.dialog, Some(Dialog::Missed { .. }))
    }

    /// Opens what is dropped into the window.
    pub(crate) fn dropped(&mut self, context: &Context) {
        let (dropped, hovers) =
            context.input(|input| (input.raw.dropped_files.clone(), !input.raw.hovered_files.is_empty()));
        if let Some(file) = dropped.first().filter(|_| !self.must_answer()) {
            self.open(Source { file: Some(file.path().to_owned()), ..Source::default() }, context);
        }
        if hovers {
            let until = Some(context.input(|input| input.time) + 0.3);
            self.word = Some(Word { until, ..Word::of("Let go to open it.".to_owned()) });
            context.request_repaint_after_secs(0.3);
        }
    }

    /// Asks before the window is closed with what would be lost.
    pub(crate) fn closing(&mut self, context: &Context) {
        if !context.input(|input| input.viewport().close_requested()) {
            return;
        }
        if self.must_answer() {
            context.send_viewport_cmd(ViewportCommand::CancelClose);
        } else if self.is_unsaved() {
            context.send_viewport_cmd(ViewportCommand::CancelClose);
            self.dialog = Some(Dialog::Unsaved(Then::Quit));
        } else if self.recording.is_some() {
            context.send_viewport_cmd(ViewportCommand::CancelClose);
            self.dialog = Some(Dialog::Recorded);
        }
    }
}
