//! Handles and pins as a list: what a pointer does, by keyboard.

use egui::{Button, Grid, InputState, Key, Label, RichText, TextEdit, Ui};
use ivd_frames::{Figures, Pane, Request, Spot};

use crate::gestures::go_to;
use crate::keys::{Focus, is_pressed_anew};
use crate::number::number;
use crate::window::Window;

/// The axes, ...
const AXES: [&str; 3] = ["x", "y", "z"];
/// ... and the sides of the patient that they go to, in a letter and in words.
const SIDES: [(&str, &str); 3] = [
    ("R", "to the right; less than 0: to the left"),
    ("A", "to the front; less than 0: to the back"),
    ("S", "to the head; less than 0: to the feet"),
];
/// Voxels that go less far than their vertex by more than this share of its way, and this (mm), are told of.
const LAG: [f64; 2] = [0.05, 0.1];
/// A vertex that is further from what was pointed at is told of (mm).
pub(crate) const AWAY: f64 = 3.0;
/// Why a handle isn't where it was put.
const VERTEX: &str = "A handle takes the surface's nearest vertex. A finer surface, by a lower level, has one that is closer; so has a surface that was found elsewhere (below)";
/// How far a handle goes.
const MOVED: &str = "How far the handle takes its vertex; left and right are the patient's. What lies about it may go further: the largest motion stands below the pictures";
/// Why voxels go less far.
const BEHIND: &str = "Further on voxels would fold over one another, so they are kept back. A larger radius, a smaller move, or voxels that follow smoothest come closer";
/// Where a move goes, along each axis of the patient and against it; ...
const WAYS: [[&str; 2]; 3] = [["left", "right"], ["backwards", "forwards"], ["down", "up"]];
/// ... an axis that it goes along by less of its length (sine of 20°) is left out.
const ALONG: f64 = 0.34;
/// What goes so much along the way into the surface or out of it goes straight (14°).
const STRAIGHT: f64 = 0.97;
/// What goes within 45° of the way into the surface or out of it goes in or out.
const SIDE: f64 = std::f64::consts::FRAC_1_SQRT_2;
/// Into the surface.
const INTO: &str = "How far the handle goes straight into the surface, along the arrow; \"out 6\", or -6, pulls it out. What it goes sideways stays as it is. A way that leans by less than 14° is taken as straight";
/// By how much a field changes when the pointer is dragged over it by a point (mm, mN).
const SPEED: f64 = 0.1;

/// A handle that is typed.
#[derive(Debug, Default)]
pub(crate) struct Typed {
    place: String,
    /// The handles that were there when one was entered: it has the keys once it is there, too.
    before: Option<Vec<u32>>,
}

impl Typed {
    /// What was entered doesn't come.
    pub(crate) fn no_more(&mut self) {
        self.before = None;
    }
}

impl Window {
    /// Shows the list.
    pub(crate) fn handles(&mut self, ui: &mut Ui, figures: &Figures) {
        ui.heading("Handles");
        self.new_handle(ui, figures);
        if !figures.handles.is_empty() {
            ui.weak("moved by, and radius (mm):");
        }
        Grid::new("handles").num_columns(6).spacing([3.0, 3.0]).show(ui, |ui| {
            // Six columns have room in the panel, whatever their numbers.
            ui.spacing_mut().interact_size.x = 34.0;
            if !figures.handles.is_empty() {
                ui.weak("");
                ui.weak("");
                for (axis, (side, way)) in AXES.into_iter().zip(SIDES) {
                    if figures.letters.is_some() {
                        ui.weak(format!("{axis} ({side})")).on_hover_text(way);
                    } else {
                        ui.weak(axis);
                    }
                }
                ui.weak("radius");
                ui.end_row();
            }
            for one in &figures.handles {
                self.handle(ui, figures, one);
                ui.end_row();
            }
        });
        for one in figures.handles.iter().filter(|one| one.away_mm > AWAY) {
            let text = format!("{}: {:.1} mm from where you put it", one.id, one.away_mm);
            ui.colored_label(ui.visuals().warn_fg_color, text).on_hover_text(VERTEX);
        }
        for one in &figures.handles {
            ui.horizontal(|ui| self.press(ui, figures, one));
        }
        for pin in &figures.pins {
            ui.horizontal(|ui| {
                if ui.button(format!("Pin {}", pin.id)).on_hover_text("The slices go there").clicked() {
                    self.ask_all(go_to(pin));
                }
                ui.weak(format!("{:.1} mm about {}", pin.radius, place(pin.rest)));
                let release = ui.button("×").accessible_name(format!("Release pin {}", pin.id));
                if release.on_hover_text("Release it").clicked() {
                    self.ask(Request::Release { fix: pin.id });
                }
            });
        }
    }

