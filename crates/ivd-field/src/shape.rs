//! Shape changes of space within a ball: what moves, turns, scales, bends and so on does to a point.
//!
//! After Barr 1984 (bend, twist, taper). A shape may fold space where it fades out too steeply.
//!
//! ```
//! use ivd_field::shape::{Kind, Shape};
//! use nalgebra::Vector3;
//!
//! let quarter = Shape {
//!     kind: Kind::Rotate { angle: 90.0 },
//!     centre: [10.0, 0.0, 0.0],
//!     axis: [0.0, 0.0, 1.0],
//!     radius: 20.0,
//!     core: 0.5,
//! };
//! let turned = quarter.apply(Vector3::new(15.0, 0.0, 3.0), 1.0);
//! assert!((turned - Vector3::new(10.0, 5.0, 3.0)).norm() < 1e-12);
//! let beyond = Vector3::new(31.0, 0.0, 0.0);
//! assert_eq!(quarter.apply(beyond, 1.0), beyond);
//! ```

use ivd_core::ParamError;
use ivd_core::op::check_fields;
use nalgebra::{Rotation3, Unit, Vector3};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::falloff::within_ball;
use crate::param::{along_z, half, is_direction, is_finite, is_near};

/// What a shape change does, in coordinates about its centre: `s` along its axis, `q` across it (mm).
///
/// Each is a family `T(w)` with `T(0)` the identity, so that a weight fades it out by doing less of it, not by mixing
/// places: half a turn fades through quarter turns.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(tag = "kind", rename_all = "lowercase")]
pub enum Kind {
    /// Moves by `w · by`.
    Translate {
        /// Way to go, RAS.
        #[schemars(extend("x-unit" = "mm"))]
        by: [f64; 3],
    },
    /// Turns about the axis by `w · angle`, counter-clockwise as seen from the axis' tip.
    Rotate {
        /// Angle, counter-clockwise as seen from the axis' tip.
        #[schemars(range(min = -1e6, max = 1e6), extend("x-unit" = "degrees"))]
        angle: f64,
    },
    /// `s ← along^w · s`, `q ← across^w · q`; one of both at least.
    Scale {
        /// Factor along the axis; 1 where only the other is given.
        #[serde(default)]
        #[schemars(range(min = 1e-3, max = 1e3), extend("x-unit" = "1"))]
        along: Option<f64>,
        /// Factor across the axis; 1 where only the other is given.
        #[serde(default)]
        #[schemars(range(min = 1e-3, max = 1e3), extend("x-unit" = "1"))]
        across: Option<f64>,
    },
    /// `s ← f^w · s`, `q ← f^(−w/2) · q`: longer and thinner, or shorter and thicker. Volume is kept where `w` is 1.
    Stretch {
        /// Factor along the axis.
        #[schemars(range(min = 1e-3, max = 1e3), extend("x-unit" = "1"))]
        factor: f64,
    },
    /// `q ← f^w · q`, `s ← f^(−2w) · s`: as hands round a lump of clay. Volume is kept where `w` is 1.
    Squeeze {
        /// Factor across the axis.
        #[schemars(range(min = 1e-3, max = 1e3), extend("x-unit" = "1"))]
        factor: f64,
    },
    /// Turns about the axis by `w · rate · s` (Barr 1984).
    Twist {
        /// Turn for each mm along the axis.
        #[schemars(range(min = -1e6, max = 1e6), extend("x-unit" = "degrees/mm"))]
        rate: f64,
        /// Length of the part that is twisted, half of it on either side of the centre. What lies beyond goes along without being
        /// twisted itself. Without it there is no such end.
        #[serde(default)]
        #[schemars(extend("x-unit" = "mm", "exclusiveMinimum" = 0.0))]
        length: Option<f64>,
    },
    /// `q ← e^(w · rate · s) · q`. Barr's taper is linear, and turns inside out beyond its tip; this one has the same slope at
    /// the centre and no tip.
    Taper {
        /// Growth across the axis for each mm along it.
        #[schemars(range(min = -1e6, max = 1e6), extend("x-unit" = "1/mm"))]
        rate: f64,
        /// Length of the part that is tapered, half of it on either side of the centre. What lies beyond goes along without being
        /// tapered itself. Without it there is no such end.
        #[serde(default)]
        #[schemars(extend("x-unit" = "mm", "exclusiveMinimum" = 0.0))]
        length: Option<f64>,
    },
    /// Rolls the line through the centre along `spine` up to an arc about the axis, of curvature `w · rate`, and what is beside
    /// the line with it (Barr 1984). The lengths along the line are kept. It needs `rate · q < 1` towards the arc's middle.
    Bend {
        /// Turn for each mm along the spine.
        #[schemars(range(min = -1e6, max = 1e6), extend("x-unit" = "degrees/mm"))]
        rate: f64,
        /// Direction of the line that is bent, RAS; its part across the axis counts.
        #[schemars(extend("x-unit" = "1"))]
        spine: [f64; 3],
        /// Length of the part that is bent, half of it on either side of the centre. What lies beyond goes along without being bent
        /// itself. Without it there is no such end.
        #[serde(default)]
        #[schemars(extend("x-unit" = "mm", "exclusiveMinimum" = 0.0))]
        length: Option<f64>,
    },
}

