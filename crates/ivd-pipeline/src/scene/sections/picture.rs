use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// What a picture shows of the volume.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum RenderMode {
    /// Direct volume rendering.
    #[default]
    Dvr,
    /// Maximum intensity projection.
    Mip,
    /// First-hit isosurface.
    Iso,
}

/// How the scene is projected onto the picture.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum Projection {
    /// Parallel rays: lengths can be read off the picture.
    #[default]
    Orthographic,
    /// Rays from one eye point.
    Perspective,
}

/// `[render]`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct RenderSection {
    /// What is shown.
    pub mode: RenderMode,
    /// Isovalue of mode "iso".
    pub iso: Option<f64>,
    /// Width and height (pixels).
    pub size: [usize; 2],
    /// Azimuth and elevation (degrees); 0, 0 looks from the front.
    pub view: [f64; 2],
    /// Enlargement; 1 fits the volume.
    pub zoom: f64,
    /// Sample distance as a fraction of the smallest spacing.
    pub step: f64,
    /// Whether surfaces are shaded.
    pub shading: bool,
    /// Whether orientation letters and a scale bar are drawn.
    pub annotate: bool,
    /// Parallel or perspective.
    pub projection: Projection,
    /// Opacity at which a ray ends; above 1 no ray ends early.
    pub termination: f64,
    /// Whether bricks that hold nothing to see are passed over: speed, never the pixels.
    pub skip: bool,
    /// Background, straight linear RGBA in 0…1.
    pub background: [f32; 4],
    /// Colour of the surface of mode "iso", linear RGB in 0…1.
    pub surface: [f32; 3],
}

impl Default for RenderSection {
    fn default() -> Self {
        let params = ivd_render::RenderParams::default();
        Self {
            mode: RenderMode::Dvr,
            iso: None,
            size: [params.width, params.height],
            view: [30.0, 15.0],
            zoom: params.view.zoom,
            step: params.step,
            shading: params.shading,
            annotate: params.annotate,
            projection: Projection::Orthographic,
            termination: params.termination,
            skip: params.skip,
            background: params.background,
            surface: params.surface,
        }
    }
}
