use ivd_core::{
    Displacement, Error, FieldBricks, Frame, Lattice, Motion, Role, VoxelCoord, VoxelIndex, counted,
};
use ivd_field::certificate::{Certificate, Histogram};
use ivd_field::sampler::{Sampler, brick_at};
use ivd_field::vectors::lengths;
use nalgebra::Vector3;
use rayon::prelude::*;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::region::Region;

/// How well the voxels' motion follows the lattice's, at the vertices that are driven or held. Those in a conflict don't count in the mean, the
/// percentiles and the root mean square over all.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize, JsonSchema)]
pub struct SurfaceFit {
    /// Vertices in reach that a solver moved.
    #[schemars(extend("x-unit" = "1"))]
    pub vertices_driven: u64,
    /// Vertices in reach that were told to stay.
    #[schemars(extend("x-unit" = "1"))]
    pub vertices_held: u64,
    /// Vertices in reach that nothing moved or held: they go along with what surrounds them.
    #[schemars(extend("x-unit" = "1"))]
    pub vertices_carried: u64,
    /// Vertices in a conflict: within two voxels another one's motion differs by more than how far it is away.
    #[schemars(extend("x-unit" = "1"))]
    pub conflicts: u64,
    /// Largest difference of the map's motion from a vertex's own (mm).
    #[schemars(extend("x-unit" = "mm"))]
    pub misfit_max_mm: f64,
    /// The same along the grid's axes, in voxels.
    #[schemars(extend("x-unit" = "voxels"))]
    pub misfit_max_voxel: f64,
    /// Where that is, RAS; null where nothing moves.
    #[schemars(extend("x-unit" = "mm"))]
    pub misfit_max_at_mm: Option<[f64; 3]>,
    /// Mean of the difference over the vertices in reach (edges of a cube of a voxel's volume).
    #[schemars(extend("x-unit" = "voxels"))]
    pub misfit_mean_voxel: f64,
    /// Difference that 95 % of them don't exceed.
    #[schemars(extend("x-unit" = "voxels"))]
    pub misfit_p95_voxel: f64,
    /// Difference that 99.9 % of them don't exceed.
    #[schemars(extend("x-unit" = "voxels"))]
    pub misfit_p999_voxel: f64,
    /// Root mean square of the difference over all vertices that move (voxels).
    #[schemars(extend("x-unit" = "voxels"))]
    pub misfit_rms_voxel: f64,
    /// Root mean square of the difference over the vertices that move at least half as far as the farthest, as a
    /// fraction of their motion (no unit).
    #[schemars(extend("x-unit" = "1"))]
    pub misfit: f64,
    /// Volume enclosed by the lattice, at rest and deformed by the map (mm³).
    #[schemars(extend("x-unit" = "mm³"))]
    pub volume_mm3: [f64; 2],
}

/// How the equations of a map's nodes were solved; of several parts together.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize, JsonSchema)]
pub struct SolveFigures {
    /// Nodes that are free to move.
    #[schemars(extend("x-unit" = "1"))]
    pub nodes: u64,
    /// Iterations, of all increments.
    #[schemars(extend("x-unit" = "1"))]
    pub iterations: u32,
    /// Largest residual of an increment, relative to its right-hand side.
    #[schemars(extend("x-unit" = "1"))]
    pub residual: f64,
    /// Increments that the motion was made in; 1 where one step doesn't fold.
    #[schemars(extend("x-unit" = "1"))]
    pub increments: u32,
}

/// How much space is squeezed to less than a tenth of its volume, by cells of eight voxels, which are as large as a voxel: those that are so
/// at their middle.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize, JsonSchema)]
pub struct Squeezed {
    /// How many.
    #[schemars(extend("x-unit" = "voxels"))]
    pub voxels: u64,
    /// What they take at rest.
    #[schemars(extend("x-unit" = "mm³"))]
    pub volume_mm3: f64,
    /// Their share of the cells in which something moves.
    #[schemars(extend("x-unit" = "1"))]
    pub share: f64,
}

impl Squeezed {
    /// - `det_j`: determinants at the cells' middles, with bins that end at [`SQUEEZED`]; `voxel_mm3`: what a voxel takes.
    fn of(det_j: &Histogram, voxel_mm3: f64) -> Self {
        let width = (det_j.upper - det_j.lower) / det_j.counts.len() as f64;
        let bins = ((SQUEEZED - det_j.lower) / width).round() as usize;
        let voxels: u64 = det_j.counts.iter().take(bins).sum();
        let all: u64 = det_j.counts.iter().sum();
        Self { voxels, volume_mm3: voxels as f64 * voxel_mm3, share: voxels as f64 / all.max(1) as f64 }
    }

