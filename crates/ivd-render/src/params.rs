use ivd_core::ParamError;
use serde::{Deserialize, Serialize};

/// What a ray makes of the values along it.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
#[serde(rename_all = "lowercase", deny_unknown_fields)]
pub enum Mode {
    /// Direct volume rendering: emission and absorption by the transfer function, post-classified.
    #[default]
    Dvr,
    /// The greatest value, as grey over the volume's range.
    Mip,
    /// The first place where the value reaches `value`, as a lit opaque surface.
    Iso {
        /// Isovalue, in real values.
        value: f64,
    },
}

/// How the scene is projected onto the picture.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Projection {
    /// Parallel rays: lengths can be read off the picture.
    #[default]
    Orthographic,
    /// Rays from one eye point, 30° across the shorter side at zoom 1.
    Perspective,
}

/// Where the scene is seen from. The camera looks at the centre of the volume; at zoom 1 the shorter side of the picture holds the sphere round
/// the volume, whatever the angles.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct View {
    /// Turn of the camera about the body axis (degrees): 0 from the front, 90 from the patient's left, 180 from behind.
    pub azimuth_deg: f64,
    /// Height of the camera (degrees), −90…90: 90 from the head, −90 from the feet (anterior up, as axial slices are shown).
    pub elevation_deg: f64,
    /// Magnification (no unit), > 0.
    pub zoom: f64,
    /// Parallel or perspective.
    pub projection: Projection,
}

impl Default for View {
    fn default() -> Self {
        Self { azimuth_deg: 0.0, elevation_deg: 0.0, zoom: 1.0, projection: Projection::Orthographic }
    }
}

/// What the picture is to be.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct RenderParams {
    /// Width (pixels), 1…32768.
    pub width: usize,
    /// Height (pixels), 1…32768.
    pub height: usize,
    /// What a ray makes of the values along it.
    pub mode: Mode,
    /// Where from.
    pub view: View,
    /// Distance of samples along a ray (fractions of the smallest spacing), 0.01…10.
    pub step: f64,
    /// Opacity at which a ray ends (no unit), > 0; above 1 no ray ends early.
    pub termination: f64,
    /// Whether gradients light the volume. A surface (mode iso) is always lit.
    pub shading: bool,
    /// Whether bricks that the transfer function makes clear are passed over. The pixels are the same either way: it is read,
    /// but never written, so that no cache key holds it.
    #[serde(skip_serializing)]
    pub skip: bool,
    /// Whether orientation letters and a scale bar are drawn.
    pub annotate: bool,
    /// Background, straight linear RGBA in 0…1.
    pub background: [f32; 4],
    /// Colour of a surface in mode iso, linear RGB in 0…1.
    pub surface: [f32; 3],
}

impl Default for RenderParams {
    fn default() -> Self {
        Self {
            width: 512,
            height: 512,
            mode: Mode::Dvr,
            view: View::default(),
            step: 0.5,
            termination: 0.99,
            shading: true,
            skip: true,
            annotate: true,
            background: [0.0, 0.0, 0.0, 1.0],
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
        let bad = |field, problem: String, remedy: &str| Err(ParamError::new(field, problem, remedy));
        for (field, side) in [("width", self.width), ("height", self.height)] {
            if !(1..=32768).contains(&side) {
                return bad(field, format!("{side} pixels"), "use 1…32768");
            }
        }
        let View { azimuth_deg, elevation_deg, zoom, .. } = self.view;
        if !azimuth_deg.is_finite() {
            return bad("view.azimuth_deg", format!("{azimuth_deg}"), "use a finite angle in degrees");
        }
        if !(-90.0..=90.0).contains(&elevation_deg) {
            return bad("view.elevation_deg", format!("{elevation_deg}"), "use −90…90 degrees");
        }
        if !(1e-3..=1e6).contains(&zoom) {
            return bad("view.zoom", format!("{zoom}"), "use 0.001…1000000");
        }
        if !(0.01..=10.0).contains(&self.step) {
            return bad("step", format!("{}", self.step), "use 0.01…10 of the smallest spacing");
        }
        if !(self.termination.is_finite() && self.termination > 0.0) {
            return bad("termination", format!("{}", self.termination), "use an opacity above 0");
        }
        if let Mode::Iso { value } = self.mode
            && !value.is_finite()
        {
            return bad("mode.iso.value", format!("{value}"), "use a finite isovalue");
        }
        let unit = |colour: &[f32]| colour.iter().all(|c| (0.0..=1.0).contains(c));
        if !unit(&self.background) {
            return bad("background", format!("{:?}", self.background), "use components in 0…1");
        }
        if !unit(&self.surface) {
            return bad("surface", format!("{:?}", self.surface), "use components in 0…1");
        }
        Ok(())
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
        assert_eq!(bad(RenderParams { width: 0, ..ok() }), "width");
        assert_eq!(bad(RenderParams { step: f64::NAN, ..ok() }), "step");
        assert_eq!(bad(RenderParams { termination: 0.0, ..ok() }), "termination");
        assert_eq!(bad(RenderParams { mode: Mode::Iso { value: f64::NAN }, ..ok() }), "mode.iso.value");
        let view = View { elevation_deg: 91.0, ..View::default() };
        assert_eq!(bad(RenderParams { view, ..ok() }), "view.elevation_deg");
        assert_eq!(bad(RenderParams { background: [0.0, 2.0, 0.0, 1.0], ..ok() }), "background");
    }
}
