//! Cuts of a tree: which merges are undone, and the labels of what is left joined.

use std::cmp::Reverse;
use std::collections::BinaryHeap;

use ivd_core::op::check_fields;
use ivd_core::{
    Class, Error, Exec, Grid, Labels, LeafMeans, Linkage, Merged, NO_DATA, ParamError, SpillVec, Tree,
    parallel, sets,
};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::frame;
use crate::moments::Moments;
use crate::{Segmentation, classes};

/// Most classes: a label has 16 bits, and 0 is no data.
const MOST_CLASSES: usize = u16::MAX as usize;
/// Voxels or leaves that one task looks at.
const CHUNK: usize = 1 << 16;
/// The thesis draws its tree as the levels 0…4.
const LEVELS: u32 = 5;

/// Which merges matter most.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Ranking {
    /// Those that join two parts that are both large and far apart. For single linkage: the height times the voxels of the
    /// smaller part, which is the area under its life in the tree. Ward's heights have the sizes in them: the height.
    #[default]
    Persistence,
    /// The highest. For single linkage a single voxel unlike its neighbours comes first.
    Height,
    /// Those with the most voxels in the smaller part.
    Area,
}

/// How a tree is cut.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default)]
pub struct CutParams {
    /// Number of classes; fewer where the tree has fewer leaves.
    #[schemars(range(min = 1, max = 65535), extend("x-unit" = "1", "x-knob" = "accuracy"))]
    pub k: usize,
    /// Cut at a height instead of a number of classes: all merges above it are undone. By Ward's criterion in squares of real units.
    #[schemars(range(min = 0.0), extend("x-unit" = "real units"))]
    pub height: Option<f64>,
    /// Cut at a level instead of a number of classes. The levels are those of the thesis (figure 4.2), which starts from many parts
    /// and ends with two: 32, 16, 8, 4 and 2 classes.
    #[schemars(range(min = 0, max = 4), extend("x-unit" = "1"))]
    pub level: Option<u32>,
    /// Which merges a number of classes undoes first. A cut by height undoes all above the height.
    pub ranking: Ranking,
    /// Fewest voxels of a part, ≥ 1: merges with a smaller part on one side are never undone, so specks stay with their
    /// neighbour. No key of a scene, where [`TidyParams`](crate::TidyParams) say what becomes of small parts.
    #[serde(skip_serializing)]
    #[schemars(skip)]
    pub least_part: u64,
}

impl Default for CutParams {
    fn default() -> Self {
        Self { k: 4, height: None, level: None, ranking: Ranking::Persistence, least_part: 1 }
    }
}

impl CutParams {
    /// # Errors
    /// [`ParamError`] names the field that is out of its domain.
    pub fn check(&self) -> Result<(), ParamError> {
        check_fields(self)?;
        self.check_together()
    }

    pub(crate) fn check_together(&self) -> Result<(), ParamError> {
        let given = match (self.height, self.level) {
            (Some(_), Some(level)) => {
                let problem = format!("{level} and a height, which both say where the tree is cut");
                return Err(ParamError::new("level", problem, "give one of them"));
            }
            (Some(_), None) => Some("height"),
            (None, Some(_)) => Some("level"),
            (None, None) => None,
        };
        if let Some(given) = given.filter(|_| self.k != Self::default().k) {
            let problem = format!("{} classes and a {given}, which both say where the tree is cut", self.k);
            return Err(ParamError::new("k", problem, "give one of them"));
        }
        if self.least_part == 0 {
            return Err(ParamError::new("least_part", "0 voxels", "use 1 or more"));
        }
        Ok(())
    }

    fn classes(&self) -> Option<usize> {
        match (self.height, self.level) {
            (Some(_), _) => None,
            (None, Some(level)) => Some(1 << (LEVELS - level)),
            (None, None) => Some(self.k),
        }
    }
}