impl Kind {
    /// How far it takes everything (mm), where it takes everything alike.
    pub fn way(&self) -> Option<[f64; 3]> {
        match *self {
            Self::Translate { by } => Some(by),
            Self::Rotate { .. }
            | Self::Scale { .. }
            | Self::Stretch { .. }
            | Self::Squeeze { .. }
            | Self::Twist { .. }
            | Self::Taper { .. }
            | Self::Bend { .. } => None,
        }
    }

    /// Length of the part that is twisted, tapered or bent (mm), where it has an end.
    fn length(&self) -> Option<f64> {
        match *self {
            Self::Twist { length, .. } | Self::Taper { length, .. } | Self::Bend { length, .. } => length,
            Self::Translate { .. }
            | Self::Rotate { .. }
            | Self::Scale { .. }
            | Self::Stretch { .. }
            | Self::Squeeze { .. } => None,
        }
    }
}

/// A shape change about a centre, within a ball.
///
/// It does its whole work within `core · radius` of the centre, fades out smoothly from there, and does nothing from `radius`
/// on, bit for bit.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Shape {
    /// What it does.
    #[serde(flatten)]
    pub kind: Kind,
    /// Centre, RAS.
    #[schemars(extend("x-unit" = "mm"))]
    pub centre: [f64; 3],
    /// Direction of the axis, RAS; any length but 0.
    #[serde(default = "along_z")]
    #[schemars(extend("x-unit" = "1"))]
    pub axis: [f64; 3],
    /// Distance from the centre from which on nothing moves.
    #[schemars(extend("x-unit" = "mm", "exclusiveMinimum" = 0.0))]
    pub radius: f64,
    /// Fraction of the radius within which the work is done whole.
    #[serde(default = "half")]
    #[schemars(range(min = 0.0), extend("x-unit" = "1", "exclusiveMaximum" = 1.0))]
    pub core: f64,
}

impl Shape {
    /// # Errors
    /// [`ParamError`] names the part that is out of its domain.
    pub fn check(&self) -> Result<(), ParamError> {
        check_fields(self)?;
        self.check_together()
    }

