//! Which vertex a place on a surface means: one of the sheet that it lies on, and not one of the sheet behind that, which may be nearer where walls are thin
//! and triangles large.

use ivd_core::Lattice;
use ivd_core::geometry::closest_on_triangle;
use ivd_motion::handles::{Anchor, Pick, find_picks};
use nalgebra::Vector3;
use rayon::prelude::*;

/// The vertex that a place (mm, RAS) means; none where the nearest is too far to be picked.
///
/// - `eye`: the way to who sees it, where only sheets are meant that face them: what lies behind the skin may be nearer to a place that is seen through it.
pub(super) fn pick(lattice: &Lattice, place: [f64; 3], eye: Option<Vector3<f64>>) -> Option<Pick> {
    nearest_and_meant(lattice, place, eye).map(|[_, meant]| meant)
}

/// The place to anchor what was put at a place (mm, RAS) at: that place where its nearest vertex belongs to its sheet, else the sheet's vertex that is nearest.
pub(super) fn anchor(lattice: &Lattice, place: [f64; 3], eye: Option<Vector3<f64>>) -> Anchor {
    match nearest_and_meant(lattice, place, eye) {
        Some([nearest, meant]) if nearest.vertex != meant.vertex => Anchor::NearestTo(meant.at),
        _ => Anchor::NearestTo(place),
    }
}

/// What of a handle's radius the surface's direction there is a mean over.
const OUT: f64 = 0.5;

/// Out of the surface about a vertex, over a radius (mm); none where it has no side.
#[derive(Debug, Clone, Copy)]
struct Side {
    of: (usize, f64),
    out: Option<[f64; 3]>,
}

/// Directions out of the surface at rest about handles: they stay while vertices and radii do.
#[derive(Debug, Default)]
pub(super) struct Sides {
    /// The level that they are of.
    level: u8,
    known: Vec<Side>,
}

impl Sides {
    /// Finds those of vertices with their handles' radii that aren't known, and forgets others.
    pub(super) fn keep(&mut self, lattice: &Lattice, level: u8, handles: impl Iterator<Item = (usize, f64)>) {
        let before = std::mem::take(&mut self.known);
        let before = if level == self.level { before } else { Vec::new() };
        let mut at = Vec::new();
        let of = |of: (usize, f64)| {
            before.iter().find(|known| known.of == of).copied().unwrap_or_else(|| {
                if at.is_empty() {
                    at = lattice.local_positions();
                }
                Side { of, out: outwards(lattice, &at, of.0, OUT * of.1).map(Into::into) }
            })
        };
        (self.level, self.known) = (level, handles.map(of).collect());
    }

    /// Out of the surface about a vertex.
    pub(super) fn out(&self, vertex: usize, radius: f64) -> Option<[f64; 3]> {
        self.known.iter().find(|known| known.of == (vertex, radius))?.out
    }
}

/// The direction out of the surface at rest about a vertex: a mean over the triangles within a radius (mm) that face as those at the vertex do; `None` where
/// it has no side.
fn outwards(lattice: &Lattice, at: &[Vector3<f64>], vertex: usize, radius: f64) -> Option<Vector3<f64>> {
    let facing = |triangle: &[u32; 3]| facing(triangle.map(|v| at[v as usize]));
    let triangles = lattice.triangles();
    let own: Vector3<f64> =
        triangles.iter().filter(|triangle| triangle.contains(&(vertex as u32))).map(facing).sum();
    let is_near =
        |triangle: &&[u32; 3]| triangle.iter().all(|v| (at[*v as usize] - at[vertex]).norm() <= radius);
    let near = triangles.iter().filter(is_near).map(facing).filter(|facing| facing.dot(&own) > 0.0);
    (own + near.sum::<Vector3<f64>>()).try_normalize(0.0)
}

/// Square to a triangle, out of the body, twice its area long.
fn facing([a, b, c]: [Vector3<f64>; 3]) -> Vector3<f64> {
    (b - a).cross(&(c - a))
}

fn nearest_and_meant(lattice: &Lattice, place: [f64; 3], eye: Option<Vector3<f64>>) -> Option<[Pick; 2]> {
    let nearest = *find_picks(lattice, "handle", [&Anchor::NearestTo(place)]).ok()?.first()?;
    let of_sheet = vertex_of_sheet(lattice, place, eye).or_else(|| vertex_of_sheet(lattice, place, None));
    let vertex = of_sheet.unwrap_or(nearest.vertex);
    Some([nearest, Pick { vertex, at: lattice.world(vertex).0.into(), ..nearest }])
}

