//! Voxels amid one material: where the number of components is looked for.
//!
//! Where two materials meet, a voxel holds a share of each. Such values lie between two densities and ask a criterion for components that
//! are no material; half of the voxels, those with the least slope, hardly have any.

use ivd_core::{Error, Exec, Mask, Scalar, Volume, parallel, with_voxels};

/// Voxels that one task looks at.
const CHUNK: usize = 1 << 16;
/// Most voxels that the median of the slope is taken from.
const SAMPLE: usize = 1 << 20;

/// The voxels inside the mask whose slope isn't above the median; where most have none at all (a background of one value), above the
/// median of those that have some. Voxels without a value aren't among them.
///
/// # Errors
/// The memory limit, or a cancelled run.
pub(super) fn amid(volume: &Volume, mask: Option<&Mask>, exec: &Exec) -> Result<Mask, Error> {
    let grid = volume.grid();
    let mut inside = exec.bulk::<u8>("the voxels amid one material", grid.len())?;
    with_voxels!(volume.voxels(), slice => {
        let slopes = Slopes { values: slice, inside: mask.map(Mask::inside), dims: grid.dims() };
        let most = slopes.limit();
        parallel::try_for_each_piece_mut(&mut inside, CHUNK, &|piece, inside| {
            exec.check_cancelled()?;
            for (i, inside) in inside.iter_mut().enumerate() {
                *inside = u8::from(slopes.at(piece * CHUNK + i).is_some_and(|slope| slope <= most));
            }
            Ok::<_, Error>(())
        })
    })?;
    Mask::new(grid.clone(), inside.into_buffer())
}

/// Squared slopes of a volume's values, a voxel.
struct Slopes<'a, T> {
    values: &'a [T],
    inside: Option<&'a [u8]>,
    dims: [usize; 3],
}

impl<T: Scalar> Slopes<'_, T> {
    /// The value, where there is one and it counts.
    fn value(&self, i: usize) -> Option<f64> {
        let value = self.values[i];
        (value.is_data() && self.inside.is_none_or(|inside| inside[i] != 0)).then(|| value.to_f64())
    }

    /// Sum over the axes of the squared difference between the neighbours; where one of them is missing, between the voxel and the other.
    fn at(&self, i: usize) -> Option<f64> {
        let here = self.value(i)?;
        let mut squares = 0.0;
        let mut stride = 1;
        for n in self.dims {
            let place = i / stride % n;
            let before = if place > 0 { self.value(i - stride) } else { None };
            let after = if place + 1 < n { self.value(i + stride) } else { None };
            squares += (after.unwrap_or(here) - before.unwrap_or(here)).powi(2);
            stride *= n;
        }
        Some(squares)
    }

    /// The squared slope up to which a voxel counts: from all voxels, or from as many as the sample has, spread by the golden ratio.
    fn limit(&self) -> f64 {
        let n = self.values.len();
        let mut sample: Vec<f64> = if n <= SAMPLE {
            (0..n).filter_map(|i| self.at(i)).collect()
        } else {
            let places = (0..SAMPLE).map(|k| ((k as f64 * GOLDEN).fract() * n as f64) as usize);
            places.filter_map(|i| self.at(i.min(n - 1))).collect()
        };
        let all = median(&mut sample);
        if all != Some(0.0) {
            // A mask may be so small that the sample misses it.
            return all.unwrap_or(f64::INFINITY);
        }
        sample.retain(|slope| *slope > 0.0);
        median(&mut sample).unwrap_or(0.0)
    }
}

/// Its multiples fill the unit interval evenly, whatever the number of voxels in a row.
const GOLDEN: f64 = 0.618_033_988_749_894_9;

/// The lower median.
fn median(values: &mut [f64]) -> Option<f64> {
    let middle = values.len().checked_sub(1)? / 2;
    Some(*values.select_nth_unstable_by(middle, f64::total_cmp).1)
}

#[cfg(test)]
mod tests {
    use super::*;
    use ivd_core::Grid;

    fn amid_of(dims: [usize; 3], values: Vec<f32>, mask: Option<Vec<u8>>) -> Vec<u8> {
        let grid = Grid::with_spacing(dims, [1.0; 3]).unwrap();
        let volume = Volume::new(grid.clone(), values.into()).unwrap();
        let mask = mask.map(|inside| Mask::new(grid, inside.into()).unwrap());
        amid(&volume, mask.as_ref(), &Exec::default()).unwrap().inside().to_vec()
    }

    #[test]
    fn voxels_at_a_border_between_two_levels_are_left_out() {
        let row = vec![0.0, 1.0, 0.0, 1.0, 50.0, 100.0, 101.0, 100.0, 101.0];
        assert_eq!(amid_of([9, 1, 1], row.clone(), None), [1, 1, 1, 0, 0, 0, 1, 1, 1]);
        // Also along the other axes.
        assert_eq!(amid_of([1, 9, 1], row.clone(), None), [1, 1, 1, 0, 0, 0, 1, 1, 1]);
        assert_eq!(amid_of([1, 1, 9], row, None), [1, 1, 1, 0, 0, 0, 1, 1, 1]);
    }

    #[test]
    fn a_background_of_one_value_doesnt_stand_for_all() {
        let row = vec![0.0; 12].into_iter().chain([0.0, 60.0, 63.0, 61.0, 65.0, 61.0]).collect();
        let found = amid_of([18, 1, 1], row, None);
        assert_eq!(found[..12], [1; 12]);
        assert_eq!(found[12..], [0, 0, 1, 1, 1, 1]);
    }

    #[test]
    fn voxels_outside_the_mask_or_without_value_neither_count_nor_border() {
        let row = vec![1.0, 2.0, 1.0, 900.0, f32::NAN, 2.0, 1.0, 2.0, f32::NEG_INFINITY, f32::NEG_INFINITY];
        let found = amid_of([10, 1, 1], row, Some(vec![1, 1, 1, 0, 1, 1, 1, 1, 1, 1]));
        assert_eq!((&found[3..5], &found[8..]), (&[0, 0][..], &[0, 0][..]));
        assert!(found[2] == 1 && found[5] == 1, "{found:?}");
        assert_eq!(amid_of([2, 1, 1], vec![f32::NAN; 2], None), [0, 0]);
        // The air of a logarithm, more than half of the voxels.
        let row = vec![f32::NEG_INFINITY; 20].into_iter().chain([1.0, 2.0, 1.0]).collect();
        assert!(amid_of([23, 1, 1], row, None)[20..].contains(&1));
    }
}
