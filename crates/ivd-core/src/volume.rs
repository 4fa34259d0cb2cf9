use std::ops::Range;
use std::sync::OnceLock;

use serde::{Deserialize, Serialize};

use crate::{
    BrickIndex, BrickRanges, Error, Exec, Grid, Reference, Scalar, VoxelIndex, VoxelType, Voxels, parallel,
    with_voxels,
};

/// What a scan was made with.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Modality {
    /// Computed tomography.
    ComputedTomography,
    /// Magnetic resonance.
    MagneticResonance,
}

impl Modality {
    /// Its name in DICOM.
    pub fn name(self) -> &'static str {
        match self {
            Self::ComputedTomography => "CT",
            Self::MagneticResonance => "MR",
        }
    }
}

/// A scalar volume: stored voxels, the slope and intercept that make them real, and the grid that places them.
///
/// `real = slope · stored + intercept`. Kernels work on stored values and map thresholds into stored space, so that
/// integer data keeps exact comparisons. Slope is finite and not 0; intercept is finite.
#[derive(Debug)]
pub struct Volume {
    grid: Grid,
    voxels: Voxels,
    slope: f64,
    intercept: f64,
    modality: Option<Modality>,
    bricks: OnceLock<BrickIndex>,
    /// Set once every voxel was touched.
    touched: OnceLock<()>,
}

impl Clone for Volume {
    fn clone(&self) -> Self {
        Self {
            grid: self.grid.clone(),
            voxels: self.voxels.clone(),
            slope: self.slope,
            intercept: self.intercept,
            modality: self.modality,
            bricks: self.bricks.clone(),
            touched: self.touched.clone(),
        }
    }
}

impl Volume {
    /// A volume whose stored values are its real values.
    ///
    /// # Errors
    /// [`Error::Inconsistent`] where the number of voxels isn't the grid's.
    pub fn new(grid: Grid, voxels: Voxels) -> Result<Self, Error> {
        Self::with_scale(grid, voxels, 1.0, 0.0)
    }

    /// A volume with `real = slope · stored + intercept`.
    ///
    /// # Errors
    /// [`Error::Inconsistent`] where the number of voxels isn't the grid's, or the scale isn't finite, or the slope is 0.
    pub fn with_scale(grid: Grid, voxels: Voxels, slope: f64, intercept: f64) -> Result<Self, Error> {
        if voxels.len() != grid.len() {
            return Err(Error::Inconsistent {
                what: "volume",
                problem: format!("{} voxels for a grid of {:?}", voxels.len(), grid.dims()),
            });
        }
        if !slope.is_finite() || slope == 0.0 || !intercept.is_finite() {
            return Err(Error::Inconsistent {
                what: "volume",
                problem: format!("slope {slope}, intercept {intercept}: both finite, slope not 0"),
            });
        }
        let (bricks, touched) = (OnceLock::new(), OnceLock::new());
        Ok(Self { grid, voxels, slope, intercept, modality: None, bricks, touched })
    }

    /// The same with what it was made with.
    #[must_use]
    pub fn with_modality(self, modality: Option<Modality>) -> Self {
        Self { modality, ..self }
    }

    /// What it was made with, where its file says so. What is made of a volume says nothing of it.
    pub fn modality(&self) -> Option<Modality> {
        self.modality
    }

    /// The same on a [grid that is known to lie in the patient's space or not](Grid::with_patient_space).
    #[must_use]
    pub fn with_patient_space(self, in_patient: bool) -> Self {
        Self { grid: self.grid.with_patient_space(in_patient), ..self }
    }

    /// The same on a [grid with what is known of world space](Grid::with_reference).
    #[must_use]
    pub fn with_reference(self, reference: Reference) -> Self {
        Self { grid: self.grid.with_reference(reference), ..self }
    }

    /// Where the voxels lie.
    pub fn grid(&self) -> &Grid {
        &self.grid
    }

