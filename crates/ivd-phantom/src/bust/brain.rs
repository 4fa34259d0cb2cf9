//! The brain: a folded cortex over white matter, ventricles, cerebellum and brain stem. All lengths in mm on an adult.

use super::field::{Cone, Ellipsoid, Point, cut, join, meet, norm, tube};
use super::{skull, spine};

/// Fluid between the skull's hollow and the crowns of the folds.
const FLUID: f64 = 1.6;
/// Thickness of the cortex.
const CORTEX: f64 = 2.9;

/// Folds follow rays from the brain's middle through an ellipsoid, so that sulci stand on the surface.
const MIDDLE: Point = [0.0, 2.0, 22.0];
const ELLIPSOID: [f64; 3] = [64.0, 84.0, 66.0];
/// Lengths of the two waves of the folds, and the height of the lesser one (share of the greater).
const WAVE: f64 = 27.0;
const SMALL_WAVE: f64 = 14.9;
const SMALL_SHARE: f64 = 0.33;
/// Least slope (a wave's height over its length) by which height over zero is divided to have a distance.
const FLATTEST: f64 = 3.6;
/// How far waves are bent.
const BEND: f64 = 9.0;
/// How far sulci go in from the vault, and half the width of one.
const SULCUS_DEPTH: f64 = 15.0;
const SULCUS: f64 = 0.5;

/// Half the width of the fissure between the hemispheres, which ends on the bridge between them.
const FISSURE: f64 = 0.6;
const BRIDGE: Ellipsoid = Ellipsoid::new([0.0, -2.0, 16.0], [40.0, 40.0, 24.0]);
/// The fissure over the temporal lobe: a sheet from its front lower edge, rising to the back.
const SYLVIAN: [Point; 2] = [[0.0, 34.0, -4.0], [0.0, -30.0, 22.0]];
const SYLVIAN_DEPTH: f64 = 32.0;

const CEREBELLUM: [Ellipsoid; 2] = [
    Ellipsoid::new([22.5, -44.0, -20.0], [28.5, 28.0, 23.0]),
    Ellipsoid::new([0.0, -42.0, -21.0], [12.0, 23.0, 18.0]),
];
/// Folia: blades around an axis across the cerebellum (its place along y and z), so many in half a turn; thickness of their grey, half that of
/// their white.
const FOLIA_AXIS: [f64; 2] = [-28.0, -22.0];
const FOLIA: f64 = 15.0;
const FOLIUM_CORTEX: f64 = 2.6;
const BLADE: f64 = 0.8;
/// The tent over the cerebellum: height at the back, slope towards the front, fall to the sides (1/mm).
const TENT: [f64; 3] = [-15.0, 0.27, 0.006];

/// The brain stem from the midbrain down, its pons, and the arms to the cerebellum.
const PONS: Ellipsoid = Ellipsoid::new([0.0, -7.0, -20.0], [16.0, 12.5, 14.0]);
const STEM: [[f64; 4]; 4] =
    [[0.0, -10.0, 4.0, 9.5], [0.0, -12.0, -20.0, 10.5], [0.0, -20.0, -42.0, 7.6], [0.0, -31.0, -64.0, 5.4]];
/// Room around the stem, also before the pons; no cerebrum lies there.
const CISTERN: Ellipsoid = Ellipsoid::new([0.0, -4.0, -25.0], [20.0, 17.0, 21.0]);
/// Radius of the spinal cord, and where it begins.
const CORD: f64 = 5.2;
const CORD_TOP: f64 = -58.0;
const PEDUNCLE: Cone = Cone::new([10.0, -14.0, -22.0], 7.0, [20.0, -36.0, -24.0], 6.0);

/// A lateral ventricle: front horn, body, where the horns meet, lower horn.
const VENTRICLE: [[f64; 4]; 6] = [
    [6.5, 33.0, 16.0, 2.6],
    [8.0, 24.0, 20.0, 4.6],
    [9.0, -4.0, 27.0, 4.4],
    [19.0, -32.0, 20.0, 6.4],
    [30.0, -26.0, -2.0, 4.0],
    [33.0, 0.0, -12.0, 2.6],
];
const BACK_HORN: Cone = Cone::new([20.0, -34.0, 16.0], 5.0, [20.0, -54.0, 12.0], 2.4);
const THIRD: Ellipsoid = Ellipsoid::new([0.0, 2.0, 6.0], [2.4, 15.0, 9.0]);
const FOURTH: Ellipsoid = Ellipsoid::new([0.0, -26.0, -24.0], [6.0, 5.0, 11.0]);

