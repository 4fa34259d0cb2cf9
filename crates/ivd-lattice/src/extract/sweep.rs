//! Extraction in passes, as in Flying Edges (Schroeder, Maynard and Geveci 2015): signs, counts, sums, triangles.
//!
//! The signs of all voxels are read into bits. Counting the vertices and triangles of each layer of cells then gives
//! every layer its place in the output, so that layers are written independently and in any order. The work is by
//! words of 32 cells between the first and the last voxel inside; only cells with both signs are looked at one by one.

use std::ops::Range;
use std::sync::{Mutex, PoisonError};

use ivd_core::{Exec, parallel};

use super::place::Cell;
use super::rows::CellRow;
use super::samples::Samples;
use super::signs::Signs;
use super::surface::Surface;
use super::table::{CASES, CrossingId, Simple};
use super::vertices::{Centre, Layer, Voxel, VoxelRow};
use crate::Error;

/// Slabs of layers for each thread: enough to share out the work, few beside the layers, as each numbers one more.
const SLABS_PER_THREAD: usize = 6;

/// Layers that are counted before it is asked whether there is room for what they hold.
const BATCH: usize = 128;

/// Task name for observers.
const TASK: &str = "extract";

/// What a layer of cells adds to the lattice.
#[derive(Debug, Default)]
struct Count {
    vertices: u64,
    triangles: u64,
    /// Vertices of the row that has most.
    longest_row: u32,
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

