//! What a log says, done again.

use ivd_core::{Classified as _, ErrorClass};
use ivd_session::Entry;

use super::Model;
use crate::figures::Missed;
use crate::{Error, Pane};

/// Which steps of a log were done again: an undo of one that wasn't has nothing to undo.
#[derive(Debug, Default)]
struct Steps {
    past: Vec<bool>,
    undone: Vec<bool>,
}

impl Steps {
    /// Whether an entry that goes back or forth has something to do.
    fn goes(&mut self, entry: &Entry) -> bool {
        let (from, to) = match entry {
            Entry::Undo => (&mut self.past, &mut self.undone),
            Entry::Redo => (&mut self.undone, &mut self.past),
            Entry::Step(_) => return true,
        };
        // Without a step that is known the session says that there is none.
        let Some(was_done) = from.pop() else { return true };
        to.push(was_done);
        was_done
    }

    fn note(&mut self, entry: &Entry, is_done: bool) {
        if matches!(entry, Entry::Step(_)) {
            self.undone.clear();
            self.past.push(is_done);
        }
    }
}

impl Model {
    /// Does again what a log says. What can't be done is left out, and so is what goes on from it alone; the figures keep it as [`crate::Figures::missed`].
    ///
    /// # Errors
    /// Says what couldn't be done again; all else is done.
    pub fn replay(&mut self, entries: &[Entry]) -> Result<(), Error> {
        let mut steps = Steps::default();
        let mut missed = Vec::new();
        for entry in entries {
            if !steps.goes(entry) {
                continue;
            }
            // Of which nothing is left is no step.
            if matches!(entry, Entry::Step(step) if step.events.is_empty()) {
                steps.note(entry, false);
                continue;
            }
            let done = self.session.replay(entry.clone(), &self.exec);
            steps.note(entry, done.is_ok());
            match done {
                Err(error) if error.error_class() == ErrorClass::Cancelled => return Err(error.into()),
                Err(error) => missed.push(Missed { name: named(entry), why: error.to_string() }),
                Ok(()) => {}
            }
        }
        self.touch(&Pane::ALL);
        self.follow_labels()?;
        self.carry_rulers();
        self.clip_rest()?;
        self.find_spots()?;
        self.missed = missed;
        if self.missed.is_empty() {
            return Ok(());
        }
        let told: Vec<String> = self.missed.iter().map(|one| format!("{}: {}", one.name, one.why)).collect();
        let (done, all) = (entries.len() - told.len(), entries.len());
        let problem = format!("{done} of {all} steps were done again; these can't be: {}", told.join("; "));
        Err(Error::Io { what: "the log", problem })
    }
}

/// What an entry of a log is called.
fn named(entry: &Entry) -> String {
    match entry {
        Entry::Step(step) => step.name.clone(),
        Entry::Undo => "undo".to_owned(),
        Entry::Redo => "redo".to_owned(),
    }
}
