//! The values that a table's samples are spread over.

use ivd_core::{Scalar, Volume, with_voxels};

use crate::Error;
use crate::statistics::ClassStatistics;

/// Largest magnitude of a value: the squares of 2⁵⁰ such values have a sum.
const MOST: f64 = 1e140;
/// Voxels that the bulk of the values is judged by.
const LOOKED_AT: usize = 1 << 17;
/// Share of the voxels below the bulk of the values, and above it.
const TAIL: f64 = 1e-4;
/// A table is spread over the whole range, unless that is more than so many times as wide as the bulk of the values …
const SPARSE: f64 = 16.0;
/// … which a class belongs to if it has this share of the voxels and this many.
const CLASS_SHARE: f64 = 1e-5;
const CLASS_VOXELS: u64 = 8;

/// Smallest and largest real value; zeros without data.
pub(crate) fn range_of(volume: &Volume) -> Result<[f64; 2], Error> {
    let [low, high] = volume.range().unwrap_or([0.0, 0.0]);
    if low >= -MOST && high <= MOST { Ok([low, high]) } else { Err(Error::TooWide { low, high, most: MOST }) }
}

/// Range of the table: that of the volume, `whole`, unless a few voxels stretch it so far that the rest would share a sample or a few. Then it is
/// that of the bulk of the values and of the means of the classes that aren't just a few voxels, with its width to spare on either side. Values
/// beyond it look like those at its end.
pub(crate) fn table_range(volume: &Volume, classes: &[ClassStatistics], whole: [f64; 2]) -> [f64; 2] {
    let Some(mut bulk) = bulk(volume) else { return whole };
    let all: u64 = classes.iter().map(|class| class.voxels).sum();
    let least = CLASS_VOXELS.max((CLASS_SHARE * all as f64) as u64);
    for class in classes.iter().filter(|class| class.voxels >= least) {
        bulk = [bulk[0].min(class.mean), bulk[1].max(class.mean)];
    }
    let width = bulk[1] - bulk[0];
    if width <= 0.0 || whole[1] - whole[0] <= SPARSE * width {
        return whole;
    }
    [(bulk[0] - width).max(whole[0]), (bulk[1] + width).min(whole[1])]
}

/// Real values that all but the tails lie between, by an even choice of the voxels; `None` without data.
fn bulk(volume: &Volume) -> Option<[f64; 2]> {
    // Odd: not a multiple of a row's length, so that it isn't the same columns over and over.
    let step = volume.grid().len().div_ceil(LOOKED_AT) | 1;
    let mut values: Vec<f64> = with_voxels!(volume.voxels(), stored => {
        let chosen = stored.iter().step_by(step).filter(|value| value.is_data());
        chosen.map(|value| volume.real(value.to_f64())).collect()
    });
    let tail = (TAIL * values.len() as f64) as usize;
    let last = values.len().checked_sub(1 + tail)?;
    let mut at = |i: usize| *values.select_nth_unstable_by(i, f64::total_cmp).1;
    Some([at(tail), at(last)])
}

#[cfg(test)]
mod tests {
    use super::*;
    use ivd_core::{Grid, Voxels};

    fn volume(value: impl Fn(usize) -> f32) -> Volume {
        let grid = Grid::with_spacing([30; 3], [1.0; 3]).unwrap();
        let values: Vec<f32> = (0..grid.len()).map(value).collect();
        Volume::new(grid, Voxels::from(values)).unwrap()
    }

    fn class(mean: f64, voxels: u64) -> ClassStatistics {
        ClassStatistics { id: 1, voxels, mean, sd: 1.0, border_strength: 0.0, on_sides: [0; 3] }
    }

    #[test]
    fn a_hot_voxel_does_not_stretch_the_table() {
        let hot = volume(|i| if i == 77 { 1e6 } else { (i % 11) as f32 });
        assert_eq!(table_range(&hot, &[class(2.0, 20_000), class(8.0, 6_999)], [0.0, 1e6]), [0.0, 20.0]);
        let classes = [class(5.0, 26_999), class(1e6, 1)];
        assert_eq!(table_range(&hot, &classes, [0.0, 1e6]), [0.0, 20.0], "a class of one voxel");
    }

    #[test]
    fn real_classes_and_plain_ranges_keep_the_whole() {
        let plain = volume(|i| (i % 101) as f32);
        assert_eq!(table_range(&plain, &[class(50.0, 27_000)], [0.0, 100.0]), [0.0, 100.0]);
        let small = volume(|i| if i < 10 { 1e4 } else { (i % 11) as f32 });
        let classes = [class(5.0, 26_990), class(1e4, 10)];
        assert_eq!(table_range(&small, &classes, [0.0, 1e4]), [0.0, 1e4], "a small part of its own class");
        let one = volume(|i| f32::from(u8::from(i < 2)));
        assert_eq!(table_range(&one, &[class(0.0, 27_000)], [0.0, 1.0]), [0.0, 1.0], "no bulk to go by");
        assert_eq!(table_range(&volume(|_| f32::NAN), &[], [0.0; 2]), [0.0; 2]);
    }
}