/// Cuts a tree into connected classes, without the volume that it was grown from. O(L α(L) + N).
///
/// A cut undoes merges: single edges between leaves, wherever they lie in the tree. A merge that isn't undone keeps its two
/// leaves in one class, so what is left out by a cut stays with the neighbour that it joined. The merges are undone in one
/// order (by [`CutParams::ranking`]; the later of equal ones first), so cuts of a tree with the same ranking and `least_part` nest.
/// Parts that touch nowhere are joined by merges too, and a cut may leave them joined.
///
/// Labels are 1…K in the order of the class means; means, spreads and counts come from the leaves.
/// [`Segmentation::objective`] is the classes' inertia, and [`Segmentation::gap`] is 0: a cut promises no optimum.
///
/// # Errors
/// [`Error`]: a bad parameter, a height that leaves more than 65535 classes, an inconsistent tree, the memory limit, or
/// cancelled.
pub fn cut(tree: &Tree, params: &CutParams, exec: &Exec) -> Result<Segmentation, Error> {
    exec.run(|| classes_of(tree, params, exec)?.segment(&tree.grid, &tree.leaves, exec))
}

/// Figures of leaves.
pub(super) trait LeafFigures {
    /// Tells of each leaf, in their order from 0, mean (real units), voxels, and sum of squared deviations from the mean (real units²).
    fn each(&self, exec: &Exec, look: &mut dyn FnMut(usize, f64, u32, f64)) -> Result<(), Error>;
}

/// Figures that lie side by side.
pub(super) struct Stored<'a> {
    pub(super) counts: &'a [u32],
    pub(super) means: &'a LeafMeans,
    pub(super) squares: Option<&'a [f64]>,
}

impl LeafFigures for Stored<'_> {
    fn each(&self, exec: &Exec, look: &mut dyn FnMut(usize, f64, u32, f64)) -> Result<(), Error> {
        for start in (0..self.counts.len()).step_by(CHUNK) {
            exec.check_cancelled()?;
            for leaf in start..(start + CHUNK).min(self.counts.len()) {
                let squares = self.squares.map_or(0.0, |s| s[leaf]);
                look(leaf, self.means.get(leaf), self.counts[leaf], squares);
            }
        }
        Ok(())
    }
}

/// A merge that a cut undoes.
pub(super) struct Undone {
    /// The leaves on either side.
    pub(super) pair: [u32; 2],
    pub(super) height: f64,
}

/// The classes of a cut, before voxels get their labels.
pub(super) struct Classes {
    /// The merges that are undone, in their order.
    pub(super) undone: Vec<Undone>,
    /// The class of each leaf, 1….
    pub(super) groups: SpillVec<u16>,
    pub(super) list: Vec<Class>,
    inertia: f64,
}

/// # Errors
/// Those of [`cut`].
pub(super) fn classes_of(tree: &Tree, params: &CutParams, exec: &Exec) -> Result<Classes, Error> {
    params.check()?;
    let sizes = || {
        let mut sizes: SpillVec<u32> = exec.bulk("the sizes of the parts", tree.leaf_count())?;
        sizes.copy_from_slice(&tree.counts);
        Ok(sizes)
    };
    let joined = join(tree.merged(), tree.leaf_count(), sizes, params, exec)?;
    let squares = tree.squares.as_deref();
    joined.describe(&Stored { counts: &tree.counts, means: &tree.means, squares }, exec)
}

/// The leaves, joined by all merges but some.
pub(super) struct Joined {
    undone: Vec<Undone>,
    /// The group of each leaf, 1….
    groups: SpillVec<u32>,
    count: usize,
}

/// Joins the leaves by the merges that a cut keeps. `sizes` gives the voxels of each leaf, and is asked only where they matter.
///
/// # Errors
/// A height that leaves too many classes, the memory limit, or cancelled.
pub(super) fn join(
    merged: Merged<'_>,
    leaves: usize,
    sizes: impl FnOnce() -> Result<SpillVec<u32>, Error>,
    params: &CutParams,
    exec: &Exec,
) -> Result<Joined, Error> {
    let undone = undone(merged, sizes, params, exec)?;
    if undone.len() >= MOST_CLASSES {
        let problem = format!("{} classes, labels have 16 bits", undone.len() + 1);
        return Err(
            ParamError::new("height", problem, "raise the height, or ask for a number of classes").into()
        );
    }
    let (groups, count) = groups(merged.merges, leaves, &undone, exec)?;
    let told = |merge: &u32| {
        let at = *merge as usize;
        Undone { pair: merged.merges[at], height: merged.height(at) }
    };
    Ok(Joined { undone: undone.iter().map(told).collect(), groups, count })
}

