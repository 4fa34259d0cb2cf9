use std::fmt;
use std::str::FromStr;

use ivd_core::{ParamError, VoxelType};
use serde::{Deserialize, Serialize};

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
    /// A person's head with neck and shoulders: skin, fat, muscle, bones, teeth, eyes, airway and brain, in the contrast of MR or CT.
    Bust,
}

/// What a scan of the bust shows bright.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Default, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Contrast {
    /// T1-weighted MR: fat brightest, white over grey matter over fluid, bone and air dark.
    #[default]
    Mr,
    /// CT: air under fat under soft tissue under bone under teeth.
    Ct,
}

impl Contrast {
    /// Both, in the order of the documentation.
    pub const ALL: [Self; 2] = [Self::Mr, Self::Ct];

    /// Name as written on the command line.
    pub fn name(self) -> &'static str {
        match self {
            Self::Mr => "mr",
            Self::Ct => "ct",
        }
    }

    /// That nothing needs to be written of it.
    #[allow(clippy::trivially_copy_pass_by_ref, reason = "serde gives a reference")]
    fn is_default(&self) -> bool {
        *self == Self::default()
    }
}

impl fmt::Display for Contrast {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.pad(self.name())
    }
}

impl FromStr for Contrast {
    type Err = ParamError;
    fn from_str(name: &str) -> Result<Self, ParamError> {
        Self::ALL.into_iter().find(|c| c.name() == name).ok_or_else(|| {
            ParamError::new("contrast", format!("no contrast is called `{name}`"), "use mr or ct")
        })
    }
}

impl Shape {
    /// Every shape, in the order of the documentation.
    pub const ALL: [Self; 9] = [
        Self::Head,
        Self::Sphere,
        Self::Torus,
        Self::Gyroid,
        Self::Spheres,
        Self::Shell,
        Self::Bars,
        Self::Neck,
        Self::Bust,
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
            Self::Bust => "bust",
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
    /// What the bust shows bright; the other shapes are as they are.
    #[serde(skip_serializing_if = "Contrast::is_default")]
    pub contrast: Contrast,
}

impl Default for Params {
    fn default() -> Self {
        Self {
            shape: Shape::Head,
            size: 128,
            noise: None,
            voxel_type: VoxelType::U8,
            seed: 7,
            contrast: Contrast::Mr,
        }
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
