use ivd_core::ParamError;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::handles::{self, Action, Anchor};

/// A vertex that is moved or pulled: `pick` or `vertex`, `move` or `force`, and how far round it the lattice follows.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Handle {
    /// A point, RAS; the nearest vertex is taken, at most ten voxel diagonals away. Instead of numbers, landmarks of 3D Slicer:
    /// `FILE.mrk.json#LABEL`, or FILE.mrk.json for a handle at each of its points.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(extend("x-unit" = "mm"))]
    pub pick: Option<[f64; 3]>,
    /// Number of a vertex of the lattice that is deformed.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(extend("x-unit" = "1"))]
    pub vertex: Option<u32>,
    /// Where the vertex goes, relative, RAS.
    #[serde(default, rename = "move", skip_serializing_if = "Option::is_none")]
    #[schemars(extend("x-unit" = "mm"))]
    pub by: Option<[f64; 3]>,
    /// The force on it, RAS; how far it goes is physics.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(extend("x-unit" = "mN"))]
    pub force: Option<[f64; 3]>,
    /// Reach in rest space: beyond it nothing moves.
    #[schemars(extend("x-unit" = "mm", "exclusiveMinimum" = 0.0))]
    pub radius: f64,
}

/// Vertices within a ball that stay where they are.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Pin {
    /// Centre, RAS; the nearest vertex is taken. Instead of numbers, landmarks of 3D Slicer: `FILE.mrk.json#LABEL`, or all points of
    /// FILE.mrk.json.
    #[schemars(extend("x-unit" = "mm"))]
    pub pick: [f64; 3],
    /// Radius in rest space.
    #[schemars(extend("x-unit" = "mm", "exclusiveMinimum" = 0.0))]
    pub radius: f64,
}

impl Handle {
    /// The handle as solvers take it.
    ///
    /// # Errors
    /// Not exactly one place and one action; a place or an action that is no place.
    pub fn read(&self) -> Result<handles::Handle, ParamError> {
        let one = |keys: &str, given: bool| {
            let problem =
                if given { format!("{keys} are both given") } else { format!("{keys} are missing") };
            ParamError::at_itself(problem, "give one of them")
        };
        let at = match (self.pick, self.vertex) {
            (Some(point), None) => Anchor::NearestTo(point),
            (None, Some(vertex)) => Anchor::Vertex(vertex),
            (pick, _) => return Err(one("pick = [x, y, z] (mm) and vertex = N", pick.is_some())),
        };
        let action = match (self.by, self.force) {
            (Some(by), None) => Action::Move(by),
            (None, Some(force)) => Action::Force(force),
            (by, _) => return Err(one("move = [x, y, z] (mm) and force = [x, y, z] (mN)", by.is_some())),
        };
        let handle = handles::Handle { at, action, radius: self.radius };
        handle.check()?;
        Ok(handle)
    }
}

impl Pin {
    /// The fixed place as solvers take it.
    pub fn read(&self) -> handles::Pin {
        handles::Pin { at: Anchor::NearestTo(self.pick), radius: self.radius }
    }
}
