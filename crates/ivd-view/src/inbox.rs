//! What the service has given and the window has not yet looked at.

use std::collections::VecDeque;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

use egui::Context;
use ivd_core::{Exec, Observer};
use ivd_frames::{Client, Entry, Error, File, Frame, Log, Output, Scan};

use crate::files::{Keeping, Keeps};

/// The one who asks for the log, to make the same again.
pub(crate) const AGAIN: Client = 1;
/// Progress is shown so often.
const SEEN: Duration = Duration::from_millis(50);
/// Notes that are kept.
const NOTES: usize = 50;

/// What came last of everything.
#[derive(Default)]
pub(crate) struct Inbox {
    pub(crate) scan: Option<Arc<Scan>>,
    pub(crate) frame: Option<Arc<Frame>>,
    /// The stage that is run while something is opened.
    pub(crate) stage: Option<&'static str>,
    /// Its share that is done, where that is known.
    pub(crate) done: Option<(u64, u64)>,
    /// When that was shown last.
    painted: Option<Instant>,
    pub(crate) notes: VecDeque<String>,
    pub(crate) problems: VecDeque<String>,
    /// What was written where, or why not.
    pub(crate) kept: VecDeque<(Keeps, Result<String, String>)>,
    /// What was done, to make the same again; or why that isn't known.
    pub(crate) done_before: Option<Result<Vec<Entry>, String>>,
    pub(crate) failed: Option<Arc<Error>>,
}

/// The inbox as both threads hold it.
#[derive(Clone)]
pub(crate) struct Shared {
    inbox: Arc<Mutex<Inbox>>,
    pub(crate) keeping: Arc<Keeping>,
    pub(crate) context: Context,
}

impl Shared {
    pub(crate) fn new(context: Context) -> Self {
        Self { inbox: Arc::default(), keeping: Arc::default(), context }
    }

    pub(crate) fn locked(&self) -> MutexGuard<'_, Inbox> {
        self.inbox.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Takes what the service gives, on its thread; what is to be kept is written here.
    pub(crate) fn take(&self, output: Output) {
        match output {
            Output::Note(text) => self.note(&text),
            Output::Stage(name) => {
                let mut inbox = self.locked();
                (inbox.stage, inbox.done) = (Some(name), None);
            }
            Output::Scan(scan) => self.locked().scan = Some(scan),
            Output::Frame(frame) => self.locked().frame = Some(frame),
            Output::File(AGAIN, file) => {
                self.locked().done_before = Some(file.and_then(|file| entries(&file)));
            }
            Output::File(_, Ok(file)) => {
                let what = file.what;
                let kept = self.keeping.write(&file);
                self.locked().kept.push_back((Keeps::Asked(what), kept));
            }
            Output::Problem(_, text) | Output::File(_, Err(text)) => self.locked().problems.push_back(text),
            Output::Failed(error) => self.locked().failed = Some(error),
        }
        self.context.request_repaint();
    }

    fn note(&self, text: &str) {
        let mut inbox = self.locked();
        if inbox.notes.len() == NOTES {
            inbox.notes.pop_front();
        }
        inbox.notes.push_back(text.to_owned());
    }
}

/// What a log says was done.
fn entries(log: &File) -> Result<Vec<Entry>, String> {
    let text = std::str::from_utf8(&log.bytes).map_err(|error| error.to_string())?;
    Ok(text.parse::<Log>()?.entries)
}

/// How work goes on, for the window, and what is noted, for the terminal too.
pub(crate) struct Watch {
    pub(crate) shared: Shared,
    pub(crate) exec: Exec,
}

impl Observer for Watch {
    fn begin(&self, _task: &'static str, total: u64) {
        self.shared.locked().done = Some((0, total));
        self.shared.context.request_repaint();
    }

    fn advance(&self, _task: &'static str, units: u64) {
        let mut inbox = self.shared.locked();
        if let Some((done, _)) = &mut inbox.done {
            *done += units;
        }
        // Threads tell it far more often than anybody looks.
        if inbox.painted.is_none_or(|painted| painted.elapsed() >= SEEN) {
            inbox.painted = Some(Instant::now());
            drop(inbox);
            self.shared.context.request_repaint();
        }
    }

    fn end(&self, _task: &'static str) {
        self.shared.locked().done = None;
    }

    fn note(&self, message: &str) {
        self.exec.observer().note(message);
        self.shared.note(message);
        self.shared.context.request_repaint();
    }
}
