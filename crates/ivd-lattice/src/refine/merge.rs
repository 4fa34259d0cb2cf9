//! Vertex clustering: space is cut into cubes, and of the vertices in a cube one stays (Rossignac & Borrel 1993).
//!
//! The one that stays is a **member**: of all vertices of the cube that which lies best for the planes of all (least
//! quadric error, Garland & Heckbert 1997). The original puts a new vertex there, which would have no place on the grid.
//!
//! With `allow_topology` that is all: each triangle follows its corners, and those that become an edge or a point go. So
//! do triangles that double back: of several on the same three vertices, those that run in opposite directions cancel,
//! as the sheets of a thin wall do that met, and of those left over one stays. Whatever is smaller than a cube vanishes,
//! and the result need be no manifold.
//!
//! Without it, the vertices of a cube move onto their member by legal half-edge collapses alone, and only those that
//! the surface joins within the cube: each such patch has a member of its own. Cubes begin as small as the triangles and
//! grow by half their side, each time over what is left, until the target is met.

use ivd_core::{Exec, Lattice, sets};
use nalgebra::Vector3;
use rayon::prelude::*;

use super::half_edge::Limits;
use super::locks::Locks;
use super::mean::Seen;
use super::measured::Draft;
use super::params::{RefineParams, Target};
use super::passes::Run;
use super::pull::{Rules, pull};
use super::quadric::{Quadric, plane_root};
use super::refusal::{Refused, StopReason};
use super::report::Refined;
use super::surface::{self, Surface};
use crate::Error;
use crate::figures::stars::Stars;

type Point = Vector3<f64>;

/// How much cubes grow from one size to the next.
const GROWTH: f64 = 1.5;
/// Sizes of cubes tried in the search for the one that meets the target.
const TRIES: usize = 18;
/// Sizes of cubes nearer to each other than this are as good as one.
const CLOSE: f64 = 1.02;
/// Cubes along an axis at most.
const MOST: f64 = (1 << 20) as f64;

/// What a target means.
#[derive(Debug, Clone, Copy)]
enum Goal {
    /// Vertices to keep at most.
    Vertices(usize),
    /// Triangles to keep at most.
    Triangles(usize),
    /// Largest error (mm).
    Error(f64),
}

impl Goal {
    fn new(lattice: &Lattice, target: Target) -> Self {
        let share = |n: usize, share: f64| (n as f64 * share).round() as usize;
        match target {
            Target::Level(level) => {
                Self::Vertices(share(lattice.keys().len(), 0.25_f64.powi(i32::from(level))))
            }
            Target::Ratio(ratio) => Self::Triangles(share(lattice.triangles().len(), ratio)),
            Target::Count(count) => Self::Triangles(count),
            Target::MaxError(mm) => Self::Error(mm),
        }
    }

    /// Collapses that it takes from a surface of so many vertices and triangles.
    fn removals(self, vertices: usize, triangles: usize) -> usize {
        match self {
            Self::Vertices(keep) => vertices.saturating_sub(keep),
            Self::Triangles(keep) => triangles.saturating_sub(keep) / 2,
            Self::Error(_) => usize::MAX,
        }
    }

    fn is_met(self, draft: &Draft) -> bool {
        match self {
            Self::Vertices(keep) => draft.kept.len() <= keep,
            Self::Triangles(keep) => draft.triangles.len() <= keep,
            Self::Error(_) => false,
        }
    }
}

/// Refines a lattice by vertex clustering; see the module.
///
/// With `allow_topology`, the side of the cubes is found by bisection: the least that keeps no more than asked for, or the
/// largest within the error asked for. Without, a share, number or level is met exactly where nothing is in the way.
/// Locked vertices stay where they are, and others of their cube move onto one of them.
///
/// # Errors
/// [`ivd_core::Error::MemoryLimit`], [`ivd_core::Error::Cancelled`].
pub(super) fn merge(
    lattice: &Lattice,
    params: &RefineParams,
    locks: Locks<'_>,
    exec: &Exec,
) -> Result<Refined, Error> {
    let bytes = if params.allow_topology { Clusters::bytes(lattice) } else { surface::bytes_for(lattice) };
    exec.check_memory("the vertices to be clustered", bytes)?;
    exec.run(|| {
        let goal = Goal::new(lattice, params.target.get());
        let same = Draft::same(lattice, StopReason::Target);
        if lattice.triangles().is_empty() || goal.is_met(&same) {
            return same.finished(lattice, f64::INFINITY, exec);
        }
        if params.allow_topology {
            Clusters::new(lattice, locks).search(goal, exec)
        } else {
            collapsed(lattice, params, goal, locks, exec)
        }
    })
}

