//! The modes: their parameters, and what they draw.

use std::time::Instant;

use ivd_core::op::{Failure, Op, Remark, Want};
use ivd_core::{Exec, Image, Kernel as _, ParamError};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::params::MOST_ATTENUATION;
use crate::plan::Casting;
use crate::{ClassLooks, Classification, Fit, Mode, Prepared, RenderParams, Scene};

use super::{Coloured, FRAMING, Picked, Plain, RenderFigures, rate};

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

/// Minimum intensity projection: the least value along a ray, as grey over the volume's range. Air round a body hides all that is in it: clip it away.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(default)]
pub struct MinipParams {
    /// The picture.
    #[serde(flatten)]
    pub picture: RenderParams,
}

/// The mean value along a ray, as grey over the volume's range: like a radiograph.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(default)]
pub struct MeanParams {
    /// The picture.
    #[serde(flatten)]
    pub picture: RenderParams,
}

/// Local maximum intensity projection: the first local maximum along a ray at or above a threshold, else the greatest value, as grey over the volume's
/// range. What lies in front hides what lies behind.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(default)]
pub struct LmipParams {
    /// Value that a local maximum must reach; without it the middle of the volume's range.
    #[schemars(extend("x-unit" = "that of the values"))]
    pub threshold: Option<f64>,
    /// The picture.
    #[serde(flatten)]
    pub picture: RenderParams,
}

/// Attenuated maximum intensity projection: the greatest grey along a ray, where what lies before a sample dims it.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default)]
pub struct AttenuatedMipParams {
    /// How much what lies before a sample dims it: white all along the volume's diagonal by `exp(−attenuation)`; 0 gives mode mip.
    #[schemars(range(min = 0.0, max = MOST_ATTENUATION), extend("x-unit" = "1"))]
    pub attenuation: f64,
    /// The picture.
    #[serde(flatten)]
    pub picture: RenderParams,
}

impl Default for AttenuatedMipParams {
    fn default() -> Self {
        Self { attenuation: 4.0, picture: RenderParams::default() }
    }
}

/// What decides what a picture holds is of no use where that is the volume.
fn wants(slot: &str, picture: &RenderParams) -> Want {
    if slot == FRAMING && picture.fit == Fit::Volume { Want::No } else { Want::Yes }
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

/// A mode without a transfer function: what it is of its parameters, and what it casts its rays by.
macro_rules! plain {
    ($($params:ty: $mode:expr, $close:expr);+ $(;)?) => {$(
        impl Op for $params {
            const REVISION: u32 = REVISION;
            type Inputs<'a> = Plain<'a>;
            type Output = Image;
            type Figures = RenderFigures;
            const REMARK: Option<Remark<RenderFigures>> = Some(RenderFigures::remark);

            fn check_together(&self) -> Result<(), ParamError> {
                RenderParams { mode: $mode(self)?, ..self.picture.clone() }.check_together()
            }

            fn wants(&self, slot: &str) -> Want {
                wants(slot, &self.picture)
            }

            fn close(&self) -> &'static [&'static str] {
                $close
            }

            fn run(&self, inputs: Plain<'_>, exec: &Exec) -> Result<(Image, RenderFigures), Failure> {
                let mode: Result<Mode, ParamError> = $mode(self);
                let mode = mode.map_err(crate::Error::from)?;
                drawn(&inputs.into(), mode, &self.picture, exec)
            }
        }
    )+};
}
plain! {
    MipParams: |_: &Self| Ok(Mode::Mip), CLOSE;
    IsoParams: Self::mode, CLOSE;
    MinipParams: |_: &Self| Ok(Mode::Minip), CLOSE;
    // Of those that follow no device knows the form.
    MeanParams: |_: &Self| Ok(Mode::Mean), &[];
    LmipParams: |params: &Self| Ok(Mode::Lmip { threshold: params.threshold }), &[];
    AttenuatedMipParams: |params: &Self| Ok(Mode::AttenuatedMip { attenuation: params.attenuation }), &[];
}

impl IsoParams {
    fn mode(&self) -> Result<Mode, ParamError> {
        let needed = || ParamError::new("iso", "mode iso needs it", "give an isovalue, a real value");
        Ok(Mode::Iso { value: self.iso.ok_or_else(needed)? })
    }
}
