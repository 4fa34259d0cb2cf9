//! Parts made of parts: joined, cut, cleaned.

mod params;

use ivd_core::op::Op as _;
use ivd_core::{Exec, Grid, Mask, Volume, slots};

pub use params::{EditParams, SetOperation};

use crate::component::{draw, fill_holes, ones};
use crate::part::{Frame, limit, squared_distances};
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
        if params.close > 0.0 {
            close(&mut inside, grid, params.close, exec)?;
        }
        if params.open > 0.0 {
            open(&mut inside, grid, params.open, exec)?;
        }
        for (i, inside) in inside.iter_mut().enumerate() {
            *inside *= u8::from(volume.voxels().get(i).is_finite());
        }
        let least = params.islands / grid.voxel_volume();
        let (components, islands) = without_islands(&mut inside, grid.dims(), least)?;
        if components == 0 {
            let remedy = "open less, drop smaller islands, or give parts that overlap";
            return Err(Error::no_boundary("the edit leaves nothing of the part", remedy));
        }
        let filled = if params.fill_holes {
            let runs = ones(&inside, grid.dims());
            fill_holes(&mut inside, grid.dims(), &runs, &vec![0; runs.len()], 0, volume, &|_| true)?
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

/// A ball's closing: what every ball of the radius (mm) that holds it shares a voxel with the set. The space that balls lie in goes on
/// beyond the volume, where nothing of the set is.
fn close(inside: &mut [u8], grid: &Grid, radius: f64, exec: &Exec) -> Result<(), Error> {
    let (dims, edges) = (grid.dims(), grid.spacing());
    let extent = (0..3).map(|a| (dims[a] as f64 * edges[a]).powi(2)).sum::<f64>().sqrt();
    if radius > extent {
        let problem = format!("{radius} mm is more than the volume's diagonal");
        return Err(ivd_core::ParamError::new("close", problem, format!("give at most {extent:.1}")).into());
    }
    // All that a ball about a voxel of the set reaches, and a voxel more, which is outside.
    let frame = Frame::about(inside, dims, edges.map(|edge| (radius / edge) as usize + 2));
    let holds = |i: usize| frame.voxel(i).is_some_and(|voxel| inside[voxel] != 0);
    let away = squared_distances(frame.size, edges, &holds, exec)?;
    let depth = squared_distances(frame.size, edges, &|i| away[i] > limit(radius), exec)?;
    for (i, &depth) in depth.iter().enumerate() {
        if let Some(voxel) = frame.voxel(i) {
            inside[voxel] = u8::from(depth > limit(radius));
        }
    }
    Ok(())
}

/// A ball's opening: all balls of the radius (mm) that lie within the set. Beyond the volume nothing of the set is.
fn open(inside: &mut [u8], grid: &Grid, radius: f64, exec: &Exec) -> Result<(), Error> {
    let edges = grid.spacing();
    let frame = Frame::about(inside, grid.dims(), [1; 3]);
    let outside = |i: usize| frame.voxel(i).is_none_or(|voxel| inside[voxel] == 0);
    let depth = squared_distances(frame.size, edges, &outside, exec)?;
    let away = squared_distances(frame.size, edges, &|i| depth[i] > limit(radius), exec)?;
    for (i, &away) in away.iter().enumerate() {
        if let Some(voxel) = frame.voxel(i) {
            inside[voxel] = u8::from(away <= limit(radius));
        }
    }
    Ok(())
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
