//! What all connections share.

use std::collections::{BTreeMap, BTreeSet};
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::Instant;

use ivd_frames::{Client, File, Frame, Output, Request, Scan, Service, TOO_MUCH};
use serde_json::{Value as Json, json};
use tokio::sync::{Semaphore, mpsc, watch};

use crate::token::Token;
use crate::wheel::{Turn, Wheel};

/// Most connections.
const CONNECTIONS: usize = 8;
/// Words that wait for a connection; more are let go.
const WORDS: usize = 64;
/// Notes that are kept for those who come later.
const NOTES: usize = 50;

/// A file that somebody waits for, or why there is none.
pub(crate) type Answer = Result<Arc<File>, String>;

/// What is said to one connection beside frames.
pub(crate) struct Said {
    /// Something to read.
    pub(crate) words: mpsc::Receiver<Json>,
    /// What was asked for; not let go, as there is one at a time.
    pub(crate) files: mpsc::Receiver<Answer>,
}

/// Where that is said.
struct Ear {
    words: mpsc::Sender<Json>,
    files: mpsc::Sender<Answer>,
}

/// What is shown.
#[derive(Debug, Clone)]
pub(crate) enum Shown {
    /// A scan that is opened.
    Scan(Arc<Scan>),
    Frame(Arc<Frame>),
}

/// What somebody may do.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Role {
    Driver,
    Watcher,
}

/// What to open in a browser.
#[derive(Debug, Clone)]
pub struct Links {
    /// For who drives.
    pub drive: String,
    /// For who watches.
    pub watch: String,
}

/// What all connections share.
pub(crate) struct Hub {
    driver: Token,
    watcher: Token,
    pub(crate) places: Arc<Semaphore>,
    shown: watch::Sender<Option<Shown>>,
    /// Who drives.
    driving: watch::Sender<Option<Client>>,
    pub(crate) failed: watch::Sender<Option<Arc<ivd_frames::Error>>>,
    wheel: Mutex<Wheel>,
    ears: Mutex<BTreeMap<Client, Ear>>,
    notes: Mutex<Vec<String>>,
    /// Who waits for a file.
    saving: Mutex<BTreeSet<Client>>,
    next: AtomicU64,
    service: Mutex<Option<Service>>,
}

fn locked<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}

impl Hub {
    pub(crate) fn new(driver: Token, watcher: Token) -> Arc<Self> {
        Arc::new(Self {
            driver,
            watcher,
            places: Arc::new(Semaphore::new(CONNECTIONS)),
            shown: watch::Sender::new(None),
            driving: watch::Sender::new(None),
            failed: watch::Sender::new(None),
            wheel: Mutex::default(),
            ears: Mutex::default(),
            notes: Mutex::default(),
            saving: Mutex::default(),
            next: AtomicU64::new(1),
            service: Mutex::default(),
        })
    }

    /// The links to the page at an address.
    pub(crate) fn links(&self, address: &str) -> Links {
        Links {
            drive: format!("{address}#{}", self.driver.text()),
            watch: format!("{address}#{}", self.watcher.text()),
        }
    }

    /// The service that is asked from now on.
    pub(crate) fn set_service(&self, service: Option<Service>) {
        let before = std::mem::replace(&mut *locked(&self.service), service);
        drop(before);
    }

    /// Takes what the service gives, on its thread.
    pub(crate) fn take(&self, output: Output) {
        match output {
            Output::Note(text) => self.note(text),
            Output::Stage(name) => self.note(format!("{name} …")),
            // Pictures are packed here once, and not by each connection.
            Output::Scan(scan) => {
                scan.all_pictures().for_each(|picture| _ = picture.png());
                _ = self.shown.send_replace(Some(Shown::Scan(scan)));
            }
            Output::Frame(frame) => {
                frame.pictures.iter().for_each(|picture| _ = picture.png());
                _ = self.shown.send_replace(Some(Shown::Frame(frame)));
            }
            Output::File(client, file) => self.answer(client, file),
            Output::Problem(client, text) => self.say(client, problem(&text)),
            Output::Failed(error) => _ = self.failed.send_replace(Some(error)),
        }
    }

    /// Tells everybody something, also those who come later.
    pub(crate) fn note(&self, text: String) {
        let word = json!({ "kind": "note", "text": text });
        let mut notes = locked(&self.notes);
        notes.push(text);
        let over = notes.len().saturating_sub(NOTES);
        notes.drain(..over);
        locked(&self.ears).values().for_each(|ear| _ = ear.words.try_send(word.clone()));
        drop(notes);
    }

    pub(crate) fn say(&self, client: Client, word: Json) {
        if let Some(ear) = locked(&self.ears).get(&client) {
            let _ = ear.words.try_send(word);
        }
    }

