//! k-means on place and value: Lloyd's algorithm, exactly, over a hierarchy of bricks and groups of like voxels.

mod brick;
mod build;
mod farthest;
mod frame;
mod hierarchy;
mod labels;
mod layout;
mod start;
mod sums;
#[cfg(test)]
mod tests;
mod walk;

use ivd_core::{Exec, Iteration, Labels, Mask, Scalar, Volume, with_voxels};

use super::params::KmvsParams;
use crate::{Error, Segmentation, selection};
use frame::{Centroid, Frame};
use hierarchy::Hierarchy;
use sums::Tally;

/// What k-means on place and value found.
#[derive(Debug, Clone, PartialEq)]
pub struct SpatialKmvs {
    /// Labels and classes. Classes overlap in value, so their crossings are those of their normal densities. The objective
    /// counts places too: the sum of squared distances from the class's mean, `w²` times squared mm plus squared values.
    pub segmentation: Segmentation,
    /// The centroid that each class's voxels are nearest to, `[x, y, z, value]` (mm from the first voxel along the axes of the
    /// grid; real units), shape `[classes]`. With convergence these are the classes' means.
    pub centroids: Vec<[f64; 4]>,
    /// Empty clusters that began anew at the farthest voxel.
    pub reseeded: u64,
    /// Voxels with two nearest centroids within a relative 1e-12 of the squared distance. They belong to the one that comes
    /// first at the start.
    pub ties: u64,
    /// Voxels that were looked at one by one, over all iterations and the final labelling.
    pub visited: u64,
}

/// k-means on place and value: Lloyd's algorithm (Lloyd 1982) on the features `(w x, w y, w z, I)`, with `x, y, z` the voxel's
/// index times the spacing (mm), `w` = [`KmvsParams::spatial_weight`] and `I` the real value. The axes of a sheared grid are so
/// measured as perpendicular.
///
/// The labels are those of plain Lloyd, voxel for voxel. Bricks of up to 4096 voxels, and in them groups of voxels of like
/// value, keep exact sums; those that lie nearest to one centroid with all of their box go to it whole (Kanungo et al. 2002),
/// and only voxels in groups that straddle two centroids are looked at one by one. O(N) to set up; an iteration costs
/// O(N K / 4096) and a share for the voxels near a border, typically a few per cent.
///
/// Means are exact: sums are integers. Floats enter sums rounded to 2⁻⁴⁹ of their range. A voxel as far from two centroids, by
/// distances rounded to `f64`, goes to the first of them. An empty cluster begins anew at the voxel that is farthest from its
/// nearest centroid (the first in the volume among equals); with fewer voxels than clusters some stay empty and are left out.
/// The start is [`KmvsParams::start`], or k-means++ (Arthur & Vassilvitskii 2007) from [`KmvsParams::seed`], drawn among means
/// of groups instead of voxels.
///
/// The result is a local optimum. Nothing better than 0 is certified to lie below it, so [`Segmentation::gap`] is the objective
/// itself. [`Segmentation::visited_fraction`] is [`SpatialKmvs::visited`] per voxel and pass.
///
/// # Errors
/// [`Error`]: a bad parameter, a mask on another grid, the memory limit, or cancelled.
pub fn kmvs_spatial(
    volume: &Volume,
    mask: Option<&Mask>,
    params: &KmvsParams,
    exec: &Exec,
) -> Result<SpatialKmvs, Error> {
    params.check()?;
    exec.run(|| {
        let scope = selection::of(volume, mask, params.within, exec)?;
        let mask = scope.as_deref();
        with_voxels!(volume.voxels(), slice => cluster(volume, slice, mask, params, exec))
    })
}

