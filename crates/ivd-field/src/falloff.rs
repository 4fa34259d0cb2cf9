//! How what is done fades out with distance.

/// `1 − 3t² + 2t³`, 1 below 0 and 0 from 1 on: falls from 1 to 0 with no slope at either end; steepest −3/2 half way.
#[inline]
pub fn smooth_fall(t: f64) -> f64 {
    let t = t.clamp(0.0, 1.0);
    1.0 - t * t * (3.0 - 2.0 * t)
}
