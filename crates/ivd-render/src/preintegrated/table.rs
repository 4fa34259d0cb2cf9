//! The table of a step over the values at its two ends (Engel, Kraus & Ertl 2001).

use ivd_core::{BrickRange, Error, Exec, TransferFunction, parallel};

use crate::axis::ValueAxis;

/// Values along each side of the table.
const SIDE: usize = 1024;
/// Least places between two of these values where the transfer function is looked at.
const LEAST_BETWEEN: usize = 4;
/// Most of them.
const MOST_BETWEEN: usize = 64;

/// Light and opacity of a step between two values, for a value that goes evenly from one to the other:
///
/// ```text
/// C(f, b) = ∫₀¹ τ c (s(t)) d exp(-∫₀ᵗ τ(s(u)) d du) dt,   A(f, b) = 1 − exp(-∫₀¹ τ(s(t)) d dt),   s(t) = f + t (b − f)
/// ```
///
/// with extinction `τ`, colour `c` and step `d`. What is in front hides what lies behind within a step too.
pub(crate) struct Preintegrated {
    /// Premultiplied, shape `[SIDE, SIDE]`: the value at the front, and at the back.
    table: Vec<[f32; 4]>,
    axis: ValueAxis,
    /// How many entries of equal ends, and intervals after them, before each value aren't clear.
    occupied: Vec<u32>,
}

/// What light meets between two neighbouring values, or at one value.
#[derive(Debug, Clone, Copy)]
struct Piece {
    /// Optical depth over a step if all of it were of these values; infinite where nothing passes.
    depth: f64,
    rgb: [f64; 3],
}

/// Premultiplied colour and opacity in double precision.
type Layer = [f64; 4];

impl Preintegrated {
    /// - `range`: fast values to cover; `real` turns them into real ones.
    /// - `step`: step length in reference lengths.
    ///
    /// # Errors
    /// [`Error::MemoryLimit`], [`Error::Cancelled`].
    pub(crate) fn new(
        transfer: &TransferFunction,
        range: [f32; 2],
        real: impl Fn(f64) -> f64 + Sync,
        step: f64,
        exec: &Exec,
    ) -> Result<Self, Error> {
        exec.check_memory("the pre-integrated table", (2 * size_of::<[f32; 4]>() * SIDE * SIDE) as u64)?;
        let width = f64::from(range[1]) - f64::from(range[0]);
        let value = |at: f64| real(f64::from(range[0]) + width * (at / (SIDE - 1) as f64));
        let between = (4 * transfer.resolution() / SIDE).clamp(LEAST_BETWEEN, MOST_BETWEEN);
        let at_value: Vec<Piece> = (0..SIDE).map(|i| piece(transfer, &[value(i as f64)], step)).collect();
        let after: Vec<Piece> = (0..SIDE - 1)
            .map(|i| {
                let places: Vec<f64> =
                    (0..between).map(|k| value(i as f64 + (k as f64 + 0.5) / between as f64)).collect();
                piece(transfer, &places, step)
            })
            .collect();
        // Entries of one distance between the ends are a window that slides along the values.
        let diagonals = parallel::try_map(SIDE, &|distance| {
            exec.check_cancelled()?;
            if distance == 0 {
                let own: Vec<Layer> = at_value.iter().map(|p| p.layer(1.0)).collect();
                return Ok([own.clone(), own]);
            }
            let layers: Vec<Layer> = after.iter().map(|p| p.layer(1.0 / distance as f64)).collect();
            Ok::<_, Error>([false, true].map(|back| windows(&layers, distance, back)))
        })?;
        let mut table = vec![[0.0; 4]; SIDE * SIDE];
        for (distance, [up, down]) in diagonals.iter().enumerate() {
            for low in 0..SIDE - distance {
                let high = low + distance;
                table[low * SIDE + high] = up[low].map(|c| c as f32);
                table[high * SIDE + low] = down[low].map(|c| c as f32);
            }
        }
        let is_seen = |piece: &Piece| u32::from(piece.depth > 0.0);
        let mut occupied = vec![0];
        for i in 0..SIDE {
            let seen = is_seen(&at_value[i]) + after.get(i).map_or(0, is_seen);
            occupied.push(occupied[i] + seen);
        }
        let axis = ValueAxis::new(range, SIDE).with_clear(&occupied);
        Ok(Self { table, axis, occupied })
    }

