use serde::{Deserialize, Serialize};

use crate::Error;

/// What one class contributes to a transfer function.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct TransferEntry {
    /// Class of the label volume; 0 for an entry that holds for every voxel.
    pub class: u16,
    /// Colour, linear RGB in 0…1.
    pub rgb: [f32; 3],
    /// Peak opacity over [`TransferFunction::reference_mm`], 0…1.
    pub opacity: f32,
    /// Where the entry begins in real values (posterior crossing with the class below).
    pub lower: f64,
    /// Where the entry ends in real values (posterior crossing with the class above).
    pub upper: f64,
    /// Softness of its edges in real values, ≥ 0.
    pub softness: f64,
}

/// A transfer function over real values with the class label as second axis.
///
/// `table` has one row for each of `classes`, each of `resolution` samples over `range`, straight (not
/// premultiplied) linear RGB and the opacity gathered over `reference_mm` of homogeneous material. A renderer with
/// step `d` uses `1 - (1 - opacity)^(d / reference_mm)`.
#[derive(Debug, Clone, PartialEq)]
pub struct TransferFunction {
    range: [f64; 2],
    resolution: usize,
    reference_mm: f64,
    classes: Vec<u16>,
    table: Vec<[f32; 4]>,
    entries: Vec<TransferEntry>,
}

impl TransferFunction {
    /// A transfer function from its parts; `table` has shape `[classes.len(), resolution]`, row-major, RGBA in 0…1.
    /// Row 0 must be class 0, which holds for voxels whose label has no row of its own.
    ///
    /// # Errors
    /// [`Error::Inconsistent`] names the part that doesn't fit.
    pub fn new(
        range: [f64; 2],
        resolution: usize,
        reference_mm: f64,
        classes: Vec<u16>,
        table: Vec<[f32; 4]>,
        entries: Vec<TransferEntry>,
    ) -> Result<Self, Error> {
        let bad = |problem: String| Error::Inconsistent { what: "transfer function", problem };
        if !(range[0].is_finite() && range[1].is_finite() && range[0] <= range[1]) {
            return Err(bad(format!("range {range:?} is not finite and ordered")));
        }
        if resolution < 2 || classes.first() != Some(&0) {
            return Err(bad("needs at least 2 samples a row and class 0 as its first row".into()));
        }
        if table.len() != resolution * classes.len() {
            return Err(bad(format!("{} samples for {} rows of {resolution}", table.len(), classes.len())));
        }
        if !(reference_mm.is_finite() && reference_mm > 0.0) {
            return Err(bad(format!("reference length {reference_mm} mm is not positive")));
        }
        if let Some(bad_at) = table.iter().position(|c| !c.iter().all(|v| (0.0..=1.0).contains(v))) {
            return Err(bad(format!("sample {bad_at} leaves 0…1")));
        }
        Ok(Self { range, resolution, reference_mm, classes, table, entries })
    }

    /// Real values of the first and last sample.
    pub fn range(&self) -> [f64; 2] {
        self.range
    }

    /// Samples a row.
    pub fn resolution(&self) -> usize {
        self.resolution
    }

    /// Length over which the opacities hold (mm).
    pub fn reference_mm(&self) -> f64 {
        self.reference_mm
    }

    /// Label of each row; the first is 0.
    pub fn classes(&self) -> &[u16] {
        &self.classes
    }

    /// All samples, shape `[classes, resolution]`.
    pub fn table(&self) -> &[[f32; 4]] {
        &self.table
    }

    /// What each class contributes.
    pub fn entries(&self) -> &[TransferEntry] {
        &self.entries
    }

    /// Row for a label: its own, else row 0.
    pub fn row(&self, label: u16) -> usize {
        self.classes.iter().position(|&c| c == label).unwrap_or(0)
    }

    /// Whether a label changes anything: false where all rows are the same.
    pub fn depends_on_label(&self) -> bool {
        let (first, others) = self.table.split_at(self.resolution);
        others.chunks_exact(self.resolution).any(|row| row != first)
    }

    /// Straight RGBA at a real value, linear between samples, clamped at the ends. A value that is no data is clear.
    #[inline]
    pub fn sample(&self, row: usize, value: f64) -> [f32; 4] {
        if !value.is_finite() {
            return [0.0; 4];
        }
        let width = self.range[1] - self.range[0];
        let at = if width > 0.0 {
            ((value - self.range[0]) / width * (self.resolution - 1) as f64)
                .clamp(0.0, (self.resolution - 1) as f64)
        } else {
            0.0
        };
        let i = (at as usize).min(self.resolution - 2);
        let f = (at - i as f64) as f32;
        let (a, b) = (self.table[row * self.resolution + i], self.table[row * self.resolution + i + 1]);
        std::array::from_fn(|c| a[c] + (b[c] - a[c]) * f)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_label_matters_where_its_row_differs() {
        let of = |table: Vec<[f32; 4]>| {
            TransferFunction::new([0.0, 1.0], 2, 1.0, vec![0, 5], table, vec![]).unwrap()
        };
        let (clear, seen) = ([0.0; 4], [1.0; 4]);
        assert!(!of(vec![clear, seen, clear, seen]).depends_on_label());
        assert!(of(vec![clear, seen, clear, clear]).depends_on_label());
    }
}
