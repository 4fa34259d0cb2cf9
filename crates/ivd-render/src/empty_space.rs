use std::ops::{ControlFlow, Range};

use ivd_core::BRICK;

use crate::camera::Ray;
use crate::samples::Shape;

/// The bricks of the volume and how far one may leap from each.
pub(crate) struct Space {
    shape: Shape,
    bricks: [usize; 3],
    /// 0 for a brick that must be sampled; `d` where every brick up to `d - 1` away along each axis may be passed over.
    leap: Vec<u8>,
}

/// The brick that a ray is in, as its first cell.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct Home([usize; 3]);

/// Before the first brick.
pub(crate) const NOWHERE: Home = Home([usize::MAX; 3]);

impl Home {
    /// The brick of a cell.
    #[inline(always)]
    pub(crate) fn of(cell: [usize; 3]) -> Self {
        Self(cell.map(|c| c & !(BRICK - 1)))
    }

    /// Whether a cell lies in the brick.
    #[inline(always)]
    pub(crate) fn holds(self, cell: [usize; 3]) -> bool {
        let Self(first) = self;
        ((cell[0] ^ first[0]) | (cell[1] ^ first[1]) | (cell[2] ^ first[2])) < BRICK
    }
}

impl Space {
    /// `empty` tells for every brick whether it may be passed over.
    pub(crate) fn new(shape: Shape, empty: &[bool]) -> Self {
        let bricks = shape.dims.map(|n| n.div_ceil(BRICK));
        Self { shape, bricks, leap: distances(bricks, empty) }
    }

    /// A space where nothing may be passed over.
    pub(crate) fn full(shape: Shape) -> Self {
        let bricks = shape.dims.map(|n| n.div_ceil(BRICK));
        Self { shape, bricks, leap: vec![0; bricks.iter().product()] }
    }

    /// Bricks along each axis.
    pub(crate) fn bricks(&self) -> [usize; 3] {
        self.bricks
    }

    /// The leap of every brick.
    pub(crate) fn leaps(&self) -> &[u8] {
        &self.leap
    }

    /// Brick that a voxel coordinate's cell lies in.
    pub(crate) fn brick(&self, at: [f32; 3]) -> usize {
        self.linear(self.brick_at(at))
    }

    #[inline(always)]
    fn linear(&self, b: [usize; 3]) -> usize {
        b[0] + self.bricks[0] * (b[1] + self.bricks[1] * b[2])
    }

    /// Brick of a cell, and, where it may be passed over, how many bricks further on may be as well.
    #[inline(always)]
    pub(crate) fn enter(&self, cell: [usize; 3]) -> (usize, Option<usize>) {
        let brick = self.linear(cell.map(|c| c / BRICK));
        (brick, usize::from(self.leap[brick]).checked_sub(1))
    }

    /// Index of a sample after `i` up to which all lie in the bricks up to `reach` from that of `cell`, where sample `i` is.
    ///
    /// The index is estimated from the box's planes, then put right by looking at the samples themselves; as their coordinates are monotone
    /// along the ray, all samples between two that are inside are inside.
    #[inline(always)]
    pub(crate) fn leap(&self, ray: &Ray, i: usize, cell: [usize; 3], reach: usize) -> usize {
        let mut steps = ray.steps as f32;
        let mut low = [0; 3];
        let mut high = [0; 3];
        for a in 0..3 {
            let brick = cell[a] / BRICK;
            low[a] = brick.saturating_sub(reach) * BRICK;
            // Beyond the last brick there is no cell.
            high[a] = (brick + reach + 1) * BRICK;
            let plane = if ray.delta[a] > 0.0 { high[a] } else { low[a] };
            // A ray that runs along the planes meets none of them.
            let open = if ray.delta[a] > 0.0 {
                brick + reach + 1 >= self.bricks[a]
            } else {
                brick <= reach || ray.delta[a] == 0.0
            };
            let there = (plane as f32 - ray.start[a]) * ray.inverse[a];
            steps = if !open && there < steps { there } else { steps };
        }
        let mut end = (steps as usize + 1).clamp(i + 1, ray.steps);
        let inside = |k: usize| {
            let there = self.shape.place(ray.at(k)).cell();
            (0..3).all(|a| there[a].wrapping_sub(low[a]) < high[a] - low[a])
        };
        while end > i + 1 && !inside(end - 1) {
            end -= 1;
        }
        end
    }

    #[inline(always)]
    fn brick_at(&self, at: [f32; 3]) -> [usize; 3] {
        self.shape.place(at).cell().map(|c| c / BRICK)
    }

