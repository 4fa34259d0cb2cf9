use ivd_core::ParamError;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::cut::{Clip, ClipSpace};
use crate::shells::{MOST_SHELLS, Shell};
use crate::surroundings::Surroundings;
use crate::written;

/// What a ray makes of the values along it.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub enum Mode {
    /// Direct volume rendering: emission and absorption by the transfer function, post-classified.
    #[default]
    Dvr,
    /// The greatest value, as grey over [`RenderParams::window`].
    Mip,
    /// The least value, as grey over [`RenderParams::window`].
    Minip,
    /// The mean value, as grey over [`RenderParams::window`]; the last, shorter step counts by its length.
    Mean,
    /// The first local maximum at or above a threshold, else the greatest value, as grey over [`RenderParams::window`].
    Lmip {
        /// In real values; without it the middle of the volume's range.
        threshold: Option<f64>,
    },
    /// The greatest grey, where what lies before a sample dims it.
    AttenuatedMip {
        /// White all along the volume's diagonal dims by `exp(−attenuation)`.
        attenuation: f64,
    },
    /// As [`Mode::Dvr`], by slices.
    Slices {
        /// How many; without it twice as many as voxels lie along what they lie across.
        count: Option<usize>,
        /// What they lie across.
        across: Across,
    },
    /// As [`Mode::Dvr`], by slices that are sheared and a picture that is warped.
    ShearWarp {
        /// How many; without it twice as many as voxels lie along the axis that they lie across.
        count: Option<usize>,
    },
    /// The first place where the value reaches `value`, as a lit opaque surface.
    Iso {
        /// Isovalue, in real values.
        value: f64,
    },
}

/// What slices lie across.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum Across {
    /// The grid's axis that the view runs along most (object-aligned).
    #[default]
    Axis,
    /// The view (view-aligned).
    View,
}

impl Mode {
    /// Whether colours are those of a transfer function.
    pub(crate) fn is_coloured(self) -> bool {
        self == Self::Dvr || self.is_by_slices()
    }

    /// Whether emission and absorption are gathered by slices.
    pub(crate) fn is_by_slices(self) -> bool {
        matches!(self, Self::Slices { .. } | Self::ShearWarp { .. })
    }
}

/// Most that white along the diagonal dims, as a power of e.
pub(crate) const MOST_ATTENUATION: f64 = 1000.0;

/// Most slices.
pub(crate) const MOST_SLICES: usize = 65536;

/// Most rays along a side of a pixel.
pub(crate) const MOST_ANTIALIAS: usize = 8;

/// Most pictures of a turn.
pub(crate) const MOST_FRAMES: usize = 720;

/// What colour and opacity a step of a ray gets from a transfer function.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum Classification {
    /// Those of the value at its middle.
    #[default]
    Post,
    /// Those of all values from that at its one end to that at its other: thin layers aren't stepped over, so that a step of a voxel shows
    /// what takes a quarter of one otherwise. Not with a transfer function whose colours go by label or gradient.
    PreIntegrated,
}

/// How the scene is projected onto the picture.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum Projection {
    /// Parallel rays: lengths can be read off the picture.
    #[default]
    Orthographic,
    /// Rays from one eye point, `field_of_view` across the shorter side at zoom 1.
    Perspective,
}

/// A side of the patient that a scene is seen from.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum Side {
    /// The patient's left: 90, 0.
    Left,
    /// The patient's right: 270, 0.
    Right,
    /// The face: 0, 0.
    Front,
    /// From behind: 180, 0.
    Back,
    /// From above the head: 0, 90.
    Top,
    /// From below the feet: 0, −90.
    Bottom,
    /// As front.
    Anterior,
    /// As back.
    Posterior,
    /// As top.
    Superior,
    /// As bottom.
    Inferior,
}

