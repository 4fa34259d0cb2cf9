//! A solid with creases, flat and curved faces and three handles, whose distance is a formula: a tilted plate with bores.

use ivd_core::Volume;
use nalgebra::{Rotation3, Vector3};

use crate::experiment::Problem;
use crate::inputs::{grid, sampled};

/// Half the plate's edges (mm).
const HALF: [f64; 3] = [46.0, 34.0, 15.0];
/// Bores along its shortest edge: the axis' place in the plate, and the radius (mm).
const BORES: [[f64; 3]; 3] = [[-24.0, 8.0, 14.0], [14.0, -10.0, 9.0], [26.0, 16.0, 5.0]];
/// Turns about x, y and z (radians), so that no face lies along the grid.
const TILT: [f64; 3] = [0.35, 0.5, 0.25];

/// What the plate is, in words.
pub(crate) const WORDS: &str = "a tilted plate of 92 × 68 × 30 mm with three bores";

/// The signed distance (mm) from the plate's surface, positive inside, on `n` voxels along each edge of the cube.
pub(crate) fn volume(n: usize) -> Result<Volume, Problem> {
    let tilt = tilt();
    sampled(&grid(n)?, |p| {
        let own = tilt.inverse() * p;
        let distance = (own - nearest_on(own)).norm();
        if is_inside(own) { distance } else { -distance }
    })
}

/// The point of the plate's surface that is nearest to a place (mm).
pub(crate) fn nearest(place: Vector3<f64>) -> Vector3<f64> {
    let tilt = tilt();
    tilt * nearest_on(tilt.inverse() * place)
}

/// Turn and height of a camera that looks through the bores, from a little aside (degrees).
pub(crate) fn view() -> [f64; 2] {
    let axis = tilt() * Vector3::new(0.35, 0.3, 1.0).normalize();
    [(-axis.x).atan2(axis.y).to_degrees(), axis.z.asin().to_degrees()]
}

fn tilt() -> Rotation3<f64> {
    let [x, y, z] = TILT;
    Rotation3::from_euler_angles(x, y, z)
}

fn is_inside(own: Vector3<f64>) -> bool {
    (0..3).all(|a| own[a].abs() < HALF[a])
        && BORES.iter().all(|[x, y, radius]| (own.x - x).hypot(own.y - y) > *radius)
}

/// The same in the plate's own axes: the nearest of six faces, two of which have holes, and of three walls. No bore
/// touches another or a side.
fn nearest_on(own: Vector3<f64>) -> Vector3<f64> {
    let clamped = Vector3::from_fn(|a, _| own[a].clamp(-HALF[a], HALF[a]));
    let faces = (0..3).flat_map(|axis| [-1.0, 1.0].map(|side| (axis, side))).map(|(axis, side)| {
        let mut on = clamped;
        on[axis] = side * HALF[axis];
        let hole = BORES.iter().find(|[x, y, radius]| (on.x - x).hypot(on.y - y) < *radius);
        match hole {
            Some(bore) if axis == 2 => on_wall(on, *bore),
            _ => on,
        }
    });
    let walls = BORES.iter().map(|bore| on_wall(clamped_along(own), *bore));
    let off = |p: &Vector3<f64>| (p - own).norm_squared();
    faces.chain(walls).min_by(|a, b| off(a).total_cmp(&off(b))).expect("a plate has faces")
}

fn clamped_along(own: Vector3<f64>) -> Vector3<f64> {
    Vector3::new(own.x, own.y, own.z.clamp(-HALF[2], HALF[2]))
}

/// A place moved straight away from a bore's axis, or towards it, onto the wall.
fn on_wall(place: Vector3<f64>, [x, y, radius]: [f64; 3]) -> Vector3<f64> {
    let (dx, dy) = (place.x - x, place.y - y);
    let length = dx.hypot(dy);
    let [ux, uy] = if length > 0.0 { [dx / length, dy / length] } else { [1.0, 0.0] };
    Vector3::new(x + radius * ux, y + radius * uy, place.z)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Points all over the surface, by the faces' and walls' own coordinates.
    fn surface() -> Vec<Vector3<f64>> {
        let steps = |half: f64| (0..=60).map(move |i| half * (f64::from(i) / 30.0 - 1.0));
        let mut points = Vec::new();
        for axis in 0..3 {
            let [b, c] = [(axis + 1) % 3, (axis + 2) % 3];
            for side in [-1.0, 1.0] {
                for (u, v) in steps(HALF[b]).flat_map(|u| steps(HALF[c]).map(move |v| (u, v))) {
                    let mut p = Vector3::zeros();
                    (p[axis], p[b], p[c]) = (side * HALF[axis], u, v);
                    let bored = BORES.iter().any(|[x, y, r]| (p.x - x).hypot(p.y - y) < *r);
                    if axis != 2 || !bored {
                        points.push(p);
                    }
                }
            }
        }
        for [x, y, radius] in BORES {
            for (turn, z) in (0..180).flat_map(|t| steps(HALF[2]).map(move |z| (f64::from(t) * 2.0, z))) {
                let (sin, cos) = turn.to_radians().sin_cos();
                points.push(Vector3::new(x + radius * cos, y + radius * sin, z));
            }
        }
        points
    }

    #[test]
    fn no_point_of_the_surface_is_nearer_and_the_nearest_is_on_it() {
        let surface = surface();
        for i in 0..400_u32 {
            let at = |step: u32, most: f64| (f64::from(i * step % 401) / 200.0 - 1.0) * 1.3 * most;
            let place = Vector3::new(at(7, HALF[0]), at(31, HALF[1]), at(113, HALF[2]));
            let found = nearest_on(place);
            let least = surface.iter().map(|p| (p - place).norm()).fold(f64::INFINITY, f64::min);
            let distance = (found - place).norm();
            // The points lie 1.6 mm apart at most.
            assert!(distance <= least + 1e-9 && distance >= least - 1.2, "{place}: {distance}, {least}");
            assert!(
                (nearest_on(found) - found).norm() < 1e-9,
                "{place}: the nearest point is on the surface"
            );
        }
    }
}