    /// What the schema of a single field can't say.
    ///
    /// # Errors
    /// [`ParamError`] names the part that is out of its domain.
    pub fn check_together(&self) -> Result<(), ParamError> {
        is_finite("centre", &self.centre)?;
        is_direction("axis", &self.axis)?;
        is_near("radius", self.radius)?;
        is_near("length", self.kind.length().unwrap_or(0.0))?;
        match &self.kind {
            Kind::Translate { by } => is_finite("by", by),
            Kind::Scale { along: None, across: None } => {
                Err(ParamError::at_itself("along and across are missing", "give one of them or both"))
            }
            Kind::Bend { spine, .. } => {
                is_finite("spine", spine)?;
                let axis = Vector3::from(self.axis).normalize();
                let across = Vector3::from(*spine).normalize().cross(&axis).norm();
                if across > 1e-6 {
                    return Ok(());
                }
                Err(ParamError::new("spine", format!("{spine:?}"), "give a direction across the axis"))
            }
            Kind::Rotate { .. }
            | Kind::Scale { .. }
            | Kind::Stretch { .. }
            | Kind::Squeeze { .. }
            | Kind::Twist { .. }
            | Kind::Taper { .. } => Ok(()),
        }
    }

    /// Where it takes a point (mm, RAS) when it does `amount` of its work, 0 … 1. A point out of its reach comes back bit for
    /// bit.
    pub fn apply(&self, point: Vector3<f64>, amount: f64) -> Vector3<f64> {
        let centre = Vector3::from(self.centre);
        let from_centre = point - centre;
        let weight = within_ball(from_centre.norm(), self.radius, self.core) * amount;
        if weight == 0.0 {
            return point;
        }
        centre + self.about_centre(from_centre, weight)
    }

    /// `T(w)` of a point relative to the centre.
    fn about_centre(&self, point: Vector3<f64>, w: f64) -> Vector3<f64> {
        let axis = Unit::new_normalize(Vector3::from(self.axis));
        let s = point.dot(&axis);
        let across = point - axis.into_inner() * s;
        // The part of a place that counts for what goes on along a line, and how far beyond its end the place is.
        let within = |s: f64| match self.kind.length() {
            Some(length) => s.clamp(-length / 2.0, length / 2.0),
            None => s,
        };
        let scaled = |along: f64, across_by: f64| axis.into_inner() * (s * along) + across * across_by;
        match self.kind {
            Kind::Translate { by } => point + Vector3::from(by) * w,
            Kind::Rotate { angle } => turn(axis, w * angle) * point,
            Kind::Scale { along, across } => {
                scaled(along.unwrap_or(1.0).powf(w), across.unwrap_or(1.0).powf(w))
            }
            Kind::Stretch { factor } => scaled(factor.powf(w), factor.powf(-w / 2.0)),
            Kind::Squeeze { factor } => scaled(factor.powf(-2.0 * w), factor.powf(w)),
            Kind::Twist { rate, .. } => turn(axis, w * rate * within(s)) * point,
            Kind::Taper { rate, .. } => scaled(1.0, (w * rate * within(s)).exp()),
            Kind::Bend { rate, spine, .. } => {
                let line = Vector3::from(spine);
                let line = (line - axis.into_inner() * line.dot(&axis)).normalize();
                let up = axis.cross(&line);
                let (t, height) = (point.dot(&line), point.dot(&up));
                let bent = within(t);
                let angle = (w * rate * bent).to_radians();
                let (sine, cosine) = angle.sin_cos();
                // The arc of length `bent` whose ends differ by `angle` in direction.
                let chord =
                    if angle.abs() > 1e-12 { bent * (angle / 2.0).sin() / (angle / 2.0) } else { bent };
                let (half_sine, half_cosine) = (angle / 2.0).sin_cos();
                let on_arc = line * (chord * half_cosine) + up * (chord * half_sine);
                on_arc
                    + (line * cosine + up * sine) * (t - bent)
                    + (up * cosine - line * sine) * height
                    + axis.into_inner() * s
            }
        }
    }
}

fn turn(axis: Unit<Vector3<f64>>, degrees: f64) -> Rotation3<f64> {
    Rotation3::from_axis_angle(&axis, degrees.to_radians())
}
