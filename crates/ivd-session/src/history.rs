//! What was done, to be undone, done again and written to a log.

use std::collections::VecDeque;
use std::fmt;

use serde::{Deserialize, Serialize};

use crate::{Error, Event, Settings};

/// Most bytes of settings that are kept for undoing; the oldest steps are let go then.
const MOST_BYTES: usize = 16 << 20;
/// Of so many steps one keeps the settings before it.
const KEPT: usize = 32;

/// What is undone at once: an event, or a gesture of many.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Step {
    /// What it is called, for whoever may undo it.
    pub name: String,
    /// Its events; of those that only the last of counts, the last.
    pub events: Vec<Event>,
}

/// A line of a session's log.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Entry {
    /// Something was done.
    Step(Step),
    /// The last step was undone.
    Undo,
    /// The step undone last was done again.
    Redo,
}

/// A step that was done.
#[derive(Debug)]
struct Past {
    step: Step,
    /// The settings before it: for the oldest and for one in so many; those between follow from the steps.
    before: Option<Box<Settings>>,
}

impl Past {
    /// About how many bytes it takes.
    fn bytes(&self) -> usize {
        let lists = |settings: &Settings| {
            let Settings { handles, fixed, shapes, bones, space, clip, .. } = settings;
            let moved = size_of_val(&**handles) + size_of_val(&**fixed) + size_of_val(&**shapes);
            moved + size_of_val(&**bones) + size_of_val(&**space) + size_of_val(&*clip.parts)
        };
        let before = self.before.as_deref().map_or(0, |settings| size_of_val(settings) + lists(settings));
        size_of::<Self>() + before + self.step.name.len() + size_of_val(&*self.step.events)
    }
}

/// Steps that can be undone, and those that can be done again.
#[derive(Debug, Default)]
pub(crate) struct History {
    past: VecDeque<Past>,
    bytes: usize,
    /// The last undone last.
    undone: Vec<Step>,
    /// How many are done, also those that were let go, and how many were ever noted.
    done: u64,
    noted: u64,
}

impl History {
    /// Notes a step; what was undone can't be done again.
    pub(crate) fn push(&mut self, step: Step, before: Settings) {
        self.undone.clear();
        self.noted += 1;
        self.again(step, before);
    }

    /// What was undone can't be done again.
    pub(crate) fn forget_undone(&mut self) {
        self.undone.clear();
    }

    /// How many steps are done, also those that are no longer kept, and how many were ever noted.
    pub(crate) fn counts(&self) -> [u64; 2] {
        [self.done, self.noted]
    }

    fn again(&mut self, step: Step, before: Settings) {
        self.done += 1;
        let is_due = self.past.iter().rev().take(KEPT - 1).all(|past| past.before.is_none());
        let past = Past { step, before: is_due.then(|| Box::new(before)) };
        self.bytes += past.bytes();
        self.past.push_back(past);
        // The last stays, however large it is.
        while self.bytes > MOST_BYTES && self.past.len() > 1 {
            self.let_go();
        }
    }

    /// Lets the oldest step go; the one after it takes over what was before it.
    fn let_go(&mut self) {
        let Some(oldest) = self.past.pop_front() else { return };
        self.bytes -= oldest.bytes();
        let Some(next) = self.past.front_mut().filter(|next| next.before.is_none()) else { return };
        let before = oldest.before.and_then(|before| before.after_all(&oldest.step.events).ok());
        self.bytes -= next.bytes();
        next.before = before.map(Box::new);
        self.bytes += next.bytes();
    }

    /// The settings before the last step; `None` where there is no step.
    ///
    /// # Errors
    /// As [`Settings::after`], though what was done once can be done again.
    pub(crate) fn before(&self) -> Result<Option<Settings>, Error> {
        let kept =
            self.past.iter().enumerate().rev().find_map(|(i, past)| Some((i, past.before.as_deref()?)));
        let Some((first, settings)) = kept else { return Ok(None) };
        let steps = self.past.range(first..self.past.len() - 1);
        settings.after_all(steps.flat_map(|past| &past.step.events)).map(Some)
    }

