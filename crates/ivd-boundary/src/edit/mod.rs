//! Parts made of parts: joined, cut, cleaned.

mod params;

use ivd_core::op::Op as _;
use ivd_core::{Exec, Grid, Mask, Volume, slots};

pub use params::{EditParams, SetOperation};

use crate::component::{draw, fill_holes, ones};
use crate::part::squared_distances;
use crate::{Error, part};

/// A part after an edit.
#[derive(Debug, Clone, PartialEq)]
pub struct Edited {
    /// The part, with a level function.
    pub mask: Mask,
    /// Voxels of the mask.
    pub voxels: u64,
    /// Connected pieces that it has.
    pub components: usize,
    /// Pieces that were too small and went.
    pub islands: usize,
    /// Voxels that were enclosed.
    pub filled: u64,
}

slots! {
    /// What is edited.
    ///
    /// - `volume`: where voxels without data are, which stay out.
    /// - `part`: the part.
    /// - `other`: the second part of a union, an intersection or a difference.
    pub struct EditInputs<'a> { volume: &'a Volume, part: &'a Mask, other: Option<&'a Mask> }
}

/// Edits a part: with another one, then closed, opened, without islands, without holes, in this order.
///
/// # Errors
/// [`Error::NoBoundary`] where nothing is left; parts of another grid, an operation without a second part; memory, cancelled.
pub fn edit(inputs: &EditInputs<'_>, params: &EditParams, exec: &Exec) -> Result<Edited, Error> {
    params.check()?;
    let EditInputs { volume, part: own, other } = *inputs;
    let grid = volume.grid();
    grid.require(own.grid(), "volume", "part")?;
    let mut inside = own.inside().to_vec();
    match (params.operation, other) {
        (Some(operation), Some(other)) => {
            grid.require(other.grid(), "volume", "other")?;
            for (own, other) in inside.iter_mut().zip(other.inside()) {
                *own = operation.of(*own, *other);
            }
        }
        (None, None) => {}
        (Some(_), None) => {
            let problem = "two parts are needed";
            return Err(ivd_core::ParamError::new("operation", problem, "give the other one as other").into());
        }
        (None, Some(_)) => {
            let problem = "there is another part, but nothing to do with it";
            let remedy = "give union, intersection or difference";
            return Err(ivd_core::ParamError::new("operation", problem, remedy).into());
        }
    }
    exec.run(|| {
        exec.check_memory("distances to a part", 8 * grid.len() as u64)?;
        if params.close > 0.0 {
            inside = within(&dilated(&inside, grid, params.close), grid, params.close, true);
            exec.check_cancelled()?;
        }
        if params.open > 0.0 {
            let core = within(&inside, grid, params.open, false);
            inside = dilated(&core, grid, params.open);
            exec.check_cancelled()?;
        }
        for (i, inside) in inside.iter_mut().enumerate() {
            *inside *= u8::from(volume.voxels().get(i).is_finite());
        }
        let least = params.islands / grid.voxel_volume();
        let (components, islands) = without_islands(&mut inside, grid.dims(), least)?;
        if components == 0 {
            return Err(Error::NoBoundary { problem: "the edit leaves nothing of the part".into() });
        }
        let filled = if params.fill {
            let runs = ones(&inside, grid.dims());
            fill_holes(&mut inside, grid.dims(), &runs, &vec![0; runs.len()], 0, volume)?
        } else {
            0
        };
        let mask = part::levelled(inside, grid, exec)?;
        Ok(Edited { voxels: mask.count(), mask, components, islands, filled })
    })
}

impl SetOperation {
    fn of(self, own: u8, other: u8) -> u8 {
        match self {
            Self::Union => own | other,
            Self::Intersection => own & other,
            Self::Difference => own & (1 - other),
        }
    }
}

/// What is within a distance (mm) of a set.
fn dilated(inside: &[u8], grid: &Grid, radius: f64) -> Vec<u8> {
    let limit = (radius * radius) as f32;
    let away = squared_distances(grid.dims(), grid.spacing(), &|i| inside[i] != 0);
    away.iter().map(|&d| u8::from(d <= limit)).collect()
}

/// What is further than a distance (mm) from all outside; what lies beyond the volume is as `beyond`.
fn within(inside: &[u8], grid: &Grid, radius: f64, beyond: bool) -> Vec<u8> {
    let limit = (radius * radius) as f32;
    let (dims, edges) = (grid.dims(), grid.spacing());
    let depth = squared_distances(dims, edges, &|i| inside[i] == 0);
    depth
        .iter()
        .enumerate()
        .map(|(i, &depth)| {
            let at = [i % dims[0], i / dims[0] % dims[1], i / dims[0] / dims[1]];
            let border = (0..3)
                .map(|a| (at[a] + 1).min(dims[a] - at[a]) as f64 * edges[a])
                .fold(f64::INFINITY, f64::min);
            u8::from(depth > limit && (beyond || (border * border) as f32 > limit))
        })
        .collect()
}

/// Drops the pieces of fewer voxels than `least`; gives how many stay and how many go.
fn without_islands(inside: &mut [u8], dims: [usize; 3], least: f64) -> Result<(usize, usize), Error> {
    let runs = ones(inside, dims);
    let pieces = runs.components()?;
    let mut sizes = std::collections::BTreeMap::<u32, u64>::new();
    for (run, &piece) in pieces.iter().enumerate() {
        *sizes.entry(piece).or_default() += runs.span(run).len() as u64;
    }
    let small: Vec<u32> =
        sizes.iter().filter(|(_, n)| (**n as f64) < least).map(|(piece, _)| *piece).collect();
    if !small.is_empty() {
        let marked: Vec<u32> =
            pieces.iter().map(|piece| u32::from(small.binary_search(piece).is_err())).collect();
        inside.fill(0);
        draw(&runs, &marked, 1, dims, inside);
    }
    Ok((sizes.len() - small.len(), small.len()))
}
