//! The other ways to cut and to thin out a surface, as one subject each.

use ivd_core::{ErrorClass, Exec};
use ivd_lattice::refine::{Method, RefineParams};

use super::backend::{Answer, Backend};
use super::case::{Case, Stage, TURNS};
use super::invariants::{Verdict, mesh};
use super::subject::{Subject, Values};

/// The lattices of all classes at once.
pub(super) struct Parts;

impl Subject for Parts {
    fn stage(&self) -> Stage {
        Stage::Parts
    }
    fn run(&self, on: &dyn Backend, case: &Case, values: &mut Values, exec: &Exec) -> Answer<bool> {
        let Some(found) = &values.segmentation else { return Ok(false) };
        if !has_turn(case, self.stage()) {
            return Ok(false);
        }
        values.parts = on.parts(&found.labels, exec)?;
        Ok(true)
    }
    fn check(&self, _: &dyn Backend, _: &Case, values: &Values, _: &Exec) -> Verdict {
        mesh::parts(&values.segmentation.as_ref().expect("it ran").labels, &values.parts)
    }
}

/// A method of refinement with its name.
pub(super) struct Thinning(Stage, &'static str, Method);

pub(super) static DECIMATE: Thinning =
    Thinning(Stage::RefineDecimate, "refine by decimation", Method::Decimate);
pub(super) static LOOP: Thinning = Thinning(Stage::RefineLoop, "refine by loop", Method::Loop);
pub(super) static MERGE: Thinning = Thinning(Stage::RefineMerge, "refine by merging", Method::Merge);
pub(super) static SAMPLE: Thinning = Thinning(Stage::RefineSample, "refine by sampling", Method::Sample);

impl Subject for Thinning {
    fn stage(&self) -> Stage {
        self.0
    }
    fn run(&self, on: &dyn Backend, case: &Case, values: &mut Values, exec: &Exec) -> Answer<bool> {
        let Some(lattice) = values.lattice.as_ref().filter(|_| has_turn(case, self.0)) else {
            return Ok(false);
        };
        let params = RefineParams { method: self.2, ..case.setup.refine.clone() };
        match on.refine(lattice, &params, exec) {
            Ok(found) => {
                values.refinements.insert(self.1, found);
                Ok(true)
            }
            // A lattice that was made by hand has no crossings to sample.
            Err(refusal)
                if self.2 == Method::Sample
                    && case.lattice.is_some()
                    && refusal.fault == ErrorClass::Usage =>
            {
                Ok(false)
            }
            Err(refusal) => Err(refusal),
        }
    }
    fn check(&self, _: &dyn Backend, _: &Case, values: &Values, exec: &Exec) -> Verdict {
        let (input, found) = (values.lattice.as_ref().expect("it ran"), &values.refinements[self.1]);
        if self.2 == Method::Sample {
            mesh::sampled(input, found, exec)
        } else {
            mesh::refined(input, found, exec)
        }
    }
}

/// Whether a stage that takes turns has its own.
pub(super) fn has_turn(case: &Case, stage: Stage) -> bool {
    case.setup.turn.is_none_or(|turn| stage as usize % TURNS == turn)
}
