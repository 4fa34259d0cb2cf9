//! Start centroids: k-means++ (Arthur & Vassilvitskii 2007) over the means of groups.

use ivd_core::{Exec, Scalar, parallel};

use super::brick::{Brick, GROUP};
use super::farthest::farthest;
use super::frame::{Centroid, Frame, distance};
use super::hierarchy::Hierarchy;
use crate::Error;

/// Up to `k` centroids, each the mean of a group drawn with a chance of its voxels times the squared distance from the
/// centroids before it; the first by its voxels alone. Where groups run out, the farthest voxels follow.
pub(super) fn plus_plus<T: Scalar>(
    hierarchy: &Hierarchy<T>,
    frame: &Frame,
    k: usize,
    seed: u64,
    exec: &Exec,
) -> Result<Vec<Centroid>, Error> {
    let groups = |brick: &Brick| brick.count.div_ceil(GROUP);
    let total: usize = hierarchy.bricks.iter().map(groups).sum();
    // The means of groups, and how far each is from its nearest centroid so far.
    let mut near = exec.bulk::<f64>("the distances of groups", total)?;
    near.fill(1.0);
    let mut random = Random(seed);
    let mut found: Vec<Centroid> = Vec::new();
    while found.len() < k {
        exec.check_cancelled()?;
        let weights = weights(hierarchy, frame, &mut near, &found);
        let Some((brick, group)) = draw(hierarchy, &near, &weights, random.next()) else { break };
        found.push(mean(hierarchy, frame, &hierarchy.bricks[brick], group));
    }
    top_up(hierarchy, frame, &mut found, k, exec)?;
    Ok(found)
}

/// Adds the farthest voxels until there are `k` centroids, or no voxel is left that isn't one.
fn top_up<T: Scalar>(
    hierarchy: &Hierarchy<T>,
    frame: &Frame,
    found: &mut Vec<Centroid>,
    k: usize,
    exec: &Exec,
) -> Result<(), Error> {
    while found.len() < k {
        match farthest(hierarchy, frame, found, exec)? {
            Some(voxel) => found.push(voxel),
            None => break,
        }
    }
    Ok(())
}

/// The mean of a group.
fn mean<T: Scalar>(hierarchy: &Hierarchy<T>, frame: &Frame, brick: &Brick, group: usize) -> Centroid {
    let places = &hierarchy.group_places[brick.first_group + group];
    let count = brick.members(group).len() as u64;
    let indices = std::array::from_fn(|a| u64::from(places[6 + a]) + count * brick.origin[a] as u64);
    frame.centroid(count, indices, i128::from(hierarchy.group_sums[brick.first_group + group]))
}

/// Brings the distances of all groups up to the newest centroid; gives every brick's weight.
fn weights<T: Scalar>(
    hierarchy: &Hierarchy<T>,
    frame: &Frame,
    near: &mut [f64],
    found: &[Centroid],
) -> Vec<f64> {
    let mut rest = near;
    let mut parts = Vec::with_capacity(hierarchy.bricks.len());
    for brick in &hierarchy.bricks {
        let (part, more) = rest.split_at_mut(brick.count.div_ceil(GROUP));
        parts.push((brick, part));
        rest = more;
    }
    let update = |(brick, near): &mut (&Brick, &mut [f64])| {
        let mut weight = 0.0;
        for (group, near) in near.iter_mut().enumerate() {
            if let Some(newest) = found.last() {
                let d = distance(&mean(hierarchy, frame, brick, group).at, &newest.at);
                *near = if found.len() == 1 { d } else { near.min(d) };
            }
            weight += *near * brick.members(group).len() as f64;
        }
        weight
    };
    parallel::map_pieces_mut(&mut parts, 16, &|_, parts| parts.iter_mut().map(update).collect::<Vec<f64>>())
        .concat()
}

/// The group at a fraction of the total weight.
fn draw<T: Scalar>(
    hierarchy: &Hierarchy<T>,
    near: &[f64],
    weights: &[f64],
    fraction: f64,
) -> Option<(usize, usize)> {
    let total: f64 = weights.iter().sum();
    let mut left = fraction * total;
    let mut first = 0;
    let mut last = None;
    for (index, (brick, weight)) in hierarchy.bricks.iter().zip(weights).enumerate() {
        let groups = brick.count.div_ceil(GROUP);
        if *weight > 0.0 {
            for (group, near) in near[first..first + groups].iter().enumerate() {
                let weight = near * brick.members(group).len() as f64;
                if weight > 0.0 {
                    last = Some((index, group));
                    if left < weight {
                        return last;
                    }
                }
                left -= weight;
            }
        }
        first += groups;
    }
    // Rounding may leave a little beyond the end.
    last
}

/// Uniform numbers in 0…1 (Steele, Lea & Flood 2014, `SplitMix64`).
struct Random(u64);

impl Random {
    fn next(&mut self) -> f64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        ((z ^ (z >> 31)) >> 11) as f64 / (1_u64 << 53) as f64
    }
}
