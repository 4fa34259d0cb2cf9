//! Loop subdivision backwards.
//!
//! A surface that was subdivided is taken back exactly ([`super::inverse`]). Marching cubes makes none such: there, level by
//! level, an independent set of vertices stays, the **even** ones, and each other one, **odd**, is pulled onto an even
//! neighbour by a legal half-edge collapse.
//!
//! In a subdivided surface an odd vertex is the middle of an edge: its six neighbours hold the edge's two ends opposite
//! each other, and the even vertices are those that are reached so from one of them. Even vertices are chosen the same
//! way wherever it can be: of an even vertex all neighbours are odd, and what lies opposite beyond an odd neighbour is
//! even, unless it is odd already. Where such walks meet, what is left undecided becomes even one by one. The set is
//! independent and maximal: every odd vertex has an even neighbour.

use std::collections::VecDeque;

use ivd_core::{Exec, Lattice};

use super::half_edge::Limits;
use super::inverse;
use super::locks::Locks;
use super::mean::Seen;
use super::measured::Draft;
use super::params::{RefineParams, Target};
use super::passes::Run;
use super::pull::{Rules, pull};
use super::refusal::{Refused, StopReason};
use super::report::Refined;
use super::star::Fan;
use super::surface::{self, Surface};
use crate::Error;

/// Levels at most where no level is asked for.
const LEVELS: usize = 32;
/// Passes over a level's odd vertices at most.
const PASSES: u32 = 16;

/// What a target means.
struct Goal {
    levels: usize,
    /// Triangles to keep at least.
    keep: usize,
    /// Bound on the error (mm).
    mm: f64,
}

impl Goal {
    fn new(lattice: &Lattice, target: Target) -> Self {
        let keep = |keep| Self { levels: LEVELS, keep, mm: f64::INFINITY };
        match target {
            Target::Level(level) => Self { levels: usize::from(level), keep: 0, mm: f64::INFINITY },
            Target::Ratio(ratio) => keep((lattice.triangles().len() as f64 * ratio).round() as usize),
            Target::Count(count) => keep(count),
            Target::MaxError(mm) => Self { levels: LEVELS, keep: 0, mm },
        }
    }

    /// Whether a surface of so many triangles has reached it at a level.
    fn is_reached(&self, level: usize, triangles: usize) -> bool {
        level >= self.levels || triangles <= self.keep.saturating_add(1)
    }
}

/// Refines a lattice by levels of an inverse Loop scheme.
///
/// As far as the surface is a subdivided one, it is taken back exactly; then comes the collapse of odd vertices onto even
/// ones. A share or a number of triangles ends it within a level. A level of which less than half the odd vertices could
/// go isn't counted as reached and is the last; what went is kept.
///
/// # Errors
/// [`ivd_core::Error::MemoryLimit`], [`ivd_core::Error::Cancelled`].
pub(super) fn loop_levels(
    lattice: &Lattice,
    params: &RefineParams,
    locks: Locks<'_>,
    exec: &Exec,
) -> Result<Refined, Error> {
    exec.check_memory("the surface to be refined", surface::bytes_for(lattice))?;
    exec.run(|| {
        let goal = Goal::new(lattice, params.target.get());
        if lattice.triangles().is_empty() {
            return Draft::same(lattice, StopReason::Target).finished(lattice, f64::INFINITY, exec);
        }
        let (exact, levels, error) = taken_back(lattice, &goal, locks, exec)?;
        if goal.is_reached(levels, exact.triangles.len()) {
            return exact.finished(lattice, error, exec);
        }
        pulled(lattice, &exact, levels, error, params, &goal, locks, exec)
    })
}

/// Takes back as many subdivisions as there are and as are asked for: what is left, how many, and the error (mm).
fn taken_back(
    lattice: &Lattice,
    goal: &Goal,
    locks: Locks<'_>,
    exec: &Exec,
) -> Result<(Draft, usize, f64), Error> {
    let positions = lattice.local_positions();
    let locked = locks.flags(lattice.keys().len());
    let (mut draft, mut levels, mut error) = (Draft::same(lattice, StopReason::Target), 0, 0.0);
    while !goal.is_reached(levels, draft.triangles.len()) && draft.triangles.len() / 4 >= goal.keep {
        let Ok(coarse) = inverse::coarser(&draft.triangles, &positions) else { break };
        exec.check_cancelled()?;
        let next = Draft::of(coarse.triangles, lattice, locks, levels as u32 + 1);
        if coarse.odd.iter().any(|&v| locked[v as usize]) {
            break;
        }
        if goal.mm.is_finite() {
            let Some(refined) = next.clone().measured(lattice, f64::INFINITY, goal.mm, exec)? else { break };
            error = refined.max_error_mm;
        } else {
            error = f64::INFINITY;
        }
        (draft, levels) = (next, levels + 1);
    }
    Ok((draft, levels, error))
}

