//! Which voxels lie inside a closed lattice: scan conversion along x, exact.
//!
//! A ray runs through the centres of each row of voxels. Lattice vertices lie on grid edges, so these rays *do* hit
//! vertices and edges, and a tie must count once. The ray is therefore moved by an infinitesimal amount, `ε` along y and
//! `ε² ` along z (Edelsbrunner and Mücke 1990, simulation of simplicity): such a ray meets only the interiors of
//! triangles. Vertices are rounded once to multiples of 2⁻³⁴ voxel (exact for every crossing of a grid edge), and edge
//! functions are evaluated in integers, so every decision is that of exact arithmetic and both triangles at an edge
//! agree. A closed lattice is then left as often as it is entered, along every row, whatever its shape.
//!
//! A voxel is inside where the winding number of the lattice round its centre is not 0.

mod crossings;
mod triangle;

use std::ops::Range;

use ivd_core::{Exec, Lattice, Mask};
use rayon::prelude::*;

pub(crate) use crossings::Crossings;

use crate::Error;

/// The voxels of the lattice's grid whose centres lie inside the lattice.
///
/// # Errors
/// [`Error::Open`] names a row along which the lattice isn't closed; [`Error::TooLarge`] for a grid with more than
/// 2²¹ − 2 voxels along an axis; in [`Error::Core`] a lattice that breaks its own check, the memory limit, cancelling.
pub fn inside(lattice: &Lattice, exec: &Exec) -> Result<Mask, Error> {
    exec.run(|| {
        exec.check_memory("the inside of a lattice", lattice.grid().len() as u64)?;
        let crossings = Crossings::find(lattice, exec)?;
        let [nx, ny, _] = lattice.grid().dims();
        let mut inside = vec![0_u8; lattice.grid().len()];
        inside
            .par_chunks_mut(nx)
            .enumerate()
            .for_each(|(row, voxels)| fill(&crossings, [row % ny, row / ny], 0, voxels));
        Ok(Mask::new(lattice.grid().clone(), inside.into())?)
    })
}

/// As [`inside()`], of the voxels of a box alone: 1 inside, x fastest.
///
/// # Errors
/// As [`inside()`].
///
/// # Panics
/// Where the box isn't within the lattice's grid.
pub fn inside_box(lattice: &Lattice, ranges: [Range<usize>; 3], exec: &Exec) -> Result<Vec<u8>, Error> {
    let dims = lattice.grid().dims();
    let within = ranges.iter().zip(dims).all(|(range, n)| range.start <= range.end && range.end <= n);
    assert!(within, "{ranges:?} isn't within {dims:?}");
    exec.run(|| {
        let [xs, ys, zs] = ranges;
        exec.check_memory("the inside of a lattice", (xs.len() * ys.len() * zs.len()) as u64)?;
        let crossings = Crossings::of_rows(lattice, &[ys.clone(), zs.clone()], exec)?;
        let mut inside = vec![0_u8; xs.len() * ys.len() * zs.len()];
        inside.par_chunks_mut(xs.len().max(1)).enumerate().for_each(|(row, voxels)| {
            let at = [ys.start + row % ys.len(), zs.start + row / ys.len()];
            fill(&crossings, at, xs.start, voxels);
        });
        Ok(inside)
    })
}

/// Sets the voxels of a row, from `first` on, that lie inside.
fn fill(crossings: &Crossings, [y, z]: [usize; 2], first: usize, voxels: &mut [u8]) {
    let end = first + voxels.len();
    let mut winding = 0;
    let mut runs = crossings.row(y, z).peekable();
    while let Some((from, sign)) = runs.next() {
        winding += sign;
        let to = runs.peek().map_or(end, |next| next.0);
        if winding != 0 {
            let within = |x: usize| x.clamp(first, end) - first;
            voxels[within(from)..within(to)].fill(1);
        }
    }
}
