use ivd_core::ParamError;
use nalgebra::{Rotation3, Unit, Vector3};
use serde::{Deserialize, Serialize};

use crate::map::smooth_fall;

/// What a shape change does, in coordinates about its centre: `s` along its axis, `q` across it (mm).
///
/// Each is a family `T(w)` with `T(0)` the identity, so that a weight fades it out by doing less of it, not by mixing
/// places: half a turn fades through quarter turns.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Kind {
    /// Moves by `w · by`.
    Translate {
        /// Way to go (mm), RAS.
        by: [f64; 3],
    },
    /// Turns about the axis by `w · angle`, counter-clockwise as seen from the axis' tip.
    Rotate {
        /// Degrees.
        angle: f64,
    },
    /// `s ← along^w · s`, `q ← across^w · q`.
    Scale {
        /// Factor along the axis, > 0.
        along: f64,
        /// Factor across it, > 0.
        across: f64,
    },
    /// `s ← f^w · s`, `q ← f^(−w/2) · q`: longer and thinner, or shorter and thicker. Volume is kept where `w` is 1.
    Stretch {
        /// Factor along the axis, > 0.
        factor: f64,
    },
    /// `q ← f^w · q`, `s ← f^(−2w) · s`: as hands round a lump of clay. Volume is kept where `w` is 1.
    Squeeze {
        /// Factor across the axis, > 0.
        factor: f64,
    },
    /// Turns about the axis by `w · rate · s` (Barr 1984).
    Twist {
        /// Degrees for each mm along the axis.
        rate: f64,
    },
    /// `q ← e^(w · rate · s) · q`. Barr's taper is linear, and turns inside out beyond its tip; this one has the same slope at
    /// the centre and no tip.
    Taper {
        /// Growth across the axis for each mm along it (1/mm).
        rate: f64,
    },
    /// Rolls the line through the centre along `spine` up to an arc about the axis, of curvature `w · rate`, and what is beside
    /// the line with it (Barr 1984). The lengths along the line are kept. It needs `rate · q < 1` towards the arc's middle.
    Bend {
        /// Degrees for each mm along the spine.
        rate: f64,
        /// Direction of the line that is bent, RAS; its part across the axis counts.
        spine: [f64; 3],
    },
}

/// A shape change about a centre, within a ball.
///
/// It does its whole work within `core · radius` of the centre, fades out smoothly from there, and does nothing from `radius`
/// on, bit for bit.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Shape {
    /// What it does.
    pub kind: Kind,
    /// Centre (mm), RAS.
    pub centre: [f64; 3],
    /// Direction of the axis, RAS; any length but 0.
    #[serde(default = "Shape::default_axis")]
    pub axis: [f64; 3],
    /// Distance from which on nothing moves (mm).
    pub radius: f64,
    /// Fraction of the radius within which the work is done whole, 0 … below 1.
    #[serde(default)]
    pub core: f64,
    /// For twist, taper and bend: length of the part that is twisted, tapered or bent (mm), half of it on either side of the
    /// centre. What lies beyond goes along without being twisted, tapered or bent itself. Without it there is no such end.
    #[serde(default)]
    pub length: Option<f64>,
}

impl Shape {
    fn default_axis() -> [f64; 3] {
        [0.0, 0.0, 1.0]
    }

    /// # Errors
    /// [`ParamError`] names the part that is out of its domain.
    pub fn check(&self) -> Result<(), ParamError> {
        let finite = |field, vector: &[f64; 3]| {
            if vector.iter().all(|c| c.abs() <= 1e100) {
                return Ok(());
            }
            Err(ParamError::new(field, format!("{vector:?}"), "give three finite numbers"))
        };
        let length = |field, value: f64| {
            if value > 0.0 && value <= 1e100 {
                return Ok(());
            }
            Err(ParamError::new(field, format!("{value} mm"), "use a positive length"))
        };
        let factor = |field, value: f64| {
            if (1e-3..=1e3).contains(&value) {
                return Ok(());
            }
            Err(ParamError::new(field, format!("{value}"), "use a factor, 0.001 to 1000"))
        };
        let number = |field, value: f64| {
            if value.abs() <= 1e6 {
                return Ok(());
            }
            Err(ParamError::new(field, format!("{value}"), "use -1e6 to 1e6"))
        };
        finite("centre", &self.centre)?;
        finite("axis", &self.axis)?;
        if Vector3::from(self.axis).norm() < 1e-100 {
            return Err(ParamError::new("axis", format!("{:?}", self.axis), "give a direction"));
        }
        length("radius", self.radius)?;
        length("length", self.length.unwrap_or(1.0))?;
        if !(0.0..1.0).contains(&self.core) {
            return Err(ParamError::new("core", format!("{}", self.core), "use a fraction, 0 to below 1"));
        }
        match &self.kind {
            Kind::Translate { by } => finite("by", by),
            Kind::Rotate { angle } => number("angle", *angle),
            Kind::Scale { along, across } => factor("along", *along).and(factor("across", *across)),
            Kind::Stretch { factor: f } | Kind::Squeeze { factor: f } => factor("factor", *f),
            Kind::Twist { rate } | Kind::Taper { rate } => number("rate", *rate),
            Kind::Bend { rate, spine } => {
                number("rate", *rate)?;
                finite("spine", spine)?;
                let axis = Vector3::from(self.axis).normalize();
                let across = Vector3::from(*spine).normalize().cross(&axis).norm();
                if across > 1e-6 {
                    return Ok(());
                }
                Err(ParamError::new("spine", format!("{spine:?}"), "give a direction across the axis"))
            }
        }
    }

    /// How much of its work it does at a distance from the centre (mm): 1 … 0.
    fn weight(&self, distance: f64) -> f64 {
        let core = self.core * self.radius;
        if distance >= self.radius { 0.0 } else { smooth_fall((distance - core) / (self.radius - core)) }
    }

    /// Where it takes a point (mm, RAS) when it does `amount` of its work, 0 … 1. A point out of its reach comes back bit for
    /// bit.
    pub fn apply(&self, point: Vector3<f64>, amount: f64) -> Vector3<f64> {
        let centre = Vector3::from(self.centre);
        let from_centre = point - centre;
        let weight = self.weight(from_centre.norm()) * amount;
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
        let within = |s: f64| match self.length {
            Some(length) => s.clamp(-length / 2.0, length / 2.0),
            None => s,
        };
        let scaled = |along: f64, across_by: f64| axis.into_inner() * (s * along) + across * across_by;
        match self.kind {
            Kind::Translate { by } => point + Vector3::from(by) * w,
            Kind::Rotate { angle } => turn(axis, w * angle) * point,
            Kind::Scale { along, across } => scaled(along.powf(w), across.powf(w)),
            Kind::Stretch { factor } => scaled(factor.powf(w), factor.powf(-w / 2.0)),
            Kind::Squeeze { factor } => scaled(factor.powf(-2.0 * w), factor.powf(w)),
            Kind::Twist { rate } => turn(axis, w * rate * within(s)) * point,
            Kind::Taper { rate } => scaled(1.0, (w * rate * within(s)).exp()),
            Kind::Bend { rate, spine } => {
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
