use ivd_core::ParamError;
use serde::{Deserialize, Serialize};

/// What the transfer function is to be.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Params {
    /// Samples of each row over the volume's range (count), 2…65536.
    pub resolution: usize,
    /// Opacity of the most prominent class over the reference length (no unit), 0…1.
    pub max_opacity: f32,
    /// Opacity below which no class but air falls (no unit), 0…`max_opacity`: a class that hardly stands out stays visible.
    pub min_opacity: f32,
    /// Power of "inverse size" (no unit), ≥ 0: a class of share `n` of the voxels is weighed by `n^-size_exponent`. The default 1/3 makes it an inverse
    /// length, so that rays gather about as much in a large class as in a small one.
    pub size_exponent: f64,
    /// Half width of an edge in standard deviations of the narrower class (no unit), ≥ 0; 0 for hard edges.
    pub softness: f64,
}

impl Default for Params {
    fn default() -> Self {
        Self {
            resolution: 1024,
            max_opacity: 0.6,
            min_opacity: 0.01,
            size_exponent: 1.0 / 3.0,
            softness: 1.0,
        }
    }
}

impl Params {
    /// Checks every field against its domain.
    ///
    /// # Errors
    /// [`ParamError`] names the first field that leaves it.
    pub fn check(&self) -> Result<(), ParamError> {
        if !(2..=65536).contains(&self.resolution) {
            return Err(ParamError::new("resolution", format!("{} samples", self.resolution), "use 2…65536"));
        }
        if !(0.0..=1.0).contains(&self.max_opacity) {
            return Err(ParamError::new("max_opacity", format!("{}", self.max_opacity), "use 0…1"));
        }
        if !(0.0..=self.max_opacity).contains(&self.min_opacity) {
            return Err(ParamError::new("min_opacity", format!("{}", self.min_opacity), "use 0…max_opacity"));
        }
        if !(self.size_exponent.is_finite() && self.size_exponent >= 0.0) {
            return Err(ParamError::new(
                "size_exponent",
                format!("{}", self.size_exponent),
                "use a number ≥ 0",
            ));
        }
        if !(self.softness.is_finite() && self.softness >= 0.0) {
            return Err(ParamError::new("softness", format!("{}", self.softness), "use a number ≥ 0"));
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_field_out_of_its_domain_is_named() {
        assert!(Params::default().check().is_ok());
        let bad = |params: Params| params.check().unwrap_err().field;
        assert_eq!(bad(Params { resolution: 1, ..Params::default() }), "resolution");
        assert_eq!(bad(Params { max_opacity: f32::NAN, ..Params::default() }), "max_opacity");
        assert_eq!(bad(Params { min_opacity: 0.9, ..Params::default() }), "min_opacity");
        assert_eq!(bad(Params { size_exponent: -1.0, ..Params::default() }), "size_exponent");
        assert_eq!(bad(Params { softness: f64::INFINITY, ..Params::default() }), "softness");
    }
}
