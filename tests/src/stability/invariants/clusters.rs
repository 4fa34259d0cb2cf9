//! Labels of classes that need not be intervals.

use ivd_core::{NO_DATA, Volume};
use ivd_segment::Segmentation;

use super::Verdict;
use super::segments::reals;
use crate::hold;

/// Every voxel with data has a class and no other has one; classes count their voxels, have their mean and spread, and rise.
///
/// # Errors
/// The first thing that doesn't hold.
pub fn sound(volume: &Volume, found: &Segmentation) -> Verdict {
    let values = reals(volume);
    let classes = found.labels.classes();
    hold!(classes.len() == found.k, "{} classes, k {}", classes.len(), found.k);
    let any = values.iter().any(Option::is_some);
    hold!((found.k > 0) == any, "{} classes, data: {any}", found.k);
    hold!(found.objective.is_finite(), "objective {}", found.objective);
    hold!((0.0..=1.0).contains(&found.visited_fraction), "visited {}", found.visited_fraction);
    let mut members: Vec<Vec<f64>> = vec![Vec::new(); classes.len()];
    for (i, (&id, value)) in found.labels.ids().iter().zip(&values).enumerate() {
        match *value {
            None => hold!(id == NO_DATA, "voxel {i} is no data and has label {id}"),
            Some(value) => {
                hold!(
                    (1..=classes.len()).contains(&usize::from(id)),
                    "voxel {i} of value {value} has label {id}"
                );
                members[usize::from(id) - 1].push(value);
            }
        }
    }
    // Sums are about the middle of the volume's range, in steps of 2⁻⁴⁹ of it or finer: below that a figure is noise.
    let reach = volume.range().map_or(0.0, |[low, high]| (high / 2.0 - low / 2.0) * 2.0_f64.powi(-46));
    for (class, members) in classes.iter().zip(&members) {
        hold!(
            class.voxels == members.len() as u64 && class.voxels > 0,
            "{class:?} has {} voxels",
            members.len()
        );
        // Halves: sums and differences of the ends of f64 overflow.
        let first = members[0] / 2.0;
        let mean = members.iter().map(|v| (v / 2.0 - first) / members.len() as f64).sum::<f64>() + first;
        let scale = members.iter().fold(0.0_f64, |m, v| m.max(v.abs()));
        let slack = 1e-9 * scale + reach + f64::MIN_POSITIVE;
        let off = (class.mean / 2.0 - mean).abs();
        hold!(
            off <= slack,
            "class {} has mean {}, half of which summed plainly is {mean}",
            class.id,
            class.mean
        );
        let widest = members.iter().fold(0.0_f64, |m, v| m.max((v / 2.0 - mean).abs())) * 2.0;
        let most = widest * (1.0 + 1e-9) + slack;
        hold!(class.sd >= 0.0 && class.sd <= most, "class {} has spread {} of {widest}", class.id, class.sd);
    }
    let rising = classes.windows(2).all(|w| w[0].mean <= w[1].mean && w[0].id + 1 == w[1].id);
    hold!(rising, "the classes' means fall");
    for pair in classes.windows(2) {
        let Some(meet) = pair[0].upper else {
            return Err(format!("class {} has no crossing above", pair[0].id));
        };
        hold!(
            pair[1].lower == Some(meet) && meet.is_finite(),
            "neighbours meet at {meet} and {:?}",
            pair[1].lower
        );
    }
    Ok(())
}
