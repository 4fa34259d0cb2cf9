//! A cube that shows how the patient lies: its sides carry the letters of the body's directions.

use nalgebra::Vector3;

use crate::annotate::letter_along;
use crate::camera::Camera;
use crate::font;

/// Samples along a side of a pixel.
const FINE: usize = 4;
/// From this share of half a side on a face is edge.
const EDGE: f64 = 0.93;
/// How much of a face's height its letter takes.
const LETTER: f64 = 0.7;
/// Levels (of 255) of edges and letters.
const BLACK: f64 = 20.0;
const WHITE: f64 = 250.0;
/// Those of a face seen from aside and from straight before it.
const DARK: f64 = 70.0;
const LIGHT: f64 = 150.0;

/// The faces of a cube that a camera sees.
pub(crate) struct Cube {
    faces: Vec<Face>,
}

struct Face {
    /// Its middle, and from there to the middle of its right and its upper edge: to the picture's right and up, in halves of the cube's diagonal.
    middle: [f64; 2],
    right: [f64; 2],
    up: [f64; 2],
    glyph: font::Glyph,
    level: f64,
}

impl Cube {
    pub(crate) fn new(camera: &Camera) -> Self {
        let [right, up] = [camera.right, camera.up].map(|v| v.normalize());
        let toward_eye = right.cross(&up);
        let reach = 3.0_f64.sqrt();
        let on_picture = |v: Vector3<f64>| [v.dot(&right) / reach, v.dot(&up) / reach];
        let face = |axis: usize, against: bool| {
            let normal = Vector3::ith(axis, if against { -1.0 } else { 1.0 });
            let turned = normal.dot(&toward_eye);
            // Upright as a person stands; at head and feet as they are seen from there (`Side`).
            let face_up = if axis == 2 { Vector3::new(0.0, -normal.z, 0.0) } else { Vector3::z() };
            (turned > 1e-9).then(|| Face {
                middle: on_picture(normal),
                right: on_picture(face_up.cross(&normal)),
                up: on_picture(face_up),
                glyph: font::glyph(letter_along(axis, against)),
                level: DARK + (LIGHT - DARK) * turned,
            })
        };
        Self { faces: (0..6).filter_map(|side| face(side / 2, side % 2 == 1)).collect() }
    }

    /// The grey level (0…255) of a pixel of a square picture with so many a side, and how much of it the cube covers.
    pub(crate) fn pixel(&self, [x, y]: [usize; 2], side: usize) -> [f64; 2] {
        let (mut sum, mut met) = (0.0, 0_usize);
        for sample in 0..FINE * FINE {
            let share = |pixel: usize, part: usize| {
                2.0 * (pixel as f64 + (part as f64 + 0.5) / FINE as f64) / side as f64 - 1.0
            };
            let at = [share(x, sample % FINE), -share(y, sample / FINE)];
            if let Some(level) = self.faces.iter().find_map(|face| face.level_at(at)) {
                sum += level;
                met += 1;
            }
        }
        [sum / met.max(1) as f64, met as f64 / (FINE * FINE) as f64]
    }
}

impl Face {
    /// Its level at a place of the picture, if it lies there.
    fn level_at(&self, at: [f64; 2]) -> Option<f64> {
        let from = [at[0] - self.middle[0], at[1] - self.middle[1]];
        let cross = |a: [f64; 2], b: [f64; 2]| a[0] * b[1] - a[1] * b[0];
        let area = cross(self.right, self.up);
        let [across, up] = [cross(from, self.up) / area, cross(self.right, from) / area];
        if !(across.abs() <= 1.0 && up.abs() <= 1.0) {
            return None;
        }
        if across.abs().max(up.abs()) > EDGE {
            return Some(BLACK);
        }
        // A cell of the letter is as wide as it is high.
        let cell = 2.0 * LETTER / font::HEIGHT as f64;
        let column = (across / cell + font::WIDTH as f64 / 2.0).floor();
        let row = (font::HEIGHT as f64 / 2.0 - up / cell).floor();
        let is_within =
            (0.0..font::WIDTH as f64).contains(&column) && (0.0..font::HEIGHT as f64).contains(&row);
        let is_letter = is_within && self.glyph[row as usize] >> (font::WIDTH - 1 - column as usize) & 1 == 1;
        Some(if is_letter { WHITE } else { self.level })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fit::Held;
    use crate::{RenderParams, Side, View};

    fn cube(angles: [f64; 2]) -> Cube {
        let grid = ivd_core::Grid::with_spacing([4; 3], [1.0; 3]).unwrap();
        let view = View { angles, ..View::FRONT };
        Cube::new(&Camera::new(&grid, &RenderParams { view, ..RenderParams::default() }, &Held::Volume))
    }

    #[test]
    fn from_a_side_only_its_letter_is_seen_upright() {
        for (side, letter) in [
            (Side::Front, 'A'),
            (Side::Back, 'P'),
            (Side::Left, 'L'),
            (Side::Right, 'R'),
            (Side::Top, 'S'),
            (Side::Bottom, 'I'),
        ] {
            let cube = cube(side.angles());
            assert_eq!(cube.faces.len(), 1, "{side:?}");
            assert_eq!(cube.faces[0].glyph, font::glyph(letter), "{side:?}");
            let Face { right, up, .. } = cube.faces[0];
            assert!(right[0] > 0.5 && up[1] > 0.5, "{side:?}: {right:?} {up:?}");
        }
    }

    #[test]
    fn what_it_covers_is_the_area_of_its_faces() {
        let cube = cube([30.0, 20.0]);
        assert_eq!(cube.faces.len(), 3);
        // A parallelogram of half sides r, u has the area 4 |r × u|; the picture's is 4.
        let area = |face: &Face| (face.right[0] * face.up[1] - face.right[1] * face.up[0]).abs();
        let expected: f64 = cube.faces.iter().map(area).sum();
        let side = 100;
        let covered: f64 = (0..side * side).map(|i| cube.pixel([i % side, i / side], side)[1]).sum::<f64>()
            / (side * side) as f64;
        assert!((covered - expected).abs() < 2e-3, "{covered} {expected}");
    }
}
