//! What a sample on a ray may be: one of a number of kinds, each a mix of materials.

use std::collections::HashMap;

use ivd_core::{Exec, parallel};

use crate::Error;
use crate::mix::Mix;
use crate::reduced::{MAX_LEVEL, Reduced};
use crate::roles::Role;

/// Even bins of the value axis, in all rows together at most, …
const MOST_BINS: usize = 1 << 16;
/// … in a row at most, …
const MOST_IN_ROW: usize = 2048;
/// … and at least.
const LEAST_IN_ROW: usize = 256;

/// Materials at a value with their shares.
type Parts = Vec<(u16, f32)>;

/// The value axis in bins, and the kinds of samples: what there is to see in a bin, in a row. Rows that show the same in a bin share a kind.
///
/// Bins lie round values that are spread evenly, and round the mean of every class: a class of which the window is narrower than the distance
/// of even bins is met too.
pub(crate) struct SampleBins {
    /// Materials of every kind with their shares, one after the other.
    parts: Parts,
    /// Where the parts of each kind begin, and the end.
    starts: Vec<usize>,
    bin_of_level: Vec<u16>,
    bins: usize,
    /// Kind of each bin in each row, shape `[rows, bins]`.
    kinds: Vec<u32>,
}

impl SampleBins {
    pub(crate) fn new(mix: &Mix<'_>, reduced: &Reduced<'_>, exec: &Exec) -> Result<Self, Error> {
        let rows = mix.rows();
        let centres = centres(mix, reduced, rows);
        let bins = centres.len();
        let of_bins = parallel::try_map(bins, &|bin| {
            exec.check_cancelled()?;
            Ok::<_, Error>(kinds_at(mix, rows, reduced.real(centres[bin])))
        })?;
        let (mut parts, mut starts, mut kinds) = (Vec::new(), vec![0], vec![0; rows * bins]);
        for (bin, (of_bin, of_rows)) in of_bins.into_iter().enumerate() {
            let first = starts.len() - 1;
            for kind in of_bin {
                parts.extend(kind);
                starts.push(parts.len());
            }
            for (row, kind) in of_rows.into_iter().enumerate() {
                kinds[row * bins + bin] = (first + kind) as u32;
            }
        }
        Ok(Self { parts, starts, bin_of_level: nearest(&centres), bins, kinds })
    }

    /// Number of kinds.
    pub(crate) fn len(&self) -> usize {
        self.starts.len() - 1
    }

    /// Materials of a kind with their shares.
    #[inline]
    pub(crate) fn parts(&self, kind: usize) -> &[(u16, f32)] {
        &self.parts[self.starts[kind]..self.starts[kind + 1]]
    }

    /// The bin of a level, 0 … [`MAX_LEVEL`].
    #[inline]
    pub(crate) fn bin(&self, level: u16) -> usize {
        usize::from(self.bin_of_level[usize::from(level)])
    }

    /// The kind of a sample.
    #[inline]
    pub(crate) fn kind(&self, row: usize, level: u16) -> u32 {
        self.kinds[row * self.bins + self.bin(level)]
    }

    /// How many bins before each hold something to see in some row; one longer than there are bins.
    pub(crate) fn visible_below(&self) -> Vec<usize> {
        let of_rows = |bin: usize| self.kinds[bin..].iter().step_by(self.bins);
        let is_visible = |bin: usize| of_rows(bin).any(|&kind| !self.parts(kind as usize).is_empty());
        let mut below = vec![0];
        (0..self.bins).for_each(|bin| below.push(below[bin] + usize::from(is_visible(bin))));
        below
    }

    /// Whether at least half of what is in each bin, by its value alone, is material.
    pub(crate) fn is_matter(&self) -> Vec<bool> {
        let share = |kind: u32| self.parts(kind as usize).iter().map(|(_, share)| share).sum::<f32>();
        self.kinds[..self.bins].iter().map(|&kind| share(kind) >= 0.5).collect()
    }
}

/// Levels that bins lie round, ascending.
fn centres(mix: &Mix<'_>, reduced: &Reduced<'_>, rows: usize) -> Vec<f64> {
    let even = (MOST_BINS / rows.next_power_of_two()).clamp(LEAST_IN_ROW, MOST_IN_ROW);
    let evenly = (0..even).map(|bin| (bin as f64 + 0.5) * f64::from(MAX_LEVEL) / even as f64);
    let step = reduced.step();
    let level = |mean: f64| if step > 0.0 { (mean - reduced.range[0]) / step } else { 0.0 };
    let own = (0..mix.classes.len()).filter(|&class| mix.roles[class] != Role::Transition);
    let means = own.map(|class| level(mix.classes[class].mean).clamp(0.0, f64::from(MAX_LEVEL)));
    let mut centres: Vec<f64> = evenly.chain(means).collect();
    centres.sort_by(f64::total_cmp);
    centres.dedup();
    centres
}

/// For every level, which of the centres is nearest.
fn nearest(centres: &[f64]) -> Vec<u16> {
    let mut bin = 0;
    let of_level = |level: u16| {
        let at = f64::from(level);
        while bin + 1 < centres.len() && centres[bin + 1] - at < at - centres[bin] {
            bin += 1;
        }
        bin as u16
    };
    (0..=MAX_LEVEL).map(of_level).collect()
}

/// The different mixes at a value, and which of them each row has.
fn kinds_at(mix: &Mix<'_>, rows: usize, value: f64) -> (Vec<Parts>, Vec<usize>) {
    let (at, mut shares) = (mix.at(value), Vec::new());
    let (mut kinds, mut known) = (Vec::new(), HashMap::new());
    let of_rows = (0..rows).map(|row| {
        mix.shares(row, value, &at, &mut shares);
        let parts: Parts = shares.iter().map(|&(class, share)| (class as u16, share as f32)).collect();
        let key: Vec<(u16, u32)> = parts.iter().map(|(class, share)| (*class, share.to_bits())).collect();
        *known.entry(key).or_insert_with(|| {
            kinds.push(parts);
            kinds.len() - 1
        })
    });
    let of_rows = of_rows.collect();
    (kinds, of_rows)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_level_belongs_to_the_nearest_centre() {
        let found = nearest(&[10.0, 20.0, 20.5, 60_000.0]);
        let at = |level: u16| found[usize::from(level)];
        assert_eq!((at(0), at(15), at(16), at(20), at(21), at(30_010), at(30_011)), (0, 0, 1, 1, 2, 2, 3));
        assert_eq!(found.len(), usize::from(MAX_LEVEL) + 1);
    }
}
