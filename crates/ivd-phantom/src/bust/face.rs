//! The skin's surface: the outer shape of head, face and neck. All lengths in mm on an adult.

use super::ears;
use super::field::{Bump, Cone, Ellipsoid, Point, Ridge, cut, hill, join, soft_abs, tube};
use super::neck;

/// The cranium is two eggs: the hind one broad, the front one narrow.
const CRANIUM_BACK: Ellipsoid = Ellipsoid::new([0.0, -21.0, 31.0], [75.0, 74.0, 83.5]);
const CRANIUM_FRONT: Ellipsoid = Ellipsoid::new([0.0, 29.0, 35.0], [61.0, 65.0, 72.0]);
/// Under the back of the cranium, over the cerebellum.
const OCCIPUT: Ellipsoid = Ellipsoid::new([0.0, -32.0, -12.0], [60.0, 51.0, 46.0]);
const CRANIUM_BLEND: f64 = 26.0;

/// What hangs from the cranium: the middle of the face, cheek bones, jaw, chin, the muzzle around the mouth.
const MIDFACE: Ellipsoid = Ellipsoid::new([0.0, 34.0, -37.0], [55.0, 58.0, 63.0]);
const CHEEK_BONE: Ellipsoid = Ellipsoid::new([43.0, 54.0, -23.0], [18.0, 25.0, 18.0]);
const ARCH: Cone = Cone::new([47.0, 46.0, -22.0], 15.0, [57.0, 2.0, -22.0], 10.0);
const JAW_ANGLE: Cone = Cone::new([45.0, 14.0, -34.0], 14.0, [38.5, 14.0, -76.0], 12.0);
const JAW_LINE: Cone = Cone::new([38.5, 14.0, -76.0], 12.0, [8.0, 77.0, -99.0], 13.0);
const CHIN: Ellipsoid = Ellipsoid::new([0.0, 78.0, -99.0], [20.0, 18.0, 15.0]);
const MUZZLE: Ellipsoid = Ellipsoid::new([0.0, 68.0, -66.0], [34.0, 29.5, 28.0]);

/// Nose.
const BRIDGE: [[f64; 4]; 3] = [[0.0, 84.0, 17.0, 9.0], [0.0, 84.6, 5.0, 8.0], [0.0, 107.0, -34.0, 8.0]];
const TIP: Ellipsoid = Ellipsoid::new([0.0, 109.0, -37.0], [10.0, 10.5, 9.0]);
const WING: Ellipsoid = Ellipsoid::new([12.5, 99.0, -40.0], [6.8, 10.5, 7.8]);
const NOSE_SIDE: Cone = Cone::new([5.0, 86.0, 0.0], 8.0, [11.0, 92.0, -36.0], 10.0);
const COLUMELLA: Cone = Cone::new([0.0, 110.0, -42.0], 3.8, [0.0, 97.0, -44.5], 5.0);
const NOSTRIL: Cone = Cone::new([6.6, 104.5, -50.0], 4.2, [6.4, 98.0, -36.0], 4.0);

/// Closed lids over the eyeballs.
pub(super) const EYE: Point = [32.0, 77.0, -1.0];
const LID: Ellipsoid = Ellipsoid::new([32.0, 76.5, -1.0], [17.0, 15.0, 14.5]);

/// Lips, and the line between them.
const UPPER_LIP: Bow = Bow { half: 25.0, y: [98.0, -14.0], z: [-64.0, 9.0, -12.0], radius: [4.5, -3.6] };
const LOWER_LIP: Bow = Bow { half: 23.5, y: [96.4, -13.5], z: [-72.2, 4.8, 0.0], radius: [5.3, -4.4] };
const MOUTH: Bow = Bow { half: 24.5, y: [101.8, -14.0], z: [-68.4, 5.0, -3.6], radius: [1.1, -0.4] };

/// What is sculpted on the solids before nose, lids and lips join: mirrored left and right.
const BROAD: [Bump; 9] = [
    // Eye sockets, temples, the flesh of the cheek, the root of the nose.
    Bump::new([33.0, 92.0, -2.0], [24.0, 30.0, 19.0], -9.0),
    Bump::new([62.0, 58.0, 20.0], [24.0, 34.0, 30.0], -1.0),
    Bump::new([48.0, 52.0, -54.0], [26.0, 36.0, 26.0], 2.5),
    Bump::new([0.0, 98.0, 4.0], [22.0, 26.0, 18.0], -2.5),
    // Over the cheek bone's arch.
    Bump::new([54.0, 34.0, 4.0], [30.0, 42.0, 24.0], 2.5),
    // Brow ridge, its middle, forehead, apple of the cheek.
    Bump::new([28.0, 92.0, 20.0], [30.0, 26.0, 12.0], 3.5),
    Bump::new([0.0, 96.0, 24.0], [18.0, 20.0, 14.0], 0.5),
    Bump::new([24.0, 84.0, 58.0], [30.0, 30.0, 26.0], 1.5),
    Bump::new([36.0, 78.0, -32.0], [30.0, 34.0, 28.0], 2.5),
];

/// Behind this (along y) nothing is sculpted.
const FACE_FROM: f64 = -9.0;

