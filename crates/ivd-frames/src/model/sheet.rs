//! Which vertex a place on a surface means: one of the sheet that it lies on, and not one of the sheet behind that, which may be nearer where walls are thin
//! and triangles large.

use std::collections::{BTreeMap, BTreeSet};

use ivd_core::Lattice;
use ivd_core::geometry::closest_on_triangle;
use ivd_motion::handles::{Anchor, Pick, find_picks};
use ivd_session::Id;
use nalgebra::Vector3;
use rayon::prelude::*;

/// The vertex that a place (mm, RAS) means; none where the nearest is too far to be picked.
///
/// - `seen`: where it is seen, sheets that face who sees it are meant: what lies behind the skin may be nearer to a place that is seen through it.
pub(super) fn pick(lattice: &Lattice, place: [f64; 3], seen: Option<Seen<'_>>) -> Option<Pick> {
    nearest_and_meant(lattice, place, seen).map(|[_, meant]| meant)
}

/// The place to anchor what was put at a place (mm, RAS) at: that place where its nearest vertex belongs to its sheet, else the sheet's vertex that is nearest;
/// and the vertex that is meant. None where the nearest is too far to be picked.
pub(super) fn anchor(lattice: &Lattice, place: [f64; 3], seen: Option<Seen<'_>>) -> Option<(Anchor, Pick)> {
    let [nearest, meant] = nearest_and_meant(lattice, place, seen)?;
    let at = if nearest.vertex == meant.vertex { place } else { meant.at };
    Some((Anchor::NearestTo(at), meant))
}

/// From where a surface is seen.
#[derive(Debug, Clone, Copy)]
pub(super) struct Seen<'a> {
    /// The way to the eye.
    pub(super) eye: Vector3<f64>,
    /// How far vertices have moved (mm), where they have: it is as it is now that the surface faces an eye.
    pub(super) moved: Option<&'a [[f64; 3]]>,
}

/// A sheet that faces the eye is meant unless it is farther than the nearest one by more than so many voxel diagonals: where that is cut away, what is seen
/// is another.
const BEHIND: f64 = 4.0;

/// What of a handle's radius the surface's direction there is a mean over.
const OUT: f64 = 0.5;

/// Of so many handles that are gone, but can be brought back, the direction at the lowest level stays known.
const MOST_GONE: usize = 1024;

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
    /// Of each handle, the one at the lowest level that was seen.
    lowest: BTreeMap<Id, (u8, Vector3<f64>)>,
}

impl Sides {
    /// Finds those of handles' vertices with their radii that aren't known, and forgets others.
    pub(super) fn keep(
        &mut self,
        lattice: &Lattice,
        level: u8,
        handles: impl Iterator<Item = (Id, usize, f64)>,
    ) {
        let handles: Vec<_> = handles.collect();
        self.forget_oldest(&handles.iter().map(|(id, ..)| *id).collect());
        let before = std::mem::take(&mut self.known);
        let before = if level == self.level { before } else { Vec::new() };
        let mut at = Vec::new();
        let mut of = |of: (usize, f64)| {
            before.iter().find(|known| known.of == of).copied().unwrap_or_else(|| {
                if at.is_empty() {
                    at = lattice.local_positions();
                }
                Side { of, out: outwards(lattice, &at, of.0, OUT * of.1).map(Into::into) }
            })
        };
        let all = handles.into_iter().map(|(_, vertex, radius)| of((vertex, radius)));
        (self.level, self.known) = (level, all.collect());
    }

    /// Of handles that are gone, those of the lowest numbers are the least likely to come back.
    fn forget_oldest(&mut self, present: &BTreeSet<Id>) {
        let gone: Vec<Id> = self.lowest.keys().filter(|id| !present.contains(id)).copied().collect();
        for id in &gone[..gone.len().saturating_sub(MOST_GONE)] {
            self.lowest.remove(id);
        }
    }

    /// Out of the surface about a handle's vertex; `None` where that has no side, or is of another one than at a lower level: at a coarse one the nearest
    /// vertex may be.
    pub(super) fn of(&mut self, handle: Id, vertex: usize, radius: f64) -> Option<[f64; 3]> {
        let out = self.out(vertex, radius)?;
        let now = (self.level, Vector3::from(out));
        let lowest = self.lowest.entry(handle).or_insert(now);
        if now.0 <= lowest.0 {
            *lowest = now;
        }
        (lowest.1.dot(&now.1) > 0.0).then_some(out)
    }

