//! What a set of voxels is: its values, the area of its border and where that runs.

use ivd_core::{BRICK, Error, Exec, parallel};

use super::band::{Band, place};
use super::level::{CUBE, Level};
use super::sweep::{Brick, Faces, row};

/// Bins of a histogram over 0 … 1.
pub(super) const BINS: usize = 256;

/// The bin of a value.
#[inline]
pub(super) fn bin(value: f32) -> usize {
    ((value * BINS as f32) as usize).min(BINS - 1)
}

/// Values of a set, summed up.
#[derive(Debug, Clone, Default, PartialEq)]
pub(super) struct Tally {
    pub(super) count: f64,
    pub(super) sum: f64,
    pub(super) squares: f64,
    /// Counts by bin; empty where the model needs none.
    pub(super) bins: Vec<f64>,
}

impl Tally {
    pub(super) fn new(bins: bool) -> Self {
        Self { bins: vec![0.0; if bins { BINS } else { 0 }], ..Self::default() }
    }

    #[inline]
    fn add(&mut self, value: f32) {
        let v = f64::from(value);
        self.count += 1.0;
        self.sum += v;
        self.squares += v * v;
        if !self.bins.is_empty() {
            self.bins[bin(value)] += 1.0;
        }
    }

    /// With `sign` times another.
    pub(super) fn plus(&mut self, sign: f64, other: &Self) {
        self.count += sign * other.count;
        self.sum += sign * other.sum;
        self.squares += sign * other.squares;
        for (own, other) in self.bins.iter_mut().zip(&other.bins) {
            *own += sign * other;
        }
    }

    pub(super) fn mean(&self) -> f64 {
        if self.count > 0.0 { self.sum / self.count } else { 0.0 }
    }

    /// Variance, 0 at least.
    pub(super) fn variance(&self) -> f64 {
        if self.count > 0.0 { (self.squares / self.count - self.mean().powi(2)).max(0.0) } else { 0.0 }
    }

    /// With one value more, where it is one.
    pub(super) fn count_in(&mut self, value: f32) {
        if !value.is_nan() {
            self.add(value);
        }
    }

    /// Of a brick's values, where there are any.
    fn of(values: &Brick, bins: bool) -> Self {
        let mut tally = Self::new(bins);
        if bins {
            for value in values {
                tally.count_in(*value);
            }
            return tally;
        }
        // Eight sums side by side: one alone waits for itself.
        let mut sums = [[0.0_f64; BRICK]; 3];
        for row in values.chunks_exact(BRICK) {
            for (x, value) in row.iter().enumerate() {
                let (one, v) = if value.is_nan() { (0.0, 0.0) } else { (1.0, f64::from(*value)) };
                sums[0][x] += one;
                sums[1][x] += v;
                sums[2][x] += v * v;
            }
        }
        let [count, sum, squares] = sums.map(|lanes| lanes.iter().sum());
        Self { count, sum, squares, ..tally }
    }
}

/// A bit for every voxel of a brick: whether it is inside.
pub(super) type Bits = [u64; BRICK];

/// Whether a voxel of a brick is inside.
#[inline]
pub(super) fn is_inside(bits: &Bits, voxel: usize) -> bool {
    bits[voxel / 64] >> (voxel % 64) & 1 == 1
}

/// What is seen in a brick.
pub(super) struct Look {
    /// Values inside.
    pub(super) inside: Tally,
    /// Area of the border (shortest edges squared times the other edges: in voxels of the functional).
    pub(super) area: f64,
    /// Faces between voxels of the border.
    pub(super) faces: u64,
    /// The lowest and the highest voxel with the border at it.
    pub(super) front: Option<[[usize; 3]; 2]>,
    pub(super) bits: Bits,
}

/// A bit for each of eight shares that is above a half.
#[inline(always)]
fn above_half(row: &[f32; BRICK]) -> u8 {
    row.iter().enumerate().fold(0, |bits, (i, u)| bits | u8::from(*u > 0.5) << i)
}

