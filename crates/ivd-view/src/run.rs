//! The window on a screen.

use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::time::Duration;

use egui::{Ui, ViewportBuilder, ViewportCommand};
use ivd_artefact::Cache;
use ivd_core::Exec;
use ivd_frames::Source;

use crate::layout::{Layout, state_folder};
use crate::{Chooser, Error, Window};

/// How often it is looked whether the user has interrupted.
const LOOK: Duration = Duration::from_millis(100);

/// What comes within so long needs no word, where nothing else is said.
const SOON: Duration = Duration::from_millis(300);

/// How a window works.
#[derive(Debug, Clone)]
pub struct Options {
    /// Threads, memory, devices, who listens. Its cancellation closes the window.
    pub exec: Exec,
    /// What stages made before.
    pub cache: Arc<Cache>,
    /// Where the layout and the logs of sessions lie, which go on after a crash; `None` keeps neither.
    pub folder: Option<PathBuf>,
    /// What asks for paths.
    pub chooser: Chooser,
    /// What comes within so long needs no word.
    pub soon: Duration,
}

impl Options {
    /// With the system's usual folder for what programs keep.
    pub fn new(exec: Exec, cache: Cache) -> Self {
        Self { exec, cache: Arc::new(cache), folder: state_folder(), chooser: Chooser::system(), soon: SOON }
    }
}

/// What to open by a word that was typed: a file, or the demo.
pub fn source(word: &Path) -> Source {
    let is_demo = word == Path::new("demo") && !word.exists();
    Source { file: (!is_demo).then(|| word.to_owned()), ..Source::default() }
}

/// The window as eframe calls it.
struct App {
    window: Window,
    size: Option<[f32; 2]>,
}

impl eframe::App for App {
    fn ui(&mut self, ui: &mut Ui, _frame: &mut eframe::Frame) {
        let size = ui.ctx().content_rect().size();
        self.size = Some([size.x, size.y]);
        self.window.show(ui);
    }

    fn on_exit(&mut self) {
        self.window.end(self.size);
    }
}

/// Shows a window until it is closed.
///
/// - `source`: what it opens; without one it asks.
///
/// # Errors
/// [`Error::Screen`] where the system shows no window.
pub fn run(options: Options, source: Option<Source>) -> Result<(), Error> {
    let layout = Layout::read(options.folder.as_deref());
    let viewport = ViewportBuilder::default()
        .with_app_id("ivd")
        .with_title("IVD")
        .with_inner_size(layout.size)
        .with_min_inner_size([480.0, 360.0]);
    let native = eframe::NativeOptions { viewport, ..eframe::NativeOptions::default() };
    let cancel = options.exec.cancel.clone();
    let create = move |creation: &eframe::CreationContext<'_>| {
        creation.egui_ctx.set_theme(egui::Theme::Dark);
        // What has the keys is seen at a glance.
        creation.egui_ctx.all_styles_mut(|style| style.visuals.widgets.active.bg_stroke.width = 2.0);
        let context = creation.egui_ctx.clone();
        let watch = move || {
            while !cancel.is_cancelled() {
                std::thread::sleep(LOOK);
            }
            context.send_viewport_cmd(ViewportCommand::Close);
            context.request_repaint();
        };
        std::thread::Builder::new().name("interruption".to_owned()).spawn(watch)?;
        let app = App { window: Window::new(options, source), size: None };
        Ok(Box::new(app) as Box<dyn eframe::App>)
    };
    eframe::run_native("ivd", native, Box::new(create)).map_err(|error| Error::Screen(error.to_string()))
}
