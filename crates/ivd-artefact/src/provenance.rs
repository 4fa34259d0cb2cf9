use std::collections::BTreeMap;

use serde_json::Value;

use crate::ContentHash;

/// Where an artefact came from. Holds no time and no host, so that the same work gives the same bytes.
#[derive(Debug, Clone, PartialEq)]
pub struct Provenance {
    /// Stage that made it, such as `"segment"`.
    pub stage: String,
    /// Revision of the stage: raised whenever its results change.
    pub revision: u32,
    /// The stage's parameters. Kept as JSON so that those of any version can be shown.
    pub params: Value,
    /// Content hashes of the inputs by name.
    pub inputs: BTreeMap<String, ContentHash>,
    /// Backend class, such as `"cpu"`: results of different classes never stand for each other.
    pub backend: String,
}

impl Provenance {
    /// A provenance without inputs, of revision 1 on the CPU.
    pub fn new(stage: impl Into<String>, params: Value) -> Self {
        Self { stage: stage.into(), revision: 1, params, inputs: BTreeMap::new(), backend: "cpu".to_owned() }
    }

    /// Adds an input.
    #[must_use]
    pub fn with_input(mut self, name: impl Into<String>, hash: ContentHash) -> Self {
        self.inputs.insert(name.into(), hash);
        self
    }
}
