//! The stage as scenes and commands see it.

use ivd_core::op::{Failure, Memory, Method, Op, Place, Remark, Stage, Want, method};
use ivd_core::{Artefact, Exec, Kind, Labels, Mask, ParamError, Value as _, Volume, counted, slots};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::params::check_together;
use crate::{
    CompeteParams, ComponentParams, ContourParams, EditInputs, EditParams, SeedInputs, SurfaceParams,
    active_contour, active_surface, compete, component, edit, part_of_seeds,
};

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
    memory: Memory { voxel: 24, reached: 0, triangle: 0 },
};
const METHODS: &[Method] = &[
    method::<ComponentParams>("component"),
    method::<SurfaceParams>("surface"),
    method::<CompeteParams>("compete").with("seeds"),
    method::<ContourParams>("contour"),
    method::<EditParams>("edit"),
];

slots! {
    /// What a part is found in: by its classes, unless a value is given.
    pub struct Inputs<'a> { volume: &'a Volume, labels: Option<&'a Labels> }
}

/// What an isolated part comes to.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize, JsonSchema)]
pub struct BoundaryFigures {
    /// Voxels of the part.
    #[schemars(extend("x-unit" = "voxels", "x-headline" = 1))]
    pub voxels: u64,
    /// Iterations; 0 of a method that has none.
    #[schemars(extend("x-unit" = "1"))]
    pub iterations: u32,
    /// The first of the energies: of a surface that at which its finest resolution begins, of a curve that of the circle.
    #[schemars(extend("x-unit" = "1"))]
    pub energy_first: Option<f64>,
    /// Energies that were accepted, of a method that lowers one: each lower than the one before. Of a surface, at its finest resolution.
    #[schemars(extend("x-unit" = "1"))]
    pub energies: Vec<f64>,
    /// The last of the energies.
    #[schemars(extend("x-unit" = "1"))]
    pub energy_last: Option<f64>,
    /// Of a surface, share of the voxels of its finest resolution that were worked on (in bricks of 8³). Of other methods, share of the
    /// voxels that the part has, or that have a label.
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
    /// Connected pieces of the class; the part is one of them. Of seeds of several labels, labels.
    #[schemars(extend("x-unit" = "1"))]
    pub components: usize,
    /// Voxels that weren't of the piece and were enclosed.
    #[schemars(extend("x-unit" = "voxels"))]
    pub filled: u64,
    /// Voxels of the largest piece, where one that encloses it was taken.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schemars(extend("x-unit" = "voxels"))]
    pub encloses: Option<u64>,
    /// Where the class begins, unless it is open below.
    #[schemars(extend("x-unit" = "value"))]
    pub lower: Option<f64>,
    /// Where the class ends, unless it is open above.
    #[schemars(extend("x-unit" = "value"))]
    pub upper: Option<f64>,
}

impl BoundaryFigures {
    /// Those of any part.
    pub(crate) fn of(voxels: u64, components: usize, filled: u64, volume: &Volume) -> Self {
        let active_fraction = voxels as f64 / volume.grid().len() as f64;
        Self { voxels, active_fraction, components, filled, ..Self::default() }
    }

    /// What to know of a part, where there is something.
    fn remark(&self) -> Option<String> {
        let within = counted(self.encloses?, "voxel", "voxels");
        Some(format!(
            "the part encloses the largest piece, of {within}, and has it as a hole that is filled; a seed in that piece takes it alone"
        ))
    }

    /// With those of a method that lowers an energy.
    fn with_energies(self, energies: Vec<f64>) -> Self {
        Self {
            energy_first: energies.first().copied(),
            energy_last: energies.last().copied(),
            energies,
            ..self
        }
    }
}

impl Op for ComponentParams {
    const REVISION: u32 = 3;
    type Inputs<'a> = Inputs<'a>;
    type Gives = (Mask, BoundaryFigures);

    const REMARK: Option<Remark<BoundaryFigures>> = Some(BoundaryFigures::remark);

    fn check_together(&self) -> Result<(), ParamError> {
        check_together(self)
    }

    fn wants(&self, _: &str) -> Want {
        if self.above.is_some() { Want::No } else { Want::Yes }
    }

