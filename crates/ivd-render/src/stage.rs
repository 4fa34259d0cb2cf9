//! The stage as scenes and commands see it.

use std::time::Instant;

use ivd_core::op::{Amount, Failure, Method, Op, Place, PlaceKind, Remark, Stage, Want, method};
use ivd_core::{
    Displacement, Exec, Image, Kernel as _, Labels, Lattice, ParamError, TransferFunction, Volume, slots,
};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::plan::Casting;
use crate::{ClassLooks, Classification, Fit, Mode, Pick, Prepared, RenderParams, Scene, difference};

/// The stage: its modes, and the pictures that a scene has of it.
pub const STAGE: Stage = Stage {
    name: "render",
    about: "Draws a volume.",
    selector: "mode",
    methods: METHODS,
    positional: &["volume"],
    places: &[
        Place {
            empty: &[DISPLACEMENT, "labels", "lattice", WHOLE],
            from: &[(FRAMING, DISPLACEMENT)],
            if_made: &[FRAMING],
            ..picture("before")
        },
        Place {
            needs: &[DISPLACEMENT],
            // What is clipped or combined has been deformed already.
            from: &[(VOLUME, "result"), (VOLUME, VOLUME), (WHOLE, VOLUME), (FRAMING, DISPLACEMENT)],
            with: &[(WHOLE, "result"), (FRAMING, "result")],
            unless: &[(DISPLACEMENT, "result")],
            empty: &["labels", "lattice"],
            ..picture("after")
        },
        Place {
            kind: PlaceKind::Fixed { method: &DIFFERENCE },
            amount: Amount::Pixels,
            ..picture("difference")
        },
    ],
    quiet: false,
    memory: [10, 100],
};
/// The slot of what is drawn.
pub const VOLUME: &str = "volume";
/// The slot of a displacement that is shown.
pub const DISPLACEMENT: &str = "displacement";
/// The slot of a volume that decides camera and window, see [`Scene::whole`].
pub const WHOLE: &str = "whole";
/// The slot of a displacement that a picture leaves room for.
pub const FRAMING: &str = "framing";

/// The place of a picture. In one of a scene the nearest voxel's label would draw the grid's steps on every surface.
const fn picture(name: &'static str) -> Place {
    Place {
        variant: name,
        empty: &["labels", "lattice", FRAMING, WHOLE],
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
];
static DIFFERENCE: Method = method::<DifferenceParams>("difference");

/// Direct volume rendering: emission and absorption by the transfer function.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(default)]
pub struct DvrParams {
    /// The picture.
    #[serde(flatten)]
    pub picture: RenderParams,
    /// How single classes are drawn.
    #[serde(flatten)]
    pub classes: ClassLooks,
}

/// Maximum intensity projection: the greatest value along a ray, as grey over the volume's range.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(default)]
pub struct MipParams {
    /// The picture.
    #[serde(flatten)]
    pub picture: RenderParams,
}

/// First-hit isosurface: the first place where the value reaches the isovalue, as a lit opaque surface.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(default)]
pub struct IsoParams {
    /// Isovalue of the surface.
    #[schemars(extend("x-unit" = "that of the values", "x-from" = "lattice.iso"))]
    pub iso: Option<f64>,
    /// The picture.
    #[serde(flatten)]
    pub picture: RenderParams,
}

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
    /// Samples taken for each pixel of the picture, on average.
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
    #[schemars(extend("x-unit" = "that of the values"))]
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

/// What decides what a picture holds is of no use where that is the volume.
fn wants(slot: &str, picture: &RenderParams) -> Want {
    if slot == FRAMING && picture.fit == Fit::Volume { Want::No } else { Want::Yes }
}

/// Pictures in a second where one takes as long as since `start`.
fn rate(start: Instant) -> f64 {
    1.0 / start.elapsed().as_secs_f64().max(1e-9)
}

/// Draws a scene in a mode.
fn drawn(
    scene: &Scene<'_>,
    mode: Mode,
    picture: &RenderParams,
    exec: &Exec,
) -> Result<(Image, RenderFigures), Failure> {
    let start = Instant::now();
    let params = RenderParams { mode, ..picture.clone() };
    let prepared = Prepared::new(scene, &params, exec)?;
    let found = prepared.render(params.view, exec)?;
    let picks = params.picks.iter().map(|&pixel| Ok(Picked::of(pixel, prepared.pick(params.view, pixel)?)));
    let figures = RenderFigures {
        picks: picks.collect::<Result<_, crate::Error>>()?,
        frames: found.frames,
        samples_per_pixel: found.samples_per_pixel,
        skipped_fraction: found.skipped_fraction,
        fps: Some(rate(start)),
    };
    Ok((found.image, figures))
}

impl<'a> From<Plain<'a>> for Scene<'a> {
    fn from(Plain { volume, displacement, framing, whole, lattice }: Plain<'a>) -> Self {
        Scene { displacement, framing, whole, lattice, ..Scene::new(volume) }
    }
}