/// The vertices of a lattice, to be clustered.
struct Clusters<'a> {
    lattice: &'a Lattice,
    locks: Locks<'a>,
    positions: Vec<Point>,
    quadrics: Vec<Quadric>,
    /// Vertices that a triangle names, ascending.
    used: Vec<u32>,
    locked: Vec<bool>,
}

impl<'a> Clusters<'a> {
    fn new(lattice: &'a Lattice, locks: Locks<'a>) -> Self {
        let positions = lattice.local_positions();
        let stars = Stars::new(positions.len(), lattice.triangles());
        let root = |t: &[u32; 3]| plane_root(t.map(|v| positions[v as usize]));
        let roots: Vec<_> = lattice.triangles().par_iter().map(root).collect();
        let quadric = |v| Quadric::of_star(stars.of(v).iter().map(|&t| roots[t as usize]));
        let quadrics = (0..positions.len()).into_par_iter().map(quadric).collect();
        let used = (0..positions.len() as u32).filter(|&v| !stars.of(v as usize).is_empty()).collect();
        let locked = locks.flags(positions.len());
        Self { lattice, locks, positions, quadrics, used, locked }
    }

    /// Bytes of them, and of the cubes and triangles of one size beside the best two drafts so far.
    fn bytes(lattice: &Lattice) -> u64 {
        let vertex = size_of::<Point>() + size_of::<Quadric>() + size_of::<u32>() + size_of::<bool>();
        let cubes = size_of::<(u64, u32)>() + size_of::<&[(u64, u32)]>() + 3 * size_of::<u32>();
        let doubles = size_of::<([u32; 3], bool, u32)>() + size_of::<u32>();
        let triangle = doubles + 3 * size_of::<[u32; 3]>();
        let drafts = 2 * size_of::<u32>();
        (vertex + cubes + drafts) as u64 * lattice.keys().len() as u64
            + triangle as u64 * lattice.triangles().len() as u64
    }

    /// Bisects the side of the cubes.
    fn search(&self, goal: Goal, exec: &Exec) -> Result<Refined, Error> {
        let (low, high) = extent(self.used.iter().map(|&v| &self.positions[v as usize]));
        let (mut low_side, mut high_side) =
            (0.25 * mean_side(self.lattice, &self.positions), 2.0 * (high - low).norm());
        let (mut best, mut short, mut within): (Option<Draft>, Option<Draft>, Option<Refined>) =
            (None, None, None);
        for passes in 1..=TRIES {
            if high_side <= low_side * CLOSE {
                break;
            }
            exec.check_cancelled()?;
            let side = (low_side * high_side).sqrt();
            let draft = Draft::of(self.triangles(low, side), self.lattice, self.locks, passes as u32);
            // Where nothing is left, cubes are too large for any target.
            let too_large = draft.triangles.is_empty();
            let enough = match goal {
                _ if too_large => true,
                Goal::Error(mm) => {
                    let draft = Draft { stopped_by: StopReason::MaxError, ..draft };
                    match draft.measured(self.lattice, f64::INFINITY, mm, exec)? {
                        Some(refined) => {
                            within = Some(refined);
                            false
                        }
                        None => true,
                    }
                }
                _ if goal.is_met(&draft) => {
                    best = Some(draft);
                    true
                }
                _ => {
                    short = Some(Draft { stopped_by: StopReason::Vanishing, ..draft });
                    false
                }
            };
            *if enough { &mut high_side } else { &mut low_side } = side;
        }
        if let Some(refined) = within {
            return Ok(refined);
        }
        let stopped_by =
            if matches!(goal, Goal::Error(_)) { StopReason::MaxError } else { StopReason::Vanishing };
        let draft = best.or(short).unwrap_or_else(|| Draft::same(self.lattice, stopped_by));
        draft.finished(self.lattice, f64::INFINITY, exec)
    }

    /// The triangles left between the members of cubes.
    fn triangles(&self, low: Point, side: f64) -> Vec<[u32; 3]> {
        let labels =
            self.used.par_iter().map(|&v| (cube(&self.positions[v as usize], low, side), v)).collect();
        let planes = |v: u32| self.quadrics[v as usize];
        let mut to = vec![0; self.positions.len()];
        for (v, member) in members(labels, &self.positions, planes, |v| self.locked[v as usize]) {
            to[v as usize] = member;
        }
        // Locked vertices stay, also beside the member.
        for &v in self.locks.vertices {
            to[v as usize] = v;
        }
        let moved: Vec<_> = self.lattice.triangles().par_iter().map(|t| t.map(|v| to[v as usize])).collect();
        without_doubles(&moved)
    }
}

