use std::sync::LazyLock;

use ivd_core::{Image, srgb};
use rayon::prelude::*;

use crate::{Radiance, RenderParams};

/// Rows that are encoded at a time.
const ROWS: usize = 16;

/// Encodes many components: finds the byte from a coarse table, then puts it right by the linear value at which each byte begins.
struct Encoder {
    guess: Vec<u8>,
    begins: [f32; 256],
}

impl Encoder {
    const CELLS: usize = 4096;

    fn new() -> Self {
        let begins = std::array::from_fn(|b| srgb::linear((b as f32 - 0.5).max(0.0) / 255.0));
        let byte_at = |l: f32| (begins.partition_point(|&b| b <= l) - 1) as u8;
        let guess = (0..=Self::CELLS).map(|i| byte_at(i as f32 / Self::CELLS as f32)).collect();
        Self { guess, begins }
    }

    fn byte(&self, linear: f32) -> u8 {
        let l = linear.clamp(0.0, 1.0);
        let mut byte = self.guess[(l * Self::CELLS as f32) as usize];
        while byte < 255 && self.begins[usize::from(byte) + 1] <= l {
            byte += 1;
        }
        byte
    }
}

static ENCODER: LazyLock<Encoder> = LazyLock::new(Encoder::new);

/// What stands behind a picture: straight linear RGBA at its top and at its bottom.
pub(crate) struct Background([[f64; 4]; 2]);

impl Background {
    /// That which is asked for.
    pub(crate) fn of(params: &RenderParams) -> Self {
        Self([params.background, params.background_bottom.unwrap_or(params.background)])
    }

    /// That of a row: between top and bottom encoded colours, which are about even to the eye, change evenly.
    fn of_row(&self, row: usize, rows: usize) -> [f32; 4] {
        let Self([top, bottom]) = self;
        if top == bottom {
            return top.map(|c| c as f32);
        }
        let share = (row as f64 + 0.5) / rows as f64;
        let mixed = |a: f64, b: f64| a + share * (b - a);
        std::array::from_fn(|c| match c {
            3 => mixed(top[3], bottom[3]) as f32,
            _ => srgb::linear(mixed(srgb::encoded(top[c]), srgb::encoded(bottom[c]))) as f32,
        })
    }
}

/// The picture of a radiance over a background.
pub(crate) fn compose(radiance: &Radiance, background: &Background) -> Image {
    let encoder = &*ENCODER;
    let encoded = |&[r, g, b, a]: &[f32; 4], background: [f32; 4]| {
        let behind = (1.0 - a).max(0.0) * background[3];
        let alpha = (a + behind).min(1.0);
        let straight = if alpha > 0.0 { 1.0 / alpha } else { 0.0 };
        let over = |c: f32, back: f32| encoder.byte((c + behind * back) * straight);
        let byte = (alpha * 255.0 + 0.5) as u8;
        [over(r, background[0]), over(g, background[1]), over(b, background[2]), byte]
    };
    let mut bytes = vec![0; 4 * radiance.rgba.len()];
    let pixels =
        bytes.par_chunks_mut(4 * ROWS * radiance.width).zip(radiance.rgba.par_chunks(ROWS * radiance.width));
    pixels.enumerate().for_each(|(i, (bytes, rgba))| {
        let rows = bytes.chunks_exact_mut(4 * radiance.width).zip(rgba.chunks_exact(radiance.width));
        for (y, (bytes, rgba)) in rows.enumerate() {
            let background = background.of_row(ROWS * i + y, radiance.height);
            for (bytes, rgba) in bytes.chunks_exact_mut(4).zip(rgba) {
                bytes.copy_from_slice(&encoded(rgba, background));
            }
        }
    });
    Image::new(radiance.width, radiance.height, bytes).expect("four bytes a pixel, sides checked")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_table_encodes_as_the_formula_does() {
        let encoder = Encoder::new();
        for i in 0..100_000 {
            let l = i as f32 / 99_999.0;
            assert!(
                encoder.byte(l).abs_diff(srgb::byte(l))
                    <= u8::from(encoder.begins.iter().any(|b| (b - l).abs() < 1e-6))
            );
        }
    }

    #[test]
    fn a_half_covered_pixel_mixes_with_the_background_in_linear_light() {
        let radiance = Radiance {
            width: 2,
            height: 1,
            rgba: vec![[0.5, 0.0, 0.0, 0.5], [0.0; 4]],
            samples: 0,
            skipped: 0,
        };
        let image = compose(&radiance, &Background([[0.0, 1.0, 0.0, 1.0]; 2]));
        assert_eq!(image.rgba(), [srgb::byte(0.5), srgb::byte(0.5), 0, 255, 0, 255, 0, 255]);
        let clear = compose(&radiance, &Background([[0.0; 4]; 2]));
        assert_eq!(clear.rgba(), [255, 0, 0, 128, 0, 0, 0, 0]);
    }

    #[test]
    fn a_background_changes_evenly_from_top_to_bottom() {
        let rows = 2 * ROWS + 1;
        let radiance =
            Radiance { width: 3, height: rows, rgba: vec![[0.0; 4]; 3 * rows], samples: 0, skipped: 0 };
        let image = compose(&radiance, &Background([[1.0, 1.0, 0.2, 1.0], [0.0, 1.0, 0.2, 0.0]]));
        for (row, pixels) in image.rgba().chunks_exact(12).enumerate() {
            let share = (row as f64 + 0.5) / rows as f64;
            let level = |at: usize| f64::from(pixels[at]);
            assert!((level(0) - 255.0 * (1.0 - share)).abs() <= 0.51, "{row}");
            assert!((level(3) - 255.0 * (1.0 - share)).abs() <= 0.51, "{row}");
            assert_eq!((pixels[1], pixels[2]), (255, srgb::byte(0.2)));
            assert!(pixels.chunks_exact(4).all(|pixel| *pixel == pixels[..4]));
        }
    }
}
