//! What a schema says of one field.

use serde_json::Value as Json;

/// One field of a method's parameters or figures.
#[derive(Debug, Clone, Copy)]
pub struct Field<'a> {
    /// Its name: the key of a scene's section.
    pub name: &'a str,
    /// Its schema.
    pub schema: &'a Json,
}

/// The fields of an object's schema, by name.
pub fn fields(schema: &Json) -> impl Iterator<Item = Field<'_>> {
    let properties = schema.get("properties").and_then(Json::as_object);
    properties.into_iter().flatten().map(|(name, schema)| Field { name, schema })
}

impl<'a> Field<'a> {
    fn word(self, key: &str) -> &'a str {
        self.schema.get(key).and_then(Json::as_str).unwrap_or("")
    }

    /// What it is, in plain words.
    pub fn about(self) -> &'a str {
        self.word("description")
    }

    /// Its unit; empty where it has none, being no number.
    pub fn unit(self) -> &'a str {
        self.word("x-unit")
    }

    /// The value that it has where nothing is said.
    pub fn default(self) -> Option<&'a Json> {
        self.schema.get("default")
    }

    /// Names that it had before. One that begins with `!` says the opposite.
    pub fn aliases(self) -> impl Iterator<Item = &'a str> {
        self.schema.get("x-alias").and_then(Json::as_array).into_iter().flatten().filter_map(Json::as_str)
    }

    /// The section and key of a scene whose value it takes where it isn't given.
    pub fn from(self) -> Option<(&'a str, &'a str)> {
        self.schema.get("x-from").and_then(Json::as_str)?.split_once('.')
    }

    /// The section and key that keep it from doing so where they are given.
    pub fn unless(self) -> Option<(&'a str, &'a str)> {
        self.schema.get("x-unless").and_then(Json::as_str)?.split_once('.')
    }

    /// Whether it says how the work is done, and not what comes of it.
    pub fn is_how(self) -> bool {
        self.schema.get("x-how").and_then(Json::as_bool).unwrap_or(false)
    }

    /// Whether it is a time or a rate of one run.
    pub fn is_time(self) -> bool {
        self.schema.get("x-time").and_then(Json::as_bool).unwrap_or(false)
    }

    /// Its place among the figures that a person wants first; `None` of all others.
    pub fn headline(self) -> Option<u64> {
        self.schema.get("x-headline").and_then(Json::as_u64)
    }

    /// What it may be, for a person: its range with its unit, or its words.
    pub fn domain(self) -> String {
        domain(self.schema, self.unit())
    }
}

/// The alternatives of a schema, but for nothing at all; the schema itself where it has none.
pub fn alternatives(schema: &Json) -> Vec<&Json> {
    let all = schema.get("anyOf").or_else(|| schema.get("oneOf")).and_then(Json::as_array);
    match all {
        Some(all) if schema.get("properties").is_none() => all
            .iter()
            .filter(|one| one.get("type").and_then(Json::as_str) != Some("null"))
            .flat_map(alternatives)
            .collect(),
        _ => vec![schema],
    }
}

/// Whether nothing at all fits a schema.
pub fn is_nullable(schema: &Json) -> bool {
    let is_null = |kind: &Json| kind.as_str() == Some("null");
    match schema.get("type") {
        Some(Json::Array(kinds)) => kinds.iter().any(is_null),
        Some(kind) => is_null(kind),
        None => {
            let all = schema.get("anyOf").or_else(|| schema.get("oneOf")).and_then(Json::as_array);
            all.into_iter().flatten().any(is_nullable)
        }
    }
}

/// The type of a schema without alternatives: `number`, `integer`, `boolean`, `string`, `array` or `object`.
pub fn kind(schema: &Json) -> &str {
    let kind = match schema.get("type") {
        Some(Json::Array(kinds)) => kinds.iter().filter_map(Json::as_str).find(|kind| *kind != "null"),
        Some(kind) => kind.as_str(),
        None => None,
    };
    kind.unwrap_or(if words(schema).is_empty() { "" } else { "string" })
}