    /// Place of a finite fast value.
    #[inline(always)]
    pub(crate) fn index(&self, value: f32) -> u32 {
        self.axis.index(value) as u32
    }

    /// Entry of a step between two places.
    #[inline(always)]
    pub(crate) fn between(&self, front: u32, back: u32) -> [f32; 4] {
        self.table[front as usize * SIDE + back as usize]
    }

    /// Where the entry of a step between two places, each below the table's side, lies.
    #[cfg(target_arch = "x86_64")]
    pub(crate) fn entry(&self, front: u32, back: u32) -> *const [f32; 4] {
        &raw const self.table[front as usize * SIDE + back as usize]
    }

    /// Where values lie along each side.
    #[cfg(target_arch = "x86_64")]
    pub(crate) fn axis(&self) -> &ValueAxis {
        &self.axis
    }

    /// Whether every step between values of a brick is clear.
    pub(crate) fn is_clear(&self, range: BrickRange, shift: f64) -> bool {
        self.axis.places(range, shift).is_none_or(|[from, to]| self.occupied[to] == self.occupied[from])
    }
}

impl Piece {
    /// The piece over a part of a step.
    fn layer(&self, part: f64) -> Layer {
        let alpha = -(-self.depth * part).exp_m1();
        let [r, g, b] = self.rgb;
        [r * alpha, g * alpha, b * alpha, alpha]
    }
}

/// The mean of a transfer function over places, which share a step of `step` reference lengths.
fn piece(transfer: &TransferFunction, places: &[f64], step: f64) -> Piece {
    let (mut depth, mut sum, mut weight) = (0.0, [0.0; 3], 0.0);
    for &place in places {
        let [r, g, b, opacity] = transfer.sample(0, place).map(f64::from);
        let own = -(-opacity).ln_1p();
        depth += own * step / places.len() as f64;
        // Where nothing passes the mean is over those places alone, each as much as the other.
        let own = own.min(f64::from(f32::MAX));
        for (sum, c) in sum.iter_mut().zip([r, g, b]) {
            *sum += own * c;
        }
        weight += own;
    }
    Piece { depth, rgb: if weight > 0.0 { sum.map(|c| c / weight) } else { [0.0; 3] } }
}

/// What is seen of one layer before another.
fn over(front: Layer, back: Layer) -> Layer {
    std::array::from_fn(|c| front[c] + (1.0 - front[3]) * back[c])
}

