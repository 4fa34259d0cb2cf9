//! Canonical JSON: one text for one value.

use serde_json::Value;

/// The value as JSON without white space, keys sorted by their bytes, numbers as short as they round-trip.
///
/// `1` and `1.0` stay two texts: the type that a parameter was serialized from decides, and it doesn't change within a
/// revision of its stage.
///
/// ```
/// let value = serde_json::json!({"b": [1, 2.5], "a": null});
/// assert_eq!(ivd_artefact::canonical_json(&value), r#"{"a":null,"b":[1,2.5]}"#);
/// ```
pub fn canonical_json(value: &Value) -> String {
    let mut text = String::new();
    append(value, &mut text);
    text
}

fn append(value: &Value, text: &mut String) {
    match value {
        Value::Array(items) => {
            text.push('[');
            for (i, item) in items.iter().enumerate() {
                if i > 0 {
                    text.push(',');
                }
                append(item, text);
            }
            text.push(']');
        }
        Value::Object(map) => {
            // Sorted here: whether the map is sorted depends on a feature that any crate of the build may switch on.
            let mut keys: Vec<&String> = map.keys().collect();
            keys.sort_unstable();
            text.push('{');
            for (i, key) in keys.into_iter().enumerate() {
                if i > 0 {
                    text.push(',');
                }
                text.push_str(&Value::String(key.clone()).to_string());
                text.push(':');
                append(&map[key], text);
            }
            text.push('}');
        }
        scalar => text.push_str(&scalar.to_string()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn key_order_and_nesting_do_not_change_the_text() {
        let a: Value = serde_json::from_str(r#"{"z":{"k":1,"a":"ü\n"},"m":[{"y":0.1,"x":-0.0}]}"#).unwrap();
        let b: Value = serde_json::from_str(r#"{"m":[{"x":-0.0,"y":0.1}],"z":{"a":"ü\n","k":1}}"#).unwrap();
        assert_eq!(canonical_json(&a), canonical_json(&b));
        assert_eq!(canonical_json(&a), r#"{"m":[{"x":-0.0,"y":0.1}],"z":{"a":"ü\n","k":1}}"#);
    }
}
