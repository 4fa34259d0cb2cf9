//! All that a transfer function holds.

use ivd_core::{GradientTable, TransferEntry, TransferFunction};
use serde_json::{Value, json};

use super::{Problem, number};

pub(super) fn write(transfer: &TransferFunction) -> Value {
    let mut value = json!({
        "kind": "transfer", "range": transfer.range(), "resolution": transfer.resolution(),
        "reference_mm": transfer.reference_mm(), "classes": transfer.classes(), "entries": transfer.entries(),
        "table": transfer.table(),
    });
    if let Some(by) = transfer.gradient() {
        value["gradient"] = json!({ "top": by.top(), "dims": by.dims(), "table": by.table() });
    }
    value
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
    let transfer = TransferFunction::new(range, resolution, reference_mm, classes, table, entries)
        .map_err(|error| Problem::new("the table", error.to_string()))?;
    let Some(by) = value.get("gradient") else { return Ok(transfer) };
    let of = |name: &str| by.get(name).cloned().unwrap_or(Value::Null);
    let dims: [usize; 2] = serde_json::from_value(of("dims")).map_err(|e| part("gradient.dims", e))?;
    let table: Vec<[f32; 4]> = serde_json::from_value(of("table")).map_err(|e| part("gradient.table", e))?;
    let table = GradientTable::new(number(by.get("top"), "gradient.top")?, dims, table)
        .map_err(|error| Problem::new("gradient", error.to_string()))?;
    Ok(transfer.with_gradient(table))
}
