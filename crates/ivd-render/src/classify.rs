use ivd_core::{BrickRange, GradientTable, NO_DATA, TransferFunction};

use crate::axis::ValueAxis;
use crate::samples::Top;

/// Least samples of a row. The value axis is finer than the transfer function's own, so that the nearest entry serves.
const LEAST_SAMPLES: usize = 4096;
/// Rows that get a bit of their own in a set of rows; the rest share the last bit.
const OWN_BITS: usize = 63;

/// A table by value and gradient.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PlanSteep<'a> {
    /// Premultiplied entries, values fastest.
    pub table: &'a [[f32; 4]],
    /// As that of the values alone.
    pub axis: [f32; 3],
    /// Values of a row.
    pub values: usize,
    /// What turns a gradient (real units / mm) into a row: factor, last row.
    pub gradient: [f32; 2],
}

/// What chooses the rows of a transfer function.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Rows {
    /// Nothing does: row 0, the union of all classes, holds everywhere.
    Union,
    /// Labels do, and what has none is clear.
    Labelled,
    /// Labels do, and the union holds where there is none.
    LabelledOrUnion,
}

/// A transfer function made ready for one step length: premultiplied RGB and the opacity of one step, by fast value and row.
pub(crate) struct Classifier {
    table: Vec<[f32; 4]>,
    /// Of a row.
    axis: ValueAxis,
    samples: usize,
    /// First entry of each label's row; empty where there are no labels.
    row_start: Vec<u32>,
    /// For each row, how many entries before each index aren't clear.
    occupied: Vec<u32>,
    /// What samples look like by gradient too; the table then only tells which values are clear at every gradient.
    steep: Option<Steep>,
}

impl Classifier {
    /// - `range`: fast values to cover; `real` turns them into real ones.
    /// - `rows`: what chooses them.
    /// - `step`: step length in reference lengths: the opacity of a step is `1 - (1 - opacity)^step`.
    pub(crate) fn new(
        transfer: &TransferFunction,
        range: [f32; 2],
        real: impl Fn(f64) -> f64,
        step: f64,
        rows: Rows,
    ) -> Self {
        let samples = (4 * transfer.resolution()).clamp(LEAST_SAMPLES, 1 << 16);
        let width = f64::from(range[1]) - f64::from(range[0]);
        let labelled = rows != Rows::Union;
        let count = if labelled { transfer.classes().len() } else { 1 };
        let steep = transfer.gradient().map(|by| Steep::new(transfer, by, range, &real, step));
        let mut table = Vec::with_capacity(count * samples);
        let mut occupied = Vec::with_capacity(count * (samples + 1));
        for row in 0..count {
            let mut seen = 0;
            occupied.push(0);
            for i in 0..samples {
                let value = f64::from(range[0]) + width * (i as f64 / (samples - 1) as f64);
                let entry = match &steep {
                    Some(steep) => steep.greatest(value),
                    None => of_step(transfer.sample(row, real(value)), step),
                };
                seen += u32::from(entry[3] > 0.0);
                occupied.push(seen);
                table.push(entry);
            }
        }
        let row_start = if labelled {
            let mut starts = vec![0_u32; 1 << 16];
            for (row, &class) in transfer.classes().iter().enumerate() {
                starts[usize::from(class)] = (row * samples) as u32;
            }
            if rows == Rows::Labelled {
                starts[usize::from(NO_DATA)] = (count * samples) as u32;
                table.resize((count + 1) * samples, [0.0; 4]);
                occupied.resize((count + 1) * (samples + 1), 0);
            }
            starts
        } else {
            Vec::new()
        };
        let axis = ValueAxis::new(range, samples).with_clear(&occupied[..=samples]);
        Self { table, axis, samples, row_start, occupied, steep }
    }

    /// What samples look like by value and gradient, where the transfer function says so.
    #[inline(always)]
    pub(crate) fn steep(&self) -> Option<&Steep> {
        self.steep.as_ref()
    }

