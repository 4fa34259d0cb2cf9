//! Ears: an oval plate that stands off the head, with helix, antihelix, concha, tragus and lobe. mm on an adult.

use super::field::{Cone, Ellipsoid, Point, cut, dot, from, join, meet, norm};

/// Middle of the right ear, and its axes: to its front, to its top, outwards.
const PLACE: Point = [70.0, -10.0, -11.0];
const FRONT: Point = [-0.423, 0.886, 0.188];
const TOP: Point = [0.081, -0.170, 0.982];
const OUT: Point = [0.902, 0.431, 0.0];

/// How far an ear reaches from its middle.
const REACH: f64 = 42.0;

const PLATE: Ellipsoid = Ellipsoid::new([0.0, 3.0, -1.0], [16.5, 28.0, 3.4]);
const ROOT: Ellipsoid = Ellipsoid::new([8.0, 0.0, -7.0], [9.0, 22.0, 9.0]);
const LOBE: Ellipsoid = Ellipsoid::new([5.0, -25.0, -0.5], [8.0, 9.0, 4.0]);
const CONCHA: Ellipsoid = Ellipsoid::new([4.5, -5.0, 3.0], [8.5, 12.0, 6.0]);
const SCAPHA: f64 = 1.8;
const TRAGUS: Ellipsoid = Ellipsoid::new([14.0, -5.0, 1.0], [4.0, 6.0, 4.5]);
const ANTITRAGUS: Ellipsoid = Ellipsoid::new([2.0, -17.5, 2.0], [4.5, 3.4, 3.4]);
const CRUS: Cone = Cone::new([15.0, 8.0, 1.0], 2.8, [4.0, -1.0, -0.5], 2.0);

/// Rings: middle and half-axes in the ear's plane, height over it, radius.
const HELIX: [f64; 6] = [0.0, 5.0, 16.0, 25.5, 2.2, 3.3];
const ANTIHELIX: [f64; 6] = [4.5, -3.0, 12.0, 16.0, 1.6, 2.9];

pub(super) fn surface(q: Point) -> f64 {
    let q = from(q, PLACE);
    let far = norm(q);
    if far > REACH + 12.0 {
        return far - REACH;
    }
    let e = [dot(q, FRONT), dot(q, TOP), dot(q, OUT)];
    let mut d = join(PLATE.distance(e), ROOT.distance(e), 8.0);
    d = join(d, LOBE.distance(e), 6.0);
    d = cut(d, ring(&[0.0, 4.0, 12.5, 20.5, 3.4, SCAPHA], e).max(e[0] - 6.0), 3.0);
    // The helix runs over the top and down the back; at the front it turns in above the canal.
    let helix = meet(ring(&HELIX, e), 0.7 * (e[0] - 12.0) - 0.7 * (e[1] - 6.0), 4.0);
    d = join(d, helix, 3.0);
    d = join(d, meet(ring(&ANTIHELIX, e), e[0] - 4.0, 4.0), 3.0);
    d = cut(d, CONCHA.distance(e), 3.0);
    d = join(d, CRUS.distance(e), 2.5);
    d = join(d, TRAGUS.distance(e), 3.0);
    join(d, ANTITRAGUS.distance(e), 3.0)
}

/// First-order distance from a tube along an ellipse in the ear's plane.
fn ring(&[u, v, a, b, height, radius]: &[f64; 6], e: Point) -> f64 {
    let away = Ellipsoid::new([u, v, 0.0], [a, b, f64::INFINITY]).distance([e[0], e[1], 0.0]);
    away.hypot(e[2] - height) - radius
}
