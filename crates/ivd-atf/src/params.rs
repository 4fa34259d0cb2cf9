use ivd_core::op::{Failure, Method, Op, Place, Stage, Want, method};
use ivd_core::{Exec, Labels, ParamError, TransferFunction, Volume, slots};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

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
};
const METHODS: &[Method] = &[method::<Params>("")];

/// What the transfer function is to be.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default)]
pub struct Params {
    /// Samples of each row of the table, over the volume's range.
    #[schemars(range(min = 2, max = 65536), extend("x-unit" = "samples", "x-knob" = "accuracy"))]
    pub resolution: usize,
    /// Opacity of the most prominent class over the reference length.
    #[schemars(range(min = 0.0, max = 1.0), extend("x-unit" = "1"))]
    pub max_opacity: f64,
    /// Opacity below which no class but air falls, at most `max_opacity`: a class that hardly stands out stays visible.
    #[schemars(range(min = 0.0, max = 1.0), extend("x-unit" = "1"))]
    pub min_opacity: f64,
    /// Power of "inverse size": a class of share `n` of the voxels is weighed by `n` to the minus this. At 1/3 it is an inverse length, so
    /// that rays gather about as much in a large class as in a small one.
    #[schemars(range(min = 0.0), extend("x-unit" = "1"))]
    pub size_exponent: f64,
    /// Half width of an edge in standard deviations of the narrower class; 0 for hard edges.
    #[schemars(range(min = 0.0), extend("x-unit" = "1"))]
    pub softness: f64,
    /// Isovalue that splits the volume, where it isn't coloured by its classes.
    #[schemars(extend("x-unit" = "that of the values", "x-from" = "lattice.iso", "x-unless" = "boundary.class"))]
    pub iso: Option<f64>,
}

impl Default for Params {
    fn default() -> Self {
        Self {
            resolution: 1024,
            max_opacity: 0.6,
            min_opacity: 0.01,
            size_exponent: 1.0 / 3.0,
            softness: 1.0,
            iso: None,
        }
    }
}

slots! {
    /// What is coloured, and by which classes.
    pub struct Inputs<'a> { volume: &'a Volume, labels: Option<&'a Labels> }
}

/// What a transfer function comes to.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Figures {
    /// Classes that have an entry: those that occur.
    #[schemars(extend("x-unit" = "1", "x-headline" = 1))]
    pub entries: usize,
    /// Least and greatest opacity of the entries over the reference length; zeros without entries.
    #[schemars(extend("x-unit" = "1"))]
    pub opacity_range: [f32; 2],
}

impl Op for Params {
    const REVISION: u32 = 2;
    type Inputs<'a> = Inputs<'a>;
    type Output = TransferFunction;
    type Figures = Figures;

    fn check_together(&self) -> Result<(), ParamError> {
        if self.min_opacity <= self.max_opacity {
            return Ok(());
        }
        Err(ParamError::new(
            "min_opacity",
            format!("{}", self.min_opacity),
            format!("give 0 … {}, which is max_opacity", self.max_opacity),
        ))
    }

    fn wants(&self, _: &str) -> Want {
        if self.iso.is_none() { Want::Yes } else { Want::No }
    }

    fn run(&self, inputs: Inputs<'_>, exec: &Exec) -> Result<(TransferFunction, Figures), Failure> {
        let built = match (self.iso, inputs.labels) {
            (Some(iso), _) => crate::from_isovalue(inputs.volume, iso, self, exec)?,
            (None, Some(labels)) => crate::transfer(inputs.volume, labels, self, exec)?,
            (None, None) => {
                return Err(Failure::usage("needs labels, or iso, a value to split the volume at"));
            }
        };
        Ok((built.transfer, Figures { entries: built.entries, opacity_range: built.opacity_range }))
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
        assert_eq!(bad(Params { min_opacity: 0.9, ..Params::default() }), "min_opacity");
        assert_eq!(bad(Params { size_exponent: -1.0, ..Params::default() }), "size_exponent");
        assert_eq!(bad(Params { softness: f64::INFINITY, ..Params::default() }), "softness");
    }
}
