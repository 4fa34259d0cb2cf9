//! Questions that the window asks, each on its own, and what is answered.

use std::path::{Path, PathBuf};

use egui::text::{CCursor, CCursorRange};
use egui::{Context, Id, Key, Modal, ScrollArea, TextEdit, Ui, ViewportCommand};
use ivd_frames::{KEYS, Missed, Request, Saved, Source};

use crate::again::Before;
use crate::files::Keeps;
use crate::journal::Left;
use crate::keys::OWN;
use crate::offered::Offered;
use crate::run::source;
use crate::system::Purpose;
use crate::window::Window;
use crate::work::Begins;

/// What is asked.
pub(crate) enum Dialog {
    /// What to open.
    Open { path: String },
    /// Labels of what is open.
    Labels { path: String },
    /// Whether the deformed volume is kept without what planes and boxes take away.
    Export { without: bool },
    /// Where to keep something.
    Keep { what: Keeps, path: String, was: Was },
    /// What would be lost.
    Unsaved(Then),
    /// Whether to go on from a log that was left over.
    Recover { left: Left, source: Source },
    /// What couldn't be done again where the same was made otherwise.
    Missed { missed: Vec<Missed>, before: Before },
    /// What was recorded would be lost.
    Recorded,
    /// What hands and keys do.
    Keys,
    /// Which of several things that a file or folder holds is to be opened.
    Offered(Offered),
    /// Something went wrong.
    Problem { title: &'static str, text: String },
}

/// What was found of a path before it is asked for.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) enum Was {
    /// Nothing yet.
    New,
    /// This file is there, which may be replaced.
    There(PathBuf),
    /// Its folder isn't there.
    Nowhere,
}

/// What is done after a question about what would be lost.
#[derive(Debug, Clone)]
pub(crate) enum Then {
    Quit,
    Close,
    Open(Source),
}

/// What a dialog comes to in a pass.
enum Answer {
    /// Not yet.
    None,
    /// Away with it.
    Away,
    /// What it asks for is done.
    Do,
    /// The other thing is done.
    Other,
}

impl Window {
    /// Shows what is asked, if anything is, and does what is answered.
    pub(crate) fn dialogs(&mut self, context: &Context) {
        let Some(mut dialog) = self.dialog.take() else { return };
        let response = Modal::new(Id::unique(("dialog", dialog.number()))).show(context, |ui| {
            ui.set_width(ui.ctx().content_rect().width().min(dialog.width()) - 20.0);
            dialog.show(ui)
        });
        let away = response.should_close();
        match response.inner {
            Answer::None | Answer::Away if matches!(dialog, Dialog::Missed { .. }) => {
                self.dialog = Some(dialog);
            }
            Answer::None if !away => self.dialog = self.dialog.take().or(Some(dialog)),
            Answer::None | Answer::Away => self.waits = None,
            Answer::Do => self.answered(dialog, context),
            Answer::Other => self.otherwise(dialog, context),
        }
    }

    fn answered(&mut self, dialog: Dialog, context: &Context) {
        match dialog {
            Dialog::Open { path } => self.open(source(Path::new(path.trim())), context),
            Dialog::Labels { path } => self.open_labels(PathBuf::from(path.trim()), context),
            Dialog::Export { without } => {
                let what = if without { Saved::Volume } else { Saved::Whole };
                self.ask_for(Purpose::Keep(Keeps::Asked(what)), context);
            }
            Dialog::Keep { what, path, was } => {
                let path = PathBuf::from(path.trim());
                let replace = was == Was::There(path.clone());
                self.keep(what, path, replace, context);
            }
            Dialog::Unsaved(then) => {
                self.ask_for(Purpose::Keep(Keeps::Asked(Saved::Scene)), context);
                self.waits = Some(then);
            }
            Dialog::Recover { left, .. } => {
                let source = Source { file: Some(left.path().to_owned()), ..Source::default() };
                self.begin(&source, Begins::Left(left), context);
            }
            Dialog::Missed { before, .. } => self.as_it_was(before, context),
            Dialog::Recorded => self.record(context),
            Dialog::Offered(offered) => self.open(offered.chosen(), context),
            Dialog::Keys | Dialog::Problem { .. } => {}
        }
    }

    fn otherwise(&mut self, dialog: Dialog, context: &Context) {
        match dialog {
            Dialog::Unsaved(then) => self.then(then, context),
            Dialog::Recover { left, source } => {
                left.remove();
                self.begin(&source, Begins::Anew, context);
            }
            Dialog::Missed { .. } => {
                if let Some(work) = &mut self.work {
                    work.goes_on();
                }
            }
            Dialog::Recorded => {
                self.recording = None;
                context.send_viewport_cmd(ViewportCommand::Close);
            }
            _ => {}
        }
    }

