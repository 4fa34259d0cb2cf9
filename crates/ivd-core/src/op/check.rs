//! A value held against its schema: names, types, ranges, words. What doesn't fit is told with its place, and with what would.

use std::collections::BTreeSet;

use schemars::JsonSchema;
use serde::Serialize;
use serde_json::{Map, Value as Json};

use super::field::{Field, alternatives, domain, fields, figure, is_nullable, kind, map_values, words};
use super::finite::not_finite;
use super::schema::schema_of;
use crate::ParamError;

/// Holds parameters against the schema of their type: ranges, words, numbers that are finite.
///
/// # Errors
/// The first field that doesn't fit.
pub fn check_fields<T: Serialize + JsonSchema + 'static>(params: &T) -> Result<(), ParamError> {
    if let Some(field) = not_finite(params) {
        return Err(ParamError::new(field, "not a finite number", "give a finite number"));
    }
    let wrong = |e: serde_json::Error| ParamError::at_itself(e.to_string(), "give plain parameters");
    check(&mut serde_json::to_value(params).map_err(wrong)?, schema_of::<T>())
}

/// Writes old names as what they are called now, and holds the value against the schema.
///
/// # Errors
/// The first thing that doesn't fit.
pub fn check(value: &mut Json, schema: &Json) -> Result<(), ParamError> {
    check_unit(value, schema, schema.get("x-unit").and_then(Json::as_str).unwrap_or(""))
}

/// The elements of a list, and the numbers of a choice, have the unit of the whole.
fn check_unit(value: &mut Json, schema: &Json, unit: &str) -> Result<(), ParamError> {
    if value.is_null() {
        return if is_nullable(schema) { Ok(()) } else { Err(wrong(value, schema, unit)) };
    }
    let all = alternatives(schema);
    match all[..] {
        [one] => check_one(value, one, unit),
        _ => check_choice(value, schema, &all, unit),
    }
}

fn check_choice(value: &mut Json, schema: &Json, all: &[&Json], unit: &str) -> Result<(), ParamError> {
    // An object says by its tag which of them it is.
    if let Some(object) = value.as_object() {
        let tagged = |one: &&Json| tag(one).and_then(|(key, word)| Some(object.get(key)?.as_str()? == word));
        if let Some(one) = all.iter().find(|one| tagged(one) == Some(true)) {
            return check_one(value, one, unit);
        }
        if let Some((key, _)) = all.iter().find_map(|one| tag(one)) {
            let known: Vec<&str> = all.iter().filter_map(|one| tag(one)).map(|(_, word)| word).collect();
            return Err(match object.get(key) {
                None => ParamError::at_itself(
                    format!("{key} is missing"),
                    format!("give one of {}", known.join(", ")),
                ),
                Some(found) => unknown("word", &plain(found), known.iter().copied()).under(key),
            });
        }
    }
    let mut last = None;
    for one in all {
        let mut tried = value.clone();
        match check_one(&mut tried, one, unit) {
            Ok(()) => {
                *value = tried;
                return Ok(());
            }
            Err(problem) if fits_kind(value, one) => last = Some(problem),
            Err(_) => {}
        }
    }
    match last {
        Some(problem) if value.as_str().is_none() => Err(problem),
        _ => Err(wrong(value, schema, unit)),
    }
}

/// The key and the word that tell an alternative from the others.
fn tag(schema: &Json) -> Option<(&str, &str)> {
    fields(schema).find_map(|field| Some((field.name, field.schema.get("const")?.as_str()?)))
}

fn fits_kind(value: &Json, schema: &Json) -> bool {
    match kind(schema) {
        "number" => value.is_number(),
        "integer" => value.is_i64() || value.is_u64(),
        "boolean" => value.is_boolean(),
        "string" => value.is_string(),
        "array" => value.is_array(),
        "object" => value.is_object(),
        _ => true,
    }
}