impl Side {
    /// Azimuth and elevation of the camera (degrees).
    pub fn angles(self) -> [f64; 2] {
        match self {
            Self::Front | Self::Anterior => [0.0, 0.0],
            Self::Left => [90.0, 0.0],
            Self::Back | Self::Posterior => [180.0, 0.0],
            Self::Right => [270.0, 0.0],
            Self::Top | Self::Superior => [0.0, 90.0],
            Self::Bottom | Self::Inferior => [0.0, -90.0],
        }
    }
}

/// What a picture holds at zoom 1.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum Fit {
    /// All that is seen: bricks (8³ voxels) that the transfer function doesn't leave clear, that reach the isovalue, or whose values rise above
    /// the lowest twentieth of a projection's window; of a deformed volume at rest and as it is deformed.
    #[default]
    Visible,
    /// The sphere round the whole volume, across the shorter side, whatever the angles.
    Volume,
}

/// Where the scene is seen from. The camera looks at the middle of what the picture holds at zoom 1, as [`Fit`] says, or at a place that is given.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default)]
pub struct View {
    /// Azimuth and elevation of the camera. Azimuth turns it about the body axis: 0 from the front, 90 from the patient's left, 180 from
    /// behind. Elevation, −90 to 90, is its height: 90 from the head, −90 from the feet (anterior up, as axial slices are shown).
    /// Or the side of the patient.
    #[serde(rename = "view", deserialize_with = "written::angles")]
    #[schemars(with = "written::Angles", extend("x-unit" = "degrees"))]
    pub angles: [f64; 2],
    /// Magnification; at 1 the picture shows what `fit` selects.
    #[schemars(range(min = 0.001, max = 1_000_000.0), extend("x-unit" = "1"))]
    pub zoom: f64,
    /// Parallel or perspective.
    pub projection: Projection,
    /// What lies in the middle of the picture (mm, RAS); without it the middle of what the picture holds at zoom 1.
    #[schemars(extend("x-unit" = "mm"))]
    pub target: Option<[f64; 3]>,
    /// Turns the camera about its line of sight, clockwise: what was up leans to the picture's left.
    #[schemars(range(min = -360.0, max = 360.0), extend("x-unit" = "degrees"))]
    pub roll: f64,
    /// Angle across the picture's shorter side at zoom 1, in perspective: the wider, the nearer the eye.
    #[schemars(range(min = 1.0, max = 150.0), extend("x-unit" = "degrees"))]
    pub field_of_view: f64,
    /// In perspective, the distance from the eye to what lies in the middle of the picture; the eye may lie inside the volume. Default: the distance at which zoom 1 shows
    /// what `fit` selects.
    #[schemars(extend("x-unit" = "mm", "exclusiveMinimum" = 0.0))]
    pub distance: Option<f64>,
}

impl View {
    /// From the front, parallel.
    pub const FRONT: Self = Self {
        angles: [0.0; 2],
        zoom: 1.0,
        projection: Projection::Orthographic,
        target: None,
        roll: 0.0,
        field_of_view: 30.0,
        distance: None,
    };
}

impl Default for View {
    /// From somewhat aside and above, which shows more than the front does.
    fn default() -> Self {
        Self { angles: [30.0, 15.0], ..Self::FRONT }
    }
}

