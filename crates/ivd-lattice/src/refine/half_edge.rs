//! A single half-edge collapse: whether it may be, and what it changes.

use nalgebra::Vector3;

use super::deviation::Deviation;
use super::features::Kind;
use super::params::RefineParams;
use super::refusal::Refusal;
use super::shared::NONE;
use super::star::Fan;
use super::surface::Surface;

/// Least height of a new triangle as a share of its longest side.
pub(super) const LEAST_HEIGHT: f64 = 1e-4;

/// Limits of a single collapse.
pub(super) struct Limits {
    /// Least cosine between a triangle's normals before and after.
    pub(super) turn_cosine: f64,
    /// Largest bound allowed (mm).
    pub(super) bound: f64,
    /// See [`edge_squared`].
    pub(super) edge_squared: f64,
}

impl Limits {
    /// - `bound`: the largest one allowed (mm).
    pub(super) fn new(params: &RefineParams, bound: f64) -> Self {
        Self {
            turn_cosine: params.max_turn_degrees.to_radians().cos(),
            bound,
            edge_squared: edge_squared(params),
        }
    }

    /// Whether an edge may be made.
    pub(super) fn allow_edge(&self, a: &Vector3<f64>, b: &Vector3<f64>) -> bool {
        (b - a).norm_squared() <= self.edge_squared
    }
}

/// Squared length (mm²) beyond which no edge is made; infinite where any may be.
pub(super) fn edge_squared(params: &RefineParams) -> f64 {
    params.max_edge.map_or(f64::INFINITY, |mm| mm * mm)
}

/// Collapses the vertex of `fan`, `u`, onto its neighbour `y` if nothing speaks against it.
///
/// Reads and writes entries of `u`, of its ring and of triangles round these alone; what it reads of a triangle with a
/// corner outside the ring of `u` is only who its corners are.
pub(super) fn collapse(
    surface: &Surface,
    [u, y]: [u32; 2],
    fan: &mut Fan,
    deviation: &mut Deviation,
    limits: &Limits,
) -> Result<(), Refusal> {
    fan.turn_to(y);
    let from = &surface.positions[u as usize];
    let k = fan.ring().len();
    if let Kind::Crease([a, b]) = surface.features.kind(u) {
        let other = if a == y { b } else { a };
        let adjacent = [fan.ring()[1], fan.ring()[k - 1]].contains(&other);
        if !surface.features.may_join([y, other], adjacent) {
            return Err(Refusal::Feature);
        }
    }
    // A tetrahedron is told as one, whatever its shape.
    if k == 3 {
        check_link(surface, [u, y], fan)?;
        check_shape(from, fan.places(), limits)?;
    } else {
        check_shape(from, fan.places(), limits)?;
        check_link(surface, [u, y], fan)?;
    }
    // The first and the last of the others are neighbours already.
    let [to, _, far @ .., _] = fan.places() else { return Err(Refusal::Link) };
    if !far.iter().all(|place| limits.allow_edge(to, place)) {
        return Err(Refusal::Edge);
    }
    let old = fan.triangles().iter().map(|&t| surface.triangles.bound(t));
    let bounds = deviation.bounds_after(from, fan.places(), old);
    let largest = bounds.iter().copied().fold(0.0, f32::max);
    if f64::from(largest) > limits.bound {
        return Err(Refusal::Bound(largest));
    }
    for (&t, &bound) in fan.triangles()[1..k - 1].iter().zip(bounds) {
        surface.triangles.pull(t, u, y, bound);
    }
    surface.triangles.remove(fan.triangles()[0]);
    surface.triangles.remove(fan.triangles()[k - 1]);
    record(surface, [u, y], fan);
    Ok(())
}

fn record(surface: &Surface, [u, y]: [u32; 2], fan: &Fan) {
    surface.onto[u as usize].set(y);
    let first = surface.merged[y as usize].get();
    surface.merged[u as usize].set(if first == NONE { u } else { first });
    surface.merged[y as usize].set(u);
    surface.features.join(u);
    for &r in fan.ring() {
        surface.forget(r);
    }
}

/// No new triangle may turn too far from the old one or be nearly without area.
pub(super) fn check_shape(
    from: &Vector3<f64>,
    places: &[Vector3<f64>],
    limits: &Limits,
) -> Result<(), Refusal> {
    let to = &places[0];
    let (mut old_b, mut new_b) = (places[1] - from, places[1] - to);
    let mut new_b_squared = new_b.norm_squared();
    for side in places[1..].windows(2) {
        let (old_c, new_c, edge) = (side[1] - from, side[1] - to, side[1] - side[0]);
        let (old, new) = (old_b.cross(&old_c), new_b.cross(&new_c));
        let new_c_squared = new_c.norm_squared();
        let longest = edge.norm_squared().max(new_b_squared).max(new_c_squared);
        let size = new.norm_squared();
        let flat = size <= (LEAST_HEIGHT * longest).powi(2);
        if flat || old.dot(&new) < limits.turn_cosine * (old.norm_squared() * size).sqrt() {
            return Err(Refusal::Flip);
        }
        (old_b, new_b, new_b_squared) = (old_c, new_c, new_c_squared);
    }
    Ok(())
}

/// The link condition (Dey et al. 1999): `u` and `y` share the two neighbours of their edge's triangles and no
/// other, and no new triangle exists already.
fn check_link(surface: &Surface, [u, y]: [u32; 2], fan: &Fan) -> Result<(), Refusal> {
    let ring = fan.ring();
    // Most corners are no neighbours of u: a bit for each neighbour tells so at once.
    let bit = |v: u32| 1_u64 << (v % 64);
    let bits = ring[1..].iter().fold(0, |bits, &r| bits | bit(r));
    let mut common = 0_u64;
    let mut last = y;
    loop {
        for &t in surface.stars.of(last as usize) {
            // A removed triangle's corners are no vertices at all.
            let corners = surface.triangles.corners(t);
            // The third side of a fan of three, seen from the other side: a tetrahedron.
            if ring.len() == 3 && !corners.contains(&u) && ring[1..].iter().all(|r| corners.contains(r)) {
                return Err(Refusal::Speck);
            }
            for c in corners {
                if bits & bit(c) != 0
                    && let Some(at) = ring[1..].iter().position(|&r| r == c)
                {
                    common |= 1 << at;
                }
            }
        }
        let next = surface.merged[last as usize].get();
        if next == NONE || next == last {
            break;
        }
        last = next;
    }
    if common.count_ones() == 2 { Ok(()) } else { Err(Refusal::Link) }
}
