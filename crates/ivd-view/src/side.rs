//! The panel beside the pictures: what moves and how, classes, what was noted.

use egui::{CollapsingHeader, ComboBox, Response, ScrollArea, Slider, SliderClamping, Ui, WidgetText};
use ivd_frames::{Figures, MapName, Overlay, Pane, Request, WEIGHTS};

use crate::number::number;
use crate::over::name;
use crate::window::Window;

/// What stands so far above and below what has the keys is shown, too (points): headings are.
const ABOVE: f32 = 60.0;
/// Level that the slider ends at; higher ones have a handful of vertices.
const LEVELS: u8 = 8;
/// Where stiffness shows.
const STIFFNESS: &str = "Of springs. It changes something only where matter differs, or where something is pulled with a force: what is moved goes where the hand is, however stiff all of it is.";
/// Where it doesn't.
const NO_STIFFNESS: &str = "By distance alone the surface goes where the hand is, however stiff it is. Let it follow by springs (below) to make all of it stiffer, or one class";
/// What fades.
const FADES: &str = "How the motion fades from the surface inwards. Not at all: what is inside moves as the surface does, as far as the radius goes.";
/// How voxels follow.
const FOLLOW: &str = "What lies within goes as the nearest of the surface does, which is quick, or as smoothly as it can, which squeezes less and takes longer";
/// What is looked into.
const INSIDE: &str = "Leaves out of the volume's picture what lies before that slice. It is for looking alone, and the slices move it; where they meet near the body's edge, they go to its middle first";
/// What colours over slices tell of.
const OVER: &str = "How far voxels have moved, how much they are squeezed or stretched, or of which class they are, as colours over the slices";
/// Stiffness that the slider ends at (N/m).
const STIFFEST: f64 = 1e5;

/// What a radius means.
const RADIUS: &str = "As far round the handle the surface goes along, less the further away it is. It is that of the handle that was worked on last; a new one begins with the radius that was set last";
/// What the lattice's level means.
const LEVEL: &str = "How coarse the net of triangles is that is pulled: 0 is the finest and slowest, each further level has about a quarter of the vertices, until what is left is needed for its shape. How many there are stands below the pictures";

impl Window {
    /// Shows the panel.
    pub(crate) fn side(&mut self, ui: &mut Ui) {
        let width = ui.available_width();
        ScrollArea::both().auto_shrink(false).show(ui, |ui| {
            // Texts wrap; what can't be narrower is scrolled to.
            ui.set_max_width(width);
            // While it is made again the panel stays as it was, and where it was scrolled to.
            let meanwhile = self.meanwhile.clone();
            if meanwhile.is_some() {
                ui.disable();
            }
            let (meanwhile, noted) = meanwhile.map(|of| (of.figures, of.notes)).unzip();
            if let Some(figures) = self.shown.figures().cloned().or(meanwhile) {
                self.motion(ui, &figures);
                ui.separator();
                self.handles(ui, &figures);
                ui.separator();
                self.incision(ui, &figures);
                ui.separator();
                self.clips(ui, &figures);
                ui.separator();
                self.bones(ui, &figures);
                self.classes(ui, &figures);
                // Comes and goes with its tool: last, so that nothing else is moved by it.
                self.rulers(ui, &figures);
                self.made_of(ui, &figures);
            }
            self.scroll_to_keys(ui);
            let notes = noted.unwrap_or_else(|| self.notes.clone());
            if !notes.is_empty() {
                CollapsingHeader::new("Notes").default_open(true).show(ui, |ui| {
                    for note in notes {
                        ui.label(note);
                    }
                });
            }
        });
    }

    /// Shows the part of the panel that has got the keys, with what stands above it.
    fn scroll_to_keys(&mut self, ui: &Ui) {
        let has_keys = ui.memory(egui::Memory::focused);
        if std::mem::replace(&mut self.has_keys, has_keys) == has_keys {
            return;
        }
        // What a pointer presses stays where it is pressed.
        if ui.input(|input| input.pointer.any_down() || input.pointer.any_released()) {
            return;
        }
        let part = has_keys.and_then(|id| ui.ctx().read_response(id));
        let part = part.filter(|part| part.layer_id == ui.layer_id()).map(|part| part.rect);
        let width = ui.min_rect().x_range();
        if let Some(rect) = part.filter(|rect| width.contains(rect.center().x)) {
            ui.scroll_to_rect(rect.expand2(egui::vec2(0.0, ABOVE)), None);
        }
    }

