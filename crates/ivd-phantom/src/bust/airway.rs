//! The airway: the nose's two passages, throat and wind pipe. All lengths in mm on an adult.

use super::field::{Ellipsoid, Point, join, soft_abs, tube};

/// From the nostril to the passage of its side, and from the passages down.
const NOSTRIL: [[f64; 4]; 4] =
    [[6.4, 101.0, -44.0, 3.6], [6.4, 94.0, -36.0, 3.6], [6.0, 84.0, -32.0, 3.4], [6.0, 70.0, -34.0, 3.4]];
const PASSAGES: [Ellipsoid; 2] = [
    Ellipsoid::new([6.2, 58.0, -28.0], [3.8, 32.0, 15.0]),
    Ellipsoid::new([6.6, 54.0, -37.0], [4.6, 30.0, 6.0]),
];
const THROAT: [[f64; 4]; 7] = [
    [7.0, 36.0, -34.0, 5.5],
    [0.0, 22.0, -37.0, 8.0],
    [0.0, 13.0, -58.0, 7.5],
    [0.0, 14.0, -92.0, 7.5],
    [0.0, 14.0, -126.0, 6.5],
    [0.0, 8.0, -150.0, 8.0],
    [0.0, -8.0, -215.0, 8.5],
];

/// Signed distance from all of it; the mouth is shut.
pub(super) fn passages(p: Point) -> f64 {
    let q = [soft_abs(p[0], 0.8), p[1], p[2]];
    if p[1] > 30.0 || p[2] > -50.0 {
        let nose = join(PASSAGES[0].distance(q), PASSAGES[1].distance(q), 2.0);
        join(join(nose, tube(&NOSTRIL, q), 3.0), tube(&THROAT, q), 4.0)
    } else {
        tube(&THROAT, q)
    }
}