    /// Moves the last step to those that can be done again.
    pub(crate) fn undo(&mut self) {
        if let Some(past) = self.past.pop_back() {
            self.bytes -= past.bytes();
            self.done -= 1;
            self.undone.push(past.step);
        }
    }

    /// The step that was undone last.
    pub(crate) fn next(&self) -> Option<&Step> {
        self.undone.last()
    }

    /// Moves that back to the past.
    pub(crate) fn redo(&mut self, before: Settings) {
        if let Some(step) = self.undone.pop() {
            self.again(step, before);
        }
    }

    pub(crate) fn steps(&self) -> impl Iterator<Item = &Step> {
        self.past.iter().map(|past| &past.step)
    }
}

/// A gesture that goes on.
#[derive(Debug)]
pub(crate) struct Gesture {
    pub(crate) name: String,
    pub(crate) before: Settings,
    events: Vec<Event>,
}

impl Gesture {
    pub(crate) fn new(name: String, before: Settings) -> Self {
        Self { name, before, events: Vec::new() }
    }

    /// Takes an event; one whose work it does again is let go.
    pub(crate) fn take(&mut self, event: Event) {
        // Past those that set other things it may be found as well; not past what makes or takes away what is set.
        let sets = |event: &&Event| event.replaces(event);
        let behind = self.events.iter().rev().take_while(sets).position(|earlier| event.replaces(earlier));
        if let Some(behind) = behind {
            self.events.remove(self.events.len() - 1 - behind);
        }
        self.events.push(event);
    }

    pub(crate) fn into_step(mut self) -> Step {
        self.events.shrink_to_fit();
        Step { name: self.name, events: self.events }
    }
}

/// What is called with a line of the log.
type Record = dyn FnMut(&Entry) + Send + Sync;

/// Whoever writes the log.
#[derive(Default)]
pub(crate) struct Recorder(pub(crate) Option<Box<Record>>);

impl Recorder {
    pub(crate) fn note(&mut self, entry: &Entry) {
        if let Self(Some(record)) = self {
            record(entry);
        }
    }
}

impl fmt::Debug for Recorder {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_tuple("Recorder").field(&self.0.is_some()).finish()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The step of that number, and the settings before it.
    fn step(number: usize) -> (Step, Settings) {
        let level = |number: usize| (number % 16) as u8;
        let step = Step { name: number.to_string(), events: vec![Event::Level(level(number))] };
        (step, Settings { level: level(number - 1), ..Settings::default() })
    }

    #[test]
    fn what_was_before_each_step_follows_from_what_is_kept() {
        let mut history = History::default();
        for n in 1..=100 {
            let (step, before) = step(n);
            // Whatever is undone and done again in between.
            history.push(step, before.clone());
            if n % 7 == 0 {
                history.undo();
                history.redo(before);
            }
        }
        let kept = history.past.iter().filter(|past| past.before.is_some()).count();
        assert!(kept < 8, "{kept} of 100");
        for n in (1..=100).rev() {
            assert_eq!(
                history.before().unwrap().map(|settings| settings.level),
                Some(((n - 1) % 16) as u8),
                "{n}"
            );
            history.undo();
        }
        assert_eq!((history.before().unwrap(), history.bytes), (None, 0));
    }

    /// Bytes of a name: under 17,000 of such steps are too many.
    const NAME: usize = 1000;

    #[test]
    fn the_oldest_steps_go_when_there_are_too_many() {
        let mut history = History::default();
        let count = MOST_BYTES / NAME;
        for number in 1..=count {
            let (step, before) = step(number);
            history.push(Step { name: "n".repeat(NAME), ..step }, before);
        }
        let kept = history.steps().count();
        assert_eq!(history.counts(), [count as u64; 2], "those that were let go count");
        assert!(kept < count && history.bytes <= MOST_BYTES && history.bytes > MOST_BYTES - (1 << 16));
        for number in (count - kept + 1..=count).rev() {
            assert_eq!(history.before().unwrap().map(|settings| settings.level), Some(step(number).1.level));
            history.undo();
        }
        assert_eq!((history.before().unwrap(), history.bytes), (None, 0));
    }
}