    /// A handle more, at a place that is typed or where the slices meet.
    fn new_handle(&mut self, ui: &mut Ui, figures: &Figures) {
        ui.horizontal(|ui| {
            ui.label("place (mm)");
            let field = TextEdit::singleline(&mut self.typed.place).hint_text("x, y, z").desired_width(110.0);
            let field = ui.add(field).accessible_name("Place of a new handle, at rest, mm");
            if figures.handles.is_empty() && self.focus.take_if(|to| *to == Focus::Handles).is_some() {
                field.request_focus();
            }
            let entered = field.lost_focus() && ui.input(|input| input.key_pressed(Key::Enter));
            if ui.button("Add").on_hover_text("A handle at that place").clicked() || entered {
                match read(&self.typed.place) {
                    Some(place) => {
                        self.typed.before =
                            entered.then(|| figures.handles.iter().map(|one| one.id).collect());
                        self.ask(Request::Add { place, by: [0.0; 3] });
                    }
                    None => {
                        self.complain("A place is three numbers, x, y, z, in mm: 10, -4.5, 32.".to_owned());
                    }
                }
            }
        });
        ui.horizontal(|ui| {
            ui.weak("Where the slices meet:");
            let add = ui.add(Button::new("Handle")).accessible_name("Handle where the slices meet");
            if add.on_hover_text("A handle at the lattice's nearest vertex").clicked() {
                self.ask(Request::Add { place: figures.cross, by: [0.0; 3] });
            }
            let pin = ui.add(Button::new("Pin")).accessible_name("Pin where the slices meet");
            if pin.on_hover_text("What is there stays").clicked()
                && let Some(at) = figures.cross_at[Pane::Axial.number()]
            {
                self.ask(Request::Pin { pane: Pane::Axial, at });
            }
        });
    }

    /// How far a handle goes into the surface, to be typed, and which way that is.
    fn press(&mut self, ui: &mut Ui, figures: &Figures, one: &Spot) {
        let id = one.id;
        ui.weak(format!("{id}:"));
        if let (Some(by), Some(out)) = (one.by, one.out) {
            let full = format!("Handle {id}: into the surface, mm");
            let there = depth(by, out);
            // Before it is drawn: all of what stands there is chosen then, and what is typed takes its place.
            if self.typed.before.as_ref().is_some_and(|before| !before.contains(&id)) {
                let next = ui.next_auto_id();
                ui.memory_mut(|memory| memory.request_focus(next));
                self.typed.before = None;
            }
            let mut into = self.value(&full, unsigned(there));
            let field = number(ui, &full, &mut into, 1, |field| {
                let field = field.speed(SPEED).range(-1e6..=1e6);
                field.custom_formatter(|into, _| in_or_out(into)).custom_parser(read_in_or_out)
            });
            let field = field.on_hover_text(INTO);
            let by = deepened(by, out, into);
            self.turned(&field, (&full, into), || Request::Move { handle: id, by });
        }
        let Some(told) = told(one, figures.letters.is_some()) else { return };
        let behind = lag(one).is_some();
        let text = RichText::new(told);
        let text = if behind { text.color(ui.visuals().warn_fg_color) } else { text.weak() };
        let line = ui.add(Label::new(text).wrap());
        line.on_hover_text(if behind { BEHIND } else { MOVED });
    }