    /// How much that is, in words.
    fn told(self) -> String {
        let Self { voxels, volume_mm3, share } = self;
        let percent = 100.0 * share;
        let percent = if percent < 0.01 { "less than 0.01".to_owned() } else { format!("{percent:.2}") };
        let volume = if volume_mm3 < 10.0 { format!("{volume_mm3:.2}") } else { format!("{volume_mm3:.0}") };
        format!("{} ({volume} mm³, {percent} % of what moves)", counted(voxels, "voxel", "voxels"))
    }
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
    /// Middle of the cell of that bound at rest, RAS; null where nothing moves.
    #[serde(default)]
    #[schemars(extend("x-unit" = "mm"))]
    pub min_det_j_at_mm: Option<[f64; 3]>,
    /// Space that is squeezed to less than a tenth; results of older programs don't tell.
    #[serde(default)]
    pub squeezed: Option<Squeezed>,
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
    pub solved: Option<SolveFigures>,
    /// Largest `|φ(ψ(y)) − y|`.
    #[schemars(extend("x-unit" = "voxels"))]
    pub inverse_residual_max_voxel: f64,
    /// Voxels that a part moving alone left behind.
    #[schemars(extend("x-unit" = "voxels"))]
    pub voxels_vacated: u64,
    /// Share of the way that is gone: 1, or what can be mapped where it ends there.
    #[schemars(extend("x-unit" = "1"))]
    pub share: f64,
    /// Largest motion of a voxel.
    #[schemars(extend("x-unit" = "mm"))]
    pub largest_mm: f64,
    /// Where that is at rest, RAS; null where nothing moves.
    #[schemars(extend("x-unit" = "mm"))]
    pub largest_at_mm: Option<[f64; 3]>,
    /// How well the map follows the lattice.
    pub followed: SurfaceFit,
    /// Lengths of the voxels' motion (mm), 0 … the largest.
    pub motion_mm_histogram: Histogram,
    /// det ∇φ at the centres of the cells that move, 0 … 2.
    pub det_j_histogram: Histogram,
}

/// Space that is squeezed to less than this share of its volume is as good as lost: two voxels' matter lies within a tenth of one.
const SQUEEZED: f64 = 0.1;

/// Further behind than this (voxels) the map's surface isn't the lattice's.
const LEFT_BEHIND: f64 = 1.0;

impl MapFigures {
    /// Whether the voxels follow the lattice to within a voxel, all of the way.
    pub fn follows(&self) -> bool {
        self.share >= 1.0 && self.followed.misfit_max_voxel <= LEFT_BEHIND
    }

    /// Whether there is nothing to know of it before it is trusted, but perhaps that a corner of a voxel is squeezed.
    pub fn is_plain(&self) -> bool {
        let is_squeezed = self.squeezed.map_or(self.min_det_j < SQUEEZED, |squeezed| squeezed.voxels > 0);
        self.follows() && self.followed.conflicts == 0 && !is_squeezed
    }

    /// What a person should know before the map is trusted: that it ends on the way, leaves vertices behind, was told different motions
    /// near one another, or squeezes space to next to nothing.
    pub fn remark(&self) -> Option<String> {
        let (fit, mut told) = (&self.followed, Vec::new());
        if self.share < 1.0 {
            told.push(format!("it ends after {:.1} % of the way", 100.0 * self.share));
        }
        if fit.misfit_max_voxel > LEFT_BEHIND {
            let at = fit.misfit_max_at_mm.map(|at| at.map(|c| format!("{c:.1}")).join(", "));
            let at = at.map_or_else(String::new, |at| format!(" at {at} mm"));
            told.push(format!(
                "a vertex is left behind by {:.2} mm ({:.1} voxels){at}; the largest motion of a voxel is {:.2} mm",
                fit.misfit_max_mm, fit.misfit_max_voxel, self.largest_mm
            ));
        }
        if fit.conflicts > 0 {
            told.push(counted(
                fit.conflicts,
                "vertex within two voxels of others is told to move differently",
                "vertices within two voxels of others are told to move differently",
            ));
        }
        if let Some(last) = told.last_mut() {
            *last +=
                "; what moves more evenly is followed more closely: move less; a wider radius may help, too";
        }
        told.extend((self.min_det_j < SQUEEZED).then(|| self.squeezed_told()));
        (!told.is_empty()).then(|| told.join("; "))
    }
}

