//! Methods that the stage doesn't list yet: what they take and what they come to.

use ivd_core::op::{Failure, Op, Want};
use ivd_core::{Exec, Labels, Mask, ParamError, Volume, slots};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::{
    CompeteParams, ContourParams, EditParams, SurfaceParams, active_contour, active_surface, edit,
    part_of_strokes,
};

/// What a part comes to that a surface, strokes, a contour or an edit gives.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize, JsonSchema)]
pub struct PartFigures {
    /// Voxels of the part.
    #[schemars(extend("x-unit" = "voxels", "x-headline" = 1))]
    pub voxels: u64,
    /// Iterations; 0 of a method that has none.
    #[schemars(extend("x-unit" = "1"))]
    pub iterations: u32,
    /// Energy at the start, of a method that lowers one.
    #[schemars(extend("x-unit" = "1"))]
    pub energy_first: Option<f64>,
    /// Energies that were accepted, of a method that lowers one: each lower than the one before.
    #[schemars(extend("x-unit" = "1"))]
    pub energies: Vec<f64>,
    /// Energy at the end.
    #[schemars(extend("x-unit" = "1"))]
    pub energy_last: Option<f64>,
    /// Share of the voxels that the part has.
    #[schemars(extend("x-unit" = "1"))]
    pub active_fraction: f64,
    /// The class it was taken from, where no value was given instead.
    #[schemars(extend("x-unit" = "1"))]
    pub class: Option<u16>,
    /// How far the energy of a surface's set can be above the lowest for its statistics, over μ times its area; of cuts, and with certify.
    #[schemars(extend("x-unit" = "1"))]
    pub gap: Option<f64>,
    /// The same of shares of voxels, which are lower than any set; with certify where the area is smooth.
    #[schemars(extend("x-unit" = "1"))]
    pub relaxed_gap: Option<f64>,
    /// Weight of a surface's area.
    #[schemars(extend("x-unit" = "value² mm"))]
    pub mu: Option<f64>,
    /// Mean values inside and outside of a surface.
    #[schemars(extend("x-unit" = "value"))]
    pub means: Option<[f64; 2]>,
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

slots! {
    /// What a surface moves in, and what it starts from where that is drawn.
    pub struct SurfaceInputs<'a> { volume: &'a Volume, labels: Option<&'a Labels>, start: Option<&'a Mask> }
}

impl Op for SurfaceParams {
    const REVISION: u32 = 1;
    type Inputs<'a> = SurfaceInputs<'a>;
    type Output = Mask;
    type Figures = PartFigures;

    fn check_together(&self) -> Result<(), ParamError> {
        Self::check_together(self)
    }

    fn wants(&self, slot: &str) -> Want {
        if slot == "labels" && self.class.is_none() { Want::No } else { Want::Yes }
    }

    fn run(&self, inputs: SurfaceInputs<'_>, exec: &Exec) -> Result<(Mask, PartFigures), Failure> {
        let SurfaceInputs { volume, labels, start } = inputs;
        let found = active_surface(volume, labels, start, self, exec)?;
        let figures = PartFigures {
            voxels: found.voxels,
            iterations: found.sweeps,
            energy_first: found.energies.first().copied(),
            energy_last: found.energies.last().copied(),
            energies: found.energies,
            active_fraction: found.active_fraction,
            gap: found.gap,
            relaxed_gap: found.relaxed_gap,
            mu: Some(found.mu),
            means: Some(found.means),
            components: found.components,
            filled: found.filled,
            ..PartFigures::default()
        };
        Ok((found.mask, figures))
    }
}

slots! {
    /// What strokes compete for, those that are drawn, a mask in the part, and what nobody gets.
    pub struct StrokeInputs<'a> {
        volume: &'a Volume, strokes: Option<&'a Labels>, start: Option<&'a Mask>, blocked: Option<&'a Mask>
    }
}

impl Op for CompeteParams {
    const REVISION: u32 = 1;
    type Inputs<'a> = StrokeInputs<'a>;
    type Output = Mask;
    type Figures = PartFigures;

    fn check_together(&self) -> Result<(), ParamError> {
        Self::check_together(self)
    }

    fn run(&self, inputs: StrokeInputs<'_>, exec: &Exec) -> Result<(Mask, PartFigures), Failure> {
        let StrokeInputs { volume, strokes, start, blocked } = inputs;
        let won = part_of_strokes(volume, strokes, start, blocked, self, exec)?;
        let share = won.voxels as f64 / volume.grid().len() as f64;
        let figures = PartFigures {
            voxels: won.voxels,
            active_fraction: share,
            components: won.components,
            filled: won.filled,
            ..PartFigures::default()
        };
        Ok((won.mask, figures))
    }
}

slots! {
    /// What a slice is taken of.
    pub struct ContourInputs<'a> { volume: &'a Volume }
}

impl Op for ContourParams {
    const REVISION: u32 = 1;
    type Inputs<'a> = ContourInputs<'a>;
    type Output = Mask;
    type Figures = PartFigures;

    fn check_together(&self) -> Result<(), ParamError> {
        Self::check_together(self)
    }

    fn run(&self, inputs: ContourInputs<'_>, exec: &Exec) -> Result<(Mask, PartFigures), Failure> {
        let found = active_contour(inputs.volume, self, exec)?;
        let figures = PartFigures {
            voxels: found.voxels,
            iterations: found.iterations,
            energy_first: found.energies.first().copied(),
            energy_last: found.energies.last().copied(),
            energies: found.energies,
            active_fraction: found.voxels as f64 / inputs.volume.grid().len() as f64,
            components: 1,
            ..PartFigures::default()
        };
        Ok((found.mask, figures))
    }
}

slots! {
    /// What parts are of, the part, and a second one.
    pub struct EditInputs<'a> { volume: &'a Volume, part: &'a Mask, other: Option<&'a Mask> }
}

impl Op for EditParams {
    const REVISION: u32 = 1;
    type Inputs<'a> = EditInputs<'a>;
    type Output = Mask;
    type Figures = PartFigures;

    fn run(&self, inputs: EditInputs<'_>, exec: &Exec) -> Result<(Mask, PartFigures), Failure> {
        let EditInputs { volume, part, other } = inputs;
        let edited = edit(volume, part, other, self, exec)?;
        let figures = PartFigures {
            voxels: edited.voxels,
            active_fraction: edited.voxels as f64 / volume.grid().len() as f64,
            components: edited.components,
            filled: edited.filled,
            ..PartFigures::default()
        };
        Ok((edited.mask, figures))
    }
}
