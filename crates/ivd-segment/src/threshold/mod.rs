//! Classes between given values.

use ivd_core::op::check_fields;
use ivd_core::{Class, Exec, Labels, Mask, ParamError, Scalar, SpillVec, Volume, parallel, with_voxels};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::{Error, KmvsParams, Segmentation, histogram, kmvs, segmentation};

/// Voxels whose statistics are gathered together. The joins follow this division, never the threads.
const CHUNK: usize = 1 << 16;

/// Given thresholds.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(default)]
pub struct ThresholdParams {
    /// Thresholds, ascending: class `c` holds the values from `values[c - 2]` up to, but not including, `values[c - 1]`. Without any
    /// there is one, where two classes have the least inertia.
    #[schemars(length(max = 1023), extend("x-unit" = "real units"))]
    pub values: Vec<f64>,
}

impl ThresholdParams {
    /// # Errors
    /// [`ParamError`] names the field that is out of its domain.
    pub fn check(&self) -> Result<(), ParamError> {
        check_fields(self)?;
        self.check_together()
    }

    pub(crate) fn check_together(&self) -> Result<(), ParamError> {
        match self.values.windows(2).position(|w| w[0] >= w[1]) {
            Some(at) => {
                let problem = format!("threshold {} comes before {}", self.values[at], self.values[at + 1]);
                Err(ParamError::new("values", problem, "give ascending values"))
            }
            None => Ok(()),
        }
    }
}

/// Classes between thresholds of the real value. A value on a threshold belongs to the class above.
///
/// Class ids stay those of the intervals, so that a threshold keeps its meaning from volume to volume; an interval without
/// voxels isn't listed and doesn't count in `k`. Without thresholds this is [`kmvs`] with two classes, whose criterion is
/// that of Otsu 1979.
///
/// # Errors
/// [`Error`]: a bad parameter, a mask on another grid, the memory limit, or cancelled.
pub fn threshold(
    volume: &Volume,
    mask: Option<&Mask>,
    params: &ThresholdParams,
    exec: &Exec,
) -> Result<Segmentation, Error> {
    params.check()?;
    segmentation::check_mask(volume, mask)?;
    if params.values.is_empty() {
        return kmvs(volume, mask, &KmvsParams { k: 2, ..KmvsParams::default() }, exec);
    }
    exec.run(|| {
        let values = &params.values;
        let (ids, tallies) = match histogram::of(volume.voxels(), mask, exec)? {
            Some(histogram) => counted(volume, mask, values, &histogram, exec)?,
            None => with_voxels!(volume.voxels(), slice => scanned(volume, slice, mask, values, exec))?,
        };
        describe(volume, mask, values, ids, &tallies)
    })
}

/// Number, mean and sum of squared deviations of some values (Chan, Golub & LeVeque 1979).
#[derive(Debug, Clone, Copy, Default)]
struct Tally {
    count: u64,
    mean: f64,
    squares: f64,
}

impl Tally {
    fn join(&mut self, other: &Self) {
        if other.count > 0 {
            let total = (self.count + other.count) as f64;
            let off = other.mean - self.mean;
            self.squares += other.squares + off * off * (self.count as f64) * (other.count as f64) / total;
            self.mean += off * (other.count as f64 / total);
            self.count += other.count;
        }
    }
}

type Labelled = (SpillVec<u16>, Vec<Tally>);

/// Interval of a real value.
#[inline]
fn interval(value: f64, values: &[f64]) -> usize {
    values.partition_point(|t| *t <= value)
}

/// Labels and statistics through the histogram: one decision a value, not one a voxel.
fn counted(
    volume: &Volume,
    mask: Option<&Mask>,
    values: &[f64],
    histogram: &histogram::Histogram,
    exec: &Exec,
) -> Result<Labelled, Error> {
    let intervals: Vec<usize> =
        histogram.values.iter().map(|&v| interval(volume.real(v as f64), values)).collect();
    // Ascending stored values cross the thresholds in order (either order), so runs of equal intervals are groups.
    let starts = (0..intervals.len()).filter(|&i| i == 0 || intervals[i] != intervals[i - 1]);
    let ends: Vec<usize> = starts.chain(std::iter::once(intervals.len())).collect();
    let groups = kmvs::groups_between(histogram, &ends);
    let mut tallies = vec![Tally::default(); values.len() + 1];
    let mut ids = Vec::new();
    for (group, &start) in groups.iter().zip(&ends) {
        let slope = volume.slope();
        let (mean, squares) = (volume.real(group.mean), group.inertia * slope * slope);
        tallies[intervals[start]] = Tally { count: group.count, mean, squares };
        ids.push(intervals[start] as u16 + 1);
    }
    let cuts: Vec<f64> = groups.iter().skip(1).map(|g| g.range[0]).collect();
    Ok((crate::labelling::of(volume.voxels(), mask, &cuts, &ids, exec)?, tallies))
}

/// Labels and statistics voxel by voxel.
fn scanned<T: Scalar>(
    volume: &Volume,
    voxels: &[T],
    mask: Option<&Mask>,
    values: &[f64],
    exec: &Exec,
) -> Result<Labelled, Error> {
    let mut ids = exec.bulk("the labels", voxels.len())?;
    let parts: Vec<Vec<Tally>> = parallel::try_map_pieces_mut(&mut ids, CHUNK, &|i, ids: &mut [u16]| {
        exec.check_cancelled()?;
        let mut tallies = vec![Tally::default(); values.len() + 1];
        for (j, (id, v)) in ids.iter_mut().zip(&voxels[i * CHUNK..]).enumerate() {
            if v.is_data() && mask.is_none_or(|m| m.inside()[i * CHUNK + j] != 0) {
                let value = volume.real(v.to_f64()).clamp(f64::MIN, f64::MAX);
                let at = interval(value, values);
                *id = at as u16 + 1;
                tallies[at].join(&Tally { count: 1, mean: value, squares: 0.0 });
            }
        }
        Ok::<_, Error>(tallies)
    })?;
    let mut tallies = vec![Tally::default(); values.len() + 1];
    for part in &parts {
        tallies.iter_mut().zip(part).for_each(|(total, part)| total.join(part));
    }
    Ok((ids, tallies))
}

fn describe(
    volume: &Volume,
    mask: Option<&Mask>,
    values: &[f64],
    ids: SpillVec<u16>,
    tallies: &[Tally],
) -> Result<Segmentation, Error> {
    let occupied = tallies.iter().enumerate().filter(|(_, t)| t.count > 0);
    let classes: Vec<Class> = occupied
        .map(|(i, tally)| Class {
            id: i as u16 + 1,
            name: None,
            mean: tally.mean,
            sd: (tally.squares / tally.count as f64).sqrt().min(f64::MAX),
            voxels: tally.count,
            lower: i.checked_sub(1).map(|below| values[below]),
            upper: values.get(i).copied(),
        })
        .collect();
    Ok(Segmentation {
        k: classes.len(),
        iterations: 1,
        converged: true,
        objective: tallies.iter().map(|t| t.squares).sum::<f64>().min(f64::MAX),
        visited_fraction: segmentation::visited(volume, mask),
        gap: 0.0,
        labels: Labels::new(volume.grid().clone(), ids.into(), classes)?,
    })
}
