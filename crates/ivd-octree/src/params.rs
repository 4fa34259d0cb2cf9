use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// How fine an octree is.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default)]
pub struct Params {
    /// Edge of a surface leaf (voxels), a power of two from 1 to 64. Smaller leaves list fewer triangles each and take
    /// more memory; results of queries don't depend on it.
    #[schemars(range(min = 1, max = 64), extend("x-unit" = "voxels"))]
    pub leaf_size: u32,
}

impl Default for Params {
    fn default() -> Self {
        Self { leaf_size: 4 }
    }
}
