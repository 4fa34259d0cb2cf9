//! The stage as scenes and commands see it.

mod modes;
mod moved;
mod volumetric;

use std::time::Instant;

use ivd_core::op::{Amount, Failure, Memory, Method, Op, Place, PlaceKind, Stage, method};
use ivd_core::{Displacement, Exec, Image, Labels, Lattice, TransferFunction, Volume, slots};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::{Pick, difference};
pub use modes::{AttenuatedMipParams, Greys, IsoParams, LmipParams, MeanParams, MinipParams, MipParams};
pub use moved::{MovedFigures, MovedParams};
pub use volumetric::{DvrParams, ShearWarpParams, SlicesParams};

/// The stage: its modes, and the pictures that a scene has of it.
pub const STAGE: Stage = Stage {
    name: "render",
    about: "Draws a volume.",
    selector: "mode",
    methods: METHODS,
    positional: &["volume"],
    places: &[
        Place {
            empty: &[DISPLACEMENT, "lattice", WHOLE],
            from: &[(FRAMING, DISPLACEMENT)],
            if_made: &[FRAMING],
            ..picture("before")
        },
        Place {
            needs: &[DISPLACEMENT],
            // What is clipped or combined has been deformed already.
            from: &[(VOLUME, "result"), (VOLUME, VOLUME), (WHOLE, VOLUME), (FRAMING, DISPLACEMENT)],
            with: &[(WHOLE, "result"), (FRAMING, "result")],
            unless: &[(DISPLACEMENT, "result"), (LABELS, "result")],
            empty: &["lattice"],
            ..picture("after")
        },
        Place {
            kind: PlaceKind::Fixed { method: &DIFFERENCE },
            amount: Amount::Pixels,
            ..picture("difference")
        },
        Place { kind: PlaceKind::Beside { method: &MOVED }, needs: &[DISPLACEMENT], ..picture("moved") },
    ],
    quiet: false,
    memory: Memory { voxel: 10, reached: 0, triangle: 100 },
};
/// The slot of what is drawn.
pub const VOLUME: &str = "volume";
/// The slot of what tells the parts apart.
pub(crate) const LABELS: &str = "labels";
/// The slot of a displacement that is shown.
pub const DISPLACEMENT: &str = "displacement";
/// The slot of a volume that decides camera and window, see [`crate::Scene::whole`].
pub const WHOLE: &str = "whole";
/// The slot of a displacement that a picture leaves room for.
pub const FRAMING: &str = "framing";

/// The place of a picture. What is clipped or combined has labels no more.
const fn picture(name: &'static str) -> Place {
    Place {
        variant: name,
        empty: &["lattice", FRAMING, WHOLE],
        unless: &[(LABELS, "result")],
        unread: "no output shows a picture",
        amount: Amount::Samples,
        ..Place::only(name)
    }
}

const METHODS: &[Method] = &[
    method::<DvrParams>("dvr"),
    // Without a transfer function there is nothing to compose; the maximum shows every volume.
    method::<MipParams>("mip").without("transfer"),
    method::<IsoParams>("iso"),
    method::<MinipParams>("minip"),
    method::<MeanParams>("mean"),
    method::<LmipParams>("lmip"),
    method::<AttenuatedMipParams>("attenuated-mip"),
    method::<SlicesParams>("slices"),
    method::<ShearWarpParams>("shear-warp"),
];
static MOVED: Method = method::<MovedParams>("moved");
static DIFFERENCE: Method = method::<DifferenceParams>("difference");

/// Where two pictures differ, amplified.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, JsonSchema)]
pub struct DifferenceParams {}

slots! {
    /// What is drawn with a transfer function.
    pub struct Coloured<'a> {
        volume: &'a Volume,
        transfer: Option<&'a TransferFunction>,
        labels: Option<&'a Labels>,
        displacement: Option<&'a Displacement>,
        framing: Option<&'a Displacement>,
        whole: Option<&'a Volume>,
        lattice: Option<&'a Lattice>,
    }
}
slots! {
    /// What is drawn without.
    pub struct Plain<'a> {
        volume: &'a Volume,
        displacement: Option<&'a Displacement>,
        framing: Option<&'a Displacement>,
        whole: Option<&'a Volume>,
        lattice: Option<&'a Lattice>,
    }
}
slots! {
    /// Two pictures of one size.
    pub struct Pair<'a> { before: &'a Image, after: &'a Image }
}

