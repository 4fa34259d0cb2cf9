//! What lies inside classes, and between them.

use std::collections::BTreeMap;

use ivd_core::{Exec, Labels, Scalar, Volume, parallel, with_voxels};
use nalgebra::Vector3;

use super::plane::{Arc, Blob};
use crate::Error;
use crate::mix::Mix;
use crate::roles::Role;
use crate::slopes::Slopes;

/// Slabs that the volume is looked at in: a fixed number, so that sums don't depend on the threads.
const SLABS: usize = 64;
/// Voxels that are looked at, at most.
const LOOKED_AT: usize = 1 << 21;
/// A voxel belongs to a boundary if its gradient exceeds that of noise by this factor …
const STEEP: f64 = 4.0;
/// … and the way up or down ends where values change by less than this share of what they change by at the voxel, …
const LEVEL: f64 = 0.15;
/// … or after so many voxels.
const FARTHEST: f64 = 6.0;
/// Steps in a voxel on that way.
const STEPS: f64 = 2.0;
/// An arc has at least this share of the voxels of all arcs, …
const LEAST_SHARE: f64 = 0.005;
/// … and this many voxels that are looked at.
const LEAST_VOXELS: u64 = 27;
/// Bins of blurs in an octave, and octaves about the length of a voxel.
const BINS: usize = 16;
const OCTAVES: usize = 5;

/// Blobs and arcs of a volume.
pub(super) struct Found {
    /// Of each class; `None` without a voxel whose neighbours are all of its class.
    pub(super) blobs: Vec<Option<Blob>>,
    pub(super) arcs: Vec<Arc>,
}

/// Sums over voxels.
#[derive(Clone, Default)]
struct Sums {
    /// By class: voxels inside, values from the class's mean and their squares, squared gradients.
    inside: Vec<[f64; 4]>,
    /// By pair of classes: voxels, and how many of them have their blur in each bin.
    between: BTreeMap<[usize; 2], (u64, Vec<u64>)>,
}

/// Finds them. `classes`: a volume's classes in the order of their means, `rank`: the place of each label among them. `noise`: deviation of the values'
/// noise. Transitions are neither blobs nor ends of arcs.
pub(super) fn find(
    volume: &Volume,
    labels: &Labels,
    mix: &Mix<'_>,
    rank: &[u16],
    noise: f64,
    exec: &Exec,
) -> Result<Found, Error> {
    let dims = volume.grid().dims();
    let every = volume.grid().len().div_ceil(LOOKED_AT) | 1;
    let slabs = with_voxels!(volume.voxels(), stored => {
        parallel::try_map(SLABS, &|slab| {
            let look = Look::new(volume, stored, labels.ids(), mix, rank, noise);
            let mut sums = Sums { inside: vec![[0.0; 4]; mix.classes.len()], ..Sums::default() };
            let area = dims[0] * dims[1];
            let [from, to] = [slab, slab + 1].map(|slab| dims[2] * slab / SLABS * area);
            for voxel in (from.next_multiple_of(every)..to).step_by(every) {
                if voxel % (1 << 12) < every {
                    exec.check_cancelled()?;
                }
                look.at(voxel, &mut sums);
            }
            Ok::<_, Error>(sums)
        })?
    });
    let mut all = Sums { inside: vec![[0.0; 4]; mix.classes.len()], ..Sums::default() };
    for slab in slabs {
        for (sum, part) in all.inside.iter_mut().flatten().zip(slab.inside.iter().flatten()) {
            *sum += part;
        }
        for (pair, (voxels, blurs)) in slab.between {
            let sum = all.between.entry(pair).or_insert_with(|| (0, vec![0; blurs.len()]));
            sum.0 += voxels;
            sum.1.iter_mut().zip(blurs).for_each(|(sum, part)| *sum += part);
        }
    }
    let length = volume.grid().voxel_volume().cbrt();
    let voxels: u64 = all.between.values().map(|(voxels, _)| voxels).sum();
    let is_arc = |count: u64| count >= LEAST_VOXELS && count as f64 >= LEAST_SHARE * voxels as f64;
    let blob = |class: usize| {
        let [voxels, first, second, squares] = all.inside[class];
        let mean = first / voxels;
        let is_blob = voxels > 0.0 && mix.roles[class] != Role::Transition;
        is_blob.then(|| Blob {
            voxels: voxels * every as f64,
            mean: mix.classes[class].mean + mean,
            sd: (second / voxels - mean * mean).max(0.0).sqrt(),
            slope: (squares / voxels / 3.0).sqrt(),
        })
    };
    let blobs: Vec<Option<Blob>> = (0..mix.classes.len()).map(blob).collect();
    // The inside of a class is what boundaries begin and end at: its other voxels are boundaries themselves.
    let mean = |class: usize| blobs[class].map_or(mix.classes[class].mean, |blob| blob.mean);
    let arcs = all.between.iter().filter(|(_, (count, _))| is_arc(*count)).filter_map(
        |(&classes, (count, blurs))| {
            let means = classes.map(mean);
            let blur = length * median_blur(blurs)?;
            Some(Arc { classes, means, voxels: (count * every as u64) as f64, blur })
        },
    );
    let arcs = arcs.filter(|arc| arc.means[0] < arc.means[1]).collect();
    Ok(Found { blobs, arcs })
}

