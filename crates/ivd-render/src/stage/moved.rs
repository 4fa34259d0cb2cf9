//! How far what is seen has moved: the job beside those that show surfaces.

use std::time::Instant;

use ivd_core::op::{Failure, Op, Remark, Want};
use ivd_core::{Exec, Image, ParamError};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::modes::{CLOSE, REVISION, wants_coloured};
use super::{Coloured, LABELS, rate};
use crate::prepared::LEAST_MOVED;
use crate::{ClassLooks, Classification, Mode, Prepared, RenderParams, Scene};

/// What is seen in greys, red where it has come out of its surface and blue where it has gone in, with a bar in mm: the motion of what modes dvr and iso show, along the
/// normal that faces the eye; of parts by labels that of their surface. Ambient occlusion and shadows are left out; the bar is drawn whatever `annotate` says.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(default)]
pub struct MovedParams {
    /// Isovalue of the surface that is seen; without it what the transfer function shows.
    #[schemars(extend("x-unit" = "real units"))]
    pub iso: Option<f64>,
    /// The picture.
    #[serde(flatten)]
    pub picture: RenderParams,
    /// How single classes are drawn.
    #[serde(flatten)]
    pub classes: ClassLooks,
}

/// What a picture of how far what is seen has moved comes to.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct MovedFigures {
    /// Pictures made.
    #[schemars(extend("x-unit" = "1"))]
    pub frames: u32,
    /// How far what is seen has come out of its surface at most.
    #[schemars(extend("x-unit" = "mm"))]
    pub out_mm: f64,
    /// How far it has gone in at most.
    #[schemars(extend("x-unit" = "mm"))]
    pub in_mm: f64,
    /// What the ends of the bar mean.
    #[schemars(extend("x-unit" = "mm"))]
    pub scale_mm: f64,
    /// Pictures made in a second.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(extend("x-unit" = "1/s", "x-time" = true))]
    pub fps: Option<f64>,
}

impl MovedFigures {
    /// That the picture shows nothing of the motion.
    fn remark(&self) -> Option<String> {
        let is_still = self.out_mm.max(self.in_mm) < LEAST_MOVED;
        is_still.then(|| {
            "nothing that is seen from here has come out of its surface or gone into it; another render.view may show what moved".to_owned()
        })
    }
}

impl MovedParams {
    fn asked(&self) -> RenderParams {
        let mode = self.iso.map_or(Mode::Dvr, |value| Mode::Iso { value });
        // It has a bar of its own.
        RenderParams { mode, legend: false, ..self.picture.clone() }
    }
}

impl Op for MovedParams {
    const REVISION: u32 = 100 * REVISION + 2;
    const REMARK: Option<Remark<MovedFigures>> = Some(MovedFigures::remark);
    type Inputs<'a> = Coloured<'a>;
    type Gives = (Image, MovedFigures);

    fn wants(&self, slot: &str) -> Want {
        // A surface has no colours here, and is one of values.
        let is_of_classes = slot == "transfer" || slot == LABELS;
        if is_of_classes && self.iso.is_some() { Want::No } else { wants_coloured(slot, &self.picture) }
    }

    fn close(&self) -> &'static [&'static str] {
        let is_pre_integrated = self.picture.classification == Classification::PreIntegrated;
        if self.iso.is_some() || !is_pre_integrated { CLOSE } else { &[] }
    }

    fn check_together(&self) -> Result<(), ParamError> {
        self.asked().check_together()?;
        self.classes.check_together()
    }

    fn run(&self, inputs: Coloured<'_>, exec: &Exec) -> Result<Self::Gives, Failure> {
        let start = Instant::now();
        let Coloured { volume, transfer, labels, displacement, framing, whole, lattice } = inputs;
        let changed = self.classes.changed(transfer)?;
        let transfer = changed.as_ref().or(transfer).filter(|_| self.iso.is_none());
        let unlabelled = self.classes.unlabelled;
        let scene = Scene { volume, transfer, labels, unlabelled, displacement, framing, whole, lattice };
        let prepared = Prepared::new(&scene, &self.asked(), exec)?;
        let found = prepared.draw_moved(self.picture.view, exec)?;
        let figures = MovedFigures {
            frames: found.image.frames() as u32,
            out_mm: found.out_mm,
            in_mm: found.in_mm,
            scale_mm: found.scale_mm,
            fps: Some(found.image.frames() as f64 * rate(start)),
        };
        Ok((found.image, figures))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_picture_that_shows_nothing_of_the_motion_says_so() {
        let seen = |out_mm, in_mm| MovedFigures { frames: 1, out_mm, in_mm, scale_mm: 0.001, fps: None };
        assert!(seen(0.0, 1e-9).remark().unwrap().contains("render.view"));
        assert_eq!((seen(0.2, 0.0).remark(), seen(0.0, 3.0).remark()), (None, None));
    }
}