impl MapFigures {
    /// How much space is squeezed to next to nothing, and where worst.
    fn squeezed_told(&self) -> String {
        let at = self.min_det_j_at_mm.map(|at| at.map(|c| format!("{c:.1}")).join(", "));
        let at = at.map_or_else(String::new, |at| format!(" at {at} mm (at rest)"));
        let worst = format!("to {:.1} %{at}", 100.0 * self.min_det_j);
        let much = match self.squeezed {
            Some(Squeezed { voxels: 0, .. }) => {
                return format!(
                    "no voxel as a whole is squeezed to less than a tenth of its volume, a corner of one is, {worst}: it folds nowhere"
                );
            }
            Some(squeezed) => format!(" of {}", squeezed.told()),
            None => String::new(),
        };
        format!(
            "space{much} is squeezed to less than a tenth of its volume, at the worst corner of a voxel {worst}: it folds nowhere, but matter there can \
             be hard to see; the slices show where, and a smaller move, or of map.method octree and biharmonic the other, may squeeze less"
        )
    }
}

/// What a map made.
#[derive(Debug, Clone, PartialEq)]
pub struct MapResult {
    /// The displacement, forward and inverse.
    pub displacement: Displacement,
    /// What it comes to.
    pub figures: MapFigures,
}

/// What a map makes of a lattice that is dragged: [`MapResult`] without what only a report shows.
#[derive(Debug, Clone, PartialEq)]
pub struct MapUpdate {
    /// The displacement, forward and inverse.
    pub displacement: Displacement,
    /// Rounds of local relaxation that were needed.
    pub relaxations: u32,
    /// `k` where the map is a flow in 2ᵏ steps; 0 for the field as carried.
    pub halvings: u32,
    /// How far the vertices that move most are left behind: see [`SurfaceFit::misfit`].
    pub misfit: f64,
    /// How far any vertex is left behind: see [`SurfaceFit::misfit_max_mm`].
    pub left_mm: f64,
}

impl From<MapResult> for (Displacement, MapFigures) {
    fn from(mapped: MapResult) -> Self {
        (mapped.displacement, mapped.figures)
    }
}

impl From<MapResult> for MapUpdate {
    fn from(mapped: MapResult) -> Self {
        let MapResult { displacement, figures } = mapped;
        let MapFigures { relaxations, halvings, followed, .. } = figures;
        let SurfaceFit { misfit, misfit_max_mm: left_mm, .. } = followed;
        Self { displacement, relaxations, halvings, misfit, left_mm }
    }
}

impl MapResult {
    pub(super) fn new(
        displacement: Displacement,
        certificate: Certificate,
        relaxations: u32,
        halvings: u32,
        followed: SurfaceFit,
    ) -> Self {
        let (voxels_moved, motion_mm_histogram) = lengths(displacement.forward());
        let (largest_mm, largest_at_mm) = largest(&displacement);
        let middle = |cell: [i64; 3]| VoxelCoord(Vector3::from(cell.map(|c| c as f64 + 0.5)));
        let min_det_j_at_mm =
            certificate.worst.map(|worst| displacement.grid().world(middle(worst.cell)).0.into());
        let figures = MapFigures {
            share: 1.0,
            largest_mm,
            largest_at_mm,
            voxels_moved,
            bricks_touched: displacement.forward().stored() as u64,
            bricks_total: displacement.forward().table().len() as u64,
            min_det_j: certificate.min_det,
            min_det_j_at_mm,
            squeezed: Some(Squeezed::of(&certificate.histogram, displacement.grid().voxel_volume())),
            folds: certificate.folded.len() as u64,
            relaxations,
            halvings,
            solved: None,
            inverse_residual_max_voxel: displacement.inverse_residual_max(),
            det_j_histogram: certificate.histogram,
            motion_mm_histogram,
            voxels_vacated: displacement.vacated().iter().map(|&v| u64::from(v)).sum(),
            followed,
        };
        Self { displacement, figures }
    }
}

