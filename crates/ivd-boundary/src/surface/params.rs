use ivd_core::{ClassChoice, ParamError};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::mixture::Noise;

/// What tells inside from outside.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum DataTerm {
    /// Distance from the mean of either side (Chan & Vese 2001).
    #[default]
    Means,
    /// How likely the value is on either side, by the distribution of its values.
    Likelihood,
    /// How likely the value is among those of the start (a normal distribution), or among all others (their histogram). Both stay as they
    /// are: for a part that is a small share of the scan, from a start that lies within it.
    Start,
    /// Distance from the mean of either side within `reach` (Lankton & Tannenbaum 2008): for a part whose brightness changes across it. The
    /// front moves from where it starts, which must lie within reach of the boundary.
    Local,
}

/// How a side's values are spread, for the likelihood.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum Distribution {
    /// As they are: a smoothed histogram.
    #[default]
    Histogram,
    /// A normal distribution.
    Gaussian,
    /// Rice's distribution: magnitudes with noise, as in MR.
    Rician,
    /// Two values and what lies between them, as at a blurred border, all with the same normal noise: for a scan of two materials.
    GaussianMixture,
    /// The same with the noise of magnitudes, as in MR.
    RicianMixture,
}

impl Distribution {
    /// The noise of a mixture, where it is one.
    pub(super) fn noise_of_mixture(self) -> Option<Noise> {
        match self {
            Self::GaussianMixture => Some(Noise::Gaussian),
            Self::RicianMixture => Some(Noise::Rician),
            Self::Histogram | Self::Gaussian | Self::Rician => None,
        }
    }
}

/// How the border's area is measured.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum AreaMeasure {
    /// The length of the gradient by forward differences: fast, and nearly the same in all directions.
    #[default]
    Smooth,
    /// Cut edges between voxels that share a face: a minimum cut.
    Faces,
    /// Cut edges between all 26 neighbours: a minimum cut, whose area is within a few per cent of the true one.
    Corners,
}

/// What a surface starts from.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum StartShape {
    /// A ball about the seed, or about the middle of the volume.
    Ball,
    /// A cube along the volume's axes about the seed, or about the middle (thesis, Figure 4.9).
    Cube,
    /// A box between two corners: `box_from` and `box_to`.
    Box,
    /// A class: `class`.
    Class,
    /// A ball about the seed, which must be given: `seed`.
    Seed,
}

/// A surface that finds the boundary of the part that it starts in: between two regions that differ as much as possible, with as little area
/// as possible.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default)]
pub struct SurfaceParams {
    /// What it starts from; a mask of your own takes its place. Without either, the box, class or seed that is given, else a ball about the
    /// middle of the volume.
    pub start: Option<StartShape>,
    /// A point (RAS) inside the part: the start is a ball or cube about it, or the class's piece there.
    #[schemars(extend("x-unit" = "mm"))]
    pub seed: Option<[f64; 3]>,
    /// Radius of the ball, half the edge of the cube; without it 3 voxels about a seed, and a fifth of the volume's shortest side about its
    /// middle.
    #[schemars(extend("x-unit" = "mm", "exclusiveMinimum" = 0.0))]
    pub radius: Option<f64>,
    /// One corner (RAS) of a box to start from, along the axes of space.
    #[schemars(extend("x-unit" = "mm"))]
    pub box_from: Option<[f64; 3]>,
    /// The corner opposite to `box_from`.
    #[schemars(extend("x-unit" = "mm"))]
    pub box_to: Option<[f64; 3]>,
    /// A class to start from: an id, densest or largest. Needs labels.
    #[schemars(extend("x-unit" = "1"))]
    pub class: Option<ClassChoice>,
    /// What tells inside from outside.
    pub data: DataTerm,
    /// How values are spread, for the likelihood; without it as they are, a smoothed histogram.
    pub distribution: Option<Distribution>,
    /// How far `local` looks; without it four mean edges of a voxel.
    #[schemars(extend("x-unit" = "mm", "exclusiveMinimum" = 0.0))]
    pub reach: Option<f64>,
    /// Steepness (values per mm) at which the border's area counts half, so that it prefers steep places, as geodesic active contours do
    /// (Caselles et al. 1997). Without it area counts the same everywhere.
    #[schemars(extend("x-unit" = "value/mm", "exclusiveMinimum" = 0.0))]
    pub edge: Option<f64>,
    /// Least and greatest value that count; values beyond, such as metal in a CT, are taken for these.
    #[schemars(extend("x-unit" = "value"))]
    pub window: Option<[f64; 2]>,
    /// Weight φ of smoothness against fit (thesis, equation 4.12); without it chosen by noise and contrast. The border's area weighs
    /// φ / (1 − φ) × the mean edge of a voxel × half the difference between what a voxel costs on its wrong side and on its right side.
    #[schemars(range(min = 1e-6, max = 0.999_999), extend("x-unit" = "1"))]
    pub phi: Option<f64>,
    /// How the border's area is measured at the end. Cuts are solved over the whole volume until no lower energy is possible: minutes at
    /// 256³.
    pub area: AreaMeasure,
    /// Whether to show how far the set's energy can be above the lowest for its statistics; over the whole volume, as with cuts.
    pub certify: bool,
    /// Leak guard: where the part is narrower than twice this it is cut, and what hangs on such a bridge stays out.
    #[schemars(range(min = 0.0), extend("x-unit" = "mm"))]
    pub open: f64,
    /// Whether holes inside the part become part of it. Voxels without data stay out.
    #[schemars(extend("x-alias" = ["!keep_holes"]))]
    pub fill_holes: bool,
    /// Most sweeps at each resolution.
    #[schemars(range(min = 1, max = 100_000), extend("x-unit" = "1", "x-knob" = "accuracy"))]
    pub sweeps: u32,
}