/// The label of the cube that a point is in.
fn cube(p: &Point, low: Point, side: f64) -> u64 {
    let [x, y, z] = ((p - low) / side).map(|c| c.clamp(0.0, MOST) as u64).into();
    x | y << 21 | z << 42
}

/// For each vertex the member that its cluster, the vertices of one label, keeps: the one that costs least, ties by number;
/// one that is locked before all others.
fn members(
    mut labels: Vec<(u64, u32)>,
    positions: &[Point],
    planes: impl Fn(u32) -> Quadric + Sync,
    locked: impl Fn(u32) -> bool + Sync,
) -> Vec<(u32, u32)> {
    labels.par_sort_unstable();
    let clusters: Vec<&[(u64, u32)]> = labels.chunk_by(|a, b| a.0 == b.0).collect();
    clusters
        .into_par_iter()
        .flat_map_iter(|cluster| {
            let first = cluster[0].1;
            let offset = |v: u32| (positions[v as usize] - positions[first as usize]).cast();
            let mut sum = Quadric::default();
            for &(_, v) in cluster {
                sum.merge(&planes(v), &offset(v));
            }
            let cost = |v: u32| (!locked(v), sum.mean_square(&offset(v)));
            let member = cluster
                .iter()
                .map(|&(_, v)| v)
                .min_by(|&a, &b| {
                    let (a, b) = (cost(a), cost(b));
                    a.0.cmp(&b.0).then(a.1.total_cmp(&b.1))
                })
                .unwrap_or(first);
            cluster.iter().map(move |&(_, v)| (v, member))
        })
        .collect()
}

/// Triangles without those that have no area, and of those on the same vertices one, or none where as many run one way as
/// the other. The order stays.
fn without_doubles(triangles: &[[u32; 3]]) -> Vec<[u32; 3]> {
    let mut sides: Vec<([u32; 3], bool, u32)> = triangles
        .par_iter()
        .enumerate()
        .filter(|(_, [a, b, c])| a != b && b != c && c != a)
        .map(|(i, &t)| {
            let mut sorted = t;
            sorted.sort_unstable();
            let at = t.iter().position(|&v| v == sorted[0]).expect("the least is one of them");
            (sorted, t[(at + 1) % 3] == sorted[1], i as u32)
        })
        .collect();
    sides.par_sort_unstable();
    let mut kept: Vec<u32> = Vec::with_capacity(sides.len());
    for same in sides.chunk_by(|a, b| a.0 == b.0) {
        let upward = same.iter().filter(|s| s.1).count();
        if 2 * upward != same.len() {
            let way = 2 * upward > same.len();
            kept.extend(same.iter().find(|s| s.1 == way).map(|s| s.2));
        }
    }
    kept.sort_unstable();
    kept.into_iter().map(|i| triangles[i as usize]).collect()
}

/// Low and high corner of the box round points.
fn extent<'a>(points: impl Iterator<Item = &'a Point>) -> (Point, Point) {
    let far = Point::repeat(f64::INFINITY);
    points.fold((far, -far), |(low, high), p| (low.inf(p), high.sup(p)))
}

/// Mean length (mm) of a triangle's side.
fn mean_side(lattice: &Lattice, positions: &[Point]) -> f64 {
    let length = |&[a, b, c]: &[u32; 3]| {
        let [a, b, c] = [a, b, c].map(|v| positions[v as usize]);
        (b - a).norm() + (c - b).norm() + (a - c).norm()
    };
    lattice.triangles().iter().map(length).sum::<f64>() / (3.0 * lattice.triangles().len().max(1) as f64)
}