    /// The value of a slider or field: the hand's while it is held, and until an answer comes; else what is shown.
    pub(crate) fn value(&self, name: &str, shown: f64) -> f64 {
        let held = self.turning.as_ref().filter(|(held, _)| held == name);
        held.map_or_else(|| self.awaited.value(name, shown), |(_, value)| *value)
    }

    /// What a slider or a field changes from when it is taken hold of until it is let go of is one step.
    pub(crate) fn turned(
        &mut self,
        response: &Response,
        (name, value): (&str, f64),
        request: impl FnOnce() -> Request,
    ) {
        if response.drag_started() {
            self.ask(Request::Adjust);
        }
        if response.dragged() {
            self.turning = Some((name.to_owned(), value));
        }
        if response.changed() {
            self.ask(request());
            self.awaited.turn(name, value);
        }
        if response.drag_stopped() {
            self.turning = None;
            self.ask(Request::Drop);
        }
    }

    fn motion(&mut self, ui: &mut Ui, figures: &Figures) {
        let widest = self.extent_mm().max(1.0);
        let handle = figures.held.or(self.selected);
        let of = handle.and_then(|id| figures.handles.iter().find(|one| one.id == id));
        let name = of.map_or_else(
            || "Radius of the next handle".to_owned(),
            |one| format!("Radius of handle {}", one.id),
        );
        let mut radius = self.value(&name, of.map_or(figures.radius, |one| one.radius));
        for response in slider(ui, &name, "mm", &mut radius, 0.5..=widest, Scale::Ratios) {
            let response = response.on_hover_text(RADIUS);
            let request = || Request::Radius { handle: of.map(|one| one.id), radius: radius.max(1e-3) };
            self.turned(&response, (&name, radius), request);
        }
        let mut stiffness = self.value("Stiffness", figures.stiffness);
        let counts = figures.stiffness_counts;
        let unit = match (counts, figures.matter.is_empty()) {
            (false, _) => "N/m, used with springs",
            (true, true) => "N/m",
            (true, false) => "N/m, where no class has its own",
        };
        let responses = ui.add_enabled_ui(counts, |ui| {
            slider(ui, "Stiffness", unit, &mut stiffness, 1e-2..=STIFFEST, Scale::Ratios)
        });
        for response in responses.inner {
            let request = || Request::Stiffness { stiffness };
            let response = response.on_hover_text(STIFFNESS).on_disabled_hover_text(NO_STIFFNESS);
            self.turned(&response, ("Stiffness", stiffness), request);
        }
        self.follows_by(ui, figures);
        let mut level = self.value("Level", f64::from(figures.level));
        for response in slider(
            ui,
            "Level",
            "of the surface: 0 is the finest",
            &mut level,
            0.0..=f64::from(LEVELS),
            Scale::Whole,
        ) {
            let request = || Request::Level { level: level.round() as u8 };
            let response = response.on_hover_text(LEVEL);
            self.turned(&response, ("Level", level), request);
        }
        self.follow(ui, figures);
        self.fades(ui, figures);
        self.compare(ui, figures);
        self.colours_over(ui, figures);
    }

    /// How the voxels follow.
    fn follow(&mut self, ui: &mut Ui, figures: &Figures) {
        let now = MapName::ALL.into_iter().find(|map| map.key() == figures.map);
        let now = self.awaited.map(now);
        let shown = (now, now.map_or(figures.map, MapName::word));
        if let Some(map) =
            list(ui, ["Voxels follow", FOLLOW], shown, MapName::ALL.map(|map| (map, map.word())))
        {
            self.ask(Request::Map { map });
        }
    }

    /// How the motion fades with depth, to be chosen where voxels follow what is nearest.
    fn fades(&mut self, ui: &mut Ui, figures: &Figures) {
        let word = WEIGHTS.iter().find(|(weight, _)| Some(*weight) == figures.depth).map(|(_, word)| *word);
        let shown = (figures.depth, word.unwrap_or("–"));
        // Nothing else changes its place where there is nothing to choose.
        let chosen = ui.add_enabled_ui(figures.depth.is_some(), |ui| {
            list(ui, ["Motion fades with depth", FADES], shown, WEIGHTS)
        });
        let weight = chosen.inner;
        chosen.response.on_disabled_hover_text("To be chosen where voxels follow the nearest");
        if let Some(weight) = weight {
            self.ask(Request::Depth { weight });
        }
    }

