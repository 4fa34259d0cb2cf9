//! The modes with a transfer function: their parameters, and what they draw.

use ivd_core::op::{Failure, Job, Op, Remark, Want};
use ivd_core::{Exec, Image, ParamError};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::{Across, ClassLooks, Classification, Mode, RenderParams, Scene, Surroundings};

use crate::params::MOST_SLICES;

use super::modes::{CLOSE, REVISION, drawn, wants_coloured};
use super::{Coloured, MovedParams, RenderFigures};

/// Direct volume rendering: emission and absorption by the transfer function.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(default)]
pub struct DvrParams {
    /// The picture.
    #[serde(flatten)]
    pub picture: RenderParams,
    /// What takes light away.
    #[serde(flatten)]
    pub surroundings: Surroundings,
    /// How single classes are drawn.
    #[serde(flatten)]
    pub classes: ClassLooks,
}

/// Direct volume rendering by slices, across the view or across the grid axis closest to it: another way to the picture of mode dvr, for comparison. Their number
/// takes the place of `step`.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(default)]
pub struct SlicesParams {
    /// How many; without it twice as many as voxels lie along what they lie across.
    #[schemars(range(min = 1, max = MOST_SLICES), extend("x-unit" = "1", "x-knob" = "accuracy"))]
    pub slices: Option<usize>,
    /// What they lie across.
    pub across: Across,
    /// The picture.
    #[serde(flatten)]
    pub picture: RenderParams,
    /// How single classes are drawn.
    #[serde(flatten)]
    pub classes: ClassLooks,
}

/// Direct volume rendering by shear-warp, with sheared slices and a warped picture: another way to the picture of mode dvr, for comparison. Their number takes the place of
/// `step`.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(default)]
pub struct ShearWarpParams {
    /// How many; without it twice as many as voxels lie along the axis that they lie across.
    #[schemars(range(min = 1, max = MOST_SLICES), extend("x-unit" = "1", "x-knob" = "accuracy"))]
    pub slices: Option<usize>,
    /// The picture.
    #[serde(flatten)]
    pub picture: RenderParams,
    /// How single classes are drawn.
    #[serde(flatten)]
    pub classes: ClassLooks,
}

impl DvrParams {
    /// The picture that is asked for.
    pub fn asked(&self) -> RenderParams {
        RenderParams { mode: Mode::Dvr, surroundings: self.surroundings, ..self.picture.clone() }
    }

    fn is_close(&self) -> bool {
        let is_pre_integrated = self.picture.classification == Classification::PreIntegrated;
        !is_pre_integrated && !self.surroundings.are_asked()
    }
}

impl SlicesParams {
    fn asked(&self) -> RenderParams {
        let mode = Mode::Slices { count: self.slices, across: self.across };
        RenderParams { mode, ..self.picture.clone() }
    }
}

impl ShearWarpParams {
    fn asked(&self) -> RenderParams {
        RenderParams { mode: Mode::ShearWarp { count: self.slices }, ..self.picture.clone() }
    }
}

/// A mode with a transfer function, whether devices know its form, and the job beside it.
macro_rules! coloured {
    ($($params:ty: $is_close:expr, $beside:expr);+ $(;)?) => {$(
        impl Op for $params {
            const REVISION: u32 = REVISION;
            type Inputs<'a> = Coloured<'a>;
            type Gives = (Image, RenderFigures);
            const REMARK: Option<Remark<RenderFigures>> = Some(RenderFigures::remark);

            fn check_together(&self) -> Result<(), ParamError> {
                self.asked().check_together()?;
                self.classes.check_together()
            }

            fn wants(&self, slot: &str) -> Want {
                wants_coloured(slot, &self.picture)
            }

            fn close(&self) -> &'static [&'static str] {
                if $is_close(self) { CLOSE } else { &[] }
            }

            fn beside(&self) -> Option<Box<dyn Job>> {
                $beside(self)
            }

            fn run(&self, inputs: Coloured<'_>, exec: &Exec) -> Result<Self::Gives, Failure> {
                let Coloured { volume, transfer, labels, displacement, framing, whole, lattice } = inputs;
                let changed = self.classes.changed(transfer)?;
                let transfer = changed.as_ref().or(transfer);
                let unlabelled = self.classes.unlabelled;
                let scene =
                    Scene { volume, transfer, labels, unlabelled, displacement, framing, whole, lattice };
                drawn(&scene, &self.asked(), exec)
            }
        }
    )+};
}
coloured! {
    DvrParams: Self::is_close, |params: &Self| {
        let (picture, classes) = (params.picture.clone(), params.classes.clone());
        Some(Box::new(MovedParams { iso: None, picture, classes }) as Box<dyn Job>)
    };
    SlicesParams: |_: &Self| false, |_: &Self| None;
    ShearWarpParams: |_: &Self| false, |_: &Self| None;
}
