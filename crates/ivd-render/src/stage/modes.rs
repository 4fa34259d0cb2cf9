//! The modes without a transfer function: their parameters, and what they draw.

use std::time::Instant;

use ivd_core::op::{Failure, Job, Op, Remark, Want};
use ivd_core::{Exec, Image, Kernel as _, ParamError};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::params::MOST_ATTENUATION;
use crate::plan::Casting;
use crate::{Classification, Fit, Mode, Prepared, RenderParams, Scene, Shell, Surroundings};

use super::{FRAMING, LABELS, MovedParams, Picked, Plain, RenderFigures, rate};

/// What is black and white.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(default)]
pub struct Greys {
    /// Values that are drawn black and white, those beyond them too; without it the volume's range.
    #[schemars(extend("x-unit" = "real units"))]
    pub window: Option<[f64; 2]>,
}

/// Maximum intensity projection: the greatest value along a ray, as grey over `window`.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(default)]
pub struct MipParams {
    /// What is black and white.
    #[serde(flatten)]
    pub greys: Greys,
    /// The picture.
    #[serde(flatten)]
    pub picture: RenderParams,
}

/// First-hit isosurface: the first place where the value reaches the isovalue, as a lit opaque surface.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(default)]
pub struct IsoParams {
    /// Isovalue of the surface.
    #[schemars(extend("x-unit" = "real units", "x-from" = "lattice.iso"))]
    pub iso: Option<f64>,
    /// Isosurfaces about it that are seen through, as thin films are: the isovalue, the colour (linear RGB) and the opacity of each. Without ambient occlusion and shadows.
    pub shells: Vec<Shell>,
    /// What takes light away.
    #[serde(flatten)]
    pub surroundings: Surroundings,
    /// The picture.
    #[serde(flatten)]
    pub picture: RenderParams,
}

/// Minimum intensity projection: the least value along a ray, as grey over `window`. Air round a body hides all that is in it: clip it away.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(default)]
pub struct MinipParams {
    /// What is black and white.
    #[serde(flatten)]
    pub greys: Greys,
    /// The picture.
    #[serde(flatten)]
    pub picture: RenderParams,
}

/// The mean value along a ray, as grey over `window`: like a radiograph.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(default)]
pub struct MeanParams {
    /// What is black and white.
    #[serde(flatten)]
    pub greys: Greys,
    /// The picture.
    #[serde(flatten)]
    pub picture: RenderParams,
}

/// Local maximum intensity projection: the first local maximum along a ray at or above a threshold, else the greatest value, as grey over
/// `window`. What lies in front hides what lies behind.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(default)]
pub struct LmipParams {
    /// Value that a local maximum must reach; without it the middle of the volume's range.
    #[schemars(extend("x-unit" = "real units"))]
    pub threshold: Option<f64>,
    /// What is black and white.
    #[serde(flatten)]
    pub greys: Greys,
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
    /// What is black and white.
    #[serde(flatten)]
    pub greys: Greys,
    /// The picture.
    #[serde(flatten)]
    pub picture: RenderParams,
}

impl Default for AttenuatedMipParams {
    fn default() -> Self {
        Self { attenuation: 4.0, greys: Greys::default(), picture: RenderParams::default() }
    }
}

/// What decides what a picture holds is of no use where that is the volume.
pub(super) fn wants(slot: &str, picture: &RenderParams) -> Want {
    if slot == FRAMING && picture.fit == Fit::Volume { Want::No } else { Want::Yes }
}

/// The same for pictures in colours of classes. A scene's go by labels that a person chose, where one of these parts moves. They don't where a surface is one of values: it has no label, and would be clear.
/// By labels that values gave, the nearest voxel's would draw the grid's steps on every surface. Steps between values know no labels.
pub(super) fn wants_coloured(slot: &str, picture: &RenderParams) -> Want {
    match slot {
        LABELS if picture.classification == Classification::PreIntegrated => Want::No,
        LABELS => Want::IfGiven,
        _ => wants(slot, picture),
    }
}

