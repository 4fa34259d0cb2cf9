//! The edges of a minimum spanning forest of the voxels and few others, in the order of their differences.
//!
//! The heaviest edge of a cycle is in no minimum spanning forest, so an edge that a block of voxels can do without, the whole
//! volume can do without (as in the distributed algorithms after Borůvka; filter-Kruskal, Osipov, Sanders & Singler 2009).
//! Each block is small enough to stay close to the processor, and blocks don't wait for one another.

use ivd_core::{Error, Exec, SpillVec, parallel, sets};

use super::field::{Apart, Block, Field, blocks};

/// Voxels of a block along each axis; a voxel's place in it takes 13 bits, an edge's 15.
const BLOCK: [usize; 3] = [32, 16, 16];
const PLACES: usize = 32 * 16 * 16;
/// Blocks that are worked on before their edges are put together.
const BATCH: usize = 256;
/// Most buckets of the sort. More of them would each have their own page, and fewer would be longer to sort.
const BUCKETS: u32 = 1 << 12;
/// Edges that one task counts.
const CHUNK: usize = 1 << 18;

/// Edges of a minimum spanning forest and few others, ascending in their difference; of equal ones, in the order of blocks.
pub(super) struct Edges {
    ids: SpillVec<u32>,
    len: usize,
}

impl Edges {
    pub(super) fn ids(&self) -> &[u32] {
        &self.ids[..self.len]
    }
}

pub(super) fn edges<T: Apart>(field: &Field<'_, T>, exec: &Exec) -> Result<Edges, Error> {
    let (found, len, largest) = gather(field, exec)?;
    let found = &found[..len];
    let shift = (32 - largest.leading_zeros()).saturating_sub(BUCKETS.ilog2());
    let buckets = (largest >> shift) as usize + 1;
    let mut starts = vec![0_usize; buckets + 1];
    for part in parallel::map_pieces(len, CHUNK, &|piece| count(field, &found[piece], shift, buckets)) {
        starts[1..].iter_mut().zip(&part).for_each(|(start, n)| *start += *n as usize);
    }
    (0..buckets).for_each(|b| starts[b + 1] += starts[b]);
    exec.check_cancelled()?;
    let mut ids = exec.bulk("the sorted edges", len)?;
    let mut next = starts.clone();
    for part in found.chunks(CHUNK) {
        exec.check_cancelled()?;
        for &edge in part {
            let place = &mut next[(field.key(edge) >> shift) as usize];
            ids[*place] = edge;
            *place += 1;
        }
    }
    if shift > 0 || !T::EXACT {
        sort_buckets(field, &mut ids, &starts, exec)?;
    }
    Ok(Edges { ids, len })
}

fn count<T: Apart>(field: &Field<'_, T>, edges: &[u32], shift: u32, buckets: usize) -> Vec<u32> {
    let mut counts = vec![0_u32; buckets];
    for edge in edges {
        counts[(field.key(*edge) >> shift) as usize] += 1;
    }
    counts
}

fn sort_buckets<T: Apart>(
    field: &Field<'_, T>,
    ids: &mut [u32],
    starts: &[usize],
    exec: &Exec,
) -> Result<(), Error> {
    let mut rest = ids;
    let mut parts = Vec::with_capacity(starts.len());
    for w in starts.windows(2) {
        let (part, after) = rest.split_at_mut(w[1] - w[0]);
        parts.push(part);
        rest = after;
    }
    parallel::try_for_each_of(parts, &|part| {
        exec.check_cancelled()?;
        // Differences aren't negative: their bits ascend with them.
        let mut keyed: Vec<(u64, u32)> = part.iter().map(|e| (field.apart(*e).to_bits(), *e)).collect();
        keyed.sort_by_key(|(apart, _)| *apart);
        part.iter_mut().zip(&keyed).for_each(|(edge, (_, sorted))| *edge = *sorted);
        Ok(())
    })
}