    /// A row: the handle, how far it moves or with what force it pulls, and how to be rid of it.
    fn handle(&mut self, ui: &mut Ui, figures: &Figures, one: &Spot) {
        let id = one.id;
        let selected = figures.held.or(self.selected) == Some(id);
        let go = ui
            .add(Button::new(id.to_string()).selected(selected))
            .accessible_name(format!("Go to handle {id}"));
        let at = place(one.now);
        let go = go.on_hover_text(format!("At {at} mm; the slices go there, and Delete removes it then"));
        // Once: the next row's button may have the keys then.
        let deletes = |input: &InputState| {
            let is_new = |key| is_pressed_anew(input, key);
            input.modifiers.is_none() && (is_new(Key::Delete) || is_new(Key::Backspace))
        };
        if go.has_focus() && ui.input(deletes) {
            self.ask(Request::Remove { handle: id });
        }
        let worked_on = self.selected.or_else(|| figures.handles.first().map(|one| one.id));
        if worked_on == Some(id) && self.focus.take_if(|to| *to == Focus::Handles).is_some() {
            go.request_focus();
        }
        if go.clicked() {
            go.request_focus();
            self.selected = Some(id);
            self.ask_all(go_to(one));
        }
        let remove = ui.button("×").accessible_name(format!("Remove handle {id}"));
        if remove.on_hover_text("Remove it").clicked() {
            self.ask(Request::Remove { handle: id });
        }
        let pulls = one.with.is_some();
        let unit = if pulls { "mN" } else { "mm from rest" };
        let mut told = one.with.or(one.by).unwrap_or_default().map(unsigned);
        for (axis, name) in AXES.into_iter().enumerate() {
            let full = format!("Handle {id}: {name}, {unit}");
            told[axis] = self.value(&full, told[axis]);
            let field = number(ui, &full, &mut told[axis], 2, |field| {
                field.speed(SPEED).range(-1e6..=1e6).suffix(if pulls { " mN" } else { "" })
            });
            self.turned(&field, (&full, told[axis]), || {
                if pulls {
                    Request::Pull { handle: id, with: told }
                } else {
                    Request::Move { handle: id, by: told }
                }
            });
        }
        let full = format!("Handle {id}: radius, mm");
        let mut radius = self.value(&full, one.radius);
        let field = number(ui, &full, &mut radius, 1, |field| field.speed(SPEED).range(1e-3..=1e6));
        self.turned(&field, (&full, radius), || Request::Radius { handle: Some(id), radius });
    }
}

/// A number that isn't told as less than 0 where it is told as 0.
fn unsigned(number: f64) -> f64 {
    if number.abs() < 5e-3 { 0.0 } else { number }
}

/// How far a handle has moved its vertex, which way in the patient, where it is known how they lie, and how far the voxels there have gone; `None` where it moves
/// nothing.
pub(crate) fn told(one: &Spot, is_patient: bool) -> Option<String> {
    let by = one.by.filter(|by| length(*by) > 0.0)?;
    let mut along: Vec<usize> = (0..3).filter(|&a| is_patient && by[a].abs() > ALONG * length(by)).collect();
    along.sort_by(|&a, &b| by[b].abs().total_cmp(&by[a].abs()));
    let ways: Vec<&str> = along.into_iter().map(|a| WAYS[a][usize::from(by[a] > 0.0)]).collect();
    let way = ways.join(" and ");
    let out = one.out.map_or(0.0, |out| dot(by, out));
    let side = if out > 0.0 { "out" } else { "in" };
    // What isn't straight along that way is told with how much of it is.
    let whole = length(by);
    let (first, part) = match (out.abs() >= SIDE * whole, one.out.is_some_and(|out| is_straight(by, out))) {
        (false, _) => ("", String::new()),
        (true, true) => (side, String::new()),
        (true, false) => ("", format!(", of that {:.1} mm {side}", out.abs())),
    };
    let ways: Vec<&str> = [first, &way].into_iter().filter(|words| !words.is_empty()).collect();
    let ways = if ways.is_empty() { String::new() } else { format!(" {}", ways.join(", ")) };
    let voxels = lag(one).map_or_else(String::new, |gone| format!(", voxels there {gone:.1} mm"));
    Some(format!("{whole:.1} mm{ways}{part}{voxels}"))
}

