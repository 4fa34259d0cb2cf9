//! Extraction in passes, as in Flying Edges (Schroeder, Maynard and Geveci 2015): signs, counts, sums, triangles.
//!
//! The signs of all voxels are read into bits. Counting the vertices and triangles of each layer of cells then gives
//! every layer its place in the output, so that layers are written independently and in any order. The work is by
//! words of 32 cells; only cells with both signs are looked at one by one.

use std::ops::Range;

use ivd_core::{ElementKey, Exec};
use rayon::prelude::*;

use super::Surface;
use super::directory::{Directory, Row};
use super::place::Cell;
use super::samples::Samples;
use super::signs::Signs;
use super::table::CASES;
use crate::Error;

/// Layers that one task writes: enough to make up for filling in one directory more than it has layers.
const SLAB: usize = 8;

/// Task name for observers.
const TASK: &str = "extract";

/// What a layer of cells adds to the lattice.
#[derive(Debug, Default)]
struct Count {
    vertices: u64,
    triangles: u64,
    /// Padded `[x, y]` of the cells with a vertex of their own, ascending by row, then place; twice those with two.
    centres: Vec<[u32; 2]>,
}

/// The input of every pass.
struct Sweep<'a, S> {
    samples: &'a S,
    signs: &'a Signs,
    dims: [usize; 3],
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
    let sweep = Sweep { samples, signs, dims, flip };
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
        exec.check_memory("the lattice", Signs::bytes(self.dims) + vertices * 20 + triangles * 12)?;

        let mut keys = vec![0_u64; vertices as usize];
        let mut places = vec![[0.0_f32; 3]; vertices as usize];
        let mut corners = vec![[0_u32; 3]; triangles as usize];
        slabs(&counts, &mut keys, &mut places, &mut corners).into_par_iter().try_for_each(|slab| {
            exec.check_cancelled()?;
            let layers = slab.layers.len() as u64;
            self.write_slab(slab, &counts);
            exec.observer().advance(TASK, layers);
            Ok::<(), Error>(())
        })?;
        Ok(Surface { keys: bytemuck::cast_vec(keys), places, triangles: corners })
    }

    /// Calls `visit` for each cell of a row of cells that has corners of both signs, in order.
    #[inline(always)]
    fn each_active_cell(&self, z: usize, y: usize, mut visit: impl FnMut(usize, u8)) {
        let rows = [(y, z), (y + 1, z), (y, z + 1), (y + 1, z + 1)].map(|(y, z)| self.signs.row(y, z));
        for k in 0..rows[0].len() - 1 {
            let bits = rows.map(|row| u64::from(row[k]) | u64::from(row[k + 1]) << 32);
            let any = bits[0] | bits[1] | bits[2] | bits[3];
            let all = bits[0] & bits[1] & bits[2] & bits[3];
            let mut active = ((any | any >> 1) & !(all & all >> 1)) as u32;
            while active != 0 {
                let b = active.trailing_zeros();
                active &= active - 1;
                let pair = |r: usize| (bits[r] >> b) as u8 & 3;
                visit(32 * k + b as usize, pair(0) | pair(1) << 2 | pair(2) << 4 | pair(3) << 6);
            }
        }
    }

    fn count_layer(&self, z: usize) -> Count {
        let mut count = Count::default();
        for y in 0..=self.dims[1] {
            let (mut vertices, mut triangles) = (0, 0);
            self.each_active_cell(z, y, |x, case| {
                let id = Cell { dims: self.dims, first: [x, y, z] }.crossing(self.samples, case);
                let (here, centres) = CASES.counts(id);
                vertices += OWN_EDGES[usize::from(case)].count_ones();
                triangles += u64::from(here);
                for _ in 0..centres {
                    count.centres.push([x as u32, y as u32]);
                }
            });
            count.vertices += u64::from(vertices);
            count.triangles += triangles;
        }
        count.vertices += count.centres.len() as u64;
        count
    }

    fn write_slab(&self, slab: Slab<'_>, counts: &[Count]) {
        let (mut here, mut above) = (Directory::default(), Directory::default());
        let mut first = slab.first;
        let mut vertices = slab.keys.iter_mut().zip(slab.places);
        let mut triangles = slab.triangles.iter_mut();
        let nothing = Count::default();
        here.fill(self.signs, self.dims, slab.layers.start, first, &counts[slab.layers.start].centres);
        for z in slab.layers {
            first += counts[z].vertices as u32;
            let next = counts.get(z + 1).unwrap_or(&nothing);
            above.fill(self.signs, self.dims, z + 1, first, &next.centres);
            for y in 0..=self.dims[1] {
                let rows = [here.row(y), here.row(y + 1), above.row(y), above.row(y + 1)];
                let first_key = ElementKey::new(self.dims, [0, y, z], 0).0;
                let own = OwnVertices::new(self.samples, self.dims, y, z);
                self.each_active_cell(z, y, |x, case| {
                    let cell = Cell { dims: self.dims, first: [x, y, z] };
                    let id = cell.crossing(self.samples, case);
                    let mut put = |element: u64, place: [f32; 3]| {
                        if let Some((key, at)) = vertices.next() {
                            (*key, *at) = (first_key + 8 * x as u64 + element, place);
                        }
                    };
                    own.write(x, OWN_EDGES[usize::from(case)], &mut put);
                    for (element, fan) in (6..).zip(CASES.fans(id)) {
                        put(element, cell.centre_place(self.samples, fan));
                    }
                    let vertex = vertices_of_cell(rows, x);
                    for (&corners, triangle) in CASES.triangles(id).iter().zip(triangles.by_ref()) {
                        let [a, b, c] = corners.map(|e| vertex[usize::from(e & 15)]);
                        *triangle = if self.flip { [a, c, b] } else { [a, b, c] };
                    }
                });
            }
            std::mem::swap(&mut here, &mut above);
        }
    }
}

