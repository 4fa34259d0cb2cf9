use serde::{Deserialize, Serialize};

use crate::Error;

/// What a class is to a picture.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum ClassRole {
    /// Round the matter, or gas in it: clear.
    Background,
    /// Matter: visible.
    #[default]
    Material,
    /// Voxels that lie partly in one material and partly in another: no matter of their own, drawn as a mix of the two.
    Transition,
}

impl ClassRole {
    /// Whether it is a material, which nobody need say.
    pub fn is_material(&self) -> bool {
        *self == Self::Material
    }
}

/// What one class contributes to a transfer function.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct TransferEntry {
    /// Class of the label volume; 0 for an entry that holds for every voxel.
    pub class: u16,
    /// What it is to a picture. Files of before there were roles say that all are materials.
    #[serde(default, skip_serializing_if = "ClassRole::is_material")]
    pub role: ClassRole,
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

/// Colour and opacity by value and magnitude of the gradient (Kindlmann & Durkin 1998; Kniss, Kindlmann & Hansen 2002): values that two
/// materials share with the boundary of others are told apart by how steep they are.
///
/// Values are spread over the range of the transfer function that holds it; gradients from 0 to `top` [real units / mm], central differences over two
/// voxels of the undeformed volume. Steeper ones look like those of `top`. Samples are as those of the transfer function's own table.
#[derive(Debug, Clone, PartialEq)]
pub struct GradientTable {
    top: f64,
    dims: [usize; 2],
    table: Vec<[f32; 4]>,
}

impl GradientTable {
    /// - `dims`: samples along the values, and along the gradients; at least two each.
    /// - `table`: shape `[dims[1], dims[0]]`, values fastest, RGBA in 0…1.
    ///
    /// # Errors
    /// [`Error::Inconsistent`] names the part that doesn't fit.
    pub fn new(top: f64, dims: [usize; 2], table: Vec<[f32; 4]>) -> Result<Self, Error> {
        let bad = |problem: String| Error::Inconsistent { what: "table by value and gradient", problem };
        if !(top.is_finite() && top > 0.0) {
            return Err(bad(format!("its greatest gradient {top} is not positive")));
        }
        if dims[0] < 2 || dims[1] < 2 || dims[0].checked_mul(dims[1]) != Some(table.len()) {
            let [values, gradients] = dims;
            return Err(bad(format!(
                "{} samples for {values} values and {gradients} gradients",
                table.len()
            )));
        }
        require_in_0_to_1(&table).map_err(bad)?;
        Ok(Self { top, dims, table })
    }

    /// Gradient of the last samples [real units / mm].
    pub fn top(&self) -> f64 {
        self.top
    }

    /// Samples along the values, and along the gradients.
    pub fn dims(&self) -> [usize; 2] {
        self.dims
    }

    /// All samples, shape `[dims[1], dims[0]]`.
    pub fn table(&self) -> &[[f32; 4]] {
        &self.table
    }

    /// Straight RGBA at shares of the range of values and of that of gradients, linear between samples.
    fn sample(&self, shares: [f64; 2]) -> [f32; 4] {
        let place = |a: usize| {
            let at = shares[a].clamp(0.0, 1.0) * (self.dims[a] - 1) as f64;
            let i = (at as usize).min(self.dims[a] - 2);
            (i, (at - i as f64) as f32)
        };
        let ((i, f), (j, g)) = (place(0), place(1));
        let mix = |a: [f32; 4], b: [f32; 4], t: f32| -> [f32; 4] {
            std::array::from_fn(|c| a[c] + (b[c] - a[c]) * t)
        };
        let row = |j: usize| {
            let at = j * self.dims[0] + i;
            mix(self.table[at], self.table[at + 1], f)
        };
        mix(row(j), row(j + 1), g)
    }
}

/// Says which sample of a table isn't RGBA in 0…1.
fn require_in_0_to_1(table: &[[f32; 4]]) -> Result<(), String> {
    match table.iter().position(|c| !c.iter().all(|v| (0.0..=1.0).contains(v))) {
        Some(at) => Err(format!("sample {at} leaves 0…1")),
        None => Ok(()),
    }
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
    gradient: Option<GradientTable>,
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
        require_in_0_to_1(&table).map_err(bad)?;
        Ok(Self { range, resolution, reference_mm, classes, table, entries, gradient: None })
    }

    /// The same with a table by value and gradient, which pictures go by.
    #[must_use]
    pub fn with_gradient(self, gradient: GradientTable) -> Self {
        Self { gradient: Some(gradient), ..self }
    }

    /// The table by value and gradient, where there is one. What knows nothing of gradients goes by the value alone.
    pub fn gradient(&self) -> Option<&GradientTable> {
        self.gradient.as_ref()
    }

    /// Straight RGBA at a real value and a gradient [real units / mm] by the table of both; without one that of row 0 at the value.
    pub fn sample_steep(&self, value: f64, gradient: f64) -> [f32; 4] {
        let Some(table) = &self.gradient else { return self.sample(0, value) };
        if !value.is_finite() {
            return [0.0; 4];
        }
        let width = self.range[1] - self.range[0];
        let share = if width > 0.0 { (value - self.range[0]) / width } else { 0.0 };
        table.sample([share, if gradient.is_nan() { 0.0 } else { gradient / table.top }])
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

    /// The same with another table, of the same shape, and other entries.
    ///
    /// # Errors
    /// As [`TransferFunction::new`].
    pub fn with_looks(self, table: Vec<[f32; 4]>, entries: Vec<TransferEntry>) -> Result<Self, Error> {
        let gradient = self.gradient;
        let new = Self::new(self.range, self.resolution, self.reference_mm, self.classes, table, entries)?;
        Ok(Self { gradient, ..new })
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

    #[test]
    fn a_table_of_gradients_is_linear_between_samples_and_held_at_its_ends() {
        let transfer =
            TransferFunction::new([0.0, 10.0], 2, 1.0, vec![0], vec![[0.5; 4], [0.25; 4]], vec![]).unwrap();
        assert_eq!(transfer.sample_steep(5.0, 9.0), transfer.sample(0, 5.0), "by the value alone");
        let at = |a: f32| [a, 0.0, 0.0, 1.0];
        let table = GradientTable::new(4.0, [2, 2], vec![at(0.0), at(0.2), at(0.4), at(1.0)]).unwrap();
        let transfer = transfer.with_gradient(table);
        for (value, gradient, wanted) in
            [(0.0, 0.0, 0.0), (10.0, 0.0, 0.2), (5.0, 2.0, 0.4), (-3.0, 99.0, 0.4), (99.0, 4.0, 1.0)]
        {
            let found = transfer.sample_steep(value, gradient)[0];
            assert!((found - wanted).abs() < 1e-6, "{found} at {value}, {gradient}");
        }
        assert_eq!(transfer.sample_steep(f64::NAN, 0.0), [0.0; 4]);
        assert!(GradientTable::new(0.0, [2, 2], vec![[0.0; 4]; 4]).is_err());
        assert!(GradientTable::new(1.0, [2, 3], vec![[0.0; 4]; 4]).is_err());
        assert!(GradientTable::new(1.0, [2, 2], vec![[2.0; 4]; 4]).is_err());
    }
}
