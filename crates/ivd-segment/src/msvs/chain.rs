//! Mean shift proposes how many classes there are, and k-means makes them.
//!
//! The thesis runs both and lists two numbers of classes, one proposed and a smaller one kept (Table 8.1), but not the step
//! between them: k-means never drops a class. Here the proposal is the most classes that are looked at. For every number up
//! to it k-means gives the partition of least inertia, and the number that describes the values best is kept.

use std::time::{Duration, Instant};

use ivd_core::op::check_fields;
use ivd_core::{Exec, Iteration, Mask, ParamError, Volume};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::bandwidth::{self, Bandwidths};
use super::cells::Cells;
use super::params::MsvsParams;
use super::{Msvs, msvs};
use crate::groups::Partition;
use crate::histogram::{self, Histogram};
use crate::kmvs::partitions;
use crate::{Error, KmvsParams, Segmentation, kmvs, selection};

/// Bandwidths that a class is taken to be wider than it is: modes closer than two bandwidths are one mode. With one, the
/// criterion still falls at 12 classes of a bonsai and of an engine block and keeps whatever is proposed; with two it is least
/// at 5 and 6, with four at 4 and 5, where the bonsai loses a part that it shows.
const BLUR: f64 = 2.0;

/// Mean shift proposes classes, k-means keeps those that count.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default)]
pub struct ChainParams {
    /// How the number of classes is proposed. Its `within` holds for both parts.
    #[serde(flatten)]
    pub msvs: MsvsParams,
    /// Fewest classes looked at; where fewer are proposed, that many are kept.
    #[schemars(range(min = 1, max = 1024), extend("x-unit" = "1"))]
    pub k_min: usize,
}

impl Default for ChainParams {
    fn default() -> Self {
        Self { msvs: MsvsParams::default(), k_min: 2 }
    }
}

impl ChainParams {
    /// # Errors
    /// [`ParamError`] names the field that is out of its domain.
    pub fn check(&self) -> Result<(), ParamError> {
        check_fields(self)?;
        self.msvs.within.check()
    }
}

/// One number of classes that was looked at.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct ChainPoint {
    /// Number of classes.
    #[schemars(extend("x-unit" = "1"))]
    pub k: usize,
    /// Least inertia of a partition into so many classes.
    #[schemars(extend("x-unit" = "real units²"))]
    pub objective: f64,
    /// Criterion of description length; the least is best.
    #[schemars(extend("x-unit" = "1"))]
    pub bic: f64,
}

/// How long the parts took. No part of a result's identity: two equal results differ in it.
#[derive(Debug, Clone, Copy, Default)]
pub struct ChainTimes {
    /// Mean shift.
    pub msvs: Duration,
    /// The curve, and k-means with the number that was kept.
    pub kmvs: Duration,
}

impl PartialEq for ChainTimes {
    fn eq(&self, _: &Self) -> bool {
        true
    }
}

/// What the chain found.
#[derive(Debug, Clone, PartialEq)]
pub struct Chain {
    /// Classes of k-means.
    pub segmentation: Segmentation,
    /// Number of modes that mean shift proposes.
    pub k_proposed: usize,
    /// Number of classes kept.
    pub k_kept: usize,
    /// Every number of classes that was looked at, ascending.
    pub curve: Vec<ChainPoint>,
    /// Bandwidth of the values (real units).
    pub range_bandwidth: f64,
    /// How long the parts took; equal to any other in comparisons.
    pub times: ChainTimes,
}

/// Classes of [`kmvs`], as many as mean shift proposes or fewer.
///
/// For each `k` from [`ChainParams::k_min`] to the number of modes kept, `kmvs` gives the partition of least inertia, and
/// its description length in normal classes is
///
/// ```text
/// bic(k) = -2 Σ_c n_c (ln(n_c / n) - ½ ln(2π s_c²) - ½) + (3k - 1) ln n
/// ```
///
/// with the classes' sizes `n_c`, and `s_c²` their variance plus the square of two bandwidths: what lies closer than that has
/// one mode. It is the Bayesian information criterion of the classification likelihood (Biernacki, Celeux & Govaert 2000),
/// where each value belongs to one class only. That of the mixture falls without end on millions of voxels, as no real class
/// is quite normal. The `k` of the least `bic` is kept, the smallest among equal ones.
///
/// 8 and 16 bit volumes go through the exact histogram; for other types the curve is that of values rounded to a sixteenth of
/// the bandwidth (with the default `cells_per_bandwidth`), and only the partition that is kept is exact.
///
/// # Errors
/// [`Error`]: as [`msvs`] and [`kmvs`].
pub fn msvs_kmvs(
    volume: &Volume,
    mask: Option<&Mask>,
    params: &ChainParams,
    exec: &Exec,
) -> Result<Chain, Error> {
    params.check()?;
    let start = Instant::now();
    let proposed = msvs(volume, mask, &params.msvs, exec)?;
    let times = ChainTimes { msvs: start.elapsed(), ..ChainTimes::default() };
    let start = Instant::now();
    let curve = exec.run(|| curve(volume, mask, params, &proposed, exec))?;
    let best = curve.iter().reduce(|best, point| if point.bic < best.bic { point } else { best });
    let k = best.map_or(1, |point| point.k);
    let segmentation =
        kmvs(volume, mask, &KmvsParams { k, within: params.msvs.within, ..KmvsParams::default() }, exec)?;
    Ok(Chain {
        k_proposed: proposed.k_proposed,
        k_kept: segmentation.k,
        segmentation,
        curve,
        range_bandwidth: proposed.range_bandwidth,
        times: ChainTimes { kmvs: start.elapsed(), ..times },
    })
}