    /// First entry of each label's row; empty where there are no labels.
    pub(crate) fn row_starts(&self) -> &[u32] {
        &self.row_start
    }

    /// The table: premultiplied entries, row after row.
    pub(crate) fn table(&self) -> &[[f32; 4]] {
        &self.table
    }

    /// Where values lie in a row; what is clear is told of row 0.
    #[inline(always)]
    pub(crate) fn axis(&self) -> &ValueAxis {
        &self.axis
    }

    /// First entry of a label's row.
    pub(crate) fn row_start(&self, label: u16) -> u32 {
        self.row_start[usize::from(label)]
    }

    /// Entry of row 0 for a finite fast value.
    #[inline(always)]
    pub(crate) fn of(&self, value: f32) -> [f32; 4] {
        self.table[self.axis.index(value)]
    }

    /// Entry of a label's row for a finite fast value.
    #[inline(always)]
    pub(crate) fn of_labelled(&self, value: f32, label: u16) -> [f32; 4] {
        self.table[self.row_start(label) as usize + self.axis.index(value)]
    }

    /// The bit of a label's row in a set of rows.
    pub(crate) fn row_bit(&self, label: u16) -> u64 {
        1 << (self.row_start[usize::from(label)] as usize / self.samples).min(OWN_BITS)
    }

    /// Whether every value of a brick is clear in every row of a set.
    pub(crate) fn is_clear(&self, range: BrickRange, shift: f64, rows: u64) -> bool {
        let Some([from, to]) = self.axis.places(range, shift) else { return true };
        let all_rows = self.table.len() / self.samples;
        (0..all_rows).filter(|&row| rows >> row.min(OWN_BITS) & 1 == 1).all(|row| {
            let counts = &self.occupied[row * (self.samples + 1)..][..=self.samples];
            counts[to] == counts[from]
        })
    }
}

/// Values that a table by value and gradient is spread over, and gradients.
const STEEP: [usize; 2] = [1024, 256];

/// A table by value and gradient made ready for one step length.
pub(crate) struct Steep {
    /// Premultiplied, shape `[STEEP[1], STEEP[0]]`, values fastest.
    table: Vec<[f32; 4]>,
    axis: ValueAxis,
    /// What turns a gradient [real units / mm] into an index, and the last one.
    per_gradient: f32,
    top: Top,
}

impl Steep {
    fn new(
        transfer: &TransferFunction,
        by: &GradientTable,
        range: [f32; 2],
        real: &impl Fn(f64) -> f64,
        step: f64,
    ) -> Self {
        let [values, gradients] = STEEP;
        let width = f64::from(range[1]) - f64::from(range[0]);
        let entry = |i: usize| {
            let value = f64::from(range[0]) + width * ((i % values) as f64 / (values - 1) as f64);
            let gradient = by.top() * ((i / values) as f64 / (gradients - 1) as f64);
            of_step(transfer.sample_steep(real(value), gradient), step)
        };
        Self {
            table: (0..values * gradients).map(entry).collect(),
            axis: ValueAxis::new(range, values),
            per_gradient: ((gradients - 1) as f64 / by.top()) as f32,
            top: Top::new((gradients - 1) as f32),
        }
    }

    /// The same as plain data.
    pub(crate) fn numbers(&self) -> PlanSteep<'_> {
        let gradient = [self.per_gradient, self.top.number()];
        PlanSteep { table: &self.table, axis: self.axis.numbers(), values: STEEP[0], gradient }
    }

    /// Entry for a finite fast value and a gradient [real units / mm]; beside missing data, where there is no gradient, that of a flat place.
    #[inline(always)]
    pub(crate) fn of(&self, value: f32, gradient: f32) -> [f32; 4] {
        let j = self.top.whole(gradient * self.per_gradient + 0.5);
        self.table[j * STEEP[0] + self.axis.index(value)]
    }

    /// The greatest opacity that a fast value has at any gradient, looked up among the nearest values; without colour.
    fn greatest(&self, value: f64) -> [f32; 4] {
        let i = self.axis.index(value as f32);
        let near = i.saturating_sub(1)..(i + 2).min(STEEP[0]);
        let opacities = near.flat_map(|i| (0..STEEP[1]).map(move |j| self.table[j * STEEP[0] + i][3]));
        [0.0, 0.0, 0.0, opacities.fold(0.0, f32::max)]
    }
}