/// Which of the three edges that start at a cell's first corner are crossed, a bit each, by case.
static OWN_EDGES: [u8; 256] = own_edges();

const fn own_edges() -> [u8; 256] {
    let mut edges = [0; 256];
    let mut case = 0;
    while case < 256 {
        let here = case as u8;
        edges[case] =
            ((here ^ here >> 1) & 1) | ((here ^ here >> 2) & 1) << 1 | ((here ^ here >> 4) & 1) << 2;
        case += 1;
    }
    edges
}

/// Places the vertices on the edges that start at the voxels of one padded row.
struct OwnVertices<'a, S> {
    samples: &'a S,
    /// The voxel at padded `x` of this row is `start + x - border`, where that isn't in the border layer.
    start: usize,
    border: usize,
    /// For each axis the step to the next voxel and the `x` between which its edges have two real voxels.
    steps: [usize; 3],
    real: [Range<usize>; 3],
}

impl<'a, S: Samples> OwnVertices<'a, S> {
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

    /// Hands element and place of the crossed edges at padded `x` to `put`, in order.
    #[inline(always)]
    fn write(&self, x: usize, edges: u8, put: &mut impl FnMut(u64, [f32; 3])) {
        for axis in (0..3).filter(|axis| edges >> axis & 1 == 1) {
            let mut place = [0.0; 3];
            place[axis] = if self.real[axis].contains(&x) {
                let voxel = self.start + x - self.border;
                self.samples.crossing(voxel, voxel + self.steps[axis])
            } else {
                0.5
            };
            put(axis as u64, place);
        }
    }
}

/// Vertex of each element of the cell at padded `x` between four rows: the twelve edges, then the cell's two; what stands
/// for an element without a vertex means nothing.
#[inline(always)]
fn vertices_of_cell(rows: [Row<'_>; 4], x: usize) -> [u32; 16] {
    let [[a, b], [c, d], [e, f]] = [rows[0].pair(x), rows[1].pair(x), rows[2].pair(x)];
    let g = rows[3].voxel(x);
    [
        a.first,
        c.first,
        e.first,
        g.first,
        a.y(),
        b.y(),
        e.y(),
        f.y(),
        a.z(),
        b.z(),
        c.z(),
        d.z(),
        a.cell(),
        a.cell() + 1,
        0,
        0,
    ]
}

/// A few layers and their part of the output.
struct Slab<'a> {
    layers: Range<usize>,
    /// Index of the slab's first vertex.
    first: u32,
    keys: &'a mut [u64],
    places: &'a mut [[f32; 3]],
    triangles: &'a mut [[u32; 3]],
}

fn slabs<'a>(
    counts: &[Count],
    mut keys: &'a mut [u64],
    mut places: &'a mut [[f32; 3]],
    mut triangles: &'a mut [[u32; 3]],
) -> Vec<Slab<'a>> {
    let mut slabs = Vec::new();
    let mut first = 0;
    for (s, counts) in counts.chunks(SLAB).enumerate() {
        let vertices: usize = counts.iter().map(|c| c.vertices as usize).sum();
        let faces: usize = counts.iter().map(|c| c.triangles as usize).sum();
        let (own_keys, rest_keys) = keys.split_at_mut(vertices);
        let (own_places, rest_places) = places.split_at_mut(vertices);
        let (own_triangles, rest_triangles) = triangles.split_at_mut(faces);
        (keys, places, triangles) = (rest_keys, rest_places, rest_triangles);
        let layers = s * SLAB..s * SLAB + counts.len();
        slabs.push(Slab { layers, first, keys: own_keys, places: own_places, triangles: own_triangles });
        first += vertices as u32;
    }
    slabs
}
