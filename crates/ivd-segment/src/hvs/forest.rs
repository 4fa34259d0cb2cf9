//! The edges of a minimum spanning forest of the voxels and few others, in the order of their differences.
//!
//! The heaviest edge of a cycle is in no minimum spanning forest, so an edge that a block of voxels can do without, the whole
//! volume can do without (as in the distributed algorithms after Borůvka; filter-Kruskal, Osipov, Sanders & Singler 2009).
//! Each block is small enough to stay close to the processor, and blocks don't wait for one another.

use std::ops::Range;

use ivd_core::{Error, Exec, SpillVec, parallel, sets};

use super::field::{Apart, Block, Field, blocks};

/// Voxels of a block along each axis; a voxel's place in it takes 13 bits, an edge's 15.
const BLOCK: [usize; 3] = [32, 16, 16];
const PLACES: usize = 32 * 16 * 16;
/// Blocks that are worked on before their edges are put together.
const BATCH: usize = 256;
/// Bits of the number of buckets of the sort, of keys that are exact: one for each difference of 16-bit values, so that nothing is
/// left to sort. Most edges of a scan fall into few of them.
const EXACT_BITS: u32 = 16;
/// The same of other keys. More buckets would each have their own page, and fewer would be longer to sort.
const ROUNDED_BITS: u32 = 12;
/// Edges or voxels between two looks at whether to stop.
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

    pub(super) fn ids_mut(&mut self) -> &mut [u32] {
        &mut self.ids[..self.len]
    }
}

pub(super) fn edges<T: Apart>(field: &Field<'_, T>, exec: &Exec) -> Result<Edges, Error> {
    let kept = gather(field, exec)?;
    let bits = if T::EXACT { EXACT_BITS } else { ROUNDED_BITS };
    let shift = (32 - kept.largest.leading_zeros()).saturating_sub(bits);
    let buckets = (kept.largest >> shift) as usize + 1;
    let mut starts = vec![0_usize; buckets + 1];
    let count = |batch| kept.count(field, batch, shift, buckets);
    for part in parallel::map_pieces(kept.blocks.len(), BATCH, &count) {
        starts[1..].iter_mut().zip(&part).for_each(|(start, n)| *start += *n as usize);
    }
    (0..buckets).for_each(|b| starts[b + 1] += starts[b]);
    let len = starts[buckets];
    exec.check_cancelled()?;
    let mut ids = exec.bulk("the sorted edges", len)?;
    let mut next = starts.clone();
    for block in 0..kept.blocks.len() {
        if block % BATCH == 0 {
            exec.check_cancelled()?;
        }
        kept.each(field, block, |edge| {
            let place = &mut next[(field.key(edge) >> shift) as usize];
            ids[*place] = edge;
            *place += 1;
        });
    }
    drop(kept);
    if shift > 0 || !T::EXACT {
        sort_buckets(field, &mut ids, &starts, shift, exec)?;
    }
    Ok(Edges { ids, len })
}

fn sort_buckets<T: Apart>(
    field: &Field<'_, T>,
    ids: &mut [u32],
    starts: &[usize],
    shift: u32,
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
        if T::EXACT && part.len() >> shift > 0 {
            count_out(field, part, shift);
            return Ok(());
        }
        // Differences aren't negative: their bits ascend with them.
        let mut keyed: Vec<(u64, u32)> = part.iter().map(|e| (field.apart(*e).to_bits(), *e)).collect();
        keyed.sort_by_key(|(apart, _)| *apart);
        part.iter_mut().zip(&keyed).for_each(|(edge, (_, sorted))| *edge = *sorted);
        Ok(())
    })
}

/// Sorts the edges of one bucket by the bits of their keys below `shift`, by counting; equal ones stay in their order. It takes a
/// quarter of the memory of a sort that compares.
fn count_out<T: Apart>(field: &Field<'_, T>, edges: &mut [u32], shift: u32) {
    let before = edges.to_vec();
    let bits = |edge: u32| (field.key(edge) & ((1 << shift) - 1)) as usize;
    let mut next = vec![0_u32; 1 << shift];
    for edge in &before {
        next[bits(*edge)] += 1;
    }
    let mut sum = 0;
    for n in &mut next {
        (*n, sum) = (sum, sum + *n);
    }
    for edge in before {
        let place = &mut next[bits(edge)];
        edges[*place as usize] = edge;
        *place += 1;
    }
}

