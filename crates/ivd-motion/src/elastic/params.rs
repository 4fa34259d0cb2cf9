use std::collections::BTreeMap;

use ivd_core::op::by_class;
use ivd_elastic::{FLESH, Tissue};
use ivd_field::param::Limit;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// What a class is made of; what neither it nor its tissue says is as where it lies: inside the lattice, or outside.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct Material {
    /// What it is: gives what of the others isn't given.
    pub tissue: Option<Tissue>,
    /// Young's modulus.
    #[schemars(range(min = 1e-6, max = 1e9), extend("x-unit" = "kPa"))]
    pub kpa: Option<f64>,
    /// Poisson's ratio ν.
    #[schemars(range(min = 0.0, max = 0.45), extend("x-unit" = "1"))]
    pub poisson: Option<f64>,
    /// Whether it stays as it is, as bone does; where no bone of the scene moves it, it stays where it is.
    pub rigid: bool,
}

impl Material {
    /// Young's modulus (kPa) and Poisson's ratio, as far as they are given.
    pub(super) fn moduli(&self) -> (Option<f64>, Option<f64>) {
        let named = self.tissue.and_then(Tissue::moduli);
        (self.kpa.or(named.map(|n| n.0)), self.poisson.or(named.map(|n| n.1)))
    }

    /// Air that has been given a modulus is matter.
    pub(super) fn is_air(&self) -> bool {
        self.tissue == Some(Tissue::Air) && self.kpa.is_none() && !self.rigid
    }

    /// Bone that has been given a modulus yields.
    pub(super) fn is_rigid(&self) -> bool {
        self.rigid || (self.tissue == Some(Tissue::Bone) && self.kpa.is_none())
    }
}

/// What the body is made of, and how closely its balance is found.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default)]
pub struct ElasticParams {
    /// Edge of the finest cells: 1, 2 or 4 voxels. Without it four, and fewer where the smallest ball is less than 48 voxels in radius.
    #[schemars(range(min = 1, max = 4), extend("x-unit" = "voxels", "x-knob" = "accuracy"))]
    pub cell: Option<u8>,
    /// Young's modulus of what lies inside the lattice and has no class of its own.
    #[schemars(range(min = 1e-6, max = 1e9), extend("x-unit" = "kPa"))]
    pub kpa: f64,
    /// Poisson's ratio ν of what lies inside the lattice and has no class of its own: how much it keeps its volume. Beyond 0.45 the cells would be far too stiff.
    #[schemars(range(min = 0.0, max = 0.45), extend("x-unit" = "1"))]
    pub poisson: f64,
    /// Young's modulus of what lies outside the lattice and has no class of its own, relative to `kpa`: air by default. Its ν is 0.4.
    #[schemars(range(min = 0.0001, max = 1.0), extend("x-unit" = "1"))]
    pub filler: f64,
    /// What classes are made of, where labels are given, inside the lattice and outside.
    #[serde(deserialize_with = "by_class")]
    pub material: BTreeMap<u16, Material>,
    /// Whether the volume is in Hounsfield units, which then decide what a voxel without a class of its own is: air, lung, fat, or bone, which stays, and otherwise
    /// what `kpa` and `poisson` say; outside the lattice as well as inside.
    pub hounsfield: bool,
    /// Radius of the ball of material around a handle's vertex that the handle grips: the inner half moves with it as one. Without
    /// it a fifth of the handle's radius, at least three cells, and twice as far as it goes, as long as that is at most half of the radius. It
    /// ends at what is rigid.
    #[schemars(extend("x-unit" = "mm", "exclusiveMinimum" = 0.0))]
    pub grip: Option<f64>,
    /// What to do if the material can't make the whole motion.
    pub limit: Limit,
    /// Forces that may be left at the end, relative to those that cancel.
    #[schemars(range(min = 1e-12, max = 1.0), extend("x-unit" = "1", "x-knob" = "accuracy"))]
    pub tolerance: f64,
}

impl Default for ElasticParams {
    fn default() -> Self {
        Self {
            cell: None,
            kpa: FLESH,
            poisson: 0.45,
            filler: 0.001,
            material: BTreeMap::new(),
            hounsfield: false,
            grip: None,
            limit: Limit::default(),
            tolerance: 1e-3,
        }
    }
}
