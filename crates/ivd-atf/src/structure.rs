//! How classes lie beside each other: faces between their voxels, steps across them, how steep values are inside, and noise.
//!
//! All of it is measured between voxels that are neighbours, never between samples further apart. Of a volume that is held in samples the rows
//! of voxels that have samples are measured, so that a volume of a voxel more gives what the smaller one gives.

use ivd_core::{Exec, parallel};

use crate::Error;
use crate::reduced::{MAX_LEVEL, MISSING, Reduced, evenly};

/// Bins of a histogram of squared slopes: an eighth of an octave each, from the bits of a single-precision number.
const SLOPE_BINS: usize = 2048;
/// Bins of the histogram of values.
pub(crate) const VALUE_BINS: usize = 1024;
/// Slopes and second differences are taken at one voxel of so many.
const EVERY: usize = 3;
/// Standard deviation of a second difference of white noise of deviation 1.
const OF_SECOND: f64 = 2.449_489_742_783_178;
/// Where fewer than this share of neighbouring triples aren't all equal, as in a drawn volume, those that differ are edges and no noise.
const NOISY: f64 = 0.05;
/// Median of the magnitude of a normal deviate.
const MEDIAN_OF_NORMAL: f64 = 0.674_489_750_196_081_7;

/// Measures of neighbouring voxels by class; classes are numbered in the order of their means.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Structure {
    classes: usize,
    /// Faces between a voxel of class `a` and one of class `b`, at `a * classes + b`, and at `b * classes + a` again; each face once.
    faces: Vec<u64>,
    /// Steps across them, summed, in levels.
    steps: Vec<u64>,
    /// Median magnitude of the slope in each class [levels / voxel], where a voxel's length is the cube root of its volume.
    pub(crate) slope: Vec<f64>,
    /// Standard deviation of the noise [levels].
    pub(crate) noise: f64,
    /// Number of voxels in equal bins of the range.
    pub(crate) histogram: Vec<u64>,
}

impl Structure {
    /// Number of classes.
    pub(crate) fn classes(&self) -> usize {
        self.classes
    }

    /// Faces of `a` on `b`.
    pub(crate) fn faces(&self, a: usize, b: usize) -> u64 {
        self.faces[a * self.classes + b]
    }

    /// Faces of `a`, on itself too.
    pub(crate) fn all_faces(&self, a: usize) -> u64 {
        self.faces[a * self.classes..][..self.classes].iter().sum()
    }

    /// Mean step across the faces of `a` on those classes that `on` names [levels]; infinite without such faces.
    pub(crate) fn step(&self, a: usize, on: impl Fn(usize) -> bool) -> f64 {
        let chosen = || (0..self.classes).filter(|&b| b != a && on(b)).map(|b| a * self.classes + b);
        let faces: u64 = chosen().map(|i| self.faces[i]).sum();
        let steps: u64 = chosen().map(|i| self.steps[i]).sum();
        if faces == 0 { f64::INFINITY } else { steps as f64 / faces as f64 }
    }

    /// Makes the mean step across the faces of two classes so large [levels].
    #[cfg(test)]
    pub(crate) fn set_step(&mut self, a: usize, b: usize, mean: u64) {
        for at in [a * self.classes + b, b * self.classes + a] {
            self.steps[at] = mean * self.faces[at];
        }
    }

    /// A structure without noise and slopes, from its faces alone.
    #[cfg(test)]
    pub(crate) fn of_faces(classes: usize, faces: Vec<u64>) -> Self {
        let steps = vec![0; faces.len()];
        Self { classes, faces, steps, slope: vec![0.0; classes], noise: 0.0, histogram: vec![0; VALUE_BINS] }
    }
}

/// Counts of one thread.
struct Counts {
    faces: Vec<u64>,
    steps: Vec<u64>,
    slopes: Vec<u32>,
    seconds: Vec<u64>,
    flat: u64,
    histogram: Vec<u64>,
    ranks: [Vec<u16>; 3],
    levels: [Vec<u16>; 5],
}

