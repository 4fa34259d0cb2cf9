//! What decides about a run while it goes on.

use std::collections::BTreeMap;

use ivd_core::Exec;

use crate::Error;
use crate::plan::{NodeId, Plan};
use crate::runner::{Runner, StageRecord, StageResult};

/// Is asked before every stage of a run and told after it, and may change the settings of those that are still to come. Where none of this is written, every stage runs as the
/// scene has it.
pub trait Control {
    /// Before the stage at `at` runs: may give the plan's stages other settings ([`Plan::retune`]). Gives the stage's result where it has
    /// made that already.
    ///
    /// # Errors
    /// Whatever ends the run.
    fn before(
        &mut self,
        at: usize,
        plan: &mut Plan,
        done: &BTreeMap<NodeId, StageResult>,
        runner: Runner<'_>,
    ) -> Result<Option<StageResult>, Error> {
        let _ = (at, plan, done, runner);
        Ok(None)
    }

    /// After a stage.
    fn after(&mut self, id: NodeId, result: &StageResult) {
        let _ = (id, result);
    }

    /// What a report of the run shows of what was decided: a title, and a line for each decision.
    fn summary(&self) -> Decisions {
        Decisions::default()
    }

    /// Says what a failure of the run comes from, where that is of its making; `stages` are those that were done by then.
    fn explain(&self, error: Error, exec: &Exec, stages: &[StageRecord]) -> Error {
        let _ = (exec, stages);
        error
    }
}

/// What was decided in a run, as a section of its report.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct Decisions {
    /// Title of the section.
    pub title: &'static str,
    /// A line for each; without any there is no section.
    pub lines: Vec<String>,
}

/// Decides nothing.
pub(crate) struct Uncontrolled;

impl Control for Uncontrolled {}
