use ivd_core::ParamError;
use nalgebra::Vector3;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// A half space: the side of a plane that its normal points to, with the plane itself.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct HalfSpace {
    /// A point of the plane (RAS).
    #[schemars(extend("x-unit" = "mm"))]
    pub point: [f64; 3],
    /// Where to; of any length but 0.
    #[schemars(extend("x-unit" = "1"))]
    pub normal: [f64; 3],
}

/// A box along the world's axes, with its faces.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Cuboid {
    /// Lowest corner (RAS).
    #[schemars(extend("x-unit" = "mm"))]
    pub min: [f64; 3],
    /// Highest corner (RAS), nowhere below the lowest.
    #[schemars(extend("x-unit" = "mm"))]
    pub max: [f64; 3],
}

/// What a clip keeps: all that lies in every half space and in every box and, where there is a tag, in what is tagged.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(default)]
pub struct ClipParams {
    /// Half spaces that are kept, each with its plane: the voxels whose centres lie there. A lattice of what is kept ends up to a voxel from the plane.
    #[schemars(extend("x-alias" = ["plane"]))]
    pub planes: Vec<HalfSpace>,
    /// Boxes along the world's axes that are kept, with their faces: the voxels whose centres lie there.
    #[schemars(extend("x-alias" = ["box"]))]
    pub boxes: Vec<Cuboid>,
    /// Of labels that tag: the class meant; without it every label but 0.
    #[schemars(extend("x-unit" = "1"))]
    pub class: Option<u16>,
    /// Throws away what would be kept, and keeps the rest.
    pub invert: bool,
    /// Value (for labels an id, for a mask 0 or 1) of what is thrown away. Without it the smallest real value of the volume; 0 for
    /// labels and masks.
    #[schemars(extend("x-unit" = "real units"))]
    pub background: Option<f64>,
}

impl ClipParams {
    /// # Errors
    /// Names the field that is out of its domain: a normal of length 0, a box turned inside out, a number that isn't finite.
    pub fn check(&self) -> Result<(), ParamError> {
        let finite = |field: &'static str, values: &[f64; 3], part: &str| {
            if values.iter().all(|v| v.is_finite()) {
                return Ok(());
            }
            Err(ParamError::new(
                field,
                format!("{part} {values:?} isn't finite"),
                "give three numbers, x,y,z",
            ))
        };
        for HalfSpace { point, normal } in &self.planes {
            finite("plane", point, "point")?;
            finite("plane", normal, "normal")?;
            if *normal == [0.0; 3] {
                let problem = format!("the normal at {point:?} has length 0 and points nowhere");
                return Err(ParamError::new("plane", problem, "give a normal towards the side to keep"));
            }
        }
        for Cuboid { min, max } in &self.boxes {
            finite("box", min, "min")?;
            finite("box", max, "max")?;
            if let Some(a) = (0..3).find(|&a| min[a] > max[a]) {
                let problem = format!("min {min:?} is above max {max:?} along {}", ["x", "y", "z"][a]);
                return Err(ParamError::new(
                    "box",
                    problem,
                    "give the lowest corner as min, the highest as max",
                ));
            }
        }
        match self.background {
            Some(value) if !value.is_finite() => {
                let problem = format!("{value} is not finite");
                Err(ParamError::new("background", problem, "give a number, or leave it out"))
            }
            _ => Ok(()),
        }
    }

    /// All half spaces that must hold at once, with unit normals: planes, and the faces of boxes.
    pub(super) fn half_spaces(&self) -> Vec<HalfSpace> {
        let unit = |plane: &HalfSpace| {
            // Scaled first, so that no square of a component is 0 or infinite.
            let normal = Vector3::from(plane.normal);
            let normal = (normal / normal.amax()).normalize().into();
            HalfSpace { point: plane.point, normal }
        };
        let faces = self.boxes.iter().flat_map(|Cuboid { min, max }| {
            (0..6).map(|face| {
                let (axis, upper) = (face / 2, face % 2 == 1);
                let mut normal = [0.0; 3];
                normal[axis] = if upper { -1.0 } else { 1.0 };
                HalfSpace { point: if upper { *max } else { *min }, normal }
            })
        });
        self.planes.iter().map(unit).chain(faces).collect()
    }
}
