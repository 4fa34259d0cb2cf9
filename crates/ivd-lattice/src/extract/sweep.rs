//! Extraction in passes, as in Flying Edges (Schroeder, Maynard and Geveci 2015): signs, counts, sums, triangles.
//!
//! The signs of all voxels are read into bits. Counting the vertices and triangles of each layer of cells then gives
//! every layer its place in the output, so that layers are written independently and in any order. The work is by
//! words of 32 cells between the first and the last voxel inside; only cells with both signs are looked at one by one.

use std::ops::Range;
use std::sync::{Mutex, PoisonError};

use ivd_core::Exec;
use rayon::prelude::*;

use super::Surface;
use super::place::Cell;
use super::rows::CellRow;
use super::samples::Samples;
use super::signs::Signs;
use super::table::{CASES, CrossingId, Simple};
use super::vertices::{Centre, Layer, Voxel, VoxelRow};
use crate::Error;

/// Slabs of layers for each thread: enough to share out the work, few beside the layers, as each numbers one more.
const SLABS: usize = 6;

/// Task name for observers.
const TASK: &str = "extract";

/// What a layer of cells adds to the lattice.
#[derive(Debug, Default)]
struct Count {
    vertices: u64,
    triangles: u64,
    /// The rows that hold all of them.
    rows: Range<usize>,
    /// How the surface crosses those cells whose signs leave it open, in order.
    open: Vec<CrossingId>,
    /// The cells with a vertex of their own, ascending by row, then place.
    centres: Vec<Centre>,
}

impl Count {
    /// What it costs to write the layer, in vertices.
    fn cost(&self, dims: [usize; 3]) -> u64 {
        self.vertices + dims[1] as u64
    }

    /// The cells of row `y` with a vertex of their own.
    fn centres(&self, y: usize) -> &[Centre] {
        if self.centres.is_empty() {
            return &[];
        }
        let start = self.centres.partition_point(|c| (c.at[1] as usize) < y);
        let len = self.centres[start..].partition_point(|c| c.at[1] as usize == y);
        &self.centres[start..start + len]
    }
}

/// The input of every pass.
struct Sweep<'a, S> {
    samples: &'a S,
    signs: &'a Signs,
    dims: [usize; 3],
    simple: &'a Simple,
    flip: bool,
}

/// The surface of `samples`, whose signs are `signs`, on a grid of `dims` voxels. `flip` turns every triangle over
/// (left-handed grids).
pub(super) fn extract<S: Samples>(
    samples: &S,
    signs: &Signs,
    dims: [usize; 3],
    flip: bool,
    exec: &Exec,
) -> Result<Surface, Error> {
    let sweep = Sweep { samples, signs, dims, simple: &CASES.simple[usize::from(flip)], flip };
    let layers = dims[2] + 1;
    exec.observer().begin(TASK, 2 * layers as u64);
    let surface = sweep.run(layers, exec);
    exec.observer().end(TASK);
    surface
}