    fn run(&self, inputs: Inputs<'_>, exec: &Exec) -> Result<Self::Gives, Failure> {
        let Inputs { volume, labels } = inputs;
        let part = component(volume, labels, self, exec)?;
        let figures = BoundaryFigures {
            class: part.class,
            lower: part.lower,
            upper: part.upper,
            encloses: part.encloses,
            ..BoundaryFigures::of(part.voxels, part.components, part.filled, volume)
        };
        Ok((part.mask, figures))
    }
}

slots! {
    /// What a surface moves in, and what it starts from where that is drawn.
    pub struct SurfaceInputs<'a> { volume: &'a Volume, labels: Option<&'a Labels>, start: Option<&'a Mask> }
}

impl Op for SurfaceParams {
    const REVISION: u32 = 2;
    type Inputs<'a> = SurfaceInputs<'a>;
    type Gives = (Mask, BoundaryFigures);

    fn check_together(&self) -> Result<(), ParamError> {
        Self::check_together(self)
    }

    fn wants(&self, slot: &str) -> Want {
        if slot == "labels" && self.class.is_none() { Want::No } else { Want::Yes }
    }

    fn run(&self, inputs: SurfaceInputs<'_>, exec: &Exec) -> Result<Self::Gives, Failure> {
        let SurfaceInputs { volume, labels, start } = inputs;
        let found = active_surface(volume, labels, start, self, exec)?;
        let figures = BoundaryFigures {
            iterations: found.sweeps,
            active_fraction: found.active_fraction,
            gap: found.gap,
            relaxed_gap: found.relaxed_gap,
            mu: Some(found.mu),
            means: Some(found.means),
            ..BoundaryFigures::of(found.voxels, found.components, found.filled, volume)
                .with_energies(found.energies)
        };
        Ok((found.mask, figures))
    }
}

impl Op for CompeteParams {
    const REVISION: u32 = 1;
    type Inputs<'a> = SeedInputs<'a>;
    type Gives = (Artefact, BoundaryFigures);

    fn check_together(&self) -> Result<(), ParamError> {
        Self::check_together(self)
    }

    fn output(&self) -> Option<Kind> {
        Some(if self.label.is_some() { Kind::Mask } else { Kind::Labels })
    }

    fn run(&self, inputs: SeedInputs<'_>, exec: &Exec) -> Result<Self::Gives, Failure> {
        if self.label.is_none() {
            let labels = compete(&inputs, self, exec)?;
            let voxels = labels.classes().iter().map(|class| class.voxels).sum();
            let figures = BoundaryFigures::of(voxels, labels.classes().len(), 0, inputs.volume);
            return Ok((labels.into_artefact(), figures));
        }
        let won = part_of_seeds(&inputs, self, exec)?;
        let figures = BoundaryFigures::of(won.voxels, won.components, won.filled, inputs.volume);
        Ok((won.mask.into_artefact(), figures))
    }
}

slots! {
    /// What a slice is taken of.
    pub struct ContourInputs<'a> { volume: &'a Volume }
}

impl Op for ContourParams {
    const REVISION: u32 = 1;
    type Inputs<'a> = ContourInputs<'a>;
    type Gives = (Mask, BoundaryFigures);

    fn check_together(&self) -> Result<(), ParamError> {
        Self::check_together(self)
    }

    fn run(&self, inputs: ContourInputs<'_>, exec: &Exec) -> Result<Self::Gives, Failure> {
        let found = active_contour(inputs.volume, self, exec)?;
        let figures = BoundaryFigures {
            iterations: found.iterations,
            ..BoundaryFigures::of(found.voxels, 1, 0, inputs.volume).with_energies(found.energies)
        };
        Ok((found.mask, figures))
    }
}

impl Op for EditParams {
    const REVISION: u32 = 1;
    type Inputs<'a> = EditInputs<'a>;
    type Gives = (Mask, BoundaryFigures);

    fn run(&self, inputs: EditInputs<'_>, exec: &Exec) -> Result<Self::Gives, Failure> {
        let edited = edit(&inputs, self, exec)?;
        let figures = BoundaryFigures::of(edited.voxels, edited.components, edited.filled, inputs.volume);
        Ok((edited.mask, figures))
    }
}
