//! Bandwidths, and the values that the data span.

use ivd_core::{Error, Exec, Mask, Scalar, Volume, parallel, with_voxels};
use rayon::prelude::*;

use super::params::MsvsParams;

/// Voxels that one task looks at.
const CHUNK: usize = 1 << 18;
/// Voxels that a rule for the bandwidth looks at.
const SAMPLE: usize = 1 << 18;

/// How wide the kernel is, and what it has to cover.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Bandwidths {
    /// Of the values (real units).
    pub(super) range: f64,
    /// In space (mm); 0 where space doesn't count.
    pub(super) spatial: f64,
    /// Smallest and largest real value.
    pub(super) values: [f64; 2],
}

/// `None` where there are no data.
pub(super) fn of(
    volume: &Volume,
    mask: Option<&Mask>,
    params: &MsvsParams,
    exec: &Exec,
) -> Result<Option<Bandwidths>, Error> {
    let Some((count, values)) = with_voxels!(volume.voxels(), slice => span(volume, slice, mask, exec))?
    else {
        return Ok(None);
    };
    let range = if params.range_bandwidth > 0.0 {
        params.range_bandwidth
    } else {
        automatic(with_voxels!(volume.voxels(), slice => sample(volume, slice, mask)), count, values)
    };
    Ok(Some(Bandwidths { range, spatial: params.spatial_bandwidth, values }))
}

/// The real value of a voxel, kept finite.
#[inline]
pub(super) fn real<T: Scalar>(volume: &Volume, voxel: T) -> f64 {
    volume.real(voxel.to_f64()).clamp(f64::MIN, f64::MAX)
}

/// Number of the data, and their smallest and largest real value.
fn span<T: Scalar>(
    volume: &Volume,
    voxels: &[T],
    mask: Option<&Mask>,
    exec: &Exec,
) -> Result<Option<(u64, [f64; 2])>, Error> {
    let spans: Vec<Option<(u64, T, T)>> = parallel::try_map_pieces(voxels.len(), CHUNK, &|piece| {
        exec.check_cancelled()?;
        let inside = mask.map(|m| &m.inside()[piece.clone()]);
        Ok::<_, Error>(span_of(&voxels[piece], inside))
    })?;
    let joined = spans
        .into_iter()
        .flatten()
        .reduce(|a, b| (a.0 + b.0, if b.1 < a.1 { b.1 } else { a.1 }, if b.2 > a.2 { b.2 } else { a.2 }));
    Ok(joined.map(|(count, low, high)| {
        let [low, high] = [real(volume, low), real(volume, high)];
        (count, [low.min(high), low.max(high)])
    }))
}

fn span_of<T: Scalar>(voxels: &[T], inside: Option<&[u8]>) -> Option<(u64, T, T)> {
    let data = |i: usize| voxels[i].is_data() && inside.is_none_or(|m| m[i] != 0);
    let first = (0..voxels.len()).find(|i| data(*i))?;
    let (mut count, mut low, mut high) = (0, voxels[first], voxels[first]);
    if inside.is_none() {
        for v in &voxels[first..] {
            let v = if v.is_data() { *v } else { low };
            low = if v < low { v } else { low };
            high = if v > high { v } else { high };
        }
        count = voxels.iter().filter(|v| v.is_data()).count() as u64;
    } else {
        for i in (first..voxels.len()).filter(|i| data(*i)) {
            count += 1;
            low = if voxels[i] < low { voxels[i] } else { low };
            high = if voxels[i] > high { voxels[i] } else { high };
        }
    }
    Some((count, low, high))
}

/// Real values at places spread over the volume, one in each of equal stretches, ascending. The place within its stretch
/// varies, so that no row or layer is met again and again.
fn sample<T: Scalar>(volume: &Volume, voxels: &[T], mask: Option<&Mask>) -> Vec<f64> {
    let stretches = voxels.len().min(SAMPLE);
    let mut values: Vec<f64> = (0..stretches)
        .filter_map(|s| {
            let at = |s: usize| (s as u128 * voxels.len() as u128 / stretches as u128) as usize;
            let hash = (s as u64).wrapping_mul(0x9e37_79b9_7f4a_7c15) >> 33;
            let place = at(s) + hash as usize % (at(s + 1) - at(s));
            let inside = mask.is_none_or(|m| m.inside()[place] != 0);
            (inside && voxels[place].is_data()).then(|| real(volume, voxels[place]))
        })
        .collect();
    values.par_sort_unstable_by(f64::total_cmp);
    values
}

/// The bandwidth for a sample (ascending) of `count` values that span `values`; see [`super::Msvs::range_bandwidth`].
fn automatic(sample: Vec<f64>, count: u64, values: [f64; 2]) -> f64 {
    let whole = (values[1] / 2.0 - values[0] / 2.0) * 2.0;
    let whole = whole.min(f64::MAX);
    let sample = if sample.is_empty() { values.to_vec() } else { sample };
    let quantile = |q: f64| sample[((sample.len() - 1) as f64 * q).round() as usize];
    let [low, high] = [quantile(0.01), quantile(0.99)];
    let middle = low.midpoint(high);
    let unit = (high / 2.0 - low / 2.0).max(f64::MIN_POSITIVE);
    // About the middle and in units of the range, so that no square overflows.
    let kept: Vec<f64> = sample.iter().map(|v| (v.clamp(low, high) - middle) / unit).collect();
    let mean = kept.iter().sum::<f64>() / kept.len() as f64;
    let sd = (kept.iter().map(|v| (v - mean).powi(2)).sum::<f64>() / kept.len() as f64).sqrt() * unit;
    let quartiles = (quantile(0.75) / 1.349 - quantile(0.25) / 1.349).min(f64::MAX);
    let spread = if quartiles > 0.0 { sd.min(quartiles) } else { sd };
    let silverman = 0.45 * spread * (count as f64).powf(-0.2);
    let mut steps: Vec<f64> = sample.windows(2).filter(|w| w[0] < w[1]).map(|w| w[1] - w[0]).collect();
    steps.sort_unstable_by(f64::total_cmp);
    let step = steps.get(steps.len() / 2).copied().unwrap_or(0.0);
    let found = silverman.max((high / 100.0 - low / 100.0).min(f64::MAX)).max(step);
    // Values that hardly vary: any bandwidth below their distance will do; without any distance, any at all.
    let found = if found > 0.0 { found } else { whole / 100.0 };
    if found > 0.0 { found } else { 1.0 }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_rule_follows_spread_steps_and_degenerate_samples() {
        let uniform: Vec<f64> = (0..1001).map(f64::from).collect();
        // Silverman: standard deviation 289 below the quartiles' 371; n^(-1/5) of 100000 is a tenth.
        let found = automatic(uniform, 100_000, [0.0, 1000.0]);
        assert!((found - 0.45 * 288.0 * 0.1).abs() < 0.5, "{found}");
        let steps: Vec<f64> = (0..1000).map(|i| f64::from(i / 250) * 16.0).collect();
        assert_eq!(automatic(steps, u64::MAX, [0.0, 48.0]), 16.0);
        assert_eq!(automatic(vec![5.0; 9], 9, [5.0, 5.0]), 1.0);
        assert_eq!(automatic(vec![5.0; 9], 9, [5.0, 105.0]), 1.0);
        for extreme in [vec![f64::MIN, 0.0, f64::MAX], vec![1e-310, 2e-310]] {
            let values = [extreme[0], extreme[extreme.len() - 1]];
            let found = automatic(extreme, 3, values);
            assert!(found.is_finite() && found > 0.0, "{found}");
        }
    }
}
