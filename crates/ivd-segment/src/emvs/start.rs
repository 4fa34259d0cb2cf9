//! Where the search begins: at the classes of least inertia; and how many components there are.

use super::bins::Bins;
use super::mixture::Component;
use crate::histogram::Histogram;
use crate::kmvs;

/// Steps between the extremes that values are rounded to for the partition.
const STEPS: f64 = 1_073_741_824.0;

/// The classes of least inertia over the (coarse) bins: each class's share, mean and variance. Values beyond the robust
/// quantiles by more than their distance count as if they lay there, so that an outlier doesn't become a class. Fewer than `k`
/// where there are fewer values.
pub(super) fn classes(bins: &Bins, k: usize, floor: f64) -> Vec<Component> {
    let [low, high] = bins.quantiles;
    let width = if high > low { high - low } else { 0.0 };
    let least = bins.value[0].max(low - width);
    let most = bins.value[bins.len() - 1].min(high + width);
    let (least, most) =
        if most > least { (least, most) } else { (bins.value[0], bins.value[bins.len() - 1]) };
    let place = |t: f64| {
        let share = if most > least { (t.clamp(least, most) - least) / (most - least) } else { 0.0 };
        (share * STEPS).round() as i64
    };
    let mut histogram = Histogram::default();
    for (&t, &n) in bins.value.iter().zip(&bins.count) {
        if histogram.values.last() == Some(&place(t)) {
            *histogram.counts.last_mut().expect("as many counts as values") += n as u64;
        } else {
            histogram.values.push(place(t));
            histogram.counts.push(n as u64);
        }
    }
    let groups = kmvs::partition(&histogram, k).groups;
    let mut bin = 0;
    groups
        .iter()
        .map(|group| {
            let from = bin;
            while bin < bins.len() && place(bins.value[bin]) as f64 <= group.range[1] {
                bin += 1;
            }
            component(bins, from..bin, floor)
        })
        .collect()
}

fn component(bins: &Bins, range: std::ops::Range<usize>, floor: f64) -> Component {
    let n: f64 = bins.count[range.clone()].iter().sum();
    let sum = |f: &dyn Fn(usize) -> f64| range.clone().map(|i| bins.count[i] * f(i)).sum::<f64>() / n;
    let mean = sum(&|i| bins.value[i]);
    let variance = sum(&|i| (bins.value[i] - mean).powi(2) + bins.spread[i]);
    Component::on_intensity(n / bins.total, mean, variance.max(floor))
}

/// Least variance of the intensity, in the frame: see [`super::EmvsParams::variance_floor`].
pub(super) fn floor(bins: &Bins, share: f64) -> f64 {
    if bins.variance == 0.0 {
        // A constant volume: any variance will do.
        return 1.0 / 12.0;
    }
    // Rounding can't be most of what is seen: two values far apart are two classes, not a coarse scale.
    let rounding = (bins.step * bins.step / 12.0).min(0.01 * bins.variance);
    let least = 1e-20 * bins.variance;
    if share == 0.0 { least } else { (share * bins.variance).max(rounding).max(least) }
}

/// Bayesian information criterion of a mixture with `free` parameters (Schwarz 1978): the less the better.
pub(super) fn criterion(mean_log_likelihood: f64, voxels: f64, free: usize) -> f64 {
    free as f64 * voxels.ln() - 2.0 * voxels * mean_log_likelihood
}