/// Looks at the set of shares above a half in a brick.
fn look(band: &Band, slot: usize, weights: &[f64; 8], bins: bool) -> Look {
    let brick = band.place(slot);
    let faces = Faces { above: band.above(brick), extent: band.extent(brick) };
    let (u, values) = (&band.primal[slot].u, &band.values[slot]);
    let mut found = Look { inside: Tally::new(bins), area: 0.0, faces: 0, front: None, bits: [0; BRICK] };
    let mut kinds = [0_u32; 8];
    let softened = band.softness.get(slot);
    let next_x = faces.next_x(u);
    for z in 0..faces.extent[2] {
        for y in 0..faces.extent[1] {
            let first = BRICK * (y + BRICK * z);
            let here = above_half(row(u, first));
            let next = [row(&next_x, first), faces.next_y(u, y, z), faces.next_z(u, y, z)];
            let changes = next.map(|next| above_half(next) ^ here);
            found.bits[z] |= u64::from(here) << (BRICK * y);
            if here != 0 {
                for (x, &value) in values[first..first + BRICK].iter().enumerate() {
                    if here >> x & 1 == 1 && !value.is_nan() {
                        found.inside.add(value);
                    }
                }
            }
            let any = changes[0] | changes[1] | changes[2];
            if any == 0 {
                continue;
            }
            found.faces += changes.iter().map(|changes| u64::from(changes.count_ones())).sum::<u64>();
            if let Some(soft) = softened {
                for x in (0..BRICK).filter(|x| any >> x & 1 == 1) {
                    let kind = (0..3).fold(0, |kind, a| kind | usize::from(changes[a] >> x & 1) << a);
                    found.area += weights[kind] * f64::from(soft[first + x]);
                }
            }
            for (kind, count) in kinds.iter_mut().enumerate().skip(1) {
                let of = (0..3).fold(u8::MAX, |bits, a| {
                    bits & if kind >> a & 1 == 1 { changes[a] } else { !changes[a] }
                });
                *count += of.count_ones();
            }
            let at = [any.trailing_zeros() as usize, y, z];
            let end = [7 - any.leading_zeros() as usize, y, z];
            let [low, high] = found.front.get_or_insert([at, end]);
            for a in 0..3 {
                low[a] = low[a].min(at[a]);
                high[a] = high[a].max((end[a] + usize::from(changes[a] != 0)).min(BRICK - 1));
            }
        }
    }
    if softened.is_none() {
        found.area = kinds.iter().zip(weights).map(|(&n, w)| f64::from(n) * w).sum();
    }
    found
}

/// Length of the gradient of a set's indicator, by which of its three differences there are.
fn weights(slope: [f32; 3]) -> [f64; 8] {
    std::array::from_fn(|kind| {
        (0..3).filter(|a| kind >> a & 1 == 1).map(|a| f64::from(slope[a]).powi(2)).sum::<f64>().sqrt()
    })
}

/// Looks at every brick in work.
pub(super) fn look_at_all(band: &Band, slope: [f32; 3], bins: bool, exec: &Exec) -> Result<Vec<Look>, Error> {
    let weights = weights(slope);
    parallel::try_map_pieces(band.len(), 16, &|slots| {
        exec.check_cancelled()?;
        Ok(slots.map(|slot| look(band, slot, &weights, bins)).collect::<Vec<_>>())
    })
    .map(|pieces: Vec<Vec<Look>>| pieces.into_iter().flatten().collect())
}

/// Sums over a whole level, and over those of its bricks that `is_inner` tells.
///
/// # Errors
/// Cancelled.
pub(super) fn tallies(
    level: &Level,
    is_inner: &(dyn Fn([usize; 3]) -> bool + Sync),
    bins: bool,
    exec: &Exec,
) -> Result<[Tally; 2], Error> {
    let sides = level.bricks();
    let none = || [Tally::new(bins), Tally::new(bins)];
    let parts = parallel::try_map_pieces(sides.iter().product(), 64, &|range| {
        exec.check_cancelled()?;
        let [mut total, mut inner] = none();
        let mut values = [0.0; CUBE];
        for brick in range.map(|i| place(sides, i)) {
            level.brick(brick, &mut values);
            let own = Tally::of(&values, bins);
            total.plus(1.0, &own);
            if is_inner(brick) {
                inner.plus(1.0, &own);
            }
        }
        Ok::<_, Error>([total, inner])
    })?;
    let mut all = none();
    for part in &parts {
        all.iter_mut().zip(part).for_each(|(all, part)| all.plus(1.0, part));
    }
    Ok(all)
}

/// Of values that a brick holds.
pub(super) fn tally_of(values: &Brick, bins: bool) -> Tally {
    Tally::of(values, bins)
}