    /// Bytes that it takes.
    fn bytes(&self) -> u64 {
        let lists = size_of_val(&self.open[..]) + size_of_val(&self.centres[..]);
        (size_of::<Self>() + lists) as u64
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

/// Memory of sweeps before, for the next one; what is in it means nothing.
#[derive(Debug, Default)]
pub(super) struct Spare {
    desks: Vec<Desk>,
    pub(super) surface: Surface,
}

impl Spare {
    /// Most bytes of the vectors that a surface of so many vertices and triangles is written to.
    fn bytes(&self, vertices: u64, triangles: u64) -> u64 {
        let Surface { keys, places, triangles: corners } = &self.surface;
        let larger = |need: u64, have: usize| need.max(have as u64);
        8 * larger(vertices, keys.capacity())
            + 12 * larger(vertices, places.capacity())
            + 12 * larger(triangles, corners.capacity())
    }

    /// Vectors of these lengths, of what is there where that is enough; their contents mean nothing.
    fn surface(&mut self, vertices: usize, triangles: usize) -> (Vec<u64>, Vec<[f32; 3]>, Vec<[u32; 3]>) {
        let Surface { keys, places, triangles: corners } = std::mem::take(&mut self.surface);
        (
            of_length(bytemuck::cast_vec(keys), vertices),
            of_length(places, vertices),
            of_length(corners, triangles),
        )
    }
}

/// The vector with another length; one that is too small is given up first, so that both are never held.
fn of_length<T: bytemuck::Zeroable + Copy>(mut spare: Vec<T>, len: usize) -> Vec<T> {
    if spare.capacity() < len {
        drop(spare);
        return bytemuck::zeroed_vec(len);
    }
    spare.resize(len, T::zeroed());
    spare
}

/// The surface of `samples`, whose signs are `signs`, on a grid of `dims` voxels, in the memory of `spare`. `flip` turns every
/// triangle over (left-handed grids).
pub(super) fn extract<S: Samples>(
    samples: &S,
    signs: &Signs,
    dims: [usize; 3],
    flip: bool,
    spare: &mut Spare,
    exec: &Exec,
) -> Result<Surface, Error> {
    let sweep = Sweep { samples, signs, dims, simple: &CASES.simple[usize::from(flip)], flip };
    let layers = dims[2] + 1;
    exec.observer().begin(TASK, 2 * layers as u64);
    let surface = sweep.run(layers, spare, exec);
    exec.observer().end(TASK);
    surface
}

impl<S: Samples> Sweep<'_, S> {
    fn run(&self, layers: usize, spare: &mut Spare, exec: &Exec) -> Result<Surface, Error> {
        let counts = self.count(layers, exec)?;
        let vertices: u64 = counts.iter().map(|c| c.vertices).sum();
        let triangles: u64 = counts.iter().map(|c| c.triangles).sum();
        let slabs = self.slabs(&counts);
        let desks = rayon::current_num_threads().min(slabs.len()) * 2 * Layer::bytes(self.dims);
        let held = Signs::bytes(self.dims) + counts.iter().map(Count::bytes).sum::<u64>() + desks as u64;
        exec.check_memory("the lattice", held + spare.bytes(vertices, triangles))?;

        let (mut keys, mut places, mut corners) = spare.surface(vertices as usize, triangles as usize);
        let slabs = shared_out(slabs, &counts, &mut keys, &mut places, &mut corners);
        spare.desks.retain(|[layer, _]| layer.fits(self.dims));
        let desks = Mutex::new(std::mem::take(&mut spare.desks));
        parallel::try_for_each_of(slabs, &|slab| {
            let free = desks.lock().unwrap_or_else(PoisonError::into_inner).pop();
            let mut desk = free.unwrap_or_else(|| [Layer::new(self.dims), Layer::new(self.dims)]);
            self.write_slab(slab, &counts, &mut desk, exec)?;
            desks.lock().unwrap_or_else(PoisonError::into_inner).push(desk);
            Ok::<(), Error>(())
        })?;
        spare.desks = desks.into_inner().unwrap_or_else(PoisonError::into_inner);
        Ok(Surface { keys: bytemuck::cast_vec(keys), places, triangles: corners })
    }

    /// What each layer adds, if there is room for it.
    fn count(&self, layers: usize, exec: &Exec) -> Result<Vec<Count>, Error> {
        let mut counts: Vec<Count> = Vec::with_capacity(layers);
        let (mut vertices, mut bytes) = (0, Signs::bytes(self.dims));
        for start in (0..layers).step_by(BATCH) {
            let batch: Vec<Count> = parallel::try_map(BATCH.min(layers - start), &|i| {
                exec.check_cancelled()?;
                let count = self.count_layer(start + i);
                exec.observer().advance(TASK, 1);
                Ok::<_, ivd_core::Error>(count)
            })?;
            vertices += batch.iter().map(|c| c.vertices).sum::<u64>();
            bytes += batch.iter().map(Count::bytes).sum::<u64>();
            if vertices > u64::from(u32::MAX) || batch.iter().any(|c| c.longest_row >= Voxel::MOST) {
                return Err(Error::TooManyVertices { vertices });
            }
            exec.check_memory("the layers of the lattice", bytes)?;
            counts.extend(batch);
        }
        Ok(counts)
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
                        vertices += own as u32;
                        count.centres.push(Centre { at: [x as u32, y as u32], id });
                    }
                    CASES.triangles(id).len() as u64
                };
            });
            count.triangles += triangles;
            count.longest_row = count.longest_row.max(vertices);
        }
        count
    }

    fn write_slab(
        &self,
        slab: Slab<'_>,
        counts: &[Count],
        desk: &mut Desk,
        exec: &Exec,
    ) -> Result<(), Error> {
        let Slab { layers, first, mut keys, mut places, mut triangles } = slab;
        let [here, above] = desk;
        let nothing = Count::default();
        let (mut next, end) = (first, layers.end);
        for z in layers.start..=end {
            exec.check_cancelled()?;
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
            if z < end {
                exec.observer().advance(TASK, 1);
            }
        }
        Ok(())
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

    /// The layers in slabs of about the same work.
    fn slabs(&self, counts: &[Count]) -> Vec<Range<usize>> {
        let all: u64 = counts.iter().map(|count| count.cost(self.dims)).sum();
        let share = all / (SLABS_PER_THREAD * rayon::current_num_threads()) as u64;
        let mut slabs = Vec::new();
        let (mut start, mut cost) = (0, 0);
        for (z, count) in counts.iter().enumerate() {
            cost += count.cost(self.dims);
            if cost >= share || z + 1 == counts.len() {
                slabs.push(start..z + 1);
                (start, cost) = (z + 1, 0);
            }
        }
        slabs
    }
}

/// Each slab with its part of the output.
fn shared_out<'a>(
    slabs: Vec<Range<usize>>,
    counts: &[Count],
    mut keys: &'a mut [u64],
    mut places: &'a mut [[f32; 3]],
    mut triangles: &'a mut [[u32; 3]],
) -> Vec<Slab<'a>> {
    let mut first = 0;
    let share = |layers: Range<usize>| {
        let vertices: usize = counts[layers.clone()].iter().map(|count| count.vertices as usize).sum();
        let faces: usize = counts[layers.clone()].iter().map(|count| count.triangles as usize).sum();
        let slab = Slab {
            layers,
            first,
            keys: keys.split_off_mut(..vertices).expect("as counted"),
            places: places.split_off_mut(..vertices).expect("as counted"),
            triangles: triangles.split_off_mut(..faces).expect("as counted"),
        };
        first += vertices as u32;
        slab
    };
    slabs.into_iter().map(share).collect()
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
