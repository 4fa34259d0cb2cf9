use std::collections::BTreeMap;

use ivd_elastic::{FLESH, Tissue};
use ivd_field::falloff::smooth_fall;
use ivd_field::param::Limit;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Weight `w` of the nearest lattice point's motion at depth `t · depth` inside the lattice; 0 from `t = 1` on.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum DepthWeight {
    /// `1 − t`.
    Linear,
    /// `1 − 3t² + 2t³`: flat at the lattice and at the end.
    #[default]
    Smooth,
    /// `(e^(−3t) − e^(−3)) / (1 − e^(−3))`: steep at the lattice.
    Exponential,
    /// `1` at every depth: the inside moves as the lattice does, and a translation is exact.
    One,
}

impl DepthWeight {
    /// The weight at `t = depth / depth` (no unit), `t ≥ 0`.
    pub fn at(self, t: f64) -> f64 {
        if self == Self::One {
            return 1.0;
        }
        if t >= 1.0 {
            return 0.0;
        }
        match self {
            Self::Linear => 1.0 - t,
            Self::Smooth => smooth_fall(t),
            Self::Exponential => {
                let end = (-3.0_f64).exp();
                ((-3.0 * t).exp() - end) / (1.0 - end)
            }
            Self::One => 1.0,
        }
    }
}

/// What happens outside the lattice.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum Outside {
    /// A band round the lattice moves along, falling to 0 over the margin, so that space stays in one piece.
    #[default]
    Band,
    /// The part moves alone; what it leaves becomes background.
    Free,
}

/// Young's modulus of bone, relative to flesh's: the most that classes may be given.
const STIFFEST: f64 = 1000.0;

/// What a class is made of; what neither it nor its tissue says is as where it lies: inside the lattice, or outside.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct Elastic {
    /// What it is: gives what of the others isn't given, relative to flesh of 4 kPa; bone is a thousand times as stiff.
    pub tissue: Option<Tissue>,
    /// Young's modulus relative to that of matter without a class of its own inside the lattice.
    #[schemars(range(min = 0.001, max = 1000.0), extend("x-unit" = "1"))]
    pub young: Option<f64>,
    /// Poisson's ratio ν.
    #[schemars(range(min = 0.0, max = 0.45), extend("x-unit" = "1"))]
    pub poisson: Option<f64>,
}

impl Elastic {
    /// Young's modulus relative to the inside's, and Poisson's ratio, as far as they are given.
    pub(crate) fn moduli(&self) -> (Option<f64>, Option<f64>) {
        let named = self.tissue.map(|tissue| match tissue.moduli() {
            Some((kpa, poisson)) => (kpa / FLESH, Some(poisson)),
            None => (STIFFEST, None),
        });
        (self.young.or(named.map(|n| n.0)), self.poisson.or(named.and_then(|n| n.1)))
    }
}

/// What every map does beyond the lattice, whichever way it is found.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default)]
pub struct Band {
    /// Width of the band outside the lattice and of the fall-off beyond the reach. Without it four times the largest motion of
    /// each handle's own vertices, or of a handle that it overlaps (by `fem` and `body`: of all), at least two voxel diagonals.
    #[schemars(extend("x-unit" = "mm", "exclusiveMinimum" = 0.0))]
    pub margin: Option<f64>,
    /// What happens outside the lattice.
    pub outside: Outside,
    /// How far lattice points may be left behind to keep the map free of folds, as a fraction of the largest motion: the root mean square of
    /// those that move most, and the 99.9th percentile of all that are driven or held. Beyond it the map isn't what was asked for.
    #[schemars(range(min = 0.0, max = 1.0), extend("x-unit" = "1", "x-knob" = "accuracy"))]
    pub tolerance: f64,
    /// What is done where the whole motion can't be mapped.
    pub limit: Limit,
}

impl Default for Band {
    fn default() -> Self {
        Self { margin: None, outside: Outside::default(), tolerance: 0.5, limit: Limit::default() }
    }
}

/// The motion of the nearest lattice point, found through the octree and weighted by depth (I-DOGME).
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(default)]
pub struct OctreeParams {
    /// How the motion fades with depth inside the lattice.
    pub weight: DepthWeight,
    /// Depth at which the motion has faded to 0. Without it each handle's radius, at least four times the largest motion of its
    /// own vertices; or those of a handle that it overlaps.
    #[schemars(extend("x-unit" = "mm", "exclusiveMinimum" = 0.0))]
    pub depth: Option<f64>,
    /// Beyond the lattice.
    #[serde(flatten)]
    pub band: Band,
    /// Frame of the motion that is mapped, from 0. Without it the last.
    #[schemars(extend("x-unit" = "1"))]
    pub frame: Option<u32>,
}

