//! Colours that tell numbers, and where their scales end.

/// In, or less; not at all; out, or more: ends and middle of RdBu (Brewer).
pub const BLUE_TO_RED: [[u8; 3]; 5] =
    [[33, 102, 172], [146, 197, 222], [247, 247, 247], [244, 165, 130], [178, 24, 43]];

/// The colour at a share, 0…1, of a scale with evenly spaced stops; beyond its ends that of the end.
pub fn colour_at(stops: &[[u8; 3]; 5], share: f64) -> [u8; 3] {
    let at = share.clamp(0.0, 1.0) * (stops.len() - 1) as f64;
    let first = (at.floor() as usize).min(stops.len() - 2);
    mixed(stops[first], stops[first + 1], at - first as f64)
}

/// A colour with so much, 0…1, of another in it.
pub fn mixed(one: [u8; 3], other: [u8; 3], share: f64) -> [u8; 3] {
    [0, 1, 2].map(|c| (f64::from(one[c]) * (1.0 - share) + f64::from(other[c]) * share).round() as u8)
}

/// The least of 1, 2, 5 · 10ⁿ that is no less.
pub fn rounded_up(least: f64) -> f64 {
    let power = 10.0_f64.powf(least.log10().floor());
    let found = [1.0, 2.0, 5.0].map(|digit| digit * power).into_iter().find(|n| *n >= least);
    found.unwrap_or(10.0 * power)
}
