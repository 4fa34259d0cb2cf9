//! The values of a volume, gathered in bins with their exact moments.
//!
//! 8 and 16 bit values have a bin each, and so have other values where no two of them fall into one bin: the histogram is the
//! sample. Otherwise there are 2¹⁶ bins between robust extremes and 1024 of growing width beyond them. A
//! bin keeps its values' mean and mean squared deviation; all voxels of a bin share their responsibilities, by the mean of
//! their log-densities (Verbeek, Nunnink & Vlassis 2006). What is maximised is then a lower bound of the log-likelihood.

use ivd_core::{Error, Exec, Mask, Scalar, Volume, Voxels, parallel, with_voxels};

use crate::histogram;

/// Bins between the extremes.
const CORE: usize = 1 << 16;
/// Bins beyond either extreme: eight an octave.
const TAIL: usize = 512;
/// Parts of the volume that are summed apart, whatever the threads.
const PARTS: usize = 16;
/// Share of the values that may lie beyond either robust extreme.
const BEYOND: u64 = 1 << 14;
/// Voxels between two looks at the cancel flag.
const CHUNK: usize = 1 << 16;
/// Bins of the coarse histogram that the search begins with.
const COARSE: usize = 1024;

/// Occupied bins, ascending, and the frame they are measured in: a number `t` stands for the stored value `centre + unit t`.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Bins {
    pub(super) centre: f64,
    pub(super) unit: f64,
    /// Mean of a bin's values, in the frame.
    pub(super) value: Vec<f64>,
    /// Mean squared deviation from it, in the frame.
    pub(super) spread: Vec<f64>,
    pub(super) count: Vec<f64>,
    /// Smallest and largest stored value of each bin.
    pub(super) ends: Vec<[f64; 2]>,
    pub(super) total: f64,
    /// Variance of the values between their quantiles of 0.1 % and 99.9 %, and these quantiles, in the frame.
    pub(super) variance: f64,
    pub(super) quantiles: [f64; 2],
    /// Least distance of neighbouring values; 0 where bins hold several.
    pub(super) step: f64,
    ruler: Ruler,
    /// Bin of each slot of the ruler.
    bin_of: Vec<u32>,
}

/// From a stored value to a slot.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Ruler {
    low: f64,
    /// Slots a stored unit; values are halved so that no difference overflows.
    rate: f64,
}

impl Ruler {
    const SLOTS: usize = CORE + 2 * TAIL;

    fn between(low: f64, high: f64) -> Self {
        let width = high * 0.5 - low * 0.5;
        let rate = if width > 0.0 { ((CORE - 1) as f64 / width).min(f64::MAX) } else { 0.0 };
        Self { low, rate }
    }

    #[inline]
    fn slot(&self, value: f64) -> usize {
        let at = (value * 0.5 - self.low * 0.5) * self.rate;
        if at < 0.0 {
            TAIL - 1 - octaves(-at)
        } else if at < CORE as f64 {
            TAIL + at as usize
        } else {
            TAIL + CORE + octaves(at - CORE as f64)
        }
    }
}

fn octaves(slots: f64) -> usize {
    (((1.0 + slots).log2() * 8.0) as usize).min(TAIL - 1)
}

/// What is known of the values in a slot.
#[derive(Debug, Clone, Copy)]
struct Slot {
    count: u64,
    /// Sums of the scaled differences from the smallest value that came first.
    first: f64,
    sum: f64,
    squares: f64,
    ends: [f64; 2],
}

impl Slot {
    const EMPTY: Self =
        Self { count: 0, first: 0.0, sum: 0.0, squares: 0.0, ends: [f64::INFINITY, f64::NEG_INFINITY] };

    #[inline]
    fn add(&mut self, value: f64, count: u64, shrink: f64) {
        if self.count == 0 {
            self.first = value;
        }
        let d = value * shrink - self.first * shrink;
        self.count += count;
        self.sum += d * count as f64;
        self.squares += d * d * count as f64;
        self.ends = [self.ends[0].min(value), self.ends[1].max(value)];
    }