/// The merges that are undone, ascending.
fn undone(
    merged: Merged<'_>,
    sizes: impl FnOnce() -> Result<SpillVec<u32>, Error>,
    params: &CutParams,
    exec: &Exec,
) -> Result<Vec<u32>, Error> {
    let merges = merged.merges.len();
    let by_height = match params.ranking {
        Ranking::Height => true,
        Ranking::Persistence => merged.linkage == Linkage::Ward,
        Ranking::Area => false,
    };
    let first = match (params.height, params.classes()) {
        (Some(height), _) => merged.up_to(height),
        (_, Some(k)) if by_height && params.least_part <= 1 => merges.saturating_sub(k - 1),
        _ => 0,
    };
    let most = params.classes().map_or(MOST_CLASSES, |k| k - 1);
    if params.least_part <= 1 && (by_height || params.classes().is_none()) {
        return Ok((first as u32..merges as u32).collect());
    }
    let mut top = Top { most, heap: BinaryHeap::new() };
    ranked(merged, sizes()?, exec, |merge, height, smaller| {
        if merge >= first && u64::from(smaller) >= params.least_part {
            let rank = match params.ranking {
                _ if params.classes().is_none() => 0.0,
                Ranking::Area => f64::from(smaller),
                _ if by_height => height,
                _ => height * f64::from(smaller),
            };
            top.see(rank.min(f64::MAX), merge as u32);
        }
    })?;
    let mut undone: Vec<u32> = top.heap.into_iter().map(|Reverse((_, merge))| merge).collect();
    undone.sort_unstable();
    Ok(undone)
}

/// The highest of many ranks; they aren't negative, so their bits ascend with them.
struct Top {
    most: usize,
    heap: BinaryHeap<Reverse<(u64, u32)>>,
}

impl Top {
    fn see(&mut self, rank: f64, merge: u32) {
        let item = Reverse((rank.to_bits(), merge));
        if self.heap.len() < self.most {
            self.heap.push(item);
        } else if self.heap.peek().is_some_and(|least| item.0 > least.0) {
            self.heap.pop();
            self.heap.push(item);
        }
    }
}

/// Marks a leaf that stands for its part; the other bits are the part's voxels. There are fewer of these than 2³¹.
const TOP: u32 = 1 << 31;

/// Tells each merge with its height and the voxels of its smaller part. `parts` are the voxels of each leaf.
fn ranked(
    merged: Merged<'_>,
    mut parts: SpillVec<u32>,
    exec: &Exec,
    mut tell: impl FnMut(usize, f64, u32),
) -> Result<(), Error> {
    let parts = &mut *parts;
    for size in parts.iter_mut() {
        *size |= TOP;
    }
    let mut step = 0;
    for (merge, pair) in merged.merges.iter().enumerate() {
        if merge % CHUNK == 0 {
            exec.check_cancelled()?;
        }
        step += usize::from(merged.ends[step] as usize <= merge);
        let [a, b] = pair.map(|leaf| top(parts, leaf - 1));
        let sizes = [a, b].map(|at| parts[at as usize] & !TOP);
        tell(merge, merged.heights[step], sizes[0].min(sizes[1]));
        parts[a.max(b) as usize] = a.min(b);
        parts[a.min(b) as usize] = (sizes[0] + sizes[1]) | TOP;
    }
    Ok(())
}

/// As [`sets::root`], where what stands for a set holds its size instead of itself.
#[inline(always)]
fn top(parts: &mut [u32], mut at: u32) -> u32 {
    loop {
        let above = parts[at as usize];
        if above & TOP != 0 {
            return at;
        }
        let next = parts[above as usize];
        if next & TOP != 0 {
            return above;
        }
        parts[at as usize] = next;
        at = next;
    }
}

