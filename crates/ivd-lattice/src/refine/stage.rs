//! The stage as scenes and commands see it.

use ivd_core::op::{Amount, Failure, Memory, Method, Op, Place, Remark, Stage, method};
use ivd_core::{Exec, Lattice, ParamError, World, slots};
use nalgebra::Vector3;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::repair::{RepairParams, repair};
use super::{
    Locks, Method as Refines, RefineParams, RefineStatus, Refined, Target, chain, distances, refine,
    vertices_within, with_levels,
};
use crate::Error;
use crate::figures::measure;

/// The stage as scenes and commands see it.
pub const STAGE: Stage = Stage {
    name: "refine",
    about: "Simplifies a lattice, keeping a subset of its vertices.",
    selector: "",
    methods: METHODS,
    positional: &["lattice"],
    places: &[Place { amount: Amount::TrianglesAsCut, ..Place::only("lattice") }],
    quiet: false,
    memory: Memory { voxel: 0, reached: 0, triangle: 440 },
};
const METHODS: &[Method] = &[method::<Refinement>("")];

/// A ball whose vertices stay.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Lock {
    /// Its centre (RAS).
    #[schemars(extend("x-unit" = "mm"))]
    pub pick: [f64; 3],
    /// Its radius.
    #[schemars(range(min = 0.0), extend("x-unit" = "mm"))]
    pub radius: f64,
}

/// Fewer of the same vertices: one of level, ratio, count or max_error says how many, or chain.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(default)]
pub struct Refinement {
    /// How, and how far.
    #[serde(flatten)]
    pub params: RefineParams,
    /// Balls whose vertices stay: pick is the centre (mm, RAS), radius is in mm.
    pub lock: Vec<Lock>,
    /// Components of fewer triangles are removed first; 0 keeps all.
    #[schemars(extend("x-unit" = "triangles"))]
    pub min_component: u64,
    /// Levels to keep beside the lattice itself, ascending, in place of one target: each from the one before.
    #[schemars(extend("x-unit" = "1"))]
    pub chain: Vec<u8>,
}

slots! {
    /// What is refined.
    pub struct Inputs<'a> { lattice: &'a Lattice }
}

/// What a refined lattice comes to; of a chain what its last level does.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct RefineFigures {
    /// Vertices of the input.
    #[schemars(extend("x-unit" = "1"))]
    pub vertices_in: usize,
    /// The refined lattice, or the last level of a chain.
    #[serde(flatten)]
    pub last: LevelFigures,
    /// Vertices in which several fans of triangles meet, and nothing but the vertex joins them; not told of a chain.
    #[schemars(extend("x-unit" = "1"))]
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub bow_tie_vertices: Option<u64>,
    /// Euler characteristic: used vertices − edges + triangles; not told of a chain.
    #[schemars(extend("x-unit" = "1"))]
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub euler: Option<i64>,
    /// Parts that triangles connect; not told of a chain.
    #[schemars(extend("x-unit" = "1"))]
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub components: Option<u64>,
    /// Components that went as too small.
    #[schemars(extend("x-unit" = "1"))]
    pub components_removed: u64,
    /// Vertices that were locked.
    #[schemars(extend("x-unit" = "1"))]
    pub locked: usize,
    /// The error that was asked for, where that was the target: it is kept, and as many vertices went as can within it.
    #[schemars(extend("x-unit" = "mm"))]
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub within_mm: Option<f64>,
    /// The levels of a chain.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub levels: Vec<LevelFigures>,
}

