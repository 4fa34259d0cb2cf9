use ivd_core::Image;

/// A picture and what it cost.
#[derive(Debug, Clone, PartialEq)]
pub struct Rendered {
    /// The picture.
    pub image: Image,
    /// Pictures made: 1, or those of a turntable.
    pub frames: u32,
    /// Samples taken.
    pub samples: u64,
    /// Samples taken for each pixel of the picture, on average.
    pub samples_per_pixel: f64,
    /// Share of the samples on the rays' way that were passed over because their brick is empty; what lies behind the end of a ray counts
    /// in neither.
    pub skipped_fraction: f64,
}