/// What the picture is to be.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default)]
#[allow(clippy::struct_excessive_bools, reason = "keys of a scene, each a question of its own")]
pub struct RenderParams {
    /// What a ray makes of the values along it; in scenes the method.
    #[serde(skip)]
    pub mode: Mode,
    /// What of the surroundings takes light away, in modes dvr and iso; in scenes keys of these.
    #[serde(skip)]
    pub surroundings: Surroundings,
    /// Surfaces about that of mode iso that are seen through; in scenes a key of it.
    #[serde(skip)]
    pub shells: Vec<Shell>,
    /// Values that modes mip, minip, mean, lmip and attenuated-mip draw black and white; without it the volume's range. In scenes a key of these.
    #[serde(skip)]
    pub window: Option<[f64; 2]>,
    /// Width and height of the picture, or one number for a square.
    #[serde(deserialize_with = "written::size")]
    #[schemars(with = "written::Size", extend("x-unit" = "pixels"))]
    pub size: [usize; 2],
    /// Where from.
    #[serde(flatten)]
    pub view: View,
    /// What the picture holds at zoom 1.
    pub fit: Fit,
    /// Distance of samples along a ray, as a fraction of the smallest spacing.
    #[schemars(range(min = 0.01, max = 10.0), extend("x-unit" = "1", "x-knob" = "accuracy"))]
    pub step: f64,
    /// What colour and opacity a step gets from the transfer function.
    pub classification: Classification,
    /// Opacity at which a ray ends; above 1 no ray ends early.
    #[schemars(extend("x-unit" = "1", "exclusiveMinimum" = 0.0, "x-knob" = "accuracy"))]
    pub termination: f64,
    /// Whether gradients light the volume. A surface (mode iso) is always lit.
    pub shading: bool,
    /// Whether bricks that hold nothing to see are passed over: speed, never the pixels.
    #[schemars(extend("x-how" = true))]
    pub skip: bool,
    /// Whether a scale bar is drawn, and letters of orientation where the volume's file says that its axes are the patient's.
    pub annotate: bool,
    /// Whether a cube at the top right shows the patient's axes, its sides lettered, where the volume's file says that they are those.
    pub cube: bool,
    /// Whether a bar at the bottom right tells what values the picture's greys or colours stand for; not in modes iso and attenuated-mip, nor where colours go by label or gradient.
    pub legend: bool,
    /// Background, straight linear RGBA.
    #[schemars(inner(range(min = 0.0, max = 1.0)), extend("x-unit" = "1"))]
    pub background: [f64; 4],
    /// Background at the picture's bottom, `background` being that at its top: between them colours change evenly to the eye. Without it all is `background`.
    #[schemars(inner(range(min = 0.0, max = 1.0)), extend("x-unit" = "1"))]
    pub background_bottom: Option<[f64; 4]>,
    /// Rays along each side of a pixel, whose light is averaged: 2 or 3 take the stairs off edges, at 4 or 9 times the work.
    #[schemars(range(min = 1, max = MOST_ANTIALIAS), extend("x-unit" = "1"))]
    pub antialias: usize,
    /// Pictures of a full turn about the body's axis, from `view` on, all of one scale; 1 is a still picture. `.gif`, `.apng` and `.png` hold them as an animation.
    #[schemars(range(min = 1, max = MOST_FRAMES), extend("x-unit" = "1"))]
    pub turntable: usize,
    /// Whether the light that a picture is made of is kept beside it, as `.exr` files hold it: linear, without background, letters and outline.
    pub keep_light: bool,
    /// Pixels (of the first picture of a turntable), as column and row from the top left, to report on: what each shows, which is the place in the patient, before and after the deformation, with voxel, value
    /// and label.
    #[schemars(extend("x-unit" = "pixels"))]
    pub picks: Vec<[usize; 2]>,
    /// What is shown: half spaces, by a point of their plane and a normal towards their inside, and boxes along the world's axes, by their lowest and
    /// highest corner; what lies in all of them. Cut faces are lit as the planes lie.
    pub clip: Vec<Clip>,
    /// Where planes and boxes lie: where the deformed volume is, or where it was before.
    pub clip_space: ClipSpace,
    /// Colour of a surface in mode iso, linear RGB.
    #[schemars(inner(range(min = 0.0, max = 1.0)), extend("x-unit" = "1"))]
    pub surface: [f64; 3],
}

impl Default for RenderParams {
    fn default() -> Self {
        Self {
            mode: Mode::Dvr,
            surroundings: Surroundings::default(),
            shells: Vec::new(),
            window: None,
            size: [512; 2],
            view: View::default(),
            fit: Fit::Visible,
            step: 0.5,
            classification: Classification::Post,
            termination: 0.99,
            shading: true,
            skip: true,
            annotate: true,
            turntable: 1,
            keep_light: false,
            cube: false,
            legend: false,
            background: [0.0, 0.0, 0.0, 1.0],
            background_bottom: None,
            antialias: 1,
            picks: Vec::new(),
            clip: Vec::new(),
            clip_space: ClipSpace::Deformed,
            surface: [0.80, 0.72, 0.58],
        }
    }
}

