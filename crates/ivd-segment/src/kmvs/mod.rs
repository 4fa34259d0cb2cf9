//! k-means: on intensity alone the partition of the values into K classes of least inertia, globally; with a weight for places,
//! Lloyd's algorithm on place and value (see `spatial`).

mod integers;
mod optimal;
mod reals;
mod sorted;
mod spatial;

use ivd_core::{Exec, Mask, ParamError, Scalar, Volume, parallel, with_voxels};
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

use crate::groups::Partition;
use crate::{Error, Segmentation, histogram, scope, segmentation};

pub(crate) use integers::{groups_between, partition, partitions};
pub use spatial::{SpatialKmvs, kmvs_spatial};

/// Most classes that can be asked for.
const MOST_CLASSES: usize = 1024;

/// What `kmvs` looks for.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct KmvsParams {
    /// Number of classes, 1…1024. A volume with fewer distinct values gets as many classes as values.
    pub k: usize,
    /// Only voxels whose real value lies between these, both included.
    pub range: Option<[f64; 2]>,
    /// How many real units of the value a distance of 1 mm is worth, 0…1e100 (real units/mm). The axes of a sheared grid are
    /// measured as perpendicular. 0: intensity alone counts, and the result is the global optimum; the fields below have no
    /// effect then.
    pub spatial_weight: f64,
    /// What the draw of start centroids begins with.
    pub seed: u64,
    /// Most iterations of Lloyd's algorithm, at least 1.
    pub max_iterations: u64,
    /// Relative fall of the inertia in one iteration at which to stop, 0…1; 0: until no label changes.
    pub tolerance: f64,
    /// Start centroids, `[x, y, z, value]` (mm from the first voxel along the grid's axes; real units), shape `[k]`, instead of
    /// drawn ones.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub start: Option<Vec<[f64; 4]>>,
}

impl Default for KmvsParams {
    fn default() -> Self {
        Self {
            k: 4,
            range: None,
            spatial_weight: 0.0,
            seed: 1,
            max_iterations: 300,
            tolerance: 0.0,
            start: None,
        }
    }
}

impl KmvsParams {
    /// # Errors
    /// [`ParamError`] names the field that is out of its domain.
    pub fn check(&self) -> Result<(), ParamError> {
        if !(1..=MOST_CLASSES).contains(&self.k) {
            return Err(ParamError::new("k", format!("{} classes", self.k), format!("use 1…{MOST_CLASSES}")));
        }
        let within = |field, value: f64, most: f64| {
            if (0.0..=most).contains(&value) {
                Ok(())
            } else {
                Err(ParamError::new(field, format!("{value}"), format!("use 0…{most}")))
            }
        };
        within("spatial_weight", self.spatial_weight, spatial::LARGEST)?;
        within("tolerance", self.tolerance, 1.0)?;
        if self.max_iterations == 0 {
            return Err(ParamError::new("max_iterations", "0", "use at least 1"));
        }
        spatial::check_start(self.start.as_deref(), self.k)?;
        scope::check_range(self.range)
    }
}

/// Classes of least inertia (sum of squared distances of the values from their class's mean): the global optimum of k-means
/// on intensity, by dynamic programming (Grønlund et al. 2017, arXiv:1701.07204).
///
/// - 8 and 16 bit volumes: over the histogram, with exact integer sums; O(N + K B log B) for B distinct values.
/// - Other types: the values are sorted and bounds narrow down where the optimal cuts lie; exact too, to a relative 1e-12 of
///   the inertia, and [`Segmentation::gap`] says so. O(N log N), and a copy of the voxels in memory.
///
/// Voxels that are no data, or outside `mask`, get label 0. Among partitions of equal inertia the one with the lowest cuts
/// wins. In an optimal partition no value lies midway between two means, so the classes' crossings are those midpoints.
/// A constant volume has one class; a volume without data has none, and all its labels are 0.
///
/// With a [`KmvsParams::spatial_weight`] above 0 places count as well, and the result is [`kmvs_spatial`]'s: a local optimum.
///
/// # Errors
/// [`Error::Core`]: a bad parameter, a mask on another grid, the memory limit, or cancelled.
pub fn kmvs(
    volume: &Volume,
    mask: Option<&Mask>,
    params: &KmvsParams,
    exec: &Exec,
) -> Result<Segmentation, Error> {
    params.check()?;
    if params.spatial_weight > 0.0 {
        return Ok(kmvs_spatial(volume, mask, params, exec)?.segmentation);
    }
    exec.run(|| {
        let scope = scope::of(volume, mask, params.range, exec)?;
        let mask = scope.as_deref();
        let partition = match histogram::of(volume.voxels(), mask, exec)? {
            Some(histogram) => integers::partition(&histogram, params.k),
            None => with_voxels!(volume.voxels(), slice => sample(slice, mask, params.k, exec))?,
        };
        segmentation::label(volume, mask, &partition, exec)
    })
}

/// Voxels that are looked at in one go.
const PIECE: usize = 1 << 16;

/// The optimum over the data inside the mask, sorted.
fn sample<T: Scalar>(voxels: &[T], mask: Option<&Mask>, k: usize, exec: &Exec) -> Result<Partition, Error> {
    exec.check_memory("sorting the voxels", size_of_val(voxels) as u64)?;
    let parts = parallel::map_pieces(voxels.len(), PIECE, &|piece| {
        let inside = mask.map(|m| &m.inside()[piece.clone()]);
        let counts = |(i, v): &(usize, &T)| v.is_data() && inside.is_none_or(|m| m[*i] != 0);
        voxels[piece].iter().enumerate().filter(counts).map(|(_, v)| *v).collect::<Vec<T>>()
    });
    let mut values = parts.concat();
    exec.check_cancelled()?;
    values.par_sort_unstable_by(|a, b| a.partial_cmp(b).expect("missing data were left out"));
    Ok(reals::partition(&values, k, exec)?)
}