/// How far in, in words; out where that is less than 0.
fn in_or_out(into: f64) -> String {
    let way = if into < -0.05 { "out" } else { "in" };
    format!("{way} {:.1}", into.abs())
}

/// Reads that, or a number, of which less than 0 is out.
fn read_in_or_out(text: &str) -> Option<f64> {
    let text = text.trim().to_lowercase();
    let number = |rest: &str| rest.trim().replace('−', "-").parse::<f64>().ok();
    match (text.strip_prefix("out"), text.strip_prefix("in")) {
        (Some(rest), _) => number(rest).map(|out| -out),
        (None, Some(rest)) => number(rest),
        (None, None) => number(&text),
    }
}

/// How far voxels have gone (mm), where that is noticeably less than they were told to.
fn lag(one: &Spot) -> Option<f64> {
    let (by, gone) = (one.by?, one.gone?);
    let left = length(std::array::from_fn(|a| by[a] - gone[a]));
    (left > (LAG[0] * length(by)).max(LAG[1])).then(|| length(gone))
}

/// Whether a move goes into the surface or out of it, but for little.
fn is_straight(by: [f64; 3], out: [f64; 3]) -> bool {
    dot(by, out).abs() > STRAIGHT * length(by)
}

/// How far a move goes into the surface (mm): the whole of one that goes straight in or out, however its reach turns the surface's way a little.
fn depth(by: [f64; 3], out: [f64; 3]) -> f64 {
    let along = -dot(by, out);
    if is_straight(by, out) { length(by).copysign(along) } else { along }
}

/// A move that goes so far into the surface instead, and as far aside.
fn deepened(by: [f64; 3], out: [f64; 3], into: f64) -> [f64; 3] {
    let aside: [f64; 3] = std::array::from_fn(|a| by[a] - dot(by, out) * out[a]);
    let to = |along: f64| std::array::from_fn(|a| aside[a] - along * out[a]);
    // Of a straight one the whole is so long.
    let whole = to((into * into - dot(aside, aside)).max(0.0).sqrt().copysign(into));
    if is_straight(whole, out) { whole } else { to(into) }
}

fn dot(a: [f64; 3], b: [f64; 3]) -> f64 {
    (0..3).map(|i| a[i] * b[i]).sum()
}

/// How long a way is.
pub(crate) fn length(way: [f64; 3]) -> f64 {
    dot(way, way).sqrt()
}

/// A place, as it is read.
pub(crate) fn place(at: [f64; 3]) -> String {
    at.map(|c| format!("{c:.1}")).join(", ")
}

