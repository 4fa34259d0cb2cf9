//! What was done, to be undone, done again and written to a log.

use std::collections::VecDeque;
use std::fmt;

use serde::{Deserialize, Serialize};

use crate::{Event, Settings};

/// Most bytes of settings that are kept for undoing; the oldest steps are let go then.
const MOST_BYTES: usize = 16 << 20;

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

/// A step with what was before it.
#[derive(Debug, Clone)]
pub(crate) struct Past {
    pub(crate) step: Step,
    pub(crate) before: Settings,
}

impl Past {
    /// About how many bytes it takes.
    fn bytes(&self) -> usize {
        let Settings { handles, fixed, shapes, bones, space, clip, .. } = &self.before;
        let moved = size_of_val(&**handles) + size_of_val(&**fixed) + size_of_val(&**shapes);
        let lists = moved + size_of_val(&**bones) + size_of_val(&**space) + size_of_val(&*clip.parts);
        size_of::<Self>() + lists + self.step.name.len() + size_of_val(&*self.step.events)
    }
}

/// Steps that can be undone, and those that can be done again.
#[derive(Debug, Default)]
pub(crate) struct History {
    past: VecDeque<Past>,
    bytes: usize,
    /// The last undone last.
    undone: Vec<Step>,
}

impl History {
    /// Notes a step; what was undone can't be done again.
    pub(crate) fn push(&mut self, step: Step, before: Settings) {
        self.undone.clear();
        self.again(step, before);
    }

    fn again(&mut self, step: Step, before: Settings) {
        let past = Past { step, before };
        self.bytes += past.bytes();
        self.past.push_back(past);
        while self.bytes > MOST_BYTES
            && let Some(oldest) = self.past.pop_front()
        {
            self.bytes -= oldest.bytes();
        }
    }

    /// The last step, if there is one.
    pub(crate) fn last(&self) -> Option<&Past> {
        self.past.back()
    }

    /// Moves the last step to those that can be done again.
    pub(crate) fn undo(&mut self) {
        if let Some(past) = self.past.pop_back() {
            self.bytes -= past.bytes();
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

    pub(crate) fn into_step(self) -> Step {
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

    #[test]
    fn the_oldest_steps_go_when_there_are_too_many() {
        let mut history = History::default();
        let step = |number: usize| Step { name: number.to_string(), events: vec![Event::Level(1)] };
        let count = 3 * MOST_BYTES / size_of::<Past>() / 2;
        (0..count).for_each(|number| history.push(step(number), Settings::default()));
        let kept: Vec<&str> = history.steps().map(|step| step.name.as_str()).collect();
        assert!(kept.len() < count && kept.len() > count / 4, "{} of {count}", kept.len());
        assert_eq!(kept.last().copied(), Some(&*(count - 1).to_string()));
        while history.last().is_some() {
            history.undo();
        }
        assert_eq!(history.bytes, 0);
    }
}