impl RenderParams {
    /// Checks every field against its domain.
    ///
    /// # Errors
    /// [`ParamError`] names the first field that leaves it.
    pub fn check(&self) -> Result<(), ParamError> {
        ivd_core::op::check_fields(self)?;
        ivd_core::op::check_fields(&self.surroundings)?;
        self.check_together()
    }

    /// Checks what a mode asks for.
    fn check_mode(&self) -> Result<(), ParamError> {
        match self.mode {
            Mode::Iso { value } if !value.is_finite() => {
                Err(ParamError::new("iso", format!("{value}"), "give a finite isovalue"))
            }
            Mode::Lmip { threshold: Some(value) } if !value.is_finite() => {
                Err(ParamError::new("threshold", format!("{value}"), "give a finite value"))
            }
            Mode::AttenuatedMip { attenuation } if !(0.0..=MOST_ATTENUATION).contains(&attenuation) => {
                Err(ParamError::new("attenuation", format!("{attenuation}"), "give 0 … 1000"))
            }
            Mode::AttenuatedMip { .. } if self.legend => {
                let problem = "greys tell how deep a value lies, too";
                Err(ParamError::new("legend", problem, "use mode mip, or leave it out"))
            }
            Mode::Iso { .. } if self.legend => {
                let problem = "a surface has one colour, which stands for no values";
                Err(ParamError::new("legend", problem, "use another mode, or leave it out"))
            }
            Mode::Mean if !self.picks.is_empty() => {
                let problem = "a mean is of all samples of a ray, so that a pixel shows no place";
                Err(ParamError::new("picks", problem, "use another mode, or leave them out"))
            }
            Mode::Slices { count: Some(count), .. } | Mode::ShearWarp { count: Some(count) }
                if !(1..=MOST_SLICES).contains(&count) =>
            {
                Err(ParamError::new("slices", format!("{count}"), format!("give 1 … {MOST_SLICES}")))
            }
            Mode::Slices { .. } | Mode::ShearWarp { .. }
                if self.classification == Classification::PreIntegrated =>
            {
                let problem = "slices have the values on them, and none between";
                Err(ParamError::new("classification", problem, "use post, or mode dvr"))
            }
            Mode::Dvr
            | Mode::Slices { .. }
            | Mode::ShearWarp { .. }
            | Mode::Mip
            | Mode::Minip
            | Mode::Mean
            | Mode::Lmip { .. }
            | Mode::AttenuatedMip { .. }
            | Mode::Iso { .. } => Ok(()),
        }
    }

    /// Checks the surfaces that are seen through.
    fn check_shells(&self) -> Result<(), ParamError> {
        if self.shells.len() > MOST_SHELLS {
            let problem = format!("{} surfaces", self.shells.len());
            return Err(ParamError::new("shells", problem, format!("give at most {MOST_SHELLS}")));
        }
        if !self.shells.is_empty() && self.surroundings.are_asked() {
            let problem = "ambient occlusion and shadows are of surfaces that nothing is seen through";
            return Err(ParamError::new("shells", problem, "leave ao and shadow out, or the shells"));
        }
        let check = |(i, shell): (usize, &Shell)| {
            ivd_core::op::check_fields(shell).map_err(|problem| problem.under(&format!("shells.{i}")))
        };
        self.shells.iter().enumerate().try_for_each(check)
    }