/// Looks at voxels and their six neighbours. All sums are of whole numbers: the same for any number of threads.
///
/// `least_noise`: below which no noise is taken to be [levels], such as that of rounding to whole numbers.
pub(crate) fn measure(
    reduced: &Reduced<'_>,
    classes: usize,
    least_noise: f64,
    exec: &Exec,
) -> Result<Structure, Error> {
    let [_, ny, nz] = reduced.full;
    let rows = [reduced.dims[1], reduced.dims[2]];
    let of_thread = 16 * classes * classes + 4 * classes * SLOPE_BINS + 8 * (2 * usize::from(MISSING) + 1);
    exec.check_memory("faces between the classes", ((rayon::current_num_threads() + 1) * of_thread) as u64)?;
    let length = reduced.voxel_spacing.iter().product::<f64>().cbrt();
    let per_length = reduced.voxel_spacing.map(|spacing| (length / spacing) as f32);
    let empty = || Counts {
        faces: vec![0; classes * classes],
        steps: vec![0; classes * classes],
        slopes: vec![0; classes * SLOPE_BINS],
        seconds: vec![0; 2 * usize::from(MISSING) + 1],
        flat: 0,
        histogram: vec![0; VALUE_BINS],
        ranks: Default::default(),
        levels: Default::default(),
    };
    let gathered = parallel::try_gather(rows[1], &empty, &|counts, z| {
        exec.check_cancelled()?;
        let z = evenly(z, rows[1], nz);
        for y in 0..rows[0] {
            count_row(reduced, classes, [evenly(y, rows[0], ny), z], per_length, counts);
        }
        Ok::<_, Error>(())
    })?;
    let mut all = empty();
    for counts in gathered {
        let pairs: [(&mut Vec<u64>, &[u64]); 4] = [
            (&mut all.faces, &counts.faces),
            (&mut all.steps, &counts.steps),
            (&mut all.seconds, &counts.seconds),
            (&mut all.histogram, &counts.histogram),
        ];
        for (sum, part) in pairs {
            sum.iter_mut().zip(part).for_each(|(sum, part)| *sum += part);
        }
        all.flat += counts.flat;
        all.slopes.iter_mut().zip(&counts.slopes).for_each(|(sum, part)| *sum += part);
    }
    let slopes = all.slopes.chunks_exact(SLOPE_BINS);
    let slope = slopes.map(|bins| {
        let bin = median(bins.iter().map(|&n| u64::from(n)));
        // Twice the central difference was squared.
        bin.map_or(0.0, |bin| 0.5 * f64::from(f32::from_bits((bin as u32) << 20)).sqrt())
    });
    let differing: u64 = all.seconds.iter().sum();
    let is_noisy = differing as f64 >= NOISY * (differing + all.flat) as f64;
    let second = if is_noisy { median(all.seconds.iter().copied()).unwrap_or(0) as f64 } else { 0.0 };
    Ok(Structure {
        classes,
        slope: slope.collect(),
        noise: (second / (MEDIAN_OF_NORMAL * OF_SECOND)).max(least_noise),
        faces: all.faces,
        steps: all.steps,
        histogram: all.histogram,
    })
}

/// Voxels so many apart, at most, are looked at for noise whose grains are larger than a voxel: …
const FARTHEST: usize = 6;
/// … so many along each axis at least.
const LEAST_ALONG: usize = 16;
/// Noise that is greater by less than this factor than between voxels one less apart has no larger grains.
const GROWN: f64 = 1.1;

/// The same of voxels so far apart that noise is independent in them, where it isn't in neighbours. None where it is, and where values differ the more the
/// further apart they are: that is what they do in a body.
///
/// - `near`: of neighbours.
pub(crate) fn apart(
    reduced: &Reduced<'_>,
    near: &Structure,
    least_noise: f64,
    exec: &Exec,
) -> Result<Option<Structure>, Error> {
    let (mut found, mut noise) = (None, near.noise);
    for stride in 2..=FARTHEST {
        if noise == 0.0 || reduced.full.iter().any(|n| n / stride < LEAST_ALONG) {
            break;
        }
        let further = measure(&reduced.strided(stride, exec)?, near.classes, least_noise, exec)?;
        if further.noise < GROWN * noise {
            return Ok(found);
        }
        noise = further.noise;
        found = Some(further);
    }
    Ok(None)
}

/// The first bin up to which lies half of what is counted; `None` where nothing is.
fn median(counts: impl Iterator<Item = u64> + Clone) -> Option<usize> {
    let all: u64 = counts.clone().sum();
    let mut below = 0;
    let half = |n: u64| {
        below += n;
        2 * below >= all
    };
    if all == 0 { None } else { counts.map(half).position(|reached| reached) }
}