/// Premultiplied RGB and opacity of a step from a straight sample over the reference length.
fn of_step([r, g, b, opacity]: [f32; 4], step: f64) -> [f32; 4] {
    let alpha = (1.0 - (1.0 - f64::from(opacity)).powf(step)) as f32;
    [r * alpha, g * alpha, b * alpha, alpha]
}

/// The same entry for a part of a step.
pub(crate) fn of_part([r, g, b, alpha]: [f32; 4], part: f32) -> [f32; 4] {
    if alpha <= 0.0 {
        return [0.0; 4];
    }
    let partial = (1.0 - (1.0 - f64::from(alpha)).powf(f64::from(part))) as f32;
    let ratio = partial / alpha;
    [r * ratio, g * ratio, b * ratio, partial]
}

#[cfg(test)]
mod tests {
    use super::*;

    fn window() -> TransferFunction {
        // Opaque above 60 of 0…100 in row 0, above 80 in the row of class 5.
        let row = |from: usize| (0..101).map(move |i| [1.0, 0.5, 0.0, if i > from { 0.75 } else { 0.0 }]);
        let table = row(60).chain(row(80)).collect();
        TransferFunction::new([0.0, 100.0], 101, 2.0, vec![0, 5], table, vec![]).unwrap()
    }

    #[test]
    fn a_step_of_half_the_reference_gets_the_root_of_the_transparency() {
        let c = Classifier::new(&window(), [0.0, 100.0], |v| v, 0.5, Rows::Labelled);
        let entry = c.of(90.0);
        assert!((entry[3] - 0.5).abs() < 1e-6, "1 - sqrt(1 - 0.75)");
        assert!((entry[1] - 0.25).abs() < 1e-6, "premultiplied");
        assert_eq!(c.of_labelled(70.0, 5)[3], 0.0);
        assert_eq!(c.of_labelled(70.0, 4), c.of(70.0), "a label without row");
        assert_eq!(c.of_labelled(90.0, 0), [0.0; 4], "no label");
        let c = Classifier::new(&window(), [0.0, 100.0], |v| v, 0.5, Rows::LabelledOrUnion);
        assert_eq!(c.of_labelled(70.0, 0), c.of(70.0), "what has no label, where that is seen");
        assert_eq!(
            (c.of(70.0)[3] > 0.0, c.of_labelled(70.0, 5)[3]),
            (true, 0.0),
            "a label has its own row all the same"
        );
        let whole = of_part(entry, 2.0);
        assert!((whole[3] - 0.75).abs() < 1e-6);
    }

    #[test]
    fn clear_ranges_depend_on_the_rows_in_use() {
        let c = Classifier::new(&window(), [0.0, 100.0], |v| v, 1.0, Rows::Labelled);
        let range = |min, max| BrickRange { min, max, missing: false };
        let (row0, row5) = (c.row_bit(4), c.row_bit(5));
        assert!(c.is_clear(range(0.0, 59.0), 0.0, row0 | row5));
        assert!(!c.is_clear(range(0.0, 70.0), 0.0, row0 | row5));
        assert!(c.is_clear(range(0.0, 70.0), 0.0, row5));
        assert!(!c.is_clear(range(81.0, 81.0), 0.0, row5));
        assert!(c.is_clear(range(0.0, 100.0), 0.0, c.row_bit(0)), "label 0");
        assert!(c.is_clear(range(f32::INFINITY, f32::NEG_INFINITY), 0.0, row0), "no data");
    }
}
