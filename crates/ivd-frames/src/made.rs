//! What the body is made of: its surface, its part, how it follows.

use ivd_pipeline::scene::Scene;
use ivd_session::{Physics, Settings};
use serde::Serialize;
use serde_json::Value as Json;

use crate::subject::springs;

/// What the body is made of, as it was said or found; each can be said otherwise by a key of the scene.
#[derive(Debug, Clone, PartialEq, Default, Serialize)]
pub struct Made {
    /// `lattice.iso`: the value of its surface, where one is given.
    pub iso: Option<f64>,
    /// `boundary.class`: a class, `densest` or `largest`, where one is given.
    pub part: Option<String>,
    /// The class that its part was found in.
    pub class: Option<u16>,
    /// Values that this class lies between; nothing where it is open there.
    pub between: [Option<f64>; 2],
    /// `deform.solver`: how it follows.
    pub solver: &'static str,
    /// `deform.stiffness` (N/m).
    pub stiffness: f64,
}

impl Made {
    /// - `part`: figures of the stage that isolates the part, where one was.
    pub(crate) fn of(scene: &Scene, settings: &Settings, part: Option<&Json>) -> Self {
        let number = |key: &str| part.and_then(|figures| figures[key].as_f64());
        let (solver, stiffness) = match &settings.physics {
            Physics::Ring(params) => ("ring", params.stiffness),
            Physics::Springs(params) => (springs(params).0, params.springs.stiffness),
        };
        Self {
            iso: scene.param(&ivd_lattice::extract::STAGE, "iso").and_then(|iso| iso.as_f64()),
            part: scene.param(&ivd_boundary::STAGE, "class").map(|class| match class {
                Json::String(word) => word,
                number => number.to_string(),
            }),
            class: number("class").map(|class| class as u16),
            between: [number("lower"), number("upper")],
            solver,
            stiffness,
        }
    }
}
