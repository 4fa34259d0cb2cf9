//! The choice of refinement and time steps by an error (mm): predicted, measured, and made finer until it holds.

/// Parts of the error that a choice decides, in this order: the lattice's bound, its motion, the time steps.
pub(crate) const PARTS: usize = 3;

/// A refinement with a number of time steps.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Candidate {
    pub(crate) level: f64,
    pub(crate) steps: f64,
    /// Predicted time (s).
    pub(crate) seconds: f64,
    /// Predicted parts (mm).
    pub(crate) parts: [f64; PARTS],
}

/// What the trials so far taught.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Learned {
    /// Measured over predicted, by part, at least 1.
    pub(crate) factors: [f64; PARTS],
    /// Error that no choice changes (mm).
    pub(crate) fixed: f64,
    /// Candidates that were tried, by index.
    pub(crate) tried: Vec<usize>,
}

impl Learned {
    pub(crate) fn new() -> Self {
        Self { factors: [1.0; PARTS], fixed: 0.0, tried: Vec::new() }
    }

    /// Remembers a trial; parts that weren't measured are `None`.
    pub(crate) fn trial(
        &mut self,
        at: usize,
        candidate: &Candidate,
        measured: [Option<f64>; PARTS],
        fixed: f64,
    ) {
        self.tried.push(at);
        self.fixed = self.fixed.max(fixed);
        for ((factor, measured), predicted) in self.factors.iter_mut().zip(measured).zip(candidate.parts) {
            if let Some(measured) = measured.filter(|_| predicted > 0.0) {
                *factor = factor.max(measured / predicted);
            }
        }
    }

    fn error(&self, candidate: &Candidate) -> f64 {
        let parts = candidate.parts.iter().zip(self.factors).map(|(part, factor)| part * factor);
        parts.sum::<f64>() + self.fixed
    }

    /// The cheapest candidate not tried yet that is predicted to stay within `most` (mm); where there is none, the one that
    /// errs least, unless it was tried: a prediction may be wrong, what was measured isn't.
    pub(crate) fn next(&self, candidates: &[Candidate], most: f64) -> Option<usize> {
        let untried = |i: &usize| !self.tried.contains(i);
        let all = 0..candidates.len();
        let good = all.clone().filter(untried).filter(|&i| self.error(&candidates[i]) <= most);
        let cheapest = good.min_by(|&a, &b| candidates[a].seconds.total_cmp(&candidates[b].seconds));
        cheapest.or_else(|| {
            let sum = |i: usize| self.error(&candidates[i]);
            all.min_by(|&a, &b| sum(a).total_cmp(&sum(b))).filter(untried)
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Levels 0 to 3 with 50, 100 and 200 steps: the lattice errs `4^level - 1`, the steps 10 over their number.
    fn candidates() -> Vec<Candidate> {
        let of = |level: i32, steps: f64| Candidate {
            level: f64::from(level),
            steps,
            seconds: 10.0 - f64::from(level) + steps / 1000.0,
            parts: [4_f64.powi(level) - 1.0, 0.0, 10.0 / steps],
        };
        (0..4).flat_map(|level| [50.0, 100.0, 200.0].map(|steps| of(level, steps))).collect()
    }

    fn chosen(learned: &Learned, most: f64) -> Option<(f64, f64)> {
        let all = candidates();
        learned.next(&all, most).map(|i| (all[i].level, all[i].steps))
    }

    #[test]
    fn the_cheapest_that_is_predicted_to_hold_is_taken() {
        let none = Learned::new();
        assert_eq!(chosen(&none, 100.0), Some((3.0, 50.0)));
        assert_eq!(chosen(&none, 3.15), Some((1.0, 100.0)));
        assert_eq!(chosen(&none, 0.06), Some((0.0, 200.0)));
    }

    #[test]
    fn a_larger_error_than_predicted_makes_the_next_choice_finer() {
        let all = candidates();
        let mut learned = Learned::new();
        let first = learned.next(&all, 16.0).unwrap();
        assert_eq!(all[first].level, 2.0);
        // Twice what was predicted: 30 instead of 15.
        learned.trial(first, &all[first], [Some(30.0), None, None], 0.0);
        assert_eq!(chosen(&learned, 16.0), Some((1.0, 50.0)));
        // What no choice changes counts as well.
        learned.fixed = 15.9;
        assert_eq!(chosen(&learned, 16.0), Some((0.0, 100.0)));
    }

    #[test]
    fn an_error_that_nothing_holds_is_tried_at_its_finest_and_then_given_up() {
        let all = candidates();
        let mut learned = Learned::new();
        assert_eq!(chosen(&learned, 1e-3), Some((0.0, 200.0)));
        let finest = learned.next(&all, 1e-3).unwrap();
        learned.trial(finest, &all[finest], [Some(0.0), Some(0.0), Some(0.05)], 0.0);
        assert_eq!(chosen(&learned, 1e-3), None);
    }
}