/// Thalamus, putamen, caudate nucleus.
const DEEP_GREY: [Ellipsoid; 3] = [
    Ellipsoid::new([10.0, -6.0, 10.0], [8.0, 14.0, 9.0]),
    Ellipsoid::new([25.0, 10.0, 8.0], [6.0, 18.0, 12.0]),
    Ellipsoid::new([14.0, 20.0, 18.0], [5.0, 12.0, 7.0]),
];

/// Distance from the hull of the cerebrum: its crowns, without sulci.
pub(super) fn hull(p: Point, hollow: f64, cerebellum: f64) -> f64 {
    let shell = hollow + FLUID;
    let tent = (TENT[0] + TENT[1] * (p[1] + 85.0) - TENT[2] * p[0] * p[0] - p[2]) * 0.9;
    let free = cut(meet(shell, tent.min(-10.0 - p[1]), 6.0), CISTERN.distance(p), 3.0);
    cut(free, cerebellum - FLUID, 2.0)
}

/// Room of fluid: the skull's hollow, the canal of the cord, and what is around the stem between them.
pub(super) fn fluid(p: Point, hollow: f64) -> f64 {
    if p[2] > -28.0 { hollow } else { hollow.min(spine::canal_room(p)).min(tube(&STEM, p) - 2.6) }
}

/// Distance from the pial surface, with sulci and fissures.
pub(super) fn pia(p: Point, hull: f64) -> f64 {
    let inside = -(skull::lid(p) + FLUID);
    let sulcus = sulcus(p).hypot((inside - SULCUS_DEPTH).max(0.0)) - SULCUS;
    let mut d = cut(hull, sulcus, 4.6);
    let bridge = (-BRIDGE.distance(p)).max(0.0);
    d = cut(d, p[0].hypot(bridge) - FISSURE, 3.5);
    cut(d, sylvian(p, inside), 4.0)
}

/// Bounds of the pial distance from the hull and the place of the fissure: (least, greatest).
pub(super) fn pia_bounds(p: Point, hull: f64) -> (f64, f64) {
    (hull, (hull + SYLVIAN_DEPTH + 8.0).max(FISSURE + 2.0 - p[0].abs()))
}

/// Distance from the middle sheet of the nearest sulcus (first order): where two waves that are as branched as a gyroid cancel each other.
fn sulcus(p: Point) -> f64 {
    let q = [p[0], p[1] - MIDDLE[1], p[2] - MIDDLE[2]];
    let r = norm([q[0] / ELLIPSOID[0], q[1] / ELLIPSOID[1], q[2] / ELLIPSOID[2]]).max(0.2);
    // The sides differ a little.
    let side = 2.5 * (q[0] / 12.0).tanh();
    let u = bend([q[0].abs() / r, q[1] / r + side, q[2] / r - side], BEND, 1.0 / 30.0);
    let (mut f, mut gradient) = (0.0, [0.0; 3]);
    for (wave, weight, turn) in [(WAVE, 1.0, 0.0), (SMALL_WAVE, SMALL_SHARE, 1.7)] {
        let k = std::f64::consts::TAU / wave;
        let (s, c) = (u.map(|v| (v * k + turn).sin()), u.map(|v| (v * k + turn).cos()));
        f += weight * (s[0] * c[1] + s[1] * c[2] + s[2] * c[0]);
        gradient[0] += weight * k * (c[0] * c[1] - s[2] * s[0]);
        gradient[1] += weight * k * (c[1] * c[2] - s[0] * s[1]);
        gradient[2] += weight * k * (c[2] * c[0] - s[1] * s[2]);
    }
    f.abs() / norm(gradient).max(FLATTEST / WAVE) * r.min(1.0)
}

fn bend(u: Point, by: f64, rate: f64) -> Point {
    let wave = |a: f64, b: f64| by * ((a * rate).sin() + (b * rate * 1.37 + 1.0).cos()) * 0.5;
    [u[0] + wave(u[1], u[2]), u[1] + wave(u[2], u[0] + 5.0), u[2] + wave(u[0] + 9.0, u[1])]
}