/// Three numbers with commas or spaces between them.
fn read(text: &str) -> Option<[f64; 3]> {
    let words = text.split([',', ' ', ';']).filter(|word| !word.is_empty());
    let numbers: Option<Vec<f64>> = words.map(|word| word.parse().ok()).collect();
    <[f64; 3]>::try_from(numbers?).ok().filter(|place| place.iter().all(|c| c.is_finite()))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_move_is_told_by_its_way_and_by_what_stays_behind() {
        let spot = |by, gone| Spot {
            id: 0,
            rest: [0.0; 3],
            away_mm: 0.0,
            now: [0.0; 3],
            by: Some(by),
            with: None,
            radius: 9.0,
            at: [None; 4],
            off: [0.0; 3],
            out: Some([0.0, 1.0, 0.0]),
            gone: Some(gone),
            seen: [true; 4],
            inwards: [None; 4],
            beside: [false; 4],
        };
        let said = |by, gone| told(&spot(by, gone), true);
        assert_eq!(said([0.0, -5.0, 0.0], [0.0, -4.9, 0.0]).unwrap(), "5.0 mm in, backwards");
        assert_eq!(
            said([0.0, 5.0, 4.0], [0.0, 5.0, 4.0]).unwrap(),
            "6.4 mm forwards and up, of that 5.0 mm out"
        );
        let behind = said([0.0, -5.0, 0.0], [0.0, -2.7, 0.0]).unwrap();
        assert_eq!(behind, "5.0 mm in, backwards, voxels there 2.7 mm");
        assert_eq!(said([3.0, 1.0, 0.0], [3.0, 1.0, 0.0]).unwrap(), "3.2 mm right");
        assert_eq!(said([-2.0, 0.1, 4.0], [-2.0, 0.1, 4.0]).unwrap(), "4.5 mm up and left");
        assert_eq!(told(&spot([3.0, 1.0, 0.0], [3.0, 1.0, 0.0]), false).unwrap(), "3.2 mm");
        assert_eq!(said([0.0; 3], [0.0; 3]), None);
        assert_eq!(told(&Spot { by: None, with: Some([1.0; 3]), ..spot([0.0; 3], [0.0; 3]) }, true), None);
    }

    #[test]
    fn a_depth_is_told_by_its_way_and_read_with_it_or_by_its_sign() {
        assert_eq!([5.0, 0.0, -6.04].map(in_or_out), ["in 5.0", "in 0.0", "out 6.0"]);
        for (text, into) in [("in 5.5", 5.5), ("out 6", -6.0), (" -3 ", -3.0), ("Out 2.5", -2.5), ("4", 4.0)]
        {
            assert_eq!(read_in_or_out(text), Some(into), "{text}");
        }
        assert_eq!([read_in_or_out("inwards"), read_in_or_out("")], [None, None]);
    }

    #[test]
    fn what_goes_straight_in_is_as_deep_as_it_is_long() {
        let out = [0.0, 1.0, 0.0];
        let slant = [0.0, -4.9, 0.9];
        assert!((depth(slant, out) - length(slant)).abs() < 1e-12, "a wider radius turns the way a little");
        assert_eq!(depth([0.0, 2.0, 0.1], out), -length([0.0, 2.0, 0.1]));
        assert_eq!(depth([0.0; 3], out), 0.0);
        assert_eq!(deepened([3.0, -1.0, 0.0], out, 2.5), [3.0, -2.5, 0.0]);
        // What is typed is what is told, and the way aside stays, however it is come by.
        for (by, into) in
            [(slant, 7.0), (slant, 0.0), (slant, -6.0), ([1.2, -2.0, 0.0], 5.5), ([0.0; 3], 5.0)]
        {
            let deeper = deepened(by, out, into);
            assert!((depth(deeper, out) - into).abs() < 1e-12, "{by:?}, {into}: {deeper:?}");
            assert_eq!([deeper[0], deeper[2]], [by[0], by[2]]);
        }
        assert_eq!(deepened([1e-200, 0.0, 0.0], out, 2.0), [1e-200, -2.0, 0.0]);
    }

    #[test]
    fn a_place_is_three_numbers() {
        assert_eq!(read("1, -2.5,3"), Some([1.0, -2.5, 3.0]));
        assert_eq!(read("1 2 3"), Some([1.0, 2.0, 3.0]));
        for bad in ["", "1, 2", "1,2,3,4", "a, b, c", "1, 2, inf"] {
            assert_eq!(read(bad), None, "{bad}");
        }
    }
}
