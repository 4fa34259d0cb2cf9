use std::path::Path;
use std::sync::Arc;
use std::time::{Duration, Instant};

use egui::{Event, Modifiers, MouseWheelSource, MouseWheelUnit, PointerButton, Pos2, Rect, TouchPhase, vec2};
use egui_kittest::kittest::Queryable as _;
use egui_kittest::{Harness, TestRenderer};
use ivd_artefact::Cache;
use ivd_core::Exec;
use ivd_frames::{Figures, Source};
use ivd_view::{Chooser, Options, Window};

/// A ball of 32³ voxels of 1 mm with values that fall outwards, cut halfway.
pub(crate) const BALL: &str = include_str!("../../../ivd-frames/tests/frames/ball.toml");

/// Whatever takes longer never comes.
const LONG: Duration = Duration::from_mins(1);

/// A window without a screen, and the folder that it keeps things in.
pub(crate) struct Here {
    pub(crate) harness: Harness<'static, Window>,
    pub(crate) folder: Arc<tempfile::TempDir>,
}

/// What a scene's file opens, in a folder.
pub(crate) fn scene(folder: &Path, text: &str) -> Source {
    let file = folder.join("scene.toml");
    std::fs::write(&file, text).unwrap();
    Source { file: Some(file), ..Source::default() }
}

impl Here {
    /// A window on the ball.
    pub(crate) fn ball() -> Self {
        let folder = Arc::new(tempfile::tempdir().unwrap());
        let source = scene(folder.path(), BALL);
        let mut here = Self::new(folder, Some(source), None);
        here.settle();
        here
    }

    /// A window that opens something, where paths are typed.
    pub(crate) fn new(
        folder: Arc<tempfile::TempDir>,
        source: Option<Source>,
        renderer: Option<Box<dyn TestRenderer>>,
    ) -> Self {
        Self::with_chooser(folder, source, renderer, Chooser::default())
    }

    /// The same where something else asks for paths.
    pub(crate) fn with_chooser(
        folder: Arc<tempfile::TempDir>,
        source: Option<Source>,
        renderer: Option<Box<dyn TestRenderer>>,
        chooser: Chooser,
    ) -> Self {
        Self::made(folder, source, renderer, chooser, Duration::from_millis(300))
    }

    /// A window that says at once what it does.
    pub(crate) fn telling(folder: Arc<tempfile::TempDir>, source: Source) -> Self {
        Self::made(folder, Some(source), None, Chooser::default(), Duration::ZERO)
    }

    fn made(
        folder: Arc<tempfile::TempDir>,
        source: Option<Source>,
        renderer: Option<Box<dyn TestRenderer>>,
        chooser: Chooser,
        soon: Duration,
    ) -> Self {
        let options = Options {
            soon,
            exec: Exec::default(),
            cache: Arc::new(Cache::disabled()),
            folder: Some(folder.path().join("state")),
            chooser,
        };
        let builder = Harness::builder().with_size([1000.0, 700.0]);
        let builder = match renderer {
            Some(renderer) => builder.renderer(Passed(renderer)),
            None => builder,
        };
        let harness =
            builder.build_ui_state(|ui, window: &mut Window| window.show(ui), Window::new(options, source));
        Self { harness, folder }
    }

    /// Goes on until something holds.
    pub(crate) fn until(&mut self, what: &str, holds: impl Fn(&Self) -> bool) {
        let start = Instant::now();
        loop {
            self.harness.step();
            if holds(self) {
                return;
            }
            assert!(start.elapsed() < LONG, "never: {what}");
            std::thread::sleep(Duration::from_millis(5));
        }
    }

    /// Goes on until the volume's picture is whole.
    pub(crate) fn settle(&mut self) {
        self.until("a whole picture", |here| here.harness.state().is_settled());
    }

    /// What is told, once something holds of it.
    pub(crate) fn told(&mut self, what: &str, holds: impl Fn(&Figures) -> bool) -> Figures {
        self.until(what, |here| here.harness.state().figures().is_some_and(&holds));
        self.harness.state().figures().unwrap().clone()
    }

    pub(crate) fn figures(&self) -> &Figures {
        self.harness.state().figures().unwrap()
    }

    /// The place of something that is called so.
    pub(crate) fn rect(&self, name: &str) -> Rect {
        self.harness.get_by_label(name).rect()
    }

    /// Whether something that is called so lies in the window.
    pub(crate) fn is_in_sight(&self, name: &str) -> bool {
        self.harness.ctx.content_rect().contains_rect(self.rect(name))
    }

    /// A place in a pane, by shares of it.
    pub(crate) fn at(&self, pane: &str, right: f32, down: f32) -> Pos2 {
        let rect = self.rect(pane);
        rect.min + vec2(right * rect.width(), down * rect.height())
    }

    /// The left button goes down there, or up.
    pub(crate) fn button(&mut self, pos: Pos2, pressed: bool) {
        self.harness.event(Event::PointerButton {
            pos,
            button: PointerButton::Primary,
            pressed,
            modifiers: Modifiers::NONE,
        });
        self.harness.step();
    }

    /// Turns the wheel there, away from the hand.
    pub(crate) fn wheel(&mut self, lines: f32) {
        self.harness.event(Event::MouseWheel {
            unit: MouseWheelUnit::Line,
            delta: vec2(0.0, lines),
            phase: TouchPhase::Move,
            source: MouseWheelSource::Unknown,
            modifiers: Modifiers::NONE,
        });
        self.harness.step();
    }

    pub(crate) fn has(&self, text: &str) -> bool {
        self.harness.query_all_by_label_contains(text).next().is_some()
    }

    /// Presses something that is called so.
    pub(crate) fn press(&mut self, name: &str) {
        self.harness.get_by_label(name).click();
        self.harness.step();
        self.harness.step();
    }
}

/// A renderer that was made elsewhere.
struct Passed(Box<dyn TestRenderer>);

impl TestRenderer for Passed {
    fn handle_delta(&mut self, delta: &mut egui::TexturesDelta) {
        self.0.handle_delta(delta);
    }
}