/// A row of a block: for each axis, at which of its voxels an edge along the axis begins that is kept.
type Row = [u32; 3];

/// The edges that blocks keep, as bits: they are enumerated where they are wanted, in the order of the blocks and of the places in
/// each, as a list of them would take ten times as much.
struct Kept {
    blocks: Vec<Block>,
    rows: SpillVec<Row>,
    /// Where each block's rows start.
    starts: Vec<usize>,
    /// The largest key.
    largest: u32,
}

impl Kept {
    #[inline(always)]
    fn each<T>(&self, field: &Field<'_, T>, block: usize, mut tell: impl FnMut(u32)) {
        let Block { start, size } = self.blocks[block];
        let rows = &self.rows[self.starts[block]..self.starts[block + 1]];
        for (i, row) in rows.iter().enumerate() {
            let [y, z] = [start[1] + i % size[1], start[2] + i / size[1]];
            let first = start[0] + field.steps[1] * y + field.steps[2] * z;
            let mut left = row[0] | row[1] | row[2];
            while left != 0 {
                let x = left.trailing_zeros();
                left &= left - 1;
                let edge = 3 * (first + x as usize) as u32;
                for (axis, bits) in row.iter().enumerate() {
                    if bits >> x & 1 == 1 {
                        tell(edge + axis as u32);
                    }
                }
            }
        }
    }

    /// How many edges of some blocks fall into each bucket.
    fn count<T: Apart>(
        &self,
        field: &Field<'_, T>,
        batch: Range<usize>,
        shift: u32,
        buckets: usize,
    ) -> Vec<u32> {
        let mut counts = vec![0_u32; buckets];
        for block in batch {
            self.each(field, block, |edge| counts[(field.key(edge) >> shift) as usize] += 1);
        }
        counts
    }
}

fn gather<T: Apart>(field: &Field<'_, T>, exec: &Exec) -> Result<Kept, Error> {
    let blocks = blocks(field.dims, BLOCK);
    let mut starts = vec![0];
    for block in &blocks {
        starts.push(starts[starts.len() - 1] + block.size[1] * block.size[2]);
    }
    let mut rows: SpillVec<Row> = exec.bulk("the edges of the voxels", starts[blocks.len()])?;
    let mut largest = 0;
    for from in (0..blocks.len()).step_by(BATCH) {
        exec.check_cancelled()?;
        let batch = &blocks[from..(from + BATCH).min(blocks.len())];
        let parts: Vec<(Vec<Row>, u32)> =
            parallel::try_map_with(batch.len(), &Scratch::default, &|scratch, i| {
                Ok::<_, Error>(scratch.keep(field, batch[i]))
            })?;
        for (i, (part, key)) in parts.iter().enumerate() {
            rows[starts[from + i]..starts[from + i + 1]].copy_from_slice(part);
            largest = largest.max(*key);
        }
    }
    Ok(Kept { blocks, rows, starts, largest })
}

/// What a task needs for a block.
struct Scratch {
    sets: Vec<u16>,
    keep: Vec<Row>,
    keyed: Vec<u64>,
    other: Vec<u64>,
}

impl Default for Scratch {
    fn default() -> Self {
        let keep = vec![[0; 3]; PLACES / BLOCK[0]];
        Self { sets: vec![0; PLACES], keep, keyed: Vec::new(), other: Vec::new() }
    }
}

/// From a place in a block to the next one along each axis.
const STEPS: [usize; 3] = [1, BLOCK[0], BLOCK[0] * BLOCK[1]];

