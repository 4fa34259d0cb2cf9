//! What is drawn over a pane's picture: cross hair, handles, pins, letters, a bar of a round length.

use std::cell::RefCell;

use egui::{Align2, Color32, FontId, Painter, Pos2, Rect, Shape, Stroke, Vec2, pos2, vec2};
use ivd_frames::{Bone, Figures, Hovered, Overlay, Pane, Ruler, SEEN_ASIDE, Shows, Spot, Tool};

use crate::handles::{length, told};
use crate::rulers::{degrees, mm, shown_mm};
use crate::shown::Shown;

const CROSS: Color32 = Color32::from_rgba_premultiplied(63, 139, 106, 170);
const HANDLE: Color32 = Color32::from_rgb(255, 180, 84);
const HELD: Color32 = Color32::from_rgb(255, 212, 121);
const PIN: Color32 = Color32::from_rgb(108, 182, 255);
const CUT: Color32 = Color32::from_rgb(245, 245, 245);
const BONE: Color32 = Color32::from_rgb(235, 215, 160);
const RULER: Color32 = Color32::from_rgb(190, 240, 110);
const OUTLINE: Color32 = Color32::from_rgb(80, 220, 230);
const REST: Color32 = Color32::from_rgb(240, 160, 220);
const TEXT: Color32 = Color32::from_rgb(221, 221, 238);
const FAINT: Color32 = Color32::from_rgb(154, 163, 178);
/// Of what is written over pictures (points).
const LETTERS: f32 = 13.0;
/// Where letters stand along the edges (points).
const EDGE: f32 = 24.0;

/// A length keeps off its line by so much (points), ...
const CLEAR: f32 = 6.0;
/// ... above it where that rises by less than this share of its way, else to its right.
const FLAT: f32 = 0.35;

/// Width and height of what tells colours apart (points), and into how many it is divided.
const LEGEND: Vec2 = vec2(100.0, 8.0);
const SHADES: usize = 25;
/// Of a class's colour and number (points).
const CHIP: f32 = 34.0;

/// Texts that would lie over one another are tried so many lines further down, and up.
const LINES: i32 = 8;

/// What is drawn over a pane.
pub(crate) struct Over<'a> {
    pub(crate) painter: &'a Painter,
    pub(crate) pane: Pane,
    /// The pane, and the picture in it.
    pub(crate) rect: Rect,
    pub(crate) room: Rect,
    pub(crate) shown: &'a Shown,
    pub(crate) tool: Tool,
    /// Whether the pointer is over a picture.
    pub(crate) pointed: bool,
    /// Whether the hand does something in this pane.
    pub(crate) is_at_work: bool,
    /// The handle that was worked on last.
    pub(crate) selected: Option<u32>,
    /// Whether the surface is drawn over slices.
    pub(crate) is_outlined: bool,
    /// The line that is drawn, to cut, to measure or to make a bone along.
    pub(crate) line: Option<[[f64; 2]; 2]>,
    /// Where rulers and handles are written about.
    pub(crate) written: RefCell<Vec<Rect>>,
}

