use ivd_core::op::Failure;
use ivd_core::{Grid, Lattice, VoxelCoord, World};
use nalgebra::Vector3;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::Moves;
use crate::elastic::ElasticResult;
use crate::freeform::Shaped;
use crate::handles::Pick;
use crate::mass_spring;
use crate::rigid::BoneMotion;
use crate::ring;

/// What a deformation comes to.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize, JsonSchema)]
pub struct Figures {
    /// Vertices whose displacement isn't 0 in the last frame.
    #[schemars(extend("x-unit" = "1", "x-headline" = 1))]
    pub vertices_moved: usize,
    /// Time steps made; frames, where time doesn't pass; 0 where there are shapes only.
    #[schemars(extend("x-unit" = "1"))]
    pub steps: usize,
    /// How far from balance it ends: unbalanced force over the force put in, or the worst relative gradient of an implicit solver.
    #[schemars(extend("x-unit" = "1"))]
    pub residual: f64,
    /// Energy after the first step.
    #[schemars(extend("x-unit" = "nJ"))]
    pub energy_first: f64,
    /// Energy after the last step.
    #[schemars(extend("x-unit" = "nJ"))]
    pub energy_last: f64,
    /// Largest displacement of any frame.
    #[schemars(extend("x-unit" = "mm"))]
    pub max_displacement_mm: f64,
    /// Vertices that the handles took, in their order.
    pub handles: Vec<PickFigures>,
    /// Vertices in the middle of the fixed places, in their order.
    pub fixed: Vec<PickFigures>,
    /// Of masses on springs.
    #[serde(flatten)]
    pub springs: Option<SpringFigures>,
    /// Of elastic matter.
    #[serde(flatten)]
    pub elastic: Option<ElasticFigures>,
}

/// Where a place was found on the lattice.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct PickFigures {
    /// Point that was asked for, RAS; null where the vertex was named by its number.
    #[schemars(extend("x-unit" = "mm"))]
    pub asked_mm: Option<[f64; 3]>,
    /// The vertex that was taken.
    #[schemars(extend("x-unit" = "1"))]
    pub vertex: usize,
    /// Where it is at rest, RAS.
    #[schemars(extend("x-unit" = "mm"))]
    pub at_mm: [f64; 3],
    /// How far that is from what was asked for.
    #[schemars(extend("x-unit" = "mm"))]
    pub away_mm: f64,
    /// The same in diagonals of a voxel.
    #[schemars(extend("x-unit" = "1"))]
    pub away_diagonals: f64,
    /// How far the vertex is from the nearest outer face of the scan, at rest and where a handle moves it; less than 0 beyond.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(extend("x-unit" = "voxels"))]
    pub border_voxels: Option<[f64; 2]>,
}

impl PickFigures {
    /// `way`: how far a handle moves the vertex (mm).
    fn new(pick: &Pick, way: [f64; 3], lattice: &Lattice) -> Self {
        let grid = lattice.grid();
        let away_mm = pick.away();
        let away_diagonals = away_mm / grid.voxel_diagonal();
        let at = Vector3::from(pick.at);
        let border_voxels = Some([at, at + Vector3::from(way)].map(|place| from_border(grid, place)));
        Self {
            asked_mm: pick.asked,
            vertex: pick.vertex,
            at_mm: pick.at,
            away_mm,
            away_diagonals,
            border_voxels,
        }
    }
}

/// How far a place (mm) is from the nearest outer face of a grid's voxels (voxels); less than 0 beyond.
fn from_border(grid: &Grid, place: Vector3<f64>) -> f64 {
    let VoxelCoord(voxel) = grid.voxel(World(place));
    (0..3).map(|a| (voxel[a] + 0.5).min(grid.dims()[a] as f64 - 0.5 - voxel[a])).fold(f64::INFINITY, f64::min)
}

/// What is told of elastic matter beside the rest.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct ElasticFigures {
    /// Cells of matter.
    #[schemars(extend("x-unit" = "1"))]
    pub cells: usize,
    /// Nodes that are free to move.
    #[schemars(extend("x-unit" = "1"))]
    pub nodes_free: usize,
    /// Iterations of the equations, of all steps.
    #[schemars(extend("x-unit" = "1"))]
    pub iterations: usize,
    /// Share of the way that was gone; less than 1 only with `limit = "stop"`.
    #[schemars(extend("x-unit" = "1"))]
    pub share: f64,
    /// Force of each handle at the end: what it pulls with, or what it takes to hold its grip. 0 of one on a bone.
    #[schemars(extend("x-unit" = "mN"))]
    pub handle_forces_mn: Vec<[f64; 3]>,
    /// Sum of the sizes of the forces by which the border of what may move holds the rest.
    #[schemars(extend("x-unit" = "mN"))]
    pub border_mn: f64,
    /// What bones have done, as they were declared.
    pub bones: Vec<BoneFigures>,
}

