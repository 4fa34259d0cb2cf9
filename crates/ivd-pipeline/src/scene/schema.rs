use ivd_core::op::Stage;
use serde_json::{Map, Value as Json, json};

use crate::list::{Key, STAGES, keys};
use crate::params::tell_landmarks;

/// The schema of a scene with a section for every stage of the list.
pub(super) fn with_stages(mut schema: Json) -> Json {
    if let Some(properties) = schema.get_mut("properties").and_then(Json::as_object_mut) {
        properties.extend(STAGES.iter().map(|stage| (stage.name.to_owned(), section(stage))));
    }
    schema
}

/// The schema of a stage's section: the keys of all of its methods, each with the methods that read it where not all do.
fn section(stage: &'static Stage) -> Json {
    let mut properties = Map::new();
    if !stage.selector.is_empty() {
        properties.insert(stage.selector.to_owned(), selector(stage));
    }
    for key in keys(stage) {
        let mut own = described(stage, key);
        tell_landmarks(&mut own);
        for alias in key.field().aliases().filter(|alias| !alias.starts_with('!')) {
            let mut old = own.clone();
            old["deprecated"] = json!(true);
            old["description"] = json!(format!("Another name of {}.", key.name));
            properties.insert(alias.to_owned(), old);
        }
        properties.insert(key.name.clone(), own);
    }
    json!({ "type": "object", "description": stage.about, "additionalProperties": false, "properties": properties })
}

/// The key that chooses the method.
fn selector(stage: &Stage) -> Json {
    let words = stage.methods.iter().map(|method| {
        let schema = (method.schema)();
        let about = schema.get("description").cloned().unwrap_or(Json::Null);
        json!({ "type": "string", "const": method.name, "description": about })
    });
    let default = stage.methods.first().map_or("", |method| method.name);
    json!({ "description": "Method.", "default": default, "oneOf": words.collect::<Vec<_>>() })
}

/// A key's schema; where not every method reads it, or not all alike, its description tells which do.
fn described(stage: &Stage, key: &Key) -> Json {
    let mut schema = key.schema.clone();
    if key.is_of_all(stage) {
        return schema;
    }
    let tells_defaults = key.schema.get("default").is_none();
    let said = key.says.iter().map(|said| {
        let names: Vec<String> = said.methods.iter().map(|name| format!("`{name}`")).collect();
        let default = said.default.as_ref().filter(|default| tells_defaults && !default.is_null());
        let default = default.map_or_else(String::new, |default| format!(" Default {default}."));
        format!("{}: {}{default}", names.join(", "), said.about)
    });
    schema["description"] = json!(said.collect::<Vec<_>>().join("\n\n"));
    schema
}
