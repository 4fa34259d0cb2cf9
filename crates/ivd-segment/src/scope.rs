//! Which voxels a method looks at.

use std::borrow::Cow;

use ivd_core::{Error as CoreError, Exec, Mask, ParamError, Scalar, Volume, parallel, with_voxels};

use crate::Error;

/// Voxels that one task looks at.
const CHUNK: usize = 1 << 16;

/// # Errors
/// [`ParamError`] where a range isn't two finite numbers, the lower first.
pub(crate) fn check_range(range: Option<[f64; 2]>) -> Result<(), ParamError> {
    match range {
        Some([low, high]) if !(low.is_finite() && high.is_finite() && low <= high) => Err(ParamError::new(
            "range",
            format!("{low} to {high}"),
            "give two finite values, the lower one first",
        )),
        _ => Ok(()),
    }
}

/// The voxels inside the mask whose real value lies in `range` (both ends belong to it). `None` stands for all voxels.
///
/// # Errors
/// [`CoreError::GridMismatch`] where the mask lies on another grid, or the memory limit.
pub(crate) fn of<'a>(
    volume: &Volume,
    mask: Option<&'a Mask>,
    range: Option<[f64; 2]>,
    exec: &Exec,
) -> Result<Option<Cow<'a, Mask>>, Error> {
    crate::segmentation::check_mask(volume, mask)?;
    let Some([low, high]) = range else { return Ok(mask.map(Cow::Borrowed)) };
    let mut inside = exec.bulk::<u8>("the voxels within the range", volume.grid().len())?;
    with_voxels!(volume.voxels(), slice => {
        parallel::try_for_each_piece_mut(&mut inside, CHUNK, &|i, inside| {
            exec.check_cancelled()?;
            let voxels = &slice[i * CHUNK..][..inside.len()];
            let mask = mask.map(|m| &m.inside()[i * CHUNK..][..voxels.len()]);
            for (j, (inside, v)) in inside.iter_mut().zip(voxels).enumerate() {
                let value = volume.real(v.to_f64());
                *inside = u8::from((low..=high).contains(&value) && mask.is_none_or(|m| m[j] != 0));
            }
            Ok::<_, CoreError>(())
        })
    })?;
    Ok(Some(Cow::Owned(Mask::new(volume.grid().clone(), inside.into_buffer())?)))
}

#[cfg(test)]
mod tests {
    use super::*;
    use ivd_core::{Grid, Voxels};

    #[test]
    fn a_range_cuts_the_mask_down_and_counts_both_ends() {
        let grid = Grid::with_spacing([5, 1, 1], [1.0; 3]).unwrap();
        let volume =
            Volume::with_scale(grid.clone(), Voxels::from(vec![f32::NAN, 1.0, 2.0, 3.0, 4.0]), -2.0, 1.0)
                .unwrap();
        let mask = Mask::new(grid, vec![1_u8, 1, 1, 1, 0].into()).unwrap();
        let exec = Exec::default();
        // Real values: NaN, -1, -3, -5, -7.
        let found = of(&volume, None, Some([-7.0, -3.0]), &exec).unwrap().unwrap();
        assert_eq!(found.inside(), [0, 0, 1, 1, 1]);
        let found = of(&volume, Some(&mask), Some([-7.0, -3.0]), &exec).unwrap().unwrap();
        assert_eq!(found.inside(), [0, 0, 1, 1, 0]);
        assert!(of(&volume, None, None, &exec).unwrap().is_none());
        for bad in [[2.0, 1.0], [f64::NAN, 1.0], [0.0, f64::INFINITY]] {
            assert!(check_range(Some(bad)).is_err());
        }
    }
}
