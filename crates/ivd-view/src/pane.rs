//! A pane: its picture with what lies over it, and what hands do in it.

use std::cell::RefCell;

use egui::accesskit::Role;
use egui::{
    Color32, CursorIcon, Event, EventFilter, Key, MouseWheelUnit, PointerButton, Pos2, Rect, Response, Sense,
    Ui, WidgetInfo, pos2, vec2,
};
use ivd_frames::{Pane, Request, Tool};

use crate::gestures::{Button, step};
use crate::over::{Over, name};
use crate::window::Window;

/// Lines of a page, for wheels that turn pages.
const PAGE: f32 = 10.0;
/// Slices have one scale where none has less than this share of the size that it could have.
const SMALLEST: f32 = 0.5;
/// Shares of the pane that an arrow turns the volume by.
const ARROW: f64 = 1.0 / 36.0;

/// The panes' places in what is left for them; one alone has all of it.
pub(crate) fn places(rect: Rect, alone: Option<Pane>) -> Vec<(Pane, Rect)> {
    if let Some(pane) = alone {
        return vec![(pane, rect)];
    }
    let half = (rect.size() - vec2(2.0, 2.0)) / 2.0;
    let corner = |column: f32, row: f32| rect.min + vec2(column * (half.x + 2.0), row * (half.y + 2.0));
    let place = |n: usize| Rect::from_min_size(corner((n % 2) as f32, (n / 2) as f32), half);
    Pane::ALL.iter().enumerate().map(|(n, pane)| (*pane, place(n))).collect()
}

/// How a pane is called by those who read the window by ear.
fn spoken(pane: Pane) -> String {
    if pane == Pane::Volume { name(pane).to_owned() } else { format!("{} slice", name(pane)) }
}

/// Where a picture of a shape lies in a pane.
pub(crate) fn fitted(rect: Rect, ratio: f32) -> Rect {
    let width = rect.width().min(rect.height() * ratio);
    Rect::from_center_size(rect.center(), vec2(width, width / ratio))
}

/// Points for every mm where a slice of that width and height (mm) fills a pane.
fn scale(rect: Rect, [wide, high]: [f64; 2]) -> f32 {
    (f64::from(rect.width()) / wide).min(f64::from(rect.height()) / high) as f32
}

/// The same where each of them fits.
fn least_scale(rect: Rect, extents: &[[f64; 2]]) -> f32 {
    extents.iter().map(|extent| scale(rect, *extent)).fold(f32::INFINITY, f32::min)
}

fn share(room: Rect, at: Pos2) -> [f64; 2] {
    let way = at - room.min;
    [f64::from(way.x / room.width()), f64::from(way.y / room.height())]
}

impl Window {
    /// Shows a pane and follows what hands do in it.
    pub(crate) fn pane(&mut self, ui: &mut Ui, pane: Pane, rect: Rect) {
        let response =
            ui.interact(rect, ui.scope_id().with(("pane", pane.number())), Sense::click_and_drag());
        response.widget_info(|| WidgetInfo::labeled(Role::Canvas, true, spoken(pane)));
        self.describe(ui, &response, pane);
        let painter = ui.painter_at(rect);
        painter.rect_filled(rect, 0.0, Color32::BLACK);
        let Some(ratio) = self.shown.ratio(pane).filter(|ratio| ratio.is_finite() && *ratio > 0.0) else {
            if pane == Pane::Volume {
                self.opening(ui, rect);
            }
            return;
        };
        let room = self.room(pane, rect, ratio);
        if let Some(texture) = self.shown.texture(pane) {
            let whole = Rect::from_min_max(pos2(0.0, 0.0), pos2(1.0, 1.0));
            painter.image(texture.id(), room, whole, Color32::WHITE);
        }
        let line = self.hands.line(pane);
        let (shown, tool, pointed) = (&self.shown, self.tool, self.pointed);
        let selected = self.selected;
        let (is_at_work, is_outlined) = (self.hands.pane() == Some(pane), self.layout.outline);
        let written = RefCell::default();
        Over {
            painter: &painter,
            pane,
            rect,
            room,
            shown,
            tool,
            pointed,
            is_at_work,
            selected,
            is_outlined,
            line,
            written,
        }
        .draw();
        if self.is_over_line(ui, &response, room) {
            ui.ctx().set_cursor_icon(CursorIcon::ResizeHorizontal);
        } else if matches!(self.tool, Tool::Incise | Tool::Bone | Tool::Measure) && response.hovered() {
            ui.ctx().set_cursor_icon(CursorIcon::Crosshair);
        }
        if response.has_focus() {
            let stroke = ui.visuals().selection.stroke;
            painter.rect_stroke(rect, 0.0, stroke, egui::StrokeKind::Inside);
            self.arrows(ui, &response, pane);
        }
        self.pointer(ui, &response, pane, room);
        if pane == Pane::Volume && self.shown.figures().is_none() {
            self.opening(ui, rect);
        }
        if response.double_clicked() && self.tool == Tool::Turn {
            self.layout.alone = if self.layout.alone.is_some() { None } else { Some(pane) };
        }
    }

    /// Where a pane's picture lies in it; slices beside one another show a mm by as much.
    pub(crate) fn room(&self, pane: Pane, rect: Rect, ratio: f32) -> Rect {
        let room = fitted(rect, ratio);
        let (Some(slice), Some(slices), None) =
            (pane.number().checked_sub(1), self.shown.slices(), self.layout.alone)
        else {
            return room;
        };
        let extents = slices.each_ref().map(|slice| slice.extent_mm);
        let by = least_scale(rect, &extents) / scale(rect, extents[slice]);
        // Not where one of them is much longer than others: hands need room.
        let least = extents.iter().map(|extent| least_scale(rect, &extents) / scale(rect, *extent));
        if by.is_finite() && least.fold(f32::INFINITY, f32::min) > SMALLEST {
            Rect::from_center_size(room.center(), room.size() * by)
        } else {
            room
        }
    }

