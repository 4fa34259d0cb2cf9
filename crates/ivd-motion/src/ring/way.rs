//! How far it is from a vertex to others through the part: a straight line tells nothing where air lies between.

use std::cmp::Reverse;
use std::collections::BinaryHeap;

use ivd_core::{Error, Exec, Lattice};
use nalgebra::Vector3;

use super::rings::Edges;

/// Vertices whose way is longer than this many times the straight line don't follow.
const DETOUR: f64 = 1.5;

/// The vertices of a ball that a handle's vertex takes along, ascending: those to which a way of at most one and a half times the straight line, and a voxel's
/// diagonal, leads within the ball, through the part's voxels and along its edges.
///
/// A step from voxel to voxel goes to one of 26 neighbours: ways are up to an eighth too long. A lattice that isn't closed has no voxels inside: ways
/// go along its edges.
///
/// # Errors
/// Memory, cancelled.
pub(super) fn followers(
    lattice: &Lattice,
    edges: &Edges,
    rest: &[Vector3<f64>],
    target: usize,
    radius: f64,
    exec: &Exec,
) -> Result<Vec<u32>, Error> {
    let straight = |v: usize| (rest[v] - rest[target]).norm();
    let near: Vec<u32> =
        (0..rest.len() as u32).filter(|&v| v as usize == target || straight(v as usize) < radius).collect();
    let slack = lattice.grid().voxel_diagonal();
    let mut voxels = Voxels::new(lattice, rest[target], radius, DETOUR * radius + slack, exec)?;
    let ways = ways(lattice, edges, rest, target, &near, &mut voxels, exec)?;
    let is_short = |(v, way): (u32, f64)| (way <= DETOUR * straight(v as usize) + slack).then_some(v);
    Ok(near.iter().copied().zip(ways).filter_map(is_short).collect())
}

/// Length of the shortest way to each of the vertices that are near (mm); infinite where there is none.
fn ways(
    lattice: &Lattice,
    edges: &Edges,
    rest: &[Vector3<f64>],
    target: usize,
    near: &[u32],
    voxels: &mut Voxels,
    exec: &Exec,
) -> Result<Vec<f64>, Error> {
    let number = |v: u32| near.binary_search(&v).ok();
    let steps: Vec<Vec<(usize, f64)>> = near.iter().map(|&v| voxels.beside(lattice, v as usize)).collect();
    let mut ways = vec![f64::INFINITY; near.len()];
    ways[number(target as u32).expect("it is near itself")] = 0.0;
    loop {
        exec.check_cancelled()?;
        // Along edges, the nearest first.
        let mut queue: BinaryHeap<Reverse<(Length, usize)>> = (0..near.len())
            .filter(|&i| ways[i] < f64::INFINITY)
            .map(|i| Reverse((Length(ways[i]), i)))
            .collect();
        while let Some(Reverse((Length(way), i))) = queue.pop() {
            if way > ways[i] {
                continue;
            }
            let here = near[i] as usize;
            for &u in edges.of(here) {
                let Some(j) = number(u) else { continue };
                let longer = way + (rest[u as usize] - rest[here]).norm();
                if longer < ways[j] {
                    ways[j] = longer;
                    queue.push(Reverse((Length(longer), j)));
                }
            }
        }
        // Into the voxels, through them, and back.
        let mut entered = false;
        for (way, steps) in ways.iter().zip(&steps) {
            for &(voxel, length) in steps {
                entered |= voxels.lower(voxel, way + length);
            }
        }
        if !entered {
            return Ok(ways);
        }
        voxels.spread(exec)?;
        for (way, steps) in ways.iter_mut().zip(&steps) {
            for &(voxel, length) in steps {
                *way = way.min(f64::from(voxels.ways[voxel]) + length);
            }
        }
    }
}

/// A length as a heap orders it.
#[derive(PartialEq)]
struct Length(f64);

impl Eq for Length {}

impl PartialOrd for Length {
    fn partial_cmp(&self, other: &Self) -> Option<std::cmp::Ordering> {
        Some(self.cmp(other))
    }
}

impl Ord for Length {
    fn cmp(&self, other: &Self) -> std::cmp::Ordering {
        self.0.total_cmp(&other.0)
    }
}

/// The way to what isn't in the part: nothing is shorter.
const OUTSIDE: f32 = f32::NEG_INFINITY;
/// Groups that the longest way is divided into at most: voxels may be thousands of times as long as wide.
const MOST_GROUPS: f64 = 4096.0;

/// The voxels inside a part in the box of a ball, and a layer round it.
struct Voxels {
    /// First voxel of the box, and its voxels with the layer.
    low: [usize; 3],
    size: [usize; 3],
    /// Length of the shortest way to each that is known (mm), rounded; [`OUTSIDE`] what isn't in the part and the ball.
    ways: Vec<f32>,
    /// Steps to a voxel's neighbours, and their lengths (mm).
    steps: [(isize, f32); 26],
    /// Voxels from which ways are to go on.
    queue: Queue,
    /// No way is longer (mm).
    longest: f64,
    /// Edges of a voxel as vectors (mm).
    linear: nalgebra::Matrix3<f64>,
}

