use std::collections::BTreeMap;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// How motion is carried to voxels.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum MapMethod {
    /// Through the octree, weighted by depth.
    #[default]
    Octree,
    /// The smoothest motion that follows the lattice, in its inside and outside alike.
    Biharmonic,
    /// The equilibrium of elastic matter in which the lattice moves.
    Fem,
}

/// What happens outside the lattice.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum Outside {
    /// The surroundings follow within a band.
    #[default]
    Band,
    /// The part moves alone; what it leaves becomes background.
    Free,
}

/// How displacement fades with depth.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum DepthWeight {
    /// Straight to zero.
    Linear,
    /// Smooth to zero.
    #[default]
    Smooth,
    /// Exponential.
    Exponential,
    /// No fading: the inside moves as its surface.
    One,
}

/// `[map.material.<class>]`: what isn't given is as where the class lies, inside the lattice or outside.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct ElasticSection {
    /// Young's modulus relative to that of the rest of the inside, 0.001…1000.
    pub young: Option<f64>,
    /// Poisson's ratio, 0…0.45.
    pub poisson: Option<f64>,
}

/// `[map]`.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct MapSection {
    /// Method.
    pub method: MapMethod,
    /// `octree`: how displacement fades with depth.
    pub weight: DepthWeight,
    /// `octree`: depth at which it has faded (mm); from the handles where it isn't given.
    pub depth: Option<f64>,
    /// Width of the band beyond the handles' reach (mm).
    pub margin: Option<f64>,
    /// `biharmonic`: voxels along a cell's edge, 1, 2 or 4; from the handles where it isn't given. `fem`: of the finest cells.
    pub cell: Option<u8>,
    /// `fem`: Poisson's ratio, 0…0.45 (0.4 where it isn't given): how much matter keeps its volume.
    pub poisson: Option<f64>,
    /// `fem`: Young's modulus outside the lattice, relative to the inside's, 0.0001…1 (0.01 where it isn't given).
    pub filler: Option<f64>,
    /// `fem`: elasticity by class.
    pub material: BTreeMap<String, ElasticSection>,
    /// Outside of the lattice.
    pub outside: Outside,
    /// How far lattice points may be left behind to keep the map free of folds, as a fraction of their motion, 0…1.
    pub tolerance: Option<f64>,
}

/// Interpolation of a warp.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum WarpOrder {
    /// The nearest voxel.
    Nearest,
    /// Trilinear.
    #[default]
    Linear,
    /// Tricubic.
    Cubic,
}

/// `[warp]`.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct WarpSection {
    /// Interpolation.
    pub order: WarpOrder,
    /// Real value of what comes from outside the volume.
    pub background: Option<f64>,
}
