use ivd_core::{Cancel, Exec, Iteration};
use rayon::prelude::*;

use super::blocks::Blocks;
use super::deviation::Deviation;
use super::half_edge::{Limits, collapse};
use super::mean::Seen;
use super::params::RefineParams;
use super::queue::Queue;
use super::refusal::{Refusal, Refused, StopReason};
use super::report::Outcome;
use super::small_parts::SmallParts;
use super::star::Fan;
use super::surface::Surface;
use crate::Error;

/// Share of the vertices that a pass may remove, the cheapest first. Smaller keeps closer to the order of a queue that is
/// renewed after each collapse, and takes more passes.
const PASS_SHARE: f64 = 0.5;

/// Bound that a collapse may lead to, in roots of the largest cost of its pass. Costs are means, and say little of the one
/// triangle that ends far off: at 8 the largest errors of two scans are a third larger to more than twice as large, and
/// means hardly smaller; below 3 passes become many.
const BOUND_ROOTS: f64 = 3.0;

/// A pass over no more vertices than this doesn't divide the surface into blocks.
const ALONE: usize = 2048;

/// A queue that was cut short, and of which no more than a 64th could go, is this many times as long in the next pass: the
/// vertices left out aren't kept waiting by cheaper ones that can't go.
const WIDEN: usize = 4;

/// Vertices between two looks at whether to stop: well under a millisecond.
const LOOKS: usize = 256;

/// Name for the observer.
const TASK: &str = "collapse";

/// How a run of passes ended.
pub(super) struct Run {
    pub(super) stopped_by: StopReason,
    pub(super) refused: Refused,
    pub(super) passes: u32,
}

impl Run {
    /// What came of it, in the input's order of vertices and triangles.
    pub(super) fn outcome(&self, surface: &Surface, seen: Seen) -> Outcome {
        let mut kept: Vec<u32> =
            surface.numbers.iter().enumerate().filter(|v| surface.is_left(v.0)).map(|v| *v.1).collect();
        kept.sort_unstable();
        let mut order: Vec<u32> = (0..surface.triangles.len() as u32).collect();
        order.sort_unstable_by_key(|&t| surface.triangles.number(t));
        let corners = |t: &u32| surface.triangles.corners(*t).map(|v| surface.numbers[v as usize]);
        Outcome {
            kept,
            triangles: order.iter().map(corners).collect(),
            max_error_mm: surface.max_bound(),
            seen,
            stopped_by: self.stopped_by,
            refused: self.refused,
            passes: self.passes,
        }
    }
}

/// What a target means for a surface.
struct Goal {
    /// Vertices to remove at most.
    removals: usize,
    /// Largest bound allowed (mm).
    bound: f64,
}

impl Goal {
    fn new(surface: &Surface, params: &RefineParams) -> Self {
        let (removals, bound) =
            params.target.get().removals(surface.positions.len(), surface.triangles.len());
        Self { removals, bound }
    }
}