    fn join(&mut self, other: &Self, shrink: f64) {
        if self.count == 0 {
            *self = *other;
        } else if other.count > 0 {
            let (n, d) = (other.count as f64, other.first * shrink - self.first * shrink);
            self.squares += other.squares + 2.0 * d * other.sum + d * d * n;
            self.sum += other.sum + d * n;
            self.count += other.count;
            self.ends = [self.ends[0].min(other.ends[0]), self.ends[1].max(other.ends[1])];
        }
    }

    fn is_exact(&self) -> bool {
        self.ends[0] == self.ends[1]
    }
}

/// A power of two that keeps squares of differences within `f64`.
fn shrink(low: f64, high: f64) -> f64 {
    let largest = low.abs().max(high.abs());
    if largest > 1e140 {
        2.0_f64.powi(-600)
    } else if largest < 1e-140 && largest > 0.0 {
        2.0_f64.powi(600)
    } else {
        1.0
    }
}

impl Bins {
    /// The bins of the data inside the mask; `None` where there is none.
    pub(super) fn of(volume: &Volume, mask: Option<&Mask>, exec: &Exec) -> Result<Option<Self>, Error> {
        let Some(histogram) = histogram::of(volume.voxels(), mask, exec)? else {
            return Self::of_reals(volume.voxels(), mask, exec);
        };
        let Some((&low, &high)) = histogram.values.first().zip(histogram.values.last()) else {
            return Ok(None);
        };
        let ruler = Ruler::between(low as f64, high as f64);
        let mut slots = vec![Slot::EMPTY; Ruler::SLOTS];
        for (&value, &count) in histogram.values.iter().zip(&histogram.counts) {
            slots[ruler.slot(value as f64)].add(value as f64, count, 1.0);
        }
        Ok(Some(Self::from_slots(ruler, &slots, 1.0)))
    }

    fn of_reals(voxels: &Voxels, mask: Option<&Mask>, exec: &Exec) -> Result<Option<Self>, Error> {
        exec.check_memory("the histogram", (PARTS * Ruler::SLOTS * size_of::<Slot>()) as u64)?;
        with_voxels!(voxels, slice => {
            let Some([low, high]) = extremes(slice, mask, exec)? else { return Ok(None) };
            let shrink = shrink(low, high);
            let mut ruler = Ruler::between(low, high);
            let mut slots = fill(slice, mask, &ruler, shrink, exec)?;
            // Each look at the middle narrows it by 2¹⁴ at most: doubles would need many only where nobody cares.
            for _ in 0..24 {
                if slots.iter().all(|s| s.count == 0 || s.is_exact()) {
                    break;
                }
                let Some(closer) = closer(&ruler, &slots) else { break };
                ruler = closer;
                slots = fill(slice, mask, &ruler, shrink, exec)?;
            }
            Ok(Some(Self::from_slots(ruler, &slots, shrink)))
        })
    }

    fn from_slots(ruler: Ruler, slots: &[Slot], shrink: f64) -> Self {
        let mut bin_of = vec![u32::MAX; slots.len()];
        let mut occupied: Vec<&Slot> = Vec::new();
        for (slot, bin) in slots.iter().zip(&mut bin_of).filter(|(slot, _)| slot.count > 0) {
            *bin = occupied.len() as u32;
            occupied.push(slot);
        }
        let count: Vec<f64> = occupied.iter().map(|s| s.count as f64).collect();
        let total: f64 = count.iter().sum();
        let quantile = |share: f64| {
            let mut below = 0.0;
            let at = count.iter().position(|n| {
                below += n;
                below > share * total
            });
            at.unwrap_or(count.len() - 1)
        };
        let [low, middle, high] = [0.001, 0.5, 0.999].map(quantile);
        let centre = occupied[middle].first;
        let exact = occupied.iter().all(|s| s.is_exact());
        let mean = |s: &Slot, about: f64| {
            let own = if s.is_exact() { 0.0 } else { s.sum / s.count as f64 };
            (s.first * shrink - about * shrink) + own
        };
        let spread = |s: &Slot| {
            let n = s.count as f64;
            if s.is_exact() { 0.0 } else { (s.squares / n - (s.sum / n) * (s.sum / n)).max(0.0) }
        };
        let value: Vec<f64> = occupied.iter().map(|s| mean(s, centre)).collect();
        let spreads: Vec<f64> = occupied.iter().map(|s| spread(s)).collect();
        let step = value.windows(2).map(|w| w[1] - w[0]).fold(f64::INFINITY, f64::min);
        let mut own = Self {
            centre,
            unit: 1.0,
            quantiles: [value[low], value[high]],
            value,
            spread: spreads,
            count,
            ends: occupied.iter().map(|s| s.ends).collect(),
            total,
            variance: 0.0,
            step: if exact && step.is_finite() { step } else { 0.0 },
            ruler,
            bin_of,
        };
        own.variance = own.variance_between(low, high);
        own.scale(shrink);
        own
    }

