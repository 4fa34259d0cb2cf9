//! The chooser: how far each knob goes from the requested one so that a time is kept.

/// A value of a knob, or of knobs that go together.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct KnobValue {
    /// The value, for the caller.
    pub(crate) value: f64,
    /// A second value of the same stage, where it has two knobs.
    pub(crate) other: f64,
    /// Its error, in the front's unit; only ratios are looked at.
    pub(crate) error: f64,
}

/// The settings of a stage from the requested one to the coarsest.
#[derive(Debug, Clone, PartialEq, Default)]
pub(crate) struct KnobValues(pub(crate) Vec<KnobValue>);

/// What was chosen.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Fit {
    /// The place in every list of settings.
    pub(crate) at: Vec<usize>,
    /// Predicted time (s).
    pub(crate) seconds: f64,
    /// Whether that is what there is.
    pub(crate) fits: bool,
}

/// An error that is 0 has no ratio; it counts as this part of the next.
const LEAST: f64 = 1e-3;

/// A step that saves a smaller part of the time and isn't enough isn't worth any error: the record's noise is as large.
const WORTH: f64 = 0.02;

/// A step to coarser settings of one knob.
struct Step {
    at: Vec<usize>,
    /// Predicted time then (s).
    seconds: f64,
    loss: f64,
}

/// Takes coarser settings until the predicted time is within `available` (s). Where one step is enough, it is the one that
/// costs the least accuracy; else the one that saves the most time for the logarithm of the error that it adds, so that
/// nothing is given away that saves little.
pub(crate) fn fit(settings: &[KnobValues], seconds: impl Fn(&[usize]) -> f64, available: f64) -> Fit {
    let mut at = vec![0; settings.len()];
    let mut now = seconds(&at);
    while now > available {
        let steps = steps(settings, &at, &seconds);
        let enough = steps.iter().filter(|s| s.seconds <= available);
        let worth = |s: &&Step| now - s.seconds > WORTH * now;
        let rate = |s: &Step| (now - s.seconds) / s.loss;
        let best = enough
            .min_by(|a, b| a.loss.total_cmp(&b.loss))
            .or_else(|| steps.iter().filter(worth).max_by(|a, b| rate(a).total_cmp(&rate(b))));
        let Some(best) = best else { return Fit { at, seconds: now, fits: false } };
        (at, now) = (best.at.clone(), best.seconds);
    }
    Fit { at, seconds: now, fits: true }
}

/// Every step to coarser settings of one knob.
fn steps(settings: &[KnobValues], at: &[usize], seconds: impl Fn(&[usize]) -> f64) -> Vec<Step> {
    let places = settings.iter().enumerate().flat_map(|(i, l)| (at[i] + 1..l.0.len()).map(move |to| (i, to)));
    let step = |(i, to): (usize, usize)| {
        let mut there = at.to_vec();
        there[i] = to;
        let loss = loss(&settings[i].0[at[i]], &settings[i].0[to]);
        Step { seconds: seconds(&there), at: there, loss }
    };
    places.map(step).collect()
}

/// What a step costs in accuracy: the logarithm of the ratio of errors.
fn loss(from: &KnobValue, to: &KnobValue) -> f64 {
    let before = from.error.max(LEAST * to.error);
    (to.error / before).ln().max(LEAST)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn settings(errors: &[f64]) -> KnobValues {
        let place = |(i, &error): (usize, &f64)| KnobValue { value: i as f64, other: 0.0, error };
        KnobValues(errors.iter().enumerate().map(place).collect())
    }

    #[test]
    fn what_fits_stays_as_it_was_requested() {
        let found = fit(&[settings(&[1.0, 2.0])], |_| 3.0, 3.0);
        assert_eq!(found, Fit { at: vec![0], seconds: 3.0, fits: true });
        assert!(fit(&[], |_| 3.0, 3.0).fits);
    }

    #[test]
    fn the_step_that_saves_most_for_its_error_goes_first() {
        // The first knob saves 1 s for twice the error, the second 4 s for twice the error.
        let settings = [settings(&[1.0, 2.0]), settings(&[1.0, 2.0, 4.0])];
        let seconds = |at: &[usize]| 10.0 - at[0] as f64 - [0.0, 4.0, 4.5][at[1]];
        assert_eq!(fit(&settings, seconds, 7.0).at, [0, 1]);
        assert_eq!(fit(&settings, seconds, 5.2).at, [1, 1]);
        assert_eq!(fit(&settings, seconds, 4.5), Fit { at: vec![1, 2], seconds: 4.5, fits: true });
    }

    #[test]
    fn the_last_step_goes_no_further_than_it_must() {
        // For its error the far step saves more, but the near one is enough.
        let settings = [settings(&[1.0, 2.0, 3.0])];
        let seconds = |at: &[usize]| [10.0, 8.0, 1.0][at[0]];
        assert_eq!(fit(&settings, seconds, 9.0).at, [1]);
        assert_eq!(fit(&settings, seconds, 7.0).at, [2]);
    }

    #[test]
    fn a_time_that_nothing_keeps_ends_at_the_cheapest_and_says_so() {
        let seconds = |at: &[usize]| 5.0 - at[0] as f64;
        let found = fit(&[settings(&[0.0, 1.0, 2.0])], seconds, 1.0);
        assert_eq!(found, Fit { at: vec![2], seconds: 3.0, fits: false });
    }

    #[test]
    fn a_step_that_saves_nothing_is_passed_over() {
        assert_eq!(fit(&[settings(&[1.0, 2.0])], |at| 5.0 - 0.01 * at[0] as f64, 4.0).at, [0]);
        // The next level costs more, the one after it less.
        let seconds = |at: &[usize]| [5.0, 6.0, 2.0][at[0]];
        assert_eq!(fit(&[settings(&[1.0, 2.0, 3.0])], seconds, 4.0).at, [2]);
        assert_eq!(fit(&[settings(&[1.0, 2.0])], seconds, 4.0).at, [0]);
    }
}
