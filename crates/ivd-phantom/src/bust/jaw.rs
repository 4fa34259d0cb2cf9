//! The lower jaw and the teeth of both jaws. All lengths in mm on an adult.

use super::field::{Block, Cone, Ellipsoid, Point, cut, join, meet, soft_abs, tube};

/// The body of the jaw: its lower edge and the bone under the teeth, from chin to angle.
const LOWER_EDGE: [[f64; 4]; 4] =
    [[0.0, 82.0, -102.0, 7.5], [17.0, 76.0, -101.0, 7.0], [36.0, 42.0, -90.0, 6.5], [41.0, 14.0, -80.0, 6.0]];
const TOOTH_EDGE: [[f64; 4]; 4] =
    [[0.0, 81.0, -84.0, 6.0], [16.0, 74.0, -84.0, 6.0], [28.0, 48.0, -82.0, 6.5], [38.0, 22.0, -76.0, 5.0]];
const CHIN: Ellipsoid = Ellipsoid::new([0.0, 86.0, -101.0], [12.0, 7.0, 8.0]);
/// The ramus: from the angle up to the joint behind and to the muscle's hook in front.
const RAMUS: Block = Block::new([43.5, 17.0, -60.0], [4.0, 14.0, 22.0], 3.5);
const JOINT: Cone = Cone::new([44.0, 10.0, -56.0], 5.0, [47.0, 3.0, -34.0], 5.5);
const HOOK: Cone = Cone::new([44.0, 26.0, -54.0], 5.0, [46.0, 30.0, -28.0], 3.0);
/// Bone ends so far under the skin.
const COVER: f64 = 5.5;

pub(super) fn bone(p: Point, skin: f64) -> f64 {
    let q = [soft_abs(p[0], 2.0), p[1], p[2]];
    let mut d = join(tube(&LOWER_EDGE, q), tube(&TOOTH_EDGE, q), 13.0);
    d = join(d, CHIN.distance(q), 5.0);
    d = join(d, RAMUS.distance(q), 7.0);
    d = join(d, join(JOINT.distance(q), HOOK.distance(q), 3.0), 5.0);
    meet(d, skin + COVER, 2.0)
}

/// The room that the jaw leaves to the skull: nothing grows together.
pub(super) fn clear_of(d: f64, jaw: f64) -> f64 {
    const GAP: f64 = 3.0;
    cut(d, jaw - GAP, 1.0)
}

/// The teeth of both jaws, in two rows along half ellipses; those of one side, which the other mirrors.
#[derive(Debug, Clone)]
pub(super) struct Teeth {
    crowns: Vec<Tooth>,
}

#[derive(Debug, Clone, Copy)]
struct Tooth {
    centre: Point,
    /// Direction along the row in the plane x, y.
    along: [f64; 2],
    block: Block,
}

/// Half widths along the row and half thicknesses across it: two incisors, a canine, two premolars, two molars.
const WIDTHS: [f64; 7] = [4.1, 3.3, 3.8, 3.4, 3.4, 5.0, 4.8];
const THICKNESSES: [f64; 7] = [2.8, 2.8, 3.4, 4.0, 4.2, 5.0, 5.0];
/// Narrower by this below; room between neighbours.
const LOWER_WIDTHS: f64 = 0.92;
const SPACE: f64 = 0.7;
/// Half-axes of the arcs, their middle along y, height of the middle of the teeth, half of their height (crown and root).
const ARCS: [([f64; 2], f64, f64, f64); 2] =
    [([27.5, 42.0], 45.0, -57.5, 9.5), ([25.5, 40.0], 43.0, -77.5, 9.0)];
/// A box around all teeth.
const ROW: Block = Block::new([0.0, 62.0, -67.0], [37.0, 34.0, 23.0], 0.0);

impl Teeth {
    pub(super) fn new() -> Self {
        let mut crowns = Vec::new();
        for (row, (axes, y, z, half)) in ARCS.into_iter().enumerate() {
            let shrink = if row == 0 { 1.0 } else { LOWER_WIDTHS };
            let mut angle = 0.0;
            for (width, thickness) in WIDTHS.into_iter().zip(THICKNESSES) {
                let width = width * shrink;
                // Half a tooth forwards on the arc, the tooth, and half of it again.
                let speed = |t: f64| (axes[0] * t.cos()).hypot(axes[1] * t.sin());
                angle += (width + SPACE / 2.0) / speed(angle + 0.03);
                let tangent = [axes[0] * angle.cos(), -axes[1] * angle.sin()];
                let length = tangent[0].hypot(tangent[1]);
                crowns.push(Tooth {
                    centre: [axes[0] * angle.sin(), y + axes[1] * angle.cos(), z],
                    along: tangent.map(|v| v / length),
                    block: Block::new([0.0; 3], [width, thickness, half], 2.4),
                });
                angle += (width + SPACE / 2.0) / speed(angle);
            }
        }
        Self { crowns }
    }

    pub(super) fn distance(&self, p: Point) -> f64 {
        let far = ROW.distance(p);
        if far > 4.0 {
            return far;
        }
        let q = [p[0].abs(), p[1], p[2]];
        self.crowns.iter().map(|t| t.distance(q)).fold(f64::INFINITY, f64::min)
    }
}

impl Tooth {
    fn distance(&self, q: Point) -> f64 {
        let [x, y] = [q[0] - self.centre[0], q[1] - self.centre[1]];
        let along = x * self.along[0] + y * self.along[1];
        let across = y * self.along[0] - x * self.along[1];
        self.block.distance([along, across, q[2] - self.centre[2]])
    }
}