/// What one level comes to.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct LevelFigures {
    /// Level that its vertices amount to.
    #[schemars(extend("x-unit" = "1"))]
    pub level: u8,
    /// Vertices that are left.
    #[schemars(extend("x-unit" = "1", "x-headline" = 1))]
    pub vertices: u64,
    /// Triangles that are left.
    #[schemars(extend("x-unit" = "1", "x-headline" = 2))]
    pub triangles: u64,
    /// Bound on the distance from the input, both ways: the Hausdorff distance is at most this.
    #[schemars(extend("x-unit" = "mm"))]
    pub max_error_mm: f64,
    /// Mean distance from the input.
    #[schemars(extend("x-unit" = "mm"))]
    pub mean_error_mm: f64,
    /// Largest distance from the input that was found; `max_error_mm` is proven for all of it.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(extend("x-unit" = "mm"))]
    pub seen_error_mm: Option<f64>,
    /// Edges with one triangle.
    #[schemars(extend("x-unit" = "1"))]
    pub boundary_edges: u64,
    /// Edges with more than two triangles.
    #[schemars(extend("x-unit" = "1"))]
    pub non_manifold_edges: u64,
    /// Whether every vertex is one of the input's, address and place alike.
    pub subset: bool,
    /// How far it went, and what ended it.
    pub reached: RefineStatus,
}

impl RefineFigures {
    /// Why the target wasn't reached, or it gets no coarser within the error asked for, for a person; `None` where it was.
    pub fn shortfall(&self) -> Option<String> {
        let why = self.last.reached.stopped_by.why()?;
        Some(match self.within_mm {
            Some(mm) => format!("within {mm} mm, as asked for, it gets no coarser: {why}"),
            None => format!("it isn't as coarse as asked for: {why}"),
        })
    }
}

impl Refinement {
    /// Vertices that stay, ascending.
    ///
    /// # Errors
    /// A place without a vertex.
    pub fn locked(&self, lattice: &Lattice, exec: &Exec) -> Result<Vec<u32>, Error> {
        let mut locked = Vec::new();
        for (i, lock) in self.lock.iter().enumerate() {
            let pick = World(Vector3::from(lock.pick));
            let within = exec.run(|| vertices_within(lattice, pick, lock.radius));
            if within.is_empty() {
                let off = |i: usize| (lattice.world(i).0 - pick.0).norm();
                let nearest = (0..lattice.keys().len()).map(off).fold(f64::INFINITY, f64::min);
                let problem = format!("no vertex lies within {} mm of {:?}", lock.radius, lock.pick);
                let remedy = format!("the nearest is {nearest:.3} mm away; move it there, or make it larger");
                return Err(ParamError::new(format!("lock.{i}"), problem, remedy).into());
            }
            locked.extend(within);
        }
        locked.sort_unstable();
        locked.dedup();
        Ok(locked)
    }
}

impl Op for Refinement {
    const REVISION: u32 = 8;
    const REMARK: Option<Remark<RefineFigures>> = Some(|figures| {
        let remedy = figures.last.reached.stopped_by.remedy();
        figures
            .shortfall()
            .map(|told| remedy.map_or_else(|| told.clone(), |remedy| format!("{told}; {remedy}")))
    });
    type Inputs<'a> = Inputs<'a>;
    type Gives = (Lattice, RefineFigures);

    fn check_together(&self) -> Result<(), ParamError> {
        self.params.target.check()?;
        if !self.chain.is_empty() && self.params.target.is_given() {
            let remedy = "leave out level, ratio, count and max_error";
            return Err(ParamError::new("chain", "gives levels of its own", remedy));
        }
        Ok(())
    }

    fn memory(&self) -> Option<Memory> {
        let triangle = match self.params.method {
            Refines::Collapse => 130,
            Refines::Decimate => 100,
            Refines::Loop => 440,
            Refines::Merge => 400,
            Refines::Sample => 250,
        };
        Some(Memory { voxel: 0, reached: 0, triangle })
    }

