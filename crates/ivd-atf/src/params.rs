use ivd_core::{Labels, Volume, slots};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// What opacities go by.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum OpacityRule {
    /// Every material is seen in proportion to what it would cover alone.
    #[default]
    Visibility,
    /// The strength of a class's border, and the inverse of its size.
    Border,
}

/// Which colours classes get.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum Palette {
    /// `tissue` for values in Hounsfield units, else `safe`.
    #[default]
    Auto,
    /// Bone ivory, muscle red-brown, fat yellow, by Hounsfield value; other scans from dark red over flesh to ivory by value.
    Tissue,
    /// Eight colours that people with any colour vision tell apart.
    Safe,
    /// Yellow, green, blue by value, as in the thesis's figures.
    Thesis,
}

/// What values mean.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum ValueScale {
    /// Hounsfield units if they reach from at most -900 to at least 100, else plain.
    #[default]
    Auto,
    /// Hounsfield units of computed tomography: classes of which more than half is gas are clear.
    Hounsfield,
    /// Of no known meaning: the border of the volume tells what is background.
    Plain,
}

/// What the transfer function is to be.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default)]
pub struct Params {
    /// Samples of each row of the table, over the volume's range.
    #[schemars(range(min = 2, max = 65536), extend("x-unit" = "samples", "x-knob" = "accuracy"))]
    pub resolution: usize,
    /// What opacities go by.
    pub opacity: OpacityRule,
    /// Which colours classes get.
    pub palette: Palette,
    /// What values mean.
    pub values: ValueScale,
    /// Directions that visibility is looked at from: the six sides of the grid, then its eight corners.
    #[schemars(range(min = 1, max = 14), extend("x-unit" = "1"))]
    pub views: usize,
    /// Greatest opacity over the reference length; by border strength, that of the most prominent class.
    #[schemars(range(min = 0.0, max = 1.0), extend("x-unit" = "1"))]
    pub max_opacity: f64,
    /// Opacity below which no material falls, at most `max_opacity`: a class that hardly stands out stays visible.
    #[schemars(range(min = 0.0, max = 1.0), extend("x-unit" = "1"))]
    pub min_opacity: f64,
    /// With opacities by border strength, the power of "inverse size": a class of share `n` of the voxels is weighed by `n` to the minus this.
    /// At 1/3 it is an inverse length, so that rays gather about as much in a large class as in a small one.
    #[schemars(range(min = 0.0), extend("x-unit" = "1"))]
    pub size_exponent: f64,
    /// Half width of an edge in standard deviations of the narrower class; 0 for hard edges.
    #[schemars(range(min = 0.0), extend("x-unit" = "1"))]
    pub softness: f64,
    /// Isovalue that splits the volume, where it isn't coloured by its classes.
    #[schemars(extend("x-unit" = "that of the values", "x-from" = "lattice.iso", "x-unless" = "boundary.class"))]
    pub iso: Option<f64>,
}

impl Default for Params {
    fn default() -> Self {
        Self {
            resolution: 1024,
            opacity: OpacityRule::Visibility,
            palette: Palette::Auto,
            values: ValueScale::Auto,
            views: 6,
            max_opacity: 0.6,
            min_opacity: 0.01,
            size_exponent: 1.0 / 3.0,
            softness: 1.0,
            iso: None,
        }
    }
}

slots! {
    /// What is coloured, and by which classes.
    pub struct Inputs<'a> { volume: &'a Volume, labels: Option<&'a Labels> }
}

/// How a material is seen.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct MaterialVisibility {
    /// The class.
    pub class: u16,
    /// Its share of all that is seen, over all views.
    pub visibility: f64,
    /// The share that was aimed at.
    pub target: f64,
    /// Mean opacity that it would have alone at the greatest opacity, on rays that meet matter.
    pub alone: f64,
}

/// Two materials that touch and whose colours look alike to somebody.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct ClosePair {
    /// The classes.
    pub classes: [u16; 2],
    /// Least ΔE₀₀ over normal vision, protanopia, deuteranopia and tritanopia.
    pub difference: f64,
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
    /// Classes that are clear: what lies round the matter, or gas.
    #[schemars(extend("x-unit" = "1"))]
    pub background: Vec<u16>,
    /// Classes that are only the way from one class to another: they have no opacity and colour of their own.
    #[schemars(extend("x-unit" = "1"))]
    pub transitions: Vec<u16>,
    /// How each material is seen; empty where opacities don't go by visibility.
    #[schemars(extend("x-unit" = "1"))]
    pub visibility: Vec<MaterialVisibility>,
    /// Kullback–Leibler divergence of what is seen from what was aimed at.
    #[schemars(extend("x-unit" = "1"))]
    pub divergence: f64,
    /// Rounds in which opacities were changed.
    #[schemars(extend("x-unit" = "1"))]
    pub rounds: u32,
    /// Directions that were looked from.
    #[schemars(extend("x-unit" = "1"))]
    pub views: u32,
    /// Mean opacity of rays that meet background only.
    #[schemars(extend("x-unit" = "1"))]
    pub background_opacity: f64,
    /// Rays that meet matter and are less than half opaque, or the reverse, per ray that meets matter.
    #[schemars(extend("x-unit" = "1"))]
    pub silhouette_difference: f64,
    /// Materials that touch and whose colours differ by a ΔE₀₀ of less than 20 to somebody, nearest first; at most 64.
    #[schemars(extend("x-unit" = "1"))]
    pub close_pairs: Vec<ClosePair>,
}