    /// Out of the surface about a vertex.
    fn out(&self, vertex: usize, radius: f64) -> Option<[f64; 3]> {
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

fn nearest_and_meant(lattice: &Lattice, place: [f64; 3], seen: Option<Seen<'_>>) -> Option<[Pick; 2]> {
    let nearest = *find_picks(lattice, "handle", [&Anchor::NearestTo(place)]).ok()?.first()?;
    let vertex = Sheets::new(lattice, place).vertex(seen).unwrap_or(nearest.vertex);
    Some([nearest, Pick { vertex, at: lattice.world(vertex).0.into(), ..nearest }])
}

/// The sheets of a surface about a place.
struct Sheets<'a> {
    triangles: &'a [[u32; 3]],
    /// Vertices and the place (mm), from the grid's origin.
    at: Vec<Vector3<f64>>,
    place: Vector3<f64>,
    diagonal: f64,
}

impl<'a> Sheets<'a> {
    fn new(lattice: &'a Lattice, place: [f64; 3]) -> Self {
        let grid = lattice.grid();
        let place = Vector3::from(place) - Vector3::from(grid.origin());
        let diagonal = grid.voxel_diagonal();
        Self { triangles: lattice.triangles(), at: lattice.local_positions(), place, diagonal }
    }

    fn corners(&self, triangle: usize) -> [Vector3<f64>; 3] {
        self.triangles[triangle].map(|v| self.at[v as usize])
    }

    /// Distance of a triangle (mm).
    fn away(&self, triangle: usize) -> f64 {
        let corners = self.corners(triangle);
        let weights = closest_on_triangle(&corners, self.place);
        let closest: Vector3<f64> = corners.iter().zip(weights).map(|(corner, weight)| corner * weight).sum();
        (closest - self.place).norm()
    }

    /// The nearest of some triangles, and its distance (mm).
    fn nearest(&self, of: impl Fn(&usize) -> bool + Sync + Send) -> Option<(f64, usize)> {
        let all = (0..self.triangles.len()).into_par_iter().with_min_len(1024).filter(of);
        all.map(|t| (self.away(t), t)).reduce_with(nearer)
    }

    /// The vertex nearest to the place among the corners of the nearest triangle, or of one that faces an eye, and of those round it that face as that does.
    fn vertex(&self, seen: Option<Seen<'_>>) -> Option<usize> {
        let any = self.nearest(|_| true)?;
        let faces = |Seen { eye, moved }: Seen<'_>, triangle: usize| {
            let now = |v: u32| {
                let v = v as usize;
                self.at[v] + moved.map_or_else(Vector3::zeros, |moved| Vector3::from(moved[v]))
            };
            facing(self.triangles[triangle].map(now)).dot(&eye) > 0.0
        };
        let facing_eye = seen.and_then(|seen| self.nearest(|t| faces(seen, *t)));
        let near_enough = |(away, _): &(f64, usize)| *away <= any.0 + BEHIND * self.diagonal;
        let (_, nearest) = facing_eye.filter(near_enough).unwrap_or(any);
        let normal = facing(self.corners(nearest));
        let is_beside = |t: &usize| self.triangles[*t].iter().any(|v| self.triangles[nearest].contains(v));
        let is_of_sheet =
            |t: &usize| is_beside(t) && (*t == nearest || facing(self.corners(*t)).dot(&normal) > 0.0);
        let away = |v: u32| ((self.at[v as usize] - self.place).norm_squared(), v as usize);
        let closest = |t: usize| {
            let [a, b, c] = self.triangles[t].map(away);
            nearer(nearer(a, b), c)
        };
        let beside = (0..self.triangles.len()).into_par_iter().with_min_len(1024).filter(is_of_sheet);
        beside.map(closest).reduce_with(nearer).map(|(_, vertex)| vertex)
    }
}

fn nearer(a: (f64, usize), b: (f64, usize)) -> (f64, usize) {
    if b < a { b } else { a }
}

