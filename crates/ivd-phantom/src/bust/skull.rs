//! The skull and the hollow that the brain lies in. All lengths in mm on an adult.

use super::face::{self, EYE};
use super::field::{Cone, Ellipsoid, Point, cut, from, join, meet, norm, soft_abs, tube};

/// From the scalp to the hollow: skin, fat, bone.
const SCALP_TO_HOLLOW: f64 = 12.2;
/// Thickness of the vault; the base is thicker where the face hangs from it.
const VAULT: f64 = 6.5;
/// The bone ends at least so far under the skin.
const COVER: f64 = 5.0;

/// The hollow's floor falls in three steps: over the eyes, then, behind a wall, for the temporal lobes, then for the cerebellum.
const FLOOR: f64 = 17.0;
const WALL: f64 = 44.0;
const LOW_FLOOR: f64 = -24.0;
/// Bone between the temporal lobes.
const SPHENOID: Ellipsoid = Ellipsoid::new([0.0, 32.0, -20.0], [22.0, 33.0, 23.0]);
const HIND_FOSSA: Ellipsoid = Ellipsoid::new([0.0, -32.0, -12.0], [49.0, 40.0, 35.0]);

const MAXILLA: Ellipsoid = Ellipsoid::new([0.0, 54.0, -36.0], [31.0, 33.0, 29.0]);
const ALVEOLAR: Cone = Cone::new([0.0, 66.0, -52.0], 21.0, [18.0, 48.0, -52.0], 12.0);
const PALATE: Ellipsoid = Ellipsoid::new([0.0, 50.0, -66.0], [19.0, 32.0, 17.0]);
const CHEEK_BONE: Ellipsoid = Ellipsoid::new([46.0, 58.0, -21.0], [10.0, 13.0, 11.0]);
const CHEEK_ROOT: Cone = Cone::new([19.0, 76.0, -27.0], 7.0, [42.0, 62.0, -24.0], 9.0);
const ARCH: [[f64; 4]; 3] = [[50.0, 52.0, -18.0, 5.5], [59.0, 28.0, -16.0, 4.0], [59.0, -2.0, -17.0, 4.5]];
const BROW: [[f64; 4]; 3] = [[6.0, 83.0, 18.0, 6.5], [28.0, 80.0, 21.0, 6.5], [41.0, 60.0, 14.0, 5.5]];
const OUTER_RIM: Cone = Cone::new([41.0, 60.0, 12.0], 5.0, [43.5, 60.0, -14.0], 6.0);
/// Between the orbits, and the wall beside each.
const ETHMOID: Ellipsoid = Ellipsoid::new([0.0, 60.0, -2.0], [12.0, 26.0, 18.0]);
const SIDE_WALL: Ellipsoid = Ellipsoid::new([35.0, 46.0, -2.0], [9.0, 20.0, 18.0]);
const NASAL: Cone = Cone::new([0.0, 83.0, 12.0], 6.5, [0.0, 91.5, -12.0], 5.0);
const NASAL_SIDE: Cone = Cone::new([7.0, 81.0, 8.0], 6.0, [16.0, 77.0, -28.0], 8.0);
const MASTOID: Ellipsoid = Ellipsoid::new([48.0, -17.0, -36.0], [9.0, 11.0, 16.0]);
const BASE: Ellipsoid = Ellipsoid::new([0.0, 2.0, -22.0], [46.0, 30.0, 16.0]);
const CONDYLE: Ellipsoid = Ellipsoid::new([15.0, -16.0, -48.0], [8.0, 10.0, 9.0]);

const EYE_RADIUS: f64 = 12.0;
const LENS: Ellipsoid = Ellipsoid::new([EYE[0], EYE[1] + 7.5, EYE[2]], [4.8, 2.6, 4.8]);
/// An orbit narrows to its back.
const ORBIT: Cone = Cone::new([31.0, 84.0, -2.0], 17.5, [16.0, 47.0, 2.0], 5.5);
const NOSE_OPENING: [Ellipsoid; 2] = [
    Ellipsoid::new([6.0, 88.0, -32.0], [7.0, 26.0, 11.0]),
    Ellipsoid::new([2.0, 90.0, -22.0], [6.5, 22.0, 15.0]),
];
/// Where the spinal cord leaves.
const FORAMEN: Cone = Cone::new([0.0, -20.0, -34.0], 13.0, [0.0, -31.0, -72.0], 11.0);

/// The vault's inner surface, also where it has no floor.
pub(super) fn lid(p: Point) -> f64 {
    face::cranium(p) + SCALP_TO_HOLLOW
}

/// The hollow of the skull: brain and fluid.
pub(super) fn hollow(p: Point) -> f64 {
    let floor = join(FLOOR - p[2], meet(p[1] - WALL, LOW_FLOOR - p[2], 16.0), 12.0);
    let d = meet(lid(p), cut(floor, SPHENOID.distance(p), 6.0), 16.0);
    join(d, HIND_FOSSA.distance(p), 10.0)
}

/// The fatty room of the eye.
pub(super) fn orbit(p: Point) -> f64 {
    ORBIT.distance([p[0].abs(), p[1], p[2]])
}

/// The skull as a solid, the hollow of the brain filled; `skin` is the distance from the outer surface, `hollow` that from the hollow.
pub(super) fn bone(p: Point, skin: f64, hollow: f64) -> f64 {
    let mut d = hollow - VAULT;
    if p[2] < 48.0 {
        let q = [soft_abs(p[0], 1.5), p[1], p[2]];
        d = join(d, base(q), 8.0);
        if p[1] > -14.0 {
            d = join(d, face_bones(q), 12.0);
            d = cut(d, orbit(q), 3.0);
            let opening = join(NOSE_OPENING[0].distance(q), NOSE_OPENING[1].distance(q), 4.0);
            d = cut(d, opening, 2.0);
            d = cut(d, PALATE.distance(q), 4.0);
        }
        d = cut(d, FORAMEN.distance(p), 3.0);
    }
    meet(d, skin + COVER, 2.0)
}

fn base(q: Point) -> f64 {
    join(join(MASTOID.distance(q), CONDYLE.distance(q), 2.0), BASE.distance(q), 6.0)
}

fn face_bones(q: Point) -> f64 {
    let mut d = join(MAXILLA.distance(q), ALVEOLAR.distance(q), 8.0);
    d = join(d, join(CHEEK_BONE.distance(q), CHEEK_ROOT.distance(q), 8.0), 6.0);
    d = join(d, ETHMOID.distance(q).min(SIDE_WALL.distance(q)), 6.0);
    d = join(d, tube(&ARCH, q), 8.0);
    d = join(d, tube(&BROW, q), 8.0);
    d = join(d, OUTER_RIM.distance(q), 8.0);
    join(d, join(NASAL.distance(q), NASAL_SIDE.distance(q), 5.0), 5.0)
}

/// An eyeball and its lens.
pub(super) fn eye(p: Point) -> f64 {
    norm(from([p[0].abs(), p[1], p[2]], EYE)) - EYE_RADIUS
}

pub(super) fn lens(p: Point) -> f64 {
    LENS.distance([p[0].abs(), p[1], p[2]])
}
