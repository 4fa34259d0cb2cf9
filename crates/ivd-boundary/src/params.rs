use ivd_core::{ClassChoice, ParamError};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// One connected piece of a class, or of what is at or above a value: the largest (or, of the latter, the one that encloses it), or the one at a seed.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default)]
pub struct ComponentParams {
    /// The class whose part is isolated: an id, densest or largest (except air). Without it the class at the seed, and without a seed the
    /// largest.
    #[schemars(extend("x-unit" = "1"))]
    pub class: Option<ClassChoice>,
    /// A point (RAS) in the piece to keep; without it the piece of the most voxels or, with `above`, one that encloses that piece.
    #[schemars(extend("x-unit" = "mm"))]
    pub seed: Option<[f64; 3]>,
    /// Whether holes inside the piece become part of it. Voxels without data stay out.
    #[schemars(extend("x-alias" = ["!keep_holes"]))]
    pub fill_holes: bool,
    /// The part is what is at or above this value, instead of a class.
    #[schemars(extend("x-unit" = "value", "x-from" = "lattice.iso", "x-unless" = "boundary.class"))]
    pub above: Option<f64>,
}

impl Default for ComponentParams {
    fn default() -> Self {
        Self { class: None, seed: None, fill_holes: true, above: None }
    }
}

/// Where a value is given there is no class.
pub(crate) fn check_together(params: &ComponentParams) -> Result<(), ParamError> {
    if params.above.is_some() && params.class.is_some() {
        return Err(ParamError::new("above", "given together with a class", "give one of the two"));
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use ivd_core::op::Op as _;

    use super::*;

    #[test]
    fn params_out_of_their_domain_name_the_field() {
        let field = |params: ComponentParams| params.check().unwrap_err().field;
        assert_eq!(field(ComponentParams { seed: Some([0.0, f64::NAN, 0.0]), ..Default::default() }), "seed");
        assert_eq!(field(ComponentParams { above: Some(f64::INFINITY), ..Default::default() }), "above");
        let class = Some(ClassChoice::Densest);
        assert_eq!(field(ComponentParams { above: Some(1.0), class, ..Default::default() }), "above");
        assert_eq!(ComponentParams { class, ..Default::default() }.check(), Ok(()));
    }
}
