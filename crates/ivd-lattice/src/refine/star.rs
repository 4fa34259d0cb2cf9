use nalgebra::Vector3;

use super::shared::{GONE, Triangles};
use crate::figures::stars::Stars;

/// A vertex with more neighbours than this isn't removed.
pub(super) const MAX_VALENCE: usize = 48;

/// Triangles round a hub, at least: what lies round it elsewhere is taken not to change where one of them does.
pub(super) const HUB: usize = 512;

/// The closed fan of triangles round a vertex, in order: triangle `i` is `(vertex, ring[i], ring[i + 1])`.
#[derive(Debug, Clone)]
pub(super) struct Fan {
    len: usize,
    ring: [u32; MAX_VALENCE],
    triangles: [u32; MAX_VALENCE],
    places: [Vector3<f64>; MAX_VALENCE],
}

impl Fan {
    pub(super) fn new() -> Self {
        let (ring, triangles) = ([0; MAX_VALENCE], [0; MAX_VALENCE]);
        Self { len: 0, ring, triangles, places: [Vector3::zeros(); MAX_VALENCE] }
    }

    /// Reads the fan of `v`. Returns `false` where its triangles aren't one closed fan of 3 to [`MAX_VALENCE`].
    pub(super) fn read(&mut self, v: u32, stars: &Stars, triangles: &Triangles) -> bool {
        self.gather(v, stars.of(v as usize).iter().map(|&t| (t, triangles.corners(t))))
    }

    /// The same from a list of triangles with their corners.
    pub(super) fn gather(&mut self, v: u32, star: impl Iterator<Item = (u32, [u32; 3])>) -> bool {
        let mut after = [0_u32; MAX_VALENCE];
        self.len = 0;
        for (t, corners) in star {
            if corners == GONE {
                continue;
            }
            if self.len == MAX_VALENCE {
                return false;
            }
            let Some(at) = corners.iter().position(|&c| c == v) else { return false };
            self.ring[self.len] = corners[(at + 1) % 3];
            after[self.len] = corners[(at + 2) % 3];
            self.triangles[self.len] = t;
            self.len += 1;
        }
        self.len >= 3 && self.chain(&mut after)
    }

    /// Brings the triangles in an order in which each begins where the last ended.
    fn chain(&mut self, after: &mut [u32; MAX_VALENCE]) -> bool {
        for i in 0..self.len - 1 {
            let Some(next) = (i + 1..self.len).find(|&j| self.ring[j] == after[i]) else { return false };
            self.ring.swap(i + 1, next);
            self.triangles.swap(i + 1, next);
            after.swap(i + 1, next);
        }
        let ring = &self.ring[..self.len];
        // Closed, and no neighbour met twice.
        after[self.len - 1] == ring[0] && (1..self.len).all(|i| !ring[..i].contains(&ring[i]))
    }

    /// Neighbours in order.
    pub(super) fn ring(&self) -> &[u32] {
        &self.ring[..self.len]
    }

    /// Triangles in order.
    pub(super) fn triangles(&self) -> &[u32] {
        &self.triangles[..self.len]
    }

    /// Looks up where the neighbours are; call once after [`Fan::read`].
    pub(super) fn locate(&mut self, positions: &[Vector3<f64>]) {
        for (place, &r) in self.places[..self.len].iter_mut().zip(&self.ring) {
            *place = positions[r as usize];
        }
    }

    /// Places of the neighbours in order.
    pub(super) fn places(&self) -> &[Vector3<f64>] {
        &self.places[..self.len]
    }

    /// Turns the fan so that neighbour `y` comes first.
    pub(super) fn turn_to(&mut self, y: u32) {
        let at = self.ring().iter().position(|&r| r == y).expect("the target is a neighbour");
        if at > 0 {
            self.ring[..self.len].rotate_left(at);
            self.triangles[..self.len].rotate_left(at);
            self.places[..self.len].rotate_left(at);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn fan(triangles: &[[u32; 3]]) -> Option<Fan> {
        let mut fan = Fan::new();
        let listed: Vec<_> = triangles.iter().map(|t| if *t == GONE { [0, 7, 8] } else { *t }).collect();
        fan.read(0, &Stars::new(9, &listed), &Triangles::new(triangles, vec![0; triangles.len()]))
            .then_some(fan)
    }

    #[test]
    fn a_closed_fan_is_read_in_order_and_turned() {
        let mut fan = fan(&[[3, 4, 0], [0, 1, 2], [0, 4, 1], GONE, [2, 3, 0]]).unwrap();
        fan.locate(&std::array::from_fn::<_, 5, _>(|i| Vector3::repeat(i as f64)));
        fan.turn_to(2);
        assert_eq!(fan.places().iter().map(|p| p.x).collect::<Vec<_>>(), [2.0, 3.0, 4.0, 1.0]);
        assert_eq!((fan.ring(), fan.triangles()), (&[2, 3, 4, 1][..], &[4, 0, 2, 1][..]));
    }

    #[test]
    fn open_touching_and_doubled_fans_are_refused() {
        assert!(fan(&[[0, 1, 2], [0, 2, 3], [0, 3, 4]]).is_none(), "open");
        let two = [[0, 1, 2], [0, 2, 3], [0, 3, 1], [0, 4, 5], [0, 5, 6], [0, 6, 4]];
        assert!(fan(&two).is_none(), "two fans");
        assert!(fan(&[[0, 1, 2], [0, 2, 1]]).is_none(), "two sheets of one triangle");
        assert!(fan(&[[0, 1, 2], [0, 3, 2], [0, 3, 1]]).is_none(), "triangles that disagree");
    }
}