/// Pulls odd vertices onto even ones, level by level, from what was taken back on.
#[expect(clippy::too_many_arguments, reason = "what was taken back, and what was asked for")]
fn pulled(
    lattice: &Lattice,
    exact: &Draft,
    mut level: usize,
    error: f64,
    params: &RefineParams,
    goal: &Goal,
    locks: Locks<'_>,
    exec: &Exec,
) -> Result<Refined, Error> {
    let base = lattice.subset(&exact.kept, exact.triangles.clone())?;
    let locked: Vec<u32> =
        locks.vertices.iter().filter_map(|v| exact.kept.binary_search(v).ok()).map(|v| v as u32).collect();
    let mut surface = Surface::new(&base, Locks { vertices: &locked }, params.feature_degrees);
    let bound = if goal.mm.is_finite() { goal.mm - error } else { f64::INFINITY };
    let rules = Rules { limits: Limits::new(params, bound), shape_weight: params.shape_weight as f32 };
    let mut run = Run { stopped_by: StopReason::Target, refused: Refused::default(), passes: exact.passes };
    while !goal.is_reached(level, surface.triangles.len()) {
        let done = one_level(&mut surface, &rules, goal.keep, exec)?;
        run.passes += done.passes;
        run.refused = done.refused + surface.kept;
        level += 1;
        if done.removed * 2 < done.odd && !goal.is_reached(0, surface.triangles.len()) || done.odd == 0 {
            run.stopped_by = run.refused.reason();
            break;
        }
    }
    let outcome = run.outcome(&surface, Seen::default());
    let input = |v: u32| exact.kept[v as usize];
    let draft = Draft {
        kept: outcome.kept.into_iter().map(input).collect(),
        triangles: outcome.triangles.into_iter().map(|t| t.map(input)).collect(),
        stopped_by: outcome.stopped_by,
        refused: outcome.refused,
        passes: outcome.passes,
    };
    draft.finished(lattice, error + outcome.max_error_mm, exec)
}

/// What came of a level.
#[derive(Default)]
struct Level {
    /// Odd vertices that were free to go.
    odd: usize,
    removed: usize,
    refused: Refused,
    passes: u32,
}

fn one_level(surface: &mut Surface, rules: &Rules, keep: usize, exec: &Exec) -> Result<Level, Error> {
    exec.check_cancelled()?;
    let even = evens(surface);
    let is_odd = |v: &u32| !even[*v as usize];
    let mut level = Level { odd: surface.free.iter().filter(|v| is_odd(v)).count(), ..Level::default() };
    while level.passes < PASSES {
        let most = surface.triangles.len().saturating_sub(keep) / 2;
        let sources: Vec<u32> = surface.free.iter().copied().filter(|v| is_odd(v)).collect();
        let done = pull(surface, &sources, |_, y| even[y as usize], rules, most, exec)?;
        level.passes += 1;
        level.removed += done.count;
        level.refused = done.refused;
        if done.count == 0 || done.count == most {
            break;
        }
    }
    Ok(level)
}

/// Which vertices of a surface are even: an independent set, in the structure of a subdivision as far as that goes.
fn evens(surface: &Surface) -> Vec<bool> {
    let n = surface.positions.len();
    let (mut even, mut decided) = (vec![false; n], vec![false; n]);
    let (mut fan, mut queue) = (Fan::new(), VecDeque::new());
    for seed in seeds(surface) {
        if !decided[seed as usize] {
            queue.push_back(seed);
        }
        while let Some(v) = queue.pop_front() {
            if std::mem::replace(&mut decided[v as usize], true) {
                continue;
            }
            even[v as usize] = true;
            let corners = surface.stars.of(v as usize).iter().flat_map(|&t| surface.triangles.corners(t));
            let mut odd: Vec<u32> = corners.filter(|&c| c != v).collect();
            odd.sort_unstable();
            odd.dedup();
            for &o in &odd {
                decided[o as usize] = true;
            }
            for o in odd {
                if fan.read(o, &surface.stars, &surface.triangles) && fan.ring().len().is_multiple_of(2) {
                    fan.turn_to(v);
                    let opposite = fan.ring()[fan.ring().len() / 2];
                    if !decided[opposite as usize] {
                        queue.push_back(opposite);
                    }
                }
            }
        }
    }
    even
}

/// Vertices in the order in which walks begin: those that can't go, those that no subdivision makes odd, and the others.
fn seeds(surface: &Surface) -> Vec<u32> {
    let free: Vec<bool> = {
        let mut free = vec![false; surface.positions.len()];
        for &v in &surface.free {
            free[v as usize] = true;
        }
        free
    };
    let rank = |v: u32| match surface.stars.of(v as usize).len() {
        0 => None,
        _ if !free[v as usize] => Some(0),
        6 => Some(2),
        _ => Some(1),
    };
    let mut seeds: Vec<(u8, u32)> =
        (0..surface.positions.len() as u32).filter_map(|v| Some((rank(v)?, v))).collect();
    seeds.sort_unstable();
    seeds.into_iter().map(|s| s.1).collect()
}
