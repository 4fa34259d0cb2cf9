//! Labels, transfer functions and masks.

use std::collections::VecDeque;

use ivd_boundary::{Component, ComponentParams};
use ivd_core::{Grid, Labels, NO_DATA, TransferFunction, Volume};
use ivd_segment::Segmentation;

use super::{EPS, Verdict};
use crate::hold;

/// Stored value of every voxel; `None` where there is no data.
pub fn stored(volume: &Volume) -> Vec<Option<f64>> {
    let voxels = volume.voxels();
    (0..voxels.len()).map(|i| Some(voxels.get(i)).filter(|v| v.is_finite())).collect()
}

/// Real value of every voxel; `None` where there is no data.
pub fn reals(volume: &Volume) -> Vec<Option<f64>> {
    stored(volume).into_iter().map(|v| v.map(|v| volume.real(v))).collect()
}

/// A k-means segmentation: labels agree with the classes' intervals, classes with their voxels, the objective with the
/// values, and no partition is better where few values make that checkable.
///
/// # Errors
/// The first thing that doesn't hold.
pub fn kmeans(volume: &Volume, k: usize, found: &Segmentation) -> Verdict {
    let values = reals(volume);
    hold!(found.k <= k && found.labels.classes().len() == found.k, "{} classes of {k}", found.k);
    labels(&values, &found.labels)?;
    let any = values.iter().any(Option::is_some);
    hold!((found.k > 0) == any, "{} classes, data: {any}", found.k);
    hold!(found.objective.is_finite() && found.objective >= 0.0, "objective {}", found.objective);
    let plain = inertia(&values, &found.labels);
    // A sum of n squares, each of a difference of values that carry the rounding of slope and intercept.
    let scale = values.iter().flatten().fold(0.0_f64, |m, v| m.max(v.abs()));
    let slack = 1e-9 * plain + values.len() as f64 * (8.0 * EPS * scale).powi(2) + f64::MIN_POSITIVE;
    if plain < 1e290 {
        let off = (found.objective - plain).abs();
        hold!(off <= slack, "objective {} is {plain} when summed plainly", found.objective);
        if let Some(best) = optimum(&values, k) {
            hold!(
                found.objective <= best * (1.0 + 1e-9) + slack,
                "objective {} where {best} can be had",
                found.objective
            );
        }
    }
    Ok(())
}

/// Labels against the intervals and the sizes of their classes.
fn labels(values: &[Option<f64>], labels: &Labels) -> Verdict {
    let classes = labels.classes();
    let mut counted = vec![0_u64; classes.len()];
    for (i, (&id, value)) in labels.ids().iter().zip(values).enumerate() {
        let Some(value) = *value else {
            hold!(id == NO_DATA, "voxel {i} is no data and has label {id}");
            continue;
        };
        let Some(c) = classes.iter().position(|c| c.id == id) else {
            return Err(format!("voxel {i} of value {value} has label {id}, no class"));
        };
        counted[c] += 1;
        let (lower, upper) = (classes[c].lower, classes[c].upper);
        let within = lower.is_none_or(|l| l <= value) && upper.is_none_or(|u| value < u);
        hold!(within, "voxel {i}: {value} has label {id}, whose values are {lower:?} to {upper:?}");
    }
    for (class, counted) in classes.iter().zip(counted) {
        hold!(class.voxels == counted, "class {} counts {} voxels of {counted}", class.id, class.voxels);
        hold!(class.mean.is_finite() && class.sd.is_finite() && class.sd >= 0.0, "class {class:?}");
    }
    let rising = classes.windows(2).all(|w| w[0].mean < w[1].mean && w[0].id < w[1].id);
    hold!(rising, "the classes' means don't rise");
    Ok(())
}

/// Sum of squared distances of the values from the mean of their label, in two passes about the first value.
fn inertia(values: &[Option<f64>], labels: &Labels) -> f64 {
    labels
        .classes()
        .iter()
        .map(|class| {
            let of: Vec<f64> = values
                .iter()
                .zip(labels.ids())
                .filter(|(_, id)| **id == class.id)
                .filter_map(|(v, _)| *v)
                .collect();
            spread(&of)
        })
        .sum()
}

