//! The bar at the top: menus, tools, steps.

use egui::{Button, Context, KeyboardShortcut, Label, MenuBar, RichText, Ui};
use ivd_frames::{Pane, Request, Saved, ShownBy, Shows, Tool};
use ivd_render::Side;

use crate::dialogs::Dialog;
use crate::files::Keeps;
use crate::keys::{self, Focus, OWN};
use crate::layout::Layout;
use crate::over::name;
use crate::received::Way;
use crate::system::Purpose;
use crate::window::Window;

/// The sides that one looks from, with their names.
const SIDES: [(&str, Side); 6] = [
    ("From the front", Side::Front),
    ("From the back", Side::Back),
    ("From the left", Side::Left),
    ("From the right", Side::Right),
    ("From the top", Side::Top),
    ("From the bottom", Side::Bottom),
];

/// A button of a menu.
pub(crate) fn item(ui: &mut Ui, is_there: bool, text: &str, keys: Option<&KeyboardShortcut>) -> bool {
    let button = Button::new(text);
    let button = match keys {
        Some(keys) => button.shortcut_text(ui.ctx().format_shortcut(keys)),
        None => button,
    };
    let pressed = ui.add_enabled(is_there, button).clicked();
    if pressed {
        ui.close();
    }
    pressed
}

/// What can be done while a handle is held.
const HELD: &str = "wheel: radius; X, Y, Z: along an axis; N: in and out; Esc: as before";

impl Window {
    /// Shows the bar.
    pub(crate) fn bar(&mut self, ui: &mut Ui) {
        MenuBar::new().ui(ui, |ui| {
            let file = ui.menu_button("File", |ui| self.file_menu(ui)).response;
            if self.focus.take_if(|to| *to == Focus::Menus).is_some() {
                file.request_focus();
            }
            ui.menu_button("Edit", |ui| self.edit_menu(ui));
            ui.menu_button("View", |ui| self.view_menu(ui));
            if ui.button("Keys").on_hover_text("Mouse and keyboard: ?").clicked() {
                self.dialog = Some(Dialog::Keys);
            }
            ui.separator();
            for tool in Tool::ALL {
                let key = tool.key().to_uppercase();
                let chosen = ui.selectable_label(self.tool == tool, tool.word());
                if chosen.on_hover_text(format!("{} ({key})", doing(tool))).clicked() {
                    self.tool = tool;
                }
            }
            ui.separator();
            self.steps(ui);
            self.hint(ui);
        });
    }

    /// How the tool is used, or what is held.
    fn hint(&self, ui: &mut Ui) {
        let Some(figures) = self.shown.figures() else { return };
        let hint = if figures.held.is_some() { HELD } else { self.tool.hint() };
        ui.separator();
        ui.add(Label::new(RichText::new(hint).weak()).truncate());
    }

    /// Undo and redo by what they would do.
    fn steps(&mut self, ui: &mut Ui) {
        let [undo, redo] = self.steps_now();
        for (word, step, way) in [("Undo", undo, Way::Back), ("Redo", redo, Way::Forth)] {
            let button = ui.add_enabled(step.is_some(), Button::new(word));
            if button
                .on_hover_text(step.as_ref().map_or_else(String::new, |step| format!("{word}: {step}")))
                .clicked()
            {
                self.step(way);
            }
        }
    }