#[cfg(test)]
mod tests {
    use ivd_core::{Exec, Grid, Volume, Voxels};
    use ivd_lattice::extract::{ExtractParams, Iso, extract};
    use ivd_lattice::refine::{RefineParams, Target, collapse};
    use nalgebra::Rotation3;

    use super::*;

    const MIDDLE: f64 = 19.5;
    const OUTER: f64 = 16.0;
    const INNER: f64 = 13.0;

    fn from_middle(place: [f64; 3]) -> f64 {
        (Vector3::from(place) - Vector3::repeat(MIDDLE)).norm()
    }

    #[test]
    fn where_the_side_that_is_seen_is_far_away_it_is_the_nearest_that_is_meant() {
        let grid = Grid::with_spacing([40; 3], [1.0; 3]).unwrap();
        let value = |i: usize| 128.0 + 40.0 * (OUTER - from_middle(grid.index(i).0.map(|c| c as f64)));
        let voxels: Vec<u8> = (0..grid.len()).map(|i| value(i).clamp(0.0, 255.0) as u8).collect();
        let volume = Volume::new(grid, Voxels::from(voxels)).unwrap();
        let exec = Exec::default();
        let lattice =
            extract(&volume, None, &ExtractParams { iso: Iso::Value(128.0) }, &exec).unwrap().lattice;
        // Behind a cut that takes the front away.
        let place = [MIDDLE + 3.0, MIDDLE + OUTER - 2.0, MIDDLE];
        let seen = Seen { eye: -Vector3::y(), moved: None };
        let meant = pick(&lattice, place, Some(seen)).unwrap();
        assert!(meant.at[1] > place[1] && meant.away() < 3.0, "{meant:?}");
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
        let turned = Rotation3::from_euler_angles(0.4, 2.0, -0.3);
        let middle = Vector3::repeat(MIDDLE);
        let moved: Vec<[f64; 3]> = lattice
            .local_positions()
            .iter()
            .map(|at| (turned * (at - middle) + middle - at).into())
            .collect();
        // A handle has no in and out where it takes a vertex of another side than at a lower level, which knows better.
        let [outer, inner] = [OUTER, INNER].map(|radius| {
            vertex(&anchor(&lattice, [MIDDLE, MIDDLE, MIDDLE + radius], None).unwrap().0).vertex
        });
        let mut sides = Sides::default();
        for (level, taken, is_known) in
            [(3, outer, true), (4, inner, false), (5, outer, true), (2, inner, true), (3, outer, false)]
        {
            sides.keep(&lattice, level, [(0, taken, 5.0)].into_iter());
            assert_eq!(sides.of(0, taken, 5.0).is_some(), is_known, "level {level}");
            assert!(sides.of(1 + u32::from(level), taken, 5.0).is_some(), "a handle of its own has a side");
        }
        // What is present is known whatever else was; of what is gone, the newest.
        (10..2000).for_each(|id| _ = sides.of(id, outer, 5.0));
        sides.keep(&lattice, 3, [(0, outer, 5.0)].into_iter());
        assert_eq!((sides.lowest.len(), sides.lowest.contains_key(&0)), (1 + MOST_GONE, true));
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
                let meant = vertex(&anchor(&lattice, place, None).unwrap().0);
                assert_eq!(is_outer(meant.at), is_outer(place), "{place:?} means {:?}", meant.at);
                far = far.max((Vector3::from(meant.at) - Vector3::from(place)).norm());
                // From outside it is the outer side that is seen, also where the place lies within the wall or behind it.
                let seen = vertex(
                    &anchor(&lattice, place, Some(Seen { eye: direction.into(), moved: None })).unwrap().0,
                );
                assert!(is_outer(seen.at), "{place:?} means {:?}", seen.at);
                // It is as it is turned now that it faces an eye.
                let eye = turned * Vector3::from(direction);
                let seen =
                    vertex(&anchor(&lattice, place, Some(Seen { eye, moved: Some(&moved) })).unwrap().0);
                assert!(is_outer(seen.at), "{place:?} means {:?}, turned", seen.at);
            }
        }
        assert!(
            wrong > 10,
            "the nearest vertex is of the other side {wrong} times: too few to tell the two apart"
        );
        assert!(far < 8.0, "{far} mm");
    }
}
