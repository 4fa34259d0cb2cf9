//! What is told while a subject is opened.

use std::collections::VecDeque;
use std::sync::{Arc, Mutex, PoisonError};

use ivd_core::Volume;
use ivd_pipeline::scene::WindowSection;
use ivd_session::Entry;

use crate::Model;
use crate::preview::AtRest;
use crate::queue::Queue;

/// Tells a window what goes on while something is opened. The default tells nobody.
#[derive(Clone, Default)]
pub struct Tell(Option<(Arc<Waiting>, Arc<Queue>)>);

/// What was told and nobody has heard yet.
type Waiting = Mutex<VecDeque<Told>>;

/// Something that was told.
pub(crate) enum Told {
    Stage(&'static str),
    Note(String),
    Scan(Box<(Volume, WindowSection)>),
    AtRest(Box<AtRest>),
    /// There will be no more.
    Done,
}

impl Tell {
    pub(crate) fn through(queue: Arc<Queue>) -> Self {
        Self(Some((Arc::default(), queue)))
    }

    /// A stage begins.
    pub fn stage(&self, name: &'static str) {
        self.push(Told::Stage(name));
    }

    /// Something to read.
    pub fn note(&self, text: String) {
        self.push(Told::Note(text));
    }

    /// The scan is read; `said`: what its scene says that windows show.
    pub fn scan(&self, volume: &Volume, said: Option<&WindowSection>) {
        if self.0.is_some() {
            self.push(Told::Scan(Box::new((volume.clone(), said.cloned().unwrap_or_default()))));
        }
    }

    /// The volume can be drawn, though not moved yet.
    pub(crate) fn at_rest(&self, seen: impl FnOnce() -> AtRest) {
        if self.0.is_some() {
            self.push(Told::AtRest(Box::new(seen())));
        }
    }

    fn push(&self, told: Told) {
        let Some((waiting, queue)) = &self.0 else { return };
        waiting.lock().unwrap_or_else(PoisonError::into_inner).push_back(told);
        queue.wake();
    }

    pub(crate) fn next(&self) -> Option<Told> {
        let (waiting, _) = self.0.as_ref()?;
        waiting.lock().unwrap_or_else(PoisonError::into_inner).pop_front()
    }

    /// Says that all is told as soon as it is dropped, whatever the reason.
    pub(crate) fn done(&self) -> Done {
        Done(self.clone())
    }
}

pub(crate) struct Done(Tell);

impl Drop for Done {
    fn drop(&mut self) {
        self.0.push(Told::Done);
    }
}

/// A line of the log, without its end, as it is written.
pub type Line = Box<dyn FnMut(&str) + Send + Sync>;

/// A model, and how it goes on.
pub struct Begun {
    /// It.
    pub model: Model,
    /// What is done again first.
    pub entries: Vec<Entry>,
    /// Is given every line of the log, without what its files are called.
    pub line: Option<Line>,
}

impl From<Model> for Begun {
    fn from(model: Model) -> Self {
        Self { model, entries: Vec::new(), line: None }
    }
}