/// What is told of masses on springs beside the rest.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct SpringFigures {
    /// Vertices that may move.
    #[schemars(extend("x-unit" = "1"))]
    pub vertices_loose: usize,
    /// Springs with such an end.
    #[schemars(extend("x-unit" = "1"))]
    pub springs: usize,
    /// Length of a step.
    #[schemars(extend("x-unit" = "s"))]
    pub dt_s: f64,
    /// Iterations of an implicit solver, of all steps.
    #[schemars(extend("x-unit" = "1"))]
    pub iterations: usize,
    /// Force of each handle at the end: what it pulls with, or what it takes to hold its vertices where they are. 0 of one on a bone.
    #[schemars(extend("x-unit" = "mN"))]
    pub handle_forces_mn: Vec<[f64; 3]>,
    /// Sum of the sizes of the forces by which vertices outside the reach hold the others.
    #[schemars(extend("x-unit" = "mN"))]
    pub truncation_mn: f64,
    /// The same over the sum of the sizes of the handles' and the bones' forces; far below 1 where the reach is large enough, and 0 where no spring is stretched.
    #[schemars(extend("x-unit" = "1"))]
    pub truncation: f64,
    /// What bones have done, as they were declared.
    pub bones: Vec<BoneFigures>,
}

/// What a bone's motion is as a whole.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct BoneFigures {
    /// What it is called.
    pub name: String,
    /// Vertices that it holds.
    #[schemars(extend("x-unit" = "1"))]
    pub vertices: usize,
    /// Direction of its turn's axis against rest, its parents' included; z where it doesn't turn.
    #[schemars(extend("x-unit" = "1"))]
    pub axis: [f64; 3],
    /// Angle of that turn, 0 … 180.
    #[schemars(extend("x-unit" = "degrees"))]
    pub angle_deg: f64,
    /// Where the middle of its vertices' box is at rest, RAS.
    #[schemars(extend("x-unit" = "mm"))]
    pub centre_mm: [f64; 3],
    /// How far that goes.
    #[schemars(extend("x-unit" = "mm"))]
    pub shift_mm: [f64; 3],
    /// Root mean square of what the fit leaves at its handles; null where the motion is given.
    #[schemars(extend("x-unit" = "mm"))]
    pub left_mm: Option<f64>,
    /// Largest relative change of a distance between two of its vertices, of those looked at: rounding.
    #[schemars(extend("x-unit" = "1"))]
    pub strain: f64,
    /// Force that holds it against the tissue at the end.
    #[schemars(extend("x-unit" = "mN"))]
    pub force_mn: [f64; 3],
}

impl From<&ring::RingResult> for Figures {
    fn from(solved: &ring::RingResult) -> Self {
        let ring::RingResult { vertices_moved, steps, residual, .. } = *solved;
        let ring::RingResult { energy_first, energy_last, max_displacement_mm, .. } = *solved;
        Self {
            vertices_moved,
            steps,
            residual,
            energy_first,
            energy_last,
            max_displacement_mm,
            ..Self::default()
        }
    }
}

impl From<&mass_spring::MassSpringResult> for Figures {
    fn from(solved: &mass_spring::MassSpringResult) -> Self {
        Self {
            vertices_moved: solved.vertices_moved,
            steps: solved.steps,
            residual: solved.residual,
            energy_first: solved.energy_first,
            energy_last: solved.energy_last,
            max_displacement_mm: solved.max_displacement_mm,
            springs: Some(SpringFigures {
                vertices_loose: solved.vertices_loose,
                springs: solved.springs,
                dt_s: solved.dt,
                iterations: solved.iterations,
                handle_forces_mn: solved.handle_forces_mn.clone(),
                truncation_mn: solved.truncation_mn,
                truncation: solved.truncation,
                bones: solved.bones.iter().map(BoneFigures::from).collect(),
            }),
            ..Self::default()
        }
    }
}