/// What a picture comes to.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct RenderFigures {
    /// Pictures made.
    #[schemars(extend("x-unit" = "1"))]
    pub frames: u32,
    /// Samples taken for each pixel of the picture, on average; those of rays that look for shade aren't counted.
    #[schemars(extend("x-unit" = "1"))]
    pub samples_per_pixel: f64,
    /// Share of the samples on the rays' way that were passed over because their brick is empty.
    #[schemars(extend("x-unit" = "1"))]
    pub skipped_fraction: f64,
    /// Pictures made in a second.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(extend("x-unit" = "1/s", "x-time" = true))]
    pub fps: Option<f64>,
    /// What the pixels show that were asked for.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub picks: Vec<Picked>,
}

/// What a pixel shows; nothing but the pixel where there is nothing to see.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(default)]
pub struct Picked {
    /// Column and row, from the top left.
    #[schemars(extend("x-unit" = "pixels"))]
    pub pixel: [usize; 2],
    /// Where it is seen (RAS).
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schemars(extend("x-unit" = "mm"))]
    pub place_mm: Option<[f64; 3]>,
    /// Where that was before the deformation (RAS).
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schemars(extend("x-unit" = "mm"))]
    pub rest_mm: Option<[f64; 3]>,
    /// The voxel nearest to what is seen there.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schemars(extend("x-unit" = "voxels"))]
    pub voxel: Option<[usize; 3]>,
    /// Its value, between voxels.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schemars(extend("x-unit" = "real units"))]
    pub value: Option<f64>,
    /// The label of that voxel, where there are labels.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schemars(extend("x-unit" = "1"))]
    pub label: Option<u16>,
}

impl Picked {
    fn of(pixel: [usize; 2], pick: Option<Pick>) -> Self {
        pick.map_or(Self { pixel, ..Self::default() }, |Pick { place, rest, voxel, value, label }| Self {
            pixel,
            place_mm: Some(place),
            rest_mm: Some(rest),
            voxel: Some(voxel),
            value,
            label,
        })
    }

    fn told(&self) -> String {
        let [x, y] = self.pixel;
        let (Some(place), Some([i, j, k])) = (self.place_mm, self.voxel) else {
            return format!("nothing is seen at pixel {x}, {y}");
        };
        let place_of = |[x, y, z]: [f64; 3]| format!("{x:.2}, {y:.2}, {z:.2} mm");
        let rest = self.rest_mm.filter(|rest| *rest != place).map(place_of);
        let rest = rest.map_or_else(String::new, |rest| format!(", before the deformation {rest}"));
        let value = self.value.map_or_else(String::new, |value| format!(", value {value:.4}"));
        let label = self.label.map_or_else(String::new, |label| format!(", label {label}"));
        format!("pixel {x}, {y} shows {}{rest} (voxel {i}, {j}, {k}{value}{label})", place_of(place))
    }
}

impl RenderFigures {
    /// What was asked for at pixels.
    fn remark(&self) -> Option<String> {
        let told: Vec<String> = self.picks.iter().map(Picked::told).collect();
        (!told.is_empty()).then(|| told.join("; "))
    }
}

/// What the difference of two pictures comes to.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct DifferenceFigures {
    /// Pictures made.
    #[schemars(extend("x-unit" = "1"))]
    pub frames: u32,
    /// Greatest difference of a channel.
    #[schemars(extend("x-unit" = "levels of 255"))]
    pub max: u8,
    /// Mean over the pixels of their greatest channel's difference.
    #[schemars(extend("x-unit" = "levels of 255"))]
    pub mean: f64,
    /// Share of the pixels that differ at all.
    #[schemars(extend("x-unit" = "1"))]
    pub changed_fraction: f64,
    /// Pictures made in a second.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(extend("x-unit" = "1/s", "x-time" = true))]
    pub fps: Option<f64>,
}

/// Pictures in a second where one takes as long as since `start`.
fn rate(start: Instant) -> f64 {
    1.0 / start.elapsed().as_secs_f64().max(1e-9)
}

impl Op for DifferenceParams {
    const REVISION: u32 = 1;
    type Inputs<'a> = Pair<'a>;
    type Gives = (Image, DifferenceFigures);

    fn run(&self, inputs: Pair<'_>, _: &Exec) -> Result<Self::Gives, Failure> {
        let start = Instant::now();
        let found = difference(inputs.before, inputs.after)?;
        let figures = DifferenceFigures {
            frames: found.image.frames() as u32,
            max: found.max,
            mean: found.mean,
            changed_fraction: found.changed,
            fps: Some(found.image.frames() as f64 * rate(start)),
        };
        Ok((found.image, figures))
    }
}
