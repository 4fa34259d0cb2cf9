//! Spatial transfer functions: a curve over a coordinate of space says how far, or how much, everything there moves.

use ivd_core::ParamError;
use ivd_core::op::check_fields;
use ivd_field::falloff::within_ball;
use ivd_field::param::{along_z, half, is_direction, is_finite, is_near};
use nalgebra::{Rotation3, Unit, Vector3};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// The coordinate that a curve runs over (mm).
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum Over {
    /// Along the axis, from the centre.
    Along,
    /// Distance from the axis.
    Across,
    /// Distance from the centre.
    Distance,
}

/// What a curve's value does.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum Way {
    /// Moves along the axis by the value (mm).
    Shift,
    /// Turns about the axis by the value (degrees), counter-clockwise as seen from the axis' tip.
    Turn,
    /// Scales the distance from the axis by the value (a factor, 0.001 … 1000).
    Swell,
    /// Scales the distance from the centre by the value (a factor, 0.001 … 1000).
    Grow,
}

impl Way {
    /// The value that leaves everything where it is.
    fn rest(self) -> f64 {
        if matches!(self, Self::Swell | Self::Grow) { 1.0 } else { 0.0 }
    }
}

/// A spatial transfer function (Chen et al. 2003): as a transfer function gives a colour to a value, it gives a motion to a place.
///
/// Between its knots the curve is a cubic that is monotone where the knots are (Fritsch and Butland 1984), so that it never
/// overshoots them; beyond the outer knots it is constant. It does its whole work within `core · radius` of the centre, fades
/// out smoothly from there, and does nothing from `radius` on.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Curve {
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
    /// What the curve runs over.
    pub over: Over,
    /// What its value does.
    pub way: Way,
    /// Pairs of a coordinate (mm), ascending, and a value (mm, degrees or a factor).
    #[schemars(length(min = 1, max = 4096), extend("x-unit" = "1"))]
    pub knots: Vec<[f64; 2]>,
}

impl Curve {
    /// # Errors
    /// [`ParamError`] names the part that is out of its domain.
    pub fn check(&self) -> Result<(), ParamError> {
        check_fields(self)?;
        self.check_together()
    }

    /// What the schema of a single field can't say.
    pub(super) fn check_together(&self) -> Result<(), ParamError> {
        is_finite("centre", &self.centre)?;
        is_direction("axis", &self.axis)?;
        is_near("radius", self.radius)?;
        if let Some(pair) = self
            .knots
            .windows(2)
            .find(|pair| pair[0][0].partial_cmp(&pair[1][0]) != Some(std::cmp::Ordering::Less))
        {
            let found = format!("{} before {}", pair[0][0], pair[1][0]);
            return Err(ParamError::new("knots", found, "let their coordinates ascend"));
        }
        let fits = |value: f64| match self.way {
            Way::Shift | Way::Turn => value.abs() <= 1e6,
            Way::Swell | Way::Grow => (1e-3..=1e3).contains(&value),
        };
        match self.knots.iter().find(|knot| !(knot[0].abs() <= 1e100 && fits(knot[1]))) {
            None => Ok(()),
            Some(knot) => Err(ParamError::new(
                "knots",
                format!("{knot:?}"),
                if self.way.rest() == 1.0 { "use factors, 0.001 to 1000" } else { "use values, -1e6 to 1e6" },
            )),
        }
    }

    /// The curve's value at a coordinate (mm).
    pub fn value(&self, at: f64) -> f64 {
        let knots = &self.knots;
        let next = knots.partition_point(|knot| knot[0] <= at);
        let (Some(last), Some(end)) = (next.checked_sub(1), knots.get(next)) else {
            return knots[next.min(knots.len() - 1)][1];
        };
        let [start, from] = knots[last];
        let [width, rise] = [end[0] - start, end[1] - from];
        let t = (at - start) / width;
        let (a, b) = (self.slope(last) * width, self.slope(next) * width);
        from + t * (a + t * (3.0 * rise - 2.0 * a - b + t * (a + b - 2.0 * rise)))
    }

    /// Slope at a knot: the weighted harmonic mean of its neighbours' where they agree in sign, else 0; 0 at the ends, beyond which
    /// the curve is constant.
    fn slope(&self, knot: usize) -> f64 {
        let Some(near) = knot.checked_sub(1).and_then(|first| self.knots.get(first..first + 3)) else {
            return 0.0;
        };
        let width = [near[1][0] - near[0][0], near[2][0] - near[1][0]];
        let slope = [(near[1][1] - near[0][1]) / width[0], (near[2][1] - near[1][1]) / width[1]];
        if slope[0] * slope[1] <= 0.0 {
            return 0.0;
        }
        let weight = [2.0 * width[1] + width[0], width[1] + 2.0 * width[0]];
        (weight[0] + weight[1]) / (weight[0] / slope[0] + weight[1] / slope[1])
    }

    /// Where it takes a point (mm, RAS) when it does `amount` of its work, 0 … 1. A point out of its reach comes back bit for bit.
    pub fn apply(&self, point: Vector3<f64>, amount: f64) -> Vector3<f64> {
        let centre = Vector3::from(self.centre);
        let local = point - centre;
        let weight = within_ball(local.norm(), self.radius, self.core) * amount;
        if weight == 0.0 {
            return point;
        }
        let axis = Unit::new_normalize(Vector3::from(self.axis));
        let along = local.dot(&axis);
        let across = local - axis.into_inner() * along;
        let value = self.value(match self.over {
            Over::Along => along,
            Over::Across => across.norm(),
            Over::Distance => local.norm(),
        });
        if value == self.way.rest() {
            return point;
        }
        centre
            + match self.way {
                Way::Shift => local + axis.into_inner() * (weight * value),
                Way::Turn => Rotation3::from_axis_angle(&axis, (weight * value).to_radians()) * local,
                Way::Swell => axis.into_inner() * along + across * value.powf(weight),
                Way::Grow => local * value.powf(weight),
            }
    }
}