impl From<&ElasticResult> for Figures {
    fn from(solved: &ElasticResult) -> Self {
        Self {
            vertices_moved: solved.vertices_moved,
            steps: solved.parts,
            residual: solved.residual,
            energy_first: solved.energies[0],
            energy_last: solved.energies[1],
            max_displacement_mm: solved.max_displacement_mm,
            elastic: Some(ElasticFigures {
                cells: solved.cells,
                nodes_free: solved.nodes,
                iterations: solved.iterations,
                share: solved.share,
                handle_forces_mn: solved.handle_forces_mn.clone(),
                border_mn: solved.border_mn,
                bones: solved.bones.iter().map(BoneFigures::from).collect(),
            }),
            ..Self::default()
        }
    }
}

impl From<&BoneMotion> for BoneFigures {
    fn from(bone: &BoneMotion) -> Self {
        Self {
            name: bone.name.clone(),
            vertices: bone.vertices,
            axis: bone.axis,
            angle_deg: bone.angle,
            centre_mm: bone.centre,
            shift_mm: bone.shift,
            left_mm: bone.left_mm,
            strain: bone.strain,
            force_mn: bone.force_mn,
        }
    }
}

/// Beyond this many voxel diagonals a pick is most likely not what was meant.
const FAR_DIAGONALS: f64 = 2.0;
/// Nearer to the border of the scan than this (voxels), what moves comes out of the scan or from beyond it.
const NEAR_BORDER: f64 = 2.0;

impl Figures {
    /// With the vertices that places were found at.
    ///
    /// # Errors
    /// Those of [`find_picks`].
    pub(super) fn with_picks(self, lattice: &Lattice, moves: &Moves) -> Result<Self, Failure> {
        let [handles, fixed] = moves.picks(lattice)?;
        let ways = moves.handles()?.into_iter().map(|handle| handle.way());
        let handles =
            handles.iter().zip(ways).map(|(pick, way)| PickFigures::new(pick, way, lattice)).collect();
        let fixed = fixed.iter().map(|pick| PickFigures::new(pick, [0.0; 3], lattice)).collect();
        Ok(Self { handles, fixed, ..self })
    }

    /// What a person should know of them: places that were found far from where they were asked for, handles at the border of the scan, and a way
    /// that wasn't gone whole.
    pub(super) fn remark(&self) -> Option<String> {
        let far = |name: &'static str, picks: &[PickFigures]| -> Vec<String> {
            let far = picks.iter().enumerate().filter(|(_, pick)| pick.away_diagonals > FAR_DIAGONALS);
            far.map(|(i, pick)| {
                let PickFigures { vertex, at_mm, away_mm, away_diagonals, .. } = pick;
                format!(
                    "{name}.{i} took vertex {vertex} at {at_mm:.2?} mm, {away_mm:.2} mm ({away_diagonals:.1} voxel diagonals) \
                     from what was asked for"
                )
            })
            .collect()
        };
        let share = self.elastic.as_ref().map_or(1.0, |elastic| elastic.share);
        let stopped = (share < 1.0)
            .then(|| format!("it stopped after {:.0} % of the way, where matter can't go on", 100.0 * share));
        let far = far("handle", &self.handles).into_iter().chain(far("fix", &self.fixed));
        let told: Vec<String> = far.chain(self.at_border()).chain(stopped).collect();
        (!told.is_empty()).then(|| told.join("; "))
    }

    /// What to say of handles that are at the border of the scan, or come there.
    fn at_border(&self) -> impl Iterator<Item = String> {
        let near = self.handles.iter().enumerate().filter_map(|(i, pick)| Some((i, pick.border_voxels?)));
        near.filter(|(_, [rest, moved])| rest.min(*moved) < NEAR_BORDER).map(|(i, [rest, moved])| {
            let lies = match (rest < NEAR_BORDER, moved < 0.0) {
                (true, _) => format!("lies {:.1} voxels from the border of the scan", rest.max(0.0)),
                (false, true) => format!("is moved {:.1} voxels beyond the border of the scan", -moved),
                (false, false) => format!("is moved to {moved:.1} voxels from the border of the scan"),
            };
            format!(
                "handle.{i} {lies}: what moves out of the scan there is cut off, and where something moves inwards nothing follows but the \
                 least value (black)"
            )
        })
    }

    /// After shapes have gone on from there.
    pub(super) fn after(self, shaped: &Shaped) -> Self {
        let (vertices_moved, max_displacement_mm) = (shaped.vertices_moved, shaped.max_displacement_mm);
        Self { vertices_moved, max_displacement_mm, ..self }
    }
}