    /// Does what waited for an answer.
    pub(crate) fn then(&mut self, then: Then, context: &Context) {
        if let Some(work) = self.work.take() {
            work.close();
        }
        self.clear();
        match then {
            Then::Quit => context.send_viewport_cmd(ViewportCommand::Close),
            Then::Close => {}
            Then::Open(source) => self.open(source, context),
        }
    }

    /// Asks where something is to be kept, and of a volume that is clipped first how much of it.
    pub(crate) fn export(&mut self, what: Saved, context: &Context) {
        let clips = self.shown.figures().map_or(0, |figures| figures.clips.len());
        if what == Saved::Volume && clips > 0 {
            self.dialog = Some(Dialog::Export { without: false });
        } else {
            self.ask_for(Purpose::Keep(Keeps::Asked(what)), context);
        }
    }

    /// Asks for a path to be typed.
    pub(crate) fn ask_by_typing(&mut self, purpose: Purpose, context: &Context) {
        // The field takes the keys from what was pressed.
        context.memory_mut(|memory| {
            if let Some(has_keys) = memory.focused() {
                memory.surrender_focus(has_keys);
            }
        });
        self.dialog = Some(match purpose {
            Purpose::Open { .. } => Dialog::Open { path: self.folder_typed() },
            Purpose::Labels => Dialog::Labels { path: self.folder_typed() },
            Purpose::Keep(what) => {
                let path = self.offered(what.name());
                Dialog::Keep { what, path, was: Was::New }
            }
        });
    }

    /// How a path begins that is typed.
    fn folder_typed(&self) -> String {
        let folder = self.layout.folder.as_ref().map(|folder| format!("{}/", folder.display()));
        folder.unwrap_or_default()
    }

    /// Where something is kept unless another place is said.
    pub(crate) fn offered(&self, name: &str) -> String {
        let scan = self.work.as_ref().and_then(|work| work.files.file.as_deref());
        let others = [self.layout.kept.clone(), std::env::current_dir().ok(), std::env::home_dir()];
        let folder = folder_to_keep_in(others, scan);
        let path = folder.map_or_else(|| PathBuf::from(name), |folder| folder.join(name));
        std::path::absolute(&path).unwrap_or(path).display().to_string()
    }

    /// Keeps something there; what is there already is asked about once, and a folder that isn't there is told.
    pub(crate) fn keep(&mut self, what: Keeps, path: PathBuf, replace: bool, context: &Context) {
        let given = path;
        let path = what.with_ending(given.clone());
        // What was asked about was what was given.
        let replace = replace && path == given;
        let is_folder = |folder: &Path| folder.as_os_str().is_empty() || folder.is_dir();
        let was = match path.parent() {
            Some(folder) if !is_folder(folder) => Some(Was::Nowhere),
            _ if path.exists() && !replace => Some(Was::There(path.clone())),
            _ => None,
        };
        if let Some(was) = was {
            self.dialog = Some(Dialog::Keep { what, path: path.display().to_string(), was });
            return;
        }
        if what == Keeps::Recording {
            self.keep_recording(path, context);
            return;
        }
        let Some(work) = &self.work else { return };
        self.layout.kept = path.parent().filter(|folder| folder.is_dir()).map(Path::to_owned);
        match what {
            Keeps::Asked(what) => {
                work.shared.keeping.expect(what, path);
                self.ask(Request::Save { what });
            }
            // Taken when the dialog is gone.
            Keeps::Window => self.photograph = Some((path, context.cumulative_pass_nr() + 2)),
            Keeps::Recording => {}
        }
    }
}

impl Dialog {
    /// Tells dialogs apart: what had the keys in one has them in no other.
    fn number(&self) -> u8 {
        match self {
            Self::Open { .. } => 0,
            Self::Labels { .. } => 11,
            Self::Keep { was: Was::New, .. } => 1,
            Self::Keep { was: Was::There(_), .. } => 2,
            Self::Keep { was: Was::Nowhere, .. } => 10,
            Self::Unsaved(_) => 3,
            Self::Recover { .. } => 4,
            Self::Keys => 5,
            Self::Problem { .. } => 6,
            Self::Missed { .. } => 7,
            Self::Export { .. } => 8,
            Self::Recorded => 9,
            Self::Offered(_) => 12,
        }
    }

    /// How wide it is where there is room for it (points).
    fn width(&self) -> f32 {
        match self {
            Self::Keys => 900.0,
            Self::Offered(_) => 640.0,
            _ => 460.0,
        }
    }

