//! What the body is made of: its surface and its part.

use ivd_pipeline::scene::Scene;
use serde::Serialize;
use serde_json::Value as Json;

/// What the body is made of, as it was said or found; each can be said otherwise by a key of the scene.
#[derive(Debug, Clone, PartialEq, Default, Serialize)]
pub struct Made {
    /// `lattice.iso`: the value of its surface, where one is given.
    pub iso: Option<f64>,
    /// `boundary.class`: a class, `densest` or `largest`, where one is given.
    pub part: Option<String>,
    /// `lattice.min_part`: pieces that enclose less are left out (mm³); 0 for none.
    pub min_part: f64,
    /// The class that its part was found in.
    pub class: Option<u16>,
    /// Whether its part is all of a bare scan but the background, as nobody said otherwise.
    pub is_body: bool,
    /// Values that its part lies between; nothing where it is open there.
    pub between: [Option<f64>; 2],
}

impl Made {
    /// Whether its part is all from a value on, which a scene says or which was chosen here.
    pub fn is_above(&self) -> bool {
        self.class.is_none() && self.iso.is_none() && self.between[0].is_some()
    }

    /// - `part`: figures of the stage that isolates the part, where one was.
    /// - `is_body`: whether it was chosen here that its part is all but the background.
    pub(crate) fn of(scene: &Scene, part: Option<&Json>, is_body: bool) -> Self {
        let param = |key| scene.param(&ivd_lattice::extract::STAGE, key).and_then(|value| value.as_f64());
        let number = |key: &str| part.and_then(|figures| figures[key].as_f64());
        Self {
            iso: param("iso"),
            part: scene.param(&ivd_boundary::STAGE, "class").map(|class| match class {
                Json::String(word) => word,
                number => number.to_string(),
            }),
            min_part: param("min_part").unwrap_or(0.0),
            class: number("class").map(|class| class as u16),
            is_body,
            between: [number("lower"), number("upper")],
        }
    }
}