fn check_one(value: &mut Json, schema: &Json, unit: &str) -> Result<(), ParamError> {
    if !fits_kind(value, schema) {
        return Err(wrong(value, schema, unit));
    }
    match value {
        Json::Number(number) => check_range(number.as_f64().unwrap_or(f64::NAN), value, schema, unit),
        Json::String(text) => {
            let known = words(schema);
            if known.is_empty() || known.iter().any(|(word, _)| word == text) {
                Ok(())
            } else {
                Err(wrong(value, schema, unit))
            }
        }
        Json::Array(list) => check_list(list, schema, unit),
        Json::Object(object) => match map_values(schema) {
            Some(values) => check_map(object, schema, values),
            None => check_object(object, schema),
        },
        Json::Null | Json::Bool(_) => Ok(()),
    }
}

fn check_range(number: f64, value: &Json, schema: &Json, unit: &str) -> Result<(), ParamError> {
    let bound = |key: &str| schema.get(key).and_then(Json::as_f64);
    let fits = bound("minimum").is_none_or(|least| number >= least)
        && bound("exclusiveMinimum").is_none_or(|least| number > least)
        && bound("maximum").is_none_or(|most| number <= most)
        && bound("exclusiveMaximum").is_none_or(|most| number < most)
        && schema.get("format").and_then(Json::as_str).and_then(widest).is_none_or(|most| number <= most);
    if fits { Ok(()) } else { Err(wrong(value, schema, unit)) }
}

/// The largest number that a whole number of a format can be.
fn widest(format: &str) -> Option<f64> {
    match format {
        "uint8" => Some(u8::MAX.into()),
        "uint16" => Some(u16::MAX.into()),
        "uint32" => Some(u32::MAX.into()),
        "int32" => Some(i32::MAX.into()),
        _ => None,
    }
}

fn check_list(list: &mut [Json], schema: &Json, unit: &str) -> Result<(), ParamError> {
    let length = |key: &str| schema.get(key).and_then(Json::as_u64).map(|n| n as usize);
    let (least, most) = (length("minItems"), length("maxItems"));
    if least.is_some_and(|n| list.len() < n) || most.is_some_and(|n| list.len() > n) {
        let wanted = match (least, most) {
            (Some(a), Some(b)) if a == b => format!("{a}"),
            (least, most) => {
                format!("{} to {}", least.unwrap_or(0), most.map_or("any".to_owned(), |n| n.to_string()))
            }
        };
        return Err(ParamError::at_itself(format!("{} values", list.len()), format!("give {wanted}")));
    }
    let Some(items) = schema.get("items") else { return Ok(()) };
    let own = items.get("x-unit").and_then(Json::as_str).unwrap_or(unit);
    for (i, item) in list.iter_mut().enumerate() {
        check_unit(item, items, own).map_err(|problem| problem.under(&i.to_string()))?;
    }
    Ok(())
}

fn check_map(object: &mut Map<String, Json>, schema: &Json, values: &Json) -> Result<(), ParamError> {
    // Maps go by class: other keys have no pattern.
    let by_number = schema.get("patternProperties").is_some();
    let mut classes = BTreeSet::new();
    for (key, value) in object {
        if by_number {
            let Ok(class) = key.parse::<u16>() else {
                let remedy = "name a class by its number, 0 to 65535";
                return Err(ParamError::at_itself("not a class", remedy).under(key));
            };
            if !classes.insert(class) {
                return Err(ParamError::at_itself("the class is named twice", "name it once").under(key));
            }
        }
        check_unit(value, values, "").map_err(|problem| problem.under(key))?;
    }
    Ok(())
}

fn check_object(object: &mut Map<String, Json>, schema: &Json) -> Result<(), ParamError> {
    rename(object, schema)?;
    for (key, value) in object.iter_mut() {
        let Some(field) = fields(schema).find(|field| field.name == key) else {
            let known = fields(schema).map(|field| field.name);
            return Err(unknown("key", key, known).under(key));
        };
        check_unit(value, field.schema, field.unit()).map_err(|problem| problem.under(key))?;
    }
    let required =
        schema.get("required").and_then(Json::as_array).into_iter().flatten().filter_map(Json::as_str);
    for key in required {
        if !object.contains_key(key) {
            return Err(ParamError::at_itself(format!("{key} is missing"), "give it"));
        }
    }
    Ok(())
}