/// Distance from the fissure over the temporal lobe, which opens outwards.
fn sylvian(p: Point, inside: f64) -> f64 {
    let way = [SYLVIAN[1][1] - SYLVIAN[0][1], SYLVIAN[1][2] - SYLVIAN[0][2]];
    let length = way[0].hypot(way[1]);
    let q = [p[1] - SYLVIAN[0][1], p[2] - SYLVIAN[0][2]];
    let t = (q[0] * way[0] + q[1] * way[1]) / length;
    let off = (q[1] * way[0] - q[0] * way[1]) / length;
    let past = (t - length).max(-t).max(0.0);
    let medial = (26.0 - p[0].abs()).max(0.0);
    norm([off, past, medial.max(inside - SYLVIAN_DEPTH).max(0.0)]) - 1.6
}

/// Distance of the white matter from its surface: under the cortex, without what is grey within.
pub(super) fn white(p: Point, pia: f64) -> f64 {
    let q = [p[0].abs(), p[1], p[2]];
    let grey = DEEP_GREY.iter().map(|e| e.distance(q)).fold(f64::INFINITY, f64::min);
    cut(pia + CORTEX, grey, 1.0)
}

pub(super) fn ventricles(p: Point) -> f64 {
    let q = [p[0].abs(), p[1], p[2]];
    let lateral = join(tube(&VENTRICLE, q), BACK_HORN.distance(q), 3.0);
    let way = Cone::new([0.0, 12.0, 12.0], 1.8, [7.0, 16.0, 20.0], 1.8).distance(q);
    join(lateral, join(THIRD.distance(p), way, 2.0), 2.0)
}

pub(super) fn fourth_ventricle(p: Point) -> f64 {
    FOURTH.distance(p)
}

/// Distance from the cerebellum's hull.
pub(super) fn cerebellum_hull(p: Point, hollow: f64) -> f64 {
    let q = [p[0].abs(), p[1], p[2]];
    meet(join(CEREBELLUM[0].distance(q), CEREBELLUM[1].distance(p), 5.0), hollow + FLUID, 3.0)
}

/// Angle around the folia's axis, a half turn a folium, and distance from the axis.
fn folia(p: Point) -> (f64, f64) {
    let [y, z] = [p[1] - FOLIA_AXIS[0], p[2] - FOLIA_AXIS[1]];
    let bow = 0.1 * (p[0] / 26.0).powi(2).min(3.0) + 0.06 * (p[0].abs() / 7.0).sin();
    (FOLIA * (z.atan2(-y) + bow), y.hypot(z).max(4.0))
}

/// Distance from the folded surface of the cerebellum.
pub(super) fn cerebellum(p: Point, hull: f64) -> f64 {
    let (phase, reach) = folia(p);
    let main = (phase.sin().abs() / FOLIA) * reach;
    let fine = ((2.0 * phase + 0.7).sin().abs() / (2.0 * FOLIA)) * reach;
    let deep = main.hypot((-hull - 6.0).max(0.0)) - 0.4;
    let shallow = fine.hypot((-hull - 2.2).max(0.0)) - 0.25;
    cut(cut(hull, deep, 1.0), shallow, 1.0)
}

/// Distance of the cerebellum's white matter: a core, and a blade in every folium.
pub(super) fn cerebellar_white(p: Point, hull: f64) -> f64 {
    let (phase, reach) = folia(p);
    let blade = (phase.cos().abs() / FOLIA) * reach - BLADE;
    join(hull + 10.0, blade.max(hull + FOLIUM_CORTEX), 2.0)
}

pub(super) fn stem(p: Point) -> f64 {
    let q = [p[0].abs(), p[1], p[2]];
    let mut d = join(tube(&STEM, p), PONS.distance(p), 5.0);
    d = join(d, PEDUNCLE.distance(q), 4.0);
    if p[2] < CORD_TOP + 20.0 {
        let cord = p[0].hypot(p[1] - spine::canal(p[2])) - CORD;
        d = join(d, cord.max(p[2] - CORD_TOP), 3.0);
    }
    d
}
