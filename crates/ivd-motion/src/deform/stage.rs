//! The stage as scenes and commands see it.

use ivd_core::op::{Amount, Failure, Memory, Method, Op, Place, Remark, Stage, Want, method};
use ivd_core::{Artefact, Exec, Labels, Lattice, Motion, ParamError, slots};

use super::{
    Body, Bone, DynamicsMethod, ElasticMethod, Figures, Moves, ProjectiveMethod, RingMethod, XpbdMethod,
};
use crate::elastic::ElasticInputs;
use crate::{elastic, freeform, mass_spring, ring};

/// The stage: its methods, and where it stands in a scene.
pub const STAGE: Stage = Stage {
    name: "deform",
    about: "Moves a lattice.",
    selector: "solver",
    methods: METHODS,
    positional: &["lattice"],
    places: &[Place { amount: Amount::VerticesInReach, ..Place::only("motion") }],
    quiet: false,
    memory: Memory { voxel: 0, reached: 0, triangle: 250 },
};
const METHODS: &[Method] = &[
    method::<RingMethod>("ring"),
    method::<DynamicsMethod>("dynamics"),
    method::<ProjectiveMethod>("projective"),
    method::<XpbdMethod>("xpbd"),
    method::<ElasticMethod>("body"),
];

slots! {
    /// What is read where matter is the same everywhere.
    pub struct RingInputs<'a> { lattice: &'a Lattice }
}
slots! {
    /// What is read where classes may have a material, or bones, of their own.
    pub struct Inputs<'a> { lattice: &'a Lattice, labels: Option<&'a Labels> }
}

/// Raised for all methods together: shapes go on from what any of them gives.
const REVISION: u32 = 10;

/// Why there is nothing to do.
const STILL: &str = "the scene has no handle, no bone and no shape";

/// Takes a solver's motion, or the lattice at rest, through the shapes.
fn shaped(
    lattice: &Lattice,
    solved: Option<(Motion, Figures)>,
    moves: &Moves,
    exec: &Exec,
) -> Result<(Motion, Figures), Failure> {
    let (motion, figures) = match solved {
        Some(solved) if moves.shape.is_empty() => solved,
        solved => {
            let (motion, figures) = solved.unzip();
            let shaped = freeform::lattice(lattice, motion.as_ref(), &moves.shape, exec)?;
            let figures = figures.unwrap_or_default().after(&shaped);
            (shaped.motion, figures)
        }
    };
    Ok((motion, figures.with_picks(lattice, moves)?))
}

/// What is worth saying of any method's figures.
const REMARK: Option<Remark<Figures>> = Some(Figures::remark);

impl Op for RingMethod {
    const REVISION: u32 = REVISION;
    const REMARK: Option<Remark<Figures>> = REMARK;
    type Inputs<'a> = RingInputs<'a>;
    type Gives = (Motion, Figures);

    fn memory(&self) -> Option<Memory> {
        // A box round what a handle reaches, which may be the whole volume, as all triangles may be.
        Some(Memory { voxel: 3, reached: 0, triangle: 250 })
    }

    fn check_together(&self) -> Result<(), ParamError> {
        self.moves.check_together()
    }

    fn look_ahead(&self, slot: &str, value: &Artefact) -> Result<(), Failure> {
        self.moves.look_ahead(slot, value)
    }

    fn idle(&self) -> Option<&'static str> {
        (self.moves.handle.is_empty() && self.moves.shape.is_empty()).then_some(STILL)
    }

    fn run(&self, inputs: RingInputs<'_>, exec: &Exec) -> Result<Self::Gives, Failure> {
        let (lattice, handles) = (inputs.lattice, self.moves.handles()?);
        let only_shapes = handles.is_empty() && !self.moves.shape.is_empty();
        let solved = if only_shapes {
            None
        } else {
            let solved = ring::solve(lattice, &handles, &self.moves.fixed(), &self.ring, exec)?;
            let figures = Figures::from(&solved);
            Some((solved.motion, figures))
        };
        shaped(lattice, solved, &self.moves, exec)
    }
}

/// Why there is nothing to do, where there isn't.
fn idle(moves: &Moves, bones: &[Bone]) -> Option<&'static str> {
    (moves.handle.is_empty() && bones.is_empty() && moves.shape.is_empty()).then_some(STILL)
}

