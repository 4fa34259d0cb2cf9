use ivd_core::{Exec, Iteration};
use rayon::prelude::*;

use super::params::{RefineParams, Target};
use super::star::Fan;
use super::surface::{Limits, Refusal, Surface};
use super::{Refused, StoppedBy};
use crate::Error;

/// Share of the vertices that a pass may remove, the cheapest first. Smaller keeps closer to the order of a queue that is
/// renewed after each collapse, and takes more passes.
const PASS_SHARE: f64 = 0.5;

/// Name for the observer.
const TASK: &str = "collapse";

/// How a run of passes ended.
pub(super) struct Run {
    pub(super) stopped_by: StoppedBy,
    pub(super) refused: Refused,
    pub(super) passes: u32,
}

/// What a target means for a surface.
struct Goal {
    /// Vertices to remove at most.
    removals: usize,
    limits: Limits,
}

impl Goal {
    fn new(surface: &Surface, params: &RefineParams) -> Self {
        let vertices = surface.positions.len();
        let (removals, bound) = match params.target {
            Target::Level(level) => {
                let keep = (vertices as f64 * 0.25_f64.powi(i32::from(level))).round() as usize;
                (vertices - keep, f64::INFINITY)
            }
            Target::Ratio(ratio) => {
                let triangles = surface.triangles_left();
                let keep = (triangles as f64 * ratio).round() as usize;
                // Each collapse removes two triangles.
                ((triangles - keep) / 2, f64::INFINITY)
            }
            Target::MaxError(mm) => (usize::MAX, mm),
        };
        Self { removals, limits: Limits { turn_cosine: params.max_turn_degrees.to_radians().cos(), bound } }
    }
}

/// Collapses vertices pass by pass until the goal is reached or a pass finds nothing to do.
pub(super) fn run(surface: &mut Surface, params: &RefineParams, exec: &Exec) -> Result<Run, Error> {
    let goal = Goal::new(surface, params);
    let locks = (surface.positions.len() - surface.free.len()) as u64;
    exec.observer().begin(TASK, goal.removals.min(surface.free.len()) as u64);
    let (mut removed, mut passes) = (0, 0);
    let mut refused = Refused::default();
    // A pass that takes only the cheapest may find none of them possible; the next one then looks at all.
    let mut share = PASS_SHARE;
    while removed < goal.removals {
        exec.check_cancelled()?;
        let queue = queue(surface, params.shape_weight, share);
        let done = pass(surface, &queue, params.shape_weight, &goal.limits, goal.removals - removed);
        surface.tidy();
        passes += 1;
        removed += done.removed;
        refused = Refused { locks, ..done.refused };
        exec.observer().advance(TASK, done.removed as u64);
        exec.observer().iteration(Iteration {
            method: TASK,
            index: u64::from(passes),
            value: surface.triangles_left() as f64,
        });
        if done.removed == 0 && share >= 1.0 {
            break;
        }
        if done.removed * 64 <= surface.free.len() {
            share = 1.0;
        }
    }
    exec.observer().end(TASK);
    let stopped_by = if removed >= goal.removals { StoppedBy::Target } else { reason(&refused) };
    Ok(Run { stopped_by, refused, passes })
}

/// The most frequent reason; the first of equals.
fn reason(refused: &Refused) -> StoppedBy {
    let counts = [
        (refused.max_error, StoppedBy::MaxError),
        (refused.specks, StoppedBy::Specks),
        (refused.links, StoppedBy::Links),
        (refused.flips, StoppedBy::Flips),
        (refused.locks, StoppedBy::Locks),
    ];
    let most = counts.iter().map(|c| c.0).max().unwrap_or(0);
    counts.iter().find(|c| c.0 == most).map_or(StoppedBy::Locks, |c| c.1)
}

/// The free vertices in the order of their cheapest collapse, ties by index: the cheapest `share` of them, as the bits
/// of the cost above the index.
fn queue(surface: &Surface, shape_weight: f64, share: f64) -> Vec<u64> {
    let mut queue: Vec<u64> = surface
        .free
        .par_iter()
        .map(|&v| {
            let least = surface
                .stars
                .of(v as usize)
                .iter()
                .map(|&t| surface.cost(v, after(&surface.triangles[t as usize], v), shape_weight))
                .fold(f32::INFINITY, f32::min);
            // Costs are not negative: their bits sort like their values.
            u64::from(least.to_bits()) << 32 | u64::from(v)
        })
        .collect();
    let take = ((queue.len() as f64 * share).ceil() as usize).clamp(queue.len().min(64), queue.len());
    if take < queue.len() {
        queue.select_nth_unstable(take);
        queue.truncate(take);
    }
    queue.par_sort_unstable();
    queue
}

/// Corner that follows vertex `v` in a triangle: in a closed fan, each neighbour follows once.
#[inline]
fn after(triangle: &[u32; 3], v: u32) -> u32 {
    let [a, b, c] = *triangle;
    if a == v {
        b
    } else if b == v {
        c
    } else {
        a
    }
}

#[derive(Default)]
struct Done {
    removed: usize,
    refused: Refused,
}

/// Collapses the queued vertices in order, at most `most` of them. A vertex whose best target is refused tries the
/// others that cost no more than the last vertex of the queue.
fn pass(surface: &mut Surface, queue: &[u64], shape_weight: f64, limits: &Limits, most: usize) -> Done {
    let dearest = queue.last().map_or(0.0, |last| f32::from_bits((last >> 32) as u32));
    let mut done = Done::default();
    let mut fan = Fan::new();
    let mut targets: Vec<(f32, u32)> = Vec::new();
    for entry in queue {
        if done.removed >= most {
            break;
        }
        let v = *entry as u32;
        if surface.is_target(v) {
            continue;
        }
        if !fan.read(v, &surface.stars, &surface.triangles) {
            done.refused.links += 1;
            continue;
        }
        targets.clear();
        targets.extend(fan.ring().iter().map(|&r| (surface.cost(v, r, shape_weight), r)));
        targets.retain(|t| t.0 <= dearest);
        targets.sort_unstable_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
        let mut last = None;
        for &(_, y) in &targets {
            match surface.collapse(v, y, &mut fan, limits) {
                Ok(()) => {
                    last = None;
                    done.removed += 1;
                    break;
                }
                Err(refusal) => last = Some(refusal),
            }
        }
        match last {
            None => {}
            Some(Refusal::Link) => done.refused.links += 1,
            Some(Refusal::Flip) => done.refused.flips += 1,
            Some(Refusal::Speck) => done.refused.specks += 1,
            Some(Refusal::Bound) => done.refused.max_error += 1,
        }
    }
    done
}
