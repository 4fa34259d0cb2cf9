//! All that a transfer function holds.

use ivd_core::{TransferEntry, TransferFunction};
use serde_json::{Value, json};

use super::{Problem, number};

pub(super) fn write(transfer: &TransferFunction) -> Value {
    json!({
        "kind": "transfer", "range": transfer.range(), "resolution": transfer.resolution(),
        "reference_mm": transfer.reference_mm(), "classes": transfer.classes(), "entries": transfer.entries(),
        "table": transfer.table(),
    })
}

pub(super) fn read(value: &Value) -> Result<TransferFunction, Problem> {
    let of = |name: &str| value.get(name).cloned().unwrap_or(Value::Null);
    let part = |name: &str, error: serde_json::Error| Problem::new(name, error.to_string());
    let classes: Vec<u16> = serde_json::from_value(of("classes")).map_err(|e| part("classes", e))?;
    let table: Vec<[f32; 4]> = serde_json::from_value(of("table")).map_err(|e| part("table", e))?;
    let entries: Vec<TransferEntry> =
        serde_json::from_value(of("entries")).map_err(|e| part("entries", e))?;
    let range = [number(value.pointer("/range/0"), "range")?, number(value.pointer("/range/1"), "range")?];
    let resolution = number(value.get("resolution"), "resolution")? as usize;
    let reference_mm = number(value.get("reference_mm"), "reference_mm")?;
    TransferFunction::new(range, resolution, reference_mm, classes, table, entries)
        .map_err(|error| Problem::new("the table", error.to_string()))
}
