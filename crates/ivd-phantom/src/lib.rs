//! Generated volumes whose every voxel's class is known.
//!
//! A phantom is a cube of `size` voxels at 1 mm on the identity grid. Lengths are fractions of the size and centres lie
//! off the voxel grid, so that no surface passes through a row of voxels by chance. Apart from the head, the neck and the bars, the
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

mod noise;
mod shapes;
mod truth;

use std::fmt;
use std::str::FromStr;

use ivd_core::{Error, Exec, Grid, Labels, ParamError, Scalar, Volume, VoxelType};
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

pub use shapes::signed_distance;

use shapes::Sampler;
use truth::Tally;

/// Standard deviation of the head's noise where none is given.
const HEAD_NOISE: f64 = 0.04;

/// What is drawn.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Default, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Shape {
    /// A head of ellipsoids: air, skin, skull, fluid, a folded grey layer, white matter, two ventricles; noisy.
    #[default]
    Head,
    /// A ball of radius 0.35 size.
    Sphere,
    /// A torus about z with radii 0.28 and 0.12 size.
    Torus,
    /// The gyroid with four periods a side; scalar `0.5 - 0.3 f`.
    Gyroid,
    /// Two balls of radius 0.2 size that touch in one point.
    Spheres,
    /// A spherical shell of radius 0.35 size, 1.5 voxels thick.
    Shell,
    /// Bars across x with periods of 16, 12, 8, 6, 5, 4, 3, 2 voxels in eight bands along y; full contrast.
    Bars,
    /// A neck along z through the whole cube: air, soft tissue with an airway, a spine of five vertebrae with discs between.
    Neck,
}

impl Shape {
    /// Every shape, in the order of the documentation.
    pub const ALL: [Self; 8] = [
        Self::Head,
        Self::Sphere,
        Self::Torus,
        Self::Gyroid,
        Self::Spheres,
        Self::Shell,
        Self::Bars,
        Self::Neck,
    ];

    /// Name as written on the command line.
    pub fn name(self) -> &'static str {
        match self {
            Self::Head => "head",
            Self::Sphere => "sphere",
            Self::Torus => "torus",
            Self::Gyroid => "gyroid",
            Self::Spheres => "spheres",
            Self::Shell => "shell",
            Self::Bars => "bars",
            Self::Neck => "neck",
        }
    }
}

impl fmt::Display for Shape {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.pad(self.name())
    }
}

impl FromStr for Shape {
    type Err = ParamError;
    fn from_str(name: &str) -> Result<Self, ParamError> {
        Self::ALL.into_iter().find(|s| s.name() == name).ok_or_else(|| {
            let known = Self::ALL.map(Self::name).join(", ");
            ParamError::new("phantom", format!("no shape is called `{name}`"), format!("use one of {known}"))
        })
    }
}

/// What to generate.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Params {
    /// What is drawn.
    pub shape: Shape,
    /// Voxels along each edge of the cube, 1…2048.
    pub size: usize,
    /// Standard deviation of the Rician noise [scalar range 1], ≥ 0; `None`: 0.04 for the head, 0 for the others.
    pub noise: Option<f64>,
    /// Stored type: `u8`, `u16` or `f32`.
    pub voxel_type: VoxelType,
    /// Seed of the noise.
    pub seed: u64,
}

impl Default for Params {
    fn default() -> Self {
        Self { shape: Shape::Head, size: 128, noise: None, voxel_type: VoxelType::U8, seed: 7 }
    }
}

impl Params {
    /// # Errors
    /// [`ParamError`] names the field that is out of its domain.
    pub fn check(&self) -> Result<(), ParamError> {
        if !(1..=2048).contains(&self.size) {
            return Err(ParamError::new("size", format!("{} voxels a side", self.size), "use 1…2048"));
        }
        if let Some(noise) = self.noise
            && !(0.0..=1e3).contains(&noise)
        {
            return Err(ParamError::new("noise", format!("{noise}"), "use 0…1000; the scalar's range is 1"));
        }
        if !matches!(self.voxel_type, VoxelType::U8 | VoxelType::U16 | VoxelType::F32) {
            return Err(ParamError::new(
                "voxel_type",
                format!("phantoms aren't made as {}", self.voxel_type.name()),
                "use u8, u16 or f32",
            ));
        }
        Ok(())
    }

    /// Standard deviation of the noise that applies [scalar range 1].
    pub fn noise_sd(&self) -> f64 {
        self.noise.unwrap_or(if self.shape == Shape::Head { HEAD_NOISE } else { 0.0 })
    }
}

/// A generated volume and its truth.
#[derive(Debug, Clone, PartialEq)]
pub struct Phantom {
    /// The voxels: 1 mm, identity direction, origin 0.
    pub volume: Volume,
    /// The class of each voxel: 0…5 in the head (air, skin/soft, skull, csf, grey, white), 0…3 in the neck (air, soft, disc,
    /// bone), else 0 outside and 1 inside (noise-free scalar above 0.5). Class 0 is listed: it is the air here, not missing data.
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
    let sampler = Sampler::new(params.shape, n);
    let sd = params.noise_sd();
    let mut voxels = vec![T::default(); grid.len()];
    let mut ids = vec![0_u16; grid.len()];
    exec.observer().begin(TASK, n as u64);
    let slices = voxels.par_chunks_mut(n * n).zip(ids.par_chunks_mut(n * n)).enumerate();
    let tallies: Vec<Tally> = slices
        .map(|(z, (voxels, ids))| {
            exec.check_cancelled()?;
            let mut tally = Tally::default();
            for (i, (voxel, id)) in voxels.iter_mut().zip(ids.iter_mut()).enumerate() {
                let (clean, label) = sampler.at([i % n, i / n, z]);
                let seen = if sd > 0.0 {
                    noise::rician(clean, sd, params.seed, (z * n * n + i) as u64)
                } else {
                    clean
                };
                *voxel = T::from_f64(seen.clamp(0.0, 1.0) * scale);
                *id = label;
                tally.add(label, voxel.to_f64());
            }
            exec.observer().advance(TASK, 1);
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
