//! The stage as scenes and commands see it.

use ivd_core::op::{Failure, Memory, Method, Op, Place, Stage, Voxelwise, Want, method};
use ivd_core::{Displacement, Exec, Labels, ParamError, slots};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::{SpaceFigures, Start, Step, displace};

/// The stage as scenes and commands see it.
pub const STAGE: Stage = Stage {
    name: "space",
    about: "Displaces voxels without a lattice, or goes on from a displacement: deflectors, spatial transfer functions, chain mail, a cut.",
    selector: "",
    methods: METHODS,
    positional: &["volume"],
    places: &[Place { from: &[("after", "displacement")], ..Place::only("displacement") }],
    quiet: true,
    memory: Memory { voxel: 25, reached: 0, triangle: 0 },
};
const METHODS: &[Method] = &[method::<SpaceParams>("")];

slots! {
    /// What is displaced, what has been displaced before, and classes for chain mail that knows some.
    pub struct Inputs<'a> { volume: Voxelwise<'a>, after: Option<&'a Displacement>, labels: Option<&'a Labels> }
}

/// What happens to the voxels without a lattice.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(default)]
pub struct SpaceParams {
    /// Changes of space, each after the map of the lattice and the steps before it.
    pub step: Vec<Step>,
}

impl Op for SpaceParams {
    const REVISION: u32 = 2;
    type Inputs<'a> = Inputs<'a>;
    type Gives = (Displacement, SpaceFigures);

    fn check_together(&self) -> Result<(), ParamError> {
        let wrong = |i: usize, problem: ParamError| problem.under(&i.to_string()).under("step");
        self.step.iter().enumerate().try_for_each(|(i, step)| step.check_together().map_err(|e| wrong(i, e)))
    }

    fn wants(&self, slot: &str) -> Want {
        let knows_classes =
            || self.step.iter().any(|step| matches!(step, Step::Chain(mail) if !mail.material.is_empty()));
        match slot {
            "after" => Want::Yes,
            "labels" if !knows_classes() => Want::No,
            _ => Want::Yes,
        }
    }

    fn idle(&self) -> Option<&'static str> {
        self.step.is_empty().then_some("the scene has no step in space")
    }

    fn run(&self, inputs: Inputs<'_>, exec: &Exec) -> Result<Self::Gives, Failure> {
        let Inputs { volume, after, labels } = inputs;
        let made = displace(volume.grid(), &self.step, &Start { after, labels }, exec)?;
        Ok((made.displacement, made.figures))
    }
}