/// The edges that the blocks keep, block after block, their number and the largest key.
fn gather<T: Apart>(field: &Field<'_, T>, exec: &Exec) -> Result<(SpillVec<u32>, usize, u32), Error> {
    let blocks = blocks(field.dims, BLOCK);
    let mut found: SpillVec<u32> = exec.bulk("the edges of the voxels", most(field.dims, &blocks))?;
    let (mut len, mut largest) = (0, 0);
    for batch in blocks.chunks(BATCH) {
        exec.check_cancelled()?;
        let parts: Vec<(Vec<u32>, u32)> =
            parallel::try_map_with(batch.len(), &Scratch::default, &|scratch, i| {
                Ok::<_, Error>(scratch.keep(field, batch[i]))
            })?;
        for (part, key) in &parts {
            found[len..len + part.len()].copy_from_slice(part);
            len += part.len();
            largest = largest.max(*key);
        }
    }
    Ok((found, len, largest))
}

/// Most edges that the blocks can keep: a tree in each, and all between them.
fn most(dims: [usize; 3], blocks: &[Block]) -> usize {
    let edges = |size: [usize; 3]| -> usize {
        let all: usize = size.iter().product();
        size.iter().map(|n| all / n.max(&1) * n.saturating_sub(1)).sum()
    };
    let kept: usize = blocks.iter().map(|b| edges(b.size) - (b.size.iter().product::<usize>() - 1)).sum();
    edges(dims) - kept
}

/// What a task needs for a block.
struct Scratch {
    sets: Vec<u16>,
    keep: Vec<bool>,
    keyed: Vec<u64>,
    other: Vec<u64>,
}

impl Default for Scratch {
    fn default() -> Self {
        Self { sets: vec![0; PLACES], keep: vec![false; 3 * PLACES], keyed: Vec::new(), other: Vec::new() }
    }
}

/// From a place in a block to the next one along each axis.
const STEPS: [usize; 3] = [1, BLOCK[0], BLOCK[0] * BLOCK[1]];

impl Scratch {
    fn keep<T: Apart>(&mut self, field: &Field<'_, T>, block: Block) -> (Vec<u32>, u32) {
        self.keep.fill(false);
        let mut kept = self.list(field, block);
        self.sort();
        if !T::EXACT {
            self.settle(field, block);
        }
        self.sets.iter_mut().enumerate().for_each(|(i, set)| *set = i as u16);
        let mut largest = 0;
        for i in 0..self.keyed.len() {
            let edge = self.keyed[i] as usize & 0xffff;
            let (a, b) = (edge / 3, edge / 3 + STEPS[edge % 3]);
            if self.join(a as u16, b as u16) {
                self.keep[edge] = true;
                kept += 1;
                largest = largest.max((self.keyed[i] >> 16) as u32);
            }
        }
        let mut edges = Vec::with_capacity(kept);
        for edge in (0..3 * PLACES).filter(|edge| self.keep[*edge]) {
            edges.push(global(field, block, edge));
        }
        // Edges to other blocks have no key yet.
        let between = edges.iter().map(|e| field.key(*e)).max().unwrap_or(0);
        (edges, largest.max(between))
    }

    /// Lists the edges within a block with their keys, in the order of their places; keeps those that leave it, and counts them.
    fn list<T: Apart>(&mut self, field: &Field<'_, T>, block: Block) -> usize {
        self.keyed.clear();
        let mut leaving = 0;
        let Block { start, size } = block;
        for z in 0..size[2] {
            for y in 0..size[1] {
                let row = start[0] + field.steps[1] * (start[1] + y) + field.steps[2] * (start[2] + z);
                let place = STEPS[1] * y + STEPS[2] * z;
                for x in 0..size[0] {
                    if !field.present(row + x) {
                        continue;
                    }
                    for (axis, at) in [x, y, z].into_iter().enumerate() {
                        let next = row + x + field.steps[axis];
                        if start[axis] + at + 1 == field.dims[axis] || !field.present(next) {
                            continue;
                        }
                        let edge = 3 * (place + x) + axis;
                        if at + 1 == size[axis] {
                            self.keep[edge] = true;
                            leaving += 1;
                        } else {
                            let key = field.voxels[row + x].key(field.voxels[next]);
                            self.keyed.push(u64::from(key) << 16 | edge as u64);
                        }
                    }
                }
            }
        }
        leaving
    }