    /// Where the volume's picture is open: nothing of the volume goes by it.
    pub(crate) fn look_inside(&mut self, ui: &mut Ui, figures: &Figures) {
        let word = |along: Option<Pane>| match along {
            None => "no".to_owned(),
            Some(Pane::Volume) => "facing me".to_owned(),
            Some(slice) => name(slice).to_lowercase(),
        };
        let slices = Pane::ALL.into_iter().filter(|pane| *pane != Pane::Volume).map(Some);
        let all = [None].into_iter().chain(slices).chain([Some(Pane::Volume)]);
        let shown = (Some(figures.cut), word(figures.cut));
        if let Some(along) = list(ui, ["Look inside", INSIDE], shown, all.map(|along| (along, word(along)))) {
            self.ask(Request::Cut { along });
        }
    }

    /// What colours over the slices tell of.
    fn colours_over(&mut self, ui: &mut Ui, figures: &Figures) {
        let word = |of: Option<Overlay>| of.map_or("nothing", Overlay::word);
        let knows = |of: &Overlay| *of != Overlay::Classes || !figures.classes.is_empty();
        let all = [None].into_iter().chain(Overlay::ALL.into_iter().filter(knows).map(Some));
        let shown = (Some(figures.overlay), word(figures.overlay));
        if let Some(of) = list(ui, ["Colours over slices", OVER], shown, all.map(|of| (of, word(of)))) {
            self.ask(Request::Overlay { of });
        }
    }

    /// The longest side of the scan (mm).
    pub(crate) fn extent_mm(&self) -> f64 {
        let slices = self.shown.slices();
        let longest = slices.into_iter().flatten().flat_map(|slice| slice.extent_mm).fold(0.0, f64::max);
        self.meanwhile.as_ref().map_or(longest, |meanwhile| meanwhile.extent_mm)
    }
}

/// A list of which one entry is chosen: its label and what it means, what is chosen now with its word, and all entries with theirs. What is chosen instead, if
/// anything is.
pub(crate) fn list<T: Copy + PartialEq, W: Into<WidgetText>>(
    ui: &mut Ui,
    [label, about]: [&str; 2],
    (now, word): (Option<T>, W),
    entries: impl IntoIterator<Item = (T, W)>,
) -> Option<T> {
    let mut chosen = None;
    let list = ComboBox::from_label(label).selected_text(word).show_ui(ui, |ui| {
        for (entry, word) in entries {
            if ui.selectable_label(now == Some(entry), word.into()).clicked() {
                chosen = Some(entry);
            }
        }
    });
    list.response.on_hover_text(about);
    chosen
}

/// How a slider goes from one end to the other.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Scale {
    /// By whole numbers.
    Whole,
    /// By as much everywhere.
    Even,
    /// By as many times everywhere.
    Ratios,
}

/// A slider with a field beside it, each with a name of its own.
pub(crate) fn slider(
    ui: &mut Ui,
    name: &str,
    unit: &str,
    value: &mut f64,
    range: std::ops::RangeInclusive<f64>,
    scale: Scale,
) -> [Response; 2] {
    let whole = scale == Scale::Whole;
    ui.label(format!("{name} ({unit})"));
    ui.horizontal(|ui| {
        let slider = Slider::new(value, range.clone())
            .logarithmic(scale == Scale::Ratios)
            .step_by(if whole { 1.0 } else { 0.0 })
            .clamping(SliderClamping::Never)
            .show_value(false);
        let slid = ui.add(slider).accessible_name(name);
        let least = if *range.start() < 0.0 { -1e6 } else { 0.0 };
        let speed = if whole { 0.05 } else { 0.01 * range.end().min(100.0) };
        let (full, digits) = (format!("{name}, as a number"), if whole { 0 } else { 2 });
        [slid, number(ui, &full, value, digits, |field| field.range(least..=1e6).speed(speed))]
    })
    .inner
}
