use super::Project;

/// The first local maximum at or above a threshold; where there is none, the greatest value (local maximum intensity projection: Sato, Shiraga, Nakajima,
/// Tamura & Kikinis 1998).
///
/// What comes first and reaches the threshold is climbed from there until the next sample is lower, missing, or behind the ray's end. A sample before it doesn't reach
/// the threshold, so that no peak is left out.
pub(crate) struct FirstPeak {
    /// As `sign · value`.
    pub(crate) threshold: f32,
}

/// How far the climb has come.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Climb {
    /// The greatest value so far; on the climb the last one.
    greatest: f32,
    climbing: bool,
    settled: bool,
}

impl Project for FirstPeak {
    type Seen = Climb;

    fn nothing(&self) -> Climb {
        Climb { greatest: f32::NEG_INFINITY, climbing: false, settled: false }
    }

    #[inline(always)]
    fn take(&self, climb: &mut Climb, value: Option<f32>, _: f32) {
        if climb.climbing && value.is_none_or(|value| value < climb.greatest) {
            climb.settled = true;
        } else if let Some(value) = value {
            climb.greatest = climb.greatest.max(value);
            climb.climbing |= value >= self.threshold;
        }
    }

    #[inline(always)]
    fn is_settled(&self, climb: &Climb) -> bool {
        climb.settled
    }

    /// Before the climb the greatest value is below the threshold, and so is what doesn't exceed it.
    #[inline(always)]
    fn passes(&self, climb: &Climb, bound: f32) -> bool {
        !climb.climbing && bound <= climb.greatest
    }

    fn shown(&self, climb: &Climb) -> f32 {
        climb.greatest
    }
}
