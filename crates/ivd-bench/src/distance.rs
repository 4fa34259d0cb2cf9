//! How far a lattice is from a truth, both ways: what a coarse one leaves out counts as what it adds.

use ivd_core::{Exec, Lattice};
use ivd_octree::NearestIndex;
use nalgebra::Vector3;

use crate::experiment::Problem;
use crate::inputs::root_mean_square;

/// Points of a surface, about as many, at which distances are taken.
const POINTS: f64 = 40_000.0;

/// A surface that lattices are held against.
pub(crate) struct Truth {
    distance: Box<dyn Fn(Vector3<f64>) -> f64 + Send + Sync>,
    /// Points all over it (mm).
    points: Vec<Vector3<f64>>,
}

impl Truth {
    /// The surface that `nearest` tells the nearest point of; `near` lies close to all of it.
    pub(crate) fn formula(nearest: fn(Vector3<f64>) -> Vector3<f64>, near: &Lattice) -> Self {
        let points = spread(near).into_iter().map(nearest).collect();
        Self { distance: Box::new(move |p| (p - nearest(p)).norm()), points }
    }

    /// A lattice.
    pub(crate) fn lattice(lattice: &Lattice, exec: &Exec) -> Result<Self, Problem> {
        let search = Search::new(lattice, exec)?;
        Ok(Self { distance: Box::new(move |p| search.distance(p)), points: spread(lattice) })
    }

    /// Distance (mm) of a lattice, root mean square over its surface or over the truth's, whichever is more.
    pub(crate) fn apart(&self, lattice: &Lattice, exec: &Exec) -> Result<f64, Problem> {
        let search = Search::new(lattice, exec)?;
        let there = root_mean_square(spread(lattice).into_iter().map(|p| (self.distance)(p).powi(2)));
        let back = root_mean_square(self.points.iter().map(|p| search.distance(*p).powi(2)));
        Ok(there.max(back))
    }
}

/// Finds how far places are from a lattice.
pub(crate) struct Search {
    index: NearestIndex,
    origin: Vector3<f64>,
}

impl Search {
    pub(crate) fn new(lattice: &Lattice, exec: &Exec) -> Result<Self, Problem> {
        let tree = ivd_octree::build(lattice, &ivd_octree::Params::default(), exec)?;
        let index = ivd_octree::prepare(lattice, &tree)?;
        Ok(Self { index, origin: Vector3::from(lattice.grid().origin()) })
    }

    /// Distance of a place (mm); infinite where the lattice has no triangle.
    pub(crate) fn distance(&self, place: Vector3<f64>) -> f64 {
        self.index.nearest(place - self.origin, f64::INFINITY).map_or(f64::INFINITY, |n| n.distance_mm)
    }
}

/// Points spread evenly over a surface (mm): middles of equal parts, of each triangle as many as its area has a share in.
fn spread(lattice: &Lattice) -> Vec<Vector3<f64>> {
    let positions = lattice.positions();
    let corners = |t: &[u32; 3]| t.map(|v| positions[v as usize]);
    let area = |t: &[u32; 3]| {
        let [a, b, c] = corners(t);
        0.5 * (b - a).cross(&(c - a)).norm()
    };
    let density = POINTS / lattice.triangles().iter().map(area).sum::<f64>();
    let mut points = Vec::new();
    // What the triangles before had too much or too little.
    let mut owed = 0.0;
    for t in lattice.triangles() {
        owed += density * area(t);
        let across = owed.max(0.0).sqrt().round() as u32;
        owed -= f64::from(across * across);
        points.extend(middles(corners(t), across));
    }
    points
}

/// Middles of the `across`² equal parts of a triangle.
fn middles([a, b, c]: [Vector3<f64>; 3], across: u32) -> impl Iterator<Item = Vector3<f64>> {
    let place = move |i: u32, j: u32, shift: f64| {
        let [u, v] = [i, j].map(|k| (f64::from(k) + shift) / f64::from(across));
        a + (b - a) * u + (c - a) * v
    };
    (0..across).flat_map(move |i| {
        let upright = (0..across - i).map(move |j| place(i, j, 1.0 / 3.0));
        let turned = (0..(across - i).saturating_sub(1)).map(move |j| place(i, j, 2.0 / 3.0));
        upright.chain(turned)
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::inputs::{grid, sampled};
    use crate::plate;
    use ivd_core::Volume;
    use ivd_lattice::extract::{ExtractParams, Iso, extract};

    fn plate(n: usize) -> Lattice {
        cut(&plate::volume(n).unwrap())
    }

    fn cut(volume: &Volume) -> Lattice {
        extract(volume, None, &ExtractParams { iso: Iso::Value(0.0) }, &Exec::default()).unwrap().lattice
    }

    #[test]
    fn points_are_spread_by_area_and_lie_on_their_triangles() {
        let lattice = plate(32);
        let points = spread(&lattice);
        assert!((points.len() as f64 / POINTS - 1.0).abs() < 0.01, "{}", points.len());
        let search = Search::new(&lattice, &Exec::default()).unwrap();
        assert!(points.iter().all(|p| search.distance(*p) < 1e-9));
        // The first moment of the area: no part of the surface has more points than its share.
        let corners = |t: &[u32; 3]| t.map(|v| lattice.positions()[v as usize]);
        let (mut area, mut moment) = (0.0, Vector3::zeros());
        for t in lattice.triangles() {
            let [a, b, c] = corners(t);
            let own = 0.5 * (b - a).cross(&(c - a)).norm();
            (area, moment) = (area + own, moment + (a + b + c) * (own / 3.0));
        }
        let mean = points.iter().sum::<Vector3<f64>>() / points.len() as f64;
        assert!((mean - moment / area).norm() < 0.3, "{mean} {}", moment / area);
    }

    #[test]
    fn what_is_left_out_counts_as_what_is_added() {
        let whole = plate(48);
        let exec = Exec::default();
        let truth = Truth::formula(plate::nearest, &whole);
        let near = truth.apart(&whole, &exec).unwrap();
        assert!(near > 0.0 && near < 0.5, "marching cubes chamfers creases: {near}");
        // One of two balls lies on the truth as well as both do; that the other is missing is found from the other side.
        let balls = |middles: &[f64]| {
            let inside = |p: Vector3<f64>, x: &f64| 12.0 - (p - Vector3::new(*x, 0.0, 0.0)).norm();
            let value = |p| middles.iter().map(|x| inside(p, x)).fold(f64::NEG_INFINITY, f64::max);
            cut(&sampled(&grid(48).unwrap(), value).unwrap())
        };
        let (both, one) = (balls(&[-30.0, 30.0]), balls(&[30.0]));
        assert!(Truth::lattice(&both, &exec).unwrap().apart(&one, &exec).unwrap() > 30.0);
        assert!(Truth::lattice(&one, &exec).unwrap().apart(&both, &exec).unwrap() > 30.0);
        assert!(Truth::lattice(&whole, &exec).unwrap().apart(&whole, &exec).unwrap() < 1e-9);
    }
}
