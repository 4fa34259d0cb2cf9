//! The stage as scenes and commands see it.

use ivd_core::op::{Failure, Method, Op, Place, Stage, Voxelwise, Want, method};
use ivd_core::{Displacement, Exec, Labels, ParamError, slots};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::{Start, Step, displace};
use crate::certificate::Histogram;

/// The stage as scenes and commands see it.
pub const STAGE: Stage = Stage {
    name: "space",
    about: "Displaces voxels without a lattice, or goes on from a displacement: deflectors, spatial transfer functions, chain mail, a cut.",
    selector: "",
    methods: METHODS,
    positional: &["volume"],
    places: &[Place { from: &[("after", "displacement")], ..Place::only("displacement") }],
    quiet: true,
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

/// What steps in space come to.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct SpaceFigures {
    /// Voxels that move.
    #[schemars(extend("x-unit" = "voxels", "x-headline" = 1))]
    pub voxels_moved: u64,
    /// Bricks (8³ voxels) with a voxel that moves.
    #[schemars(extend("x-unit" = "1"))]
    pub bricks_touched: u64,
    /// Bricks of the grid.
    #[schemars(extend("x-unit" = "1"))]
    pub bricks_total: u64,
    /// Smallest proven lower bound of det ∇φ, at most 1; of a cut's sides the smaller.
    #[schemars(extend("x-unit" = "1"))]
    pub min_det_j: f64,
    /// Cells that fold: 0, or there would be no displacement.
    #[schemars(extend("x-unit" = "1"))]
    pub folds: u64,
    /// Equal parts that shapes were done in; 1 where they are done at once.
    #[schemars(extend("x-unit" = "1"))]
    pub parts: u32,
    /// What a step's centre is short of, for being done in parts; the largest of all steps.
    #[schemars(extend("x-unit" = "mm"))]
    pub short_mm: f64,
    /// Largest `|φ(ψ(y)) − y|`.
    #[schemars(extend("x-unit" = "voxels"))]
    pub inverse_residual_max_voxel: f64,
    /// Whether a cut makes it a field of two sides.
    pub two_sided: bool,
    /// Voxels where a cut has opened, or to which something came from beyond the grid that counts for nothing.
    #[schemars(extend("x-unit" = "voxels"))]
    pub voxels_vacated: u64,
    /// Lengths of the voxels' motion (mm), 0 … the largest.
    pub motion_mm_histogram: Histogram,
    /// det ∇φ at the centres of the cells that move, 0 … 2; of a cut's sides the one above.
    pub det_j_histogram: Histogram,
}

impl Op for SpaceParams {
    const REVISION: u32 = 2;
    type Inputs<'a> = Inputs<'a>;
    type Output = Displacement;
    type Figures = SpaceFigures;

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

    fn run(&self, inputs: Inputs<'_>, exec: &Exec) -> Result<(Displacement, SpaceFigures), Failure> {
        let Inputs { volume, after, labels } = inputs;
        let made = displace(volume.grid(), &self.step, &Start { after, labels }, exec)?;
        let figures = SpaceFigures {
            voxels_moved: made.voxels_moved,
            bricks_touched: made.bricks_touched,
            bricks_total: made.bricks_total,
            min_det_j: made.min_det_j,
            folds: made.folds,
            parts: made.parts,
            short_mm: made.short_mm,
            inverse_residual_max_voxel: made.inverse_residual_max_voxel,
            two_sided: made.displacement.is_two_sided(),
            voxels_vacated: made.voxels_vacated,
            motion_mm_histogram: made.motion_mm,
            det_j_histogram: made.det_j,
        };
        Ok((made.displacement, figures))
    }
}
