use ivd_core::{Exec, Labels, NO_DATA, Scalar, Volume, parallel, with_voxels};
use rayon::prelude::*;

use crate::Error;
use crate::slopes::Slopes;

/// Most classes that get a row of their own.
pub(crate) const MAX_CLASSES: usize = 1024;
/// Slabs that the volume is summed in: a fixed number, so that sums don't depend on the threads.
const SLABS: usize = 64;

/// What one class looks like, in real values.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct ClassStatistics {
    pub(crate) id: u16,
    /// Voxels with data.
    pub(crate) voxels: u64,
    pub(crate) mean: f64,
    pub(crate) sd: f64,
    /// Mean gradient magnitude over the border voxels (real units per mm); 0 for a class without border.
    pub(crate) border_strength: f64,
    /// Voxels in the first and the last layer across each axis, of those of more than two voxels.
    pub(crate) on_sides: [u64; 3],
}

#[derive(Clone, Default)]
struct Sums {
    voxels: u64,
    first: f64,
    second: f64,
    gradient: f64,
    border: u64,
    on_sides: [u64; 3],
}

/// Statistics of every label that occurs on a voxel with data, label 0 included, in the order of labels.
pub(crate) fn measure(volume: &Volume, labels: &Labels, exec: &Exec) -> Result<Vec<ClassStatistics>, Error> {
    let present = present_labels(labels.ids());
    if present.len() > MAX_CLASSES {
        return Err(Error::TooManyClasses { classes: present.len(), most: MAX_CLASSES });
    }
    let mut slot = vec![0_u16; 1 << 16];
    for (i, &id) in present.iter().enumerate() {
        slot[usize::from(id)] = i as u16;
    }
    // Squares are taken about the middle of the range: an offset of 10⁷ costs no precision.
    let middle = volume.bricks().total().map_or(0.0, |(lo, hi)| 0.5 * (f64::from(lo) + f64::from(hi)));
    let layers = volume.grid().dims()[2];
    exec.observer().begin("class statistics", layers as u64);
    let slabs: Vec<Vec<Sums>> = with_voxels!(volume.voxels(), stored => {
        parallel::try_map(SLABS, &|slab| {
            let scan = Scan::new(volume, labels, stored, &slot, middle);
            let mut sums = vec![Sums::default(); present.len()];
            for z in layers * slab / SLABS..layers * (slab + 1) / SLABS {
                exec.check_cancelled()?;
                scan.layer(z, &mut sums);
                exec.observer().advance("class statistics", 1);
            }
            Ok::<_, Error>(sums)
        })?
    });
    exec.observer().end("class statistics");
    let measured = present.iter().enumerate().map(|(i, &id)| {
        let mut total = Sums::default();
        for sums in &slabs {
            total.voxels += sums[i].voxels;
            total.first += sums[i].first;
            total.second += sums[i].second;
            total.gradient += sums[i].gradient;
            total.border += sums[i].border;
            total.on_sides.iter_mut().zip(sums[i].on_sides).for_each(|(total, n)| *total += n);
        }
        finish(volume, id, &total, middle)
    });
    Ok(measured.filter(|class| class.voxels > 0).collect())
}

fn finish(volume: &Volume, id: u16, total: &Sums, middle: f64) -> ClassStatistics {
    let n = total.voxels.max(1) as f64;
    let mean = total.first / n;
    let variance = (total.second / n - mean * mean).max(0.0);
    ClassStatistics {
        id,
        voxels: total.voxels,
        mean: volume.real(mean + middle),
        sd: variance.sqrt() * volume.slope().abs(),
        border_strength: total.gradient / total.border.max(1) as f64 * volume.slope().abs(),
        on_sides: total.on_sides,
    }
}

/// Whether a voxel is the first or the last along an axis of `n`. Along an axis of one or two voxels every voxel would be, and none of
/// them says what lies round the matter.
#[inline]
pub(crate) fn is_outermost(at: usize, n: usize) -> bool {
    n > 2 && (at == 0 || at + 1 == n)
}

/// Labels that occur, ascending.
fn present_labels(ids: &[u16]) -> Vec<u16> {
    let seen = ids
        .par_chunks(1 << 20)
        .map(|chunk| {
            let mut seen = vec![false; 1 << 16];
            let mut last = None;
            for &id in chunk {
                if last != Some(id) {
                    seen[usize::from(id)] = true;
                    last = Some(id);
                }
            }
            seen
        })
        .reduce(|| vec![false; 1 << 16], |a, b| a.iter().zip(&b).map(|(x, y)| *x || *y).collect());
    (0..=u16::MAX).filter(|&id| seen[usize::from(id)]).collect()
}

