//! Where a cell lies in the padded grid, which way its ambiguous faces go, and where its vertices lie.

use super::cell::{self, EDGES, FACES};
use super::interior;
use super::samples::Samples;
use super::table::{CASES, CrossingId, Tube};

/// A cell of the grid padded by one voxel outside on every side: it spans the padded voxels `first` to `first + 1`.
/// There are `n + 1` cells along an axis of `n` voxels.
#[derive(Debug, Clone, Copy)]
pub(super) struct Cell {
    pub(super) dims: [usize; 3],
    pub(super) first: [usize; 3],
}

impl Cell {
    /// Padded voxel of a corner.
    #[inline]
    pub(super) fn padded(&self, corner: u8) -> [usize; 3] {
        let offset = cell::offset(corner);
        std::array::from_fn(|a| self.first[a] + offset[a])
    }

    /// Linear index of the voxel at a corner; `None` in the border layer.
    #[inline]
    pub(super) fn voxel(&self, corner: u8) -> Option<usize> {
        let [p, n] = [self.padded(corner), self.dims];
        (0..3)
            .all(|a| (1..=n[a]).contains(&p[a]))
            .then(|| (p[0] - 1) + n[0] * ((p[1] - 1) + n[1] * (p[2] - 1)))
    }

    /// How the surface crosses this cell, given its corners' signs.
    #[inline]
    pub(super) fn crossing(&self, samples: &impl Samples, case: u8) -> CrossingId {
        let ambiguous = CASES.ambiguous(case);
        let joined = if ambiguous == 0 { 0 } else { self.joined(samples, case, ambiguous) };
        let id = CASES.crossing(case, joined);
        let tubes = CASES.tubes(id);
        if tubes.is_empty() { id } else { self.tubed(samples, case, tubes).unwrap_or(id) }
    }

    /// The crossing with a tube, if there is one: between loops that part the same two regions of the cell.
    fn tubed(&self, samples: &impl Samples, case: u8, tubes: &[Tube]) -> Option<CrossingId> {
        let levels = std::array::from_fn(|corner| self.level(samples, corner as u8));
        let regions = interior::regions(levels, case, samples.joins_ties())?;
        let sides = |edge: u8| {
            let [low, high] = EDGES[usize::from(edge)];
            let [inside, outside] = if case >> low & 1 == 1 { [low, high] } else { [high, low] };
            [regions[usize::from(inside)], regions[usize::from(outside)]]
        };
        tubes.iter().find(|tube| sides(tube.ends[0]) == sides(tube.ends[1])).map(|tube| tube.id)
    }

    /// The decisions about the ambiguous faces, packed: bit `k` is set where the inside corners of the `k`-th
    /// ambiguous face are joined across it.
    fn joined(&self, samples: &impl Samples, case: u8, ambiguous: u8) -> u8 {
        let faces = (0..6).filter(|f| ambiguous >> f & 1 == 1);
        faces
            .enumerate()
            .fold(0, |joined, (rank, f)| joined | u8::from(self.joins(samples, case, FACES[f])) << rank)
    }

    /// Asymptotic decider (Nielson and Hamann 1991): the inside corners of an ambiguous face are joined where the
    /// bilinear function on it is positive at its saddle. With inside levels `a`, `c` and outside ones `b`, `d`
    /// that is `a c > b d`; equality joins where the field says so. A corner without a level leaves them apart. Both cells of a
    /// face compare the same two products and so agree.
    fn joins(&self, samples: &impl Samples, case: u8, face: [u8; 4]) -> bool {
        let levels = face.map(|corner| self.level(samples, corner));
        let first_inside = case >> face[0] & 1 == 1;
        let inside = [first_inside, !first_inside, first_inside, !first_inside];
        let Some([a, b, c, d]) = interior::scaled(levels, inside) else { return false };
        let [inside, outside] = if first_inside { [a * c, b * d] } else { [b * d, a * c] };
        inside > outside || inside == outside && samples.joins_ties()
    }

    fn level(&self, samples: &impl Samples, corner: u8) -> f64 {
        self.voxel(corner).map_or(f64::NAN, |voxel| samples.level(voxel))
    }

    /// Fraction of the way along a crossed edge; halfway into the border layer.
    #[inline]
    pub(super) fn fraction(&self, samples: &impl Samples, edge: u8) -> f32 {
        let [a, b] = EDGES[usize::from(edge)].map(|corner| self.voxel(corner));
        a.zip(b).map_or(0.5, |(a, b)| samples.crossing(a, b))
    }

    /// Offset of the cell's own vertex: the mean of the crossings around it. It lies strictly inside the cell, since these
    /// don't all lie in one face.
    pub(super) fn centre_place(&self, samples: &impl Samples, fan: &[u8]) -> [f32; 3] {
        let mut sum = [0.0_f64; 3];
        for &edge in fan {
            let low = cell::offset(EDGES[usize::from(edge)][0]);
            for a in 0..3 {
                sum[a] += low[a] as f64;
            }
            sum[cell::axis(edge)] += f64::from(self.fraction(samples, edge));
        }
        sum.map(|s| (s / fan.len() as f64) as f32)
    }
}