/// Collapses vertices pass by pass until the goal is reached or a pass over all of them finds nothing to do.
///
/// - `small`: parts whose share the others don't make up for.
pub(super) fn run(
    surface: &mut Surface,
    params: &RefineParams,
    mut small: Option<SmallParts>,
    exec: &Exec,
) -> Result<Run, Error> {
    let goal = Goal::new(surface, params);
    let area = surface.areas.iter().map(|&a| f64::from(a)).sum::<f64>() / 3.0;
    exec.observer().begin(TASK, goal.removals.min(surface.free.len()) as u64);
    let (mut removed, mut passes) = (0, 0);
    let mut refused = surface.kept;
    let (mut scope, mut width) = (Scope::Cheap, 1_usize);
    while removed < goal.removals {
        exec.check_cancelled()?;
        let most = goal.removals - removed;
        let shape_weight = params.shape_weight as f32;
        let longest = most.max(ALONE).saturating_mul(width);
        let mut queue = match scope {
            Scope::Cheap => Queue::new(surface, shape_weight, PASS_SHARE, longest),
            Scope::Worthwhile => Queue::new(surface, shape_weight, 1.0, longest),
            Scope::All => {
                surface.free.par_iter().for_each(|&v| surface.forget(v));
                Queue::all(surface, shape_weight)
            }
        };
        if let Some(small) = &small {
            small.shorten(&mut queue.entries, |entry| surface.numbers[entry as u32 as usize]);
        }
        // Blocks don't know of one another how many they remove: each may remove all that it has, or there is one.
        let tried = queue.entries.len();
        let divided = tried > ALONE && tried <= most;
        let blocks = if divided { Blocks::new(surface, area, passes) } else { Blocks::one(surface) };
        let bound = goal.bound.min(BOUND_ROOTS * f64::from(queue.dearest).sqrt());
        let limits = Limits::new(params, bound);
        let cancel = &exec.cancel;
        let pass =
            Pass { surface, blocks, shape_weight, dearest: queue.dearest, asked: goal.bound, limits, cancel };
        let done = pass.run(queue.entries, most, scope == Scope::All);
        // A pass that was stopped is half done: its surface is dropped.
        exec.check_cancelled()?;
        surface.tidy(&done.collapsed);
        let count = done.collapsed.len();
        passes += 1;
        removed += count;
        refused = surface.kept + done.refused;
        if let Some(small) = &mut small {
            let Surface { numbers, free, .. } = &mut *surface;
            small.count(done.collapsed.iter().map(|&v| numbers[v as usize]));
            free.retain(|&v| small.allow(numbers[v as usize]));
        }
        exec.observer().advance(TASK, count as u64);
        exec.observer().iteration(Iteration {
            method: TASK,
            index: u64::from(passes),
            value: surface.triangles.len() as f64,
        });
        width = if queue.cut && count * 64 <= tried { width.saturating_mul(WIDEN) } else { 1 };
        scope = match scope {
            Scope::All if count == 0 => break,
            Scope::Worthwhile if count == 0 && !queue.cut => Scope::All,
            Scope::Cheap if count * 64 > surface.free.len() => Scope::Cheap,
            _ => Scope::Worthwhile,
        };
    }
    exec.observer().end(TASK);
    let stopped_by = if removed >= goal.removals { StopReason::Target } else { refused.reason() };
    Ok(Run { stopped_by, refused, passes })
}

/// Which vertices a pass tries.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Scope {
    /// The cheapest of those that are worth a try.
    Cheap,
    /// All but those that were refused and round which nothing has changed; the cheapest of them where these are many
    /// more than may still be removed.
    Worthwhile,
    /// All, wherever they lie and whatever they cost, onto any neighbour. If none of them can go, none can.
    All,
}

/// What a pass needs to know.
struct Pass<'a> {
    surface: &'a Surface,
    blocks: Blocks,
    shape_weight: f32,
    /// What a collapse may cost (mm²).
    dearest: f32,
    /// Bound that was asked for (mm); the limit of this pass may be less.
    asked: f64,
    limits: Limits,
    /// Stops the pass.
    cancel: &'a Cancel,
}

/// What came of a pass or of a block.
#[derive(Default)]
pub(super) struct Done {
    /// Vertices removed, in order.
    pub(super) collapsed: Vec<u32>,
    /// Entries that lie across a border of blocks.
    pub(super) across: Vec<u64>,
    pub(super) refused: Refused,
}

/// Room for the work on one vertex.
struct Desk {
    fan: Fan,
    deviation: Deviation,
    targets: Vec<(f32, u32)>,
}

impl Desk {
    fn new() -> Self {
        Self { fan: Fan::new(), deviation: Deviation::new(), targets: Vec::new() }
    }
}