impl SurfaceFit {
    pub(super) fn measure(
        lattice: &Lattice,
        motion: &Motion,
        field: &FieldBricks,
        frame: &Frame,
        region: &Region,
    ) -> Self {
        let grid = lattice.grid();
        let sampler = Sampler::new(field, grid);
        let (linear, to_voxel) = (grid.linear_part(), grid.inverse_linear_part());
        let places: Vec<Vector3<f64>> = lattice.local_positions();
        let moved: Vec<Vector3<f64>> =
            (0..places.len()).into_par_iter().map(|i| linear * sampler.at(lattice.voxel(i).0)).collect();
        let in_reach: Vec<bool> = places
            .par_iter()
            .zip(&frame.displacement[..])
            .map(|(at, u)| *u != [0.0; 3] || region.holds(*at))
            .collect();
        let count =
            |role| (0..places.len()).filter(|&v| in_reach[v] && motion.role(v) == role).count() as u64;
        let followed: Vec<usize> =
            (0..places.len()).filter(|&v| in_reach[v] && motion.role(v).constrains()).collect();
        let in_conflict = conflicts(&followed, &places, &frame.displacement, 2.0 * grid.longest_edge());
        let most = super::region::largest(frame);
        let edge = grid.voxel_volume().cbrt();
        let mut fit = Self {
            vertices_driven: count(Role::Driven),
            vertices_held: count(Role::Held),
            vertices_carried: count(Role::Carried),
            conflicts: in_conflict.iter().filter(|c| **c).count() as u64,
            volume_mm3: [
                volume(lattice.triangles(), |i| places[i]),
                volume(lattice.triangles(), |i| places[i] + moved[i]),
            ],
            ..Self::default()
        };
        let (mut missed, mut asked, mut squares, mut moving) = (0.0, 0.0, 0.0, 0_u64);
        let mut apart = Vec::with_capacity(followed.len());
        for (&v, &conflict) in followed.iter().zip(&in_conflict) {
            let want = Vector3::from(frame.displacement[v]);
            let difference = (moved[v] - want).norm();
            if most > 0.0 && want.norm() >= 0.5 * most {
                missed += (difference / most).powi(2);
                asked += (want.norm() / most).powi(2);
            }
            if difference > fit.misfit_max_mm || fit.misfit_max_at_mm.is_none() {
                (fit.misfit_max_mm, fit.misfit_max_at_mm) = (difference, Some(lattice.world(v).0.into()));
            }
            let in_voxels = (to_voxel * (moved[v] - want)).norm();
            fit.misfit_max_voxel = fit.misfit_max_voxel.max(in_voxels);
            if conflict {
                continue;
            }
            apart.push(difference / edge);
            if want != Vector3::zeros() {
                squares += in_voxels * in_voxels;
                moving += 1;
            }
        }
        apart.sort_unstable_by(f64::total_cmp);
        let share = |share: f64| -> f64 {
            let at = (share * apart.len() as f64).ceil() as usize;
            apart.get(at.saturating_sub(1)).copied().unwrap_or(0.0)
        };
        (fit.misfit_p95_voxel, fit.misfit_p999_voxel) = (share(0.95), share(0.999));
        fit.misfit_mean_voxel = apart.iter().sum::<f64>() / apart.len().max(1) as f64;
        fit.misfit = if asked > 0.0 { f64::sqrt(missed / asked) } else { 0.0 };
        fit.misfit_rms_voxel = if moving > 0 { f64::sqrt(squares / moving as f64) } else { 0.0 };
        fit
    }

    /// Refuses a map that leaves the lattice behind.
    ///
    /// - `tolerance`: of the root mean square; `most`: how far all but a thousandth may be left (mm); `edge`: of a cube of a voxel's volume (mm).
    pub(super) fn check(&self, tolerance: f64, most: f64, edge: f64) -> Result<(), Error> {
        const REMEDY: &str = "move the handle less, give it a larger radius, or raise the tolerance";
        let (far, at) = (self.misfit_max_mm, self.misfit_max_at_mm.unwrap_or_default());
        if self.misfit.is_nan() || self.misfit > tolerance {
            return Err(Error::Untrusted {
                what: "the map",
                problem: format!(
                    "kept free of folds it leaves the lattice behind by {:.0} % of its motion ({far:.3} mm at most, at {at:.1?} mm), more \
                     than the tolerance of {:.0} %",
                    100.0 * self.misfit,
                    100.0 * tolerance
                ),
                remedy: REMEDY,
            });
        }
        let left = self.misfit_p999_voxel * edge;
        if left <= most {
            return Ok(());
        }
        Err(Error::Untrusted {
            what: "the map",
            problem: format!(
                "kept free of folds it leaves a thousandth of the lattice behind by more than {left:.3} mm ({far:.3} mm at most, at \
                 {at:.1?} mm), more than the tolerance of {:.0} % of the largest motion",
                100.0 * tolerance
            ),
            remedy: REMEDY,
        })
    }
}

