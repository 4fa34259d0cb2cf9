//! The system's own dialog for files, where it has one; else a path is typed.

use std::fmt;
use std::path::{Path, PathBuf};
use std::pin::Pin;
use std::sync::Arc;
use std::sync::mpsc::{Receiver, TryRecvError, channel};
use std::time::{Duration, Instant};

use egui::Context;

use crate::files::Keeps;
use crate::run::source;
use crate::window::Window;

/// Nobody gives a dialog up so soon: there was none.
const AT_ONCE: Duration = Duration::from_millis(400);

/// What is asked for.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Kind {
    /// A file that is there.
    File,
    /// A folder that is there.
    Folder,
    /// A file to be written.
    New,
}

/// A path that is asked for.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Wanted {
    /// What for, in words.
    pub title: String,
    /// What it names.
    pub kind: Kind,
    /// Where the dialog begins, if it can be told, and what a file to be written may be called.
    pub at: PathBuf,
}

/// What is answered in the end; `None` where it is given up, or where there is no dialog.
pub type Choosing = Pin<Box<dyn Future<Output = Option<PathBuf>> + Send>>;

type Ask = dyn Fn(&Wanted) -> Choosing + Send + Sync;

/// What asks for paths. The default has nothing: they are typed.
#[derive(Clone, Default)]
pub struct Chooser(Option<Arc<Ask>>);

impl fmt::Debug for Chooser {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(if self.0.is_some() { "Chooser(a dialog)" } else { "Chooser(typed)" })
    }
}

impl Chooser {
    /// Something that asks. It is called on the window's thread, and what it gives is waited for on another.
    pub fn new(ask: impl Fn(&Wanted) -> Choosing + Send + Sync + 'static) -> Self {
        Self(Some(Arc::new(ask)))
    }

    /// The system's dialog; none where there can't be one.
    pub fn system() -> Self {
        if can_be() { Self::new(ask) } else { Self::default() }
    }
}

/// Whether there may be a dialog: on Linux and the like by a portal on the session's bus, or by zenity.
fn can_be() -> bool {
    if !cfg!(all(unix, not(target_os = "macos"))) {
        return true;
    }
    let told = |name| std::env::var_os(name).filter(|value| !value.is_empty());
    let bus = told("DBUS_SESSION_BUS_ADDRESS").is_some()
        || told("XDG_RUNTIME_DIR").is_some_and(|folder| Path::new(&folder).join("bus").exists());
    let programs = told("PATH").unwrap_or_default();
    bus || std::env::split_paths(&programs).any(|folder| folder.join("zenity").is_file())
}

fn ask(wanted: &Wanted) -> Choosing {
    let folder = if wanted.kind == Kind::New { wanted.at.parent() } else { Some(&*wanted.at) };
    let mut dialog = rfd::AsyncFileDialog::new().set_title(&wanted.title);
    if let Some(folder) = folder.filter(|folder| folder.is_dir()) {
        dialog = dialog.set_directory(folder);
    }
    match wanted.kind {
        Kind::File => path(dialog.pick_file()),
        Kind::Folder => path(dialog.pick_folder()),
        Kind::New => {
            let name = wanted.at.file_name().unwrap_or_default().to_string_lossy().into_owned();
            path(dialog.set_file_name(name).save_file())
        }
    }
}

fn path(handle: impl Future<Output = Option<rfd::FileHandle>> + Send + 'static) -> Choosing {
    Box::pin(async move { handle.await.map(|handle| handle.path().to_owned()) })
}

/// What is done with a path.
#[derive(Debug, Clone, Copy)]
pub(crate) enum Purpose {
    Open {
        folder: bool,
    },
    /// Labels of what is open.
    Labels,
    Keep(Keeps),
}

/// A dialog of the system that is shown.
pub(crate) struct Asked {
    purpose: Purpose,
    /// What is answered, and how soon.
    answer: Receiver<(Option<PathBuf>, Duration)>,
}

impl Window {
    /// Asks for a path; asked once more while the system's dialog is there, a path is typed.
    pub(crate) fn ask_for(&mut self, purpose: Purpose, context: &Context) {
        let wanted = match purpose {
            Purpose::Open { folder } => {
                let (kind, title) =
                    if folder { (Kind::Folder, "Open a folder of slices") } else { (Kind::File, "Open") };
                Wanted { title: title.to_owned(), kind, at: self.layout.folder.clone().unwrap_or_default() }
            }
            Purpose::Labels => Wanted {
                title: "Open labels of this scan".to_owned(),
                kind: Kind::File,
                at: self.layout.folder.clone().unwrap_or_default(),
            },
            Purpose::Keep(what) => {
                let at = self.offered(what.name()).into();
                Wanted { title: format!("Save {}", what.word()), kind: Kind::New, at }
            }
        };
        let again = self.chooses.take().is_some();
        if again {
            // Nothing waits for what nobody asks for any more.
            self.waits = None;
        }
        let ask = self.options.chooser.0.clone().filter(|_| !again);
        let asked = ask.and_then(|ask| {
            let (choosing, context) = (ask(&wanted), context.clone());
            let (done, answer) = channel();
            let wait = move || {
                let since = Instant::now();
                let path = pollster::block_on(choosing);
                let _ = done.send((path, since.elapsed()));
                context.request_repaint();
            };
            std::thread::Builder::new().name("files".to_owned()).spawn(wait).ok()?;
            Some(Asked { purpose, answer })
        });
        match asked {
            Some(asked) => self.chooses = Some(asked),
            None => self.ask_by_typing(purpose, context),
        }
    }

    /// Takes what the system's dialog has answered.
    pub(crate) fn chosen(&mut self, context: &Context) {
        let Some(asked) = &self.chooses else { return };
        let answer = match asked.answer.try_recv() {
            Err(TryRecvError::Empty) => return,
            Err(TryRecvError::Disconnected) => Err(asked.purpose),
            Ok((None, after)) if after < AT_ONCE => Err(asked.purpose),
            Ok((path, _)) => Ok((asked.purpose, path)),
        };
        self.chooses = None;
        match answer {
            Err(purpose) => self.ask_by_typing(purpose, context),
            Ok((Purpose::Open { .. }, Some(path))) => self.open(source(&path), context),
            Ok((Purpose::Labels, Some(path))) => self.open_labels(path, context),
            // What would be replaced was asked about there.
            Ok((Purpose::Keep(what), Some(path))) => self.keep(what, path, true, context),
            Ok((_, None)) => self.waits = None,
        }
    }
}
