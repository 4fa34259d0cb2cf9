//! The voxel farthest from every centroid: where an empty cluster begins anew.

use ivd_core::{Exec, Scalar};

use super::brick::GROUP;
use super::frame::{Centroid, Frame, Point, distance};
use super::hierarchy::Hierarchy;
use super::walk::Cell;
use crate::Error;

/// Room for rounding in the bounds of boxes.
const ROUNDING: f64 = 1.0 + 1e-12;

/// The voxel whose nearest centroid is farthest, the first in the volume among equals; `None` where every voxel coincides
/// with a centroid.
pub(super) fn farthest<T: Scalar>(
    hierarchy: &Hierarchy<T>,
    frame: &Frame,
    centroids: &[Centroid],
    exec: &Exec,
) -> Result<Option<Centroid>, Error> {
    let bounds = hierarchy.bricks.iter().map(|brick| bound(&Cell::of_brick(frame, brick), centroids));
    let bounds = largest_first(bounds.collect());
    // Distance, linear index, member, brick.
    let mut best = (0.0, usize::MAX, 0, 0);
    for (bound_of_brick, index) in bounds {
        if bound_of_brick < best.0 {
            break;
        }
        exec.check_cancelled()?;
        let brick = &hierarchy.bricks[index];
        for group in 0..brick.count.div_ceil(GROUP) {
            if bound(&Cell::of_group(frame, hierarchy, brick, group), centroids) < best.0 {
                continue;
            }
            for member in brick.members(group) {
                let at = hierarchy.index(brick, member);
                let value = frame.value(frame.relative(hierarchy.values[member]));
                let d = nearest(
                    &[frame.axes[0][at[0]], frame.axes[1][at[1]], frame.axes[2][at[2]], value],
                    centroids,
                );
                let linear = hierarchy.layout.linear(at);
                if d > best.0 || (d == best.0 && d > 0.0 && linear < best.1) {
                    best = (d, linear, member, index);
                }
            }
        }
    }
    Ok((best.0 > 0.0).then(|| {
        let (_, _, member, brick) = best;
        let at = hierarchy.index(&hierarchy.bricks[brick], member).map(|i| i as u64);
        let value = frame.fixed(frame.relative(hierarchy.values[member]));
        frame.centroid(1, at, i128::from(value))
    }))
}

/// Bounds with their places, the largest first.
fn largest_first(bounds: Vec<f64>) -> Vec<(f64, usize)> {
    let mut placed: Vec<(f64, usize)> = bounds.into_iter().enumerate().map(|(i, bound)| (bound, i)).collect();
    placed.sort_by(|a, b| b.0.total_cmp(&a.0).then(a.1.cmp(&b.1)));
    placed
}

fn nearest(at: &Point, centroids: &[Centroid]) -> f64 {
    centroids.iter().map(|c| distance(at, &c.at)).fold(f64::INFINITY, f64::min)
}

/// No voxel of the box is farther from its nearest centroid.
fn bound(cell: &Cell, centroids: &[Centroid]) -> f64 {
    let farthest = |c: &Centroid| -> f64 {
        (0..4).map(|a| ((cell.middle[a] - c.at[a]).abs() + cell.half[a]).powi(2)).sum()
    };
    let size: f64 = (0..4).map(|a| (cell.middle[a].abs() + cell.half[a]).powi(2)).sum();
    let least = centroids.iter().map(farthest).fold(f64::INFINITY, f64::min);
    least * ROUNDING + size * (ROUNDING - 1.0)
}
