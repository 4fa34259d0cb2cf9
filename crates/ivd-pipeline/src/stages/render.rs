use ivd_artefact::{Artefact, Kind};
use ivd_core::Exec;
use ivd_render::{Mode, Projection, RenderParams, Scene, View};
use serde_json::{Value, json};

use crate::error::stage_error;
use crate::scene::{self, RenderMode, RenderSection};
use crate::{Error, Inputs, Product, Slot, Stage};

/// Draws a volume, at rest or through a displacement.
#[derive(Debug, Clone, PartialEq)]
pub struct Render {
    /// Mode, view, size.
    pub params: RenderParams,
}

impl Render {
    /// The stage that a scene's section asks for; `iso` stands in where mode "iso" names no value.
    ///
    /// # Errors
    /// Mode "iso" without a value.
    pub fn from_section(section: &RenderSection, iso: Option<f64>) -> Result<Self, Error> {
        let mode = match section.mode {
            RenderMode::Dvr => Mode::Dvr,
            RenderMode::Mip => Mode::Mip,
            RenderMode::Iso => {
                let value = section.iso.or(iso);
                let value = value
                    .ok_or_else(|| Error::usage("render", "mode = iso needs render.iso, a real value"))?;
                Mode::Iso { value }
            }
        };
        let projection = match section.projection {
            scene::Projection::Orthographic => Projection::Orthographic,
            scene::Projection::Perspective => Projection::Perspective,
        };
        Ok(Self {
            params: RenderParams {
                mode,
                width: section.size[0],
                height: section.size[1],
                view: View {
                    azimuth_deg: section.view[0],
                    elevation_deg: section.view[1],
                    zoom: section.zoom,
                    projection,
                },
                step: section.step,
                shading: section.shading,
                annotate: section.annotate,
                termination: section.termination,
                skip: section.skip,
                background: section.background,
                surface: section.surface,
            },
        })
    }
}

impl Stage for Render {
    fn name(&self) -> &'static str {
        "render"
    }

    fn revision(&self) -> u32 {
        2
    }

    fn inputs(&self) -> &'static [Slot] {
        const {
            &[
                Slot::required("volume", &[Kind::Volume]),
                Slot::optional("transfer", &[Kind::Transfer]),
                Slot::optional("labels", &[Kind::Labels]),
                Slot::optional("displacement", &[Kind::Displacement]),
                Slot::optional("lattice", &[Kind::Lattice]),
            ]
        }
    }

    fn output(&self) -> Option<Kind> {
        Some(Kind::Image)
    }

    fn params(&self) -> Value {
        super::json(&self.params)
    }

    fn run(&self, inputs: &Inputs, exec: &Exec) -> Result<Product, Error> {
        let scene = Scene {
            volume: inputs.volume("volume").expect("checked by the runner"),
            transfer: inputs.transfer("transfer"),
            labels: inputs.labels("labels"),
            displacement: inputs.displacement("displacement"),
            lattice: inputs.lattice("lattice"),
        };
        let rendered = ivd_render::render(&scene, &self.params, exec).map_err(stage_error!("render"))?;
        let metrics = json!({
            "frames": 1,
            "samples_per_pixel": rendered.samples_per_pixel,
            "skipped_fraction": rendered.skipped_fraction,
        });
        Ok(Product::new(Artefact::Image(rendered.image), metrics))
    }
}

/// Shows where two pictures differ.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Difference;

impl Stage for Difference {
    fn name(&self) -> &'static str {
        "render"
    }

    fn revision(&self) -> u32 {
        1
    }

    fn inputs(&self) -> &'static [Slot] {
        const { &[Slot::required("before", &[Kind::Image]), Slot::required("after", &[Kind::Image])] }
    }

    fn output(&self) -> Option<Kind> {
        Some(Kind::Image)
    }

    fn params(&self) -> Value {
        json!({ "picture": "difference" })
    }

    fn run(&self, inputs: &Inputs, _exec: &Exec) -> Result<Product, Error> {
        let before = inputs.image("before").expect("checked by the runner");
        let after = inputs.image("after").expect("checked by the runner");
        let found = ivd_render::difference(before, after).map_err(stage_error!("render"))?;
        let metrics = json!({
            "frames": 1,
            "max": found.max,
            "mean": found.mean,
            "changed_fraction": found.changed,
        });
        Ok(Product::new(Artefact::Image(found.image), metrics))
    }
}
