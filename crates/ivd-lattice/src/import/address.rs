//! Addresses of vertices: those that a mesh carries, and new ones.

use ivd_core::{ElementKey, Grid, Mesh, MeshAddress, counted};
use nalgebra::{Matrix3, Vector3};
use rayon::prelude::*;

use super::refusal::{place, unfit};
use crate::Error;

/// Distance from a grid line or plane within which a vertex lies on it (voxels). Three of them together stay below the
/// 10⁻⁶ that is promised.
const ON_LINE: f64 = 5e-7;
/// Addresses of a voxel.
const ELEMENTS: usize = 8;

/// An address and the place from its voxel.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Addressed {
    pub(super) key: ElementKey,
    pub(super) place: [f32; 3],
}

/// From mm to voxels, exact to the rounding of the mm.
struct Frame {
    dims: [usize; 3],
    origin: Vector3<f64>,
    linear: Matrix3<f64>,
    inverse: Matrix3<f64>,
    spacing: f64,
}

impl Frame {
    fn new(grid: &Grid) -> Self {
        Self {
            dims: grid.dims(),
            origin: Vector3::from(grid.origin()),
            linear: grid.linear_part(),
            inverse: grid.inverse_linear_part(),
            spacing: grid.shortest_edge(),
        }
    }

    /// Voxel coordinate of a position, with one correction for what the inverse rounds away.
    fn voxel(&self, p: &Vector3<f64>) -> Vector3<f64> {
        let local = p - self.origin;
        let v = self.inverse * local;
        v + self.inverse * (local - self.linear * v)
    }

    /// What the rounding of a position in mm may amount to (voxels).
    fn rounding(&self, p: &Vector3<f64>) -> f64 {
        4.0 * f64::EPSILON * p.amax().max(self.origin.amax()) / self.spacing
    }

    /// The position as a lattice computes it.
    fn world(&self, voxel: [i64; 3], place: [f32; 3]) -> Vector3<f64> {
        self.origin + self.linear * Vector3::from_fn(|a, _| voxel[a] as f64 + f64::from(place[a]))
    }

    fn key(&self, voxel: [i64; 3], element: u8) -> ElementKey {
        ElementKey::new(self.dims, voxel.map(|v| (v + 1) as usize), element)
    }
}

/// The addresses that the mesh carries, if all of them fit its positions on this grid.
pub(super) fn kept(mesh: &Mesh, grid: &Grid) -> Option<Vec<Addressed>> {
    let addresses = mesh.addresses.as_ref().filter(|list| list.len() == mesh.positions.len())?;
    let frame = Frame::new(grid);
    let found: Option<Vec<Addressed>> =
        addresses.par_iter().zip(&mesh.positions).map(|(address, p)| own(&frame, *address, p)).collect();
    let found = found?;
    let mut keys: Vec<ElementKey> = found.iter().map(|a| a.key).collect();
    keys.par_sort_unstable();
    keys.windows(2).all(|w| w[0] < w[1]).then_some(found)
}

/// The place from an address's own voxel.
fn own(frame: &Frame, (voxel, element): MeshAddress, p: &Vector3<f64>) -> Option<Addressed> {
    let inside = (0..3).all(|a| (-1..=frame.dims[a] as i64).contains(&voxel[a]));
    if !inside || element >= ELEMENTS as u8 {
        return None;
    }
    let off = frame.voxel(p) - Vector3::from(voxel.map(|v| v as f64));
    let tolerance = ON_LINE + frame.rounding(p);
    let mut place = [0.0; 3];
    for axis in 0..3 {
        let lies_on = match element {
            0..=2 => axis != usize::from(element),
            3..=5 => axis == usize::from(element) - 3,
            _ => false,
        };
        // An element may stand for a vertex elsewhere in the cell, where the cell's own are taken.
        if !(-tolerance..=1.0 + tolerance).contains(&off[axis]) {
            return None;
        }
        // Below a rounding there is nothing to tell a place from the voxel itself.
        let on_it = lies_on && off[axis].abs() <= tolerance;
        place[axis] = if on_it { 0.0 } else { off[axis].clamp(0.0, 1.0) as f32 };
    }
    let moves = std::array::from_fn(|axis| place[axis] != 0.0);
    let place = exact(frame, voxel, place, moves, p);
    Some(Addressed { key: frame.key(voxel, element), place })
}

/// The place near `place` that gives the position back bit for bit, or `place` if its neighbours don't.
fn exact(frame: &Frame, voxel: [i64; 3], place: [f32; 3], moves: [bool; 3], p: &Vector3<f64>) -> [f32; 3] {
    if frame.world(voxel, place) == *p {
        return place;
    }
    for steps in 0..27_usize {
        let step = [steps % 3, steps / 3 % 3, steps / 9];
        let near = std::array::from_fn(|a| match step[a] {
            1 if moves[a] => place[a].next_down(),
            2 if moves[a] => place[a].next_up(),
            _ => place[a],
        });
        if near.iter().all(|c| (0.0..=1.0).contains(c)) && frame.world(voxel, near) == *p {
            return near;
        }
    }
    place
}

