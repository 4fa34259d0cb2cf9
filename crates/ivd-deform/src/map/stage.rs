//! The stage as scenes and commands see it.

use ivd_core::op::{Amount, Failure, Method, Op, Place, Stage, Want, method};
use ivd_core::{Displacement, Exec, Labels, Lattice, Motion, Octree, ParamError, slots};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::params::check_cell;
use super::{BiharmonicParams, FemParams, Followed, Mapped, OctreeParams, Solved, biharmonic, fem, octree};
use crate::certificate::Histogram;

/// The stage: its methods, and where it stands in a scene.
pub const STAGE: Stage = Stage {
    name: "map",
    about: "Carries a lattice's motion to the voxels.",
    selector: "method",
    methods: METHODS,
    positional: &["lattice", "octree", "motion"],
    places: &[Place { amount: Amount::VoxelsInReach, ..Place::only("displacement") }],
    quiet: false,
};
const METHODS: &[Method] =
    &[method::<OctreeParams>("octree"), method::<BiharmonicParams>("biharmonic"), method::<FemParams>("fem")];

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

/// What a map comes to.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct MapFigures {
    /// Voxels that move.
    #[schemars(extend("x-unit" = "voxels", "x-headline" = 1))]
    pub voxels_moved: u64,
    /// Bricks (8³ voxels) with a voxel that moves.
    #[schemars(extend("x-unit" = "1"))]
    pub bricks_touched: u64,
    /// Bricks of the grid.
    #[schemars(extend("x-unit" = "1"))]
    pub bricks_total: u64,
    /// Smallest proven lower bound of det ∇φ, at most 1.
    #[schemars(extend("x-unit" = "1"))]
    pub min_det_j: f64,
    /// Cells that fold: 0, or there would be no map.
    #[schemars(extend("x-unit" = "1"))]
    pub folds: u64,
    /// Rounds of local relaxation that were needed.
    #[schemars(extend("x-unit" = "1"))]
    pub relaxations: u32,
    /// `k` where the map is a flow in 2ᵏ steps; 0 for the field as carried.
    #[schemars(extend("x-unit" = "1"))]
    pub halvings: u32,
    /// How its equations were solved, where the method has some.
    pub solved: Option<Solved>,
    /// Largest `|φ(ψ(y)) − y|`.
    #[schemars(extend("x-unit" = "voxels"))]
    pub inverse_residual_max_voxel: f64,
    /// Voxels that a part moving alone left behind.
    #[schemars(extend("x-unit" = "voxels"))]
    pub voxels_vacated: u64,
    /// How well the map follows the lattice.
    pub followed: Followed,
    /// Lengths of the voxels' motion (mm), 0 … the largest.
    pub motion_mm_histogram: Histogram,
    /// det ∇φ at the centres of the cells that move, 0 … 2.
    pub det_j_histogram: Histogram,
}

/// The displacement and the figures of a map.
fn told(mapped: Mapped) -> (Displacement, MapFigures) {
    let figures = MapFigures {
        voxels_moved: mapped.voxels_moved,
        bricks_touched: mapped.bricks_touched,
        bricks_total: mapped.bricks_total,
        min_det_j: mapped.min_det_j,
        folds: mapped.folds,
        relaxations: mapped.relaxations,
        halvings: mapped.halvings,
        solved: mapped.solved,
        inverse_residual_max_voxel: mapped.inverse_residual_max_voxel,
        voxels_vacated: mapped.voxels_vacated,
        followed: mapped.followed,
        motion_mm_histogram: mapped.motion_mm,
        det_j_histogram: mapped.det_j,
    };
    (mapped.displacement, figures)
}

/// The frame that is mapped: a motion's last.
fn last(motion: &Motion) -> usize {
    motion.frames().len().saturating_sub(1)
}

/// Raised for all methods together: what they share is most of them.
const REVISION: u32 = 6;

impl Op for OctreeParams {
    const REVISION: u32 = REVISION;
    type Inputs<'a> = Indexed<'a>;
    type Output = Displacement;
    type Figures = MapFigures;

    fn run(&self, inputs: Indexed<'_>, exec: &Exec) -> Result<(Displacement, MapFigures), Failure> {
        let Indexed { lattice, octree: tree, motion } = inputs;
        Ok(told(octree(lattice, tree, motion, last(motion), self, exec)?))
    }
}

impl Op for BiharmonicParams {
    const REVISION: u32 = REVISION;
    type Inputs<'a> = Moving<'a>;
    type Output = Displacement;
    type Figures = MapFigures;

    fn check_together(&self) -> Result<(), ParamError> {
        check_cell(self.cell)
    }

    fn run(&self, inputs: Moving<'_>, exec: &Exec) -> Result<(Displacement, MapFigures), Failure> {
        let Moving { lattice, motion } = inputs;
        Ok(told(biharmonic(lattice, motion, last(motion), self, exec)?))
    }
}

impl Op for FemParams {
    const REVISION: u32 = REVISION;
    type Inputs<'a> = Labelled<'a>;
    type Output = Displacement;
    type Figures = MapFigures;

    fn check_together(&self) -> Result<(), ParamError> {
        check_cell(self.cell)
    }

    fn wants(&self, _: &str) -> Want {
        if self.material.is_empty() { Want::No } else { Want::Yes }
    }

    fn run(&self, inputs: Labelled<'_>, exec: &Exec) -> Result<(Displacement, MapFigures), Failure> {
        let Labelled { lattice, motion, labels } = inputs;
        Ok(told(fem(lattice, labels, motion, last(motion), self, exec)?))
    }
}
