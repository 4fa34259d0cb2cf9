//! `ivd info`.

use std::path::Path;

use ivd_artefact::Cache;
use ivd_pipeline::describe;
use serde_json::{Value, json};

use super::volume::volume_or_artefact;
use crate::context::Context;

/// Tells what a file holds.
pub(super) fn run(file: &Path, context: &Context) -> anyhow::Result<()> {
    let mut object = if file.is_file() && ivd_artefact::is_artefact(file) {
        artefact(file, context)?
    } else {
        volume(file, context)?
    };
    if let Value::Object(map) = &mut object {
        map.insert("path".to_owned(), json!(file));
    }
    context.print(&object, || lines("", &object).join("\n"))
}

fn artefact(file: &Path, context: &Context) -> anyhow::Result<Value> {
    let info = ivd_artefact::peek(file)?;
    let input = context.artefact(file)?;
    let content = context.exec.run(|| describe(&input.artefact));
    Ok(json!({
        "kind": info.kind.name(),
        "kind_version": info.kind_version,
        "hash": info.hash.to_string(),
        "bytes": info.file_bytes,
        "provenance": {
            "stage": info.provenance.stage,
            "revision": info.provenance.revision,
            "params": info.provenance.params,
            "inputs": info.provenance.inputs.iter().map(|(k, v)| (k.clone(), json!(v.to_string()))).collect::<serde_json::Map<_, _>>(),
            "backend": info.provenance.backend,
        },
        "metrics": info.metrics,
        "content": without_bulk(content),
    }))
}

fn volume(file: &Path, context: &Context) -> anyhow::Result<Value> {
    let input = volume_or_artefact(file, &Cache::disabled(), context)?;
    let content = context.exec.run(|| describe(&input.artefact));
    Ok(json!({ "kind": "volume file", "hash": input.hash.to_string(), "content": content }))
}

/// Tables and displacements are for `ivd export … .json`.
fn without_bulk(mut content: Value) -> Value {
    if let Value::Object(map) = &mut content {
        map.remove("table");
        if let Some(Value::Array(frames)) = map.get_mut("frames") {
            *frames = frames.iter().map(|f| json!({ "time": f.get("time") })).collect();
        }
    }
    content
}

/// An object as indented lines; short lists stay on theirs.
fn lines(indent: &str, value: &Value) -> Vec<String> {
    let Value::Object(map) = value else { return vec![format!("{indent}{value}")] };
    let mut lines = Vec::new();
    for (key, value) in map {
        match value {
            Value::Object(inner) if !inner.is_empty() => {
                lines.push(format!("{indent}{key}:"));
                lines.extend(self::lines(&format!("{indent}  "), value));
            }
            Value::Array(list) if list.first().is_some_and(Value::is_object) => {
                lines.push(format!("{indent}{key}:"));
                lines.extend(list.iter().map(|item| format!("{indent}  {item}")));
            }
            Value::String(text) => lines.push(format!("{indent}{key}: {text}")),
            _ => lines.push(format!("{indent}{key}: {value}")),
        }
    }
    lines
}
