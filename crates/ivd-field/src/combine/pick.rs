//! Labels and masks combined voxel by voxel.

use std::borrow::Cow;

use ivd_core::{Class, Exec, Grid, Labels, Scalar, parallel};
use nalgebra::Vector3;
use rayon::prelude::*;

use super::counts::Counts;
use super::operand::Operand;
use super::params::Op;
use super::read::{Place, SIDE};
use crate::Error;
use crate::warp::{Order, Source};

/// The combined labels on `grid`; `voxels` and `places` by operand.
pub(super) fn run<T: Scalar>(
    grid: &Grid,
    voxels: &[&[T]],
    places: &[Place<'_>],
    op: Op,
    exec: &Exec,
) -> Result<(Vec<T>, Counts), Error> {
    let [nx, ny, _] = grid.dims();
    let mut out = vec![T::default(); grid.len()];
    let counts = parallel::try_map_pieces_mut(&mut out, SIDE * nx * ny, &|bz, out| {
        exec.check_cancelled()?;
        let mut slabs = voxels.iter().zip(places).map(|(voxels, place)| slab(grid, voxels, place, bz, exec));
        let first = slabs.next().expect("checked: there are two operands or more");
        out.copy_from_slice(&first);
        for other in slabs {
            for (a, b) in out.iter_mut().zip(&*other) {
                *a = op.label(*a, *b);
            }
        }
        let changed = out.iter().zip(&*first).filter(|(a, b)| a != b).count() as u64;
        Ok::<_, Error>(Counts { changed, bricks: (nx.div_ceil(SIDE) * ny.div_ceil(SIDE)) as u64 })
    })?;
    Ok((out, counts.into_iter().sum()))
}

/// Slab `bz` of an operand, 0 outside its grid.
fn slab<'v, T: Scalar>(
    grid: &Grid,
    voxels: &'v [T],
    place: &Place<'_>,
    bz: usize,
    exec: &Exec,
) -> Cow<'v, [T]> {
    let Place::Elsewhere { linear, offset, dims } = place else {
        return place.slab(grid.dims(), voxels, bz, Order::Nearest, exec.simd);
    };
    let [nx, ny, nz] = grid.dims();
    let source = Source { voxels, dims: *dims };
    let voxels = (SIDE * bz..(SIDE * (bz + 1)).min(nz)).flat_map(|z| {
        (0..ny).flat_map(move |y| (0..nx).map(move |x| Vector3::new(x as f64, y as f64, z as f64)))
    });
    let nearest = |voxel: Vector3<f64>| source.sample((linear * voxel + offset).into(), Order::Nearest);
    voxels.map(|voxel| nearest(voxel).map_or(T::default(), T::from_f64)).collect()
}

/// Classes of the combined labels.
pub(super) fn classes(operands: &[Operand<'_, Labels>], op: Op, ids: &[u16]) -> Vec<Class> {
    let from = if op == Op::Union { operands } else { &operands[..1] };
    let mut classes: Vec<Class> = Vec::new();
    for class in from.iter().flat_map(|operand| operand.value.classes()) {
        if classes.iter().all(|listed| listed.id != class.id) {
            classes.push(class.clone());
        }
    }
    let mut counts = vec![0_u64; 1 << 16];
    for &id in ids {
        counts[usize::from(id)] += 1;
    }
    for class in &mut classes {
        class.voxels = counts[usize::from(class.id)];
    }
    if op == Op::Union {
        classes.sort_by(|a, b| a.mean.total_cmp(&b.mean));
    }
    classes
}

/// The combined level function.
pub(super) fn level(levels: &[&[f32]], op: Op) -> Vec<f32> {
    let mut out = levels[0].to_vec();
    for other in &levels[1..] {
        out.par_iter_mut().zip(other.par_iter()).for_each(|(a, &b)| {
            // Comparisons, because which of two zeros is the larger is nowhere said.
            let (b, takes) = match op {
                Op::Union => (b, b > *a),
                Op::Intersection => (b, b < *a),
                Op::Difference => (0.0 - b, 0.0 - b < *a),
            };
            if takes {
                *a = b;
            }
        });
    }
    out
}
