//! What is measured of a result: how far it is from the unrefined lattice's, stepped finely.

use ivd_core::{Displacement, Exec, FieldBricks, Lattice, Motion};
use ivd_pipeline::Error;
use nalgebra::Vector3;
use rayon::prelude::*;

/// Displacements of the last frame; none for a motion without frames.
fn last(motion: &Motion) -> &[[f64; 3]] {
    motion.frames().last().map_or(&[], |f| &f.displacement)
}

/// Largest difference of two motions of one lattice (mm).
pub(crate) fn motions(a: &Motion, b: &Motion) -> f64 {
    let pairs = last(a).iter().zip(last(b));
    pairs.map(|(p, q)| (Vector3::from(*p) - Vector3::from(*q)).norm()).fold(0.0, f64::max)
}

/// Largest difference (mm) between the motion of the vertices of `fine` and that of the nearest points of `coarse`, whose
/// motion is linear on each triangle.
pub(crate) fn surfaces(
    fine: (&Lattice, &Motion),
    coarse: (&Lattice, &Motion),
    exec: &Exec,
) -> Result<f64, Error> {
    let octree = ivd_octree::build(coarse.0, &ivd_octree::Params::default(), exec)
        .map_err(Error::in_stage("octree"))?;
    let index = ivd_octree::prepare(coarse.0, &octree).map_err(Error::in_stage("octree"))?;
    let moved = last(coarse.1);
    let (positions, wanted) = (fine.0.local_positions(), last(fine.1));
    let difference = |(place, want): (&Vector3<f64>, &[f64; 3])| {
        let Some(near) = index.nearest(*place, f64::INFINITY) else { return f64::INFINITY };
        let corners = coarse.0.triangles()[near.triangle as usize];
        let there: Vector3<f64> =
            corners.iter().zip(near.barycentric).map(|(&v, w)| Vector3::from(moved[v as usize]) * w).sum();
        (there - Vector3::from(*want)).norm()
    };
    // The largest of many is the same in any order.
    Ok(exec.run(|| positions.par_iter().zip(wanted).map(difference).reduce(|| 0.0, f64::max)))
}

/// Largest difference of two displacements on one grid (mm), forward or inverse.
pub(crate) fn fields(a: &Displacement, b: &Displacement, exec: &Exec) -> f64 {
    exec.run(|| bricks(a.forward(), b.forward()).max(bricks(a.inverse(), b.inverse())))
}

fn bricks(a: &FieldBricks, b: &FieldBricks) -> f64 {
    let still = vec![[0.0_f32; 3]; FieldBricks::VOXELS];
    let length = |(p, q): (&[f32; 3], &[f32; 3])| {
        (0..3).map(|c| (f64::from(p[c]) - f64::from(q[c])).powi(2)).sum::<f64>()
    };
    let brick = |at: usize| {
        let (p, q) = (a.brick(at), b.brick(at));
        if p.is_none() && q.is_none() {
            return 0.0;
        }
        let (p, q) = (p.unwrap_or(&still), q.unwrap_or(&still));
        p.iter().zip(q).map(length).fold(0.0, f64::max)
    };
    (0..a.table().len()).into_par_iter().map(brick).reduce(|| 0.0, f64::max).sqrt()
}