impl Over<'_> {
    /// Draws all of it.
    pub(crate) fn draw(&self) {
        self.outline();
        self.cross_hair();
        // Below what hands take hold of.
        self.letters();
        if let Some(figures) = self.shown.figures() {
            self.spots(figures);
            self.cut(figures);
            figures.bones.iter().for_each(|bone| self.bone(bone));
            figures.rulers.iter().for_each(|ruler| self.ruler(figures, ruler));
            self.legend(figures);
            self.states(figures);
        }
        self.bar();
        self.write(self.rect.left_top() + vec2(6.0, 4.0), Align2::LEFT_TOP, name(self.pane), LETTERS, FAINT);
    }

    /// The surface that moves, where the slice cuts it; of a picture that is divided the two halves would need one each.
    fn outline(&self) {
        let shows = self.shown.figures().map(|figures| figures.compare.shows);
        let Some(outline) =
            self.shown.outline(self.pane).filter(|_| self.is_outlined && shows != Some(Shows::Both))
        else {
            return;
        };
        let stroke = Stroke::new(1.0, OUTLINE.gamma_multiply(0.75));
        let place = |at: [f32; 2]| self.place(at.map(f64::from));
        self.painter.extend(outline.iter().map(|piece| Shape::line_segment(piece.map(place), stroke)));
    }

    /// Writes something, dark around it: pictures are light and dark.
    fn write(&self, at: Pos2, align: Align2, text: impl ToString, size: f32, colour: Color32) {
        let font = FontId::proportional(size);
        let dark = Color32::BLACK.gamma_multiply(0.8 * f32::from(colour.a()) / 255.0);
        self.painter.text(at + vec2(1.0, 1.0), align, text.to_string(), font.clone(), dark);
        self.painter.text(at, align, text, font, colour);
    }

    /// Writes something that belongs to a place, within the picture and clear of its letters and of what else was written so.
    fn note(&self, at: Pos2, align: Align2, text: &str, colour: Color32) {
        let size = self.painter.layout_no_wrap(text.to_owned(), FontId::proportional(LETTERS), colour).size();
        let mut written = self.written.borrow_mut();
        let rect = clear_of(&written, align.anchor_size(at, size), self.rect.shrink(EDGE));
        written.push(rect);
        drop(written);
        self.write(rect.left_top(), Align2::LEFT_TOP, text, LETTERS, colour);
    }

    fn place(&self, share: [f64; 2]) -> Pos2 {
        self.room.min + vec2(share[0] as f32 * self.room.width(), share[1] as f32 * self.room.height())
    }

    /// Points for every mm.
    fn scale(&self) -> Option<f32> {
        self.shown.width_mm(self.pane).map(|mm| self.room.width() / mm as f32)
    }

    fn cross_hair(&self) {
        if self.pane == Pane::Volume {
            return;
        }
        let Some(at) = self.shown.cross_at()[self.pane.number()].map(|at| self.place(at)) else { return };
        // Not through the letters at the edges.
        let within = self.rect.shrink(EDGE);
        self.painter.hline(within.x_range(), at.y, Stroke::new(1.0, CROSS));
        self.painter.vline(at.x, within.y_range(), Stroke::new(1.0, CROSS));
    }

    fn ring(&self, at: Pos2, radius: f32, colour: Color32, width: f32) {
        self.painter.circle_stroke(at, radius.max(1.0), Stroke::new(width, colour));
    }

    /// What doesn't lie in a slice, or is hidden in the volume, is faint there.
    fn faint(&self, spot: &Spot, colour: Color32) -> Color32 {
        if spot.beside[self.pane.number()] { colour.gamma_multiply(0.4) } else { colour }
    }

    /// Which way goes into the surface about a handle: an arrow, or what to do where it goes away from who sees it.
    fn inwards(&self, at: Pos2, one: &Spot, scale: f32) {
        let Some(end) = one.inwards[self.pane.number()].map(|end| self.place(end)) else { return };
        let way = end - at;
        if way.length() > (SEEN_ASIDE * 0.5 * one.radius) as f32 * scale {
            let from = at + way.normalized() * 8.0;
            self.painter.arrow(from, end - from, Stroke::new(1.5, HANDLE.gamma_multiply(0.8)));
            self.write(end + way.normalized() * 9.0, Align2::CENTER_CENTER, "in", LETTERS, HANDLE);
        } else if self.pane == Pane::Volume {
            self.write(at + vec2(8.0, 8.0), Align2::LEFT_TOP, "N, then up: in", LETTERS, HANDLE);
        }
    }

    fn spots(&self, figures: &Figures) {
        let number = self.pane.number();
        let Some(scale) = self.scale() else { return };
        for pin in figures.pins.iter().filter(|pin| pin.seen[number]) {
            let Some(at) = pin.at[number].map(|at| self.place(at)) else { continue };
            let colour = self.faint(pin, PIN);
            self.ring(at, 5.0, colour, 2.0);
            self.ring(at, pin.radius as f32 * scale, colour.gamma_multiply(0.35), 1.0);
        }
        let hovered = figures.hovered.as_ref().filter(|_| self.pointed);
        let pointed = hovered.and_then(|hovered| hovered.handle);
        for one in figures.handles.iter().filter(|one| one.seen[number] || figures.held == Some(one.id)) {
            let Some(at) = one.at[number].map(|at| self.place(at)) else { continue };
            let held = figures.held == Some(one.id) || pointed == Some(one.id);
            let colour = self.faint(one, if held { HELD } else { HANDLE });
            self.ring(at, 6.0, colour, if held { 3.0 } else { 2.0 });
            if held {
                self.ring(at, one.radius as f32 * scale, colour.gamma_multiply(0.55), 1.0);
            }
            // Before anything is typed or dragged, too, it is seen which way it would go.
            let is_unmoved = one.by.is_some_and(|by| length(by) == 0.0);
            let is_next = self.selected == Some(one.id) && (is_unmoved || self.tool == Tool::Handle);
            if figures.held == Some(one.id) || is_next && figures.held.is_none() {
                self.inwards(at, one, scale);
            }
            // How far it has gone stands where the hand is, on the side that has room.
            let moved = told(one, figures.letters.is_some())
                .filter(|_| figures.held == Some(one.id) && self.is_at_work);
            let text = moved.map_or_else(|| one.id.to_string(), |moved| format!("{}: {moved}", one.id));
            let (way, align) = if self.is_at_work && at.x > self.rect.center().x {
                (-8.0, Align2::RIGHT_BOTTOM)
            } else {
                (8.0, Align2::LEFT_BOTTOM)
            };
            self.note(at + vec2(way, -8.0), align, &text, colour);
        }
        if let Some(hovered) = hovered.filter(|_| figures.held.is_none() && pointed.is_none()) {
            self.would_take(figures, hovered, scale);
        }
    }

    /// The vertex that a new handle would take, which may lie away from the pointer.
    fn would_take(&self, figures: &Figures, hovered: &Hovered, scale: f32) {
        let number = self.pane.number();
        let Some(vertex) = hovered.vertex_at[number].filter(|_| self.tool == Tool::Handle) else { return };
        let vertex = self.place(vertex);
        let faint = Color32::WHITE.gamma_multiply(0.35);
        if let Some(place) = hovered.at[number].filter(|_| hovered.pane == self.pane) {
            self.painter.line_segment([self.place(place), vertex], Stroke::new(1.0, faint));
        }
        self.ring(vertex, 3.0, Color32::WHITE, 1.0);
        self.ring(vertex, figures.radius as f32 * scale, faint, 1.0);
    }

    /// The mouth of the cut that there is, while another may be drawn, and the line that is drawn with its length.
    fn cut(&self, figures: &Figures) {
        let mouth = figures.incision.as_ref().and_then(|cut| cut.at[self.pane.number()]);
        // Over the volume one that lies within would seem to lie on its skin.
        let is_slice = self.pane != Pane::Volume && figures.compare.shows != Shows::Rest;
        if let Some(ends) = mouth.filter(|_| is_slice && self.tool == Tool::Incise && self.line.is_none()) {
            let ends = ends.map(|end| self.place(end));
            self.painter.extend(Shape::dashed_line(
                &ends,
                Stroke::new(1.0, CUT.gamma_multiply(0.7)),
                4.0,
                5.0,
            ));
        }
        let (Some(line), Some(scale)) = (self.line, self.scale()) else { return };
        let [from, to] = line.map(|end| self.place(end));
        self.painter.line_segment([from, to], Stroke::new(4.0, Color32::BLACK.gamma_multiply(0.6)));
        let measures = self.tool == Tool::Measure;
        let colour = match self.tool {
            Tool::Measure => RULER,
            Tool::Bone => BONE,
            _ => CUT,
        };
        self.painter.line_segment([from, to], Stroke::new(2.0, colour));
        let length = f64::from(from.distance(to) / scale);
        let length = match self.pane {
            // Between two places of the volume it goes into depth, too.
            Pane::Volume if measures => return,
            _ if measures => format!("{length:.1} mm"),
            // A cut is a disc about the middle of its mouth, which over what is round is longer than it looks.
            Pane::Volume if self.tool == Tool::Incise => {
                format!("{length:.0} mm, at least {:.1} mm deep", length / 2.0)
            }
            _ if self.tool == Tool::Incise => {
                format!("{length:.0} mm, {:.1} mm before and behind the slice", length / 2.0)
            }
            _ => format!("{length:.0} mm"),
        };
        self.write(to + vec2(10.0, -8.0), Align2::LEFT_BOTTOM, length, LETTERS, colour);
    }

    /// The line that a bone lies along, from its joint on.
    fn bone(&self, bone: &Bone) {
        let number = self.pane.number();
        let Some([from, to]) = bone.at[number].map(|ends| ends.map(|end| self.place(end))) else { return };
        let faint = bone.beside[number];
        let share = if faint { 0.3 } else { 1.0 };
        self.painter.line_segment([from, to], Stroke::new(5.0, Color32::BLACK.gamma_multiply(0.6 * share)));
        self.painter.line_segment([from, to], Stroke::new(3.0, BONE.gamma_multiply(share)));
        self.ring(from, 5.0, BONE.gamma_multiply(share), 2.0);
        self.painter.circle_filled(to, 3.0, BONE.gamma_multiply(share));
        if !faint {
            self.write(to + vec2(6.0, -4.0), Align2::LEFT_BOTTOM, &bone.name, LETTERS, BONE);
        }
    }

    /// A ruler with its lengths, and its angle where it has one.
    fn ruler(&self, figures: &Figures, ruler: &Ruler) {
        let number = self.pane.number();
        // What doesn't lie in a slice, or is hidden in the volume, is faint there, without its numbers.
        let faint = ruler.beside[number];
        let colour = if faint { RULER.gamma_multiply(0.3) } else { RULER };
        let ends: Option<Vec<Pos2>> = ruler.at.iter().map(|at| Some(self.place(at[number]?))).collect();
        let Some(ends) = ends else { return };
        for (leg, pair) in ends.windows(2).enumerate() {
            let dark = Color32::BLACK.gamma_multiply(if faint { 0.2 } else { 0.6 });
            self.painter.line_segment([pair[0], pair[1]], Stroke::new(4.0, dark));
            self.painter.line_segment([pair[0], pair[1]], Stroke::new(1.5, colour));
            if !faint {
                // What it was at rest stands in the list: over the volume all rulers are seen at once.
                let text = match self.pane {
                    Pane::Volume => format!("{:.1} mm", shown_mm(figures, ruler, leg)),
                    _ => mm(figures, ruler, leg),
                };
                let font = FontId::proportional(LETTERS);
                let size = self.painter.layout_no_wrap(text.clone(), font, colour).size();
                let (off, align) = beside(pair[1] - pair[0], size);
                self.note(pair[0] + 0.5 * (pair[1] - pair[0]) + off, align, &text, colour);
            }
        }
        for end in &ends {
            self.ring(*end, 3.0, colour, 1.5);
        }
        if let Some(text) = degrees(figures, ruler).filter(|_| !faint) {
            self.note(ends[1] + vec2(8.0, 6.0), Align2::LEFT_TOP, &text, colour);
        }
    }

    /// Says where the body is shown at rest, and draws the line that divides both.
    fn states(&self, figures: &Figures) {
        let (low, large) = (vec2(0.0, -18.0), LETTERS + 2.0);
        match figures.compare.shows {
            Shows::Now => {}
            Shows::Rest => {
                let at = self.rect.left_top() + vec2(6.0, 22.0);
                self.write(at, Align2::LEFT_TOP, Shows::Rest.word(), large, REST);
            }
            Shows::Both => {
                let at = self.place([figures.compare.at, 1.0]);
                // Not through the letters at the edges.
                let line = self.rect.shrink(EDGE).intersect(self.room).y_range();
                self.painter.vline(at.x, line, Stroke::new(4.0, Color32::BLACK.gamma_multiply(0.6)));
                self.painter.vline(at.x, line, Stroke::new(2.0, REST));
                let at = at + low;
                let [left, right] = [Align2::RIGHT_BOTTOM, Align2::LEFT_BOTTOM];
                self.write(at - vec2(8.0, 0.0), left, Shows::Rest.word(), large, REST);
                self.write(at + vec2(8.0, 0.0), right, Shows::Now.word(), large, TEXT);
            }
        }
    }

    /// What the colours over a slice mean.
    fn legend(&self, figures: &Figures) {
        let is_coloured = self.pane != Pane::Volume && figures.compare.shows != Shows::Rest;
        let corner = self.rect.left_bottom() + vec2(6.0, -38.0);
        if figures.overlay == Some(Overlay::Classes) && self.pane != Pane::Volume {
            self.chips(figures, corner);
        }
        let of = figures.overlay.filter(|_| is_coloured);
        let Some(scale) = of.and_then(|of| of.scale(figures.largest_mm)) else { return };
        let bar = Rect::from_min_size(corner, LEGEND);
        let step = LEGEND.x / SHADES as f32;
        for shade in 0..SHADES {
            let [red, green, blue] = scale.colour((shade as f64 + 0.5) / SHADES as f64);
            let part = Rect::from_min_size(corner + vec2(step * shade as f32, 0.0), vec2(step, LEGEND.y));
            self.painter.rect_filled(part, 0.0, Color32::from_rgb(red, green, blue));
        }
        self.write(bar.left_top() - vec2(0.0, 2.0), Align2::LEFT_BOTTOM, scale.told(), LETTERS, TEXT);
    }

    /// The classes by their colours, as far as there is room.
    fn chips(&self, figures: &Figures, corner: Pos2) {
        let mut at = corner;
        let shown: Vec<_> = figures.classes.iter().filter(|class| !class.hidden).collect();
        // To the right lies what tells how long something is.
        let room = ((self.rect.right() - 110.0 - corner.x) / CHIP).max(1.0) as usize;
        if shown.len() > room {
            let more = format!("+ {}", shown.len() - room);
            self.write(corner + vec2(CHIP * room as f32, 5.0), Align2::LEFT_CENTER, more, LETTERS, TEXT);
        }
        for class in shown.into_iter().take(room) {
            let colour = Color32::from_hex(&class.colour).unwrap_or(TEXT);
            let chip = Rect::from_min_size(at, vec2(10.0, 10.0));
            self.painter.rect_filled(chip, 2.0, colour);
            self.painter.rect_stroke(chip, 2.0, Stroke::new(1.0, FAINT), egui::StrokeKind::Inside);
            self.write(at + vec2(13.0, 5.0), Align2::LEFT_CENTER, class.id, LETTERS, TEXT);
            at.x += CHIP;
        }
    }

    fn letters(&self) {
        let Some([left, right, top, bottom]) = self.shown.letters(self.pane) else { return };
        let (rect, middle) = (self.rect, self.rect.center());
        for (at, align, letter) in [
            (pos2(rect.left() + 6.0, middle.y), Align2::LEFT_CENTER, left),
            (pos2(rect.right() - 6.0, middle.y), Align2::RIGHT_CENTER, right),
            (pos2(middle.x, rect.top() + 4.0), Align2::CENTER_TOP, top),
            (pos2(middle.x, rect.bottom() - 4.0), Align2::CENTER_BOTTOM, bottom),
        ] {
            self.write(at, align, letter, LETTERS + 2.0, TEXT);
        }
        if let Some(slice) = self.pane.number().checked_sub(1).and_then(|n| Some(&self.shown.slices()?[n])) {
            let at = rect.left_bottom() + vec2(6.0, -4.0);
            let clipped = if slice.clipped { " · clipped" } else { "" };
            let oblique = slice.oblique.map_or_else(String::new, |by| format!(" · oblique by {by:.0}°"));
            let which = format!("{} / {}{oblique}{clipped}", slice.slice + 1, slice.slices);
            self.write(at, Align2::LEFT_BOTTOM, which, LETTERS, TEXT);
        }
    }

    /// A bar of a round length.
    fn bar(&self) {
        let Some(scale) = self.scale().filter(|scale| scale.is_finite() && *scale > 0.0) else { return };
        let length = round_length(f64::from(0.25 * self.rect.width() / scale));
        let end = self.rect.right_bottom() - vec2(8.0, 8.0);
        let wide = length as f32 * scale;
        let bar = Rect::from_min_max(end - vec2(wide, 2.0), end);
        self.painter.rect_filled(bar, 0.0, TEXT);
        self.write(end - vec2(0.0, 5.0), Align2::RIGHT_BOTTOM, format!("{length} mm"), LETTERS, TEXT);
    }
}