    fn show(&mut self, ui: &mut Ui) -> Answer {
        match self {
            Self::Open { path } => {
                ui.heading("Open");
                ui.label("A scan (NIfTI, NRRD, MetaImage, TIFF, VTI, a folder of DICOM files or other slices …), a scene (.toml), a log (.jsonl), or the word demo. A file that is dropped into the window is opened too.");
                typed(ui, path, "Path", "Open", false)
            }
            Self::Labels { path } => {
                ui.heading("Open labels of this scan");
                ui.label("Labels that another program made of it: a whole number for every voxel, 0 where there is no part. The scan is opened anew, divided into the parts that they name; what was done to it is not done again.");
                typed(ui, path, "Path", "Open", false)
            }
            Self::Export { without } => {
                ui.heading("Export deformed volume");
                let cut = ui.checkbox(without, "cut away what planes and boxes hide, as on the screen");
                let buttons = ui.horizontal(|ui| [ui.button("Choose a place …"), ui.button("Cancel")]);
                let [choose, cancel] = buttons.inner;
                // What has the keys takes them itself.
                let is_free = ![&cut, &choose, &cancel].iter().any(|part| part.has_focus());
                if choose.clicked() || is_free && ui.input(|input| input.key_pressed(Key::Enter)) {
                    Answer::Do
                } else if cancel.clicked() {
                    Answer::Away
                } else {
                    Answer::None
                }
            }
            Self::Keep { what, path, was } => {
                ui.heading(format!("Save {}", what.word()));
                match was {
                    Was::New => {}
                    Was::There(_) => _ = ui.label("A file of this name is there already."),
                    Was::Nowhere => {
                        let text = "There is no such folder: choose one that is there.";
                        ui.colored_label(ui.visuals().warn_fg_color, text);
                    }
                }
                // Another path is asked about anew.
                let is_there = *was == Was::There(PathBuf::from(path.trim()));
                typed(ui, path, "Path", if is_there { "Replace" } else { "Save" }, is_there)
            }
            Self::Unsaved(_) => {
                ui.heading("What was done here is not saved");
                ui.label("A scene keeps handles, pins, the cut, planes and boxes, bones, stiffness, level, how voxels follow, colours, rulers, and what is seen from where.");
                choice(ui, "Save the scene …", Some("Throw it away"))
            }
            Self::Recover { left, .. } => {
                ui.heading("An earlier window ended without being closed");
                let steps = ivd_core::counted(left.steps as u64, "step was", "steps were");
                ui.label(format!("{steps} done in it, and can be done again."));
                choice(ui, "Go on from there", Some("Begin anew"))
            }
            Self::Missed { missed, .. } => {
                let steps = ivd_core::counted(missed.len() as u64, "step", "steps");
                ui.heading(format!("{steps} can't be repeated"));
                ui.label("The surface was found anew, and what is listed here doesn't fit it. Go back to the previous surface, with everything as it was, or keep the new one without what is listed.");
                ScrollArea::vertical().max_height(300.0).show(ui, |ui| {
                    for Missed { name, why } in missed {
                        ui.label(format!("{name}: {why}"));
                    }
                });
                either(ui, "Go back to the previous surface", Some("Keep the new surface"), false)
            }
            Self::Recorded => {
                ui.heading("What was recorded is not kept");
                choice(ui, "Keep the recording …", Some("Throw it away"))
            }
            Self::Keys => {
                ui.heading("Mouse and keyboard");
                // As much as there is room for.
                let room = (ui.ctx().content_rect().height() - 160.0).max(200.0);
                ScrollArea::vertical().max_height(room).min_scrolled_height(room).show(ui, |ui| {
                    let all: Vec<_> = KEYS.iter().chain(&OWN).collect();
                    // Beside the bar.
                    ui.set_max_width(ui.available_width() - 14.0);
                    ui.columns(2, |columns| {
                        for (column, keys) in columns.iter_mut().zip(all.chunks(all.len().div_ceil(2))) {
                            for (keys, what) in keys {
                                column.strong(*keys);
                                column.indent(keys, |ui| ui.label(*what));
                            }
                        }
                    });
                });
                choice(ui, "Close the list", None)
            }
            Self::Offered(offered) => {
                offered.show(ui);
                let mut answer = Answer::None;
                ui.horizontal(|ui| {
                    let open = ui.add_enabled(offered.can_open(), egui::Button::new(offered.does()));
                    if offered.is_likely() && ui.memory(|memory| memory.focused().is_none()) {
                        open.request_focus();
                    }
                    if open.clicked() {
                        answer = Answer::Do;
                    }
                    if ui.button("Cancel").clicked() {
                        answer = Answer::Away;
                    }
                });
                answer
            }
            Self::Problem { title, text } => {
                ui.heading(*title);
                ui.label(text.as_str());
                choice(ui, "All right", None)
            }
        }
    }
}