/// `per_length`: what turns a difference along each axis into one over a voxel's length.
fn count_row(
    reduced: &Reduced<'_>,
    classes: usize,
    [y, z]: [usize; 2],
    per_length: [f32; 3],
    counts: &mut Counts,
) {
    let [nx, ny, nz] = reduced.full;
    let [own_ranks, next_y_ranks, next_z_ranks] = &mut counts.ranks;
    let [own, before_y, after_y, before_z, after_z] = &mut counts.levels;
    let row = reduced.voxel_levels(y, z, own);
    let here = reduced.voxel_ranks(y, z, own_ranks);
    let before_y = (y > 0).then(|| reduced.voxel_levels(y - 1, z, before_y));
    let before_z = (z > 0).then(|| reduced.voxel_levels(y, z - 1, before_z));
    let after_y = (y + 1 < ny).then(|| reduced.voxel_levels(y + 1, z, after_y));
    let after_z = (z + 1 < nz).then(|| reduced.voxel_levels(y, z + 1, after_z));
    let neighbours = [
        after_y.map(|levels| (levels, reduced.voxel_ranks(y + 1, z, next_y_ranks))),
        after_z.map(|levels| (levels, reduced.voxel_ranks(y, z + 1, next_z_ranks))),
    ];
    let sides = match (before_y, after_y, before_z, after_z) {
        (Some(a), Some(b), Some(c), Some(d)) => Some([a, b, c, d]),
        _ => None,
    };
    let (faces, steps) = (&mut counts.faces, &mut counts.steps);
    let mut face = |a: u16, b: u16, from: u16, to: u16| {
        if to == MISSING {
            return;
        }
        let (a, b) = (usize::from(a), usize::from(b));
        let step = u64::from(from.abs_diff(to));
        faces[a * classes + b] += 1;
        steps[a * classes + b] += step;
        if a != b {
            faces[b * classes + a] += 1;
            steps[b * classes + a] += step;
        }
    };
    for x in 0..nx {
        let (level, rank) = (row[x], here[x]);
        if level == MISSING {
            continue;
        }
        counts.histogram[usize::from(level) * VALUE_BINS / (usize::from(MAX_LEVEL) + 1)] += 1;
        if x + 1 < nx {
            face(rank, here[x + 1], level, row[x + 1]);
        }
        for (levels, ranks) in neighbours.iter().flatten() {
            face(rank, ranks[x], level, levels[x]);
        }
        // Slopes and noise are medians: a part of the voxels is enough.
        if x == 0 || x + 1 == nx || !(x + y + z).is_multiple_of(EVERY) {
            continue;
        }
        let (before, after) = (row[x - 1], row[x + 1]);
        if before == MISSING || after == MISSING {
            continue;
        }
        // Three equal values are clipped ones: they tell nothing of the noise.
        if before != level || after != level {
            let second = i32::from(before) + i32::from(after) - 2 * i32::from(level);
            counts.seconds[second.unsigned_abs() as usize] += 1;
        } else {
            counts.flat += 1;
        }
        if let Some(sides) = sides.map(|rows| rows.map(|row| row[x])).filter(|s| !s.contains(&MISSING)) {
            let twice = [[before, after], [sides[0], sides[1]], [sides[2], sides[3]]];
            let squared: f32 = twice
                .iter()
                .zip(per_length)
                .map(|([a, b], per_length)| ((f32::from(*b) - f32::from(*a)) * per_length).powi(2))
                .sum();
            counts.slopes[usize::from(rank) * SLOPE_BINS + (squared.to_bits() >> 20) as usize] += 1;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use ivd_core::{Grid, Labels, Volume, Voxels};

    #[test]
    fn faces_steps_slopes_and_noise_of_a_step_and_of_noise() {
        let grid = Grid::with_spacing([80, 6, 6], [1.0; 3]).unwrap();
        let values: Vec<f32> =
            (0..grid.len()).map(|i| if grid.index(i).0[0] < 40 { 0.0 } else { 100.0 }).collect();
        let ids: Vec<u16> = values.iter().map(|&v| if v > 0.0 { 8 } else { 3 }).collect();
        let volume = Volume::new(grid.clone(), Voxels::from(values)).unwrap();
        let labels = Labels::new(grid, ids.into(), vec![]).unwrap();
        let mut rank = vec![0; 1 << 16];
        rank[8] = 1;
        let exec = Exec::default();
        let reduced = Reduced::new(&volume, &labels, rank, [0.0, 100.0], 80, &exec).unwrap();
        let found = measure(&reduced, 2, 0.0, &exec).unwrap();
        assert_eq!((found.faces(0, 1), found.faces(1, 0)), (36, 36));
        // Along x 39 faces a row; 6 · 5 + 5 · 6 faces along y and z in each of 40 layers.
        assert_eq!(found.faces(0, 0), 39 * 36 + 40 * 60);
        assert!((found.step(0, |b| b == 1) - f64::from(MAX_LEVEL)).abs() < 1e-9);
        assert_eq!(found.step(0, |_| false), f64::INFINITY);
        assert_eq!(found.slope, [0.0, 0.0], "most of each half is flat");
        assert_eq!(found.noise, 0.0, "a single step is no noise");
        assert_eq!(found.histogram.iter().sum::<u64>(), 80 * 36);
    }

    #[test]
    fn noise_is_that_of_normal_deviates() {
        let grid = Grid::with_spacing([64, 32, 16], [1.0; 3]).unwrap();
        // Sums of twelve uniform numbers, deviation 1.
        let mut state = 1_u64;
        let mut uniform = || {
            state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            (state >> 40) as f32 / (1 << 24) as f32
        };
        let values: Vec<f32> =
            (0..grid.len()).map(|_| (0..12).map(|_| uniform()).sum::<f32>() - 6.0).collect();
        let labels = Labels::new(grid.clone(), vec![1; grid.len()].into(), vec![]).unwrap();
        let volume = Volume::new(grid, Voxels::from(values)).unwrap();
        let (range, exec) = (volume.range().unwrap(), Exec::default());
        let reduced = Reduced::new(&volume, &labels, vec![0; 1 << 16], range, 64, &exec).unwrap();
        let found = measure(&reduced, 1, 0.0, &exec).unwrap().noise * reduced.step();
        assert!((found - 1.0).abs() < 0.02, "{found}");
    }
}