/// For each place all `length` layers from it on, one over the other, the first in front, or the last with `back`.
///
/// Composition is associative: layers are kept in two stacks, of which the far one holds the compositions of what is left of it, so that every
/// layer is composed a few times, whatever the length, and none is ever taken out of a sum.
fn windows(layers: &[Layer], length: usize, back: bool) -> Vec<Layer> {
    let join = |low: Layer, high: Layer| if back { over(high, low) } else { over(low, high) };
    let mut out = Vec::with_capacity(layers.len() + 1 - length);
    for first in (0..=layers.len() - length).step_by(length) {
        // Windows that begin in this stretch reach into the next one: suffixes of it before prefixes of that.
        let next = first + length;
        let mut suffixes = layers[first..next].to_vec();
        for i in (0..length - 1).rev() {
            suffixes[i] = join(suffixes[i], suffixes[i + 1]);
        }
        let mut prefix: Option<Layer> = None;
        for (i, &suffix) in suffixes.iter().enumerate() {
            if first + i + length > layers.len() {
                break;
            }
            out.push(prefix.map_or(suffix, |prefix| join(suffix, prefix)));
            if let Some(&layer) = layers.get(next + i) {
                prefix = Some(prefix.map_or(layer, |prefix| join(prefix, layer)));
            }
        }
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A thin opaque layer, a faint slope, and a gap, in colours that differ.
    fn transfer() -> TransferFunction {
        let table = (0..512).map(|i| match i {
            100..=103 => [1.0, 0.2, 0.0, 0.95],
            200..=400 => [0.1, 0.3 + i as f32 / 1000.0, 0.9, (i - 200) as f32 / 300.0],
            _ => [0.0; 4],
        });
        TransferFunction::new([0.0, 511.0], 512, 2.0, vec![0], table.collect(), vec![]).unwrap()
    }

    fn table(transfer: &TransferFunction, step: f64) -> Preintegrated {
        Preintegrated::new(transfer, [0.0, 511.0], |v| v, step, &Exec::default()).unwrap()
    }

    /// A step between two values in so many parts, each of the value at its middle.
    fn by_parts(transfer: &TransferFunction, [front, back]: [f64; 2], step: f64) -> [f32; 4] {
        let parts = 40_000;
        let mut seen = [0.0; 4];
        for i in 0..parts {
            let value = front + (back - front) * (f64::from(i) + 0.5) / f64::from(parts);
            let [r, g, b, opacity] = transfer.sample(0, value).map(f64::from);
            let alpha = 1.0 - (1.0 - opacity).powf(step / f64::from(parts));
            seen = over(seen, [r * alpha, g * alpha, b * alpha, alpha]);
        }
        seen.map(|c| c as f32)
    }

    #[test]
    fn an_entry_is_the_integral_over_the_values_between_its_ends() {
        let transfer = transfer();
        for step in [0.1, 0.5, 4.0] {
            let table = table(&transfer, step);
            for [front, back] in [
                [0_u32, 1023],
                [1023, 0],
                [180, 230],
                [230, 180],
                [203, 203],
                [650, 651],
                [390, 810],
                [0, 90],
            ] {
                let value = |place: u32| f64::from(place) * 511.0 / 1023.0;
                let wanted = by_parts(&transfer, [value(front), value(back)], step);
                let found = table.between(front, back);
                let off = (0..4).map(|c| (found[c] - wanted[c]).abs()).fold(0.0, f32::max);
                assert!(off < 3e-3, "{front} to {back} at {step}: {found:?} for {wanted:?}");
            }
        }
    }

    #[test]
    fn what_is_in_front_hides_what_lies_behind_within_a_step() {
        let transfer = transfer();
        let table = table(&transfer, 40.0);
        let (red_first, blue_first) = (table.between(190, 800), table.between(800, 190));
        assert!((red_first[3] - blue_first[3]).abs() < 1e-6, "either way as much is let through");
        assert!(red_first[0] > 2.0 * blue_first[0] && blue_first[2] > red_first[2] + 0.02);
    }

    #[test]
    fn windows_equal_layers_that_are_composed_one_by_one() {
        let layer = |i: usize| {
            let alpha = [0.0, 0.3, 1.0, 0.01, 0.6][i % 5];
            [alpha * (i % 3) as f64 / 2.0, alpha * 0.5, alpha * (i % 7) as f64 / 6.0, alpha]
        };
        let layers: Vec<Layer> = (0..23).map(layer).collect();
        for length in [1, 2, 3, 7, 11, 12, 22, 23] {
            for back in [false, true] {
                let found = windows(&layers, length, back);
                assert_eq!(found.len(), 24 - length);
                for (first, found) in found.iter().enumerate() {
                    let mut chosen = layers[first..first + length].to_vec();
                    if back {
                        chosen.reverse();
                    }
                    let plain = chosen.into_iter().fold([0.0; 4], over);
                    assert!((0..4).all(|c| (found[c] - plain[c]).abs() < 1e-12), "{length} from {first}");
                }
            }
        }
    }

    #[test]
    fn a_range_is_clear_if_every_step_in_it_is() {
        let table = table(&transfer(), 0.5);
        let range = |min, max| BrickRange { min, max, missing: false };
        assert!(table.is_clear(range(0.0, 95.0), 0.0) && table.is_clear(range(110.0, 195.0), 0.0));
        assert!(!table.is_clear(range(0.0, 150.0), 0.0), "a layer between two clear values");
        assert!(table.is_clear(range(f32::INFINITY, f32::NEG_INFINITY), 0.0), "no data");
        assert_eq!(table.between(0, 190), [0.0; 4]);
        assert!(table.between(0, 250)[3] > 0.0);
    }
}
