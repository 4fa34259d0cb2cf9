use ivd_core::Image;

use crate::{Error, pair};

/// Where two pictures differ.
#[derive(Debug, Clone, PartialEq)]
pub struct Difference {
    /// The greatest difference of a colour channel at each pixel, eight times amplified, from black over red and yellow to white.
    pub image: Image,
    /// Greatest difference of a channel (levels of 255).
    pub max: u8,
    /// Mean over the pixels of their greatest channel's difference (levels of 255).
    pub mean: f64,
    /// Share of pixels that differ at all.
    pub changed: f64,
}

/// How much the heat map amplifies: a difference of 32 levels is white.
const AMPLIFY: u16 = 8;

/// Compares two pictures of one size, frame by frame where they have several.
///
/// # Errors
/// [`Error::SizeMismatch`] where the sizes differ, [`Error::FramesMismatch`] where the numbers of frames do.
pub fn difference(a: &Image, b: &Image) -> Result<Difference, Error> {
    pair::check(a, b)?;
    let greatest: Vec<u8> = a
        .rgba()
        .chunks_exact(4)
        .zip(b.rgba().chunks_exact(4))
        .map(|(p, q)| p.iter().zip(q).map(|(x, y)| x.abs_diff(*y)).max().unwrap_or(0))
        .collect();
    let count = greatest.len() as f64;
    let sum: u64 = greatest.iter().map(|&d| u64::from(d)).sum();
    let heat = greatest.iter().flat_map(|&d| heat(d)).collect();
    let image = Image::of_frames([a.width(), a.height()], a.frames(), heat)?;
    Ok(Difference {
        image,
        max: greatest.iter().copied().max().unwrap_or(0),
        mean: sum as f64 / count,
        changed: greatest.iter().filter(|&&d| d > 0).count() as f64 / count,
    })
}

/// Colour of a difference: red rises over the first third of the amplified scale, then green, then blue.
fn heat(difference: u8) -> [u8; 4] {
    let level = (u16::from(difference) * AMPLIFY).min(255) * 3;
    let part = |from: u16| level.saturating_sub(from).min(255) as u8;
    [part(0), part(255), part(510), 255]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn one_changed_pixel_is_found_and_amplified() {
        let a = Image::new(2, 2, vec![100; 16]).unwrap();
        let mut bytes = vec![100; 16];
        bytes[5] = 110;
        let b = Image::new(2, 2, bytes).unwrap();
        let d = difference(&a, &b).unwrap();
        assert_eq!((d.max, d.mean, d.changed), (10, 2.5, 0.25));
        assert_eq!(d.image.rgba()[..4], [0, 0, 0, 255]);
        assert_eq!(d.image.rgba()[4..8], [240, 0, 0, 255]);
        assert!(difference(&a, &Image::new(1, 4, vec![0; 16]).unwrap()).is_err());
        assert_eq!(difference(&a, &a).unwrap().max, 0);
    }
}
