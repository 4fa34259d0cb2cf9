use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// A class of the segmentation: an id, "densest" or "largest".
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(untagged)]
pub enum ClassChoice {
    /// A class id.
    Id(u16),
    /// A word.
    Word(ClassWord),
}

/// A class by what it is.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum ClassWord {
    /// Highest mean.
    Densest,
    /// Most voxels, air apart.
    Largest,
}

impl std::str::FromStr for ClassChoice {
    type Err = String;
    fn from_str(text: &str) -> Result<Self, String> {
        match text {
            "densest" => Ok(Self::Word(ClassWord::Densest)),
            "largest" => Ok(Self::Word(ClassWord::Largest)),
            _ => text.parse().map(Self::Id).map_err(|_| format!("`{text}`: a class id, densest or largest")),
        }
    }
}

/// `[boundary]`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct BoundarySection {
    /// The class whose part is isolated.
    pub class: Option<ClassChoice>,
    /// A point in the part (mm), RAS; the largest part where it isn't given.
    pub seed: Option<[f64; 3]>,
    /// Whether holes inside the part belong to it.
    pub fill_holes: bool,
    /// The part is what is at or above this real value, instead of a class.
    pub above: Option<f64>,
}

impl Default for BoundarySection {
    fn default() -> Self {
        Self { class: None, seed: None, fill_holes: true, above: None }
    }
}