impl Voxels {
    /// - `middle`, `radius`: the ball, relative to the grid's origin (mm).
    fn new(
        lattice: &Lattice,
        middle: Vector3<f64>,
        radius: f64,
        longest: f64,
        exec: &Exec,
    ) -> Result<Self, Error> {
        let grid = lattice.grid();
        let ranges = grid.voxels_of_ball(middle, radius);
        let low = ranges.clone().map(|range| range.start);
        let box_size = ranges.clone().map(|range| range.len());
        let size = box_size.map(|n| n + 2);
        exec.check_memory("the voxels within a handle's reach", 9 * size.iter().product::<usize>() as u64)?;
        let within = match ivd_octree::inside_box(lattice, ranges, exec) {
            Ok(within) => within,
            Err(ivd_octree::Error::Open { .. }) => Vec::new(),
            Err(ivd_octree::Error::Core(error)) => return Err(error),
            Err(error) => {
                return Err(Error::Inconsistent { what: "lattice", problem: error.to_string() });
            }
        };
        let linear = grid.linear_part();
        let mut ways = vec![OUTSIDE; size.iter().product()];
        for (i, _) in within.iter().enumerate().filter(|(_, within)| **within != 0) {
            let place = [i % box_size[0], i / box_size[0] % box_size[1], i / box_size[0] / box_size[1]];
            let voxel = Vector3::from_fn(|a, _| (low[a] + place[a]) as f64);
            if (linear * voxel - middle).norm() < radius {
                ways[place[0] + 1 + size[0] * (place[1] + 1 + size[1] * (place[2] + 1))] = f32::INFINITY;
            }
        }
        let offsets = (0..27_usize).filter(|i| *i != 13).map(|i| [i % 3, i / 3 % 3, i / 9]);
        let mut steps = [(0, 0.0); 26];
        for (step, offset) in steps.iter_mut().zip(offsets) {
            let [x, y, z] = offset.map(|c| c as isize - 1);
            let mm = linear * Vector3::new(x as f64, y as f64, z as f64);
            *step = (x + size[0] as isize * (y + size[1] as isize * z), mm.norm() as f32);
        }
        let shortest = steps.iter().fold(f32::INFINITY, |least, (_, mm)| least.min(*mm));
        let queue = Queue::new(shortest.max((longest / MOST_GROUPS) as f32));
        Ok(Self { low, size, ways, steps, queue, longest, linear })
    }

    /// The voxels of the part round a vertex, and how far they are (mm).
    fn beside(&self, lattice: &Lattice, vertex: usize) -> Vec<(usize, f64)> {
        let at = lattice.voxel(vertex).0;
        let corners = (0..8_usize)
            .map(|c| Vector3::from_fn(|a, _| if c >> a & 1 == 1 { at[a].ceil() } else { at[a].floor() }));
        let mut found: Vec<(usize, f64)> = Vec::new();
        for corner in corners {
            let place: [f64; 3] = std::array::from_fn(|a| corner[a] - self.low[a] as f64 + 1.0);
            if (0..3).any(|a| place[a] < 0.0 || place[a] >= self.size[a] as f64) {
                continue;
            }
            let [x, y, z] = place.map(|c| c as usize);
            let voxel = x + self.size[0] * (y + self.size[1] * z);
            let known = found.iter().any(|(other, _)| *other == voxel);
            if !known && self.ways[voxel] != OUTSIDE {
                found.push((voxel, (self.linear * (corner - at)).norm()));
            }
        }
        found
    }

    /// Takes a way to a voxel where it is shorter than the one that is known, and short enough.
    fn lower(&mut self, voxel: usize, way: f64) -> bool {
        let shorter = way <= self.longest && (way as f32) < self.ways[voxel];
        if shorter {
            self.ways[voxel] = way as f32;
            self.queue.push(voxel, way as f32);
        }
        shorter
    }

    /// Goes on from the ways that were lowered to all voxels that they make nearer.
    fn spread(&mut self, exec: &Exec) -> Result<(), Error> {
        let Self { ways, queue, steps, longest, .. } = self;
        let longest = *longest as f32;
        let mut due = Vec::new();
        while queue.take(&mut due) {
            exec.check_cancelled()?;
            for &(voxel, way) in &due {
                if way > ways[voxel as usize] {
                    continue;
                }
                for &(offset, step) in &*steps {
                    let next = (voxel as usize).wrapping_add_signed(offset);
                    let longer = way + step;
                    if longer < ways[next] && longer <= longest {
                        ways[next] = longer;
                        queue.push(next, longer);
                    }
                }
            }
        }
        Ok(())
    }
}

/// Voxels in groups of about the same way, the nearest first. A way that is shortened within its own group is looked at again.
struct Queue {
    groups: Vec<Vec<(u32, f32)>>,
    /// The first that may hold a voxel.
    first: usize,
    per_mm: f32,
}

