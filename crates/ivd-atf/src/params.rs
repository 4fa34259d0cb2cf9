use ivd_core::op::check_fields;
use ivd_core::{Labels, ParamError, Volume, slots};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// What opacities go by.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum OpacityRule {
    /// Every material is visible by what it would cover alone and by how much of it lies in front.
    #[default]
    Visibility,
    /// The strength of a class's border, and the inverse of its size.
    Border,
}

/// What colours and opacities are looked up by.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum Axes {
    /// The value (and the label, where values don't tell classes apart).
    #[default]
    Value,
    /// The value and the magnitude of the gradient: where a boundary passes through the values of a third material, it isn't drawn as that.
    ValueGradient,
}

/// Which colours classes get.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum Palette {
    /// `tissue` for values in Hounsfield units and for volumes whose file says that they are magnetic resonance, else `safe`; `safe`, too, where
    /// labels leave at least 1 % of the voxels unlabelled (label 0) and values don't tell the labelled parts apart.
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
    /// Hounsfield units if they reach from at most -900 to at least 100 and the file doesn't say that they are magnetic resonance, else plain.
    #[default]
    Auto,
    /// Hounsfield units of computed tomography: classes of which more than half is gas are clear, unless there is nothing else.
    Hounsfield,
    /// Of no known meaning: the border of the volume tells what is background.
    Plain,
}

/// What the transfer function is to be.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default)]
pub struct Params {
    /// Samples of each row of the table, over the volume's range or, where a few voxels stretch that, over the bulk of the values.
    #[schemars(range(min = 2, max = 65536), extend("x-unit" = "samples", "x-knob" = "accuracy"))]
    pub resolution: usize,
    /// What colours and opacities are looked up by.
    pub axes: Axes,
    /// What opacities go by.
    pub opacity: OpacityRule,
    /// Which colours classes get.
    pub palette: Palette,
    /// What values mean.
    pub values: ValueScale,
    /// Directions from which visibility is measured: along the grid's axes both ways, then along its eight diagonals.
    #[schemars(range(min = 1, max = 14), extend("x-unit" = "1"))]
    pub views: usize,
    /// Greatest opacity over the reference length; by border strength, that of the most prominent class.
    #[schemars(range(min = 0.0, max = 1.0), extend("x-unit" = "1"))]
    pub max_opacity: f64,
    /// Least opacity of a material, at most `max_opacity`: a class that hardly stands out stays visible. A material that no ray meets
    /// has `max_opacity`: it hides nothing.
    #[schemars(range(min = 0.0, max = 1.0), extend("x-unit" = "1"))]
    pub min_opacity: f64,
    /// With opacities by border strength, the power of "inverse size": a class of share `n` of the voxels is weighed by `n` to the minus this.
    /// At 1/3 it is an inverse length, so that rays gather about as much in a large class as in a small one.
    #[schemars(range(min = 0.0), extend("x-unit" = "1"))]
    pub size_exponent: f64,
    /// Half width of an edge in standard deviations of the narrower class; 0 for hard edges.
    #[schemars(range(min = 0.0), extend("x-unit" = "1"))]
    pub softness: f64,
    /// Isovalue that splits the volume, where it isn't coloured by its classes. What lies above is then the only material, and has the greatest
    /// opacity by either rule; its colour is that of `palette` at this value.
    #[schemars(extend("x-unit" = "real units", "x-from" = "lattice.iso", "x-unless" = "boundary.class"))]
    pub iso: Option<f64>,
}

impl Default for Params {
    fn default() -> Self {
        Self {
            resolution: 1024,
            axes: Axes::Value,
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

impl Params {
    /// Checks every field, and that the bounds of opacity are in order.
    pub(crate) fn require_valid(&self) -> Result<(), ParamError> {
        check_fields(self)?;
        self.require_bounds_in_order()
    }

    pub(crate) fn require_bounds_in_order(&self) -> Result<(), ParamError> {
        if self.min_opacity <= self.max_opacity {
            return Ok(());
        }
        Err(ParamError::new(
            "min_opacity",
            format!("{}", self.min_opacity),
            format!("give 0 … {}, which is max_opacity", self.max_opacity),
        ))
    }
}

slots! {
    /// What is coloured, and by which classes.
    pub struct Inputs<'a> { volume: &'a Volume, labels: Option<&'a Labels> }
}
