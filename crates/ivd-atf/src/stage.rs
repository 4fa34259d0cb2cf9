use ivd_core::op::{Failure, Memory, Method, Op, Place, Stage, Want, method};
use ivd_core::{Exec, ParamError, TransferFunction};

use crate::figures::Figures;
use crate::params::{Axes, Inputs, Params};

/// The stage as scenes and commands see it.
pub const STAGE: Stage = Stage {
    name: "atf",
    about: "Makes a transfer function from the classes.",
    selector: "",
    methods: METHODS,
    positional: &["volume", "labels"],
    places: &[Place {
        for_readers: true,
        unread: "the rendering mode has no transfer function",
        ..Place::only("transfer")
    }],
    quiet: false,
    memory: Memory { voxel: 6, reached: 0, triangle: 0 },
};
const METHODS: &[Method] = &[method::<Params>("")];

impl Op for Params {
    const REVISION: u32 = 8;
    type Inputs<'a> = Inputs<'a>;
    type Gives = (TransferFunction, Figures);

    fn check_together(&self) -> Result<(), ParamError> {
        self.require_bounds_in_order()
    }

    fn wants(&self, _: &str) -> Want {
        if self.iso.is_none() { Want::Yes } else { Want::No }
    }

    fn run(&self, inputs: Inputs<'_>, exec: &Exec) -> Result<Self::Gives, Failure> {
        let built = match (self.iso, inputs.labels) {
            (Some(_), _) if self.axes != Axes::Value => {
                return Err(Failure::usage(
                    "a table by value and gradient shows classes, and an isovalue has none: give labels without iso, or axes value",
                ));
            }
            (Some(iso), _) => crate::from_isovalue(inputs.volume, iso, self, exec)?,
            (None, Some(labels)) => crate::transfer(inputs.volume, labels, self, exec)?,
            (None, None) => {
                return Err(Failure::usage("needs labels, or iso, a value to split the volume at"));
            }
        };
        Ok((built.transfer, built.figures))
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
        assert_eq!(bad(Params { max_opacity: f64::NAN, ..Params::default() }), "max_opacity");
        assert_eq!(bad(Params { views: 15, ..Params::default() }), "views");
        assert_eq!(bad(Params { min_opacity: 0.9, ..Params::default() }), "min_opacity");
        assert_eq!(bad(Params { size_exponent: -1.0, ..Params::default() }), "size_exponent");
        assert_eq!(bad(Params { softness: f64::INFINITY, ..Params::default() }), "softness");
    }
}
