//! How what is done fades out with distance.

/// `1 − 3t² + 2t³`, 1 below 0 and 0 from 1 on: falls from 1 to 0 with no slope at either end; steepest −3/2 half way.
#[inline]
pub fn smooth_fall(t: f64) -> f64 {
    let t = t.clamp(0.0, 1.0);
    1.0 - t * t * (3.0 - 2.0 * t)
}

/// How much of its work something does at a distance from the middle of a ball: all of it within `core · radius`, none from `radius` on.
pub fn within_ball(distance: f64, radius: f64, core: f64) -> f64 {
    let whole = core * radius;
    if distance >= radius { 0.0 } else { smooth_fall((distance - whole) / (radius - whole)) }
}
