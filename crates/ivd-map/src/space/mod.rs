//! Deforming space: displacements of voxels without a lattice.
//!
//! Each [`Step`] is a map of space, and several act one after another, each on what the ones before left:
//!
//! - [`Step::Shape`]: a ray deflector (Kurzion and Yagel 1997) that translates, turns, scales, bends and so on within a ball. What
//!   `ivd_motion::freeform` does to the vertices of a lattice this does to all of space.
//! - [`Step::Curve`]: a spatial transfer function (Chen et al. 2003).
//! - [`Step::Chain`]: chain mail over the voxels (Gibson 1997), with links by class.
//! - [`Step::Cut`]: an incision that opens, the discontinuous deflector. The displacement then is a field of two sides and says so,
//!   in [`Displacement::sides`]; there is one cut at most.
//!
//! They go on from another displacement, a solver's for one: [`Start::after`].
//!
//! # No folds
//!
//! The composition is evaluated at the voxels, exactly, and certified as every map is ([`ivd_field::certificate`]). Where it folds, what
//! can be made of many small steps is: each shape does `1/n` of its work `n` times, `n = 2, 4 … 64`, a flow, which doesn't fold where
//! its steps don't. It comes to the same as long as a point stays in the core; [`SpaceFigures::short_mm`] tells what it falls short of. (A bend,
//! a curve and chain mail are not made of smaller ones; they are done at once.) What folds still is refused.
//!
//! A displacement goes on beyond the grid as at its border. Where that folds and the grid itself doesn't, as where a turn reaches the
//! border, what lies beyond is left out: voxels that it came to are vacated.
//!
//! ```
//! use ivd_core::{Exec, Grid, VoxelIndex};
//! use ivd_field::shape::{Kind, Shape};
//! use ivd_map::space::{self, Start, Step};
//!
//! let grid = Grid::with_spacing([32; 3], [1.0; 3])?;
//! let push = Step::Shape(Shape {
//!     kind: Kind::Translate { by: [0.0, 0.0, 3.0] },
//!     centre: [16.0; 3],
//!     axis: [0.0, 0.0, 1.0],
//!     radius: 12.0,
//!     core: 0.25,
//! });
//! let made = space::displace(&grid, &[push], &Start::default(), &Exec::default())?;
//! assert_eq!(made.displacement.forward().at(VoxelIndex([16; 3])), [0.0, 0.0, 3.0]);
//! assert!(made.figures.min_det_j > 0.0 && made.figures.inverse_residual_max_voxel < 1e-3);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

mod chain;
mod curve;
mod cut;
mod reach;
mod stage;
#[cfg(test)]
mod tests;

use ivd_core::{
    Displacement, Error as CoreError, Exec, FieldBricks, Grid, Labels, NO_BRICK, ParamError, VoxelCoord,
    VoxelIndex,
};
use ivd_field::certificate::{Certificate, Detail, Histogram, THIN, certify_bricks, touched};
use ivd_field::inverse::{from_bricks, invert, invert_within, lies_beyond};
use ivd_field::sampler::{Sampler, brick_at};
use ivd_field::shape::{Kind, Shape};
use ivd_field::vectors::{FARTHEST, lengths, sampled};
use nalgebra::Vector3;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::Error;
pub use chain::{ChainMail, ClassLinks, Links};
pub use curve::{Curve, Over, Way};
pub use cut::Cut;
use cut::{Side, TwoSided, Whole, join};
use reach::{bounds, reaches, too_far};
pub use stage::{Inputs, STAGE, SpaceParams};

/// Most equal parts that shapes are done in.
const PARTS: u32 = 64;

/// A map of space, by its `kind`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(tag = "kind", rename_all = "lowercase")]
pub enum Step {
    /// A spatial transfer function.
    Curve(Curve),
    /// Chain mail.
    Chain(ChainMail),
    /// A cut that opens.
    Cut(Cut),
    /// A ray deflector.
    #[serde(untagged)]
    Shape(Shape),
}

impl Step {
    /// # Errors
    /// [`ParamError`] names the part that is out of its domain.
    pub fn check(&self) -> Result<(), ParamError> {
        match self {
            Self::Shape(shape) => shape.check(),
            Self::Curve(curve) => curve.check(),
            Self::Chain(mail) => mail.check(),
            Self::Cut(cut) => cut.check(),
        }
    }

