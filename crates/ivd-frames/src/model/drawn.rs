//! Steps that change what is drawn and not what is deformed: looks of classes, shifted colours, rulers. They are undone and done again in the order in which
//! they were made, among those of the session.

use super::Model;
use super::looks::Looks;
use super::rulers::Places;
use crate::Error;
use crate::colours::Turned;

/// Steps that are kept.
const MOST: usize = 200;

/// What such steps change.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Drawn {
    looks: Looks,
    turned: Turned,
    rulers: Vec<Places>,
}

/// A step.
#[derive(Debug)]
struct Step {
    name: String,
    /// How many steps the session had made by then.
    after: usize,
    /// What is drawn on its other side: before it where it is done, after it where it is undone.
    other: Drawn,
}

/// The steps.
#[derive(Debug, Default)]
pub(super) struct Steps {
    done: Vec<Step>,
    undone: Vec<Step>,
}

impl Steps {
    /// What was undone of them isn't done again once something else is.
    pub(super) fn forget_undone(&mut self) {
        self.undone.clear();
    }
}

impl Model {
    /// Changes what is drawn, as a step. Changes of the same name one after the other are one: a slider or a colour is held for many.
    pub(super) fn draw_otherwise(
        &mut self,
        name: String,
        change: impl FnOnce(&mut Self) -> Result<(), Error>,
    ) -> Result<(), Error> {
        let before = self.drawn();
        change(self)?;
        if self.drawn() == before {
            return Ok(());
        }
        let after = self.session.steps().count();
        self.steps.undone.clear();
        let goes_on = self.steps.done.last().is_some_and(|last| last.after == after && last.name == name);
        if !goes_on {
            self.steps.done.push(Step { name, after, other: before });
            let many = self.steps.done.len();
            self.steps.done.drain(..many.saturating_sub(MOST));
        }
        Ok(())
    }

    /// Undoes the last step, if that is one of these; whether it is.
    pub(super) fn undo_drawn(&mut self) -> Result<bool, Error> {
        if self.last_drawn().is_none() {
            return Ok(false);
        }
        let Some(step) = self.steps.done.pop() else { return Ok(false) };
        let step = self.exchange(step)?;
        self.steps.undone.push(step);
        Ok(true)
    }

    /// Does the next step again, if that is one of these; whether it is.
    pub(super) fn redo_drawn(&mut self) -> Result<bool, Error> {
        if self.next_drawn().is_none() {
            return Ok(false);
        }
        let Some(step) = self.steps.undone.pop() else { return Ok(false) };
        let step = self.exchange(step)?;
        self.steps.done.push(step);
        Ok(true)
    }

    /// The name of what would be undone, of these or of the session.
    pub(super) fn undo_name(&self) -> Option<String> {
        self.last_drawn().or_else(|| self.session.steps().last().map(|step| step.name.clone()))
    }

    /// The name of what would be done again.
    pub(super) fn redo_name(&self) -> Option<String> {
        self.next_drawn().or_else(|| self.session.undone().map(|step| step.name.clone()))
    }

    fn last_drawn(&self) -> Option<String> {
        let last = self.steps.done.last()?;
        (last.after >= self.session.steps().count()).then(|| last.name.clone())
    }

    fn next_drawn(&self) -> Option<String> {
        let next = self.steps.undone.last()?;
        let is_due = next.after <= self.session.steps().count() || self.session.undone().is_none();
        is_due.then(|| next.name.clone())
    }

    fn drawn(&self) -> Drawn {
        Drawn { looks: self.looks.clone(), turned: self.turned, rulers: self.rulers.clone() }
    }

    /// Shows the other side of a step; gives the step with the side that was shown.
    fn exchange(&mut self, step: Step) -> Result<Step, Error> {
        let now = self.drawn();
        let Drawn { looks, turned, rulers } = step.other;
        if (&looks, turned) != (&now.looks, now.turned) {
            self.recolour(looks, turned)?;
        }
        self.rulers = rulers;
        self.carry_rulers();
        Ok(Step { other: now, ..step })
    }
}
