//! What is worked on: the service that draws it, and what came of it.

use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex, PoisonError};

use egui::Context;
use ivd_core::Cancel;
use ivd_frames::{Begun, Client, Error, Model, Opened, Request, Service, Source, Subject, Tell};

use crate::inbox::{Shared, Watch};
use crate::journal::{Journal, Left};
use crate::run::Options;

/// Pixels of the volume's pane until the window says how large it is.
const SIZE: [usize; 2] = [512; 2];
/// The one who asks.
const HERE: Client = 0;

/// What is worked on. Dropped, it ends; its log stays, unless it was closed.
pub(crate) struct Work {
    /// There is one until it is closed.
    service: Option<Service>,
    cancel: Cancel,
    pub(crate) shared: Shared,
    /// How it was opened, to be opened once more.
    pub(crate) source: Source,
    /// What was opened; `None` for the demo.
    pub(crate) of: Option<PathBuf>,
    /// Where the scan lies.
    pub(crate) scan: Option<PathBuf>,
    journal: Arc<Mutex<Option<Journal>>>,
    /// The log that it goes on from.
    left: Option<Left>,
    /// Whether it went on from one.
    pub(crate) goes_on: bool,
}

impl Work {
    /// Opens something in the background.
    ///
    /// - `left`: the log that it goes on from.
    ///
    /// # Errors
    /// A scene or log that can't be read; a system that starts no thread.
    pub(crate) fn open(
        source: &Source,
        left: Option<Left>,
        options: &Options,
        context: &Context,
    ) -> Result<Self, Error> {
        let Opened { loaded, is_bare, entries } = source.read()?;
        let absolute = |path: &Path| std::path::absolute(path).unwrap_or_else(|_| path.to_owned());
        let scan = loaded.scene.input.file.as_ref().map(|file| absolute(&loaded.folder.join(file)));
        let of = match &left {
            Some(left) => left.of.clone(),
            None => source.file.as_deref().map(absolute),
        };
        let again = match &left {
            // The log that was left over goes.
            Some(left) => Source { file: left.of.clone(), ..Source::default() },
            None => source.clone(),
        };
        let shared = Shared::new(context.clone());
        let mut exec = options.exec.clone();
        exec.cancel = Cancel::default();
        let exec = exec.with_observer(Arc::new(Watch { shared: shared.clone(), exec: options.exec.clone() }));
        let (cancel, cache) = (exec.cancel.clone(), options.cache.clone());
        let journal = Arc::new(Mutex::new(None));
        let (kept, folder, its_of, its_scan) =
            (journal.clone(), options.folder.clone(), of.clone(), scan.clone());
        let (its, to) = (exec.clone(), shared.clone());
        let open = move |tell: &Tell| {
            let subject = Subject::open(&loaded, is_bare, &cache, &its, tell)?;
            subject.said.iter().for_each(|said| tell.note(format!("chosen: {said}")));
            let begun = folder.map(|folder| Journal::begin(&folder, its_of.as_deref(), its_scan.as_deref()));
            let line = match begun.transpose() {
                Ok(Some((journal, line))) => {
                    *kept.lock().unwrap_or_else(PoisonError::into_inner) = Some(journal);
                    Some(line)
                }
                Ok(None) => None,
                Err(error) => {
                    tell.note(format!("no log is written, so a crash would lose what is done: {error}"));
                    None
                }
            };
            Ok(Begun { entries, line, model: Model::new(subject, SIZE, its)? })
        };
        let service = Service::start(open, exec, move |output| to.take(output))?;
        let goes_on = left.is_some();
        Ok(Self { service: Some(service), cancel, shared, source: again, of, scan, journal, left, goes_on })
    }

    /// Asks the service.
    pub(crate) fn ask(&self, request: Request) {
        if !self.service.as_ref().is_none_or(|service| service.ask(HERE, request)) {
            let problem = "too much at once: wait for what was asked before".to_owned();
            self.shared.locked().problems.push_back(problem);
        }
    }

    /// What is worked on, in a word.
    pub(crate) fn name(&self) -> String {
        let name = self.of.as_deref().and_then(Path::file_name);
        name.map_or_else(|| "demo".to_owned(), |name| name.to_string_lossy().into_owned())
    }

    /// Stops what goes on; the service ends with it.
    pub(crate) fn stop(&self) {
        self.cancel.cancel();
    }

    /// The log that it went on from was followed: its own has all of it.
    pub(crate) fn went_on(&mut self) {
        if let Some(left) = self.left.take() {
            left.remove();
        }
    }

    /// Ends in order: nothing is to be recovered.
    pub(crate) fn close(mut self) {
        self.cancel.cancel();
        self.service = None;
        if let Some(journal) = self.journal.lock().unwrap_or_else(PoisonError::into_inner).take() {
            journal.close();
        }
    }
}

impl Drop for Work {
    fn drop(&mut self) {
        self.cancel.cancel();
    }
}