    /// Says in words what a pane shows.
    fn describe(&self, ui: &Ui, response: &Response, pane: Pane) {
        let text = match (pane.number().checked_sub(1), self.shown.slices(), self.shown.angles()) {
            (Some(slice), Some(slices), _) => {
                let clipped = if slices[slice].clipped { ", clipped by planes or boxes" } else { "" };
                format!("slice {} of {}{clipped}", slices[slice].slice + 1, slices[slice].slices)
            }
            (None, _, Some([azimuth, elevation])) => {
                format!("seen from {azimuth:.0} degrees around and {elevation:.0} degrees up")
            }
            _ => "no picture yet".to_owned(),
        };
        let text = text + &self.spoken_state();
        ui.ctx().accesskit_node_builder(response.id, |node| node.set_description(text));
    }

    fn arrows(&mut self, ui: &Ui, response: &Response, pane: Pane) {
        let filter = EventFilter { horizontal_arrows: true, vertical_arrows: true, ..EventFilter::default() };
        ui.memory_mut(|memory| memory.set_focus_lock_filter(response.id, filter));
        let ways = [
            (Key::ArrowLeft, [-1.0, 0.0]),
            (Key::ArrowRight, [1.0, 0.0]),
            (Key::ArrowUp, [0.0, -1.0]),
            (Key::ArrowDown, [0.0, 1.0]),
        ];
        for (key, [right, down]) in ways {
            let pressed = ui.input(|input| input.num_presses(key)) as f64;
            if pressed > 0.0 {
                self.ask(match pane {
                    Pane::Volume => Request::Orbit { by: [right, down].map(|way| way * pressed * ARROW) },
                    slice => Request::Slice { pane: slice, steps: ((right - down) * pressed) as i32 },
                });
            }
        }
    }

    /// Follows the events of the pointer, in their order.
    fn pointer(&mut self, ui: &Ui, response: &Response, pane: Pane, room: Rect) {
        let (here, mine) = (response.contains_pointer(), self.hands.pane() == Some(pane));
        if !here && !mine {
            return;
        }
        let latest = ui.input(|input| input.pointer.latest_pos());
        let mut hovered = None;
        for event in ui.input(|input| input.events.clone()) {
            match event {
                Event::PointerButton { pos, button, pressed: true, modifiers } if here => {
                    let Some(button) = button_of(button) else { continue };
                    response.request_focus();
                    // Beside a slice's picture there is nothing.
                    let is_beside = share(room, pos).iter().any(|c| !(0.0..=1.0).contains(c));
                    if pane != Pane::Volume && is_beside {
                        continue;
                    }
                    if button == Button::Left && !modifiers.shift && self.is_line_at(room, pos) {
                        self.hands.divide(pane, share(room, pos));
                        continue;
                    }
                    let asked =
                        self.hands.pressed(pane, share(room, pos), button, modifiers.shift, self.tool);
                    self.ask_all(asked);
                }
                Event::PointerButton { button, pressed: false, .. } => {
                    let Some(button) = button_of(button) else { continue };
                    let asked = self.hands.released(button);
                    self.ask_all(asked);
                }
                Event::PointerMoved(pos) => {
                    let at = share(room, pos);
                    if self.hands.pane() == Some(pane) {
                        let asked = self.hands.moved(at);
                        self.ask_all(asked);
                    } else if self.hands.pane().is_none() && at.iter().all(|c| (0.0..=1.0).contains(c)) {
                        hovered = Some(Request::Hover { pane, at });
                    }
                }
                Event::MouseWheel { unit, delta, .. } if here => {
                    let points = delta.y
                        * match unit {
                            MouseWheelUnit::Point => 1.0,
                            MouseWheelUnit::Line => step(),
                            MouseWheelUnit::Page => step() * PAGE,
                        };
                    let Some(at) = latest.map(|pos| share(room, pos)) else { continue };
                    let on_handle = self.shown.hovered().is_some_and(|hovered| hovered.handle.is_some());
                    let asked = self.hands.wheel(pane, at, points, self.tool, on_handle);
                    self.ask_all(asked);
                }
                Event::Zoom(factor) if here && pane == Pane::Volume => {
                    let Some(at) = latest.map(|pos| share(room, pos)) else { continue };
                    self.ask(Request::Zoom { factor: f64::from(factor).clamp(0.01, 100.0), at });
                }
                _ => {}
            }
        }
        self.ask_all(hovered);
    }
}

fn button_of(button: PointerButton) -> Option<Button> {
    match button {
        PointerButton::Primary => Some(Button::Left),
        PointerButton::Middle => Some(Button::Middle),
        PointerButton::Secondary => Some(Button::Right),
        PointerButton::Extra1 | PointerButton::Extra2 => None,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_slice_fits_by_the_scale_of_the_one_that_needs_most_room() {
        let rect = Rect::from_min_size(pos2(10.0, 20.0), vec2(300.0, 200.0));
        let extents = [[200.0, 240.0], [200.0, 100.0], [240.0, 100.0]];
        assert_eq!(extents.map(|extent| scale(rect, extent)), [200.0 / 240.0, 1.5, 1.25]);
        assert_eq!(least_scale(rect, &extents), 200.0 / 240.0);
    }
}
