//! Active contours on a slice.

mod literal;
mod params;
mod slice;
mod snake;

use ivd_core::op::Op as _;
use ivd_core::{Exec, Grid, Mask, Volume, Voxels};

pub use params::{ContourEnergy, ContourParams, SliceAxis};
use slice::Slice;

use crate::{Error, SurfaceParams, active_surface};

/// What a contour has found.
#[derive(Debug, Clone, PartialEq)]
pub struct Contour {
    /// What lies within, on the slice alone.
    pub mask: Mask,
    /// Voxels of the mask.
    pub voxels: u64,
    /// Energy after each iteration that lowered it, the start's first.
    pub energies: Vec<f64>,
    /// Iterations.
    pub iterations: u32,
}

/// Finds a contour on one slice of a volume, from a circle.
///
/// # Errors
/// [`Error::NoBoundary`] where the slice has no values or one only, and where nothing is left within; a slice or seed outside the
/// volume; memory, cancelled.
pub fn active_contour(volume: &Volume, params: &ContourParams, exec: &Exec) -> Result<Contour, Error> {
    params.check()?;
    exec.run(|| {
        let slice = Slice::of(volume, params)?;
        let (inside, energies, iterations) = match params.energy {
            ContourEnergy::Region => region(&slice, params, exec)?,
            ContourEnergy::Edge => snake::follow(&slice, params, exec)?,
            ContourEnergy::Literal => literal::descend(&slice, params, exec)?,
        };
        let mask = Mask::new(volume.grid().clone(), slice.into_volume(&inside, volume.grid().dims()).into())?;
        Ok(Contour { voxels: mask.count(), mask, energies, iterations })
    })
}

/// The surface's energy, on a volume of one slice.
fn region(slice: &Slice, params: &ContourParams, exec: &Exec) -> Result<(Vec<u8>, Vec<f64>, u32), Error> {
    let [w, h] = slice.size;
    let [a, b] = slice.edges;
    let grid = Grid::with_spacing([w, h, 1], [a, b, (a * b).sqrt()]).map_err(ivd_core::Error::from)?;
    let voxels: Vec<f64> = slice.values.clone();
    let flat = Volume::new(grid.clone(), Voxels::from(voxels))?;
    let start =
        Mask::new(grid, slice.circle().iter().map(|&inside| u8::from(inside)).collect::<Vec<_>>().into())?;
    let surface = SurfaceParams {
        phi: params.phi,
        sweeps: params.iterations,
        fill_holes: false,
        ..SurfaceParams::default()
    };
    let found = active_surface(&flat, None, Some(&start), &surface, exec)?;
    Ok((found.mask.inside().to_vec(), found.energies, found.sweeps))
}
