use ivd_core::Image;
use nalgebra::Vector3;

use crate::camera::Camera;
use crate::cube::Cube;
use crate::font;

/// Letters along +x, −x, +y, −y, +z, −z of world space.
const LETTERS: [[char; 2]; 3] = [['R', 'L'], ['A', 'P'], ['S', 'I']];
/// Pictures with a shorter side below this have no room for letters (pixels).
const LEAST_SIDE: usize = 48;

/// What is drawn over a picture.
#[derive(Default)]
pub(crate) struct Marks<'a> {
    /// A scale bar at the bottom left and, at each edge, the letter of the body direction that it points to most.
    pub(crate) annotate: bool,
    /// A cube at the top right with the letters of the body's directions on its sides.
    pub(crate) cube: bool,
    /// Whether the world's axes are known to be the patient's: where they aren't, nothing has letters, and there is no cube.
    pub(crate) in_patient: bool,
    /// What colours mean, at the bottom right.
    pub(crate) bar: Option<&'a Bar<'a>>,
}

/// Draws marks over a picture, where that is large enough.
pub(crate) fn annotate(image: Image, camera: &Camera, marks: &Marks<'_>) -> Image {
    let (width, height) = (image.width(), image.height());
    if width.min(height) < LEAST_SIDE {
        return image;
    }
    let mut canvas = Canvas::new(image);
    if marks.annotate && marks.in_patient {
        canvas.letters(camera.right, camera.up);
    }
    if marks.annotate {
        canvas.scale_bar(camera.pixel_mm);
    }
    if marks.cube && marks.in_patient {
        canvas.cube(&Cube::new(camera));
    }
    if let Some(bar) = marks.bar {
        canvas.colour_bar(bar, marks.annotate);
    }
    canvas.into_image()
}

/// Letter along an axis of the patient, or against it.
pub(crate) fn letter_along(axis: usize, against: bool) -> char {
    LETTERS[axis][usize::from(against)]
}

/// Letter of the axis that a direction points along most.
fn letter(direction: Vector3<f64>) -> char {
    // A small preference for the later axes, so that ties don't hang on rounding.
    let axis = (0..3).rev().fold(
        2,
        |best, a| {
            if direction[a].abs() > direction[best].abs() + 1e-9 { a } else { best }
        },
    );
    letter_along(axis, direction[axis] < 0.0)
}

/// The longest of 1, 2, 5 · 10ⁿ mm that fits into `most` mm.
fn bar_length(most: f64) -> (f64, String) {
    let exponent = most.log10().floor() as i32;
    let power = 10_f64.powi(exponent);
    let digit = [5.0, 2.0, 1.0].into_iter().find(|d| d * power <= most).unwrap_or(1.0);
    let text = match exponent {
        0..=4 => format!("{}", digit * power),
        -3..=-1 => format!("{:.*}", -exponent as usize, digit * power),
        _ => format!("{digit}e{exponent}"),
    };
    (digit * power, text + " mm")
}

/// A bar that says what colours mean.
pub(crate) struct Bar<'a> {
    /// The colour at a share of it, 0…1.
    pub(crate) colour: Box<dyn Fn(f64) -> [u8; 3] + 'a>,
    /// What its ends mean.
    pub(crate) ends: [String; 2],
}

impl<'a> Bar<'a> {
    /// A bar from a length below 0 to one above (mm).
    pub(crate) fn of_length(colour: impl Fn(f64) -> [u8; 3] + 'a, most: f64) -> Self {
        let (_, most) = bar_length(most);
        Self { colour: Box::new(colour), ends: [format!("-{}", most.trim_end_matches(" mm")), most] }
    }
}

struct Canvas {
    width: usize,
    height: usize,
    rgba: Vec<u8>,
    /// Pixels of a font pixel.
    size: usize,
}

impl Canvas {
    fn new(image: Image) -> Self {
        let (width, height) = (image.width(), image.height());
        Self { width, height, size: (width.min(height) / 256).max(1), rgba: image.into_rgba() }
    }

    fn into_image(self) -> Image {
        Image::new(self.width, self.height, self.rgba).expect("the size didn't change")
    }