fn cluster<T: Scalar>(
    volume: &Volume,
    voxels: &[T],
    mask: Option<&Mask>,
    params: &KmvsParams,
    exec: &Exec,
) -> Result<SpatialKmvs, Error> {
    let Some(range) = frame::range(voxels, mask) else { return nothing(volume, exec) };
    let frame = Frame::new::<T>(range, volume, params.spatial_weight);
    let hierarchy = Hierarchy::new(volume, voxels, mask, &frame, exec)?;
    let start = match &params.start {
        Some(start) => start.iter().map(|c| frame.given(*c)).collect(),
        None => start::plus_plus(&hierarchy, &frame, params.k, params.seed, exec)?,
    };
    let lloyd = lloyd(&hierarchy, &frame, start, params, exec)?;
    let labelled = labels::label((&hierarchy, &frame), &lloyd.centroids, &lloyd.tally, voxels.len(), exec)?;
    let objective = lloyd.tally.inertia(&hierarchy, &frame);
    let visited = lloyd.visited + labelled.visited;
    let looks = (lloyd.passes + 1) as f64 * hierarchy.count as f64;
    Ok(SpatialKmvs {
        centroids: labelled.order.iter().map(|k| lloyd.centroids[*k].real).collect(),
        segmentation: Segmentation {
            k: labelled.classes.len(),
            labels: Labels::new(volume.grid().clone(), labelled.ids.into(), labelled.classes)?,
            iterations: lloyd.iterations,
            converged: lloyd.converged,
            objective,
            visited_fraction: visited as f64 / looks,
            gap: objective,
        },
        reseeded: lloyd.reseeded,
        ties: labelled.ties,
        visited,
    })
}

/// The result for a volume without data.
fn nothing(volume: &Volume, exec: &Exec) -> Result<SpatialKmvs, Error> {
    let ids = exec.bulk("the labels", volume.grid().len())?;
    let segmentation = Segmentation {
        labels: Labels::new(volume.grid().clone(), ids.into(), Vec::new())?,
        k: 0,
        iterations: 0,
        converged: true,
        objective: 0.0,
        visited_fraction: 0.0,
        gap: 0.0,
    };
    Ok(SpatialKmvs { segmentation, centroids: Vec::new(), reseeded: 0, ties: 0, visited: 0 })
}

/// Where Lloyd's algorithm ended: centroids, and the tally of what is nearest to each.
struct Lloyd {
    centroids: Vec<Centroid>,
    tally: Tally,
    iterations: u64,
    converged: bool,
    reseeded: u64,
    passes: u64,
    visited: u64,
}

fn lloyd<T: Scalar>(
    hierarchy: &Hierarchy<T>,
    frame: &Frame,
    start: Vec<Centroid>,
    params: &KmvsParams,
    exec: &Exec,
) -> Result<Lloyd, Error> {
    let tally = Tally::of(hierarchy, frame, &start, exec)?;
    let visited = tally.visited;
    let mut at =
        Lloyd { centroids: start, tally, iterations: 0, converged: false, reseeded: 0, passes: 1, visited };
    let mut before = f64::INFINITY;
    while at.iterations < params.max_iterations {
        exec.check_cancelled()?;
        at.iterations += 1;
        let inertia = at.tally.inertia(hierarchy, frame);
        exec.observer().iteration(Iteration { method: "kmvs", index: at.iterations, value: inertia });
        let (next, reseeded) = update(hierarchy, frame, &at.tally, exec)?;
        // Equal centroids give equal labels for ever.
        at.converged = next == at.centroids;
        if at.converged {
            break;
        }
        at.centroids = next;
        at.reseeded += reseeded;
        at.tally = Tally::of(hierarchy, frame, &at.centroids, exec)?;
        at.passes += 1;
        at.visited += at.tally.visited;
        at.converged =
            params.tolerance > 0.0 && reseeded == 0 && before - inertia <= params.tolerance * before;
        if at.converged {
            break;
        }
        before = inertia;
    }
    Ok(at)
}

/// The means, with empty clusters begun anew at the farthest voxels; says how many.
fn update<T: Scalar>(
    hierarchy: &Hierarchy<T>,
    frame: &Frame,
    tally: &Tally,
    exec: &Exec,
) -> Result<(Vec<Centroid>, u64), Error> {
    let mut means: Vec<Option<Centroid>> = tally.sums.iter().map(|s| s.centroid(frame)).collect();
    let mut known: Vec<Centroid> = means.iter().flatten().copied().collect();
    let mut reseeded = 0;
    for mean in means.iter_mut().filter(|mean| mean.is_none()) {
        let Some(voxel) = farthest::farthest(hierarchy, frame, &known, exec)? else { break };
        known.push(voxel);
        *mean = Some(voxel);
        reseeded += 1;
    }
    Ok((means.into_iter().flatten().collect(), reseeded))
}
