//! What a scene's outputs need: the graph of stages, who needs whom, and why.

mod files;
mod graph;

pub use graph::{NodeId, Plan, PlanNode};
pub(crate) use graph::{OF_FRAMES, PICTURES, SERIES, stage_names};