    /// What the schema of a single field can't say.
    fn check_together(&self) -> Result<(), ParamError> {
        match self {
            Self::Shape(shape) => shape.check_together(),
            Self::Curve(curve) => curve.check_together(),
            Self::Chain(mail) => mail.check_together(),
            Self::Cut(cut) => cut.check_together(),
        }
    }

    /// Whether doing a fraction of it again and again comes to the same, where it is done whole.
    fn flows(&self) -> bool {
        match self {
            Self::Shape(shape) => !matches!(shape.kind, Kind::Bend { .. }),
            Self::Cut(_) => true,
            Self::Curve(_) | Self::Chain(_) => false,
        }
    }

    /// Its ball; chain mail has none.
    fn ball(&self) -> Option<([f64; 3], f64)> {
        match self {
            Self::Shape(shape) => Some((shape.centre, shape.radius)),
            Self::Curve(curve) => Some((curve.centre, curve.radius)),
            Self::Cut(cut) => Some((cut.centre, cut.radius)),
            Self::Chain(_) => None,
        }
    }

    /// With its centre counted from the grid's origin, which may be far away.
    fn about_origin(&self, grid: &Grid) -> Self {
        let mut step = self.clone();
        let centre = match &mut step {
            Self::Shape(shape) => &mut shape.centre,
            Self::Curve(curve) => &mut curve.centre,
            Self::Chain(mail) => &mut mail.centre,
            Self::Cut(cut) => &mut cut.centre,
        };
        *centre = (Vector3::from(*centre) - Vector3::from(grid.origin())).into();
        step
    }
}

/// What steps start from.
#[derive(Debug, Clone, Copy, Default)]
pub struct Start<'a> {
    /// What has been displaced before, on the same grid, of one side and in one piece.
    pub after: Option<&'a Displacement>,
    /// Classes at rest, on the same grid, for chain mail that knows some.
    pub labels: Option<&'a Labels>,
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

/// What was made of the steps.
#[derive(Debug, Clone, PartialEq)]
pub struct Made {
    /// The displacement, forward and inverse.
    pub displacement: Displacement,
    /// What it comes to.
    pub figures: SpaceFigures,
}

/// Displaces the voxels of a grid by steps, in their order.
///
/// # Errors
/// A step outside its domain, or that doesn't reach the grid; a second cut; a start on another grid or of two sides;
/// [`Error::Folded`] where it folds however it is done; [`ivd_core::Error::Untrusted`] where a cut's sides meet; the memory limit;
/// cancellation.
pub fn displace(grid: &Grid, steps: &[Step], start: &Start<'_>, exec: &Exec) -> Result<Made, Error> {
    check(steps, start.after.is_some())?;
    check_start(grid, steps, start)?;
    exec.run(|| {
        let space = Space::new(grid, steps, start, exec)?;
        let bricks = space.bricks(exec.skip);
        // Forward and inverse, each twice while it is put together; a cut has them for either side, and both of them joined.
        let fields = if steps.iter().any(|step| matches!(step, Step::Cut(_))) { 10 } else { 4 };
        exec.check_memory("the displacement", fields * 12 * 512 * bricks.len() as u64)?;
        let most = if steps.iter().any(Step::flows) { PARTS } else { 1 };
        let mut parts = 1;
        loop {
            match space.made(&bricks, parts, exec)? {
                Tried::Made(made) => return Ok(*made),
                Tried::Folded(_) if parts < most => parts *= 2,
                Tried::Folded(certificate) => return Err(Error::folded(&certificate, grid)),
            }
        }
    })
}