impl<S: Samples> Sweep<'_, S> {
    fn run(&self, layers: usize, exec: &Exec) -> Result<Surface, Error> {
        let counts: Vec<Count> = (0..layers)
            .into_par_iter()
            .map(|z| {
                exec.check_cancelled()?;
                let count = self.count_layer(z);
                exec.observer().advance(TASK, 1);
                Ok(count)
            })
            .collect::<Result<_, ivd_core::Error>>()?;
        let vertices: u64 = counts.iter().map(|c| c.vertices).sum();
        let triangles: u64 = counts.iter().map(|c| c.triangles).sum();
        if vertices > u64::from(u32::MAX) {
            return Err(Error::TooManyVertices { vertices });
        }
        let desks = (rayon::current_num_threads() * 2 * Layer::bytes(self.dims)) as u64;
        exec.check_memory("the lattice", Signs::bytes(self.dims) + desks + vertices * 20 + triangles * 12)?;

        let mut keys = vec![0_u64; vertices as usize];
        let mut places = vec![[0.0_f32; 3]; vertices as usize];
        let mut corners = vec![[0_u32; 3]; triangles as usize];
        let slabs = self.slabs(&counts, &mut keys, &mut places, &mut corners);
        let desks = Mutex::new(Vec::new());
        slabs.into_par_iter().try_for_each(|slab| {
            exec.check_cancelled()?;
            let layers = slab.layers.len() as u64;
            let free = desks.lock().unwrap_or_else(PoisonError::into_inner).pop();
            let mut desk = free.unwrap_or_else(|| [Layer::new(self.dims), Layer::new(self.dims)]);
            self.write_slab(slab, &counts, &mut desk);
            desks.lock().unwrap_or_else(PoisonError::into_inner).push(desk);
            exec.observer().advance(TASK, layers);
            Ok::<(), Error>(())
        })?;
        Ok(Surface { keys: bytemuck::cast_vec(keys), places, triangles: corners })
    }

    fn count_layer(&self, z: usize) -> Count {
        let mut count = Count::default();
        for y in 0..=self.dims[1] {
            let cells = CellRow::new(self.signs, y, z);
            if cells.is_empty() {
                continue;
            }
            let start = if count.rows.is_empty() { y } else { count.rows.start };
            count.rows = start..y + 1;
            let (mut vertices, mut triangles) = (0, 0);
            for k in cells.words() {
                let [x, y, z] = cells.crossed(k);
                vertices += x.count_ones() + y.count_ones() + z.count_ones();
            }
            count.vertices += u64::from(vertices);
            cells.each_active(|x, case| {
                triangles += if let Some(simple) = self.simple.get(case) {
                    u64::from(simple.count)
                } else {
                    let id = Cell { dims: self.dims, first: [x, y, z] }.crossing(self.samples, case);
                    count.open.push(id);
                    let own = CASES.fans(id).len();
                    if own > 0 {
                        count.vertices += own as u64;
                        count.centres.push(Centre { at: [x as u32, y as u32], id });
                    }
                    CASES.triangles(id).len() as u64
                };
            });
            count.triangles += triangles;
        }
        count
    }

    fn write_slab(&self, slab: Slab<'_>, counts: &[Count], desk: &mut Desk) {
        let Slab { layers, first, mut keys, mut places, mut triangles } = slab;
        let [here, above] = desk;
        let nothing = Count::default();
        let (mut next, end) = (first, layers.end);
        for z in layers.start..=end {
            let count = counts.get(z).unwrap_or(&nothing);
            let below = z.checked_sub(1).filter(|below| layers.contains(below)).map(|z| &counts[z]);
            let below = below.unwrap_or(&nothing);
            let mut open = below.open.iter().copied();
            // A row of triangles follows two rows of vertices, so that these are at hand.
            let rows = match [&count.rows, &below.rows] {
                [rows, none] if none.is_empty() => rows.clone(),
                [none, rows] if none.is_empty() => rows.start..rows.end + 1,
                [a, b] => a.start.min(b.start)..a.end.max(b.end + 1),
            };
            for y in rows {
                if count.rows.contains(&y) {
                    let cells = CellRow::new(self.signs, y, z);
                    let row = VoxelRow::new(self.samples, cells, self.dims, [y, z], count.centres(y));
                    // The layer above the last one is numbered for its triangles only.
                    let len = if z < end {
                        let len = row.place(next, above, keys, places);
                        (keys, places) = (&mut keys[len..], &mut places[len..]);
                        len
                    } else {
                        row.number(next, above)
                    };
                    next += len as u32;
                }
                if let Some(y) = y.checked_sub(1).filter(|y| below.rows.contains(y)) {
                    let len = self.face_row(y, z - 1, [here, above], &mut open, triangles);
                    triangles = &mut triangles[len..];
                }
            }
            std::mem::swap(here, above);
        }
    }

    /// Puts the triangles of a row of cells at the start of `faces`; returns how many there are.
    fn face_row(
        &self,
        y: usize,
        z: usize,
        [here, above]: [&Layer; 2],
        open: &mut impl Iterator<Item = CrossingId>,
        faces: &mut [[u32; 3]],
    ) -> usize {
        let cells = CellRow::new(self.signs, y, z);
        let rows = [here.row(y), here.row(y + 1), above.row(y), above.row(y + 1)];
        let mut len = 0;
        cells.each_active(|x, case| {
            let vertex = vertices_of_cell(rows, x);
            let at = |corners: &[u8; 3]| [0, 1, 2].map(|k| vertex[usize::from(corners[k] & 15)]);
            if let Some(simple) = self.simple.get(case) {
                let [p, q, r, s] = &simple.triangles;
                let count = usize::from(simple.count);
                if let Some(room) = faces[len..].first_chunk_mut::<4>() {
                    // Three are put in any case: those after the cell's take the place of what isn't one of them.
                    [room[0], room[1], room[2]] = [at(p), at(q), at(r)];
                    if count == 4 {
                        room[3] = at(s);
                    }
                } else {
                    let room = faces[len..].iter_mut().zip(&simple.triangles[..count]);
                    room.for_each(|(to, corners)| *to = at(corners));
                }
                len += count;
            } else {
                let id = open.next().expect("as counted");
                for corners in CASES.triangles(id) {
                    let [a, b, c] = at(corners);
                    faces[len] = if self.flip { [a, c, b] } else { [a, b, c] };
                    len += 1;
                }
            }
        });
        len
    }

    /// The layers in slabs of about the same work, each with its part of the output.
    fn slabs<'a>(
        &self,
        counts: &[Count],
        mut keys: &'a mut [u64],
        mut places: &'a mut [[f32; 3]],
        mut triangles: &'a mut [[u32; 3]],
    ) -> Vec<Slab<'a>> {
        let all: u64 = counts.iter().map(|count| count.cost(self.dims)).sum();
        let share = all / (SLABS * rayon::current_num_threads()) as u64;
        let mut slabs = Vec::new();
        let (mut start, mut first) = (0, 0);
        let (mut cost, mut vertices, mut faces) = (0, 0, 0);
        for (z, count) in counts.iter().enumerate() {
            cost += count.cost(self.dims);
            vertices += count.vertices as usize;
            faces += count.triangles as usize;
            if cost >= share || z + 1 == counts.len() {
                slabs.push(Slab {
                    layers: start..z + 1,
                    first,
                    keys: keys.split_off_mut(..vertices).expect("as counted"),
                    places: places.split_off_mut(..vertices).expect("as counted"),
                    triangles: triangles.split_off_mut(..faces).expect("as counted"),
                });
                first += vertices as u32;
                start = z + 1;
                (cost, vertices, faces) = (0, 0, 0);
            }
        }
        slabs
    }
}

/// Vertex of each element of the cell at padded `x` between four rows: the twelve edges, then the cell's two; what stands
/// for an element without a vertex means nothing.
#[inline(always)]
fn vertices_of_cell(rows: [(&[Voxel], u32); 4], x: usize) -> [u32; 16] {
    let one = |r: usize, x: usize| rows[r].0[x].numbers(rows[r].1);
    let [a, b, c, d] = [one(0, x), one(0, x + 1), one(1, x), one(1, x + 1)];
    let [e, f, g] = [one(2, x), one(2, x + 1), one(3, x)];
    [a[0], c[0], e[0], g[0], a[1], b[1], e[1], f[1], a[2], b[2], c[2], d[2], a[3], a[3].wrapping_add(1), 0, 0]
}

/// The vertices of two layers of voxels, for whoever writes a slab.
type Desk = [Layer; 2];

/// A few layers and their part of the output.
struct Slab<'a> {
    layers: Range<usize>,
    /// Index of the slab's first vertex.
    first: u32,
    keys: &'a mut [u64],
    places: &'a mut [[f32; 3]],
    triangles: &'a mut [[u32; 3]],
}
