use ivd_core::ParamError;
use serde::{Deserialize, Serialize};

/// How fine an octree is.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Params {
    /// Edge of a surface leaf (voxels), a power of two from 1 to 64. Smaller leaves list fewer triangles each and take
    /// more memory; results of queries don't depend on it.
    pub leaf_size: u32,
}

impl Default for Params {
    fn default() -> Self {
        Self { leaf_size: 4 }
    }
}

impl Params {
    /// # Errors
    /// [`ParamError`] names the field that is out of its domain.
    pub fn check(&self) -> Result<(), ParamError> {
        if !self.leaf_size.is_power_of_two() || self.leaf_size > 64 {
            let problem = format!("{} voxels", self.leaf_size);
            return Err(ParamError::new("leaf_size", problem, "use 1, 2, 4, 8, 16, 32 or 64"));
        }
        Ok(())
    }
}
