//! Brightness, contrast and colours, as they are turned by hand.

use ivd_atf::soft_tissue_window;
use ivd_core::{TransferFunction, Volume};
use ivd_pipeline::scene::WindowSection;

/// Share of the voxels looked at that may be darker than black, or lighter than white.
const CLIPPED: f64 = 0.005;
/// Voxels looked at, about.
const LOOKED_AT: usize = 1 << 17;

/// The values that are black and white.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Window {
    pub(crate) low: f64,
    pub(crate) high: f64,
}

impl Window {
    /// What a scene says that windows show, or this one.
    pub(crate) fn or_said(self, said: &WindowSection) -> Self {
        said.values.map_or(self, |[low, high]| Self { low, high })
    }

    /// What soft tissue is told apart in, of computed tomography that shows some; else what most values of a volume lie in.
    pub(crate) fn of(volume: &Volume) -> Self {
        if let Some([low, high]) = soft_tissue_window(volume) {
            return Self { low, high };
        }
        let mut values: Vec<f64> = volume.sampled(LOOKED_AT).collect();
        values.sort_unstable_by(f64::total_cmp);
        let at = |share: f64| {
            let last = values.len().saturating_sub(1) as f64;
            values.get((share * last).round() as usize).copied().unwrap_or(0.0)
        };
        let (low, high) = (at(CLIPPED), at(1.0 - CLIPPED));
        if high > low {
            return Self { low, high };
        }
        let [low, high] = volume.range().unwrap_or([0.0, 1.0]);
        Self { low, high: if high > low { high } else { low + 1.0 } }
    }

    /// Wider by a drag to the right, darker by one down; `least`: how narrow it may get.
    pub(crate) fn dragged(self, [right, down]: [f64; 2], least: f64) -> Self {
        let (width, middle) = (self.high - self.low, f64::midpoint(self.low, self.high));
        let middle = middle + down.clamp(-10.0, 10.0) * width;
        let width = (width * (2.0 * right).clamp(-10.0, 10.0).exp()).clamp(least, 1e12 * least);
        let middle = middle.clamp(-1e12 * least, 1e12 * least);
        Self { low: middle - 0.5 * width, high: middle + 0.5 * width }
    }

    /// The grey of a value.
    pub(crate) fn grey(self, value: f64) -> u8 {
        // The cast makes 0 of NaN.
        ((value - self.low) / (self.high - self.low) * 255.0).round().clamp(0.0, 255.0) as u8
    }
}

/// How far the range of a transfer function is shifted and widened.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Turned {
    /// In widths of the range.
    shift: f64,
    /// To the power of e.
    widen: f64,
}

impl Turned {
    /// As it came.
    pub(crate) const NONE: Self = Self { shift: 0.0, widen: 0.0 };

    /// As a scene says that windows show it.
    pub(crate) fn of_section(said: &WindowSection) -> Self {
        said.colours.map_or(Self::NONE, |[shift, widen]| Self { shift, widen })
    }

    /// The same as a scene says it.
    pub(crate) fn said(self) -> Option<[f64; 2]> {
        (self != Self::NONE).then_some([self.shift, self.widen])
    }

    pub(crate) fn dragged(self, [right, down]: [f64; 2]) -> Self {
        Self { shift: (self.shift + right).clamp(-2.0, 2.0), widen: (self.widen - down).clamp(-3.0, 3.0) }
    }

    /// The transfer function over the turned range: the same values of its table, met at other ones.
    pub(crate) fn of(self, transfer: &TransferFunction) -> TransferFunction {
        if self == Self::NONE {
            return transfer.clone();
        }
        let [low, high] = transfer.range();
        let (width, count) = (high - low, transfer.resolution());
        let middle = f64::midpoint(low, high) + self.shift * width;
        // A sample at `value` shows what was at the place that is turned to it.
        let from = |value: f64| (value - middle) / self.widen.exp() + f64::midpoint(low, high);
        let value = |i: usize| low + width * i as f64 / (count - 1) as f64;
        let rows = 0..transfer.classes().len();
        let table: Vec<[f32; 4]> =
            rows.flat_map(|row| (0..count).map(move |i| transfer.sample(row, from(value(i))))).collect();
        transfer.clone().with_looks(table, transfer.entries().to_vec()).unwrap_or_else(|_| transfer.clone())
    }
}

#[cfg(test)]
mod tests {
    use ivd_core::{Grid, Modality, Voxels};

    use super::*;

    #[test]
    fn a_table_that_is_turned_shows_its_colours_at_other_values() {
        let table: Vec<[f32; 4]> = (0..101).map(|i| [i as f32 / 100.0, 0.0, 0.0, i as f32 / 100.0]).collect();
        let transfer = TransferFunction::new([0.0, 100.0], 101, 1.0, vec![0], table, vec![]).unwrap();
        assert_eq!(Turned::NONE.of(&transfer), transfer);
        let shifted = Turned::NONE.dragged([0.1, 0.0]).of(&transfer);
        assert!((shifted.sample(0, 60.0)[3] - 0.5).abs() < 1e-6);
        let narrow = Turned::NONE.dragged([0.0, 2.0_f64.ln()]).of(&transfer);
        assert!(
            (narrow.sample(0, 60.0)[3] - 0.7).abs() < 1e-6 && (narrow.sample(0, 50.0)[3] - 0.5).abs() < 1e-6
        );
    }

    #[test]
    fn soft_tissue_is_told_apart_where_values_are_hounsfields() {
        let grid = Grid::with_spacing([10; 3], [1.0; 3]).unwrap();
        let values = |low: f32, high: f32| -> Vec<f32> {
            (0..1000).map(|i| low + (high - low) * i as f32 / 999.0).collect()
        };
        let of = |low, high| Volume::new(grid.clone(), Voxels::from(values(low, high))).unwrap();
        let scan = of(-1000.0, 1200.0);
        assert_eq!(Window::of(&scan), Window { low: -160.0, high: 240.0 });
        // A map of phases reaches as far, and shows none.
        assert!(Window::of(&of(-4096.0, 4095.0)).high > 3000.0);
        let resonance = scan.with_modality(Some(Modality::MagneticResonance));
        assert!((Window::of(&resonance).low + 989.0).abs() < 3.0);
        let plain = Window::of(&of(0.0, 200.0));
        assert!((plain.low - 1.0).abs() < 0.3 && (plain.high - 199.0).abs() < 0.3, "{plain:?}");
    }

    #[test]
    fn a_window_is_dragged_wider_and_darker() {
        let window = Window { low: 0.0, high: 100.0 };
        let wide = window.dragged([0.5 * 2.0_f64.ln(), 0.0], 1.0);
        assert!((wide.low + 50.0).abs() < 1e-9 && (wide.high - 150.0).abs() < 1e-9);
        let dark = window.dragged([0.0, 0.25], 1.0);
        assert_eq!((dark.low, dark.high), (25.0, 125.0));
        assert_eq!((dark.grey(0.0), dark.grey(75.0), dark.grey(f64::NAN)), (0, 128, 0));
        assert!(window.dragged([-1e9, 0.0], 2.0).high - window.dragged([-1e9, 0.0], 2.0).low >= 2.0);
    }
}