/// The vertex nearest to a place (mm, RAS) among the corners of the nearest triangle (that faces an eye) and of those round it that face as that does.
fn vertex_of_sheet(lattice: &Lattice, place: [f64; 3], eye: Option<Vector3<f64>>) -> Option<usize> {
    let at = lattice.local_positions();
    let place = Vector3::from(place) - Vector3::from(lattice.grid().origin());
    let triangles = lattice.triangles();
    let corners = |t: usize| triangles[t].map(|v| at[v as usize]);
    let away = |t: usize| {
        let corners = corners(t);
        let weights = closest_on_triangle(&corners, place);
        let closest: Vector3<f64> = corners.iter().zip(weights).map(|(corner, weight)| corner * weight).sum();
        (closest - place).norm_squared()
    };
    let nearer = |a: (f64, usize), b: (f64, usize)| if b < a { b } else { a };
    let facing = |t: usize| facing(corners(t));
    let is_seen = |t: &usize| eye.is_none_or(|eye| facing(*t).dot(&eye) > 0.0);
    let all = (0..triangles.len()).into_par_iter().with_min_len(1024).filter(is_seen);
    let (_, nearest) = all.map(|t| (away(t), t)).reduce_with(nearer)?;
    let normal = facing(nearest);
    let is_beside = |t: &usize| triangles[*t].iter().any(|v| triangles[nearest].contains(v));
    let is_of_sheet = |t: &usize| is_beside(t) && (*t == nearest || facing(*t).dot(&normal) > 0.0);
    let away = |v: u32| ((at[v as usize] - place).norm_squared(), v as usize);
    let closest = |t: usize| {
        let [a, b, c] = triangles[t].map(away);
        nearer(nearer(a, b), c)
    };
    let beside = (0..triangles.len()).into_par_iter().with_min_len(1024).filter(is_of_sheet);
    beside.map(closest).reduce_with(nearer).map(|(_, vertex)| vertex)
}

#[cfg(test)]
mod tests {
    use ivd_core::{Exec, Grid, Volume, Voxels};
    use ivd_lattice::extract::{ExtractParams, Iso, extract};
    use ivd_lattice::refine::{RefineParams, Target, collapse};

    use super::*;

    const MIDDLE: f64 = 19.5;
    const OUTER: f64 = 16.0;
    const INNER: f64 = 13.0;

    fn from_middle(place: [f64; 3]) -> f64 {
        (Vector3::from(place) - Vector3::repeat(MIDDLE)).norm()
    }

    #[test]
    fn a_place_on_a_thin_wall_means_a_vertex_of_its_own_side() {
        let grid = Grid::with_spacing([40; 3], [1.0; 3]).unwrap();
        let value = |i: usize| {
            let radius = from_middle(grid.index(i).0.map(|c| c as f64));
            (128.0 + 40.0 * (OUTER - radius).min(radius - INNER)).clamp(0.0, 255.0) as u8
        };
        let voxels: Vec<u8> = (0..grid.len()).map(value).collect();
        let volume = Volume::new(grid, Voxels::from(voxels)).unwrap();
        let exec = Exec::default();
        let finest =
            extract(&volume, None, &ExtractParams { iso: Iso::Value(128.0) }, &exec).unwrap().lattice;
        let params = RefineParams { target: Target::Level(3).into(), ..RefineParams::default() };
        let lattice = collapse(&finest, &params, &exec).unwrap().lattice;
        let vertex = |anchor: &Anchor| find_picks(&lattice, "handle", [anchor]).unwrap()[0];
        let (mut wrong, mut far) = (0, 0.0_f64);
        for n in 0..500 {
            // Spread evenly over a sphere by the golden angle.
            let z = 1.0 - (2.0 * f64::from(n) + 1.0) / 500.0;
            let turn = 2.399_963_229_728_653 * f64::from(n);
            let across = (1.0 - z * z).sqrt();
            let direction = [across * turn.cos(), across * turn.sin(), z];
            for radius in [OUTER, INNER] {
                let place = direction.map(|c| MIDDLE + radius * c);
                let is_outer = |at: [f64; 3]| from_middle(at) > f64::midpoint(OUTER, INNER);
                wrong += usize::from(is_outer(vertex(&Anchor::NearestTo(place)).at) != is_outer(place));
                let meant = vertex(&anchor(&lattice, place, None));
                assert_eq!(is_outer(meant.at), is_outer(place), "{place:?} means {:?}", meant.at);
                far = far.max((Vector3::from(meant.at) - Vector3::from(place)).norm());
                // From outside it is the outer side that is seen, also where the place lies within the wall or behind it.
                let seen = vertex(&anchor(&lattice, place, Some(direction.into())));
                assert!(is_outer(seen.at), "{place:?} means {:?}", seen.at);
            }
        }
        assert!(
            wrong > 10,
            "the nearest vertex is of the other side {wrong} times: too few to tell the two apart"
        );
        assert!(far < 8.0, "{far} mm");
    }
}