    /// The stored voxels; all of them count as touched. Whoever reads a part says so by [`Volume::layers`].
    pub fn voxels(&self) -> &Voxels {
        self.touched.get_or_init(|| self.touch(0..self.voxels.len()));
        &self.voxels
    }

    /// The stored voxels, to be changed: copied first where they are shared. The index of the bricks' ranges is forgotten.
    pub fn voxels_mut(&mut self) -> &mut Voxels {
        self.voxels();
        self.bricks = OnceLock::new();
        &mut self.voxels
    }

    /// Changes voxels that lie in blocks of [`BRICK`](crate::BRICK)³ voxels (linear indices, as those of bricks), and no others: copied first where they
    /// are shared. An index of the bricks' ranges that is known stays so: those of the blocks are found anew.
    pub fn change_blocks<R>(&mut self, blocks: &[usize], change: impl FnOnce(&mut Voxels) -> R) -> R {
        self.voxels();
        // Nobody sees old ranges where the change doesn't come to its end.
        let known = self.bricks.take();
        let changed = change(&mut self.voxels);
        if let Some(mut index) = known {
            index.update(&self.grid, &self.voxels, blocks);
            let _ = self.bricks.set(index);
        }
        changed
    }

    /// The stored voxels, of which the caller reads those of the layers (voxel indices along z) and no others: the rest of a
    /// mapped file may not have been checked, nor ever be read.
    pub fn layers(&self, layers: impl IntoIterator<Item = Range<usize>>) -> &Voxels {
        if self.touched.get().is_none() {
            let [nx, ny, nz] = self.grid.dims();
            for Range { start, end } in layers {
                self.touch(nx * ny * start..nx * ny * end.min(nz));
            }
        }
        &self.voxels
    }

    fn touch(&self, linear: Range<usize>) {
        self.voxels.touch(linear);
    }

    /// Whether voxels that were touched aren't what they should be (a file was damaged): what was made from them is worth
    /// nothing.
    pub fn damaged(&self) -> bool {
        self.voxels.damaged()
    }

    /// Stored type.
    pub fn voxel_type(&self) -> VoxelType {
        self.voxels.voxel_type()
    }

    /// Factor from stored to real values.
    pub fn slope(&self) -> f64 {
        self.slope
    }

    /// Offset from stored to real values.
    pub fn intercept(&self) -> f64 {
        self.intercept
    }

    /// The real value of a stored one.
    #[inline]
    pub fn real(&self, stored: f64) -> f64 {
        self.slope * stored + self.intercept
    }

    /// The stored value (not rounded) of a real one.
    #[inline]
    pub fn stored(&self, real: f64) -> f64 {
        (real - self.intercept) / self.slope
    }

    /// A copy as an array of real values, indexed `[[x, y, z]]`, for work with `ndarray`.
    pub fn to_array(&self) -> ndarray::Array3<f64> {
        use ndarray::ShapeBuilder;
        let values: Vec<f64> =
            with_voxels!(self.voxels(), slice => slice.iter().map(|v| self.real(v.to_f64())).collect());
        ndarray::Array3::from_shape_vec(self.grid.dims().f(), values)
            .expect("checked in with_scale: one value a voxel")
    }

    /// A volume from an array indexed `[[x, y, z]]`, in any memory layout.
    ///
    /// # Errors
    /// [`Error::Inconsistent`] where the array's shape isn't the grid's.
    pub fn from_array<T: Scalar>(grid: Grid, array: &ndarray::Array3<T>) -> Result<Self, Error> {
        if array.shape() != grid.dims() {
            return Err(Error::Inconsistent {
                what: "volume",
                problem: format!("array of {:?} for a grid of {:?}", array.shape(), grid.dims()),
            });
        }
        // Reversed axes iterate with x fastest.
        let values: Vec<T> = array.t().iter().copied().collect();
        Self::new(grid, T::wrap(values.into()))
    }

