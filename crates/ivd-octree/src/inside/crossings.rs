//! Where the rows of voxels cross a lattice, sorted.

use std::ops::Range;

use ivd_core::{Exec, Lattice, OCTREE_MAX_DEPTH};
use rayon::prelude::*;

use super::triangle::{crossings, fixed_vertex};
use crate::Error;

/// Bits of a voxel coordinate in a packed crossing.
const BITS: u32 = OCTREE_MAX_DEPTH as u32;

/// All crossings of a lattice with the rows of voxel centres along x: `z`, `y`, `x` and the sign, packed into 64 bits
/// and sorted, so that a row is a run and a voxel's winding number is a sum over the head of a run.
pub(crate) struct Crossings {
    packed: Vec<u64>,
    /// Start of each slice's run, and the end of the last.
    slices: Vec<usize>,
}

impl Crossings {
    /// Finds the crossings and checks that each row leaves the lattice as often as it enters.
    pub(crate) fn find(lattice: &Lattice, exec: &Exec) -> Result<Self, Error> {
        let [_, ny, nz] = lattice.grid().dims();
        Self::of_rows(lattice, &[0..ny, 0..nz], exec)
    }

    /// As [`Crossings::find`], of the rows within ranges of y and z alone.
    pub(crate) fn of_rows(lattice: &Lattice, rows: &[Range<usize>; 2], exec: &Exec) -> Result<Self, Error> {
        let dims = lattice.grid().dims();
        let limit = (1_u64 << OCTREE_MAX_DEPTH) - 2;
        if let Some(&n) = dims.iter().find(|&&n| n as u64 > limit) {
            return Err(Error::TooLarge { what: "voxels along an axis", needed: n as u64, limit });
        }
        let mut packed: Vec<u64> = lattice
            .triangles()
            .par_chunks(1 << 12)
            .flat_map_iter(|triangles| {
                let mut found = Vec::new();
                for triangle in triangles {
                    let corners = triangle.map(|v| fixed_vertex(lattice, v));
                    crossings(corners, dims, rows, |y, z, x, sign| found.push(pack(y, z, x, sign)));
                }
                found
            })
            .collect();
        exec.check_cancelled()?;
        packed.par_sort_unstable();
        let slices =
            (0..=dims[2]).map(|z| packed.partition_point(|&c| c < (z as u64) << (2 * BITS + 1))).collect();
        let crossings = Self { packed, slices };
        crossings.check_closed()?;
        Ok(crossings)
    }

    /// Crossings of a row in the order of x: the first voxel not before each, and its sign.
    pub(crate) fn row(&self, y: usize, z: usize) -> impl Iterator<Item = (usize, i64)> {
        let slice = &self.packed[self.slices[z]..self.slices[z + 1]];
        let start = slice.partition_point(|&c| c < pack(y, z, 0, -1));
        let row = row_key(pack(y, z, 0, -1));
        slice[start..].iter().take_while(move |&&c| row_key(c) == row).map(|&c| (x_of(c), sign_of(c)))
    }

    /// Whether the centre of a voxel of the grid lies inside.
    pub(crate) fn contains(&self, [x, y, z]: [usize; 3]) -> bool {
        self.row(y, z).take_while(|crossing| crossing.0 <= x).map(|crossing| crossing.1).sum::<i64>() != 0
    }

    fn check_closed(&self) -> Result<(), Error> {
        let open = self.packed.chunk_by(|&a, &b| row_key(a) == row_key(b)).find_map(|row| {
            let surplus: i64 = row.iter().map(|&c| sign_of(c)).sum();
            (surplus != 0).then(|| (row_key(row[0]), surplus))
        });
        match open {
            Some((row, surplus)) => {
                let row = [(row & ((1 << BITS) - 1)) as usize, (row >> BITS) as usize];
                Err(Error::Open { row, surplus })
            }
            None => Ok(()),
        }
    }
}

fn pack(y: usize, z: usize, x: usize, sign: i64) -> u64 {
    ((((z as u64) << BITS | y as u64) << BITS | x as u64) << 1) | u64::from(sign > 0)
}

/// y and z of a packed crossing, as one number.
fn row_key(crossing: u64) -> u64 {
    crossing >> (BITS + 1)
}

fn x_of(crossing: u64) -> usize {
    (crossing >> 1 & ((1 << BITS) - 1)) as usize
}

fn sign_of(crossing: u64) -> i64 {
    if crossing & 1 == 1 { 1 } else { -1 }
}