fn spread(of: &[f64]) -> f64 {
    let Some(&first) = of.first() else { return 0.0 };
    let mean = of.iter().map(|v| v - first).sum::<f64>() / of.len() as f64;
    of.iter().map(|v| (v - first - mean).powi(2)).sum()
}

/// Most distinct values for which the best partition is sought plainly.
const FEW: usize = 40;

/// Least inertia of a partition of few distinct values into `k` classes, by trying every cut.
fn optimum(values: &[Option<f64>], k: usize) -> Option<f64> {
    let mut sorted: Vec<f64> = values.iter().flatten().copied().collect();
    sorted.sort_by(f64::total_cmp);
    let starts: Vec<usize> = (0..sorted.len()).filter(|&i| i == 0 || sorted[i] != sorted[i - 1]).collect();
    if starts.is_empty() || starts.len() > FEW {
        return None;
    }
    let b = starts.len();
    let end = |i: usize| starts.get(i).copied().unwrap_or(sorted.len());
    let cost: Vec<Vec<f64>> =
        (0..b).map(|i| (i..b).map(|j| spread(&sorted[end(i)..end(j + 1)])).collect()).collect();
    let mut best: Vec<f64> = (0..b).map(|j| cost[0][j]).collect();
    for _ in 1..k.min(b) {
        let last = |j: usize| (1..=j).map(|i| best[i - 1] + cost[i][j - i]).fold(best[j], f64::min);
        best = (0..b).map(last).collect();
    }
    best.last().copied()
}

/// Thresholds: every voxel's label is that of its interval.
///
/// # Errors
/// The first voxel or class that doesn't fit.
pub fn thresholds(volume: &Volume, at: &[f64], found: &Segmentation) -> Verdict {
    let values = reals(volume);
    for (i, (value, &id)) in values.iter().zip(found.labels.ids()).enumerate() {
        let expected = value.map_or(NO_DATA, |v| 1 + at.iter().filter(|t| **t <= v).count() as u16);
        hold!(id == expected, "voxel {i} of value {value:?} has label {id}, not {expected}");
    }
    for class in found.labels.classes() {
        let count = found.labels.ids().iter().filter(|id| **id == class.id).count() as u64;
        hold!(class.voxels == count && count > 0, "class {} counts {} of {count}", class.id, class.voxels);
        hold!(class.mean.is_finite() && class.sd.is_finite() && class.sd >= 0.0, "class {class:?}");
    }
    hold!(
        found.k == found.labels.classes().len(),
        "{} classes listed, k {}",
        found.labels.classes().len(),
        found.k
    );
    hold!(found.objective.is_finite() && found.objective >= 0.0, "objective {}", found.objective);
    Ok(())
}

/// A transfer function: an entry for each label that occurs, everything finite and within its domain.
///
/// # Errors
/// The first part that doesn't fit.
pub fn transfer(labels: &Labels, params: &ivd_atf::Params, transfer: &TransferFunction) -> Verdict {
    let mut labels_present: Vec<u16> = labels.ids().iter().copied().filter(|id| *id != NO_DATA).collect();
    labels_present.sort_unstable();
    labels_present.dedup();
    let mut entered: Vec<u16> = transfer.entries().iter().map(|e| e.class).collect();
    entered.sort_unstable();
    hold!(entered == labels_present, "entries for {entered:?}, labels {labels_present:?}");
    for entry in transfer.entries() {
        let finite = entry.lower.is_finite() && entry.upper.is_finite() && entry.softness.is_finite();
        hold!(finite && entry.softness >= 0.0, "entry {entry:?}");
        hold!((0.0..=params.max_opacity as f32).contains(&entry.opacity), "opacity of {entry:?}");
    }
    let within = |c: &[f32; 4]| c.iter().all(|v| (0.0..=1.0).contains(v));
    hold!(transfer.table().iter().all(within), "a sample of the table leaves 0…1");
    Ok(())
}

/// The offsets of the neighbours of a voxel through its faces.
const NEIGHBOURS: [[i64; 3]; 6] = [[-1, 0, 0], [1, 0, 0], [0, -1, 0], [0, 1, 0], [0, 0, -1], [0, 0, 1]];