/// Largest motion of a voxel (mm), and where it is.
fn largest(displacement: &Displacement) -> (f64, Option<[f64; 3]>) {
    let (grid, field) = (displacement.grid(), displacement.forward());
    let bricks = (0..field.table().len()).filter_map(|brick| Some((brick, field.brick(brick)?)));
    let mut most = (0.0, None);
    for (brick, vectors) in bricks {
        for (slot, u) in vectors.iter().enumerate() {
            let length = Vector3::from(u.map(f64::from)).norm();
            if length > most.0 {
                most = (length, Some((brick, slot)));
            }
        }
    }
    let place = |(brick, slot): (usize, usize)| {
        let first = brick_at(field.brick_dims(), brick).map(|b| 8 * b);
        let voxel = VoxelIndex([first[0] + slot % 8, first[1] + slot / 8 % 8, first[2] + slot / 64]);
        grid.world(VoxelCoord::from(voxel)).0.into()
    };
    (most.0, most.1.map(place))
}

/// Which of the vertices have another within a distance (mm) whose motion differs by more than how far it is away.
fn conflicts(vertices: &[usize], places: &[Vector3<f64>], motions: &[[f64; 3]], within: f64) -> Vec<bool> {
    let cell = |v: usize| -> [i64; 3] { places[v].map(|c| (c / within).floor() as i64).into() };
    let mut cells: Vec<([i64; 3], usize)> = vertices.iter().map(|&v| (cell(v), v)).collect();
    cells.par_sort_unstable();
    let first = |key: [i64; 3]| cells.partition_point(|(other, _)| *other < key);
    let of = |v: usize| {
        let at = cell(v);
        (0..9_i64).any(|side| {
            // Three cells along z are one run.
            let key = [at[0] + side % 3 - 1, at[1] + side / 3 - 1, at[2] - 1];
            let end = [key[0], key[1], at[2] + 1];
            cells[first(key)..].iter().take_while(|(other, _)| *other <= end).any(|&(_, u)| {
                let away = (places[u] - places[v]).norm();
                let apart = (Vector3::from(motions[u]) - Vector3::from(motions[v])).norm();
                away <= within && apart > away
            })
        })
    };
    vertices.par_iter().map(|&v| of(v)).collect()
}

/// [`SurfaceFit::misfit`] alone, from the vertices that it is about.
pub(super) fn misfit(lattice: &Lattice, motion: &Motion, field: &FieldBricks, frame: &Frame) -> f64 {
    let sampler = Sampler::new(field, lattice.grid());
    let (linear, most) = (lattice.grid().linear_part(), super::region::largest(frame));
    let counts = |want: Vector3<f64>| most > 0.0 && want.norm() >= 0.5 * most;
    let shares: Vec<[f64; 2]> = frame
        .displacement
        .par_iter()
        .enumerate()
        .map(|(v, want)| (v, Vector3::from(*want)))
        .filter(|(v, want)| motion.role(*v).constrains() && counts(*want))
        .map(|(v, want)| {
            let difference = (linear * sampler.at(lattice.voxel(v).0) - want).norm();
            [(difference / most).powi(2), (want.norm() / most).powi(2)]
        })
        .collect();
    let (mut missed, mut asked) = (0.0, 0.0);
    for [m, a] in shares {
        missed += m;
        asked += a;
    }
    if asked > 0.0 { f64::sqrt(missed / asked) } else { 0.0 }
}

/// [`SurfaceFit::misfit_max_mm`] alone.
pub(super) fn most_left(
    lattice: &Lattice,
    motion: &Motion,
    field: &FieldBricks,
    frame: &Frame,
    region: &Region,
) -> f64 {
    let sampler = Sampler::new(field, lattice.grid());
    let linear = lattice.grid().linear_part();
    let left = |(v, want): (usize, &[f64; 3])| {
        let at = lattice.voxel(v).0;
        let counts = motion.role(v).constrains() && (*want != [0.0; 3] || region.holds(linear * at));
        let far = if counts { (linear * sampler.at(at) - Vector3::from(*want)).norm() } else { 0.0 };
        if far.is_nan() { f64::INFINITY } else { far }
    };
    frame.displacement.par_iter().enumerate().map(left).reduce(|| 0.0, f64::max)
}

/// Volume enclosed by a closed mesh (mm³): a sixth of the triangles' determinants, summed in the order of triangles.
fn volume(triangles: &[[u32; 3]], position: impl Fn(usize) -> Vector3<f64> + Sync) -> f64 {
    let Some(first) = triangles.first() else { return 0.0 };
    let base = position(first[0] as usize);
    let parts: Vec<f64> = triangles
        .par_chunks(1 << 14)
        .map(|chunk| {
            chunk
                .iter()
                .map(|t| {
                    let [a, b, c] = t.map(|v| position(v as usize) - base);
                    a.dot(&b.cross(&c)) / 6.0
                })
                .sum()
        })
        .collect();
    parts.iter().sum()
}
