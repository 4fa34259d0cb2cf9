//! What a scene's outputs need: the graph of stages, who needs whom, and why.

mod files;
mod graph;

pub(crate) use graph::stage_names;
pub use graph::{NodeId, Plan, PlanNode};