/// Refuses a mesh of which a vertex lies outside the padded grid.
pub(super) fn check_inside(mesh: &Mesh, grid: &Grid) -> Result<(), Error> {
    let frame = Frame::new(grid);
    let is_outside = |p: &Vector3<f64>| {
        let v = frame.voxel(p);
        (0..3).any(|a| !(-1.0 - ON_LINE..=frame.dims[a] as f64 + ON_LINE).contains(&v[a]))
    };
    let Some(first) = mesh.positions.par_iter().position_first(is_outside) else { return Ok(()) };
    let outside = mesh.positions.par_iter().filter(|p| is_outside(p)).count();
    let corners = (0..8_usize).map(|c| {
        let v = Vector3::from_fn(|a, _| if c >> a & 1 == 1 { frame.dims[a] as f64 } else { -1.0 });
        frame.origin + frame.linear * v
    });
    let (low, high) = corners
        .fold((Vector3::repeat(f64::INFINITY), Vector3::repeat(f64::NEG_INFINITY)), |(low, high), p| {
            (low.inf(&p), high.sup(&p))
        });
    let problem = format!(
        "{outside} of {} outside the grid with one voxel round it; vertex {first} is at {}, and the grid reaches from {} to {}",
        counted(mesh.positions.len(), "vertex lies", "vertices lie"),
        place(&mesh.positions[first]),
        place(&low),
        place(&high)
    );
    Err(unfit(problem, "check the mesh's unit and axes, or take the grid of the volume that it belongs to"))
}

/// New addresses of the vertices `kept`, which lie in the padded grid.
pub(super) fn assign(kept: &[u32], mesh: &Mesh, grid: &Grid) -> Result<Vec<Addressed>, Error> {
    let frame = Frame::new(grid);
    let mut found: Vec<Addressed> = kept
        .par_iter()
        .map(|&v| {
            let (voxel, place) = locate(&frame, &frame.voxel(&mesh.positions[v as usize]));
            Addressed { key: frame.key(voxel, 0), place }
        })
        .collect();
    let mut order: Vec<u32> = (0..kept.len() as u32).collect();
    order.par_sort_unstable_by_key(|&i| (found[i as usize].key, i));
    let crowded = |voxel: &&[u32]| voxel.len() > ELEMENTS;
    let voxels = || order.chunk_by(|&a, &b| found[a as usize].key == found[b as usize].key);
    if let Some(voxel) = voxels().find(crowded) {
        let problem = format!(
            "{} more than {ELEMENTS} vertices, the first {} of them at {} (voxel {:?})",
            counted(voxels().filter(crowded).count(), "voxel holds", "voxels hold"),
            voxel.len(),
            place(&mesh.positions[kept[voxel[0] as usize] as usize]),
            found[voxel[0] as usize].key.voxel(frame.dims)
        );
        return Err(unfit(problem, "check the mesh's unit, take a finer grid, or refine the mesh first"));
    }
    let mut elements = vec![0_u8; kept.len()];
    for voxel in voxels() {
        let places: Vec<[f32; 3]> = voxel.iter().map(|&i| found[i as usize].place).collect();
        for (&i, element) in voxel.iter().zip(share(&places)) {
            elements[i as usize] = element;
        }
    }
    for (address, element) in found.iter_mut().zip(elements) {
        address.key = ElementKey(address.key.0 + u64::from(element));
    }
    Ok(found)
}

/// The voxel that a coordinate is in, and the place from it: 0 where it is on a grid line.
fn locate(frame: &Frame, v: &Vector3<f64>) -> ([i64; 3], [f32; 3]) {
    let mut voxel = [0; 3];
    let mut place = [0.0; 3];
    for axis in 0..3 {
        let c = v[axis].clamp(-1.0, frame.dims[axis] as f64);
        let near = c.round();
        if (c - near).abs() <= ON_LINE {
            voxel[axis] = near as i64;
        } else {
            voxel[axis] = c.floor() as i64;
            place[axis] = (c - c.floor()) as f32;
        }
    }
    (voxel, place)
}

/// The element of each of at most 8 vertices of a voxel: the nearest that is free. Vertices on edges choose first, then those on
/// faces, then the rest, each kind in its order.
fn share(places: &[[f32; 3]]) -> Vec<u8> {
    let off_line = |place: &[f32; 3]| place.iter().filter(|c| **c != 0.0).count().max(1);
    let mut order: Vec<usize> = (0..places.len()).collect();
    order.sort_by_key(|&i| off_line(&places[i]));
    let (mut free, mut elements) = ([true; ELEMENTS], vec![0; places.len()]);
    for i in order {
        let nearest = (0..ELEMENTS)
            .filter(|&e| free[e])
            .min_by(|&a, &b| distance(&places[i], a).total_cmp(&distance(&places[i], b)));
        // There are no more vertices than elements.
        let element = nearest.unwrap_or_default();
        free[element] = false;
        elements[i] = element as u8;
    }
    elements
}

/// Squared distance of a place from an element (voxels).
fn distance(place: &[f32; 3], element: usize) -> f32 {
    let square = |axis: usize| place[axis] * place[axis];
    match element {
        0..=2 => (0..3).filter(|axis| *axis != element).map(square).sum(),
        3..=5 => square(element - 3),
        _ => 0.0,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn vertices_on_edges_and_faces_get_them_and_the_others_the_nearest_free_element() {
        let places = [[0.5, 0.5, 0.5], [0.0, 0.3, 0.0], [0.2, 0.0, 0.4], [0.3, 0.2, 0.9], [0.4, 0.6, 0.1]];
        // Cell, edge y, face normal to y, cell, and then nearest to the face normal to z.
        assert_eq!(share(&places), [6, 1, 4, 7, 5]);
        // The last lies on the edge x, which is taken, and so on the face normal to y.
        assert_eq!(share(&[[0.0; 3], [0.0, 0.0, 0.7], [0.9, 0.0, 0.0]]), [0, 2, 4]);
    }

    #[test]
    fn eight_vertices_get_eight_elements() {
        let places: Vec<[f32; 3]> = (0_u8..8).map(|i| [f32::from(i + 1) / 10.0, 0.5, 0.25]).collect();
        let mut elements = share(&places);
        elements.sort_unstable();
        assert_eq!(elements, [0, 1, 2, 3, 4, 5, 6, 7]);
    }
}
