use ivd_core::{Class, Exec, Labels, Mask, Volume};

use crate::groups::{Group, Partition};
use crate::{Error, labelling};

/// What a segmentation found.
#[derive(Debug, Clone, PartialEq)]
pub struct Segmentation {
    /// A label a voxel: 0 is no data or outside the mask, 1…K are the classes in the order of their means (of the intervals,
    /// for thresholds). With a value `v` of a voxel, its label is `c` exactly where `lower ≤ v < upper` of class `c`.
    pub labels: Labels,
    /// Number of classes; fewer than asked where there are fewer distinct values.
    pub k: usize,
    /// Rounds of an iterative method; 1 for a method without iterations.
    pub iterations: u64,
    /// Whether the method reached what it promises.
    pub converged: bool,
    /// Inertia: the sum of squared distances of the values from their class's mean [real units²].
    pub objective: f64,
    /// Voxels looked at, as a fraction of the volume, 0…1.
    pub visited_fraction: f64,
    /// Certified excess of the objective over the global optimum [real units²]: 0 for an optimum, and for
    /// thresholds; the objective itself where only 0 is known to lie below.
    pub gap: f64,
}

/// # Errors
/// [`ivd_core::Error::GridMismatch`] where the mask lies on another grid.
pub(crate) fn check_mask(volume: &Volume, mask: Option<&Mask>) -> Result<(), Error> {
    mask.map_or(Ok(()), |mask| volume.grid().require(mask.grid(), "volume", "mask"))
}

/// Labels the voxels by an optimal partition of their stored values. The crossings are the midpoints of the class means; where
/// rounding puts such a midpoint on the wrong side of a value, the midpoint of the values next to the cut.
pub(crate) fn label(
    volume: &Volume,
    mask: Option<&Mask>,
    partition: &Partition,
    exec: &Exec,
) -> Result<Segmentation, Error> {
    let mut groups: Vec<&Group> = partition.groups.iter().collect();
    let k = groups.len();
    let falling = volume.slope() < 0.0;
    let ids: Vec<u16> = (1..=k as u16).map(|g| if falling { k as u16 + 1 - g } else { g }).collect();
    if falling {
        groups.reverse();
    }
    let real = |stored: f64| volume.real(stored).clamp(f64::MIN, f64::MAX);
    let crossings: Vec<f64> = groups
        .windows(2)
        .map(|w| {
            let [below, above] = if falling { [0, 1] } else { [1, 0] };
            crossing([real(w[0].mean), real(w[1].mean)], [real(w[0].range[below]), real(w[1].range[above])])
        })
        .collect();
    let classes = groups.iter().enumerate().map(|(i, group)| Class {
        id: i as u16 + 1,
        name: None,
        mean: real(group.mean),
        sd: (group.sd * volume.slope().abs()).min(f64::MAX),
        voxels: group.count,
        lower: i.checked_sub(1).map(|below| crossings[below]),
        upper: crossings.get(i).copied(),
    });
    let classes: Vec<Class> = classes.collect();
    let ids = labelling::of(volume.voxels(), mask, &partition.cuts(), &ids, exec)?;
    let squared = |stored: f64| (stored * volume.slope() * volume.slope()).min(f64::MAX);
    Ok(Segmentation {
        labels: Labels::new(volume.grid().clone(), ids.into(), classes)?,
        k,
        iterations: partition.iterations,
        converged: partition.converged,
        objective: squared(partition.inertia()),
        visited_fraction: visited(volume, mask),
        gap: squared(partition.gap),
    })
}

/// Fraction of the voxels inside the mask.
pub(crate) fn visited(volume: &Volume, mask: Option<&Mask>) -> f64 {
    mask.map_or(1.0, |m| m.count() as f64 / volume.grid().len() as f64)
}

/// A value `c` with `below < c ≤ above`, of the values on either side of a cut.
fn crossing(means: [f64; 2], [below, above]: [f64; 2]) -> f64 {
    let separates = |c: f64| below < c && c <= above;
    let midpoints = [means[0].midpoint(means[1]), below.midpoint(above)];
    midpoints.into_iter().find(|&c| separates(c)).unwrap_or(above)
}