const FINE: [Ridge; 8] = [
    // Brow hair.
    Ridge::new(&[[13.0, 97.0, 19.0], [26.0, 95.0, 22.0], [38.0, 90.0, 22.5], [50.0, 78.0, 15.5]], 5.5, 1.5),
    // The fold from the wing of the nose to the corner of the mouth.
    Ridge::new(&[[20.0, 94.0, -42.0], [28.0, 90.0, -54.0], [34.0, 82.0, -68.0]], 11.0, -1.3),
    // Philtrum and its columns.
    Ridge::new(&[[0.0, 101.0, -49.0], [0.0, 103.0, -60.0]], 4.5, -1.6),
    Ridge::new(&[[4.8, 101.0, -50.0], [5.6, 102.0, -60.0]], 3.4, 0.9),
    // The groove under the lower lip, the corner of the mouth.
    Ridge::new(&[[0.0, 97.0, -85.0], [9.0, 95.0, -84.5], [16.0, 91.0, -83.0]], 13.0, -1.7),
    Ridge::new(&[[27.0, 85.0, -66.0], [30.0, 82.0, -70.0]], 9.0, -0.5),
    // The crease of the upper lid, and the edge of the lower.
    Ridge::new(
        &[[19.0, 89.0, 4.0], [24.0, 91.0, 8.5], [32.0, 92.0, 10.5], [40.0, 88.0, 9.0], [47.0, 80.0, 4.0]],
        3.4,
        -1.1,
    ),
    Ridge::new(&[[20.0, 90.0, -13.0], [30.0, 90.0, -17.0], [42.0, 85.0, -15.0]], 6.0, -0.6),
];

/// The cranium alone: what skull and brain follow.
pub(super) fn cranium(p: Point) -> f64 {
    join(CRANIUM_BACK.distance(p), CRANIUM_FRONT.distance(p), CRANIUM_BLEND)
}

/// Signed distance from the outer surface of head, neck and shoulders.
pub(super) fn surface(p: Point) -> f64 {
    let head = if p[2] > -150.0 { head(p) } else { f64::INFINITY };
    let neck = neck::surface(p);
    if head.is_finite() { join(head, neck, 14.0) } else { neck }
}

fn head(p: Point) -> f64 {
    // A face is never quite even: nose and mouth lie a little to one side.
    let x = p[0] - 1.2 * hill(((p[2] + 45.0) / 70.0).powi(2)) * hill(((p[1] - 100.0) / 60.0).powi(2));
    let q = [soft_abs(x, 1.5), p[1], p[2]];
    let broad = [soft_abs(x, 8.0), p[1], p[2]];
    let mut d = join(cranium(p), MIDFACE.distance(p), 22.0);
    d = join(d, OCCIPUT.distance(p), 10.0);
    d = join(d, join(CHEEK_BONE.distance(q), ARCH.distance(q), 12.0), 24.0);
    d = join(d, join(JAW_ANGLE.distance(broad), JAW_LINE.distance(broad), 14.0), 26.0);
    d = join(d, CHIN.distance(p), 16.0);
    d = join(d, MUZZLE.distance(p), 14.0);
    if p[1] > FACE_FROM && d.abs() < 40.0 {
        d -= BROAD.iter().map(|b| b.lift(q)).sum::<f64>();
        d = features(d, q);
    }
    if q[0] > 45.0 { join(d, ears::surface(q), 3.5) } else { d }
}

fn features(mut d: f64, q: Point) -> f64 {
    d = lids(d, q);
    d = nose(d, q);
    d -= FINE.iter().map(|r| r.lift(q)).sum::<f64>();
    lips(d, q)
}

fn nose(d: f64, q: Point) -> f64 {
    let ridge = join(tube(&BRIDGE, q), TIP.distance(q), 8.0);
    let wings = join(WING.distance(q), COLUMELLA.distance(q), 3.0);
    let d = join(d, NOSE_SIDE.distance(q), 12.0);
    let d = join(join(d, ridge, 9.0), wings, 5.5);
    cut(d, NOSTRIL.distance(q), 2.5)
}

/// A smooth bulge, parted by the line where the lids meet.
fn lids(d: f64, q: Point) -> f64 {
    let d = join(d, LID.distance(q), 7.0);
    let out = q[0] - EYE[0];
    let across = hill((out / 17.0).powi(2));
    if across == 0.0 || q[1] < EYE[1] {
        return d;
    }
    let line = -7.5 + 0.022 * out * out;
    let groove = 2.1 * hill(((q[2] - line) / 2.6).powi(2));
    let edge = 1.0 * hill(((q[2] - line - 3.4) / 3.6).powi(2));
    d + across.sqrt() * (groove - edge)
}

fn lips(d: f64, q: Point) -> f64 {
    let d = join(d, UPPER_LIP.distance(q), 4.0);
    let d = join(d, LOWER_LIP.distance(q), 4.5);
    cut(d, MOUTH.distance(q), 2.5)
}

/// A rod that is bent around the middle plane: its place along y and z and its radius are polynomials of the squared share `t²` of the way
/// from the middle to an end, so that both sides meet without a crease.
struct Bow {
    half: f64,
    y: [f64; 2],
    z: [f64; 3],
    radius: [f64; 2],
}

impl Bow {
    fn distance(&self, q: Point) -> f64 {
        let t = (q[0].abs() / self.half).min(1.0);
        let s = t * t;
        let slope = [2.0 * t * self.y[1], 2.0 * t * (self.z[1] + 2.0 * s * self.z[2])].map(|v| v / self.half);
        let off = [q[1] - self.y[0] - s * self.y[1], q[2] - self.z[0] - s * (self.z[1] + s * self.z[2])];
        let away = off[0].hypot(off[1]) / (1.0 + slope[0] * slope[0] + slope[1] * slope[1]).sqrt();
        away.hypot((q[0].abs() - self.half).max(0.0)) - self.radius[0] - s * self.radius[1]
    }
}
