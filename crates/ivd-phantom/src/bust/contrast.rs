//! What the bust is made of, and how bright each tissue is in a scan.

use super::super::params::Contrast;

/// A class of the truth, in the order of its labels.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[repr(u16)]
pub(in super::super) enum Tissue {
    Air,
    Skin,
    Fat,
    Muscle,
    Skull,
    Jaw,
    Teeth,
    Vertebrae,
    Discs,
    Eyes,
    Lenses,
    Fluid,
    Ventricles,
    Grey,
    White,
    Cerebellum,
    CerebellarWhite,
    Stem,
    Airway,
}

/// Name, value in T1-weighted MR, value in CT (0…1), by label. Values in MR follow the order of T1-weighted images, fat bright, cortical bone
/// and air dark; those in CT the order of Hounsfield units, soft tissue spread out as a soft-tissue window does.
pub(in super::super) const TISSUES: [(&str, f64, f64); 19] = [
    ("air", 0.02, 0.02),
    ("skin", 0.52, 0.37),
    ("fat", 0.88, 0.28),
    ("muscle", 0.38, 0.41),
    ("skull", 0.08, 0.78),
    ("jaw", 0.08, 0.78),
    ("teeth", 0.05, 0.97),
    ("vertebrae", 0.14, 0.70),
    ("discs", 0.30, 0.44),
    ("eyes", 0.22, 0.36),
    ("lenses", 0.40, 0.43),
    ("csf", 0.20, 0.35),
    ("ventricles", 0.20, 0.35),
    ("grey", 0.50, 0.50),
    ("white", 0.72, 0.47),
    ("cerebellum", 0.50, 0.50),
    ("cerebellar white", 0.72, 0.47),
    ("brain stem", 0.66, 0.47),
    ("airway", 0.02, 0.02),
];

impl Tissue {
    /// Noise-free value (0…1).
    pub(super) fn value(self, contrast: Contrast) -> f64 {
        let (_, mr, ct) = TISSUES[self as usize];
        match contrast {
            Contrast::Mr => mr,
            Contrast::Ct => ct,
        }
    }
}