impl Default for SurfaceParams {
    fn default() -> Self {
        Self {
            start: None,
            seed: None,
            radius: None,
            box_from: None,
            box_to: None,
            class: None,
            data: DataTerm::Means,
            distribution: None,
            reach: None,
            edge: None,
            window: None,
            phi: None,
            area: AreaMeasure::Smooth,
            certify: false,
            open: 0.0,
            fill_holes: true,
            sweeps: 400,
        }
    }
}

impl SurfaceParams {
    /// Whether nothing tells of a start beside one that is drawn.
    ///
    /// # Errors
    /// Names the field.
    pub(super) fn check_beside_drawn(&self) -> Result<(), ParamError> {
        let given = [
            ("start", self.start.is_some()),
            ("seed", self.seed.is_some()),
            ("radius", self.radius.is_some()),
            ("box_from", self.box_from.is_some()),
            ("class", self.class.is_some()),
        ];
        given.into_iter().find(|(_, is_given)| *is_given).map_or(Ok(()), |(field, _)| {
            Err(ParamError::new(field, "given beside a start that is drawn", "leave one of them out"))
        })
    }

    /// Conditions on several fields.
    ///
    /// # Errors
    /// Names the field.
    pub(crate) fn check_together(&self) -> Result<(), ParamError> {
        let refused = |field: &str, problem: &str, remedy: &str| Err(ParamError::new(field, problem, remedy));
        if self.box_from.is_some() != self.box_to.is_some() {
            let missing = if self.box_from.is_some() { "box_to" } else { "box_from" };
            return refused(missing, "a box needs both of its corners", "give box_from and box_to");
        }
        if self.box_from.is_some() && (self.seed.is_some() || self.class.is_some()) {
            return refused("box_from", "given together with another start", "give one of them");
        }
        let is_other = |own: bool, field: &str| {
            own.then(|| ParamError::new(field, "given with another start", "leave it out, or change start"))
        };
        let (boxed, class) = (self.box_from.is_some(), self.class.is_some());
        match self.start {
            Some(StartShape::Box) if !boxed => {
                return refused("start", "a box without corners", "give box_from and box_to");
            }
            Some(StartShape::Class) if !class => {
                return refused("start", "no class is given to start from", "give class");
            }
            Some(StartShape::Seed) if self.seed.is_none() => {
                return refused("start", "no seed is given to start from", "give seed");
            }
            Some(StartShape::Ball | StartShape::Cube | StartShape::Seed) => {
                is_other(boxed, "box_from").or(is_other(class, "class")).map_or(Ok(()), Err)?;
            }
            Some(StartShape::Box | StartShape::Class) | None => {}
        }
        if let Some([low, high]) = self.window
            && low >= high
        {
            return Err(ParamError::new(
                "window",
                format!("{low} … {high} holds no values"),
                "give the lower value first",
            ));
        }
        if self.reach.is_some() && self.data != DataTerm::Local {
            return refused(
                "reach",
                "given for data that aren't local",
                "leave it out, or give data = local",
            );
        }
        if self.distribution.is_some() && self.data != DataTerm::Likelihood {
            return refused(
                "distribution",
                "given for data that aren't a likelihood",
                "leave it out, or give data = likelihood",
            );
        }
        let is_cut = self.area != AreaMeasure::Smooth;
        if self.edge.is_some() && (is_cut || self.certify) {
            return refused(
                "edge",
                "given for a certificate, whose area weighs alike everywhere",
                "leave one out",
            );
        }
        if self.data == DataTerm::Local && (is_cut || self.certify) {
            return refused("data", "local statistics have no certificate", "leave certify and area out");
        }
        if self.radius.is_some() && (self.class.is_some() || self.box_from.is_some()) {
            return refused("radius", "given with a start that has no radius", "leave it out");
        }
        Ok(())
    }
}
