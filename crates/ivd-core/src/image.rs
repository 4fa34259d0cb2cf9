use crate::Error;

/// A picture: straight sRGB with alpha, 8 bit a channel, rows from the top; or several of one size, as frames that are shown one after the other.
#[derive(Debug, Clone, PartialEq)]
pub struct Image {
    width: usize,
    height: usize,
    frames: usize,
    rgba: Vec<u8>,
    light: Vec<f32>,
}

impl Image {
    /// A picture from its pixels, shape `[height, width, 4]`.
    ///
    /// # Errors
    /// [`Error::Inconsistent`] where the length isn't `4 * width * height` or a side is 0.
    pub fn new(width: usize, height: usize, rgba: Vec<u8>) -> Result<Self, Error> {
        Self::of_frames([width, height], 1, rgba)
    }

    /// Pictures of one size (width and height) from their pixels, shape `[frames, height, width, 4]`.
    ///
    /// # Errors
    /// [`Error::Inconsistent`] where the length isn't that, or there is no pixel.
    pub fn of_frames([width, height]: [usize; 2], frames: usize, rgba: Vec<u8>) -> Result<Self, Error> {
        let sides = [width, height, frames, 4];
        let length = sides.iter().try_fold(1_usize, |product, side| product.checked_mul(*side));
        if length != Some(rgba.len()) || rgba.is_empty() {
            return Err(Error::Inconsistent {
                what: "image",
                problem: format!("{} bytes for {frames} of {width} x {height} pixels", rgba.len()),
            });
        }
        Ok(Self { width, height, frames, rgba, light: Vec::new() })
    }

    /// Keeps beside the pictures the light that they were made of: premultiplied linear RGB with opacity, shape as that of the pixels.
    ///
    /// # Errors
    /// [`Error::Inconsistent`] where it isn't as long as the pixels.
    pub fn with_light(self, light: Vec<f32>) -> Result<Self, Error> {
        if light.len() != self.rgba.len() {
            return Err(Error::Inconsistent {
                what: "image",
                problem: format!("{} numbers of light for {} bytes", light.len(), self.rgba.len()),
            });
        }
        Ok(Self { light, ..self })
    }

    /// Pixels a row.
    pub fn width(&self) -> usize {
        self.width
    }

    /// Rows.
    pub fn height(&self) -> usize {
        self.height
    }

    /// Pictures.
    pub fn frames(&self) -> usize {
        self.frames
    }

    /// Pixels of all frames, shape `[frames, height, width, 4]`.
    pub fn rgba(&self) -> &[u8] {
        &self.rgba
    }

    /// The same, without a copy; what was kept beside them is left.
    pub fn into_rgba(self) -> Vec<u8> {
        self.rgba
    }

    /// The light that the pictures were made of, where it was kept: premultiplied linear RGB with opacity, without what stands behind or was drawn over it, shape
    /// `[frames, height, width, 4]`.
    pub fn light(&self) -> Option<&[f32]> {
        (!self.light.is_empty()).then_some(&*self.light)
    }

    /// One of its frames, counted from 0, as a picture of its own; `None` beyond the last.
    pub fn frame(&self, frame: usize) -> Option<Self> {
        let length = 4 * self.width * self.height;
        let part = frame.checked_mul(length)?..frame.checked_add(1)?.checked_mul(length)?;
        let rgba = self.rgba.get(part.clone())?.to_vec();
        let light = self.light.get(part).unwrap_or_default().to_vec();
        Some(Self { frames: 1, rgba, light, ..*self })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn frames_are_cut_out_with_their_light() {
        let image = Image::of_frames([1, 2], 3, (0..24).collect()).unwrap();
        assert_eq!(image.frame(1).unwrap().rgba(), [8, 9, 10, 11, 12, 13, 14, 15]);
        assert!(image.frame(3).is_none() && image.frame(1).unwrap().light().is_none());
        let lit = image.with_light((0..24_u8).map(f32::from).collect()).unwrap();
        assert_eq!(lit.frame(2).unwrap().light().unwrap()[0], 16.0);
        assert!(lit.with_light(vec![0.0]).is_err());
    }

    #[test]
    fn what_does_not_fit_is_refused() {
        assert!(Image::new(0, 0, Vec::new()).is_err());
        assert!(Image::of_frames([1, 1], 0, Vec::new()).is_err());
        assert!(Image::of_frames([1, 1], 2, vec![0; 4]).is_err());
        assert!(Image::of_frames([usize::MAX, 2], 2, vec![0; 4]).is_err());
    }
}
