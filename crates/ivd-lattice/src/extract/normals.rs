//! Normals of a lattice's vertices by the gradient of the volume that it was cut from.

use ivd_core::{Exec, Grid, Lattice, Volume};
use nalgebra::Vector3;
use rayon::prelude::*;

use crate::Error;

/// Unit normals of the vertices in world space, outward, shape `[vertex_count, 3]`.
///
/// The volume's gradient by central differences, interpolated between the voxels round the vertex, taken to world space by
/// the inverse transpose of the grid's matrix, and turned to the side of the triangles' normals. At the volume's border
/// differences are one-sided, of second order too. Where there is no gradient (a flat or missing neighbourhood), and where it is
/// across the triangles (a cap on the volume's border, a mask's cut), the mean of the triangles' normals by area stands for it.
///
/// # Errors
/// [`ivd_core::Error::GridMismatch`] where the volume has another grid, [`ivd_core::Error::Inconsistent`] for a lattice whose
/// parts don't fit, [`ivd_core::Error::Cancelled`].
pub fn normals(volume: &Volume, lattice: &Lattice, exec: &Exec) -> Result<Vec<[f32; 3]>, Error> {
    volume.grid().require(lattice.grid(), "volume", "lattice")?;
    exec.run(|| {
        let faces = by_area(lattice);
        exec.check_cancelled()?;
        volume.voxels();
        let to_world = volume.grid().inverse_linear_part().transpose();
        let normal = |i: usize| {
            let face = faces[i].try_normalize(0.0).unwrap_or_else(Vector3::z);
            let gradient = to_world * gradient_at(volume, lattice.voxel(i).0);
            let outward = gradient.try_normalize(0.0).filter(|n| n.iter().all(|c| c.is_finite()));
            let outward = outward.map(|n| if n.dot(&face) < 0.0 { -n } else { n });
            let normal = outward.filter(|n| n.dot(&face) > ACROSS).unwrap_or(face);
            <[f64; 3]>::from(normal).map(|c| c as f32)
        };
        Ok((0..lattice.keys().len()).into_par_iter().map(normal).collect())
    })
}

/// Cosine between gradient and triangles below which the gradient is no normal of the surface (70°).
const ACROSS: f64 = 0.342;

/// Sum of the normals of the triangles round each vertex, each as long as twice its area.
fn by_area(lattice: &Lattice) -> Vec<Vector3<f64>> {
    let positions = lattice.local_positions();
    let mut sums = vec![Vector3::zeros(); positions.len()];
    for t in lattice.triangles() {
        let [a, b, c] = t.map(|v| positions[v as usize]);
        let normal = (b - a).cross(&(c - a));
        for &v in t {
            sums[v as usize] += normal;
        }
    }
    sums
}

/// Gradient by voxel coordinates at a place: central differences at the voxels round it, weighted trilinearly. Voxels in
/// the border layer stand for their neighbours within; those without data are left out.
fn gradient_at(volume: &Volume, at: Vector3<f64>) -> Vector3<f64> {
    let grid = volume.grid();
    let low = at.map(f64::floor);
    let (mut sum, mut weights) = (Vector3::zeros(), 0.0);
    for corner in 0..8_usize {
        let offset = Vector3::from_fn(|a, _| (corner >> a & 1) as f64);
        let voxel = low + offset;
        let weight: f64 = (0..3).map(|a| 1.0 - (at[a] - voxel[a]).abs()).product();
        if weight > 0.0
            && let Some(gradient) = gradient_of(volume, grid, voxel)
        {
            sum += weight * gradient;
            weights += weight;
        }
    }
    if weights > 0.0 { sum / weights } else { Vector3::zeros() }
}

/// Gradient at a voxel, by differences of second order: central, or one-sided where a neighbour is missing; of first order where there
/// are but two voxels, and `None` where a whole axis is missing.
fn gradient_of(volume: &Volume, grid: &Grid, voxel: Vector3<f64>) -> Option<Vector3<f64>> {
    let dims = grid.dims();
    let index: [usize; 3] = std::array::from_fn(|a| voxel[a].clamp(0.0, dims[a] as f64 - 1.0) as usize);
    let value = |index: [usize; 3]| volume.value(ivd_core::VoxelIndex(index));
    let here = value(index);
    let mut gradient = Vector3::zeros();
    for axis in 0..3 {
        let beside = |step: isize| {
            let at = index[axis].checked_add_signed(step).filter(|&at| at < dims[axis])?;
            let mut other = index;
            other[axis] = at;
            Some(value(other)).filter(|value| value.is_finite())
        };
        gradient[axis] = match (beside(-1), beside(1)) {
            (Some(down), Some(up)) => (up - down) / 2.0,
            _ if !here.is_finite() => return None,
            (None, Some(up)) => beside(2).map_or(up - here, |far| 2.0 * up - 1.5 * here - 0.5 * far),
            (Some(down), None) => beside(-2).map_or(here - down, |far| 1.5 * here - 2.0 * down + 0.5 * far),
            (None, None) => 0.0,
        };
    }
    Some(gradient)
}