    /// The real value of a voxel.
    pub fn value(&self, index: VoxelIndex) -> f64 {
        self.real(self.voxels().get(self.grid.linear(index)))
    }

    /// Real values of about so many voxels, evenly chosen in memory; those without data are left out.
    pub fn sampled(&self, about: usize) -> impl Iterator<Item = f64> {
        let len = self.grid.len();
        let chosen = (0..len).step_by((len / about.max(1)).max(1));
        chosen.map(|i| self.real(self.voxels().get(i))).filter(|value| value.is_finite())
    }

    /// Min–max of the stored values by brick; computed at the first call, on the calling rayon pool.
    pub fn bricks(&self) -> &BrickIndex {
        self.bricks.get_or_init(|| BrickIndex::build(&self.grid, self.voxels()))
    }

    /// The same, where it isn't known yet by the pass [`BrickRanges`], which a device may make.
    ///
    /// # Errors
    /// Where the device fails.
    pub fn find_bricks(&self, exec: &Exec) -> Result<&BrickIndex, Error> {
        exec.run(|| {
            if self.bricks.get().is_none() {
                let found = exec.launch::<BrickRanges>(&(&self.grid, self.voxels()))?;
                let _ = self.bricks.set(found);
            }
            Ok(self.bricks())
        })
    }

    /// Attaches an index that was stored beside the voxels, so that it need not be computed.
    ///
    /// # Errors
    /// [`Error::Inconsistent`] where its shape isn't that of this volume's bricks.
    pub fn attach_bricks(&self, index: BrickIndex) -> Result<(), Error> {
        if index.dims() != BrickIndex::dims_for(self.grid.dims()) {
            return Err(Error::Inconsistent {
                what: "brick index",
                problem: format!("{:?} bricks for a grid of {:?}", index.dims(), self.grid.dims()),
            });
        }
        let _ = self.bricks.set(index);
        Ok(())
    }

    /// Smallest and largest real value, exactly; `None` where no voxel holds data. The index answers where its `f32` holds
    /// every stored value; the wider types are looked through.
    pub fn range(&self) -> Option<[f64; 2]> {
        let [a, b] = self.stored_range()?.map(|stored| self.real(stored));
        Some([a.min(b), a.max(b)])
    }

    /// Smallest and largest stored value, exactly; `None` where no voxel holds data. What an intercept swallows of real values
    /// is told apart here.
    pub fn stored_range(&self) -> Option<[f64; 2]> {
        match &self.voxels {
            Voxels::U32(v) => extremes(v),
            Voxels::I32(v) => extremes(v),
            Voxels::F64(v) => extremes(v),
            _ => self.bricks().total().map(|(lo, hi)| [f64::from(lo), f64::from(hi)]),
        }
    }

    /// Number of voxels that are no data (NaN or infinite).
    pub fn missing(&self) -> u64 {
        if self.voxels.voxel_type().is_integer() {
            return 0;
        }
        with_voxels!(self.voxels(), slice => parallel::map_pieces(slice.len(), PIECE, &|piece| {
            slice[piece].iter().filter(|v| !v.is_data()).count() as u64
        })
        .iter()
        .sum())
    }
}

impl PartialEq for Volume {
    fn eq(&self, other: &Self) -> bool {
        self.grid == other.grid
            && self.slope == other.slope
            && self.intercept == other.intercept
            && self.voxels() == other.voxels()
    }
}

/// Voxels that are looked at in one go.
const PIECE: usize = 1 << 16;