    /// Sorts the edges by key, a byte at a time; equal keys stay in the order of their places.
    fn sort(&mut self) {
        let largest = self.keyed.iter().max().map_or(0, |k| k >> 16);
        let mut shift = 16;
        while largest >> (shift - 16) > 0 {
            let mut next = [0_u32; 256];
            self.keyed.iter().for_each(|k| next[(k >> shift) as usize & 255] += 1);
            let mut sum = 0;
            for n in &mut next {
                (*n, sum) = (sum, sum + *n);
            }
            self.other.resize(self.keyed.len(), 0);
            for k in &self.keyed {
                let place = &mut next[(k >> shift) as usize & 255];
                self.other[*place as usize] = *k;
                *place += 1;
            }
            std::mem::swap(&mut self.keyed, &mut self.other);
            shift += 8;
        }
    }

    /// Sorts edges of equal keys by what the keys rounded away.
    fn settle<T: Apart>(&mut self, field: &Field<'_, T>, block: Block) {
        let exact = |k: u64| field.apart(global(field, block, k as usize & 0xffff)).to_bits();
        for run in self.keyed.chunk_by_mut(|a, b| a >> 16 == b >> 16).filter(|run| run.len() > 1) {
            run.sort_by_key(|k| exact(*k));
        }
    }

    /// As [`sets::join`], in half the bytes and without a branch: blocks are joined where most of the time goes, and their sets fit the
    /// nearest cache.
    #[inline(always)]
    fn join(&mut self, a: u16, b: u16) -> bool {
        let (a, b) = (self.root(a), self.root(b));
        self.sets[usize::from(a.max(b))] = a.min(b);
        a != b
    }

    #[inline(always)]
    fn root(&mut self, mut at: u16) -> u16 {
        loop {
            let above = self.sets[usize::from(at)];
            if above == at {
                return at;
            }
            let next = self.sets[usize::from(above)];
            self.sets[usize::from(at)] = next;
            at = next;
        }
    }
}

/// An edge of the volume, of an edge of a block.
#[inline(always)]
fn global<T>(field: &Field<'_, T>, block: Block, edge: usize) -> u32 {
    let place = edge / 3;
    let at = [place % BLOCK[0], place / BLOCK[0] % BLOCK[1], place / STEPS[2]];
    let voxel: usize = (0..3).map(|axis| field.steps[axis] * (block.start[axis] + at[axis])).sum();
    (3 * voxel + edge % 3) as u32
}

/// Joins the voxels that edges up to a height (real units) connect. Gives the leaf of each voxel, 1…, in the order of their
/// first voxels, 0 for no data; the number of leaves; and the number of edges that were used.
pub(super) fn zones<T: Apart>(
    field: &Field<'_, T>,
    edges: &[u32],
    alpha: f64,
    exec: &Exec,
) -> Result<(SpillVec<u32>, usize, usize), Error> {
    let flat = edges.partition_point(|e| field.height(*e) <= alpha);
    let mut leaves: SpillVec<u32> = exec.bulk("the leaves of the voxels", field.voxels.len())?;
    sets::reset(&mut leaves);
    for part in edges[..flat].chunks(CHUNK) {
        exec.check_cancelled()?;
        for &edge in part {
            let [a, b] = field.ends(edge);
            sets::join(&mut leaves, a as u32, b as u32);
        }
    }
    let mut count = 0;
    for voxel in 0..leaves.len() {
        if voxel % CHUNK == 0 {
            exec.check_cancelled()?;
        }
        // A set's members follow the one that stands for it, which has its leaf by now.
        let above = leaves[voxel] as usize;
        leaves[voxel] = if above < voxel {
            leaves[above]
        } else if field.present(voxel) {
            count += 1;
            count
        } else {
            0
        };
    }
    Ok((leaves, count as usize, flat))
}