/// The smoothest motion that follows the lattice: least squared second derivatives, in its inside and outside alike.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(default)]
pub struct BiharmonicParams {
    /// Edge of the cells: 1, 2 or 4 voxels, and as many along the other axes as give about the same length. Without it four, eight where
    /// slices lie eight of these apart, and fewer where the smallest ball and its margin are less than 24 voxels wide.
    #[schemars(range(min = 1, max = 4), extend("x-unit" = "voxels", "x-knob" = "accuracy"))]
    pub cell: Option<u8>,
    /// Beyond the lattice.
    #[serde(flatten)]
    pub band: Band,
    /// Frame of the motion that is mapped, from 0. Without it the last.
    #[schemars(extend("x-unit" = "1"))]
    pub frame: Option<u32>,
}

/// The equilibrium of elastic matter, neo-Hookean, in which the lattice moves.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default)]
pub struct FemParams {
    /// Edge of the finest cells: 1, 2 or 4 voxels. Without it four, eight where slices lie eight of these apart, and fewer where the smallest ball and
    /// its margin are less than 24 voxels wide.
    #[schemars(range(min = 1, max = 4), extend("x-unit" = "voxels", "x-knob" = "accuracy"))]
    pub cell: Option<u8>,
    /// Poisson's ratio ν: how much matter keeps its volume. Beyond 0.45 the cells would be far too stiff.
    #[schemars(range(min = 0.0, max = 0.45), extend("x-unit" = "1"))]
    pub poisson: f64,
    /// Young's modulus of what lies outside the lattice, relative to the inside's.
    #[schemars(range(min = 0.0001, max = 1.0), extend("x-unit" = "1"))]
    pub filler: f64,
    /// Elasticity by class where labels are given, inside the lattice and outside (inside only with `outside = "free"`).
    pub material: BTreeMap<u16, Elastic>,
    /// Beyond the lattice.
    #[serde(flatten)]
    pub band: Band,
    /// Frame of the motion that is mapped, from 0. Without it the last.
    #[schemars(extend("x-unit" = "1"))]
    pub frame: Option<u32>,
}

impl Default for FemParams {
    fn default() -> Self {
        Self {
            cell: None,
            poisson: 0.4,
            filler: 0.01,
            material: BTreeMap::new(),
            band: Band::default(),
            frame: None,
        }
    }
}

/// The motion of space that the lattice's came with, from `solver = "body"`: nothing is found anew.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(default)]
pub struct BodyParams {
    /// Beyond the lattice.
    #[serde(flatten)]
    pub band: Band,
    /// Frame of the motion that is mapped, from 0. Without it the last.
    #[schemars(extend("x-unit" = "1"))]
    pub frame: Option<u32>,
}

#[cfg(test)]
mod tests {
    use ivd_core::op::Op as _;

    use super::*;

    #[test]
    fn weights_start_at_one_and_fall_to_zero_without_a_jump() {
        for weight in [DepthWeight::Linear, DepthWeight::Smooth, DepthWeight::Exponential] {
            assert!((weight.at(0.0) - 1.0).abs() < 1e-15, "{weight:?}");
            assert!(weight.at(1.0 - 1e-9) < 1e-7 && weight.at(1.0) == 0.0 && weight.at(7.0) == 0.0);
            let values: Vec<f64> = (0..=100).map(|i| weight.at(f64::from(i) / 100.0)).collect();
            assert!(values.windows(2).all(|w| w[0] > w[1]), "{weight:?} falls");
        }
        assert_eq!(DepthWeight::One.at(1e9), 1.0);
    }

    #[test]
    fn bad_values_are_named_as_they_are_typed() {
        let band = |band| OctreeParams { band, ..OctreeParams::default() };
        let field = |params: &FemParams| params.check().unwrap_err().field;
        let margin = band(Band { margin: Some(0.0), ..Band::default() }).check().unwrap_err();
        assert_eq!((margin.field.as_str(), margin.problem.as_str()), ("margin", "0 mm"));
        for tolerance in [f64::NAN, -0.1, 1.5] {
            let bad = band(Band { tolerance, ..Band::default() });
            assert_eq!(bad.check().unwrap_err().field, "tolerance");
        }
        for cell in [0, 3, 5] {
            assert_eq!(
                BiharmonicParams { cell: Some(cell), ..Default::default() }.check().unwrap_err().field,
                "cell"
            );
        }
        assert_eq!(field(&FemParams { poisson: 0.46, ..FemParams::default() }), "poisson");
        let soft = Elastic { poisson: Some(0.5), ..Elastic::default() };
        assert_eq!(
            field(&FemParams { material: [(3, soft)].into(), ..FemParams::default() }),
            "material.3.poisson"
        );
        let hard = Elastic { young: Some(f64::NAN), ..Elastic::default() };
        assert_eq!(
            field(&FemParams { material: [(3, hard)].into(), ..FemParams::default() }),
            "material.3.young"
        );
        assert_eq!(field(&FemParams { filler: 0.0, ..FemParams::default() }), "filler");
        assert!(FemParams::default().check().is_ok() && OctreeParams::default().check().is_ok());
    }
}
