//! What tissues resist with, by name and by Hounsfield value.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Young's modulus (kPa) of flesh of which nothing is known: between those of muscle and liver.
pub const FLESH: f64 = 4.0;

/// A tissue by name, for anyone who has no moduli at hand: Young's moduli that were measured at small strains.
///
/// Measurements differ by several times with the person, the strain and the method; a shape depends only on how stiff tissues are relative to one another.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum Tissue {
    /// 129 kPa: of the forearm, by suction (Diridollou et al. 2000).
    Skin,
    /// 2.3 kPa: under the skin, at rest, by waves of 50 Hz; three times the shear modulus (Hatt et al. 2023).
    Fat,
    /// 3 kPa: relaxed, in the same way (Hatt et al. 2023).
    Muscle,
    /// 1.6 kPa: the mean of grey and white matter, by indentation (Budday et al. 2015).
    Brain,
    /// 6.3 kPa: healthy, by waves of 60 Hz; three times the shear modulus (Venkatesh et al. 2014).
    Liver,
    /// 0.74 kPa, one and a half times the pressure of 5 cm of water that keeps it open (Lai-Fook et al. 1976); ν 0.3, as its air can leave.
    Lung,
    /// Doesn't yield.
    Bone,
    /// 0.1 kPa: hardly resists being sheared; its volume is kept as closely as ν 0.45 does.
    Fluid,
    /// 0.01 kPa, ν 0.4: next to nothing.
    Air,
}

impl Tissue {
    /// Young's modulus (kPa) and Poisson's ratio; `None` for bone, which is rigid. ν is 0.45, the most that cells here bear, where flesh that
    /// can't lose its water would have nearly 0.5.
    pub fn moduli(self) -> Option<(f64, f64)> {
        let young = match self {
            Self::Skin => 129.0,
            Self::Fat => 2.3,
            Self::Muscle => 3.0,
            Self::Brain => 1.6,
            Self::Liver => 6.3,
            Self::Lung => return Some((0.74, 0.3)),
            Self::Bone => return None,
            Self::Fluid => 0.1,
            Self::Air => return Some((0.01, 0.4)),
        };
        Some((young, 0.45))
    }

    /// What tissue of a Hounsfield value is; `None` of what is neither air, lung, fat nor bone: flesh, which CT can't tell apart.
    ///
    /// Air up to −950, lung to −400, fat to −30, bone from 250 on. Vessels with contrast agent count as bone.
    pub fn of_hounsfield(value: f64) -> Option<Self> {
        Some(match value {
            v if v >= 250.0 => Self::Bone,
            v if v < -950.0 => Self::Air,
            v if v < -400.0 => Self::Lung,
            v if v < -30.0 => Self::Fat,
            _ => return None,
        })
    }
}