    fn file_menu(&mut self, ui: &mut Ui) {
        let is_shown = self.shown.figures().is_some();
        if item(ui, true, "Open …", Some(&keys::OPEN)) {
            self.ask_for(Purpose::Open { folder: false }, ui.ctx());
        }
        if item(ui, true, "Open a folder of slices …", None) {
            self.ask_for(Purpose::Open { folder: true }, ui.ctx());
        }
        // What a log has done again isn't of other parts.
        let is_scan = self.work.as_ref().is_some_and(|work| {
            let is_log =
                work.source.file.as_ref().is_some_and(|file| file.extension().is_some_and(|e| e == "jsonl"));
            work.files.file.is_some() && !work.is_last && !is_log
        });
        if item(ui, is_scan, "Open labels of this scan …", None) {
            self.ask_for(Purpose::Labels, ui.ctx());
        }
        if item(ui, true, "Open the demo", None) {
            self.open(ivd_frames::Source::default(), ui.ctx());
        }
        ui.separator();
        for what in Saved::ALL.into_iter().filter(|what| *what != Saved::Whole) {
            let (verb, keys) = match what {
                Saved::Scene => ("Save", Some(&keys::SAVE)),
                Saved::Volume => ("Export", Some(&keys::EXPORT)),
                _ => ("Export", None),
            };
            let is_there = is_shown && (what != Saved::Labels || self.is_labelled());
            if item(ui, is_there, &format!("{verb} {} …", what.word()), keys) {
                self.export(what, ui.ctx());
            }
        }
        if item(ui, self.work.is_some(), "Screenshot of the window …", None) {
            self.ask_for(Purpose::Keep(Keeps::Window), ui.ctx());
        }
        self.record_menu(ui);
        ui.separator();
        if item(ui, self.work.is_some(), "Close", None) {
            self.close(ui.ctx());
        }
        if item(ui, true, "Quit", Some(&keys::QUIT)) {
            quit(ui.ctx());
        }
    }

    fn is_labelled(&self) -> bool {
        self.shown.figures().is_some_and(|figures| figures.shown_by == ShownBy::Labels)
    }

    fn edit_menu(&mut self, ui: &mut Ui) {
        let [undo, redo] = self.steps_now();
        let is_shown = self.shown.figures().is_some();
        let named = |word: &str, step: &Option<String>| match step {
            Some(step) => format!("{word}: {step}"),
            None => format!("{word}: nothing"),
        };
        if item(ui, undo.is_some(), &named("Undo", &undo), Some(&keys::UNDO)) {
            self.step(Way::Back);
        }
        if item(ui, redo.is_some(), &named("Redo", &redo), Some(&keys::REDO)) {
            self.step(Way::Forth);
        }
        if item(ui, is_shown, "Take all handles, pins, cuts and bones away", None) {
            self.ask(Request::Reset);
        }
    }

    fn view_menu(&mut self, ui: &mut Ui) {
        let is_shown = self.shown.figures().is_some();
        for (words, side) in SIDES {
            if item(ui, is_shown, words, None) {
                self.ask(Request::Look { side });
            }
        }
        if item(ui, is_shown, "Whole", None) {
            self.ask(Request::ResetView);
        }
        if item(ui, self.shown.slices().is_some(), "Colours as they were", None) {
            self.ask(Request::ResetColours);
        }
        ui.separator();
        let now = self.compared().map(|compared| compared.shows);
        for (shows, keys, off, on) in [
            (Shows::Rest, keys::REST, "Show the body at rest", "Show the deformed body"),
            (Shows::Both, keys::BOTH, "Divide the pictures: at rest, deformed", "Pictures not divided"),
        ] {
            let words = if now == Some(shows) { on } else { off };
            if item(ui, is_shown, words, Some(&keys)) {
                self.toggle(shows);
            }
        }
        ui.separator();
        for pane in Pane::ALL {
            if item(ui, self.layout.alone != Some(pane), &format!("{} alone", name(pane)), None) {
                self.layout.alone = Some(pane);
            }
        }
        if item(ui, self.layout.alone.is_some(), "All four pictures", None) {
            self.layout.alone = None;
        }
        let outline =
            if self.layout.outline { "Hide the surface's outline" } else { "Show the surface's outline" };
        if item(ui, self.shown.slices().is_some(), outline, None) {
            self.layout.outline = !self.layout.outline;
        }
        let side = if self.layout.side { "Hide the side panel" } else { "Show the side panel" };
        if item(ui, true, side, None) {
            self.layout.side = !self.layout.side;
        }
        if item(ui, true, "Layout as at first", None) {
            self.layout = Layout {
                size: self.layout.size,
                folder: self.layout.folder.take(),
                kept: self.layout.kept.take(),
                ..Layout::default()
            };
        }
    }
}

/// Ends the window; what would be lost is asked about first.
pub(crate) fn quit(context: &Context) {
    context.send_viewport_cmd(egui::ViewportCommand::Close);
}

/// What a tool does.
fn doing(tool: Tool) -> &'static str {
    let words = ivd_frames::KEYS.iter().chain(&OWN).find(|(word, _)| *word == tool.word());
    words.map_or("", |(_, what)| what)
}
