//! Clipping in pictures: half spaces and boxes that are shown, of which rays see what all of them share.

use ivd_core::{Grid, ParamError};
use nalgebra::Vector3;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// What is shown: a half space by `point` and `normal`, or a box along the world's axes by `min` and `max`.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct Clip {
    /// A point of the plane (RAS).
    #[schemars(extend("x-unit" = "mm"))]
    pub point: Option<[f64; 3]>,
    /// Towards the side of the plane that is shown; of any length but 0.
    #[schemars(extend("x-unit" = "1"))]
    pub normal: Option<[f64; 3]>,
    /// Lowest corner of the box (RAS).
    #[schemars(extend("x-unit" = "mm"))]
    pub min: Option<[f64; 3]>,
    /// Highest corner (RAS), nowhere below the lowest.
    #[schemars(extend("x-unit" = "mm"))]
    pub max: Option<[f64; 3]>,
}

/// Where planes and boxes lie.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum ClipSpace {
    /// Where the deformed volume is: what is seen is cut.
    #[default]
    Deformed,
    /// Where the volume was before: what is cut moves along with it.
    Rest,
}

impl Clip {
    /// The side of a plane that its normal points to.
    pub fn plane(point: [f64; 3], normal: [f64; 3]) -> Self {
        Self { point: Some(point), normal: Some(normal), ..Self::default() }
    }

    /// A box from its lowest to its highest corner.
    pub fn cuboid(min: [f64; 3], max: [f64; 3]) -> Self {
        Self { min: Some(min), max: Some(max), ..Self::default() }
    }

    /// Checks that it is one thing, and a whole one.
    pub(crate) fn check(&self) -> Result<(), ParamError> {
        let fault = |problem: String, remedy| Err(ParamError::new("clip", problem, remedy));
        match (self.point, self.normal, self.min, self.max) {
            (Some(point), Some([0.0, 0.0, 0.0]), None, None) => fault(
                format!("the normal at {point:?} has length 0 and points nowhere"),
                "give a normal towards the side to show",
            ),
            (Some(_), Some(_), None, None) => Ok(()),
            (None, None, Some(min), Some(max)) => match (0..3).find(|&a| min[a] > max[a]) {
                Some(a) => fault(
                    format!("min {min:?} is above max {max:?} along {}", ["x", "y", "z"][a]),
                    "give the lowest corner as min, the highest as max",
                ),
                None => Ok(()),
            },
            _ => fault("neither a plane nor a box".to_owned(), "give point and normal, or min and max"),
        }
    }
}

/// A half space that is shown, in voxel coordinates.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct HalfSpace {
    /// Unit, in the world, out of what is shown.
    pub(crate) outward: Vector3<f64>,
    /// Rise of the height with a voxel along each axis (mm).
    pub(crate) along: Vector3<f64>,
    /// Height of voxel 0 (mm).
    offset: f64,
}

impl HalfSpace {
    /// Those that all hold where something is shown: planes, and the faces of boxes.
    pub(crate) fn all(clips: &[Clip], grid: &Grid) -> Vec<Self> {
        let axis = |a: usize, sign: f64| {
            let mut normal = [0.0; 3];
            normal[a] = sign;
            normal
        };
        let mut all = Vec::new();
        for clip in clips {
            if let (Some(point), Some(normal)) = (clip.point, clip.normal) {
                all.push(Self::new(point, normal, grid));
            }
            if let (Some(min), Some(max)) = (clip.min, clip.max) {
                let faces = |a| [Self::new(min, axis(a, 1.0), grid), Self::new(max, axis(a, -1.0), grid)];
                all.extend((0..3).flat_map(faces));
            }
        }
        all
    }

    fn new(point: [f64; 3], normal: [f64; 3], grid: &Grid) -> Self {
        // Scaled first, so that no square of a component is 0 or infinite.
        let normal = Vector3::from(normal);
        let normal = (normal / normal.amax()).normalize();
        // Differences first: an origin 10⁶ mm away costs no precision.
        let offset = normal.dot(&(Vector3::from(grid.origin()) - Vector3::from(point)));
        Self { outward: -normal, along: grid.linear_part().transpose() * normal, offset }
    }

    /// How far a voxel coordinate lies within what is shown (mm); negative beyond the plane.
    pub(crate) fn height(&self, at: Vector3<f64>) -> f64 {
        self.along.dot(&at) + self.offset
    }
}
