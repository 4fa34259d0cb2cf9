//! Results whose error is measured, not followed from step to step.

use ivd_core::{Exec, Lattice};

use super::certified::{distances_within, least_distance};
use super::locks::Locks;
use super::mean::Seen;
use super::refusal::{Refused, StopReason};
use super::report::{Outcome, Refined};
use crate::Error;

/// What a method made of a lattice, in the input's numbers, before anyone knows how far off it is.
#[derive(Debug, Clone)]
pub(super) struct Draft {
    /// Vertices left, ascending.
    pub(super) kept: Vec<u32>,
    /// Triangles between them.
    pub(super) triangles: Vec<[u32; 3]>,
    pub(super) stopped_by: StopReason,
    pub(super) refused: Refused,
    pub(super) passes: u32,
}

impl Draft {
    /// The input as it is.
    pub(super) fn same(input: &Lattice, stopped_by: StopReason) -> Self {
        Self {
            kept: (0..input.keys().len() as u32).collect(),
            triangles: input.triangles().to_vec(),
            stopped_by,
            refused: Refused::default(),
            passes: 0,
        }
    }

    /// Triangles, and of the vertices those that are in one, locked, or in none of the input's.
    pub(super) fn of(triangles: Vec<[u32; 3]>, input: &Lattice, locks: Locks<'_>, passes: u32) -> Self {
        let mut left = vec![true; input.keys().len()];
        for &v in input.triangles().as_flattened() {
            left[v as usize] = false;
        }
        for &v in locks.vertices {
            left[v as usize] = true;
        }
        for &v in triangles.iter().flatten() {
            left[v as usize] = true;
        }
        let kept = (0..left.len() as u32).filter(|&v| left[v as usize]).collect();
        Self { kept, triangles, stopped_by: StopReason::Target, refused: Refused::default(), passes }
    }

    /// The refined lattice, as if it were no distance away.
    fn unmeasured(self, input: &Lattice) -> Refined {
        let Self { kept, triangles, stopped_by, refused, passes } = self;
        let (max_error_mm, seen) = (0.0, Seen::default());
        Outcome { kept, triangles, max_error_mm, seen, stopped_by, refused, passes }.report(input)
    }

    /// How far it is from the input at least (mm), and hardly further: cheap beside [`measured`](Self::measured).
    pub(super) fn least(self, input: &Lattice, exec: &Exec) -> Result<f64, Error> {
        least_distance(input, &self.unmeasured(input).lattice, exec)
    }

    /// The refined lattice and how far it is from the input; `None` where that is more than `limit` (mm).
    ///
    /// - `bound`: what is known of the distance otherwise (mm), or infinity.
    pub(super) fn measured(
        self,
        input: &Lattice,
        bound: f64,
        limit: f64,
        exec: &Exec,
    ) -> Result<Option<Refined>, Error> {
        let mut refined = self.unmeasured(input);
        if refined.lattice.keys().len() == input.keys().len()
            && refined.lattice.triangles() == input.triangles()
        {
            return Ok(Some(refined));
        }
        let Some(found) = distances_within(input, &refined.lattice, limit, exec)? else { return Ok(None) };
        refined.max_error_mm = found.max_mm.min(bound);
        refined.mean_error_mm = found.mean_mm.min(refined.max_error_mm);
        refined.seen_error_mm = found.least_max_mm.min(refined.max_error_mm);
        refined.lattice = refined.lattice.with_max_error_mm(input.max_error_mm() + refined.max_error_mm);
        Ok(Some(refined))
    }

    /// The same without a limit. Something must be left.
    pub(super) fn finished(self, input: &Lattice, bound: f64, exec: &Exec) -> Result<Refined, Error> {
        let stopped_by = self.stopped_by;
        match self.measured(input, bound, f64::INFINITY, exec)? {
            Some(refined) => Ok(refined),
            None => Err(Error::Unreachable {
                asked: "what was asked for".into(),
                problem: format!("no triangle is left ({stopped_by:?}), and nothing is near to nothing"),
                remedy: "ask for less".into(),
            }),
        }
    }
}