/// The words that a schema lets stand, with what they mean.
pub fn words(schema: &Json) -> Vec<(&str, &str)> {
    if let Some(word) = schema.get("const").and_then(Json::as_str) {
        return vec![(word, schema.get("description").and_then(Json::as_str).unwrap_or(""))];
    }
    if let Some(all) = schema.get("enum").and_then(Json::as_array) {
        return all.iter().filter_map(Json::as_str).map(|word| (word, "")).collect();
    }
    let all = alternatives(schema);
    if all.len() == 1 && std::ptr::eq(all[0], schema) {
        Vec::new()
    } else {
        all.into_iter().flat_map(words).collect()
    }
}

/// Whether a list has a fixed length: a vector, not a list of things.
pub fn is_vector(schema: &Json) -> bool {
    schema.get("maxItems").is_some() && schema.get("maxItems") == schema.get("minItems")
}

/// The schema of the values of a map, where it is one: an object without fields of its own.
pub fn map_values(schema: &Json) -> Option<&Json> {
    if schema.get("properties").is_some() {
        return None;
    }
    let by_pattern =
        schema.get("patternProperties").and_then(Json::as_object).and_then(|all| all.values().next());
    by_pattern.or_else(|| schema.get("additionalProperties").filter(|values| values.is_object()))
}

/// A number as a person writes it: very large and very small ones with their power of ten.
pub(super) fn figure(number: f64) -> String {
    let size = number.abs();
    if size == 0.0 || (1e-4..1e6).contains(&size) { format!("{number}") } else { format!("{number:e}") }
}

/// What a value may be, for a person.
pub fn domain(schema: &Json, unit: &str) -> String {
    let all = alternatives(schema);
    if all.len() > 1 {
        let mut parts: Vec<String> = Vec::new();
        for one in all {
            let part = match one.get("maxItems") {
                Some(count) if is_vector(one) => {
                    format!("{count} numbers {}", domain(one, unit)).trim().to_owned()
                }
                _ => domain(one, unit),
            };
            if !part.is_empty() && !parts.contains(&part) {
                parts.push(part);
            }
        }
        return parts.join(" | ");
    }
    let schema = all.first().copied().unwrap_or(schema);
    let words = words(schema);
    if !words.is_empty() {
        return words.iter().map(|(word, _)| *word).collect::<Vec<_>>().join(" | ");
    }
    let bound = |key: &str| schema.get(key).and_then(Json::as_f64);
    let unit = if unit.is_empty() || unit == "1" { String::new() } else { format!(" {unit}") };
    let range =
        match (bound("minimum"), bound("exclusiveMinimum"), bound("maximum"), bound("exclusiveMaximum")) {
            // Bounds that come from the type of an integer tell nobody anything.
            (Some(0.0), None, None | Some(255.0 | 65535.0), None) if kind(schema) == "integer" => {
                String::new()
            }
            (Some(low), None, Some(high), None) => format!("{} … {}{unit}", figure(low), figure(high)),
            (None, Some(low), Some(high), None) => format!("above {} to {}{unit}", figure(low), figure(high)),
            (Some(low), None, None, Some(high)) => format!("{} to below {}{unit}", figure(low), figure(high)),
            (None, Some(low), None, Some(high)) => {
                format!("above {}, below {}{unit}", figure(low), figure(high))
            }
            (Some(low), None, None, None) => format!("≥ {}{unit}", figure(low)),
            (None, Some(low), None, None) => format!("> {}{unit}", figure(low)),
            (None, None, Some(high), None) => format!("≤ {}{unit}", figure(high)),
            (None, None, None, Some(high)) => format!("< {}{unit}", figure(high)),
            _ => String::new(),
        };
    if range.is_empty() { unit.trim().to_owned() } else { range }
}
