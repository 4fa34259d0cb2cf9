//! The vertices of a row of voxels: their numbers, keys and places.

use std::ops::Range;

use ivd_core::ElementKey;

use super::place::Cell;
use super::rows::CellRow;
use super::samples::Samples;
use super::table::{CASES, CrossingId};

/// A cell with vertices of its own.
#[derive(Debug, Clone, Copy)]
pub(super) struct Centre {
    /// Padded x and y.
    pub(super) at: [u32; 2],
    pub(super) id: CrossingId,
}

/// Which vertices a voxel has: the number of the first, counted from the row's first, above a bit each for the edges along x,
/// y, z that start there. The vertices of its cell follow those of its edges.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Voxel(u32);

impl Voxel {
    /// Vertices that a row may have: their numbers have 29 bits.
    pub(super) const MOST: u32 = 1 << 29;

    #[inline(always)]
    fn new(first: u32, crossed: [u32; 3]) -> Self {
        Self(first << 3 | crossed[0] | crossed[1] << 1 | crossed[2] << 2)
    }

    /// Numbers of the vertices on the three edges and of the first in the cell, where there is one; `row` is the row's first.
    #[inline(always)]
    pub(super) fn numbers(self, row: u32) -> [u32; 4] {
        let x = row.wrapping_add(self.0 >> 3);
        let y = x.wrapping_add(self.0 & 1);
        let z = y.wrapping_add(self.0 >> 1 & 1);
        [x, y, z, z.wrapping_add(self.0 >> 2 & 1)]
    }
}

/// The vertices of the voxels of one layer. What it says of a voxel without one means nothing.
#[derive(Debug)]
pub(super) struct Layer {
    width: usize,
    voxels: Vec<Voxel>,
    /// The first vertex of each row.
    firsts: Vec<u32>,
}

impl Layer {
    /// Room for a layer of a grid of `dims` voxels.
    pub(super) fn new(dims: [usize; 3]) -> Self {
        let [width, rows] = [dims[0] + 2, dims[1] + 2];
        Self { width, voxels: vec![Voxel::default(); width * rows], firsts: vec![0; rows] }
    }

    /// Whether it is of a grid of `dims` voxels.
    pub(super) fn fits(&self, dims: [usize; 3]) -> bool {
        [self.width, self.firsts.len()] == [dims[0] + 2, dims[1] + 2]
    }

    /// Bytes of one.
    pub(super) fn bytes(dims: [usize; 3]) -> usize {
        (size_of::<Voxel>() * (dims[0] + 2) + size_of::<u32>()) * (dims[1] + 2)
    }

    /// The row at padded `y`, and its first vertex.
    #[inline]
    pub(super) fn row(&self, y: usize) -> (&[Voxel], u32) {
        (&self.voxels[y * self.width..][..self.width], self.firsts[y])
    }
}

/// The voxels of one padded row.
#[derive(Debug)]
pub(super) struct VoxelRow<'a, S> {
    samples: &'a S,
    cells: CellRow<'a>,
    dims: [usize; 3],
    y: usize,
    z: usize,
    /// The row's cells with vertices of their own, by place.
    centres: &'a [Centre],
}

impl<'a, S: Samples> VoxelRow<'a, S> {
    /// The row of `cells`, whose first corners have padded `y` and `z`.
    pub(super) fn new(
        samples: &'a S,
        cells: CellRow<'a>,
        dims: [usize; 3],
        [y, z]: [usize; 2],
        centres: &'a [Centre],
    ) -> Self {
        Self { samples, cells, dims, y, z, centres }
    }

    /// Enters the row's vertices in `layer`, numbered from `first` on; returns how many there are.
    pub(super) fn number(&self, first: u32, layer: &mut Layer) -> usize {
        let mut len = 0;
        let row = self.enter(first, layer);
        self.each(|x, crossed, centre| {
            row[x] = Voxel::new(len, crossed);
            len +=
                crossed.iter().sum::<u32>() + centre.map_or(0, |centre| CASES.fans(centre.id).len() as u32);
        });
        len as usize
    }