    fn run(&self, inputs: Inputs<'_>, exec: &Exec) -> Result<Self::Gives, Failure> {
        let lattice = inputs.lattice;
        let small = RepairParams { min_triangles: self.min_component, ..RepairParams::default() };
        let repaired = if self.min_component == 0 { None } else { Some(repair(lattice, &small, exec)?) };
        let sound = repaired.as_ref().map_or(lattice, |repaired| &repaired.lattice);
        let locked = self.locked(sound, exec)?;
        let locks = Locks { vertices: &locked };
        let (refined, mut figures) = if self.chain.is_empty() {
            single(lattice, refine(sound, &self.params, locks, exec)?, exec)?
        } else {
            let steps = chain(sound, &self.params, &self.chain, locks, exec)?;
            let figures = chain_figures(lattice, sound, &steps, exec)?;
            (with_levels(sound.clone(), &steps)?, figures)
        };
        figures.components_removed = repaired.as_ref().map_or(0, |repaired| repaired.done.components_removed);
        figures.locked = locked.len();
        figures.within_mm = match self.params.target.get() {
            Target::MaxError(mm) if self.chain.is_empty() => Some(mm),
            Target::MaxError(_) | Target::Level(_) | Target::Ratio(_) | Target::Count(_) => None,
        };
        Ok((refined, figures))
    }
}

/// A refined lattice with its figures.
fn single(input: &Lattice, refined: Refined, exec: &Exec) -> Result<(Lattice, RefineFigures), Error> {
    exec.check_cancelled()?;
    let f = exec.run(|| measure(&refined.lattice));
    let figures = RefineFigures {
        vertices_in: input.keys().len(),
        last: LevelFigures {
            level: refined.lattice.level(),
            vertices: f.vertices,
            triangles: f.triangles,
            max_error_mm: refined.max_error_mm,
            mean_error_mm: refined.mean_error_mm,
            seen_error_mm: Some(refined.seen_error_mm),
            boundary_edges: f.boundary_edges,
            non_manifold_edges: f.non_manifold_edges,
            subset: is_subset(&refined.lattice, input),
            reached: refined.reached,
        },
        bow_tie_vertices: Some(f.bow_tie_vertices),
        euler: Some(f.euler),
        components: Some(f.components),
        components_removed: 0,
        locked: 0,
        within_mm: None,
        levels: Vec::new(),
    };
    Ok((refined.lattice, figures))
}

/// Figures of a chain: those of its last level, with the errors from the input on, and each level's own.
fn chain_figures(
    input: &Lattice,
    sound: &Lattice,
    steps: &[Refined],
    exec: &Exec,
) -> Result<RefineFigures, Error> {
    let level = |step: &Refined| {
        let f = exec.run(|| measure(&step.lattice));
        let apart = distances(sound, &step.lattice, exec)?;
        Ok(LevelFigures {
            level: step.lattice.level(),
            vertices: f.vertices,
            triangles: f.triangles,
            max_error_mm: step.lattice.max_error_mm() - input.max_error_mm(),
            mean_error_mm: apart.mean_mm,
            seen_error_mm: Some(apart.least_max_mm),
            boundary_edges: f.boundary_edges,
            non_manifold_edges: f.non_manifold_edges,
            subset: is_subset(&step.lattice, input),
            reached: step.reached,
        })
    };
    let levels: Vec<LevelFigures> = steps.iter().map(level).collect::<Result<_, Error>>()?;
    let Some(last) = levels.last().cloned() else {
        return Err(ParamError::new("chain", "has no level", "give one or more").into());
    };
    Ok(RefineFigures {
        vertices_in: input.keys().len(),
        last,
        bow_tie_vertices: None,
        euler: None,
        components: None,
        components_removed: 0,
        locked: 0,
        within_mm: None,
        levels,
    })
}

/// Whether every vertex of `part` is one of `whole`, address and place alike. Both lists ascend by address.
fn is_subset(part: &Lattice, whole: &Lattice) -> bool {
    let mut at = 0;
    part.keys().iter().zip(part.places()).all(|(key, place)| {
        while at < whole.keys().len() && whole.keys()[at] < *key {
            at += 1;
        }
        at < whole.keys().len() && whole.keys()[at] == *key && whole.places()[at] == *place
    })
}