    fn dot(&mut self, x: usize, y: usize, [red, green, blue]: [u8; 3]) {
        if x < self.width && y < self.height {
            let at = 4 * (x + self.width * y);
            self.rgba[at..at + 4].copy_from_slice(&[red, green, blue, 255]);
        }
    }

    fn block(&mut self, x: usize, y: usize, width: usize, height: usize, level: u8) {
        for dy in 0..height {
            for dx in 0..width {
                self.dot(x + dx, y + dy, [level; 3]);
            }
        }
    }

    /// White letters with a black rim, readable on any background.
    fn text(&mut self, x: usize, y: usize, text: &str) {
        let size = self.size;
        for rim in [true, false] {
            for (i, sign) in text.chars().enumerate() {
                let left = x + i * (font::WIDTH + 1) * size;
                for (row, bits) in font::glyph(sign).into_iter().enumerate() {
                    for column in (0..font::WIDTH).filter(|c| bits >> (font::WIDTH - 1 - c) & 1 == 1) {
                        let (px, py) = (left + column * size, y + row * size);
                        if rim {
                            self.block(px.saturating_sub(1), py.saturating_sub(1), size + 2, size + 2, 0);
                        } else {
                            self.block(px, py, size, size, 255);
                        }
                    }
                }
            }
        }
    }

    /// At each edge the letter of the direction there.
    fn letters(&mut self, right: Vector3<f64>, up: Vector3<f64>) {
        let (width, height, size) = (self.width, self.height, self.size);
        let middle = |n: usize, letter: usize| n.saturating_sub(letter * size) / 2;
        let (x, y) = (middle(width, font::WIDTH), middle(height, font::HEIGHT));
        let margin = 2 * size;
        self.text(margin, y, &letter(-right).to_string());
        self.text(width - margin - font::WIDTH * size, y, &letter(right).to_string());
        self.text(x, margin, &letter(up).to_string());
        self.text(x, height - margin - font::HEIGHT * size, &letter(-up).to_string());
    }

    /// A bar of colours as wide as a quarter of the picture, or as its ends over it need; none where there is no room.
    fn colour_bar(&mut self, bar: &Bar<'_>, beside_others: bool) {
        let (size, high) = (self.size, 4 * self.size);
        let [least, most] = &bar.ends;
        let letters = |text: &str| text.len() * (font::WIDTH + 1) * size;
        // Both ends have room, with a letter between them.
        let wide = (self.width / 4).max(letters(least) + letters(most) + letters(" "));
        let Some(x) = self.width.checked_sub(wide + 3 * size).filter(|x| *x > 0) else { return };
        // Above the scale bar and the letter in the middle, where there is no room beside them.
        let up = if beside_others && x < self.width / 2 + font::WIDTH * size {
            (font::HEIGHT + 9) * size
        } else {
            0
        };
        let y = self.height - high - 3 * size - up;
        self.block(x - 1, y - 1, wide + 2, high + 2, 0);
        for dx in 0..wide {
            let colour = (bar.colour)((dx as f64 + 0.5) / wide as f64);
            (0..high).for_each(|dy| self.dot(x + dx, y + dy, colour));
        }
        let above = y - (font::HEIGHT + 2) * size;
        self.text(x, above, least);
        self.text(x + wide - letters(most), above, most);
    }

    /// A cube at the top right, a sixth of the shorter side at most.
    fn cube(&mut self, cube: &Cube) {
        let side = self.width.min(self.height) / 6;
        let (left, top) = (self.width - side - 3 * self.size, 3 * self.size);
        for y in 0..side {
            for x in 0..side {
                let [level, share] = cube.pixel([x, y], side);
                let at = 4 * (left + x + self.width * (top + y));
                for (shown, level) in self.rgba[at..at + 4].iter_mut().zip([level, level, level, 255.0]) {
                    let behind = f64::from(*shown);
                    *shown = (behind + share * (level - behind)).round() as u8;
                }
            }
        }
    }

