use crate::Error;

/// A picture: straight sRGB with alpha, 8 bit a channel, rows from the top.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Image {
    width: usize,
    height: usize,
    rgba: Vec<u8>,
}

impl Image {
    /// A picture from its pixels, shape `[height, width, 4]`.
    ///
    /// # Errors
    /// [`Error::Inconsistent`] where the length isn't `4 * width * height` or a side is 0.
    pub fn new(width: usize, height: usize, rgba: Vec<u8>) -> Result<Self, Error> {
        if width == 0
            || height == 0
            || width.checked_mul(height).and_then(|n| n.checked_mul(4)) != Some(rgba.len())
        {
            return Err(Error::Inconsistent {
                what: "image",
                problem: format!("{} bytes for {width} x {height} pixels", rgba.len()),
            });
        }
        Ok(Self { width, height, rgba })
    }

    /// Pixels a row.
    pub fn width(&self) -> usize {
        self.width
    }

    /// Rows.
    pub fn height(&self) -> usize {
        self.height
    }

    /// Pixels, shape `[height, width, 4]`.
    pub fn rgba(&self) -> &[u8] {
        &self.rgba
    }
}
