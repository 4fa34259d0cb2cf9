//! Runs one place of a plan.

use std::collections::BTreeMap;

use crate::options::PipelineOptions;
use crate::plan::{NodeId, PlanNode};
use crate::runner::{Runner, StageResult};
use crate::scene::Loaded;
use crate::{Error, Inputs, Stage};

/// What a scene is run by.
#[derive(Clone, Copy)]
pub(crate) struct Context<'a> {
    pub(crate) loaded: &'a Loaded,
    pub(crate) options: &'a PipelineOptions,
    pub(crate) runner: Runner<'a>,
}

/// Runs the stage of a place on what its inputs' places gave, which must all be among `done`.
///
/// # Errors
/// A usage error where the scene gives the place nothing to do, and those of [`Runner::run`].
pub fn run_node(
    node: &PlanNode,
    done: &BTreeMap<NodeId, StageResult>,
    runner: Runner<'_>,
    options: &PipelineOptions,
) -> Result<StageResult, Error> {
    run_node_as(node, node.stage.as_deref(), done, runner, options)
}

/// As [`run_node`], with another stage in the place's own's place: that of a plan whose settings were chosen.
pub(crate) fn run_node_as(
    node: &PlanNode,
    stage: Option<&dyn Stage>,
    done: &BTreeMap<NodeId, StageResult>,
    runner: Runner<'_>,
    options: &PipelineOptions,
) -> Result<StageResult, Error> {
    let stage = stage.ok_or_else(|| Error::usage(node.id.stage, "it has nothing to do in this scene"))?;
    let mut inputs = Inputs::default();
    for (slot, from) in &node.inputs {
        inputs = inputs.with(slot, done[from].input());
    }
    runner.run(stage, &inputs, options.force.contains(stage.name()))
}
