//! What is worked on: the service that draws it, and what came of it.

use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex, PoisonError};
use std::time::Duration;

use egui::Context;
use ivd_core::Cancel;
use ivd_frames::{
    Begun, Client, Entry, Error, Model, Opened, Patience, Request, Saved, Service, Sight, Source, Subject,
    TOO_MUCH, Tell,
};
use ivd_pipeline::scene::{InputFiles, Override};

use crate::inbox::{AGAIN, Shared, Watch};
use crate::journal::{Journal, Left};
use crate::run::Options;

/// Pixels of the volume's pane until the window says how large it is.
const SIZE: [usize; 2] = [512; 2];
/// What is asked for by a button or a field may take so long: it is told how long it has taken, and can be stopped.
const PATIENCE: Duration = Duration::from_mins(2);
/// The one who asks.
const HERE: Client = 0;

/// What something begins with when it is opened.
pub(crate) enum Begins {
    /// What its source says alone.
    Anew,
    /// A log that was left over: its source.
    Left(Left),
    /// What was done before it was made again, the log that has it until that is done once more, and how it was seen.
    Again(Vec<Entry>, Option<Left>, Option<Sight>),
}

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
    /// Where the files of its input lie.
    pub(crate) files: InputFiles,
    journal: Arc<Mutex<Option<Journal>>>,
    /// The log that it goes on from, until its own has all of that.
    left: Option<Left>,
    /// Whether there were frames of it.
    is_shown: bool,
    /// Whether it can't be opened once more: it went on from a log that doesn't say how.
    pub(crate) is_last: bool,
}

impl Work {
    /// Opens something in the background.
    ///
    /// # Errors
    /// A scene or log that can't be read; a system that starts no thread.
    pub(crate) fn open(
        source: &Source,
        begins: Begins,
        options: &Options,
        context: &Context,
    ) -> Result<Self, Error> {
        let Opened { loaded, is_bare, mut entries } = source.read()?;
        let absolute = |path: &Path| std::path::absolute(path).unwrap_or_else(|_| path.to_owned());
        let files = loaded.input_files();
        let (mut again, mut of, mut is_last) = (source.clone(), source.file.as_deref().map(absolute), false);
        let mut sight = None;
        let left = match begins {
            Begins::Anew => None,
            Begins::Left(left) => {
                // The log that was left over goes; what it is of stays.
                (again, is_last) = (of_left(&left), left.with.is_none());
                of.clone_from(&left.of);
                Some(left)
            }
            Begins::Again(done, left, seen) => {
                (entries, sight) = (done, seen);
                left
            }
        };
        let shared = Shared::new(context.clone());
        let mut exec = options.exec.clone();
        exec.cancel = Cancel::default();
        let exec = exec.with_observer(Arc::new(Watch { shared: shared.clone(), exec: options.exec.clone() }));
        let (cancel, cache) = (exec.cancel.clone(), options.cache.clone());
        let journal = Arc::new(Mutex::new(None));
        let (kept, folder, its_of, its_files) =
            (journal.clone(), options.folder.clone(), of.clone(), files.clone());
        let (its, to, with) = (exec.clone(), shared.clone(), (!is_last).then(|| written(&again.overrides)));
        let open = move |tell: &Tell| {
            let subject = Subject::open(&loaded, is_bare, &cache, &its, tell)?;
            subject.notes().for_each(|note| tell.note(note));
            let begin = |folder: PathBuf| Journal::begin(&folder, its_of.as_deref(), its_files, with);
            let begun = folder.map(begin);
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
            let mut model = Model::new(subject, SIZE, its)?;
            model.wait(Patience { work: PATIENCE, ..Patience::default() });
            model.outline();
            Ok(Begun { entries, line, model })
        };
        let service = Service::start_seen(sight, open, exec, move |output| to.take(output))?;
        let (service, is_shown) = (Some(service), false);
        Ok(Self { service, cancel, shared, source: again, of, files, journal, left, is_shown, is_last })
    }

    /// Asks the service; by what number frames tell that it was followed.
    pub(crate) fn ask(&self, request: Request) -> u64 {
        let Some(service) = &self.service else { return 0 };
        if !service.ask(HERE, request) {
            self.shared.locked().problems.push_back(TOO_MUCH.to_owned());
        }
        service.asked()
    }

    /// Asks for the log, to make the same again.
    pub(crate) fn ask_for_log(&self) {
        if let Some(service) = &self.service {
            let is_asked = service.ask(AGAIN, Request::Save { what: Saved::Log });
            if !is_asked {
                self.shared.locked().done_before = Some(Err(TOO_MUCH.to_owned()));
            }
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

    /// It is shown; `whole`: with all of the log that it goes on from, of which its own has all then.
    pub(crate) fn is_shown(&mut self, whole: bool) {
        self.is_shown = true;
        if whole {
            self.goes_on();
        }
    }

    /// It goes on from its own log.
    pub(crate) fn goes_on(&mut self) {
        if let Some(left) = self.left.take() {
            left.remove();
        }
    }

    /// Ends in order: nothing is to be recovered, but for the log that it was to go on from and didn't.
    pub(crate) fn close(mut self) -> Option<Left> {
        if let Some(journal) = self.end() {
            journal.close();
        }
        if self.is_shown {
            self.goes_on();
        }
        self.left.take()
    }

    /// Ends in order; what has done so many steps goes on from its log, or from the one that has more than its own.
    pub(crate) fn leave(mut self, steps: usize) -> Option<Left> {
        let journal = self.end();
        match self.left.take() {
            Some(left) => {
                if let Some(journal) = journal {
                    journal.close();
                }
                Some(left)
            }
            None => {
                journal.map(|journal| journal.leave(self.of.take(), std::mem::take(&mut self.files), steps))
            }
        }
    }

    fn end(&mut self) -> Option<Journal> {
        self.cancel.cancel();
        self.service = None;
        self.journal.lock().unwrap_or_else(PoisonError::into_inner).take()
    }
}

/// What a log that was left over is of, as it was opened.
fn of_left(left: &Left) -> Source {
    let overrides = left.with.iter().flatten().filter_map(|word| word.parse().ok()).collect();
    let InputFiles { file, labels, .. } = left.files.clone();
    Source { file: left.of.clone(), input: file, labels, overrides }
}

/// Values of keys, as they are typed.
fn written(overrides: &[Override]) -> Vec<String> {
    overrides.iter().map(|one| format!("{}={}", one.path.join("."), one.value)).collect()
}

impl Drop for Work {
    fn drop(&mut self) {
        self.cancel.cancel();
    }
}