    /// Gives somebody the file that they wait for.
    fn answer(&self, client: Client, file: Answer) {
        if let Some(ear) = locked(&self.ears).get(&client) {
            let _ = ear.files.try_send(file);
        }
    }

    /// Who somebody is by their token.
    pub(crate) fn role(&self, token: &str) -> Option<Role> {
        // Both are looked at, whichever it is.
        match (self.driver.is(token), self.watcher.is(token)) {
            (true, _) => Some(Role::Driver),
            (_, true) => Some(Role::Watcher),
            _ => None,
        }
    }

    /// A place for somebody who has said who they are.
    pub(crate) fn enter(&self) -> (Client, Said) {
        let client = self.next.fetch_add(1, Ordering::Relaxed);
        let (words, words_said) = mpsc::channel(WORDS);
        let (files, files_said) = mpsc::channel(1);
        // Nobody notes anything meanwhile.
        let notes = locked(&self.notes);
        for text in notes.iter() {
            let _ = words.try_send(json!({ "kind": "note", "text": text }));
        }
        locked(&self.ears).insert(client, Ear { words, files });
        drop(notes);
        (client, Said { words: words_said, files: files_said })
    }

    /// Somebody is gone; what they asked for isn't begun any more, and what they held is abandoned.
    pub(crate) fn leave(&self, client: Client) {
        locked(&self.ears).remove(&client);
        locked(&self.saving).remove(&client);
        if let Some(service) = locked(&self.service).as_ref() {
            service.forget(client);
        }
        self.let_go(client);
    }

    pub(crate) fn shown(&self) -> watch::Receiver<Option<Shown>> {
        let mut shown = self.shown.subscribe();
        shown.mark_changed();
        shown
    }

    pub(crate) fn driving(&self) -> watch::Receiver<Option<Client>> {
        let mut driving = self.driving.subscribe();
        driving.mark_changed();
        driving
    }

    /// Whether somebody drives, after they wish to.
    pub(crate) fn drives(&self, client: Client, asks: bool) -> bool {
        let turn = locked(&self.wheel).turn(client, asks, Instant::now());
        if let Turn::Took { from_another } = turn {
            if from_another {
                self.ask(client, Request::Abandon);
            }
            self.driving.send_replace(Some(client));
        }
        turn != Turn::Refused
    }

    /// Somebody lets go of the wheel, if they have it.
    pub(crate) fn let_go(&self, client: Client) {
        if locked(&self.wheel).let_go(client) {
            self.ask(client, Request::Abandon);
            self.driving.send_replace(locked(&self.wheel).driver());
        }
    }

    /// Somebody has the file that they waited for, or gets none.
    pub(crate) fn has_file(&self, client: Client) {
        locked(&self.saving).remove(&client);
    }

    /// Asks the service.
    pub(crate) fn ask(&self, client: Client, request: Request) {
        let saves = matches!(request, Request::Save { .. });
        if saves && !locked(&self.saving).insert(client) {
            return self.say(client, problem("a file is on its way: ask for the next when it is there"));
        }
        let taken = locked(&self.service).as_ref().is_some_and(|service| service.ask(client, request));
        match (taken, saves) {
            (true, _) => {}
            (false, true) => self.answer(client, Err(TOO_MUCH.to_owned())),
            (false, false) => self.say(client, problem(TOO_MUCH)),
        }
    }
}

/// Tells somebody why something wasn't done.
pub(crate) fn problem(text: &str) -> Json {
    json!({ "kind": "problem", "text": text })
}

#[cfg(test)]
mod tests {
    use std::sync::mpsc::channel;

    use ivd_core::Exec;
    use ivd_frames::{Error, Pane, Saved};

    use super::*;

    const SAVE: Request = Request::Save { what: Saved::Scene };

    #[test]
    fn who_asks_for_a_file_is_answered_however_much_is_said_beside() {
        let hub = Hub::new(Token::new().unwrap(), Token::new().unwrap());
        let (opens, opened) = channel::<()>();
        // It follows nothing until it is opened, and then it fails.
        let open = move |_: &_| {
            let _ = opened.recv();
            Err::<ivd_frames::Begun, _>(Error::Io { what: "a test", problem: "it ends".to_owned() })
        };
        let there = hub.clone();
        let service = Service::start(open, Exec::default(), move |output| there.take(output)).unwrap();
        hub.set_service(Some(service));
        let (client, mut said) = hub.enter();
        // Far more than waits, and far more than is said of it.
        for pane in [Pane::Axial, Pane::Coronal].iter().cycle().take(2000) {
            hub.ask(client, Request::Slice { pane: *pane, steps: 1 });
        }
        for _ in 0..3 {
            hub.ask(client, SAVE);
            assert_eq!(said.files.blocking_recv().unwrap().unwrap_err(), TOO_MUCH);
            hub.has_file(client);
        }
        drop(opens);
        hub.set_service(None);
    }
}