/// What pictures cast their rays by.
const CLOSE: &[&str] = &[Casting::NAME];

/// Raised for all modes together: what they share is most of them.
const REVISION: u32 = 4;

impl Op for DvrParams {
    const REVISION: u32 = REVISION;
    type Inputs<'a> = Coloured<'a>;
    type Output = Image;
    type Figures = RenderFigures;
    const REMARK: Option<Remark<RenderFigures>> = Some(RenderFigures::remark);

    fn check_together(&self) -> Result<(), ParamError> {
        self.picture.check_together()?;
        self.classes.check_together()
    }

    fn wants(&self, slot: &str) -> Want {
        wants(slot, &self.picture)
    }

    fn close(&self) -> &'static [&'static str] {
        // Of pre-integrated steps no device knows the form.
        if self.picture.classification == Classification::PreIntegrated { &[] } else { CLOSE }
    }

    fn run(&self, inputs: Coloured<'_>, exec: &Exec) -> Result<(Image, RenderFigures), Failure> {
        let Coloured { volume, transfer, labels, displacement, framing, whole, lattice } = inputs;
        let with_looks = |transfer| self.classes.of(transfer).map(Some);
        let changed = transfer.filter(|_| !self.classes.is_empty()).map_or(Ok(None), with_looks)?;
        let transfer = changed.as_ref().or(transfer);
        let scene = Scene { volume, transfer, labels, displacement, framing, whole, lattice };
        drawn(&scene, Mode::Dvr, &self.picture, exec)
    }
}

impl Op for MipParams {
    const REVISION: u32 = REVISION;
    type Inputs<'a> = Plain<'a>;
    type Output = Image;
    type Figures = RenderFigures;
    const REMARK: Option<Remark<RenderFigures>> = Some(RenderFigures::remark);

    fn check_together(&self) -> Result<(), ParamError> {
        self.picture.check_together()
    }

    fn wants(&self, slot: &str) -> Want {
        wants(slot, &self.picture)
    }

    fn close(&self) -> &'static [&'static str] {
        CLOSE
    }

    fn run(&self, inputs: Plain<'_>, exec: &Exec) -> Result<(Image, RenderFigures), Failure> {
        drawn(&inputs.into(), Mode::Mip, &self.picture, exec)
    }
}

impl IsoParams {
    fn value(&self) -> Result<f64, ParamError> {
        self.iso.ok_or_else(|| ParamError::new("iso", "mode iso needs it", "give an isovalue, a real value"))
    }
}

impl Op for IsoParams {
    const REVISION: u32 = REVISION;
    type Inputs<'a> = Plain<'a>;
    type Output = Image;
    type Figures = RenderFigures;
    const REMARK: Option<Remark<RenderFigures>> = Some(RenderFigures::remark);

    fn check_together(&self) -> Result<(), ParamError> {
        self.value()?;
        self.picture.check_together()
    }

    fn wants(&self, slot: &str) -> Want {
        wants(slot, &self.picture)
    }

    fn close(&self) -> &'static [&'static str] {
        CLOSE
    }

    fn run(&self, inputs: Plain<'_>, exec: &Exec) -> Result<(Image, RenderFigures), Failure> {
        let value = self.value().map_err(crate::Error::from)?;
        drawn(&inputs.into(), Mode::Iso { value }, &self.picture, exec)
    }
}

impl Op for DifferenceParams {
    const REVISION: u32 = 1;
    type Inputs<'a> = Pair<'a>;
    type Output = Image;
    type Figures = DifferenceFigures;

    fn run(&self, inputs: Pair<'_>, _: &Exec) -> Result<(Image, DifferenceFigures), Failure> {
        let start = Instant::now();
        let found = difference(inputs.before, inputs.after)?;
        let figures = DifferenceFigures {
            frames: 1,
            max: found.max,
            mean: found.mean,
            changed_fraction: found.changed,
            fps: Some(rate(start)),
        };
        Ok((found.image, figures))
    }
}