impl Pass<'_> {
    /// Collapses the queued vertices, each block's in order of cost, at most `most` of them; with `everywhere` at last
    /// those that lie across borders. Where there are several blocks, the queue is no longer than `most`.
    fn run(&self, mut entries: Vec<u64>, most: usize, everywhere: bool) -> Done {
        let pieces = self.blocks.group(&mut entries);
        debug_assert!(pieces.len() < 2 || pieces.iter().map(|p| p.1.len()).sum::<usize>() <= most);
        let done: Vec<Done> = pieces
            .into_par_iter()
            .with_max_len(1)
            .map_init(Desk::new, |desk, (block, piece)| {
                piece.sort_unstable();
                self.in_order(piece, Some(block), most, desk)
            })
            .collect();
        let mut all = Done::default();
        for block in done {
            all.add(block);
        }
        if everywhere {
            let mut across = std::mem::take(&mut all.across);
            across.sort_unstable();
            all.add(self.in_order(&across, None, most - all.collapsed.len(), &mut Desk::new()));
        }
        all
    }

    /// Collapses the vertices of sorted entries, at most `most` of them, whose rings lie in `block`, if one is given.
    fn in_order(&self, entries: &[u64], block: Option<u16>, most: usize, desk: &mut Desk) -> Done {
        let mut done = Done::default();
        for (at, &entry) in entries.iter().enumerate() {
            let stopped = at % LOOKS == 0 && self.cancel.is_cancelled();
            if stopped || done.collapsed.len() >= most {
                break;
            }
            let v = entry as u32;
            if self.surface.is_target(v) {
                continue;
            }
            if !desk.fan.read(v, &self.surface.stars, &self.surface.triangles) {
                done.refused.links += 1;
                self.surface.put_off(v, f32::INFINITY);
            } else if block.is_some_and(|b| desk.fan.ring().iter().any(|&r| self.blocks.of(r) != b)) {
                done.across.push(entry);
            } else {
                match self.vertex(v, desk) {
                    Ok(()) => done.collapsed.push(v),
                    Err(Some(refusal)) => done.refused.count(refusal),
                    Err(None) => {}
                }
            }
        }
        done
    }

    /// Collapses one vertex, whose fan lies on the desk, onto the cheapest neighbour that can be; a neighbour that costs
    /// more than the pass may is left for another pass. Otherwise the last refusal, if it came to one.
    fn vertex(&self, v: u32, desk: &mut Desk) -> Result<(), Option<Refusal>> {
        let Desk { fan, deviation, targets } = desk;
        let from = &self.surface.positions[v as usize];
        fan.locate(&self.surface.positions);
        let cost = |(place, &r)| (self.surface.cost(v, &(place - from), self.shape_weight), r);
        targets.clear();
        let allowed = |pair: &(_, &u32)| self.surface.features.allow(v, *pair.1);
        targets.extend(fan.places().iter().zip(fan.ring()).filter(allowed).map(cost));
        let (mut refusal, mut later) = (None, f32::INFINITY);
        while let Some(at) = cheapest(targets) {
            let (cost, y) = targets.swap_remove(at);
            if cost > self.dearest {
                later = later.min(cost);
                break;
            }
            match collapse(self.surface, [v, y], fan, deviation, &self.limits) {
                Ok(()) => return Ok(()),
                Err(Refusal::Bound(bound)) if f64::from(bound) <= self.asked => {
                    later = later.min((bound / BOUND_ROOTS as f32).powi(2));
                }
                Err(e) => refusal = Some(e),
            }
        }
        self.surface.put_off(v, later);
        Err(refusal)
    }
}

/// Where the cheapest target stands; ties by index.
fn cheapest(targets: &[(f32, u32)]) -> Option<usize> {
    let less = |&a: &usize, &b: &usize| {
        let (a, b) = (targets[a], targets[b]);
        a.0.total_cmp(&b.0).then(a.1.cmp(&b.1))
    };
    (0..targets.len()).min_by(less)
}

impl Done {
    pub(super) fn add(&mut self, other: Self) {
        self.collapsed.extend(other.collapsed);
        self.across.extend(other.across);
        self.refused = self.refused + other.refused;
    }
}