/// Whether each step is in its domain and they fit together; `after`: whether something has been displaced before.
///
/// # Errors
/// [`ivd_core::Error::Param`]; [`ivd_core::Error::Mismatch`]: a second cut, links by class that aren't the first step.
pub fn check(steps: &[Step], after: bool) -> Result<(), CoreError> {
    let mismatch = |what, problem, remedy| Err(CoreError::Mismatch { what, problem, remedy });
    steps.iter().try_for_each(Step::check)?;
    let mut cuts = (0..steps.len()).filter(|&i| matches!(steps[i], Step::Cut(_)));
    if let Some(second) = cuts.nth(1) {
        let problem = format!("step {second} is a second one; a displacement has one at most");
        return mismatch("the cut", problem, "warp the volume through the first, and cut what comes of it");
    }
    let by_class = |step: &Step| matches!(step, Step::Chain(mail) if !mail.material.is_empty());
    match steps.iter().rposition(by_class) {
        Some(i) if i > 0 || after => {
            let problem = format!("step {i} has links by class, and something has moved before it");
            mismatch("the chain mail", problem, "labels are of the volume at rest: make it the first step")
        }
        _ => Ok(()),
    }
}

fn check_start(grid: &Grid, steps: &[Step], start: &Start<'_>) -> Result<(), CoreError> {
    let mismatch = |what, problem, remedy| Err(CoreError::Mismatch { what, problem, remedy });
    if let Some(after) = start.after {
        if !grid.matches(after.grid()) {
            let dims = [after.grid().dims(), grid.dims()];
            let problem =
                format!("it lies on {:?} voxels elsewhere than the volume's {:?}", dims[0], dims[1]);
            return mismatch(
                "the displacement to start from",
                problem,
                "start from one on the volume's grid",
            );
        }
        if after.has_cut() || !after.vacated().is_empty() {
            let problem =
                "it has a cut, or a part that moved alone, and nothing goes on across that".to_owned();
            let remedy = "let the cut be the last displacement, or warp first";
            return mismatch("the displacement to start from", problem, remedy);
        }
    }
    if let Some(labels) = start.labels {
        labels.grid().require(grid, "labels", "volume")?;
    }
    for (i, step) in steps.iter().enumerate() {
        if let Some((centre, radius)) = step.ball()
            && !reaches(grid, Vector3::from(centre) - Vector3::from(grid.origin()), radius)
        {
            let problem = format!("step {i}: within {radius} mm of {centre:?} there is no voxel");
            return mismatch("a step's ball", problem, "give a centre and a radius that reach the volume");
        }
        if let Step::Chain(mail) = step
            && !mail.material.is_empty()
            && start.labels.is_none()
        {
            let problem = format!("step {i} has links by class, and there are no labels");
            return mismatch("the chain mail", problem, "give labels, or leave the classes out");
        }
    }
    Ok(())
}

/// Steps ready to be done at any place.
struct Space<'a> {
    grid: &'a Grid,
    /// With centres counted from the grid's origin, and the field of each chain mail.
    steps: Vec<(Step, Option<FieldBricks>)>,
    after: Option<&'a FieldBricks>,
    time: f64,
}

/// What a number of parts came to.
enum Tried {
    Made(Box<Made>),
    Folded(Box<Certificate>),
}

impl<'a> Space<'a> {
    fn new(grid: &'a Grid, steps: &[Step], start: &Start<'a>, exec: &Exec) -> Result<Self, Error> {
        let ready = steps.iter().map(|step| {
            let step = step.about_origin(grid);
            let field = match &step {
                Step::Chain(mail) => Some(mail.field(grid, start.labels, exec)?),
                _ => None,
            };
            Ok((step, field))
        });
        Ok(Self {
            grid,
            steps: ready.collect::<Result<_, Error>>()?,
            after: start.after.map(Displacement::forward),
            time: start.after.map_or(0.0, Displacement::time),
        })
    }

    /// The bricks in which something may move; all of them where nothing is to be skipped. What a step doesn't reach at rest comes
    /// into its reach only by what moved it before.
    fn bricks(&self, skip: bool) -> Vec<usize> {
        let dims = self.grid.dims().map(|n| n.div_ceil(8));
        let fields: Vec<&FieldBricks> =
            self.steps.iter().filter_map(|(_, field)| field.as_ref()).chain(self.after).collect();
        let balls: Vec<[[usize; 2]; 3]> = self
            .steps
            .iter()
            .filter_map(|(step, _)| step.ball())
            .filter_map(|(centre, radius)| bounds(self.grid, centre.into(), radius))
            .collect();
        let reached = |b: usize| {
            let at = brick_at(dims, b);
            let meets =
                |ball: &[[usize; 2]; 3]| (0..3).all(|a| (ball[a][0] / 8..=ball[a][1] / 8).contains(&at[a]));
            !skip || fields.iter().any(|field| field.table()[b] != NO_BRICK) || balls.iter().any(meets)
        };
        (0..dims.iter().product()).filter(|&b| reached(b)).collect()
    }

