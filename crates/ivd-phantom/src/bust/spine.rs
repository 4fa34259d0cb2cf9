//! The cervical spine, its discs and its canal. All lengths in mm on an adult.

use super::field::{Block, Cone, Ellipsoid, Point, hill, join, meet, smooth_step, soft_abs};

/// Middle of the highest body (the second vertebra), from one body to the next, how many.
const FIRST: f64 = -66.0;
const PITCH: f64 = 17.5;
const BODIES: f64 = 8.0;
/// Half the height of a body; half-axes of bodies and discs across the column.
const HALF_HEIGHT: f64 = 6.2;
const BODY: [f64; 2] = [12.5, 9.5];
const DISC: [f64; 2] = [11.5, 8.5];
/// The canal's middle behind that of the bodies, its radius, and that of the ring of bone around it.
const CANAL_BEHIND: f64 = 18.5;
pub(super) const CANAL: f64 = 8.5;
const ARCH: f64 = 13.0;
/// In a vertebra's frame, whose origin is in the canal: the process that points backwards, one to each side, the joints to its neighbours.
const PROCESS: Cone = Cone::new([0.0, -ARCH, 0.0], 4.0, [0.0, -ARCH - 16.0, -7.0], 3.6);
const WING: Cone = Cone::new([9.0, CANAL_BEHIND - 4.0, 0.0], 4.2, [22.0, CANAL_BEHIND - 8.0, -2.0], 3.4);
const JOINTS: Block = Block::new([13.0, 4.0, 0.0], [5.0, 5.0, 7.0], 3.0);
/// The second vertebra's tooth, which stands in the ring of the first; from the middle of the column.
const TOOTH: Cone = Cone::new([0.0, 0.0, FIRST], 6.0, [0.0, 1.0, FIRST + 15.0], 4.5);
/// The first vertebra is a ring without a body.
const ATLAS: f64 = -56.0;

/// Place of the bodies' middles along y at a height.
fn column(z: f64) -> f64 {
    let bow = 6.0 * hill(((z + 115.0) / 70.0).powi(2));
    -14.0 - 20.0 * smooth_step(-100.0, -230.0, z) + bow
}

/// Place of the canal's middle along y at a height.
pub(super) fn canal(z: f64) -> f64 {
    column(z) - CANAL_BEHIND
}

/// Height over the nearest body's middle.
fn height(z: f64) -> f64 {
    z - FIRST + ((FIRST - z) / PITCH).round().clamp(0.0, BODIES - 1.0) * PITCH
}

/// An upright cylinder of half-axes across z, `half` high, its edges a little round.
fn drum(q: [f64; 2], axes: [f64; 2], height: f64, half: f64) -> f64 {
    let side = Ellipsoid::new([0.0; 3], [axes[0], axes[1], f64::INFINITY]).distance([q[0], q[1], 0.0]);
    meet(side, height.abs() - half, 3.0)
}

pub(super) fn bone(p: Point) -> f64 {
    let x = soft_abs(p[0], 1.0);
    let y = p[1] - column(p[2]);
    let h = height(p[2]);
    let body = drum([x, y], BODY, h, HALF_HEIGHT);
    let tooth = TOOTH.distance([x, y, p[2]]);
    let q = [x, y + CANAL_BEHIND, h];
    let wall = (q[0].hypot(q[1]) - f64::midpoint(ARCH, CANAL)).abs() - (ARCH - CANAL) / 2.0;
    let ring = meet(wall, h.abs() - 5.0, 2.0);
    // What points down from the vertebra above may be nearer than what is this one's.
    let above = if FIRST - p[2] > PITCH / 2.0 { arms([q[0], q[1], h - PITCH]) } else { f64::INFINITY };
    let joints = JOINTS.distance(q);
    let mut d = join(body, ring, 3.0);
    d = join(d, arms(q).min(above), 3.0);
    d = join(d, joints, 3.0);
    d = join(d, tooth, 3.0);
    join(d, atlas([x, y, p[2] - ATLAS]), 1.0)
}

fn arms(q: Point) -> f64 {
    join(PROCESS.distance(q), WING.distance(q), 1.0)
}

/// The ring of the first vertebra.
fn atlas(q: Point) -> f64 {
    let flat = q[0].hypot((q[1] + 12.0) * 0.86);
    let ring = (flat - 17.0).hypot(q[2] * 0.8) - 4.6;
    let mass = Ellipsoid::new([17.0, -6.0, 0.0], [8.0, 9.0, 6.0]).distance(q);
    join(ring, mass, 3.0)
}

pub(super) fn disc(p: Point) -> f64 {
    let y = p[1] - column(p[2]);
    let low = FIRST - (BODIES - 1.0) * PITCH - HALF_HEIGHT;
    let middle = f64::midpoint(FIRST, low);
    drum([p[0], y], DISC, p[2] - middle, (FIRST - low) / 2.0)
}

/// The canal of the spinal cord.
pub(super) fn canal_room(p: Point) -> f64 {
    (p[0].hypot(p[1] - canal(p[2])) - CANAL).max(p[2] + 46.0)
}