/// Bin of a blur [voxel lengths]; `None` for one that is no boundary's.
fn bin(blur: f64) -> Option<usize> {
    let at = (blur.log2() + OCTAVES as f64 / 2.0) * BINS as f64;
    (at >= 0.0 && at < (BINS * OCTAVES) as f64).then_some(at as usize)
}

/// The middle of the bin of the median blur.
fn median_blur(bins: &[u64]) -> Option<f64> {
    let all: u64 = bins.iter().sum();
    let mut below = 0;
    let at = bins.iter().position(|count| {
        below += count;
        all > 0 && 2 * below >= all
    })?;
    Some(((at as f64 + 0.5) / BINS as f64 - OCTAVES as f64 / 2.0).exp2())
}

/// A volume to be looked at voxel by voxel.
struct Look<'a, T> {
    volume: &'a Volume,
    slopes: Slopes<'a, T>,
    ids: &'a [u16],
    mix: &'a Mix<'a>,
    rank: &'a [u16],
    /// Length of a voxel (mm).
    length: f64,
    /// Gradient that noise has [real units / mm].
    noise: f64,
}

impl<'a, T: Scalar> Look<'a, T> {
    fn new(
        volume: &'a Volume,
        stored: &'a [T],
        ids: &'a [u16],
        mix: &'a Mix<'a>,
        rank: &'a [u16],
        noise: f64,
    ) -> Self {
        let grid = volume.grid();
        let length = grid.voxel_volume().cbrt();
        // Of half the difference of two values two voxels apart, in three directions.
        let noise = noise * (3.0_f64 / 2.0).sqrt() / grid.shortest_edge();
        Self { volume, slopes: Slopes::new(grid, stored), ids, mix, rank, length, noise }
    }

    fn at(&self, voxel: usize, sums: &mut Sums) {
        let at = self.volume.grid().index(voxel).0;
        let Some(value) = self.slopes.value(at) else { return };
        let gradient = self.slopes.gradient(at) * self.volume.slope();
        let steepness = gradient.norm();
        let class = usize::from(self.rank[usize::from(self.ids[voxel])]);
        if self.is_inside(at, voxel) {
            let value = self.volume.real(value) - self.mix.classes[class].mean;
            let inside = &mut sums.inside[class];
            let part = [1.0, value, value * value, steepness * steepness];
            inside.iter_mut().zip(part).for_each(|(sum, part)| *sum += part);
        }
        if steepness <= STEEP * self.noise || steepness <= 0.0 {
            return;
        }
        let value = self.volume.real(value);
        let along = gradient / steepness;
        let ends = [-1.0, 1.0].map(|side| self.level(at, value, along * side, side, steepness));
        let [Some(low), Some(high)] = ends.map(|end| self.owner(end)) else { return };
        if low >= high || ends[0] >= ends[1] {
            return;
        }
        let (voxels, blurs) = sums.between.entry([low, high]).or_insert_with(|| (0, vec![0; BINS * OCTAVES]));
        *voxels += 1;
        if let Some(bin) = Arc::blur_of(ends, value, steepness).and_then(|blur| bin(blur / self.length)) {
            blurs[bin] += 1;
        }
    }

    /// Whether a voxel and its six neighbours are of one label; those beyond the volume's sides are.
    fn is_inside(&self, at: [usize; 3], voxel: usize) -> bool {
        let [nx, ny, _] = self.slopes.dims;
        let strides = [1, nx, nx * ny];
        let is_own = |i: usize| self.ids[i] == self.ids[voxel];
        (0..3).all(|a| {
            (at[a] == 0 || is_own(voxel - strides[a]))
                && (at[a] + 1 >= self.slopes.dims[a] || is_own(voxel + strides[a]))
        })
    }

    /// The value at which the way from a voxel along a direction levels off. `side`: 1 where values are to rise on it, −1 where they are to fall.
    fn level(&self, from: [usize; 3], value: f64, direction: Vector3<f64>, side: f64, steepness: f64) -> f64 {
        let step = self.length / STEPS;
        let per_step = self.volume.grid().inverse_linear_part() * direction * step;
        let least = LEVEL * steepness * step;
        let mut last = value;
        for i in 1..=(FARTHEST * STEPS) as usize {
            let at = Vector3::from(from.map(|c| c as f64)) + per_step * i as f64;
            let Some(next) = self.slopes.between(at).map(|stored| self.volume.real(stored)) else { break };
            let rise = side * (next - last);
            if rise > 0.0 {
                last = next;
            }
            if rise < least {
                break;
            }
        }
        last
    }

    /// The class that a value belongs to most, of those that aren't transitions.
    fn owner(&self, value: f64) -> Option<usize> {
        let at = self.mix.at(value);
        at.into_iter().max_by(|a, b| a.1.total_cmp(&b.1)).map(|(class, _)| class)
    }
}
