//! Volumes combined by opacity.

use std::ops::Range;

use ivd_core::{Exec, Scalar, VoxelType, parallel};

use super::counts::Counts;
use super::params::Op;
use super::read::{Read, Row, SIDE};
use crate::Error;

/// The combined voxels; `a`: the first operand's.
pub(super) fn run<T: Scalar>(
    a: &[T],
    reads: &[Read<'_>],
    op: Op,
    exec: &Exec,
) -> Result<(Vec<T>, Counts), Error> {
    let [nx, ny, _] = reads[0].volume.grid().dims();
    let mut out = vec![T::default(); a.len()];
    let counts = parallel::try_map_pieces_mut(&mut out, SIDE * nx * ny, &|bz, out| {
        exec.check_cancelled()?;
        Ok::<_, Error>(slab(a, reads, op, exec.skip, bz, out))
    })?;
    Ok((out, counts.into_iter().sum()))
}

/// Slab `bz`: the first operand's, and where another one decides, changed.
fn slab<T: Scalar>(a: &[T], reads: &[Read<'_>], op: Op, skip: bool, bz: usize, out: &mut [T]) -> Counts {
    let [nx, ny, _] = reads[0].volume.grid().dims();
    out.copy_from_slice(&reads[0].slab(a, bz));
    let (mut counts, mut stretches) = (Counts::default(), Vec::new());
    for by in 0..ny.div_ceil(SIDE) {
        let open = |bx: usize| !(skip && first_decides(reads, op, [bx, by, bz]));
        for bricks in runs(nx.div_ceil(SIDE), open) {
            counts.bricks += bricks.len() as u64;
            stretches.push((by, SIDE * bricks.start..(SIDE * bricks.end).min(nx)));
        }
    }
    // Nothing is deformed for a slab that no other operand has a say in.
    if stretches.is_empty() {
        return counts;
    }
    let rows: Vec<Row<'_>> = reads[1..].iter().map(|read| read.rows(bz)).collect();
    let mut room = Room::default();
    for (by, xs) in stretches {
        for z in 0..out.len() / (nx * ny) {
            for y in SIDE * by..(SIDE * (by + 1)).min(ny) {
                let first = nx * (y + ny * z);
                let to = &mut out[first + xs.start..first + xs.end];
                counts.changed += room.row(reads, &rows, op, [xs.start, y, z], to);
            }
        }
    }
    counts
}

/// Whether the opacity is the first operand's all over a brick.
fn first_decides(reads: &[Read<'_>], op: Op, brick: [usize; 3]) -> bool {
    let [least, most] = reads[0].bounds(brick);
    reads[1..].iter().map(|read| read.bounds(brick)).all(|[low, high]| match op {
        Op::Union => high <= least,
        Op::Intersection => most <= low,
        Op::Difference => most <= 1.0 - high,
    })
}

/// The ranges of numbers below `n` that are `open`.
fn runs(n: usize, open: impl Fn(usize) -> bool) -> Vec<Range<usize>> {
    let mut runs: Vec<Range<usize>> = Vec::new();
    for i in (0..n).filter(|&i| open(i)) {
        match runs.last_mut() {
            Some(run) if run.end == i => run.end += 1,
            _ => runs.push(i..i + 1),
        }
    }
    runs
}

/// Room for a row.
#[derive(Default)]
struct Room {
    /// Opacity of the first operand.
    own: Vec<f64>,
    /// Opacity of those that were folded.
    opacity: Vec<f64>,
    /// Real values: of the operand that is folded, and in a union of the one that is most opaque.
    real: Vec<f64>,
    most: Vec<f64>,
}

impl Room {
    /// Combines a stretch of a row from voxel `at` on, the first operand's when it comes; how many voxels changed.
    fn row<T: Scalar>(
        &mut self,
        reads: &[Read<'_>],
        rows: &[Row<'_>],
        op: Op,
        at: [usize; 3],
        to: &mut [T],
    ) -> u64 {
        let (first, window) = (&reads[0].volume, reads[0].window);
        let opacity = |v: &T| if v.is_data() { window.opacity(first.real(v.to_f64())) } else { 0.0 };
        self.own.clear();
        self.own.extend(to.iter().map(opacity));
        self.opacity.clone_from(&self.own);
        self.real.resize(to.len(), 0.0);
        self.most.resize(to.len(), 0.0);
        for (read, row) in reads[1..].iter().zip(rows) {
            row(at, &mut self.real);
            let folded = self.opacity.iter_mut().zip(&mut self.most);
            for ((opacity, most), &real) in folded.zip(&self.real) {
                let both = op.opacity(*opacity, read.window.opacity(real));
                if both != *opacity {
                    (*opacity, *most) = (both, real);
                }
            }
        }
        let mut changed = 0;
        for (i, to) in to.iter_mut().enumerate().filter(|(i, _)| self.opacity[*i] != self.own[*i]) {
            let real = if op == Op::Union { self.most[i] } else { window.real(self.opacity[i]) };
            let value: T = nearest_data(first.stored(real));
            changed += u64::from(value.to_f64().to_bits() != to.to_f64().to_bits());
            *to = value;
        }
        changed
    }
}

/// The nearest value of a type that is data: no number becomes infinite because the type can't hold it.
pub(crate) fn nearest_data<T: Scalar>(value: f64) -> T {
    let most = if T::TYPE == VoxelType::F32 { f64::from(f32::MAX) } else { f64::MAX };
    T::from_f64(value.clamp(-most, most))
}
