//! The one list of stages. Each says in its crate which methods it has; scenes, commands, schema, plan, cache keys, report and budgets go
//! by this list, and nothing else names a stage's parameters.

use ivd_core::op::Stage;

/// The stages, in the order in which a scene runs them.
pub const STAGES: &[&Stage] =
    &[&ivd_octree::STAGE, &ivd_deform::deform::STAGE, &ivd_deform::map::STAGE, &ivd_deform::space::STAGE];

/// The stage of a name.
pub fn stage(name: &str) -> Option<&'static Stage> {
    STAGES.iter().find(|stage| stage.name == name).copied()
}

#[cfg(test)]
mod tests;