impl Queue {
    /// Groups of `width` (mm).
    fn new(width: f32) -> Self {
        Self { groups: Vec::new(), first: 0, per_mm: 1.0 / width }
    }

    fn push(&mut self, voxel: usize, way: f32) {
        let group = (way * self.per_mm) as usize;
        if group >= self.groups.len() {
            self.groups.resize_with(group + 1, Vec::new);
        }
        self.groups[group].push((voxel as u32, way));
        self.first = self.first.min(group);
    }

    /// Takes all of the nearest group; whether there was any.
    fn take(&mut self, due: &mut Vec<(u32, f32)>) -> bool {
        while let Some(group) = self.groups.get_mut(self.first) {
            if !group.is_empty() {
                *due = std::mem::take(group);
                return true;
            }
            self.first += 1;
        }
        false
    }
}

#[cfg(test)]
mod tests {
    use ivd_core::{Grid, Volume, noise};
    use ivd_lattice::extract::{ExtractParams, Iso, extract};

    use super::*;

    /// One voxel or vertex after the other, the nearest first.
    fn plain(
        lattice: &Lattice,
        edges: &Edges,
        rest: &[Vector3<f64>],
        target: usize,
        near: &[u32],
        voxels: &Voxels,
    ) -> Vec<f64> {
        let cells = voxels.ways.len();
        let mut ways = vec![f64::INFINITY; cells + near.len()];
        let mut links: Vec<Vec<(usize, f64)>> = vec![Vec::new(); ways.len()];
        let mut link = |a: usize, b: usize, length: f64| {
            links[a].push((b, length));
            links[b].push((a, length));
        };
        for voxel in (0..cells).filter(|&voxel| voxels.ways[voxel] != OUTSIDE) {
            for (offset, step) in voxels.steps {
                let next = voxel.wrapping_add_signed(offset);
                if next > voxel && voxels.ways[next] != OUTSIDE {
                    link(voxel, next, f64::from(step));
                }
            }
        }
        for (i, &v) in near.iter().enumerate() {
            for (voxel, length) in voxels.beside(lattice, v as usize) {
                link(cells + i, voxel, length);
            }
            for &u in edges.of(v as usize) {
                if let Ok(j) = near.binary_search(&u) {
                    link(cells + i, cells + j, (rest[u as usize] - rest[v as usize]).norm());
                }
            }
        }
        let start = cells + near.binary_search(&(target as u32)).unwrap();
        ways[start] = 0.0;
        let mut queue = BinaryHeap::from([Reverse((Length(0.0), start))]);
        while let Some(Reverse((Length(way), i))) = queue.pop() {
            for &(j, length) in &links[i] {
                if way + length < ways[j] {
                    ways[j] = way + length;
                    queue.push(Reverse((Length(way + length), j)));
                }
            }
        }
        ways.split_off(cells)
    }

    #[test]
    fn ways_are_those_of_a_queue_of_voxels_and_vertices() {
        let exec = Exec::default();
        for case in 0..20 {
            let dims = [17, 14, 12];
            let grid = Grid::with_spacing(dims, [1.0, 0.8, 1.7]).unwrap();
            // Blobs with holes and caves.
            let value = |i: usize| {
                let at = grid.index(i).0.map(|c| c as f64);
                let waves = (0..3).map(|a| {
                    (at[a] * (0.7 + noise::unit(case, a as u64)) + 7.0 * noise::unit(case, 10 + a as u64))
                        .sin()
                });
                (100.0 + 60.0 * waves.sum::<f64>()) as f32
            };
            let voxels: Vec<f32> = (0..grid.len()).map(value).collect();
            let volume = Volume::new(grid, voxels.into()).unwrap();
            let lattice =
                extract(&volume, None, &ExtractParams { iso: Iso::Value(110.0) }, &exec).unwrap().lattice;
            let rest = lattice.local_positions();
            let edges = Edges::new(&lattice, &rest, |_| true);
            let target = noise::below(case, 99, rest.len() as u64) as usize;
            let radius = 4.0 + 6.0 * noise::unit(case, 98);
            let near: Vec<u32> = (0..rest.len() as u32)
                .filter(|&v| v as usize == target || (rest[v as usize] - rest[target]).norm() < radius)
                .collect();
            let mut voxels = Voxels::new(&lattice, rest[target], radius, 1e3, &exec).unwrap();
            let expected = plain(&lattice, &edges, &rest, target, &near, &voxels);
            let found = ways(&lattice, &edges, &rest, target, &near, &mut voxels, &exec).unwrap();
            assert!(found.iter().filter(|way| way.is_finite()).count() > 20, "case {case}");
            for (found, expected) in found.iter().zip(&expected) {
                assert!(
                    found == expected || (found - expected).abs() < 1e-4 * expected,
                    "case {case}: {found} {expected}"
                );
            }
        }
    }
}