impl Scratch {
    /// The rows of a block, and the largest key of an edge in them.
    fn keep<T: Apart>(&mut self, field: &Field<'_, T>, block: Block) -> (Vec<Row>, u32) {
        self.keep.fill([0; 3]);
        let mut largest = self.list(field, block);
        self.sort();
        if !T::EXACT {
            self.settle(field, block);
        }
        self.sets.iter_mut().enumerate().for_each(|(i, set)| *set = i as u16);
        for i in 0..self.keyed.len() {
            let edge = self.keyed[i] as usize & 0xffff;
            let (place, axis) = (edge / 3, edge % 3);
            if self.join(place as u16, (place + STEPS[axis]) as u16) {
                self.keep[place / BLOCK[0]][axis] |= 1 << (place % BLOCK[0]);
                largest = largest.max((self.keyed[i] >> 16) as u32);
            }
        }
        let of_layer = |z: usize| &self.keep[BLOCK[1] * z..][..block.size[1]];
        ((0..block.size[2]).flat_map(of_layer).copied().collect(), largest)
    }

    /// Lists the edges within a block with their keys, in the order of their places; keeps those that leave it, and gives their
    /// largest key.
    fn list<T: Apart>(&mut self, field: &Field<'_, T>, block: Block) -> u32 {
        self.keyed.clear();
        let mut largest = 0;
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
                        let key = field.voxels[row + x].key(field.voxels[next]);
                        if at + 1 == size[axis] {
                            self.keep[place / BLOCK[0]][axis] |= 1 << x;
                            largest = largest.max(key);
                        } else {
                            let edge = 3 * (place + x) + axis;
                            self.keyed.push(u64::from(key) << 16 | edge as u64);
                        }
                    }
                }
            }
        }
        largest
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
    sets::name(
        &mut leaves,
        || exec.check_cancelled(),
        |voxel| {
            let present = field.present(voxel);
            count += u32::from(present);
            if present { count } else { 0 }
        },
    )?;
    Ok((leaves, count as usize, flat))
}

#[cfg(test)]
mod tests {
    use super::*;
    use ivd_core::{Grid, Volume, Voxels, noise};

    fn ramp(dims: [usize; 3], values: u64) -> Vec<u16> {
        (0..dims.iter().product()).map(|i: usize| noise::below(3, i as u64, values) as u16).collect()
    }

    /// The edges of each block as the rows hold them, against all edges that join two voxels.
    #[test]
    fn rows_enumerate_the_edges_they_hold_in_the_order_of_places() {
        let dims = [70, 19, 18];
        let voxels = ramp(dims, 9);
        let grid = Grid::with_spacing(dims, [1.0; 3]).unwrap();
        let volume = Volume::new(grid, Voxels::from(voxels.clone())).unwrap();
        let field = Field::new(&volume, &voxels[..], None);
        let kept = gather(&field, &Exec::default()).unwrap();
        let mut largest = 0;
        for (block, &Block { start, size }) in kept.blocks.iter().enumerate() {
            let mut found = Vec::new();
            kept.each(&field, block, |edge| found.push(edge));
            assert!(found.is_sorted(), "x is fastest in a block of one row, and rows follow in y and z");
            for edge in found {
                let voxel = edge as usize / 3;
                let at = [voxel % dims[0], voxel / dims[0] % dims[1], voxel / dims[0] / dims[1]];
                assert!(
                    (0..3).all(|a| (start[a]..start[a] + size[a]).contains(&at[a])),
                    "{at:?} in {start:?}"
                );
                assert!(at[edge as usize % 3] + 1 < dims[edge as usize % 3]);
                largest = largest.max(field.key(edge));
            }
        }
        assert_eq!(largest, kept.largest);
    }

    #[test]
    fn counting_sorts_as_comparing_does() {
        let dims = [64, 20, 3];
        let voxels = ramp(dims, 65_536);
        let grid = Grid::with_spacing(dims, [1.0; 3]).unwrap();
        let volume = Volume::new(grid, Voxels::from(voxels.clone())).unwrap();
        let field = Field::new(&volume, &voxels[..], None);
        for shift in [1, 4, 7] {
            // Edges that share the bits above.
            let all = (0..voxels.len() - 2000).map(|voxel| 3 * voxel as u32);
            let mut edges: Vec<u32> = all.filter(|edge| field.key(*edge) >> 12 == 1).collect();
            let mut plain = edges.clone();
            plain.sort_by_key(|edge| field.key(*edge) & ((1 << shift) - 1));
            count_out(&field, &mut edges, shift);
            assert!(edges.len() > 100 && edges == plain, "{shift}");
        }
    }
}