/// The folder that was written into last, else the one that the program was started in, else a person's own: but for the first none that is the root, or a
/// scan's. Nothing lands beside scans unasked.
fn folder_to_keep_in([last, started, own]: [Option<PathBuf>; 3], scan: Option<&Path>) -> Option<PathBuf> {
    let real = |path: &Path| path.canonicalize().ok();
    let scans: Vec<PathBuf> =
        scan.into_iter().flat_map(|scan| [real(scan), scan.parent().and_then(real)]).flatten().collect();
    let is_fit = |folder: &PathBuf| {
        folder.parent().is_some() && real(folder).is_some_and(|real| !scans.contains(&real))
    };
    last.or_else(|| started.filter(is_fit)).or_else(|| own.filter(is_fit))
}

/// A field for a path, with buttons.
fn typed(ui: &mut Ui, path: &mut String, name: &str, verb: &str, was_asked: bool) -> Answer {
    let field = ui.add(TextEdit::singleline(path).desired_width(f32::INFINITY)).accessible_name(name);
    let entered = field.lost_focus() && ui.input(|input| input.key_pressed(Key::Enter));
    if !field.has_focus() && !entered && !was_asked && ui.memory(|memory| memory.focused().is_none()) {
        field.request_focus();
    }
    if field.gained_focus() {
        // What is typed takes the place of what is offered.
        let mut state = TextEdit::load_state(ui.ctx(), field.id).unwrap_or_default();
        let all = CCursorRange::two(CCursor::new(0), CCursor::new(path.chars().count()));
        state.cursor.set_char_range(Some(all));
        state.store(ui.ctx(), field.id);
    }
    let mut answer = Answer::None;
    ui.horizontal(|ui| {
        let is_path = !path.trim().is_empty();
        if (ui.add_enabled(is_path, egui::Button::new(verb)).clicked() || entered) && is_path {
            answer = Answer::Do;
        }
        if ui.button("Cancel").clicked() {
            answer = Answer::Away;
        }
    });
    answer
}

/// Buttons for what is asked; with another there is a way out as well.
fn choice(ui: &mut Ui, does: &str, other: Option<&str>) -> Answer {
    either(ui, does, other, true)
}

/// Buttons for what is asked, and for a way out where there is one.
fn either(ui: &mut Ui, does: &str, other: Option<&str>, is_way_out: bool) -> Answer {
    let mut answer = Answer::None;
    ui.horizontal(|ui| {
        let first = ui.button(does);
        if ui.memory(|memory| memory.focused().is_none()) {
            first.request_focus();
        }
        if first.clicked() {
            answer = Answer::Do;
        }
        let Some(other) = other else { return };
        if ui.button(other).clicked() {
            answer = Answer::Other;
        }
        if is_way_out && ui.button("Cancel").clicked() {
            answer = Answer::Away;
        }
    });
    answer
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn nothing_is_kept_beside_a_scan_unless_that_was_chosen() {
        let root = tempfile::tempdir().unwrap();
        let folder = |name: &str| {
            let folder = root.path().join(name);
            std::fs::create_dir_all(folder.join("series")).unwrap();
            folder
        };
        let [scans, work, home] = ["scans", "work", "home"].map(folder);
        let scan = scans.join("head.nii");
        std::fs::write(&scan, []).unwrap();
        let kept = |last: Option<&PathBuf>, started: &Path, scan: &Path| {
            folder_to_keep_in([last.cloned(), Some(started.to_owned()), Some(home.clone())], Some(scan))
        };
        assert_eq!(kept(None, &work, &scan).as_ref(), Some(&work));
        assert_eq!(kept(Some(&scans), &work, &scan).as_ref(), Some(&scans), "it was chosen");
        // Whatever it is called by, and where the scan is the folder itself.
        for (started, scan) in
            [(&scans, scan.clone()), (&scans, work.join("../scans/head.nii")), (&scans, scans.clone())]
        {
            assert_eq!(kept(None, started, &scan).as_ref(), Some(&home), "{}", scan.display());
        }
        assert_eq!(kept(None, Path::new("/"), &scan).as_ref(), Some(&home));
        assert_eq!(kept(None, &home, &home), None, "a scan that is all of it");
    }
}