/// One pass over a volume and its labels.
struct Scan<'a, T> {
    stored: &'a [T],
    ids: &'a [u16],
    slopes: Slopes<'a, T>,
    slot: &'a [u16],
    middle: f64,
}

impl<'a, T: Scalar> Scan<'a, T> {
    fn new(volume: &Volume, labels: &'a Labels, stored: &'a [T], slot: &'a [u16], middle: f64) -> Self {
        Self { stored, ids: labels.ids(), slopes: Slopes::new(volume.grid(), stored), slot, middle }
    }

    fn layer(&self, z: usize, sums: &mut [Sums]) {
        let [nx, ny, nz] = self.slopes.dims;
        for y in 0..ny {
            let outermost = [is_outermost(y, ny), is_outermost(z, nz)];
            let row = nx * (y + ny * z);
            for x in 0..nx {
                let value = self.stored[row + x];
                if !value.is_data() {
                    continue;
                }
                let sum = &mut sums[usize::from(self.slot[usize::from(self.ids[row + x])])];
                let value = value.to_f64() - self.middle;
                sum.voxels += 1;
                sum.first += value;
                sum.second += value * value;
                sum.on_sides[0] += u64::from(is_outermost(x, nx));
                sum.on_sides[1] += u64::from(outermost[0]);
                sum.on_sides[2] += u64::from(outermost[1]);
                if self.is_border([x, y, z]) {
                    sum.border += 1;
                    sum.gradient += self.slopes.gradient([x, y, z]).norm();
                }
            }
        }
    }

    /// Whether one of the six neighbours has another label. The volume's sides are no border, nor is missing data.
    #[inline]
    fn is_border(&self, at: [usize; 3]) -> bool {
        let (i, strides) = self.slopes.place(at);
        let id = self.ids[i];
        (0..3).any(|a| {
            let differs =
                |j: usize| self.ids[j] != id && (self.ids[j] != NO_DATA || self.stored[j].is_data());
            (at[a] > 0 && differs(i - strides[a]))
                || (at[a] + 1 < self.slopes.dims[a] && differs(i + strides[a]))
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use ivd_core::{Grid, Voxels};

    #[test]
    fn counts_moments_and_border_of_two_halves_on_an_anisotropic_rotated_grid() {
        // A step of 100 across y, whose spacing is 4 mm and whose direction is world -x.
        let direction = [[0.0, 1.0, 0.0], [-1.0, 0.0, 0.0], [0.0, 0.0, 1.0]];
        let grid = Grid::new([5, 6, 4], [1.0, 4.0, 2.0], [3.0, 2.0, 1.0], direction).unwrap();
        let high = |i: usize| grid.index(i).0[1] >= 3;
        let values: Vec<f32> = (0..grid.len()).map(|i| if high(i) { 100.0 } else { 0.0 }).collect();
        let ids: Vec<u16> = (0..grid.len()).map(|i| if high(i) { 9 } else { 4 }).collect();
        let volume = Volume::with_scale(grid.clone(), Voxels::from(values), 2.0, 1e7).unwrap();
        let labels = Labels::new(grid, ids.into(), vec![]).unwrap();
        let classes = measure(&volume, &labels, &Exec::default()).unwrap();
        assert_eq!(classes.iter().map(|c| c.id).collect::<Vec<_>>(), [4, 9]);
        assert_eq!(classes[0].voxels, 60);
        assert!((classes[1].mean - (1e7 + 200.0)).abs() < 1e-6 && classes[1].sd < 1e-3);
        // Central differences across the step: (200 - 0) / 2 voxels / 4 mm.
        assert!((classes[0].border_strength - 25.0).abs() < 1e-9);
        assert!((classes[1].border_strength - 25.0).abs() < 1e-9);
    }

    #[test]
    fn missing_voxels_count_nowhere_and_make_no_border() {
        let grid = Grid::with_spacing([4, 1, 1], [1.0; 3]).unwrap();
        let volume = Volume::new(grid.clone(), Voxels::from(vec![5.0_f32, f32::NAN, 5.0, 5.0])).unwrap();
        let labels = Labels::new(grid, vec![1, 0, 1, 1].into(), vec![]).unwrap();
        let classes = measure(&volume, &labels, &Exec::default()).unwrap();
        assert_eq!(classes.len(), 1);
        assert_eq!((classes[0].voxels, classes[0].border_strength), (3, 0.0));
    }
}
