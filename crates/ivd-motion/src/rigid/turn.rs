use ivd_core::ParamError;
use nalgebra::Vector3;
use serde::{Deserialize, Serialize};

/// A motion that keeps every distance: a turn about a pivot, while the pivot goes straight on.
///
/// After the part `s` of it, with the axis `â` (of length 1) and `θ = s · angle`,
///
/// ```text
/// x ↦ p + s · by + exp(θ [â]ₓ) (x − p)
/// exp(θ [â]ₓ) − I = sin θ [â]ₓ + 2 sin²(θ/2) [â]ₓ²                                     (Rodrigues)
/// ```
///
/// Any part of it is a rigid motion too, half a turn and many turns among them: nothing is interpolated between places.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct RigidTransform {
    /// Point that it turns about (mm), RAS.
    pub pivot: [f64; 3],
    /// Direction of its axis, RAS; any length but 0.
    pub axis: [f64; 3],
    /// Degrees, counter-clockwise as seen from the axis' tip; more than 360 is more than one turn.
    pub angle: f64,
    /// Way of the pivot (mm).
    pub by: [f64; 3],
}

impl RigidTransform {
    /// No motion.
    pub const NONE: Self = Self { pivot: [0.0; 3], axis: [0.0, 0.0, 1.0], angle: 0.0, by: [0.0; 3] };

    /// # Errors
    /// [`ParamError`] names the part that is out of its domain.
    pub fn check(&self) -> Result<(), ParamError> {
        finite("pivot", &self.pivot)?;
        finite("axis", &self.axis)?;
        finite("move", &self.by)?;
        let length = Vector3::from(self.axis).norm();
        if !(1e-100..=1e100).contains(&length) {
            return Err(ParamError::new("axis", format!("{:?}", self.axis), "give a direction"));
        }
        if self.angle.abs() <= 1e6 {
            return Ok(());
        }
        Err(ParamError::new("angle", format!("{} degrees", self.angle), "use -1e6 to 1e6"))
    }

    /// Whether it leaves everything where it is, at every part of it.
    pub fn is_none(&self) -> bool {
        self.angle == 0.0 && self.by == [0.0; 3]
    }

    /// Where it brings a point (mm, RAS).
    pub fn carries(&self, point: [f64; 3]) -> [f64; 3] {
        let point = Vector3::from(point);
        (point + self.after(1.0).displacement(point)).into()
    }

    /// The same relative to an origin (mm, RAS).
    pub(super) fn relative_to(&self, origin: Vector3<f64>) -> Self {
        Self { pivot: (Vector3::from(self.pivot) - origin).into(), ..*self }
    }

    /// It after the part `s` (0 … 1), ready for many points.
    pub(super) fn after(&self, s: f64) -> Pose {
        // Whole turns are taken off exactly, so that they leave nothing behind.
        let angle = ((self.angle * s) % 360.0).to_radians();
        let half = (0.5 * angle).sin();
        Pose {
            pivot: self.pivot.into(),
            axis: Vector3::from(self.axis).normalize(),
            sine: angle.sin(),
            versine: 2.0 * half * half,
            by: Vector3::from(self.by) * s,
        }
    }
}

/// A rigid motion made.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Pose {
    pivot: Vector3<f64>,
    axis: Vector3<f64>,
    sine: f64,
    /// `1 − cos θ`.
    versine: f64,
    by: Vector3<f64>,
}

impl Pose {
    /// What it does to a direction: `(R − I) v`.
    pub(super) fn turned(&self, v: Vector3<f64>) -> Vector3<f64> {
        let across = self.axis.cross(&v);
        across * self.sine + self.axis.cross(&across) * self.versine
    }

    /// Displacement (mm) of a point (mm); exactly the pivot's way at the pivot.
    pub(super) fn displacement(&self, point: Vector3<f64>) -> Vector3<f64> {
        self.turned(point - self.pivot) + self.by
    }

    /// Where a point came from: its inverse.
    pub(super) fn back(&self, point: Vector3<f64>) -> Vector3<f64> {
        let undone = Self { sine: -self.sine, ..*self };
        let arm = point - self.by - self.pivot;
        self.pivot + arm + undone.turned(arm)
    }
}

/// # Errors
/// [`ParamError`] names the field of a vector whose numbers aren't finite.
pub(super) fn finite(field: &'static str, vector: &[f64; 3]) -> Result<(), ParamError> {
    if vector.iter().all(|c| c.abs() <= 1e100) {
        return Ok(());
    }
    Err(ParamError::new(field, format!("{vector:?}"), "give three finite numbers"))
}
