use std::collections::BTreeMap;

use ivd_core::ParamError;
use serde::{Deserialize, Serialize};

/// How the motion of the lattice is carried to the voxels.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum MapMethod {
    /// The motion of the nearest lattice point, weighted by depth (I-DOGME).
    #[default]
    Octree,
    /// The smoothest motion that follows the lattice: least squared second derivatives in Ω, inside the lattice and outside.
    Biharmonic,
    /// The equilibrium of elastic matter, neo-Hookean, in which the lattice moves.
    Fem,
}

/// Weight `w` of the nearest lattice point's motion at depth `t · depth_mm` inside the lattice; 0 from `t = 1` on.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
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
    /// The weight at `t = depth / depth_mm` (no unit), `t ≥ 0`.
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

/// `1 − 3t² + 2t³`, 1 below 0 and 0 from 1 on: falls from 1 to 0 with no slope at either end; steepest −3/2 half way.
pub(crate) fn smooth_fall(t: f64) -> f64 {
    let t = t.clamp(0.0, 1.0);
    1.0 - t * t * (3.0 - 2.0 * t)
}

/// What happens outside the lattice.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Outside {
    /// A band round the lattice moves along, falling to 0 over the margin, so that space stays in one piece.
    #[default]
    Band,
    /// The part moves alone; what it leaves becomes background.
    Free,
}

/// What a class is made of; what isn't given is as where it lies: inside the lattice, or outside.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Elastic {
    /// Young's modulus relative to that of matter without a class of its own inside the lattice (no unit), 10⁻³ … 10³.
    pub young: Option<f64>,
    /// Poisson's ratio ν (no unit), 0 … 0.45.
    pub poisson: Option<f64>,
}

/// How the motion of a lattice becomes a displacement of voxels.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct MapParams {
    /// Method.
    pub method: MapMethod,
    /// Weight by depth inside the lattice; read by [`MapMethod::Octree`].
    pub weight: DepthWeight,
    /// Depth at which the weight reaches 0, in mm, > 0; read by [`MapMethod::Octree`]. Without it the largest reach of a
    /// handle, at least four times the largest motion.
    pub depth_mm: Option<f64>,
    /// Width of the band outside the lattice and of the fall-off beyond the reach, in mm, > 0. Without it four times the
    /// largest motion, at least two voxel diagonals.
    pub margin_mm: Option<f64>,
    /// Voxels along a cell's edge: 1, 2 or 4, and as many along the other axes as give about the same length; read by
    /// [`MapMethod::Biharmonic`], and by [`MapMethod::Fem`] for its finest cells. Without it four, and fewer where the smallest
    /// ball and its margin are less than 24 voxels wide.
    pub cell: Option<u8>,
    /// Poisson's ratio ν (no unit), 0 … 0.45: how much matter keeps its volume; read by [`MapMethod::Fem`]. Beyond 0.45 its
    /// cells would be far too stiff.
    pub poisson: f64,
    /// Young's modulus of what lies outside the lattice, relative to the inside's (no unit), 10⁻⁴ … 1; read by
    /// [`MapMethod::Fem`].
    pub filler: f64,
    /// Elasticity by label where labels are given, inside the lattice and outside, there not with [`Outside::Free`]; read by
    /// [`MapMethod::Fem`].
    pub classes: BTreeMap<u16, Elastic>,
    /// What happens outside the lattice.
    pub outside: Outside,
    /// How far the lattice points that move most may be left behind to keep the map free of folds, as a fraction of
    /// their motion (root mean square), 0 … 1. Beyond it the map isn't what was asked for, and is refused.
    pub tolerance: f64,
}

impl Default for MapParams {
    fn default() -> Self {
        Self {
            method: MapMethod::default(),
            weight: DepthWeight::default(),
            depth_mm: None,
            margin_mm: None,
            cell: None,
            poisson: 0.4,
            filler: 0.01,
            classes: BTreeMap::new(),
            outside: Outside::default(),
            tolerance: 0.5,
        }
    }
}

impl MapParams {
    /// # Errors
    /// Names the field that is out of its domain.
    pub fn check(&self) -> Result<(), ParamError> {
        for (field, value) in [("depth_mm", self.depth_mm), ("margin_mm", self.margin_mm)] {
            if let Some(v) = value
                && !(v.is_finite() && v > 0.0)
            {
                return Err(ParamError::new(
                    field,
                    format!("{v} mm"),
                    "give a length above 0, or leave it out",
                ));
            }
        }
        if let Some(cell) = self.cell
            && ![1, 2, 4].contains(&cell)
        {
            return Err(ParamError::new("cell", format!("{cell} voxels"), "give 1, 2 or 4, or leave it out"));
        }
        let ratios = self.classes.values().filter_map(|class| class.poisson).chain([self.poisson]);
        if let Some(poisson) = ratios.into_iter().find(|ratio| !(0.0..=0.45).contains(ratio)) {
            return Err(ParamError::new("poisson", format!("{poisson}"), "give a ratio, 0 … 0.45"));
        }
        let moduli = self.classes.values().filter_map(|class| class.young);
        if let Some(young) = moduli.into_iter().find(|modulus| !(1e-3..=1e3).contains(modulus)) {
            return Err(ParamError::new("young", format!("{young}"), "give a ratio, 0.001 … 1000"));
        }
        if !(1e-4..=1.0).contains(&self.filler) {
            return Err(ParamError::new("filler", format!("{}", self.filler), "give a ratio, 0.0001 … 1"));
        }
        if !(0.0..=1.0).contains(&self.tolerance) {
            return Err(ParamError::new(
                "tolerance",
                format!("{}", self.tolerance),
                "give a fraction, 0 … 1",
            ));
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
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
    fn bad_lengths_are_named() {
        let bad = MapParams { margin_mm: Some(0.0), ..MapParams::default() };
        assert_eq!(bad.check().unwrap_err().field, "margin_mm");
        let bad = MapParams { tolerance: f64::NAN, ..MapParams::default() };
        assert_eq!(bad.check().unwrap_err().field, "tolerance");
        let bad = MapParams { cell: Some(3), ..MapParams::default() };
        assert_eq!(bad.check().unwrap_err().field, "cell");
        let bad = MapParams { poisson: 0.46, ..MapParams::default() };
        assert_eq!(bad.check().unwrap_err().field, "poisson");
        let soft = Elastic { poisson: Some(0.5), ..Elastic::default() };
        let bad = MapParams { classes: [(3, soft)].into(), ..MapParams::default() };
        assert_eq!(bad.check().unwrap_err().field, "poisson");
        let hard = Elastic { young: Some(f64::NAN), ..Elastic::default() };
        let bad = MapParams { classes: [(3, hard)].into(), ..MapParams::default() };
        assert_eq!(bad.check().unwrap_err().field, "young");
        let bad = MapParams { filler: 0.0, ..MapParams::default() };
        assert_eq!(bad.check().unwrap_err().field, "filler");
        assert!(MapParams::default().check().is_ok());
    }
}
