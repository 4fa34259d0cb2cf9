use ivd_core::op::{Field, Stage, fields};
use serde_json::{Map, Value as Json, json};

use crate::list::STAGES;

/// The schema of a scene with a section for every stage of the list.
pub(super) fn with_stages(mut schema: Json) -> Json {
    if let Some(properties) = schema.get_mut("properties").and_then(Json::as_object_mut) {
        properties.extend(STAGES.iter().map(|stage| (stage.name.to_owned(), section(stage))));
    }
    schema
}

/// The schema of a stage's section: the keys of all of its methods, each with the methods that read it where not all do.
fn section(stage: &Stage) -> Json {
    let mut properties = Map::new();
    if !stage.selector.is_empty() {
        properties.insert(stage.selector.to_owned(), selector(stage));
    }
    for method in stage.methods {
        for field in fields(&(method.schema)()) {
            if properties.contains_key(field.name) {
                continue;
            }
            let own = described(stage, field);
            let own = in_all(stage, field.name, own);
            for alias in field.aliases().filter(|alias| !alias.starts_with('!')) {
                let mut old = own.clone();
                old["deprecated"] = json!(true);
                old["description"] = json!(format!("The old name of {}.", field.name));
                properties.insert(alias.to_owned(), old);
            }
            properties.insert(field.name.to_owned(), own);
        }
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

/// A field's schema; where not every method reads it, its description begins with those that do.
fn described(stage: &Stage, field: Field<'_>) -> Json {
    let mut schema = field.schema.clone();
    let readers = readers(stage, field.name);
    if readers.len() < stage.methods.len() {
        let names: Vec<String> = readers.iter().map(|name| format!("`{name}`")).collect();
        schema["description"] = json!(format!("{}: {}", names.join(", "), field.about()));
    }
    schema
}

/// The schema of a key whose ranges and defaults aren't the same in all methods: those of any of them.
fn in_all(stage: &Stage, key: &str, own: Json) -> Json {
    let plain = |mut schema: Json| {
        if let Some(schema) = schema.as_object_mut() {
            schema.remove("description");
        }
        schema
    };
    let mut all: Vec<Json> = Vec::new();
    for method in stage.methods {
        let schema = (method.schema)();
        let found = fields(&schema).find(|field| field.name == key).map(|field| plain(field.schema.clone()));
        all.extend(found.filter(|found| !all.contains(found)));
    }
    if all.len() < 2 { own } else { json!({ "description": own["description"], "anyOf": all }) }
}

/// Names of the methods that read a key.
fn readers(stage: &Stage, key: &str) -> Vec<&'static str> {
    let reads = |schema: &Json| fields(schema).any(|field| field.name == key);
    stage.methods.iter().filter(|method| reads(&(method.schema)())).map(|method| method.name).collect()
}