/// Number of the connected piece of every voxel of a set, pieces in the order of their first voxel; `None` outside.
fn pieces(grid: &Grid, of: &[bool]) -> (Vec<Option<usize>>, usize) {
    let dims = grid.dims();
    let mut piece = vec![None; of.len()];
    let mut count = 0;
    for seed in 0..of.len() {
        if !of[seed] || piece[seed].is_some() {
            continue;
        }
        piece[seed] = Some(count);
        let mut queue = VecDeque::from([seed]);
        while let Some(i) = queue.pop_front() {
            let at = grid.index(i).0.map(|c| c as i64);
            for d in NEIGHBOURS {
                let to: [i64; 3] = std::array::from_fn(|a| at[a] + d[a]);
                if (0..3).all(|a| to[a] >= 0 && to[a] < dims[a] as i64) {
                    let j = grid.linear(ivd_core::VoxelIndex(to.map(|c| c as usize)));
                    if of[j] && piece[j].is_none() {
                        piece[j] = Some(count);
                        queue.push_back(j);
                    }
                }
            }
        }
        count += 1;
    }
    (piece, count)
}

/// An isolated part against a flood fill: the largest piece (of equals the first) or, of what is at or above a value, the outermost that encloses it; its
/// enclosed background filled.
/// Cases with a seed are left to the crate's own tests.
///
/// # Errors
/// The first voxel that differs.
pub fn part(volume: &Volume, labels: &Labels, params: &ComponentParams, found: &Component) -> Verdict {
    let grid = volume.grid();
    let values = reals(volume);
    let member = |i: usize| match (params.above, found.class) {
        (Some(above), _) => values[i].is_some_and(|v| v >= above),
        (None, class) => Some(labels.ids()[i]) == class && values[i].is_some(),
    };
    let members: Vec<bool> = (0..grid.len()).map(member).collect();
    let (piece, count) = pieces(grid, &members);
    hold!(found.components == count, "{} components, plainly {count}", found.components);
    let mut sizes = vec![0_u64; count];
    piece.iter().flatten().for_each(|&p| sizes[p] += 1);
    let largest = (0..count).max_by_key(|&p| (sizes[p], std::cmp::Reverse(p)));
    let enclosed_by = |kept: Option<usize>| -> Vec<bool> {
        let background: Vec<bool> = piece.iter().map(|p| p.is_none() || *p != kept).collect();
        let (hole, holes) = pieces(grid, &background);
        let mut open = vec![false; holes];
        for (i, p) in hole.iter().enumerate() {
            let at = grid.index(i).0;
            if let Some(p) = p
                && (0..3).any(|a| at[a] == 0 || at[a] + 1 == grid.dims()[a])
            {
                open[*p] = true;
            }
        }
        hole.iter().map(|p| p.is_some_and(|p| !open[p])).collect()
    };
    // Of those that enclose the largest the outermost, which the others don't enclose.
    let first = piece.iter().position(|p| p.is_some() && *p == largest);
    let mut taken = largest;
    if let Some(first) = first.filter(|_| params.above.is_some() && params.fill_holes) {
        let round: Vec<usize> =
            (0..count).filter(|p| sizes[*p] > 6 && enclosed_by(Some(*p))[first]).collect();
        let is_outermost = |p: &&usize| {
            let of = piece.iter().position(|q| *q == Some(**p)).expect("it has a voxel");
            round.iter().all(|other| !enclosed_by(Some(*other))[of])
        };
        taken = round.iter().find(is_outermost).copied().or(largest);
    }
    let kept: Vec<bool> = piece.iter().map(|p| p.is_some() && *p == taken).collect();
    let enclosed = enclosed_by(taken);
    for i in 0..grid.len() {
        let filled = params.fill_holes && values[i].is_some() && enclosed[i];
        let expected = u8::from(kept[i] || filled);
        let got = found.mask.inside()[i];
        hold!(got == expected, "voxel {:?} of the part: {got}, plainly {expected}", grid.index(i).0);
    }
    hold!(found.voxels == found.mask.count(), "{} voxels of {}", found.voxels, found.mask.count());
    Ok(())
}
