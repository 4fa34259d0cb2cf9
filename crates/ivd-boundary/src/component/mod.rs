//! One connected piece of a class.

mod choice;
mod holes;

use std::collections::BTreeSet;

use ivd_core::op::Op as _;
use ivd_core::{Exec, Labels, Mask, Volume};
use rayon::prelude::*;

use crate::runs::{Runs, piece_count};
use crate::{ComponentParams, Error};
pub(crate) use choice::seed_voxel;
use choice::{Chosen, Members};
pub(crate) use holes::fill as fill_holes;

/// A part of a volume, isolated.
#[derive(Debug, Clone, PartialEq)]
pub struct Component {
    /// 1 in the part, holes filled.
    pub mask: Mask,
    /// Voxels of the mask.
    pub voxels: u64,
    /// The class it was taken from; `None` where a value was given instead.
    pub class: Option<u16>,
    /// Connected pieces that the class has; the mask is one of them.
    pub components: usize,
    /// Voxels that weren't of the piece and were enclosed.
    pub filled: u64,
    /// Voxels of the largest piece, where one that encloses it was taken.
    pub encloses: Option<u64>,
    /// Where the class begins [real units]; `None` where it is open below.
    pub lower: Option<f64>,
    /// Where the class ends [real units]; `None` where it is open above.
    pub upper: Option<f64>,
}

/// Isolates one 6-connected piece of a class, or of what is at or above a value: the largest, the one that encloses it, or the one at the seed.
///
/// - `labels`: classes on the volume's grid; needed unless [`ComponentParams::above`] is given, and then not looked at.
/// - Of two largest pieces the one whose first voxel comes first is taken.
/// - Of what is at or above a value, a piece that encloses the largest is taken in its place, where holes are filled and no seed is given: where bone that is
///   darker than that keeps skin apart from a larger brain, the skin is the body's surface.
/// - With [`ComponentParams::fill_holes`], background that doesn't reach the volume's border through faces is filled.
///   Voxels without data (NaN, infinite) are never part of it.
///
/// # Errors
/// [`Error`]: an unknown or empty class, a seed outside the volume or in another class, labels on another grid, the memory
/// limit, cancelled.
pub fn component(
    volume: &Volume,
    labels: Option<&Labels>,
    params: &ComponentParams,
    exec: &Exec,
) -> Result<Component, Error> {
    params.check()?;
    exec.run(|| {
        exec.check_memory("the mask", volume.grid().len() as u64)?;
        let chosen = choice::choose(volume, labels, params)?;
        let members = Members::new(volume, labels, &chosen);
        let dims = volume.grid().dims();
        let runs = Runs::find(dims, |y, z, found| members.row_runs(y, z, found));
        exec.check_cancelled()?;
        let components = runs.components()?;
        exec.check_cancelled()?;
        let kept = kept_component(volume, labels, params, &chosen, &members, &runs, &components)?;
        let may_be_enclosed = params.above.is_some() && params.seed.is_none() && params.fill_holes;
        let around = if may_be_enclosed { all_round(&runs, &components, kept, dims) } else { Vec::new() };
        let first = runs.linear(runs.first(kept as usize));
        let mut inside = vec![0_u8; volume.grid().len()];
        let (mut taken, mut filled) = (kept, 0);
        // It holds its own first voxel: the last one is taken where no other encloses that.
        for piece in around.into_iter().chain([kept]) {
            draw(&runs, &components, piece, dims, &mut inside);
            exec.check_cancelled()?;
            if params.fill_holes {
                filled = holes::fill(&mut inside, dims, &runs, &components, piece, volume, &|_| true)?;
            }
            if inside[first] == 1 {
                taken = piece;
                break;
            }
            inside.fill(0);
        }
        let is_of_kept = |run: &usize| components[*run] == kept;
        let size = || (0..runs.len()).filter(is_of_kept).map(|run| runs.span(run).len() as u64).sum();
        let mask = Mask::new(volume.grid().clone(), inside.into())?;
        Ok(Component {
            voxels: mask.count(),
            mask,
            class: chosen.class,
            components: piece_count(&components),
            filled,
            encloses: (taken != kept).then(size),
            lower: chosen.lower,
            upper: chosen.upper,
        })
    })
}

/// The component at the seed, or the largest.
fn kept_component(
    volume: &Volume,
    labels: Option<&Labels>,
    params: &ComponentParams,
    chosen: &Chosen,
    members: &Members,
    runs: &Runs,
    components: &[u32],
) -> Result<u32, Error> {
    if runs.len() == 0 {
        return Err(choice::nothing_there(volume, labels, chosen));
    }
    if let Some(seed) = params.seed {
        let [x, y, z] = choice::seed_voxel(volume, seed)?;
        let at_seed = runs.row(y, z).find(|&run| runs.span(run).contains(&x));
        return match at_seed {
            Some(run) => Ok(components[run]),
            None => Err(choice::seed_elsewhere(volume, labels, chosen, members, seed)),
        };
    }
    let mut sizes = vec![0_u64; components.len()];
    for (run, &component) in components.iter().enumerate() {
        sizes[component as usize] += runs.span(run).len() as u64;
    }
    let largest = (0..sizes.len() as u32).max_by_key(|&run| (sizes[run as usize], std::cmp::Reverse(run)));
    Ok(largest.expect("there is a run"))
}

/// The pieces that lie on all six sides of a piece's first voxel, the outermost of those that enclose it before the others.
fn all_round(runs: &Runs, components: &[u32], piece: u32, [_, ny, nz]: [usize; 3]) -> Vec<u32> {
    let [x, y, z] = runs.first(piece as usize);
    let has = |y: usize, z: usize, other: u32| {
        runs.row(y, z).any(|run| components[run] == other && runs.span(run).contains(&x))
    };
    let (mut found, mut tried) = (Vec::new(), BTreeSet::from([piece]));
    for run in runs.row(y, z).take_while(|run| runs.span(*run).start < x) {
        let other = components[run];
        let is_round = tried.insert(other)
            && runs.row(y, z).any(|run| components[run] == other && runs.span(run).start > x)
            && (0..y).any(|y| has(y, z, other))
            && (y + 1..ny).any(|y| has(y, z, other))
            && (0..z).any(|z| has(y, z, other))
            && (z + 1..nz).any(|z| has(y, z, other));
        if is_round {
            found.push(other);
        }
    }
    found
}

/// Runs of the ones of a mask.
pub(crate) fn ones(mask: &[u8], dims: [usize; 3]) -> Runs {
    Runs::find(dims, |y, z, found| {
        let first = dims[0] * (y + dims[1] * z);
        choice::runs_where(&mask[first..first + dims[0]], |&v| v != 0, found);
    })
}

/// Writes a component's runs into the mask.
pub(crate) fn draw(runs: &Runs, components: &[u32], kept: u32, dims: [usize; 3], inside: &mut [u8]) {
    inside.par_chunks_mut(dims[0] * dims[1]).enumerate().for_each(|(z, slice)| {
        for (y, row) in slice.chunks_mut(dims[0]).enumerate() {
            for run in runs.row(y, z).filter(|&run| components[run] == kept) {
                row[runs.span(run)].fill(1);
            }
        }
    });
}
