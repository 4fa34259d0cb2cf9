//! The same made otherwise: what was done to it is done again, and what can't be is asked about.

use egui::{Context, Popup};
use ivd_frames::{Class, Entry, Figures, Request, Ruler, Shows, Sight, Source, Spot};

use crate::dialogs::Dialog;
use crate::made::{AsBefore, told};
use crate::received::Way;
use crate::waits::does_something;
use crate::window::Window;
use crate::work::{Begins, Work};

/// A handle that has gone less far (mm) is where it was.
const TOLD: f64 = 0.05;

/// How it is called as a step.
const REMADE: &str = "make the surface otherwise";

impl Window {
    /// What undoing and doing again would do now: the surface that was made last is a step, too, until something else is done.
    pub(crate) fn steps_now(&self) -> [Option<String>; 2] {
        let figures = self.shown.figures();
        let [undo, redo] =
            [figures.and_then(|told| told.undo.clone()), figures.and_then(|told| told.redo.clone())];
        match self.previous.as_ref().and_then(|previous| previous.step).filter(|_| figures.is_some()) {
            Some(Way::Forth) => [Some(REMADE.to_owned()), redo],
            Some(Way::Back) => [undo, Some(REMADE.to_owned())],
            None => [undo, redo],
        }
    }

    /// Goes a step back or forth.
    pub(crate) fn step(&mut self, way: Way) {
        if self.making.is_some() || self.before.is_some() {
            // It is on its way; what was done before isn't meant.
            return;
        }
        let previous =
            self.previous.as_ref().filter(|previous| previous.step.is_some_and(|made| made != way));
        match (previous.map(|previous| previous.source.clone()), way) {
            (Some(source), _) => self.make_of(source, way),
            (None, Way::Back) => self.ask(Request::Undo),
            (None, Way::Forth) => self.ask(Request::Redo),
        }
    }

    /// What was done is known: the same is opened once more, made otherwise, and it is done again.
    pub(crate) fn done_before(&mut self, done: Result<Vec<Entry>, String>, context: &Context) {
        let (Some(Making { source, way, is_stale }), Some(work)) = (self.making.take(), &self.work) else {
            return;
        };
        match done {
            Err(problem) => self.complain(problem),
            // Something was done since.
            Ok(_) if is_stale => {
                work.ask_for_log();
                self.making = Some(Making::of(source, way));
            }
            Ok(entries) => {
                let figures = self.shown.figures();
                let mut seen = figures.map(Seen::of).unwrap_or_default();
                let made = figures.map_or_else(String::new, |figures| told(&figures.made));
                let (again, previous) = (source.clone(), self.previous.clone());
                let handles = seen.handles.iter().map(|handle| handle.id).collect();
                let was = AsBefore { source: work.source.clone(), made, handles, step: Some(way) };
                if let Some(previous) = previous.as_ref().filter(|previous| previous.source == source) {
                    // Those that there were before go back to where they were.
                    seen.handles.retain(|handle| !previous.handles.contains(&handle.id));
                }
                let before = Before { again, was, entries, seen, previous };
                self.begin_again(&source, before.entries.clone(), before.seen.clone(), context);
                self.before = self.work.is_some().then_some(before);
            }
        }
    }

    /// Opens something in the place of what is open, does to it what was done, and shows it as it was seen.
    fn begin_again(&mut self, source: &Source, entries: Vec<Entry>, seen: Seen, context: &Context) {
        let left = self.work.take().and_then(|work| work.leave(entries.len()));
        let shown = self.shown.figures().cloned();
        let meanwhile = shown.map(|figures| Meanwhile {
            figures,
            notes: self.notes.clone(),
            extent_mm: self.extent_mm(),
            selected: self.selected,
            previous: self.previous.clone(),
        });
        let wish = self.wish.take();
        self.clear();
        self.begin(source, Begins::Again(entries, left, seen.sight), context);
        self.wish = wish;
        self.goes_on_showing(meanwhile, context);
        self.seen = seen;
    }

    /// The list beside the pictures stays as it was, out of use, until something is there.
    fn goes_on_showing(&mut self, meanwhile: Option<Meanwhile>, context: &Context) {
        let Some(meanwhile) = meanwhile.filter(|_| self.work.is_some()) else { return };
        // They would stay in use.
        Popup::close_all(context);
        (self.selected, self.previous) = (meanwhile.selected, meanwhile.previous.clone());
        self.meanwhile = Some(meanwhile);
    }

    /// Opens what was open before the same was made otherwise.
    pub(crate) fn as_it_was(&mut self, before: Before, context: &Context) {
        self.begin_again(&before.was.source, before.entries, before.seen, context);
        self.previous = before.previous;
    }

    /// Opens what was open before something that was to be made otherwise and has ended; whether there was something.
    pub(crate) fn begin_as_before(
        &mut self,
        ended: Option<Work>,
        meanwhile: Option<Meanwhile>,
        context: &Context,
    ) -> bool {
        let Some(work) = ended else { return false };
        let before = self.before.take().filter(|before| before.again == work.source);
        let left = work.close();
        let Some(Before { was, entries, seen, previous, .. }) = before else { return false };
        self.begin(&was.source, Begins::Again(entries, left, seen.sight), context);
        self.goes_on_showing(meanwhile, context);
        (self.seen, self.previous) = (seen, previous);
        true
    }

