use crate::{Buffer, Error, Grid, Volume, parallel};

/// A part of a volume: 1 inside, 0 outside, and optionally a level function that places its border between voxels.
#[derive(Debug, Clone, PartialEq)]
pub struct Mask {
    grid: Grid,
    inside: Buffer<u8>,
    level: Option<Buffer<f32>>,
}

impl Mask {
    /// A mask on `grid`; `inside` holds 0 or 1 a voxel, linear, x fastest.
    ///
    /// # Errors
    /// [`Error::Inconsistent`] where the length isn't the grid's or a value is neither 0 nor 1.
    pub fn new(grid: Grid, inside: Buffer<u8>) -> Result<Self, Error> {
        if inside.len() != grid.len() {
            return Err(Error::Inconsistent {
                what: "mask",
                problem: format!("{} voxels for a grid of {:?}", inside.len(), grid.dims()),
            });
        }
        // The greatest of many is found many at a time; a place, one after the other.
        let is_wrong = inside.chunks(1 << 12).any(|part| part.iter().fold(0, |most, &v| most.max(v)) > 1);
        if let Some(at) = is_wrong.then(|| inside.iter().position(|&v| v > 1)).flatten() {
            return Err(Error::Inconsistent {
                what: "mask",
                problem: format!("value {} at voxel {:?}, expected 0 or 1", inside[at], grid.index(at).0),
            });
        }
        Ok(Self { grid, inside, level: None })
    }

    /// The mask that a volume holds, such as a part that another program drew: what isn't 0 is inside, NaN apart.
    ///
    /// # Errors
    /// [`Error::Inconsistent`] where nothing is inside.
    pub fn from_volume(volume: &Volume) -> Result<Self, Error> {
        let is_inside = |i: usize| {
            let value = volume.real(volume.voxels().get(i));
            u8::from(value != 0.0 && !value.is_nan())
        };
        let inside: Vec<u8> = (0..volume.grid().len()).map(is_inside).collect();
        if inside.iter().all(|v| *v == 0) {
            return Err(Error::Inconsistent { what: "mask volume", problem: "every voxel is 0".to_owned() });
        }
        Self::new(volume.grid().clone(), inside.into())
    }

    /// Adds a level function (voxels), positive inside; its sign must agree with the mask where it isn't 0.
    ///
    /// # Errors
    /// [`Error::Inconsistent`] where the length isn't the grid's or a value is NaN.
    pub fn with_level(mut self, level: Buffer<f32>) -> Result<Self, Error> {
        if level.len() != self.grid.len() {
            return Err(Error::Inconsistent {
                what: "level function",
                problem: format!("{} values for a grid of {:?}", level.len(), self.grid.dims()),
            });
        }
        let has_nan =
            parallel::map_pieces(level.len(), 1 << 18, &|range| level[range].iter().any(|v| v.is_nan()));
        let first = has_nan.iter().any(|&has| has).then(|| level.iter().position(|v| v.is_nan())).flatten();
        if let Some(at) = first {
            return Err(Error::Inconsistent {
                what: "level function",
                problem: format!("no number at voxel {:?}", self.grid.index(at).0),
            });
        }
        self.level = Some(level);
        Ok(self)
    }

    /// Where the voxels lie.
    pub fn grid(&self) -> &Grid {
        &self.grid
    }

    /// 1 inside, 0 outside; linear, x fastest.
    pub fn inside(&self) -> &[u8] {
        &self.inside
    }

    /// The buffer behind [`Mask::inside`].
    pub fn buffer(&self) -> &Buffer<u8> {
        &self.inside
    }

    /// The level function (voxels), where there is one.
    pub fn level(&self) -> Option<&Buffer<f32>> {
        self.level.as_ref()
    }

    /// Number of voxels inside.
    pub fn count(&self) -> u64 {
        use rayon::prelude::*;
        self.inside.par_chunks(1 << 16).map(|c| c.iter().map(|&v| u64::from(v)).sum::<u64>()).sum()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Voxels;

    #[test]
    fn what_is_not_0_is_inside_of_a_volume_taken_for_a_mask() {
        let volume = |voxels: Vec<f32>| {
            let grid = Grid::with_spacing([2, 2, 1], [1.0; 3]).unwrap();
            Volume::new(grid, Voxels::from(voxels)).unwrap()
        };
        let mask = Mask::from_volume(&volume(vec![0.0, 3.0, -1.0, f32::NAN])).unwrap();
        assert_eq!(mask.inside(), [0, 1, 1, 0]);
        assert!(Mask::from_volume(&volume(vec![0.0; 4])).unwrap_err().to_string().contains("every voxel"));
    }

    #[test]
    fn masks_hold_0_and_1_and_levels_are_numbers() {
        let grid = Grid::with_spacing([2, 1, 1], [1.0; 3]).unwrap();
        assert!(Mask::new(grid.clone(), vec![0, 2].into()).unwrap_err().to_string().contains("[1, 0, 0]"));
        let mask = Mask::new(grid, vec![0, 1].into()).unwrap();
        assert_eq!(mask.count(), 1);
        assert!(mask.clone().with_level(vec![-1.0, f32::NAN].into()).is_err());
        assert!(mask.with_level(vec![-1.0, 2.0].into()).is_ok());
    }
}
