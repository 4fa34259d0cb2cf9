use super::Project;

/// The mean of the values, the last, shorter step by its length.
pub(crate) struct Mean;

/// A sum of values, and the steps that they stand for.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Sum {
    values: f32,
    steps: f32,
}

impl Project for Mean {
    type Seen = Sum;

    fn nothing(&self) -> Sum {
        Sum { values: 0.0, steps: 0.0 }
    }

    #[inline(always)]
    fn take(&self, sum: &mut Sum, value: Option<f32>, steps: f32) {
        if let Some(value) = value {
            sum.values += value * steps;
            sum.steps += steps;
        }
    }

    #[inline(always)]
    fn is_settled(&self, _: &Sum) -> bool {
        false
    }

    /// Only where there is no data.
    #[inline(always)]
    fn passes(&self, _: &Sum, bound: f32) -> bool {
        bound == f32::NEG_INFINITY
    }

    fn shown(&self, sum: &Sum) -> f32 {
        if sum.steps > 0.0 { sum.values / sum.steps } else { f32::NEG_INFINITY }
    }
}
