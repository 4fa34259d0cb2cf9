//! Where in a scene things lie that a deformed volume is clipped by or combined with.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Values of a scene that a key may name instead of a file; both are of the body at rest.
pub(crate) const OF_SCENE: &[&str] = &["mask", "labels"];

/// Where something lies that a deformed volume meets.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum Lies {
    /// In the body at rest: the motion carries it along.
    Rest,
    /// Where the body has come to: the motion doesn't touch it.
    Deformed,
}

impl Lies {
    /// Where something lies of which nothing else is said: what a scene has found lies in the body, all else where it is put.
    pub(crate) fn or_of(chosen: Option<Self>, named: Option<&str>) -> Self {
        let of_scene = named.is_some_and(|named| OF_SCENE.contains(&named));
        chosen.unwrap_or(if of_scene { Self::Rest } else { Self::Deformed })
    }
}