    fn made(&self, bricks: &[usize], parts: u32, exec: &Exec) -> Result<Tried, Error> {
        let samplers = self.samplers();
        let field = |side| self.field(&samplers, bricks, parts, side, exec);
        let (above, certificate, vacated) = match self.whole(field(Side::Above)?, exec)? {
            Ok(found) => found,
            Err(certificate) => return Ok(Tried::Folded(certificate)),
        };
        let Some(cut) = self.steps.iter().position(|(step, _)| matches!(step, Step::Cut(_))) else {
            let residual = above.inverse.residual_max_voxels;
            let joined = TwoSided {
                forward: above.field,
                inverse: above.inverse.field,
                vacated: vacated.into(),
                sides: Vec::new().into(),
            };
            return self.tell(joined, residual, parts, &certificate);
        };
        let (below, mut other, _) = match self.whole(field(Side::Below)?, exec)? {
            Ok(found) => found,
            Err(certificate) => return Ok(Tried::Folded(certificate)),
        };
        let Step::Cut(at) = &self.steps[cut].0 else { unreachable!("the place of the cut") };
        let height = |rest: Vector3<f64>| {
            at.height(self.place(&samplers, rest, None, &self.steps[..cut], parts, Side::Above))
        };
        let slack = 1e-3 * self.grid.shortest_edge();
        let joined = join(self.grid, [&below, &above], height, slack, exec)?;
        let residual = above.inverse.residual_max_voxels.max(below.inverse.residual_max_voxels);
        other.min_det = certificate.min_det.min(other.min_det);
        other.histogram = certificate.histogram;
        self.tell(joined, residual, parts, &other)
    }

    /// The map of one side, all over space, whose field this is, with its certificate and what is vacated; or the certificate that it hasn't.
    #[allow(clippy::type_complexity, reason = "a map, or why there is none")]
    fn whole(
        &self,
        field: FieldBricks,
        exec: &Exec,
    ) -> Result<Result<(Whole, Certificate, Vec<u8>), Box<Certificate>>, Error> {
        let dims = self.grid.dims();
        let proof = |counts: &(dyn Fn([i64; 3]) -> bool + Sync)| {
            let all = touched(&field);
            certify_bricks(&field, self.grid, THIN, &counts, &all, Detail::All, exec)
        };
        let mut certificate = proof(&|_| true)?;
        let cuts = self.steps.iter().any(|(step, _)| matches!(step, Step::Cut(_)));
        let beyond = !cuts && certificate.folded.iter().all(|bad| lies_beyond(dims, bad.cell));
        let within = !certificate.holds() && beyond;
        if within {
            certificate = proof(&|cell| !lies_beyond(dims, cell))?;
        }
        if !certificate.holds() {
            return Ok(Err(Box::new(certificate)));
        }
        let (inverse, vacated) = if within {
            invert_within(&field, self.grid, exec)?
        } else {
            (invert(&field, self.grid, exec)?, Vec::new())
        };
        inverse.check_residual("the inverse of the displacement", "move less, or within a larger radius")?;
        Ok(Ok((Whole { field, inverse }, certificate, vacated)))
    }

