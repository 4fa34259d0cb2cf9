//! k-means: on intensity alone the partition of the values into K classes of least inertia, globally; with a weight for places,
//! Lloyd's algorithm on place and value (see `spatial`).

mod integers;
mod optimal;
mod params;
mod reals;
mod sorted;
mod spatial;

use ivd_core::{Exec, Mask, Scalar, Volume, parallel, with_voxels};
use rayon::prelude::*;

use crate::groups::Partition;
use crate::{Error, Segmentation, histogram, segmentation, selection};

pub(crate) use integers::{groups_between, partition, partitions};
pub use params::KmvsParams;
pub use spatial::{SpatialKmvs, kmvs_spatial};

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
/// [`Error`]: a bad parameter, a mask on another grid, the memory limit, or cancelled.
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
        let scope = selection::of(volume, mask, params.within, exec)?;
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
    reals::partition(&values, k, exec)
}
