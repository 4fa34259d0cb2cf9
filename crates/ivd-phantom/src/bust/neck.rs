//! Neck and shoulders: their outer shape. mm on an adult.

use super::field::{Bump, Cone, Ellipsoid, Point, Ridge, join, soft_abs};

const NECK: Cone = Cone::new([0.0, -12.0, -60.0], 43.0, [0.0, -27.0, -190.0], 48.0);
const NAPE: Cone = Cone::new([0.0, -38.0, -50.0], 24.0, [0.0, -37.0, -110.0], 23.0);
const THROAT: Cone = Cone::new([0.0, 12.0, -108.0], 22.0, [0.0, -2.0, -190.0], 24.0);
const UNDER_JAW: Ellipsoid = Ellipsoid::new([0.0, 34.0, -92.0], [38.0, 42.0, 20.0]);
const TRAPEZIUS: Cone = Cone::new([14.0, -44.0, -104.0], 20.0, [116.0, -40.0, -222.0], 38.0);
const SHOULDER: Cone = Cone::new([0.0, -38.0, -238.0], 62.0, [112.0, -36.0, -232.0], 42.0);
const CHEST: Ellipsoid = Ellipsoid::new([0.0, -16.0, -250.0], [118.0, 66.0, 66.0]);
/// From behind the ear to the notch over the breast bone.
const STERNOMASTOID: Cone = Cone::new([43.0, -18.0, -46.0], 9.0, [12.0, 18.0, -186.0], 9.0);
const COLLAR_BONE: Ridge =
    Ridge::new(&[[16.0, 30.0, -188.0], [60.0, 24.0, -184.0], [110.0, -6.0, -184.0]], 14.0, 4.0);
const NOTCH: Bump = Bump::new([0.0, 32.0, -184.0], [22.0, 30.0, 22.0], -4.0);
const ADAMS_APPLE: Bump = Bump::new([0.0, 36.0, -138.0], [20.0, 30.0, 26.0], 3.0);

pub(super) fn surface(p: Point) -> f64 {
    let q = [soft_abs(p[0], 3.0), p[1], p[2]];
    let broad = [soft_abs(p[0], 14.0), p[1], p[2]];
    let mut d = join(NECK.distance(p), THROAT.distance(p), 22.0);
    d = join(d, NAPE.distance(p), 20.0);
    d = join(d, UNDER_JAW.distance(p), 22.0);
    d = join(d, STERNOMASTOID.distance(q), 13.0);
    d = join(d, TRAPEZIUS.distance(broad), 26.0);
    if p[2] < -100.0 {
        d = join(d, join(SHOULDER.distance(q), CHEST.distance(p), 30.0), 34.0);
        d -= COLLAR_BONE.lift(q) + NOTCH.lift(p) + ADAMS_APPLE.lift(p);
    }
    d
}