    /// A bar of at most a quarter of the width, with its length.
    fn scale_bar(&mut self, pixel_mm: f64) {
        let (length, text) = bar_length(0.25 * self.width as f64 * pixel_mm);
        let pixels = (length / pixel_mm).round() as usize;
        let (x, y, size) = (3 * self.size, self.height - 4 * self.size, self.size);
        self.block(x - 1, y - 1, pixels + 2, size + 2, 0);
        self.block(x, y, pixels, size, 255);
        self.text(x, y - (font::HEIGHT + 2) * size, &text);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fit::Held;
    use crate::{RenderParams, Side, View};

    #[test]
    fn letters_name_the_nearest_body_axis() {
        assert_eq!(letter(Vector3::new(-0.9, 0.1, 0.3)), 'L');
        assert_eq!(letter(Vector3::new(0.1, 0.9, -0.3)), 'A');
        assert_eq!(letter(Vector3::new(0.0, 0.1, -0.3)), 'I');
    }

    #[test]
    fn a_side_of_the_patient_has_its_letters_where_one_who_stands_there_sees_them() {
        let grid = ivd_core::Grid::with_spacing([4; 3], [1.0; 3]).unwrap();
        // To the picture's left, to its right, up.
        for (side, letters) in [
            (Side::Front, "RLS"),
            (Side::Left, "APS"),
            (Side::Back, "LRS"),
            (Side::Right, "PAS"),
            (Side::Top, "RLP"),
            (Side::Bottom, "RLA"),
        ] {
            let view = View { angles: side.angles(), ..View::FRONT };
            let params = RenderParams { view, ..RenderParams::default() };
            let camera = Camera::new(&grid, &params, &Held::Volume);
            let found: String = [-camera.right, camera.right, camera.up].into_iter().map(letter).collect();
            assert_eq!(found, letters, "{side:?}");
        }
    }

    #[test]
    fn letters_are_drawn_only_where_the_patients_axes_are_known() {
        let grid = ivd_core::Grid::with_spacing([4; 3], [1.0; 3]).unwrap();
        let params = RenderParams { size: [64, 64], ..RenderParams::default() };
        let camera = Camera::new(&grid, &params, &Held::Volume);
        let blank = Image::new(64, 64, vec![9; 4 * 64 * 64]).unwrap();
        let [with, without] = [true, false].map(|in_patient| {
            annotate(blank.clone(), &camera, &Marks { annotate: true, in_patient, ..Marks::default() })
        });
        let drawn = |image: &Image, rows: std::ops::Range<usize>| {
            image.rgba()[4 * 64 * rows.start..4 * 64 * rows.end].iter().any(|&c| c != 9)
        };
        assert!(drawn(&with, 0..40), "letters at the top and the sides");
        assert!(!drawn(&without, 0..40) && drawn(&without, 40..64), "the bar alone");
    }

    #[test]
    fn bars_are_round_lengths_that_fit() {
        assert_eq!(bar_length(64.0), (50.0, "50 mm".to_owned()));
        assert_eq!(bar_length(2.0), (2.0, "2 mm".to_owned()));
        assert_eq!(bar_length(1999.0), (1000.0, "1000 mm".to_owned()));
        assert_eq!(bar_length(0.3).1, "0.2 mm");
        assert_eq!(bar_length(3e-7).1, "2e-7 mm");
    }

    #[test]
    fn a_bar_of_colours_has_room_for_its_ends_or_is_left_out() {
        let grid = ivd_core::Grid::with_spacing([4; 3], [1.0; 3]).unwrap();
        let camera = Camera::new(&grid, &RenderParams::default(), &Held::Volume);
        for (side, most) in [(48, 0.001), (50, 0.001), (64, 5.0), (120, 0.05), (512, 0.005), (512, 20.0)] {
            let blank = Image::new(side, side, vec![9; 4 * side * side]).unwrap();
            let bar = Bar::of_length(|_| [200, 0, 0], most);
            let drawn = annotate(blank, &camera, &Marks { bar: Some(&bar), ..Marks::default() });
            let red = drawn.rgba().chunks(4).filter(|pixel| pixel[0] == 200).count();
            let size = (side / 256).max(1);
            let ends = (2 * bar_length(most).1.len() - 1) * 6 * size;
            assert!(red == 0 || red >= 4 * size * ends.max(side / 4), "{side} {most}: {red}");
            assert_eq!(red > 0, ends + 3 * size < side, "{side} {most}");
        }
    }

    #[test]
    fn every_sign_of_the_lettering_has_a_glyph() {
        for sign in "0123456789.RLAPSIme-".chars() {
            assert_ne!(font::glyph(sign), [0; 7], "{sign}");
        }
    }
}