    /// The same, and puts their keys and places at the start of these.
    pub(super) fn place(
        &self,
        first: u32,
        layer: &mut Layer,
        keys: &mut [u64],
        places: &mut [[f32; 3]],
    ) -> usize {
        let mut len = 0;
        let row = self.enter(first, layer);
        let first_key = ElementKey::new(self.dims, [0, self.y, self.z], 0).0;
        self.each(|x, crossed, centre| {
            row[x] = Voxel::new(len as u32, crossed);
            let key = first_key + 8 * x as u64;
            // Each is put, crossed or not: the key after it takes the place of one that isn't.
            for (element, crossed) in (0..).zip(crossed) {
                if let Some(to) = keys.get_mut(len) {
                    *to = key + element;
                }
                len += crossed as usize;
            }
            for (element, _) in (6..).zip(centre.map_or(&[][..], |centre| CASES.fans(centre.id))) {
                keys[len] = key + element;
                len += 1;
            }
        });
        let edges = RowEdges::new(self.samples, self.dims, self.y, self.z);
        let split = |key: &u64| ((key - first_key) as usize / 8, (key - first_key) as usize % 8);
        let (keys, places) = (&keys[..len], &mut places[..len]);
        let ends = [keys.first(), keys.last()].map(|key| key.map_or(0, |key| split(key).0));
        if self.centres.is_empty() && edges.are_real(ends) {
            for (key, place) in keys.iter().zip(places) {
                let (x, axis) = split(key);
                let fraction = edges.fraction(x, axis);
                *place = [0, 1, 2].map(|a| if a == axis { fraction } else { 0.0 });
            }
            return len;
        }
        let mut passed = 0;
        for (key, place) in keys.iter().zip(places) {
            let (x, element) = split(key);
            *place = [0.0; 3];
            if element < 3 {
                place[element] = edges.fraction_or_half(x, element);
            } else {
                passed += usize::from(element == 6);
                let fan = &CASES.fans(self.centres[passed - 1].id)[element - 6];
                let cell = Cell { dims: self.dims, first: [x, self.y, self.z] };
                *place = cell.centre_place(self.samples, fan);
            }
        }
        len
    }

    fn enter<'l>(&self, first: u32, layer: &'l mut Layer) -> &'l mut [Voxel] {
        layer.firsts[self.y] = first;
        &mut layer.voxels[self.y * layer.width..][..layer.width]
    }

    /// Calls `visit` with place, crossed edges (0 or 1 an axis) and own cell vertices of each voxel that has a vertex.
    #[inline(always)]
    fn each(&self, mut visit: impl FnMut(usize, [u32; 3], Option<&Centre>)) {
        let mut centres = self.centres;
        for k in self.cells.words() {
            let crossed = self.cells.crossed(k);
            let mut any = crossed[0] | crossed[1] | crossed[2];
            let (here, later) =
                centres.split_at(centres.partition_point(|c| (c.at[0] as usize) < 32 * (k + 1)));
            centres = later;
            any |= here.iter().fold(0, |bits, c| bits | 1 << (c.at[0] % 32));
            let mut here = here.iter().peekable();
            while any != 0 {
                let b = any.trailing_zeros();
                any &= any - 1;
                let x = 32 * k + b as usize;
                let centre = here.next_if(|c| c.at[0] as usize == x);
                visit(x, [crossed[0] >> b & 1, crossed[1] >> b & 1, crossed[2] >> b & 1], centre);
            }
        }
    }
}

/// The edges that start at the voxels of one padded row.
struct RowEdges<'a, S> {
    samples: &'a S,
    /// The voxel at padded `x` of this row is `start + x - border`, where that isn't in the border layer.
    start: usize,
    border: usize,
    /// For each axis the step to the next voxel and the `x` between which its edges have two real voxels.
    steps: [usize; 3],
    real: [Range<usize>; 3],
}

impl<'a, S: Samples> RowEdges<'a, S> {
    fn new(samples: &'a S, [nx, ny, nz]: [usize; 3], y: usize, z: usize) -> Self {
        let all_if = |real: bool| if real { 0..nx + 1 } else { 0..0 };
        Self {
            samples,
            start: nx * (y + ny * z),
            border: 1 + nx * (1 + ny),
            steps: [1, nx, nx * ny],
            real: [1..nx, all_if((1..ny).contains(&y)), all_if((1..nz).contains(&z))],
        }
    }

    /// Whether all crossed edges between two places have two real voxels.
    fn are_real(&self, ends: [usize; 2]) -> bool {
        ends.iter().all(|x| self.real.iter().all(|real| real.contains(x)))
    }

    /// Where the surface crosses an edge that has two real voxels.
    #[inline(always)]
    fn fraction(&self, x: usize, axis: usize) -> f32 {
        let voxel = self.start + x - self.border;
        self.samples.crossing(voxel, voxel + self.steps[axis])
    }

    /// Where the surface crosses an edge: halfway into the border layer.
    fn fraction_or_half(&self, x: usize, axis: usize) -> f32 {
        if self.real[axis].contains(&x) { self.fraction(x, axis) } else { 0.5 }
    }
}