    /// Variance of the bins `low … high`, or of all where that is 0.
    fn variance_between(&self, low: usize, high: usize) -> f64 {
        let over = |a: usize, b: usize| {
            let n: f64 = self.count[a..=b].iter().sum();
            let sum = |f: &dyn Fn(usize) -> f64| (a..=b).map(|i| self.count[i] * f(i)).sum::<f64>() / n;
            let mean = sum(&|i| self.value[i]);
            sum(&|i| (self.value[i] - mean).powi(2) + self.spread[i])
        };
        let trimmed = over(low, high);
        if trimmed > 0.0 { trimmed } else { over(0, self.value.len() - 1) }
    }

    /// Makes the deviation of the values about 1, by a power of two.
    fn scale(&mut self, shrink: f64) {
        let extent = self.value[0].abs().max(self.value[self.value.len() - 1].abs());
        let deviation = if self.variance > 0.0 { self.variance.sqrt() } else { shrink };
        // Neither the unit nor what it is in stored values may leave the normal numbers.
        let shift = shrink.log2();
        let exponent = deviation.max(extent * 1e-100).log2().round();
        let exponent = exponent.clamp((shift - 1000.0).max(-900.0), (shift + 1000.0).min(900.0)) as i32;
        let unit = 2.0_f64.powi(exponent);
        self.value.iter_mut().chain(&mut self.quantiles).for_each(|v| *v /= unit);
        self.spread.iter_mut().for_each(|v| *v = *v / unit / unit);
        self.variance = self.variance / unit / unit;
        self.step /= unit;
        self.unit = unit / shrink;
    }

    /// Bin of a stored value that was counted.
    #[inline]
    pub(super) fn bin(&self, stored: f64) -> u32 {
        self.bin_of[self.ruler.slot(stored)]
    }

    pub(super) fn len(&self) -> usize {
        self.value.len()
    }

    /// Whether every bin holds one value only.
    pub(super) fn is_exact(&self) -> bool {
        self.ends.iter().all(|[low, high]| low == high)
    }

    /// The same values in about a thousand bins, where there are many more. Only for sums: a bin isn't found by its value.
    pub(super) fn coarse(&self) -> Option<Self> {
        if self.len() <= 2 * COARSE {
            return None;
        }
        let [low, high] = self.quantiles;
        let [low, high] = [2.0 * low - high, 2.0 * high - low];
        let group = |t: f64| ((t - low) / (high - low) * COARSE as f64).clamp(0.0, COARSE as f64) as usize;
        let mut own = Self {
            value: Vec::new(),
            spread: Vec::new(),
            count: Vec::new(),
            ends: Vec::new(),
            ..self.clone()
        };
        let mut from = 0;
        while from < self.len() {
            let mut to = from + 1;
            while to < self.len() && group(self.value[to]) == group(self.value[from]) {
                to += 1;
            }
            let n: f64 = self.count[from..to].iter().sum();
            let sum = |f: &dyn Fn(usize) -> f64| (from..to).map(|i| self.count[i] * f(i)).sum::<f64>() / n;
            let mean = sum(&|i| self.value[i]);
            own.value.push(mean);
            own.spread.push(sum(&|i| (self.value[i] - mean).powi(2) + self.spread[i]));
            own.count.push(n);
            own.ends.push([self.ends[from][0], self.ends[to - 1][1]]);
            from = to;
        }
        Some(own)
    }
}