fn curve(
    volume: &Volume,
    mask: Option<&Mask>,
    params: &ChainParams,
    proposed: &Msvs,
    exec: &Exec,
) -> Result<Vec<ChainPoint>, Error> {
    let scope = selection::of(volume, mask, params.msvs.within, exec)?;
    let mask = scope.as_deref();
    let (histogram, unit) = match histogram::of(volume.voxels(), mask, exec)? {
        Some(histogram) => (histogram, volume.slope().abs()),
        None => rounded(volume, mask, params, proposed, exec)?,
    };
    let k_max = proposed.segmentation.k;
    let all = partitions(&histogram, k_max);
    let points = all.iter().enumerate().skip(params.k_min.min(all.len()).saturating_sub(1));
    let points = points.map(|(i, partition)| ChainPoint {
        k: i + 1,
        objective: (partition.inertia() * unit * unit).min(f64::MAX),
        bic: criterion(partition, BLUR * proposed.range_bandwidth / unit, unit),
    });
    let points: Vec<ChainPoint> = points.collect();
    for point in &points {
        exec.observer().iteration(Iteration { method: "msvs+kmvs", index: point.k as u64, value: point.bic });
    }
    Ok(points)
}

/// See [`msvs_kmvs`]; `blur` in steps of `unit` real units.
fn criterion(partition: &Partition, blur: f64, unit: f64) -> f64 {
    let n: f64 = partition.groups.iter().map(|g| g.count as f64).sum();
    let each = partition.groups.iter().map(|g| {
        // Spreads in real units; the logarithm of a square as twice that of the root, which neither vanishes nor overflows.
        let spread = g.sd.hypot(blur).ln() + unit.ln();
        let count = g.count as f64;
        count * ((count / n).ln() - 0.5 * (2.0 * std::f64::consts::PI).ln() - spread - 0.5)
    });
    let parameters = 3 * partition.groups.len() - 1;
    -2.0 * each.sum::<f64>() + parameters as f64 * n.ln()
}

/// A histogram of values rounded to the cells of mean shift, and the width of its steps (real units).
fn rounded(
    volume: &Volume,
    mask: Option<&Mask>,
    params: &ChainParams,
    proposed: &Msvs,
    exec: &Exec,
) -> Result<(Histogram, f64), Error> {
    let alone = MsvsParams {
        range_bandwidth: proposed.range_bandwidth,
        spatial_bandwidth: 0.0,
        ..params.msvs.clone()
    };
    let Some(found) = bandwidth::of(volume, mask, &alone, exec)? else {
        return Ok((Histogram::default(), 1.0));
    };
    let cells = Cells::new(volume, mask, &alone, &Bandwidths { spatial: 0.0, ..found }, exec)?;
    let counts = cells.count(volume, mask, exec)?;
    let occupied = counts.iter().enumerate().filter(|(_, n)| **n > 0);
    let step = |cell: usize| ((cells.range.value(cell as f64) - cells.range.low) / cells.range.width) as i64;
    // Far outliers are drawn in, so that the squares of the sums stay exact; they are a class of their own all the same.
    let far = 1 << 34;
    let mut histogram = Histogram::default();
    for (cell, n) in occupied {
        let value = step(cell).min(far);
        if histogram.values.last() == Some(&value) {
            *histogram.counts.last_mut().expect("one count a value") += u64::from(*n);
        } else {
            histogram.values.push(value);
            histogram.counts.push(u64::from(*n));
        }
    }
    Ok((histogram, cells.range.width))
}