/// Clusters by legal collapses, with cubes that grow.
fn collapsed(
    lattice: &Lattice,
    params: &RefineParams,
    goal: Goal,
    locks: Locks<'_>,
    exec: &Exec,
) -> Result<Refined, Error> {
    let mut surface = Surface::new(lattice, locks, params.feature_degrees);
    let bound = if let Goal::Error(mm) = goal { mm } else { f64::INFINITY };
    let rules = Rules { limits: Limits::new(params, bound), shape_weight: params.shape_weight as f32 };
    let (low, high) = extent(surface.positions.iter());
    let largest = 2.0 * (high - low).norm();
    let mut side = mean_side(lattice, &lattice.local_positions());
    let mut left = goal.removals(lattice.keys().len(), lattice.triangles().len());
    let mut run = Run { stopped_by: StopReason::Target, refused: Refused::default(), passes: 0 };
    while left > 0 {
        // A lattice all of whose vertices lie at one place has no size to grow by.
        if !(side > 0.0 && side <= largest) {
            run.stopped_by = run.refused.reason();
            break;
        }
        let refused = one_size(&mut surface, side, low, &rules, &mut left, &mut run.passes, exec)?;
        run.refused = refused + surface.kept;
        side *= GROWTH;
    }
    let outcome = run.outcome(&surface, Seen::default());
    let (stopped_by, refused, passes) = (outcome.stopped_by, outcome.refused, outcome.passes);
    let draft = Draft { kept: outcome.kept, triangles: outcome.triangles, stopped_by, refused, passes };
    draft.finished(lattice, outcome.max_error_mm, exec)
}

/// Pulls the vertices of each patch onto its member, round by round, as each comes beside it.
fn one_size(
    surface: &mut Surface,
    side: f64,
    low: Point,
    rules: &Rules,
    left: &mut usize,
    passes: &mut u32,
    exec: &Exec,
) -> Result<Refused, Error> {
    exec.check_cancelled()?;
    let free = flags(surface);
    let patches = patches(surface, low, side);
    let mut to: Vec<u32> = (0..surface.positions.len() as u32).collect();
    let planes = |v: u32| *surface.quadric(v);
    for (v, member) in members(patches, &surface.positions, planes, |v| !free[v as usize]) {
        to[v as usize] = member;
    }
    let mut refused = Refused::default();
    while *left > 0 {
        let sources: Vec<u32> = surface.free.iter().copied().filter(|&v| to[v as usize] != v).collect();
        let done = pull(surface, &sources, |u, y| to[u as usize] == y, rules, *left, exec)?;
        *passes += 1;
        *left = left.saturating_sub(done.count);
        refused = done.refused;
        if done.count == 0 {
            break;
        }
    }
    Ok(refused)
}

fn flags(surface: &Surface) -> Vec<bool> {
    let mut free = vec![false; surface.positions.len()];
    for &v in &surface.free {
        free[v as usize] = true;
    }
    free
}

/// The vertices left, each with a label that it shares with those that edges within its cube join it to.
fn patches(surface: &Surface, low: Point, side: f64) -> Vec<(u64, u32)> {
    let n = surface.positions.len();
    let cubes: Vec<u64> = surface.positions.par_iter().map(|p| cube(p, low, side)).collect();
    let mut roots = sets::singles(n);
    for t in 0..surface.triangles.len() as u32 {
        let [a, b, c] = surface.triangles.corners(t);
        for (u, v) in [(a, b), (b, c), (c, a)] {
            if cubes[u as usize] == cubes[v as usize] {
                sets::join(&mut roots, u, v);
            }
        }
    }
    sets::flatten(&mut roots);
    let left = (0..n).filter(|&v| surface.is_left(v));
    left.map(|v| (u64::from(roots[v]), v as u32)).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn triangles_that_double_back_go_and_one_of_a_stack_stays() {
        let [a, b, c, d, e] = [[0, 1, 2], [1, 2, 0], [2, 1, 0], [3, 4, 5], [3, 5, 4]];
        assert_eq!(without_doubles(&[d, a, [6, 6, 7], e]), vec![a]);
        assert_eq!(without_doubles(&[a, b, [7, 8, 9], c]), vec![a, [7, 8, 9]]);
        assert_eq!(without_doubles(&[c, a, b, [7, 8, 9]]), vec![a, [7, 8, 9]]);
    }

    #[test]
    fn a_cluster_keeps_the_member_that_lies_best_and_a_locked_one_before_all() {
        // A corner of a box: three planes, and the vertex in which they meet lies on all of them.
        let places = [[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]].map(Point::from);
        let roots = [[0, 1, 2], [0, 2, 3], [0, 3, 1]].map(|t| plane_root(t.map(|v: usize| places[v])));
        let planes = |v: u32| Quadric::of_star(roots.iter().copied().filter(|_| v == 0));
        let labels: Vec<_> = [3, 1, 0, 2].map(|v| (7, v)).into();
        let found = members(labels.clone(), &places, planes, |_| false);
        assert_eq!(found, [(0, 0), (1, 0), (2, 0), (3, 0)]);
        assert!(members(labels, &places, planes, |v| v == 2).iter().all(|m| m.1 == 2));
    }
}