impl Body {
    fn idle(&self) -> Option<&'static str> {
        idle(&self.moves, &self.rigid)
    }

    fn wants(&self, slot: &str) -> Want {
        if slot == "labels" && !self.knows_classes() { Want::No } else { Want::Yes }
    }

    fn run(
        &self,
        params: &mass_spring::Params,
        inputs: Inputs<'_>,
        exec: &Exec,
    ) -> Result<(Motion, Figures), Failure> {
        let (lattice, handles, bones) = (inputs.lattice, self.moves.handles()?, self.bones()?);
        if handles.is_empty() && bones.is_empty() && !self.moves.shape.is_empty() {
            return shaped(lattice, None, &self.moves, exec);
        }
        let labels = inputs.labels.filter(|_| self.knows_classes());
        if labels.is_none() && self.knows_classes() {
            return Err(Failure::usage(
                "material, rigid: there are no labels to know classes by; give --labels",
            ));
        }
        let fixed = self.moves.fixed();
        let solved = mass_spring::with_bones(lattice, labels, &handles, &fixed, &bones, params, exec)?;
        let figures = Figures::from(&solved);
        shaped(lattice, Some((solved.motion, figures)), &self.moves, exec)
    }
}

impl Op for ElasticMethod {
    const REVISION: u32 = REVISION;
    const REMARK: Option<Remark<Figures>> = REMARK;
    type Inputs<'a> = ElasticInputs<'a>;
    type Gives = (Motion, Figures);

    fn memory(&self) -> Option<Memory> {
        Some(Memory { voxel: 14, reached: 0, triangle: 60 })
    }

    fn check_together(&self) -> Result<(), ParamError> {
        self.elastic.check()?;
        self.moves.check_together()?;
        self.bones().map(|_| ())
    }

    fn wants(&self, slot: &str) -> Want {
        match slot {
            "labels" if !self.knows_classes() => Want::No,
            "volume" if !self.elastic.hounsfield => Want::No,
            _ => Want::Yes,
        }
    }

    fn look_ahead(&self, slot: &str, value: &Artefact) -> Result<(), Failure> {
        self.moves.look_ahead(slot, value)
    }

    fn idle(&self) -> Option<&'static str> {
        idle(&self.moves, &self.rigid)
    }

    fn run(&self, inputs: ElasticInputs<'_>, exec: &Exec) -> Result<Self::Gives, Failure> {
        let (lattice, handles, bones) = (inputs.lattice, self.moves.handles()?, self.bones()?);
        if handles.is_empty() && bones.is_empty() && !self.moves.shape.is_empty() {
            return shaped(lattice, None, &self.moves, exec);
        }
        let fixed = self.moves.fixed();
        let solved = elastic::solve(inputs, &handles, &fixed, &bones, &self.elastic, exec)?;
        let figures = Figures::from(&solved);
        shaped(lattice, Some((solved.motion, figures)), &self.moves, exec)
    }
}

/// What the methods of masses on springs have in common.
macro_rules! on_springs {
    ($($method:ty: $memory:expr),* $(,)?) => {$(
        impl Op for $method {
            const REVISION: u32 = REVISION;
            const REMARK: Option<Remark<Figures>> = REMARK;
            type Inputs<'a> = Inputs<'a>;
            type Gives = (Motion, Figures);

            fn memory(&self) -> Option<Memory> {
                $memory
            }

            fn check_together(&self) -> Result<(), ParamError> {
                self.body.check_together()
            }

            fn wants(&self, slot: &str) -> Want {
                self.body.wants(slot)
            }

            fn look_ahead(&self, slot: &str, value: &Artefact) -> Result<(), Failure> {
                self.body.moves.look_ahead(slot, value)
            }

            fn idle(&self) -> Option<&'static str> {
                self.body.idle()
            }

            fn run(&self, inputs: Inputs<'_>, exec: &Exec) -> Result<Self::Gives, Failure> {
                self.body.run(&self.params(), inputs, exec)
            }
        }
    )*};
}
on_springs!(
    DynamicsMethod: None,
    // Its system is factored.
    ProjectiveMethod: Some(Memory { voxel: 0, reached: 0, triangle: 900 }),
    XpbdMethod: None,
);
