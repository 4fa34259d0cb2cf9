//! What the greys or colours of a picture stand for.

use ivd_core::{TransferFunction, srgb};

use crate::annotate::Bar;

/// Colours that are kept of a table.
const STOPS: usize = 512;
/// Level of values that show nothing.
const CLEAR: u8 = 40;

/// Colours of values in equal distances, with the first and the last.
pub(crate) struct Legend {
    colours: Vec<[u8; 3]>,
    ends: [f64; 2],
}

impl Legend {
    /// From black to white.
    pub(crate) fn of_greys(ends: [f64; 2]) -> Self {
        Self { colours: (0..=255).map(|level| [level; 3]).collect(), ends }
    }

    /// The colours of a table's first row from the first value that shows something to the last; `None` where gradients tell them too, or nothing shows.
    pub(crate) fn of_table(transfer: &TransferFunction) -> Option<Self> {
        if transfer.gradient().is_some() {
            return None;
        }
        let [low, high] = transfer.range();
        let last = transfer.resolution() - 1;
        let value = |sample: usize| low + (high - low) * sample as f64 / last.max(1) as f64;
        let is_seen = |sample: &usize| transfer.table()[*sample][3] > 0.0;
        let ends = [(0..=last).find(is_seen)?, (0..=last).rev().find(is_seen)?].map(value);
        let colour = |stop: usize| {
            let share = (stop as f64 + 0.5) / STOPS as f64;
            let [red, green, blue, opacity] = transfer.sample(0, ends[0] + share * (ends[1] - ends[0]));
            if opacity > 0.0 { [red, green, blue].map(srgb::byte) } else { [CLEAR; 3] }
        };
        Some(Self { colours: (0..STOPS).map(colour).collect(), ends })
    }

    /// It as it is drawn.
    pub(crate) fn bar(&self) -> Bar<'_> {
        let stops = self.colours.len();
        let colour = move |share: f64| self.colours[((share * stops as f64) as usize).min(stops - 1)];
        Bar { colour: Box::new(colour), ends: self.ends.map(short) }
    }
}

/// A value in few letters: three digits that count, or its whole part.
fn short(value: f64) -> String {
    let size = value.abs();
    if size != 0.0 && !(1e-3..1e6).contains(&size) {
        return format!("{value:.1e}");
    }
    let places =
        if size >= 100.0 || size == 0.0 { 0 } else { (2 - size.log10().floor() as i32).max(0) as usize };
    let text = format!("{value:.places$}");
    let text = if text.contains('.') { text.trim_end_matches('0').trim_end_matches('.') } else { &text };
    if text == "-0" { "0".to_owned() } else { text.to_owned() }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn values_are_told_in_few_letters() {
        for (value, text) in [
            (0.0, "0"),
            (-1024.0, "-1024"),
            (3071.4, "3071"),
            (12.34, "12.3"),
            (1.0, "1"),
            (0.0625, "0.0625"),
            (-0.5, "-0.5"),
            (65535.0, "65535"),
            (2.5e7, "2.5e7"),
            (-1.24e-5, "-1.2e-5"),
        ] {
            assert_eq!(short(value), text);
        }
    }

    #[test]
    fn a_table_is_told_from_its_first_seen_value_to_its_last() {
        let red = |opacity: f32| [1.0, 0.0, 0.0, opacity];
        let table = vec![red(0.0), red(0.5), red(0.0), [0.0, 0.0, 1.0, 0.25], red(0.0)];
        let transfer = TransferFunction::new([0.0, 40.0], 5, 1.0, vec![0], table, Vec::new()).unwrap();
        let legend = Legend::of_table(&transfer).unwrap();
        assert_eq!(legend.ends, [10.0, 30.0]);
        let bar = legend.bar();
        assert_eq!((bar.colour)(0.0)[0], 255);
        assert!((bar.colour)(1.0)[2] > 250);
        assert_eq!(bar.ends, ["10", "30"]);
        let clear =
            TransferFunction::new([0.0, 1.0], 2, 1.0, vec![0], vec![red(0.0); 2], Vec::new()).unwrap();
        assert!(Legend::of_table(&clear).is_none());
    }
}
