//! Generated volumes whose every voxel's class is known.
//!
//! A phantom is a cube of `size` voxels at 1 mm on the identity grid. Lengths are fractions of the size and centres lie
//! off the voxel grid, so that no surface passes through a row of voxels by chance. Apart from the head, the neck, the bust and the bars, the
//! scalar is `0.5 - d / 8` clipped to 0…1, with `d` the signed distance (voxels) (negative inside): the surface is the
//! value 0.5, and the profile across it is linear over 8 voxels. Integer types hold the scalar times their largest value.
//!
//! ```
//! use ivd_core::{Exec, VoxelType};
//! use ivd_phantom::{Params, Shape, generate};
//!
//! let params = Params { shape: Shape::Sphere, size: 32, voxel_type: VoxelType::U8, ..Params::default() };
//! let phantom = generate(&params, &Exec::default()).unwrap();
//! let inside = phantom.truth.class(1).unwrap().voxels as f64;
//! let ball = 4.0 / 3.0 * std::f64::consts::PI * (0.35 * 32.0_f64).powi(3);
//! assert!((inside / ball - 1.0).abs() < 0.02);
//! ```

#![forbid(unsafe_code)]

mod bust;
mod noise;
mod params;
mod shapes;
mod truth;

use ivd_core::{Error, Exec, Grid, Labels, Scalar, Volume, VoxelType};
use rayon::prelude::*;

pub use params::{Contrast, Params, Shape};
pub use shapes::signed_distance;

use shapes::Sampler;
use truth::Tally;

/// A generated volume and its truth.
#[derive(Debug, Clone, PartialEq)]
pub struct Phantom {
    /// The voxels: 1 mm, identity direction, origin 0.
    pub volume: Volume,
    /// The class of each voxel: 0…5 in the head (air, skin/soft, skull, csf, grey, white), 0…3 in the neck (air, soft, disc,
    /// bone), 0…18 in the bust (air, skin, fat, muscle, skull, jaw, teeth, vertebrae, discs, eyes, lenses, csf, ventricles, grey, white,
    /// cerebellum, cerebellar white, brain stem, airway), else 0 outside and 1 inside (noise-free scalar above 0.5). Class 0 is listed: it
    /// is the air here, not missing data.
    pub truth: Labels,
}

/// Generates a phantom: parallel over slices, the same bytes for any number of threads.
///
/// # Errors
/// [`Error::Param`], [`Error::MemoryLimit`] or [`Error::Cancelled`].
pub fn generate(params: &Params, exec: &Exec) -> Result<Phantom, Error> {
    params.check()?;
    exec.run(|| match params.voxel_type {
        VoxelType::U8 => typed::<u8>(params, 255.0, exec),
        VoxelType::U16 => typed::<u16>(params, 65535.0, exec),
        _ => typed::<f32>(params, 1.0, exec),
    })
}

fn typed<T: Scalar>(params: &Params, scale: f64, exec: &Exec) -> Result<Phantom, Error> {
    const TASK: &str = "phantom";
    let n = params.size;
    let grid = Grid::with_spacing([n; 3], [1.0; 3])?;
    exec.check_memory("the phantom and its truth", (grid.len() * (size_of::<T>() + 2)) as u64)?;
    let sampler = Sampler::new(params);
    let sd = params.noise_sd();
    let mut voxels = vec![T::default(); grid.len()];
    let mut ids = vec![0_u16; grid.len()];
    exec.observer().begin(TASK, n as u64);
    let slab = n * n * sampler.depth();
    let slabs = voxels.par_chunks_mut(slab).zip(ids.par_chunks_mut(slab)).enumerate();
    let tallies: Vec<Tally> = slabs
        .map(|(s, (voxels, ids))| {
            exec.check_cancelled()?;
            let mut tally = Tally::default();
            let mut clean = vec![0.0; voxels.len()];
            sampler.fill(s * sampler.depth(), &mut clean, ids);
            for (i, ((voxel, &clean), &label)) in voxels.iter_mut().zip(&clean).zip(&*ids).enumerate() {
                let seen = if sd > 0.0 {
                    noise::rician(clean, sd, params.seed, (s * slab + i) as u64)
                } else {
                    clean
                };
                *voxel = T::from_f64(seen.clamp(0.0, 1.0) * scale);
                tally.add(label, voxel.to_f64());
            }
            exec.observer().advance(TASK, (voxels.len() / (n * n)) as u64);
            Ok(tally)
        })
        .collect::<Result<_, Error>>()?;
    exec.observer().end(TASK);
    let classes = truth::classes(params.shape, &tallies);
    Ok(Phantom {
        volume: Volume::new(grid.clone(), T::wrap(voxels.into()))?,
        truth: Labels::new(grid, ids.into(), classes)?,
    })
}

#[cfg(test)]
mod tests;
