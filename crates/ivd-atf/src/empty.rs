//! Parts of a volume in which rays meet nothing visible.

use ivd_core::parallel;

use crate::reduced::{MISSING, Reduced};

/// Voxels along a side of a brick.
const SIDE: usize = 8;

/// Bricks of 8³ voxels, each marked if it holds nothing to see.
pub(crate) struct EmptyBricks {
    dims: [usize; 3],
    is_empty: Vec<bool>,
}

impl EmptyBricks {
    /// - `visible_below`: how many of the bins of the value axis, before each, aren't clear in some row; one longer than there are bins.
    /// - `bin`: the bin of a level.
    /// - `is_matter`: whether a class, by its place in the order of means, counts as matter.
    pub(crate) fn new(
        reduced: &Reduced<'_>,
        visible_below: &[usize],
        bin: &(dyn Fn(u16) -> usize + Sync),
        is_matter: &[bool],
    ) -> Self {
        let dims = reduced.dims.map(|n| n.div_ceil(SIDE));
        let layers = parallel::map(dims[2], &|bz| {
            let mut ranges = vec![(MISSING, 0_u16); dims[0] * dims[1]];
            let mut matter = vec![false; dims[0] * dims[1]];
            // A voxel more on every side: what lies between voxels of two bricks belongs to both.
            let z = bz * SIDE..((bz + 1) * SIDE + 1).min(reduced.dims[2]);
            for z in z.start.saturating_sub(1)..z.end {
                for y in 0..reduced.dims[1] {
                    let row = reduced.row(y, z);
                    for (x, (&level, rank)) in row.iter().zip(reduced.ranks(y, z)).enumerate() {
                        if level == MISSING {
                            continue;
                        }
                        let brick = x / SIDE + dims[0] * (y / SIDE);
                        let (low, high) = &mut ranges[brick];
                        (*low, *high) = ((*low).min(level), (*high).max(level));
                        matter[brick] |= is_matter[usize::from(rank)];
                    }
                }
            }
            ranges.into_iter().zip(matter).collect::<Vec<_>>()
        });
        let index = |[x, y]: [usize; 2]| x + dims[0] * y;
        let mut is_empty = Vec::with_capacity(dims.iter().product());
        for layer in &layers {
            for y in 0..dims[1] {
                for x in 0..dims[0] {
                    // Neighbours in x and y stand in for a voxel more.
                    let (mut low, mut high, mut matter) = (MISSING, 0, false);
                    for y in y.saturating_sub(1)..(y + 2).min(dims[1]) {
                        for x in x.saturating_sub(1)..(x + 2).min(dims[0]) {
                            let ((l, h), m) = layer[index([x, y])];
                            (low, high, matter) = (low.min(l), high.max(h), matter || m);
                        }
                    }
                    is_empty.push(
                        !matter && (low > high || visible_below[bin(high) + 1] == visible_below[bin(low)]),
                    );
                }
            }
        }
        Self { dims, is_empty }
    }

    /// Whether there is nothing to see about a place.
    #[inline]
    pub(crate) fn at(&self, p: [f32; 3]) -> bool {
        let [x, y, z] = p.map(|c| c as usize / SIDE);
        self.is_empty[x + self.dims[0] * (y + self.dims[1] * z)]
    }

    /// Whole steps that a ray goes on inside the brick of `p`, which is `at` moved into the volume.
    #[inline]
    pub(crate) fn steps_inside(p: [f32; 3], at: [f32; 3], step: [f32; 3]) -> usize {
        let steps = |a: usize| {
            let low = (p[a] as usize / SIDE * SIDE) as f32;
            match step[a] {
                s if s > 1e-6 => (low + SIDE as f32 - at[a]) / s,
                s if s < -1e-6 => (low - at[a]) / s,
                _ => f32::MAX,
            }
        };
        // A little less: a step that ends on the brick's side is looked at.
        (steps(0).min(steps(1)).min(steps(2)) - 0.001).clamp(0.0, 1e6) as usize
    }
}