/// The longest of 1, 2, 5, 10 … that is no longer.
fn round_length(most: f64) -> f64 {
    let power = 10.0_f64.powf(most.log10().floor());
    let length = [5.0, 2.0, 1.0].map(|n| n * power).into_iter().find(|length| *length <= most);
    // Without the digits that a power of ten below one brings.
    (length.unwrap_or(power) * 1e6).round() / 1e6
}

/// Where something is written in a room: as near to where it belongs as it is clear of what was written, or there where it is nowhere.
fn clear_of(written: &[Rect], rect: Rect, room: Rect) -> Rect {
    let within = |at: Rect| at.translate(held_in(at, room));
    let first = within(rect);
    let lines = (0..=LINES).flat_map(|line| [line, -line]);
    let places = lines.map(|line| within(first.translate(vec2(0.0, line as f32 * rect.height()))));
    let is_free = |at: &Rect| !written.iter().any(|other| other.intersects(at.shrink(1.0)));
    { places }.find(is_free).unwrap_or(first)
}

/// The way by which something comes to lie in a room, as far as it has room there.
fn held_in(rect: Rect, room: Rect) -> Vec2 {
    let along = |low: f32, high: f32, [least, most]: [f32; 2]| (least - low).max((most - high).min(0.0));
    vec2(
        along(rect.left(), rect.right(), [room.left(), room.right()]),
        along(rect.top(), rect.bottom(), [room.top(), room.bottom()]),
    )
}

