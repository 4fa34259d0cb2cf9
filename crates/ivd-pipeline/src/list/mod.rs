//! The one list of stages. Each says in its crate which methods it has; scenes, commands, schema, plan, cache keys, report and budgets go
//! by this list, and nothing else names a stage's parameters.

mod keys;

use ivd_core::op::{Place, Stage};

pub use keys::{Key, Said, keys, keys_of};

/// The stages, in the order in which a scene runs them.
pub const STAGES: &[&Stage] = &[
    &ivd_segment::STAGE,
    &ivd_boundary::STAGE,
    &ivd_lattice::extract::STAGE,
    &ivd_lattice::refine::STAGE,
    &ivd_octree::STAGE,
    &ivd_motion::deform::STAGE,
    &ivd_map::STAGE,
    &ivd_map::space::STAGE,
    &ivd_field::warp::STAGE,
    &ivd_field::combine::STAGE,
    &ivd_field::clip::STAGE,
    &ivd_atf::STAGE,
    &ivd_render::STAGE,
];

/// The stage of a name.
pub fn stage(name: &str) -> Option<&'static Stage> {
    STAGES.iter().find(|stage| stage.name == name).copied()
}

/// The place of a stage's name with its variant, such as `render before`.
pub fn place(name: &str) -> Option<(&'static Stage, &'static Place)> {
    let (stage_name, variant) = name.split_once(' ').unwrap_or((name, ""));
    let stage = stage(stage_name)?;
    Some((stage, stage.places.iter().find(|place| place.variant == variant)?))
}

#[cfg(test)]
mod tests;
