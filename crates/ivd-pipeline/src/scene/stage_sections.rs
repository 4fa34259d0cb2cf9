use std::collections::BTreeMap;

use ivd_core::ParamError;
use ivd_core::op::Stage;
use serde_json::Value as Json;

use crate::Section;
use crate::list::STAGES;

/// Sections by their names.
pub(crate) type Written = BTreeMap<String, Json>;

/// The stages of the list, from the sections of a scene.
pub(super) fn stage_sections(written: &Written) -> Result<Vec<Section>, ParamError> {
    let given = |section: &str, key: &str| written.get(section)?.get(key);
    let section = |stage: &&'static Stage| {
        let own = match written.get(stage.name) {
            None => None,
            Some(Json::Object(keys)) => Some(keys.clone()),
            Some(_) => {
                return Err(ParamError::new(stage.name, "not a table", "write it as a section of keys"));
            }
        };
        Section::parse_adopting(stage, own, given).map_err(|problem| problem.under(stage.name))
    };
    STAGES.iter().map(section).collect()
}