/// How a pane is called.
pub(crate) fn name(pane: Pane) -> &'static str {
    match pane {
        Pane::Volume => "Volume",
        Pane::Axial => "Axial",
        Pane::Coronal => "Coronal",
        Pane::Sagittal => "Sagittal",
    }
}

/// Where a text of a size stands beside the middle of a line, clear of it: above a flat one, to the right of others.
fn beside(way: Vec2, size: Vec2) -> (Vec2, Align2) {
    let [flat, steep] = [way.x.abs().max(1e-3), way.y.abs().max(1e-3)];
    if steep < FLAT * flat {
        (vec2(0.0, -(CLEAR + 0.5 * size.x * steep / flat)), Align2::CENTER_BOTTOM)
    } else {
        (vec2(CLEAR + 0.5 * size.y * flat / steep, 0.0), Align2::LEFT_CENTER)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_rulers_length_never_lies_on_its_line() {
        let size = vec2(150.0, 14.0);
        for degrees in 0_u16..360 {
            let turn = f32::from(degrees).to_radians();
            let way = 100.0 * vec2(turn.cos(), turn.sin());
            let (off, align) = beside(way, size);
            let text = align.anchor_size(Pos2::ZERO + off, size);
            let corners = [text.left_top(), text.right_top(), text.left_bottom(), text.right_bottom()];
            let sides = corners.map(|corner| way.x * corner.y - way.y * corner.x);
            assert!(sides.iter().all(|side| side * sides[0] > 0.0), "{degrees}°: {sides:?}");
        }
    }

    #[test]
    fn what_is_written_about_a_place_is_held_in_its_picture() {
        let room = Rect::from_min_max(pos2(0.0, 0.0), pos2(100.0, 50.0));
        let size = vec2(30.0, 10.0);
        for (corner, wanted) in [
            ((10.0, 10.0), (10.0, 10.0)),
            ((-5.0, 45.0), (0.0, 40.0)),
            ((90.0, -20.0), (70.0, 0.0)),
            ((200.0, 200.0), (70.0, 40.0)),
        ] {
            let rect = Rect::from_min_size(pos2(corner.0, corner.1), size);
            assert_eq!(rect.translate(held_in(rect, room)).min, pos2(wanted.0, wanted.1), "{corner:?}");
        }
        // What was written there first stays readable, in the lowest corner as well.
        let mut written = Vec::new();
        for _ in 0..4 {
            let next = clear_of(&written, Rect::from_min_size(pos2(95.0, 48.0), size), room);
            assert!(
                room.contains_rect(next)
                    && !written.iter().any(|other: &Rect| other.intersects(next.shrink(1.0)))
            );
            written.push(next);
        }
        // What is wider than the room begins where it does.
        let wide = Rect::from_min_size(pos2(-40.0, 0.0), vec2(300.0, 10.0));
        assert_eq!(wide.translate(held_in(wide, room)).left(), 0.0);
    }

    #[test]
    fn bars_have_round_lengths() {
        let lengths = [0.034, 0.99, 1.0, 3.0, 49.0, 73.0].map(round_length);
        assert_eq!(lengths, [0.02, 0.5, 1.0, 2.0, 20.0, 50.0]);
    }
}
