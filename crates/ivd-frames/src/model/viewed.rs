//! Steps that change what is drawn and not what is deformed: looks of classes, shifted colours, rulers. They are undone and done again in the order in which
//! they were made, among those of the session.

use super::Model;
use super::looks::Looks;
use super::rulers::Places;
use crate::Error;
use crate::colours::{Turned, Window};

/// Steps that are kept.
const MOST: usize = 200;

/// What such steps change.
#[derive(Debug, Clone, PartialEq)]
struct ViewState {
    looks: Looks,
    turned: Turned,
    rulers: Vec<Places>,
    /// How bright slices are, of a step that changes that as well.
    window: Option<Window>,
}

/// A step.
#[derive(Debug)]
struct ViewStep {
    name: String,
    /// How many steps of the session were done by then.
    after: u64,
    /// How many of them had ever been noted when it was undone: after one more it isn't done again.
    noted: u64,
    /// What is drawn on its other side: before it where it is done, after it where it is undone.
    other: ViewState,
}

/// The steps.
#[derive(Debug, Default)]
pub(super) struct ViewSteps {
    done: Vec<ViewStep>,
    undone: Vec<ViewStep>,
    /// Whether the last goes on, as that of a slider that is held.
    goes_on: bool,
}

impl ViewSteps {
    /// What comes next is a step of its own.
    pub(super) fn end(&mut self) {
        self.goes_on = false;
    }

    /// What was done so far isn't undone: it is how a view begins.
    pub(super) fn forget(&mut self) {
        *self = Self::default();
    }
}

impl Model {
    /// Changes what is drawn, as a step.
    ///
    /// - `goes_on`: whether it may be one with others of its name, while nothing else is asked for between them.
    pub(super) fn view_otherwise(
        &mut self,
        (name, goes_on): (String, bool),
        change: impl FnOnce(&mut Self) -> Result<(), Error>,
    ) -> Result<(), Error> {
        self.view_with((name, goes_on), None, change)
    }

    /// The same where how bright slices are may change, too.
    pub(super) fn view_and_window_otherwise(
        &mut self,
        name: String,
        change: impl FnOnce(&mut Self) -> Result<(), Error>,
    ) -> Result<(), Error> {
        self.view_with((name, false), Some(self.window), change)
    }

    fn view_with(
        &mut self,
        (name, goes_on): (String, bool),
        window: Option<Window>,
        change: impl FnOnce(&mut Self) -> Result<(), Error>,
    ) -> Result<(), Error> {
        let before = self.view_state(window);
        change(self)?;
        if self.view_state(window.map(|_| self.window)) == before {
            return Ok(());
        }
        self.refused = None;
        self.session.forget_undone();
        let after = self.session.steps_done();
        let steps = &mut self.view_steps;
        steps.undone.clear();
        let is_one = |last: &ViewStep| last.after == after && last.name == name;
        if !(steps.goes_on && goes_on && steps.done.last().is_some_and(is_one)) {
            let noted = self.session.steps_noted();
            steps.done.push(ViewStep { name, after, noted, other: before });
            let many = steps.done.len();
            steps.done.drain(..many.saturating_sub(MOST));
        }
        steps.goes_on = goes_on;
        Ok(())
    }

    /// Undoes the last step, if that is one of these; whether it is.
    pub(super) fn undo_view(&mut self) -> Result<bool, Error> {
        if self.last_viewed().is_none() {
            return Ok(false);
        }
        let Some(step) = self.view_steps.done.pop() else { return Ok(false) };
        let step = ViewStep { noted: self.session.steps_noted(), ..self.exchange(step)? };
        self.view_steps.undone.retain(|undone| undone.noted == step.noted);
        self.view_steps.undone.push(step);
        Ok(true)
    }

    /// Does the next step again, if that is one of these; whether it is.
    pub(super) fn redo_view(&mut self) -> Result<bool, Error> {
        if self.next_viewed().is_none() {
            return Ok(false);
        }
        let Some(step) = self.view_steps.undone.pop() else { return Ok(false) };
        let step = self.exchange(step)?;
        self.view_steps.done.push(step);
        Ok(true)
    }

    /// The name of what would be undone, of these or of the session.
    pub(super) fn undo_name(&self) -> Option<String> {
        let last = self.last_viewed().map(|step| &step.name);
        last.or_else(|| self.session.steps().last().map(|step| &step.name)).cloned()
    }

    /// The name of what would be done again.
    pub(super) fn redo_name(&self) -> Option<String> {
        let next = self.next_viewed().map(|step| &step.name);
        next.or_else(|| self.session.undone().map(|step| &step.name)).cloned()
    }

    fn last_viewed(&self) -> Option<&ViewStep> {
        self.view_steps.done.last().filter(|last| last.after >= self.session.steps_done())
    }

    fn next_viewed(&self) -> Option<&ViewStep> {
        let is_next = |next: &&ViewStep| {
            next.noted == self.session.steps_noted() && next.after <= self.session.steps_done()
        };
        self.view_steps.undone.last().filter(is_next)
    }

    fn view_state(&self, window: Option<Window>) -> ViewState {
        ViewState { looks: self.looks.clone(), turned: self.turned, rulers: self.rulers.clone(), window }
    }

    /// Shows the other side of a step; gives the step with the side that was shown.
    fn exchange(&mut self, step: ViewStep) -> Result<ViewStep, Error> {
        let now = self.view_state(step.other.window.map(|_| self.window));
        let ViewState { looks, turned, rulers, window } = step.other;
        if (&looks, turned) != (&now.looks, now.turned) {
            self.recolour(looks, turned)?;
        }
        if let Some(window) = window {
            self.show_window(window);
        }
        self.rulers = rulers;
        self.carry_rulers();
        self.refused = None;
        Ok(ViewStep { other: now, ..step })
    }
}
