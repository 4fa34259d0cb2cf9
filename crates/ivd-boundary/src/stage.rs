//! The stage as scenes and commands see it.

use ivd_core::op::{Failure, Method, Op, Place, Stage, Want, method};
use ivd_core::{Exec, Labels, Mask, ParamError, Volume, slots};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::params::check_together;
use crate::{ComponentParams, component};

/// The stage: its methods, and where it stands in a scene.
pub const STAGE: Stage = Stage {
    name: "boundary",
    about: "Isolates one part.",
    selector: "method",
    methods: METHODS,
    positional: &["volume"],
    places: &[Place {
        for_readers: true,
        unread: "the isovalue is given and no part is isolated",
        ..Place::only("mask")
    }],
    quiet: false,
};
const METHODS: &[Method] = &[method::<ComponentParams>("component")];

slots! {
    /// What a part is found in: by its classes, unless a value is given.
    pub struct Inputs<'a> { volume: &'a Volume, labels: Option<&'a Labels> }
}

/// What an isolated part comes to.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct BoundaryFigures {
    /// Voxels of the part.
    #[schemars(extend("x-unit" = "voxels", "x-headline" = 1))]
    pub voxels: u64,
    /// Iterations; 0 of a method that has none.
    #[schemars(extend("x-unit" = "1"))]
    pub iterations: u32,
    /// Energy at the start, of a method that lowers one.
    #[schemars(extend("x-unit" = "1"))]
    pub energy_first: Option<f64>,
    /// Energy at the end.
    #[schemars(extend("x-unit" = "1"))]
    pub energy_last: Option<f64>,
    /// Share of the voxels that the part has.
    #[schemars(extend("x-unit" = "1"))]
    pub active_fraction: f64,
    /// The class it was taken from, where no value was given instead.
    #[schemars(extend("x-unit" = "1"))]
    pub class: Option<u16>,
    /// Connected pieces of the class; the part is one of them.
    #[schemars(extend("x-unit" = "1"))]
    pub components: usize,
    /// Voxels that weren't of the class and were enclosed.
    #[schemars(extend("x-unit" = "voxels"))]
    pub filled: u64,
    /// Where the class begins, unless it is open below.
    #[schemars(extend("x-unit" = "value"))]
    pub lower: Option<f64>,
    /// Where the class ends, unless it is open above.
    #[schemars(extend("x-unit" = "value"))]
    pub upper: Option<f64>,
}

impl Op for ComponentParams {
    const REVISION: u32 = 1;
    type Inputs<'a> = Inputs<'a>;
    type Output = Mask;
    type Figures = BoundaryFigures;

    fn check_together(&self) -> Result<(), ParamError> {
        check_together(self)
    }

    fn wants(&self, _: &str) -> Want {
        if self.above.is_some() { Want::No } else { Want::Yes }
    }

    fn run(&self, inputs: Inputs<'_>, exec: &Exec) -> Result<(Mask, BoundaryFigures), Failure> {
        let Inputs { volume, labels } = inputs;
        let part = component(volume, labels, self, exec)?;
        let figures = BoundaryFigures {
            voxels: part.voxels,
            iterations: 0,
            energy_first: None,
            energy_last: None,
            active_fraction: part.voxels as f64 / volume.grid().len() as f64,
            class: part.class,
            components: part.components,
            filled: part.filled,
            lower: part.lower,
            upper: part.upper,
        };
        Ok((part.mask, figures))
    }
}