/// Smallest and largest value that is data.
fn extremes<T: Scalar>(values: &[T]) -> Option<[f64; 2]> {
    let none = [f64::INFINITY, f64::NEG_INFINITY];
    let join = |a: [f64; 2], b: [f64; 2]| [a[0].min(b[0]), a[1].max(b[1])];
    let parts = parallel::map_pieces(values.len(), PIECE, &|piece| {
        values[piece].iter().filter(|v| v.is_data()).fold(none, |all, v| join(all, [v.to_f64(), v.to_f64()]))
    });
    let [lo, hi] = parts.into_iter().fold(none, join);
    (lo <= hi).then_some([lo, hi])
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn stored_and_real_values_convert_both_ways() {
        let grid = Grid::with_spacing([2, 1, 1], [1.0; 3]).unwrap();
        let volume = Volume::with_scale(grid, Voxels::from(vec![10_i16, -4]), -2.0, 5.0).unwrap();
        assert_eq!(volume.value(VoxelIndex([0, 0, 0])), -15.0);
        assert_eq!(volume.stored(-15.0), 10.0);
        assert_eq!(volume.range(), Some([-15.0, 13.0]));
    }

    #[test]
    fn changed_voxels_have_ranges_of_their_own() {
        let grid = Grid::with_spacing([2, 1, 1], [1.0; 3]).unwrap();
        let mut volume = Volume::new(grid, Voxels::from(vec![1_u8, 2])).unwrap();
        let before = volume.clone();
        assert_eq!(volume.range(), Some([1.0, 2.0]));
        if let Voxels::U8(values) = volume.voxels_mut() {
            values.make_mut()[0] = 9;
        }
        assert_eq!((volume.range(), before.range()), (Some([2.0, 9.0]), Some([1.0, 2.0])));
    }

    #[test]
    fn arrays_are_indexed_x_y_z_in_any_layout() {
        let grid = Grid::with_spacing([3, 2, 4], [1.0; 3]).unwrap();
        let array = ndarray::Array3::from_shape_fn((3, 2, 4), |(x, y, z)| (x + 10 * y + 100 * z) as u16);
        let volume = Volume::from_array(grid, &array).unwrap();
        assert_eq!(volume.value(VoxelIndex([2, 1, 3])), 312.0);
        assert_eq!(volume.to_array()[[2, 1, 3]], 312.0);
    }

    #[test]
    fn wrong_lengths_and_scales_are_refused() {
        let grid = Grid::with_spacing([2, 2, 2], [1.0; 3]).unwrap();
        assert!(Volume::new(grid.clone(), Voxels::from(vec![0_u8; 7])).is_err());
        assert!(Volume::with_scale(grid.clone(), Voxels::from(vec![0_u8; 8]), 0.0, 0.0).is_err());
        assert!(Volume::with_scale(grid, Voxels::from(vec![0_u8; 8]), 1.0, f64::NAN).is_err());
    }

    #[test]
    fn the_range_of_wide_types_is_that_of_their_values() {
        let grid = Grid::with_spacing([3, 1, 1], [1.0; 3]).unwrap();
        let range = |voxels| Volume::new(grid.clone(), voxels).unwrap().range();
        // None of these is an `f32`, which the index would round outwards.
        let whole = vec![16_777_217_i32, 16_777_219, 16_777_218];
        assert_eq!(range(Voxels::from(whole)), Some([16_777_217.0, 16_777_219.0]));
        assert_eq!(range(Voxels::from(vec![u32::MAX, 7, 8])), Some([7.0, 4_294_967_295.0]));
        assert_eq!(range(Voxels::from(vec![1e300, f64::NAN, 0.1])), Some([0.1, 1e300]));
        assert_eq!(range(Voxels::from(vec![f64::NAN, f64::INFINITY, f64::NAN])), None);
    }

    #[test]
    fn nan_and_infinities_are_no_data() {
        let grid = Grid::with_spacing([4, 1, 1], [1.0; 3]).unwrap();
        let volume = Volume::new(grid, Voxels::from(vec![f32::NAN, 1.0, f32::INFINITY, -2.0])).unwrap();
        assert_eq!(volume.range(), Some([-2.0, 1.0]));
        assert_eq!(volume.missing(), 2);
    }
}
