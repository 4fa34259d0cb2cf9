//! What a scene's outputs need: the graph of stages, who needs whom, and why.

mod graph;

pub use graph::{NodeId, Plan, PlanNode};
pub(crate) use graph::{SERIES, stage_names};
