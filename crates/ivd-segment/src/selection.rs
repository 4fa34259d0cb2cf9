//! Which voxels a method looks at.

use std::borrow::Cow;

use ivd_core::{Error, Exec, Mask, ParamError, Scalar, Volume, parallel, with_voxels};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Voxels that one task looks at.
const CHUNK: usize = 1 << 16;

/// Which values count.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(default)]
pub struct Within {
    /// Only voxels whose value lies between these count, both included.
    #[schemars(extend("x-unit" = "real units"))]
    pub range: Option<[f64; 2]>,
}

impl Within {
    /// All values between two, both included.
    pub fn range(low: f64, high: f64) -> Self {
        Self { range: Some([low, high]) }
    }

    /// # Errors
    /// [`ParamError`] where the higher value comes first.
    pub(crate) fn check(self) -> Result<(), ParamError> {
        match self.range {
            Some([low, high]) if low > high => {
                Err(ParamError::new("range", format!("{low} to {high}"), "give the lower value first"))
            }
            _ => Ok(()),
        }
    }
}

/// The voxels inside the mask whose real value lies within a range (both ends belong to it). `None` stands for all voxels.
///
/// # Errors
/// [`Error::GridMismatch`] where the mask lies on another grid, or the memory limit.
pub(crate) fn of<'a>(
    volume: &Volume,
    mask: Option<&'a Mask>,
    within: Within,
    exec: &Exec,
) -> Result<Option<Cow<'a, Mask>>, Error> {
    crate::segmentation::check_mask(volume, mask)?;
    let Some([low, high]) = within.range else { return Ok(mask.map(Cow::Borrowed)) };
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
            Ok::<_, Error>(())
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
        let found = of(&volume, None, Within::range(-7.0, -3.0), &exec).unwrap().unwrap();
        assert_eq!(found.inside(), [0, 0, 1, 1, 1]);
        let found = of(&volume, Some(&mask), Within::range(-7.0, -3.0), &exec).unwrap().unwrap();
        assert_eq!(found.inside(), [0, 0, 1, 1, 0]);
        assert!(of(&volume, None, Within::default(), &exec).unwrap().is_none());
        assert!(Within::range(2.0, 1.0).check().is_err() && Within::range(2.0, 2.0).check().is_ok());
    }
}
