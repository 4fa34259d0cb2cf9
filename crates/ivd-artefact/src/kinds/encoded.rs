use serde::Serialize;

use super::sections::SectionBytes;
use crate::canonical_json;

/// A value, ready to be hashed and written.
pub(crate) struct Encoded<'a> {
    /// Canonical JSON of what stands beside the sections.
    pub(crate) content: String,
    pub(crate) sections: Vec<SectionBytes<'a>>,
    /// The oldest version of its kind that holds all of it; `None` for the newest.
    pub(crate) version: Option<u16>,
}

impl<'a> Encoded<'a> {
    /// With what stands beside the sections.
    pub(super) fn new(content: &impl Serialize, sections: Vec<SectionBytes<'a>>) -> Result<Self, String> {
        let content = serde_json::to_value(content).map_err(|e| e.to_string())?;
        Ok(Self { content: canonical_json(&content), sections, version: None })
    }
}
