//! The same made otherwise: what was done to it is done again, and what can't be is asked about.

use egui::Context;
use ivd_frames::{Entry, Event, Figures, Request, Source};

use crate::dialogs::Dialog;
use crate::window::Window;
use crate::work::{Begins, Work};

impl Window {
    /// What was done is known: the same is opened once more, made otherwise, and it is done again.
    pub(crate) fn done_before(&mut self, done: Result<Vec<Entry>, String>, context: &Context) {
        let (Some(Making { source, is_stale }), Some(work)) = (self.making.take(), &self.work) else {
            return;
        };
        match done {
            Err(problem) => self.complain(problem),
            // Something was done since.
            Ok(_) if is_stale => {
                work.ask_for_log();
                self.making = Some(Making::of(source));
            }
            Ok(entries) => {
                let again = otherwise(&entries, [&work.source, &source]);
                let before = Before { again: source.clone(), source: work.source.clone(), entries };
                self.begin_again(&source, again, context);
                self.before = self.work.is_some().then_some(before);
            }
        }
    }

    /// Opens something in the place of what is open, and does to it what was done.
    fn begin_again(&mut self, source: &Source, entries: Vec<Entry>, context: &Context) {
        let left = self.work.take().and_then(|work| work.leave(entries.len()));
        self.clear();
        self.begin(source, Begins::Again(entries, left), context);
    }

    /// Opens what was open before the same was made otherwise.
    pub(crate) fn as_it_was(&mut self, before: Before, context: &Context) {
        self.begin_again(&before.source, before.entries, context);
    }

    /// What was open before something that was to be made otherwise and has ended, with what was done to it.
    pub(crate) fn as_before(&mut self, ended: Option<Work>) -> Option<(Source, Begins)> {
        let work = ended?;
        let before = self.before.take().filter(|before| before.again == work.source);
        let left = work.close();
        before.map(|before| (before.source, Begins::Again(before.entries, left)))
    }

    /// Asks about what couldn't be done again, once it is made otherwise.
    pub(crate) fn missed(&mut self, figures: &Figures) {
        let before = self.before.take().filter(|_| !figures.missed.is_empty());
        if let Some(before) = before {
            self.dialog = Some(Dialog::Missed { missed: figures.missed.clone(), before });
        }
    }
}

/// What is to be made as soon as it is known what was done.
pub(crate) struct Making {
    source: Source,
    /// Whether something was done since that was asked.
    is_stale: bool,
}

impl Making {
    pub(crate) fn of(source: Source) -> Self {
        Self { source, is_stale: false }
    }

    /// Something is asked for meanwhile.
    pub(crate) fn ask(&mut self, request: &Request) {
        self.is_stale |= !matches!(request, Request::Hover { .. } | Request::Resize { .. });
    }
}

/// What was open before the same was made otherwise.
pub(crate) struct Before {
    /// What is made.
    again: Source,
    /// What was open.
    source: Source,
    /// What was done to it.
    entries: Vec<Entry>,
}

/// What was done, without what is said otherwise from now on.
fn otherwise(entries: &[Entry], sources: [&Source; 2]) -> Vec<Entry> {
    let differs = |key: &str| {
        let said = |source: &Source| {
            source.overrides.iter().find(|one| one.path.join(".") == key).map(|one| one.value.clone())
        };
        let [before, after] = sources.map(said);
        before != after
    };
    let (solver, stiffness) = (differs("deform.solver"), differs("deform.stiffness"));
    let stays = |event: &Event| match event {
        Event::Physics(_) => !solver,
        Event::Stiffness { .. } => !stiffness,
        _ => true,
    };
    let mut entries = entries.to_vec();
    for entry in &mut entries {
        if let Entry::Step(step) = entry {
            step.events.retain(stays);
        }
    }
    entries
}
