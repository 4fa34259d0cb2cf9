//! The same made otherwise: what was done to it is done again, and what can't be is asked about.

use egui::Context;
use ivd_frames::{Class, Entry, Event, Figures, Physics, Request, Source};

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
                let looks = self.shown.figures().map(|figures| figures.classes.clone()).unwrap_or_default();
                let before = Before { again: source.clone(), source: work.source.clone(), entries, looks };
                self.begin_again(&source, again, before.looks.clone(), context);
                self.before = self.work.is_some().then_some(before);
            }
        }
    }

    /// Opens something in the place of what is open, does to it what was done, and lets its classes look as they did.
    fn begin_again(&mut self, source: &Source, entries: Vec<Entry>, looks: Vec<Class>, context: &Context) {
        let left = self.work.take().and_then(|work| work.leave(entries.len()));
        self.clear();
        self.begin(source, Begins::Again(entries, left), context);
        self.looks = looks;
    }

    /// Opens what was open before the same was made otherwise.
    pub(crate) fn as_it_was(&mut self, before: Before, context: &Context) {
        self.begin_again(&before.source, before.entries, before.looks, context);
    }

    /// Opens what was open before something that was to be made otherwise and has ended; whether there was something.
    pub(crate) fn begin_as_before(&mut self, ended: Option<Work>, context: &Context) -> bool {
        let Some(work) = ended else { return false };
        let before = self.before.take().filter(|before| before.again == work.source);
        let left = work.close();
        let Some(Before { source, entries, looks, .. }) = before else { return false };
        self.begin(&source, Begins::Again(entries, left), context);
        self.looks = looks;
        true
    }

    /// Something is shown that was made again: its classes look as they did, and what couldn't be done again is asked about.
    pub(crate) fn made_again(&mut self, figures: &Figures) {
        for was in std::mem::take(&mut self.looks) {
            let is = figures.classes.iter().find(|class| class.id == was.id);
            if is.is_some_and(|is| *is != was) {
                let (opacity, colour) = (Some(was.opacity), Some(was.colour));
                self.ask(Request::Class { class: was.id, hidden: was.hidden, opacity, colour });
            }
        }
        let is_open = |before: &Before| self.work.as_ref().is_some_and(|work| work.source == before.again);
        let before = self.before.take().filter(|before| is_open(before) && !figures.missed.is_empty());
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
    /// How its classes looked.
    looks: Vec<Class>,
}

/// What was done, without what is said otherwise from now on; a step of nothing else is left without events.
fn otherwise(entries: &[Entry], sources: [&Source; 2]) -> Vec<Entry> {
    let said = |key: &str| {
        let of = |source: &Source| {
            source.overrides.iter().find(|one| one.path.join(".") == key).map(|one| one.value.clone())
        };
        let [before, after] = sources.map(of);
        (before != after).then_some(after)
    };
    let (solver, stiffness) = (said("deform.solver"), said("deform.stiffness"));
    let number =
        |value: toml::Value| value.as_float().or_else(|| value.as_integer().map(|whole| whole as f64));
    let stiff = stiffness.clone().flatten().and_then(number);
    let stays = |event: &mut Event| match event {
        Event::Physics(physics) => {
            if let Some(stiff) = stiff {
                match physics {
                    Physics::Ring(params) => params.stiffness = stiff,
                    Physics::Springs(params) => params.springs.stiffness = stiff,
                }
            }
            solver.is_none()
        }
        Event::Stiffness { .. } => stiffness.is_none(),
        _ => true,
    };
    let mut entries = entries.to_vec();
    for entry in &mut entries {
        if let Entry::Step(step) = entry {
            step.events.retain_mut(stays);
        }
    }
    entries
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_said_otherwise_from_now_on_is_not_taken_back_by_what_was_done() {
        let source = |said: &[&str]| {
            let overrides = said.iter().map(|one| one.parse().unwrap()).collect();
            Source { overrides, ..Source::default() }
        };
        let step = |events: &[&str]| {
            let events: Vec<Event> =
                events.iter().map(|event| serde_json::from_str(event).unwrap()).collect();
            Entry::Step(ivd_frames::Step { name: "it".to_owned(), events })
        };
        let physics = serde_json::to_string(&Event::Physics(Physics::Ring(<_>::default()))).unwrap();
        let done = [
            step(&[&physics, r#"{"stiffness":{"newton_per_metre":60.0}}"#]),
            step(&[r#"{"stiffness":{"newton_per_metre":70.0}}"#, r#"{"level":2}"#]),
            Entry::Undo,
        ];
        let events = |entries: &[Entry]| -> Vec<usize> {
            let steps = entries.iter().filter_map(|entry| match entry {
                Entry::Step(step) => Some(step.events.len()),
                _ => None,
            });
            steps.collect()
        };
        let plain = source(&[]);
        assert_eq!(otherwise(&done, [&plain, &source(&["lattice.iso=3"])]), done);
        let stiffer = otherwise(&done, [&plain, &source(&["deform.stiffness=80"])]);
        assert_eq!(events(&stiffer), [1, 1]);
        let Entry::Step(first) = &stiffer[0] else { panic!("{stiffer:?}") };
        let Event::Physics(Physics::Ring(ring)) = &first.events[0] else { panic!("{first:?}") };
        assert_eq!(ring.stiffness, 80.0);
        let other = otherwise(&done, [&plain, &source(&["deform.solver=xpbd"])]);
        assert_eq!((events(&other), other.len()), (vec![1, 2], 3));
    }
}