/// Draws a scene.
pub(super) fn drawn(
    scene: &Scene<'_>,
    params: &RenderParams,
    exec: &Exec,
) -> Result<(Image, RenderFigures), Failure> {
    let start = Instant::now();
    let prepared = Prepared::new(scene, params, exec)?;
    let found = prepared.render_all(params.view, exec)?;
    let picks = params.picks.iter().map(|&pixel| Ok(Picked::of(pixel, prepared.pick(params.view, pixel)?)));
    let figures = RenderFigures {
        picks: picks.collect::<Result<_, crate::Error>>()?,
        frames: found.frames,
        samples_per_pixel: found.samples_per_pixel,
        skipped_fraction: found.skipped_fraction,
        fps: Some(f64::from(found.frames) * rate(start)),
    };
    Ok((found.image, figures))
}

impl<'a> From<Plain<'a>> for Scene<'a> {
    fn from(Plain { volume, displacement, framing, whole, lattice }: Plain<'a>) -> Self {
        Scene { displacement, framing, whole, lattice, ..Scene::new(volume) }
    }
}

/// What pictures cast their rays by.
pub(super) const CLOSE: &[&str] = &[Casting::NAME];

/// Raised for all modes together: what they share is most of them.
pub(super) const REVISION: u32 = 5;

/// A mode without a transfer function: the picture that its parameters ask for, what it casts its rays by, and the job beside it.
macro_rules! plain {
    ($($params:ty: $picture:expr, $close:expr, $beside:expr);+ $(;)?) => {$(
        impl $params {
            /// The picture that is asked for.
            ///
            /// # Errors
            /// Names what is needed and isn't given.
            pub fn asked(&self) -> Result<RenderParams, ParamError> {
                $picture(self)
            }
        }

        impl Op for $params {
            const REVISION: u32 = REVISION;
            type Inputs<'a> = Plain<'a>;
            type Gives = (Image, RenderFigures);
            const REMARK: Option<Remark<RenderFigures>> = Some(RenderFigures::remark);

            fn check_together(&self) -> Result<(), ParamError> {
                self.asked()?.check_together()
            }

            fn wants(&self, slot: &str) -> Want {
                wants(slot, &self.picture)
            }

            fn close(&self) -> &'static [&'static str] {
                $close(self)
            }

            fn beside(&self) -> Option<Box<dyn Job>> {
                $beside(self)
            }

            fn run(&self, inputs: Plain<'_>, exec: &Exec) -> Result<Self::Gives, Failure> {
                drawn(&inputs.into(), &self.asked().map_err(crate::Error::from)?, exec)
            }
        }
    )+};
}

/// A picture in a mode of greys.
fn in_mode(mode: Mode, greys: Greys, picture: &RenderParams) -> RenderParams {
    RenderParams { mode, window: greys.window, ..picture.clone() }
}

/// No device knows the form.
fn on_processor<T>(_: &T) -> &'static [&'static str] {
    &[]
}

/// No other picture goes with it.
fn alone<T>(_: &T) -> Option<Box<dyn Job>> {
    None
}

plain! {
    MipParams: |params: &Self| Ok(in_mode(Mode::Mip, params.greys, &params.picture)), |_: &Self| CLOSE, alone;
    IsoParams:
        Self::picture,
        |params: &Self| if params.surroundings.are_asked() || !params.shells.is_empty() { &[] } else { CLOSE },
        |params: &Self| {
            let picture = params.picture.clone();
            let motion = MovedParams { iso: params.iso, picture, ..MovedParams::default() };
            Some(Box::new(motion) as Box<dyn Job>)
        };
    MinipParams: |params: &Self| Ok(in_mode(Mode::Minip, params.greys, &params.picture)), |_: &Self| CLOSE, alone;
    MeanParams: |params: &Self| Ok(in_mode(Mode::Mean, params.greys, &params.picture)), on_processor, alone;
    LmipParams:
        |params: &Self| Ok(in_mode(Mode::Lmip { threshold: params.threshold }, params.greys, &params.picture)),
        on_processor,
        alone;
    AttenuatedMipParams:
        |params: &Self| {
            let mode = Mode::AttenuatedMip { attenuation: params.attenuation };
            Ok(in_mode(mode, params.greys, &params.picture))
        },
        on_processor,
        alone;
}

impl IsoParams {
    fn picture(&self) -> Result<RenderParams, ParamError> {
        let needed = || ParamError::new("iso", "mode iso needs it", "give an isovalue, a real value");
        let mode = Mode::Iso { value: self.iso.ok_or_else(needed)? };
        let (surroundings, shells) = (self.surroundings, self.shells.clone());
        Ok(RenderParams { mode, surroundings, shells, ..self.picture.clone() })
    }
}