    /// Visits the whole steps of a ray from front to back, brick by brick, and leaps over what is empty. Each sample is visited
    /// with exactly the brick that its cell lies in. Returns how many samples were leapt over.
    #[inline(always)]
    pub(crate) fn walk(
        &self,
        ray: &Ray,
        mut visit: impl FnMut(usize, Range<usize>) -> ControlFlow<()>,
    ) -> usize {
        let (mut i, mut leapt) = (0, 0);
        while i < ray.steps {
            let brick = self.brick_at(ray.at(i));
            let at = self.linear(brick);
            let distance = usize::from(self.leap[at]);
            let end = self.exit(ray, i, brick, distance.saturating_sub(1));
            if distance > 0 {
                leapt += end - i;
            } else if visit(at, i..end).is_break() {
                break;
            }
            i = end;
        }
        leapt
    }

    /// Index of the first sample after `i` whose brick is further than `reach` from `brick` along some axis.
    #[inline(always)]
    fn exit(&self, ray: &Ray, i: usize, brick: [usize; 3], reach: usize) -> usize {
        let inside = |k: usize| {
            let there = self.brick_at(ray.at(k));
            (0..3).all(|a| there[a].abs_diff(brick[a]) <= reach)
        };
        let mut end = self.leap(ray, i, brick.map(|b| b * BRICK), reach);
        while end < ray.steps && inside(end) {
            end += 1;
        }
        end
    }
}

/// Chebyshev distance of each brick to the nearest one that isn't empty, at most 255, by two sweeps over half of the 26 neighbours each.
fn distances(bricks: [usize; 3], empty: &[bool]) -> Vec<u8> {
    let mut distance: Vec<u8> = empty.iter().map(|&e| if e { u8::MAX } else { 0 }).collect();
    let [bx, by, bz] = bricks.map(|n| n as isize);
    let order = |i: usize| {
        let i = i as isize;
        [i % bx, i / bx % by, i / bx / by]
    };
    let offsets: Vec<[isize; 3]> = (0..13).map(|o| [o % 3 - 1, o / 3 % 3 - 1, o / 9 - 1]).collect();
    let sweep = |distance: &mut Vec<u8>, i: usize, sign: isize| {
        let at = order(i);
        let mut least = distance[i];
        for offset in &offsets {
            let there = [at[0] + sign * offset[0], at[1] + sign * offset[1], at[2] + sign * offset[2]];
            if there[0] >= 0
                && there[0] < bx
                && there[1] >= 0
                && there[1] < by
                && there[2] >= 0
                && there[2] < bz
            {
                let j = (there[0] + bx * (there[1] + by * there[2])) as usize;
                least = least.min(distance[j].saturating_add(1));
            }
        }
        distance[i] = least;
    };
    for i in 0..empty.len() {
        sweep(&mut distance, i, 1);
    }
    for i in (0..empty.len()).rev() {
        sweep(&mut distance, i, -1);
    }
    distance
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn distances_equal_a_plain_search() {
        let bricks = [7, 5, 6];
        let at = |i: usize| [i % 7, i / 7 % 5, i / 35];
        let empty: Vec<bool> = (0..210).map(|i| (i * 7919) % 61 != 3).collect();
        let found = distances(bricks, &empty);
        for i in 0..210 {
            let nearest = (0..210)
                .filter(|&j| !empty[j])
                .map(|j| (0..3).map(|a| at(i)[a].abs_diff(at(j)[a])).max().unwrap())
                .min()
                .unwrap();
            assert_eq!(usize::from(found[i]), nearest);
        }
    }

    #[test]
    fn a_walk_visits_each_sample_once_with_its_own_brick_and_leaps_only_over_empty_ones() {
        let shape = Shape::new([40, 33, 50]);
        let bricks = [5, 5, 7];
        let empty: Vec<bool> = (0..175).map(|i| (i * 31) % 7 != 0).collect();
        let space = Space::new(shape, &empty);
        let rays = [
            ([-0.5, 3.0, 3.0], [0.3, 0.1, 0.2]),
            ([39.5, 32.5, 49.5], [-0.31, -0.17, -0.4]),
            ([8.0, 16.0, -0.49], [0.0, 0.0, 0.5]),
            ([7.999_999, 32.4, 0.1], [0.0, -0.25, 1e-12]),
        ];
        for (start, delta) in rays {
            let inverse = delta.map(|d: f32| 1.0 / d);
            let ray = Ray { start, delta, inverse, steps: 100, rest_at: start, rest: 0.0, cut: None };
            let mut visited = [false; 100];
            let leapt = space.walk(&ray, |brick, range| {
                for i in range {
                    assert!(!visited[i]);
                    visited[i] = true;
                    assert_eq!(space.brick(ray.at(i)), brick);
                    assert!(!empty[brick]);
                }
                ControlFlow::Continue(())
            });
            assert_eq!(leapt, visited.iter().filter(|v| !**v).count());
            for (i, seen) in visited.iter().enumerate() {
                assert_eq!(*seen, !empty[space.brick(ray.at(i))], "sample {i}");
            }
        }
        assert_eq!(bricks, space.bricks);
    }
}