/// A ruler for the values between their robust extremes, where these are much closer than the present ones.
fn closer(ruler: &Ruler, slots: &[Slot]) -> Option<Ruler> {
    let total: u64 = slots.iter().map(|s| s.count).sum();
    let beyond = (total / BEYOND).max(1);
    let low = first_beyond(slots.iter(), beyond).max(TAIL);
    let high = (slots.len() - 1 - first_beyond(slots.iter().rev(), beyond)).min(TAIL + CORE - 1);
    if high < low || high - low >= CORE / 4 || ruler.rate >= f64::MAX {
        return None;
    }
    // What the slots at both ends really hold: a single slot may be much wider than its values.
    let inside = slots[low..=high].iter().filter(|s| s.count > 0);
    let ends =
        inside.fold([f64::INFINITY, f64::NEG_INFINITY], |[a, b], s| [a.min(s.ends[0]), b.max(s.ends[1])]);
    let next = Ruler::between(ends[0], ends[1]);
    (next.rate > ruler.rate * 2.0).then_some(next)
}

/// Place of the first slot up to which there are more than `beyond` values.
fn first_beyond<'a>(mut slots: impl Iterator<Item = &'a Slot>, beyond: u64) -> usize {
    let mut sum = 0;
    let found = slots.position(|s| {
        sum += s.count;
        sum > beyond
    });
    found.unwrap_or(0)
}

/// Smallest and largest datum.
pub(super) fn extremes<T: Scalar>(
    voxels: &[T],
    mask: Option<&Mask>,
    exec: &Exec,
) -> Result<Option<[f64; 2]>, Error> {
    let none = [f64::INFINITY, f64::NEG_INFINITY];
    let join = |a: [f64; 2], b: [f64; 2]| [a[0].min(b[0]), a[1].max(b[1])];
    let parts: Vec<[f64; 2]> = parallel::try_map_pieces(voxels.len(), CHUNK, &|piece| {
        exec.check_cancelled()?;
        let from = piece.start;
        Ok::<_, Error>(data(&voxels[piece], mask, from).fold(none, |ends, v| join(ends, [v, v])))
    })?;
    let found = parts.into_iter().fold(none, join);
    Ok((found[0] <= found[1]).then_some(found))
}

/// The data of a chunk that begins at `from`.
fn data<'a, T: Scalar>(
    chunk: &'a [T],
    mask: Option<&'a Mask>,
    from: usize,
) -> impl Iterator<Item = f64> + 'a {
    let inside = move |j: usize| mask.is_none_or(|m| m.inside()[from + j] != 0);
    chunk.iter().enumerate().filter(move |(j, v)| v.is_data() && inside(*j)).map(|(_, v)| v.to_f64())
}

fn fill<T: Scalar>(
    voxels: &[T],
    mask: Option<&Mask>,
    ruler: &Ruler,
    shrink: f64,
    exec: &Exec,
) -> Result<Vec<Slot>, Error> {
    let part = voxels.len().div_ceil(PARTS).max(CHUNK);
    let parts: Vec<Vec<Slot>> = parallel::try_map_pieces(voxels.len(), part, &|piece| {
        let mut slots = vec![Slot::EMPTY; Ruler::SLOTS];
        let from = piece.start;
        for (j, chunk) in voxels[piece].chunks(CHUNK).enumerate() {
            exec.check_cancelled()?;
            data(chunk, mask, from + j * CHUNK).for_each(|v| slots[ruler.slot(v)].add(v, 1, shrink));
        }
        Ok::<_, Error>(slots)
    })?;
    let mut parts = parts.into_iter();
    let mut all = parts.next().unwrap_or_else(|| vec![Slot::EMPTY; Ruler::SLOTS]);
    for part in parts {
        all.iter_mut().zip(&part).for_each(|(all, part)| all.join(part, shrink));
    }
    Ok(all)
}
