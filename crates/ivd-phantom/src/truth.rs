//! What the true classes hold, counted over the generated voxels.

use ivd_core::Class;

use super::bust;
use super::params::Shape;

/// Class names, means of the noise-free head in the order of its labels.
pub(super) const HEAD: [(&str, f64); 6] =
    [("air", 0.02), ("skin/soft", 0.60), ("skull", 0.10), ("csf", 0.25), ("grey", 0.50), ("white", 0.75)];

/// The same of the neck.
pub(super) const NECK: [(&str, f64); 4] = [("air", 0.02), ("soft", 0.45), ("disc", 0.65), ("bone", 0.95)];

/// Count, mean and sum of squared deviations of every class that a phantom may have (Welford 1962).
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Tally([(u64, f64, f64); bust::TISSUES.len()]);

impl Tally {
    pub(super) fn add(&mut self, label: u16, value: f64) {
        let (count, mean, squares) = &mut self.0[label as usize];
        *count += 1;
        let off = value - *mean;
        *mean += off / *count as f64;
        *squares += off * (value - *mean);
    }

    /// Joins two tallies (Chan, Golub & LeVeque 1979).
    fn join(mut self, other: &Self) -> Self {
        for ((n, mean, squares), &(m, other_mean, other_squares)) in self.0.iter_mut().zip(&other.0) {
            if m > 0 {
                let total = (*n + m) as f64;
                let off = other_mean - *mean;
                *squares += other_squares + off * off * (*n as f64) * (m as f64) / total;
                *mean += off * (m as f64) / total;
                *n += m;
            }
        }
        self
    }
}

/// The classes that occur, by label; tallies are joined in the order of the slices.
pub(super) fn classes(shape: Shape, slices: &[Tally]) -> Vec<Class> {
    let total = slices.iter().fold(Tally::default(), Tally::join);
    let name = |label: usize| {
        match shape {
            Shape::Head => HEAD[label].0,
            Shape::Neck => NECK[label].0,
            Shape::Bust => bust::TISSUES[label].0,
            _ => ["outside", "inside"][label],
        }
        .to_owned()
    };
    let occupied = total.0.iter().enumerate().filter(|(_, (count, ..))| *count > 0);
    occupied
        .map(|(label, &(count, mean, squares))| Class {
            id: label as u16,
            name: Some(name(label)),
            mean,
            sd: (squares / count as f64).max(0.0).sqrt(),
            voxels: count,
            lower: None,
            upper: None,
        })
        .collect()
}