    /// Checks what the schema of a field can't say.
    pub(crate) fn check_together(&self) -> Result<(), ParamError> {
        self.check_mode()?;
        self.check_shells()?;
        // Both ends and their distance are numbers of 32 bits.
        let is_window = |[low, high]: &[f64; 2]| low < high && ((low.abs() + high.abs()) as f32).is_finite();
        if let Some([low, high]) = self.window.filter(|window| !is_window(window)) {
            let remedy = "give the value that is black, then a greater one that is white";
            return Err(ParamError::new("window", format!("{low}, {high}"), remedy));
        }
        self.clip.iter().try_for_each(Clip::check)?;
        let elevation = self.view.angles[1];
        if !(-90.0..=90.0).contains(&elevation) {
            let problem = format!("an elevation of {elevation} degrees");
            return Err(ParamError::new("view", problem, "give −90 … 90 degrees"));
        }
        let [width, height] = self.size;
        let most = written::LONGEST / self.antialias.max(1);
        if width.max(height) > most {
            let problem = format!("{width} × {height} pixels of {0} × {0} rays", self.antialias);
            return Err(ParamError::new(
                "antialias",
                problem,
                format!("give sides of at most {most} pixels, or fewer rays"),
            ));
        }
        if let Some([x, y]) = self.picks.iter().find(|[x, y]| *x >= width || *y >= height) {
            let problem = format!("{x}, {y} in a picture of {width} × {height} pixels");
            return Err(ParamError::new(
                "picks",
                problem,
                "count columns and rows from 0, from the top left",
            ));
        }
        match (self.view.distance, self.view.projection) {
            (Some(_), Projection::Orthographic) => {
                let problem = "parallel rays come from no eye, so that it has no distance";
                Err(ParamError::new("distance", problem, "use perspective, or zoom"))
            }
            _ => Ok(()),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_field_out_of_its_domain_is_named() {
        assert!(RenderParams::default().check().is_ok());
        let bad = |params: RenderParams| params.check().unwrap_err().field;
        let ok = RenderParams::default;
        assert_eq!(bad(RenderParams { size: [0, 8], ..ok() }), "size.0");
        assert_eq!(bad(RenderParams { step: f64::NAN, ..ok() }), "step");
        assert_eq!(bad(RenderParams { termination: 0.0, ..ok() }), "termination");
        for window in [[1.0, 1.0], [2.0, 1.0], [0.0, f64::INFINITY], [f64::NAN, 1.0], [-1e308, 1e308]] {
            assert_eq!(bad(RenderParams { window: Some(window), ..ok() }), "window");
        }
        assert_eq!(bad(RenderParams { mode: Mode::Iso { value: f64::NAN }, ..ok() }), "iso");
        let clip = |clip| bad(RenderParams { clip: vec![clip], ..ok() });
        assert_eq!(clip(Clip::default()), "clip");
        assert_eq!(clip(Clip { min: Some([0.0; 3]), ..Clip::plane([0.0; 3], [1.0; 3]) }), "clip");
        assert_eq!(clip(Clip::plane([0.0; 3], [0.0; 3])), "clip");
        assert_eq!(clip(Clip::cuboid([0.0, 2.0, 0.0], [1.0; 3])), "clip");
        assert!(clip(Clip::plane([f64::NAN; 3], [1.0; 3])).starts_with("clip"));
        let view = View { angles: [0.0, 91.0], ..View::default() };
        assert_eq!(bad(RenderParams { view, ..ok() }), "view");
        let view = View { distance: Some(50.0), ..View::default() };
        assert_eq!(bad(RenderParams { view, ..ok() }), "distance");
        let view = View { target: Some([f64::NAN; 3]), ..View::default() };
        assert_eq!(bad(RenderParams { view, ..ok() }), "target");
        assert_eq!(bad(RenderParams { background: [0.0, 2.0, 0.0, 1.0], ..ok() }), "background.1");
        let background_bottom = Some([0.0, 0.0, 0.0, -1.0]);
        assert!(bad(RenderParams { background_bottom, ..ok() }).starts_with("background_bottom"));
        assert_eq!(bad(RenderParams { antialias: 9, ..ok() }), "antialias");
        assert_eq!(bad(RenderParams { antialias: 2, size: [20_000, 1], ..ok() }), "antialias");
        assert_eq!(bad(RenderParams { mode: Mode::Iso { value: 1.0 }, legend: true, ..ok() }), "legend");
    }
}