/// Old names become what they are called now.
///
/// # Errors
/// A field that is given by both of its names.
pub fn rename(object: &mut Map<String, Json>, schema: &Json) -> Result<(), ParamError> {
    for field in fields(schema) {
        for alias in field.aliases() {
            let old = alias.trim_start_matches('!');
            let Some(value) = object.remove(old) else { continue };
            let value = match value {
                Json::Bool(truth) if alias.starts_with('!') => Json::Bool(!truth),
                value => value,
            };
            if object.insert(field.name.to_owned(), value).is_some() {
                let text = format!("the old name of {}, which is given too", field.name);
                return Err(ParamError::at_itself(text, "keep one of them").under(old));
            }
        }
    }
    Ok(())
}

/// A problem of a word or a key that isn't known, with the nearest known one.
pub fn unknown<'a>(what: &str, found: &str, known: impl Iterator<Item = &'a str>) -> ParamError {
    let known: Vec<&str> = known.collect();
    let short: String = found.chars().take(200).collect();
    let near = known
        .iter()
        .map(|word| (strsim::damerau_levenshtein(&short, word), *word))
        .filter(|(distance, word)| *distance <= word.len().max(3) / 2)
        .min();
    let remedy = match near {
        Some((_, word)) => format!("did you mean `{word}`?"),
        None if known.is_empty() => "there is none".to_owned(),
        None => format!("there are {}", known.join(", ")),
    };
    ParamError::at_itself(format!("unknown {what} `{short}`"), remedy)
}

/// A value as a person writes it, not at length.
fn plain(value: &Json) -> String {
    let number = value.as_f64().filter(|_| value.is_f64()).map(figure);
    let text = number.unwrap_or_else(|| value.as_str().map_or_else(|| value.to_string(), str::to_owned));
    if text.chars().count() <= 80 { text } else { text.chars().take(80).chain(['…']).collect() }
}

/// A value that doesn't fit, with what does.
fn wrong(value: &Json, schema: &Json, unit: &str) -> ParamError {
    let of_unit =
        if unit.is_empty() || unit == "1" || !value.is_number() { String::new() } else { format!(" {unit}") };
    let all = alternatives(schema);
    let known: Vec<&str> = words(schema).into_iter().map(|(word, _)| word).collect();
    let only_words = all.iter().all(|one| !words(one).is_empty());
    if let (Some(text), true) = (value.as_str(), only_words && !known.is_empty()) {
        return unknown("word", text, known.into_iter());
    }
    let mut wanted: Vec<&str> = Vec::new();
    for one in &all {
        let name = match kind(one) {
            "number" => "a number",
            "integer" => "a whole number",
            "boolean" => "true or false",
            "array" => "a list",
            "object" => "a table of keys",
            _ => "a word",
        };
        if !wanted.contains(&name) {
            wanted.push(name);
        }
    }
    let range = domain(schema, unit);
    let range = if range.is_empty() { range } else { format!(", {range}") };
    // A number in quotes looks like one without them.
    let quote = if value.is_string() && !wanted.contains(&"a word") { "\"" } else { "" };
    ParamError::at_itself(
        format!("{quote}{}{quote}{of_unit}", plain(value)),
        format!("give {}{range}", wanted.join(" or ")),
    )
}

/// Whether a value is what a field has where nothing is said.
pub fn is_default(value: &Json, field: Field<'_>) -> bool {
    let same = |a: &Json, b: &Json| a == b || a.as_f64().zip(b.as_f64()).is_some_and(|(a, b)| a == b);
    match (field.default(), value) {
        (Some(Json::Array(a)), Json::Array(b)) => {
            a.len() == b.len() && a.iter().zip(b).all(|(a, b)| same(a, b))
        }
        (Some(default), value) => same(default, value),
        (None, _) => false,
    }
}
