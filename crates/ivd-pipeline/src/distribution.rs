//! How a volume's values are spread: what an isovalue or a threshold is chosen by.

use ivd_core::{Scalar, Volume, with_voxels};
use rayon::prelude::*;
use serde_json::{Value, json};

/// Bins that quantiles are read from; integers of fewer values have one each, and so are exact.
const FINE: usize = 1 << 16;
/// Bins that are told.
const TOLD: usize = 24;
/// Shares of the voxels whose values are told.
const SHARES: [f64; 7] = [0.01, 0.05, 0.25, 0.5, 0.75, 0.95, 0.99];
/// Voxels counted as one piece.
const PIECE: usize = 1 << 20;

/// Histogram and quantiles of the values that are numbers, in real units; null where there are none.
///
/// - `histogram.edges`: borders of bins, ascending, one more than `histogram.voxels`; all are of one width but for the last, which may be narrower.
/// - `quantiles`: value below or at which a share of the voxels lies, to a 65,536th of the range.
pub(crate) fn distribution(volume: &Volume) -> Value {
    let Some([low, high]) = volume.stored_range().filter(|[low, high]| (high - low).is_finite()) else {
        return Value::Null;
    };
    let whole = volume.voxel_type().is_integer() && high - low < FINE as f64;
    // Of whole numbers each has a bin, whose middle it is.
    let (first, width, bins) = if whole {
        (low - 0.5, 1.0, (high - low) as usize + 1)
    } else if high > low {
        (low, (high - low) / FINE as f64, FINE)
    } else {
        (low - 0.5, 1.0, 1)
    };
    let mut counts = with_voxels!(volume.voxels(), voxels => count(voxels, first, width, bins));
    let all: u64 = counts.iter().sum();
    // Real values may fall as the stored ones rise.
    let falls = volume.slope() < 0.0;
    if falls {
        counts.reverse();
    }
    let real = |bin: f64| {
        let bin = if falls { bins as f64 - bin } else { bin };
        volume.slope().mul_add(first + bin * width, volume.intercept())
    };
    let value = |share: f64| {
        let wanted = ((share * all as f64).ceil() as u64).max(1);
        let mut below = 0;
        let bin = counts.iter().position(|&count| {
            below += count;
            below >= wanted
        });
        real(bin.unwrap_or(0) as f64 + 0.5)
    };
    let quantiles: Vec<Value> =
        SHARES.into_iter().map(|share| json!({ "share": share, "value": value(share) })).collect();
    let wide = bins.div_ceil(TOLD);
    let told: Vec<u64> = counts.chunks(wide).map(|bins| bins.iter().sum()).collect();
    let edges: Vec<f64> = (0..=told.len()).map(|i| real((i * wide).min(bins) as f64)).collect();
    json!({ "histogram": { "edges": edges, "voxels": told }, "quantiles": quantiles })
}

/// How many numbers each bin has.
fn count<T: Scalar>(voxels: &[T], first: f64, width: f64, bins: usize) -> Vec<u64> {
    let of = |piece: &[T]| {
        let mut counts = vec![0_u64; bins];
        for value in piece.iter().map(|v| v.to_f64()).filter(|v| v.is_finite()) {
            counts[(((value - first) / width) as usize).min(bins - 1)] += 1;
        }
        counts
    };
    voxels.par_chunks(PIECE).map(of).reduce(
        || vec![0; bins],
        |mut all, counts| {
            all.iter_mut().zip(counts).for_each(|(all, count)| *all += count);
            all
        },
    )
}

#[cfg(test)]
mod tests {
    use ivd_core::{Grid, Voxels};

    use super::*;

    fn told(voxels: Voxels, slope: f64, intercept: f64) -> Value {
        let grid = Grid::with_spacing([voxels.len(), 1, 1], [1.0; 3]).unwrap();
        distribution(&Volume::with_scale(grid, voxels, slope, intercept).unwrap())
    }

    fn quantile(told: &Value, share: f64) -> f64 {
        let all = told["quantiles"].as_array().unwrap();
        all.iter().find(|q| q["share"] == share).unwrap()["value"].as_f64().unwrap()
    }

    #[test]
    fn quantiles_of_whole_numbers_are_their_values_in_real_units() {
        // 100 values, each as often as the others: the 25th is a quarter.
        let numbers: Vec<i16> = (0..100).map(|i| (i * 37 % 100) - 50).collect();
        let told = told(Voxels::from(numbers), 2.0, -1000.0);
        assert_eq!(quantile(&told, 0.25), 2.0 * (24.0 - 50.0) - 1000.0);
        assert_eq!(quantile(&told, 0.99), 2.0 * (98.0 - 50.0) - 1000.0);
        let voxels = told["histogram"]["voxels"].as_array().unwrap();
        assert_eq!(voxels.iter().map(|n| n.as_u64().unwrap()).sum::<u64>(), 100);
        let edges = told["histogram"]["edges"].as_array().unwrap();
        assert_eq!((edges[0].as_f64(), edges[edges.len() - 1].as_f64()), (Some(-1101.0), Some(-901.0)));
        assert_eq!(edges.len(), voxels.len() + 1);
    }

    #[test]
    fn values_that_fall_as_the_stored_ones_rise_are_told_in_their_own_order() {
        let told = told(Voxels::from((0..100).collect::<Vec<u8>>()), -1.0, 0.0);
        assert_eq!((quantile(&told, 0.01), quantile(&told, 0.99)), (-99.0, -1.0));
        let edges: Vec<f64> =
            told["histogram"]["edges"].as_array().unwrap().iter().map(|e| e.as_f64().unwrap()).collect();
        assert!(edges.is_sorted() && edges[0] == -99.5);
    }

    #[test]
    fn numbers_alone_count_and_one_value_has_one_bin() {
        let told_floats = told(Voxels::from(vec![f32::NAN, 0.0, 1.0, f32::INFINITY, 0.25]), 1.0, 0.0);
        assert!((quantile(&told_floats, 0.5) - 0.25).abs() < 1e-4, "{told_floats}");
        let flat = told(Voxels::from(vec![7_u8; 9]), 1.0, 0.0);
        assert_eq!((quantile(&flat, 0.5), flat["histogram"]["voxels"].clone()), (7.0, json!([9])));
        assert_eq!(told(Voxels::from(vec![f32::NAN]), 1.0, 0.0), Value::Null);
        assert_eq!(
            told(Voxels::from(vec![f64::MIN, f64::MAX]), 1.0, 0.0),
            Value::Null,
            "a range without a width"
        );
    }
}