/// The group of each leaf, 1…, joined by all merges but the undone; and the number of groups.
fn groups(
    merges: &[[u32; 2]],
    leaves: usize,
    undone: &[u32],
    exec: &Exec,
) -> Result<(SpillVec<u32>, usize), Error> {
    let mut groups: SpillVec<u32> = exec.bulk("the groups of the leaves", leaves)?;
    let of = &mut *groups;
    sets::reset(of);
    let mut from = 0;
    for end in undone.iter().map(|merge| *merge as usize).chain([merges.len()]) {
        for merges in merges[from..end].chunks(CHUNK) {
            exec.check_cancelled()?;
            for [a, b] in merges {
                sets::join(of, a - 1, b - 1);
            }
        }
        from = (end + 1).min(merges.len());
    }
    let mut count = 0;
    sets::name(
        of,
        || exec.check_cancelled(),
        |_| {
            count += 1;
            count
        },
    )?;
    Ok((groups, count as usize))
}

impl Joined {
    /// Names the groups by their means, and tells their figures.
    pub(super) fn describe(self, leaves: &dyn LeafFigures, exec: &Exec) -> Result<Classes, Error> {
        let Self { undone, groups, count } = self;
        let mut range = [f64::INFINITY, f64::NEG_INFINITY];
        leaves.each(exec, &mut |_, mean, _, _| range = [range[0].min(mean), range[1].max(mean)])?;
        let frame = frame(range);
        let mut moments = vec![Moments::default(); count];
        leaves.each(exec, &mut |leaf, mean, voxels, squares| {
            moments[groups[leaf] as usize - 1].add_spread(mean, u64::from(voxels), squares, &frame);
        })?;
        let mean = |group: usize| moments[group].mean(&frame).clamp(f64::MIN, f64::MAX);
        let mut order: Vec<usize> = (0..count).collect();
        order.sort_by(|&a, &b| {
            mean(a).total_cmp(&mean(b)).then(moments[b].count.cmp(&moments[a].count)).then(a.cmp(&b))
        });
        let mut names = vec![NO_DATA; count + 1];
        order.iter().enumerate().for_each(|(class, group)| names[group + 1] = class as u16 + 1);
        let mut named: SpillVec<u16> = exec.bulk("the classes of the leaves", groups.len())?;
        parallel::for_each_piece_mut(&mut named, CHUNK, &|i, named| {
            let groups = &groups[i * CHUNK..];
            named.iter_mut().zip(groups).for_each(|(name, group)| *name = names[*group as usize]);
        });
        let class = |(i, &group): (usize, &usize)| Class {
            id: i as u16 + 1,
            name: None,
            mean: mean(group),
            sd: moments[group].sd(&frame).min(f64::MAX),
            voxels: moments[group].count,
            lower: None,
            upper: None,
        };
        let mut found: Vec<Class> = order.iter().enumerate().map(class).collect();
        classes::set_crossings(&mut found);
        let inertia: f64 = order.iter().map(|group| moments[*group].inertia(&frame)).sum();
        Ok(Classes { undone, groups: named, list: found, inertia: inertia.min(f64::MAX) })
    }
}

impl Classes {
    /// The voxels' labels; `leaves` are those of a tree on this grid.
    pub(super) fn segment(self, grid: &Grid, leaves: &[u32], exec: &Exec) -> Result<Segmentation, Error> {
        let voxels: u64 = self.list.iter().map(|c| c.voxels).sum();
        Ok(Segmentation {
            k: self.list.len(),
            labels: Labels::new(grid.clone(), voxel_labels(leaves, &self.groups, exec)?.into(), self.list)?,
            iterations: 1,
            converged: true,
            objective: self.inertia,
            visited_fraction: voxels as f64 / grid.len() as f64,
            gap: 0.0,
        })
    }
}

fn voxel_labels(leaves: &[u32], classes: &[u16], exec: &Exec) -> Result<SpillVec<u16>, Error> {
    let mut labels: SpillVec<u16> = exec.bulk("the labels", leaves.len())?;
    parallel::try_for_each_piece_mut(&mut labels, CHUNK, &|i, labels| {
        exec.check_cancelled()?;
        for (label, leaf) in labels.iter_mut().zip(&leaves[i * CHUNK..]) {
            *label = if *leaf == 0 { NO_DATA } else { classes[*leaf as usize - 1] };
        }
        Ok::<_, Error>(())
    })?;
    Ok(labels)
}
