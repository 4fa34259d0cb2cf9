use ivd_core::TransferFunction;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::params::Palette;

/// The visibility of a material.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct MaterialVisibility {
    /// The class.
    #[schemars(extend("x-unit" = "1"))]
    pub class: u16,
    /// Its share of all visibility, over all views.
    #[schemars(extend("x-unit" = "1"))]
    pub visibility: f64,
    /// The share that was aimed at.
    #[schemars(extend("x-unit" = "1"))]
    pub target: f64,
    /// Mean opacity that it would have as the only one, at the greatest opacity, on rays that meet matter.
    #[schemars(extend("x-unit" = "1"))]
    pub coverage: f64,
}

/// Two materials that touch and whose colours look alike to some viewers.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct ClosePair {
    /// The classes.
    #[schemars(extend("x-unit" = "1"))]
    pub classes: [u16; 2],
    /// Least ΔE₀₀ over normal vision, protanopia, deuteranopia and tritanopia.
    #[schemars(extend("x-unit" = "1"))]
    pub difference: f64,
}

/// A boundary between two classes, as an arc over values and gradients.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Boundary {
    /// The classes, the one of the lower mean first.
    #[schemars(extend("x-unit" = "1"))]
    pub classes: [u16; 2],
    /// Voxels of it.
    #[schemars(extend("x-unit" = "voxels"))]
    pub voxels: u64,
    /// Deviation of the Gaussian that blurs the step between the classes' means.
    #[schemars(extend("x-unit" = "mm"))]
    pub blur_mm: f64,
}

/// What a transfer function comes to.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Figures {
    /// Classes that have an entry: those that occur.
    #[schemars(extend("x-unit" = "1", "x-headline" = 1))]
    pub entries: usize,
    /// Least and greatest opacity of the entries over the reference length; zeros without entries.
    #[schemars(extend("x-unit" = "1"))]
    pub opacity_range: [f32; 2],
    /// Whether values were taken as Hounsfield units.
    pub hounsfield: bool,
    /// The palette that served.
    pub palette: Palette,
    /// Classes that are clear: what lies round the matter, or gas. Label 0 on voxels with data is among them.
    #[schemars(extend("x-unit" = "1"))]
    pub background: Vec<u16>,
    /// Classes that are only the way from one class to another: they have no opacity and colour of their own.
    #[schemars(extend("x-unit" = "1"))]
    pub transitions: Vec<u16>,
    /// Visibility of each material; empty where opacities don't go by visibility.
    #[schemars(extend("x-unit" = "1"))]
    pub visibility: Vec<MaterialVisibility>,
    /// Kullback–Leibler divergence of the visibility from what was aimed at, where opacities go by visibility.
    #[schemars(extend("x-unit" = "1"))]
    pub divergence: Option<f64>,
    /// Rounds in which opacities were changed; 0 where they don't go by visibility.
    #[schemars(extend("x-unit" = "1"))]
    pub rounds: u32,
    /// Directions from which visibility was measured; 0 likewise.
    #[schemars(extend("x-unit" = "1"))]
    pub views: u32,
    /// Mean opacity of rays that meet background only, where opacities go by visibility and such rays are met.
    #[schemars(extend("x-unit" = "1"))]
    pub background_opacity: Option<f64>,
    /// Rays that meet matter and are less than half opaque, or the reverse, per ray that meets matter; where opacities go by visibility and such
    /// rays are met.
    #[schemars(extend("x-unit" = "1"))]
    pub silhouette_difference: Option<f64>,
    /// Materials that touch and whose colours differ by a ΔE₀₀ of less than 20 to some viewers, nearest first; at most 64.
    #[schemars(extend("x-unit" = "1"))]
    pub close_pairs: Vec<ClosePair>,
    /// Boundaries between classes that were found, where colours go by gradient too.
    #[serde(default)]
    #[schemars(extend("x-unit" = "1"))]
    pub boundaries: Vec<Boundary>,
}

impl Figures {
    /// Figures of the entries alone.
    pub(crate) fn of_entries(transfer: &TransferFunction, palette: Palette, hounsfield: bool) -> Self {
        let opacities = || transfer.entries().iter().map(|entry| entry.opacity);
        let least = opacities().fold(f32::INFINITY, f32::min);
        let entries = transfer.entries().len();
        Self {
            entries,
            opacity_range: if entries == 0 { [0.0; 2] } else { [least, opacities().fold(0.0, f32::max)] },
            hounsfield,
            palette,
            background: Vec::new(),
            transitions: Vec::new(),
            visibility: Vec::new(),
            divergence: None,
            rounds: 0,
            views: 0,
            background_opacity: None,
            silhouette_difference: None,
            close_pairs: Vec::new(),
            boundaries: Vec::new(),
        }
    }
}
