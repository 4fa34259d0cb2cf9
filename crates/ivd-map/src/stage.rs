//! The stage as scenes and commands see it.

use ivd_core::op::{Amount, Failure, Memory, Method, Op, Place, Remark, Stage, Want, method};
use ivd_core::{Displacement, Exec, Labels, Lattice, Motion, Octree, ParamError, slots};
use ivd_field::param::is_cell;

use super::{
    BiharmonicParams, BodyParams, FemParams, MapFigures, OctreeParams, biharmonic, body, fem, octree,
};

/// The stage: its methods, and where it stands in a scene.
pub const STAGE: Stage = Stage {
    name: "map",
    about: "Carries a lattice's motion to the voxels.",
    selector: "method",
    methods: METHODS,
    positional: &["lattice", "octree", "motion"],
    places: &[Place { amount: Amount::VoxelsInReach, ..Place::only("displacement") }],
    quiet: false,
    memory: Memory { voxel: 0, reached: 15, triangle: 100 },
};
const METHODS: &[Method] = &[
    method::<OctreeParams>("octree"),
    method::<BiharmonicParams>("biharmonic"),
    method::<FemParams>("fem"),
    method::<BodyParams>("body"),
];

slots! {
    /// What is read where nearest lattice points are looked for.
    pub struct Indexed<'a> { lattice: &'a Lattice, octree: &'a Octree, motion: &'a Motion }
}
slots! {
    /// What is read where they aren't.
    pub struct Moving<'a> { lattice: &'a Lattice, motion: &'a Motion }
}
slots! {
    /// What is read where classes may have an elasticity of their own.
    pub struct Labelled<'a> { lattice: &'a Lattice, motion: &'a Motion, labels: Option<&'a Labels> }
}

/// The frame that is mapped: the one asked for, else a motion's last.
fn chosen(frame: Option<u32>, motion: &Motion) -> usize {
    frame.map_or_else(|| motion.frames().len().saturating_sub(1), |frame| frame as usize)
}

/// Raised for all methods together: what they share is most of them.
const REVISION: u32 = 16;

/// What is taken for each voxel that is reached, with cells of 1, 2 and 4 voxels.
fn by_cell(cell: Option<u8>, bytes: [u64; 3]) -> u64 {
    match cell {
        Some(1) => bytes[0],
        Some(2) => bytes[1],
        _ => bytes[2],
    }
}

impl Op for OctreeParams {
    const REVISION: u32 = REVISION;
    const REMARK: Option<Remark<MapFigures>> = Some(MapFigures::remark);
    type Inputs<'a> = Indexed<'a>;
    type Gives = (Displacement, MapFigures);

    fn run(&self, inputs: Indexed<'_>, exec: &Exec) -> Result<Self::Gives, Failure> {
        let Indexed { lattice, octree: tree, motion } = inputs;
        Ok(octree(lattice, tree, motion, chosen(self.frame, motion), self, exec)?.into())
    }
}

impl Op for BiharmonicParams {
    const REVISION: u32 = REVISION;
    const REMARK: Option<Remark<MapFigures>> = Some(MapFigures::remark);
    type Inputs<'a> = Moving<'a>;
    type Gives = (Displacement, MapFigures);

    fn memory(&self) -> Option<Memory> {
        Some(Memory { voxel: 0, reached: by_cell(self.cell, [800, 120, 50]), triangle: 300 })
    }

    fn check_together(&self) -> Result<(), ParamError> {
        is_cell("cell", self.cell)
    }

    fn run(&self, inputs: Moving<'_>, exec: &Exec) -> Result<Self::Gives, Failure> {
        let Moving { lattice, motion } = inputs;
        Ok(biharmonic(lattice, motion, chosen(self.frame, motion), self, exec)?.into())
    }
}

impl Op for BodyParams {
    const REVISION: u32 = REVISION;
    const REMARK: Option<Remark<MapFigures>> = Some(MapFigures::remark);
    type Inputs<'a> = Moving<'a>;
    type Gives = (Displacement, MapFigures);

    fn memory(&self) -> Option<Memory> {
        Some(Memory { voxel: 0, reached: 12, triangle: 60 })
    }

    fn run(&self, inputs: Moving<'_>, exec: &Exec) -> Result<Self::Gives, Failure> {
        let Moving { lattice, motion } = inputs;
        Ok(body(lattice, motion, chosen(self.frame, motion), self, exec)?.into())
    }
}

impl Op for FemParams {
    const REVISION: u32 = REVISION;
    const REMARK: Option<Remark<MapFigures>> = Some(MapFigures::remark);
    type Inputs<'a> = Labelled<'a>;
    type Gives = (Displacement, MapFigures);

    fn memory(&self) -> Option<Memory> {
        Some(Memory { voxel: 0, reached: by_cell(self.cell, [240, 65, 55]), triangle: 60 })
    }

    fn check_together(&self) -> Result<(), ParamError> {
        is_cell("cell", self.cell)
    }

    fn wants(&self, _: &str) -> Want {
        if self.material.is_empty() { Want::No } else { Want::Yes }
    }

    fn run(&self, inputs: Labelled<'_>, exec: &Exec) -> Result<Self::Gives, Failure> {
        let Labelled { lattice, motion, labels } = inputs;
        Ok(fem(lattice, labels, motion, chosen(self.frame, motion), self, exec)?.into())
    }
}