    /// Something is shown that was made again: it looks as it did, how far handles have gone is told, and what couldn't be done again is asked about.
    pub(crate) fn made_again(&mut self, figures: &Figures) {
        let seen = std::mem::take(&mut self.seen);
        if self.meanwhile.take().is_some() {
            // What was wished for is there.
            self.wish = None;
        }
        for was in seen.classes {
            let is = figures.classes.iter().find(|class| class.id == was.id);
            let look = |class: &Class| (class.hidden, class.opacity, class.colour.clone());
            if is.is_some_and(|is| look(is) != look(&was)) {
                let (opacity, colour) = (Some(was.opacity), Some(was.colour));
                self.ask(Request::Class { class: was.id, hidden: was.hidden, opacity, colour });
            }
        }
        if !seen.requests.is_empty() {
            // Those of its scene may be others by now.
            let rulers = figures.rulers.iter().map(|ruler| Request::Unmeasure { ruler: ruler.id });
            rulers.chain(seen.requests).for_each(|request| self.ask(request));
            self.ask(Request::Restored);
        }
        let level = seen.level.filter(|was| *was != figures.level);
        let level = level.map(|was| format!("its level is {}, {was} before", figures.level));
        let away = farthest(&seen.handles, &figures.handles);
        let away = away
            .map(|away| format!("handles took other vertices, up to {away:.1} mm from those that they had"));
        let differs: Vec<String> = [level, away].into_iter().flatten().collect();
        if !differs.is_empty() {
            let told = format!("Made again: {}", differs.join("; "));
            self.notes.push(told.clone());
            self.say(told);
        }
        let is_open = |before: &Before| self.work.as_ref().is_some_and(|work| work.source == before.again);
        let before = self.before.take().filter(is_open);
        if let Some(before) = &before {
            // What couldn't be done again isn't brought back by going back.
            let step = before.was.step.filter(|_| figures.missed.is_empty());
            self.previous = Some(Box::new(AsBefore { step, ..before.was.clone() }));
        }
        if let Some(before) = before.filter(|_| !figures.missed.is_empty()) {
            self.dialog = Some(Dialog::Missed { missed: figures.missed.clone(), before });
        }
    }
}

/// How something was seen, and what no log has.
#[derive(Clone, Default)]
pub(crate) struct Seen {
    sight: Option<Sight>,
    classes: Vec<Class>,
    handles: Vec<Spot>,
    level: Option<u8>,
    /// What brings all else back.
    requests: Vec<Request>,
}

impl Seen {
    fn of(figures: &Figures) -> Self {
        let (cut, overlay) = (Request::Cut { along: figures.cut }, Request::Overlay { of: figures.overlay });
        // Looking inside may take the slices elsewhere.
        let sight = Request::Show { sight: figures.sight() };
        // They go with the body, which may have moved otherwise: at rest they are where they were.
        let ruler = |ruler: &Ruler| Request::Ruler { ruler: None, places: ruler.rest.clone() };
        let mut rulers: Vec<Request> = figures.rulers.iter().map(ruler).collect();
        let at = figures.compare.at;
        if !rulers.is_empty() {
            rulers.insert(0, Request::Compare { shows: Shows::Rest, at });
        }
        rulers.push(Request::Compare { shows: figures.compare.shows, at });
        Self {
            sight: Some(figures.sight()),
            classes: figures.classes.clone(),
            handles: figures.handles.clone(),
            level: Some(figures.level),
            requests: [cut, sight, overlay].into_iter().chain(rulers).collect(),
        }
    }
}

/// How far handles have gone at rest that there were before (mm); `None` where none has.
fn farthest(before: &[Spot], after: &[Spot]) -> Option<f64> {
    let gone = |was: &Spot| {
        let is = after.iter().find(|is| is.id == was.id)?;
        Some((0..3).map(|a| (is.rest[a] - was.rest[a]).powi(2)).sum::<f64>().sqrt())
    };
    before.iter().filter_map(gone).reduce(f64::max).filter(|away| *away >= TOLD)
}

/// What goes on being shown of what is made again, until it is there.
#[derive(Clone)]
pub(crate) struct Meanwhile {
    pub(crate) figures: Figures,
    pub(crate) notes: Vec<String>,
    /// Longest side of the scan.
    pub(crate) extent_mm: f64,
    selected: Option<u32>,
    previous: Option<Box<AsBefore>>,
}

/// What is to be made as soon as it is known what was done.
pub(crate) struct Making {
    source: Source,
    way: Way,
    /// Whether something was done since that was asked.
    is_stale: bool,
}

impl Making {
    /// - `way`: whether that goes back to what was open before, as a step does that is undone.
    pub(crate) fn of(source: Source, way: Way) -> Self {
        Self { source, way, is_stale: false }
    }

    /// Something is asked for meanwhile.
    pub(crate) fn ask(&mut self, request: &Request) {
        self.is_stale |= does_something(request);
    }
}

/// What was open before the same was made otherwise.
pub(crate) struct Before {
    /// What is made.
    again: Source,
    /// What was open.
    was: AsBefore,
    /// What was done to it.
    entries: Vec<Entry>,
    /// How it was seen.
    seen: Seen,
    /// What was open before that.
    previous: Option<Box<AsBefore>>,
}