    fn tell(
        &self,
        made: TwoSided,
        residual: f64,
        parts: u32,
        certificate: &Certificate,
    ) -> Result<Tried, Error> {
        let TwoSided { forward, inverse, vacated, sides } = made;
        let (voxels_moved, motion_mm_histogram) = lengths(&forward);
        let short = |(step, field): &(Step, Option<FieldBricks>)| {
            let (Some((centre, _)), None) = (step.ball().filter(|_| step.flows()), field) else { return 0.0 };
            let go = |parts| go_through(step, centre.into(), parts, Side::Above);
            (go(1) - go(parts)).norm()
        };
        let figures = SpaceFigures {
            voxels_moved,
            bricks_touched: forward.stored() as u64,
            bricks_total: forward.table().len() as u64,
            min_det_j: certificate.min_det,
            folds: 0,
            parts,
            short_mm: self.steps.iter().map(short).fold(0.0, f64::max),
            inverse_residual_max_voxel: residual,
            det_j_histogram: certificate.histogram.clone(),
            motion_mm_histogram,
            voxels_vacated: vacated.iter().map(|&v| u64::from(v)).sum(),
            two_sided: !sides.is_empty(),
        };
        let displacement = Displacement::new(self.grid.clone(), forward, inverse)?
            .with_time(self.time)
            .with_inverse_residual_max(residual)
            .with_min_det_j(certificate.min_det)
            .with_vacated(vacated)?
            .with_sides(sides)?;
        Ok(Tried::Made(Box::new(Made { displacement, figures })))
    }

    /// One for what was displaced before, and one for each chain mail.
    fn samplers(&self) -> Samplers<'_> {
        let of = |field| Sampler::new(field, self.grid);
        Samplers {
            after: self.after.map(of),
            steps: self.steps.iter().map(|(_, field)| field.as_ref().map(of)).collect(),
        }
    }

    /// The displacement (mm) of every voxel, all of them on one side of the cut.
    fn field(
        &self,
        samplers: &Samplers<'_>,
        bricks: &[usize],
        parts: u32,
        side: Side,
        exec: &Exec,
    ) -> Result<FieldBricks, CoreError> {
        let linear = self.grid.linear_part();
        let vectors = sampled("space", self.grid.dims(), bricks, exec, |voxel, (): &mut ()| {
            let rest = linear * VoxelCoord::from(voxel).0;
            let now = self.place(samplers, rest, Some(voxel), &self.steps, parts, side);
            if now == rest { Vector3::zeros() } else { now - rest }
        })?;
        let fits = |v: &[f32; 3]| v.iter().all(|c| f64::from(c.abs()) <= FARTHEST);
        if !vectors.iter().all(fits) {
            return Err(too_far());
        }
        from_bricks(self.grid.dims(), bricks, vectors.chunks_exact(FieldBricks::VOXELS))
    }

    /// Where steps take a place at rest (mm from the grid's origin), with those that flow done in `parts` parts. Of a voxel's own place
    /// the fields that it starts with have a vector, which is taken as it is.
    fn place(
        &self,
        samplers: &Samplers<'_>,
        rest: Vector3<f64>,
        voxel: Option<VoxelIndex>,
        steps: &[(Step, Option<FieldBricks>)],
        parts: u32,
        side: Side,
    ) -> Vector3<f64> {
        let (linear, to_voxel) = (self.grid.linear_part(), self.grid.inverse_linear_part());
        let moved = |place: Vector3<f64>, field: &FieldBricks, sampler: &Sampler<'_>| match voxel {
            Some(voxel) if place == rest => match field.at(voxel) {
                [0.0, 0.0, 0.0] => place,
                vector => place + Vector3::from(vector).map(f64::from),
            },
            _ => place + linear * sampler.at(to_voxel * place),
        };
        let mut now = match (self.after, &samplers.after) {
            (Some(field), Some(sampler)) => moved(rest, field, sampler),
            _ => rest,
        };
        for ((step, field), sampler) in steps.iter().zip(&samplers.steps) {
            now = match (field, sampler) {
                (Some(field), Some(sampler)) => moved(now, field, sampler),
                _ => go_through(step, now, parts, side),
            };
        }
        now
    }
}

/// Where a step without a field takes a place, done in `parts` parts if it flows.
fn go_through(step: &Step, place: Vector3<f64>, parts: u32, side: Side) -> Vector3<f64> {
    let parts = if step.flows() { parts } else { 1 };
    let amount = 1.0 / f64::from(parts);
    (0..parts).fold(place, |place, _| match step {
        Step::Shape(shape) => shape.apply(place, amount),
        Step::Curve(curve) => curve.apply(place, amount),
        Step::Cut(cut) => cut.apply(place, amount, side),
        Step::Chain(_) => place,
    })
}

struct Samplers<'a> {
    after: Option<Sampler<'a>>,
    steps: Vec<Option<Sampler<'a>>>,
}
