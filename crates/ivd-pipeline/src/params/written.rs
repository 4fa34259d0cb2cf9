//! Values as words: `--margin 4`, `--chain 1,2`, `--handle 'pick=x,y,z;move=x,y,z;radius=r'`, `--material '4=young:2,poisson:0.3'`.
//! What a word means follows from the schema.

use serde_json::{Map, Value as Json};

use ivd_core::ParamError;
use ivd_core::op::{Field, alternatives, fields, is_vector, kind, map_values, words};

/// What one occurrence of a flag adds to a field: its value, the next elements of a list, the next entries of a map.
///
/// # Errors
/// What was written, and how to write it.
pub fn read_entry(before: Option<Json>, field: Field<'_>, text: &str) -> Result<Json, ParamError> {
    let new = read(field.schema, text)?;
    Ok(match (before, new) {
        (Some(Json::Array(mut list)), Json::Array(more)) if !is_vector(field.schema) => {
            list.extend(more);
            Json::Array(list)
        }
        (Some(Json::Object(mut map)), Json::Object(more)) if map_values(field.schema).is_some() => {
            for (key, value) in more {
                if map.insert(key.clone(), value).is_some() {
                    return Err(ParamError::at_itself(format!("`{key}` is there twice"), "give it once"));
                }
            }
            Json::Object(map)
        }
        (Some(_), _) => return Err(ParamError::at_itself("given twice", "give it once")),
        (None, new) => new,
    })
}

/// Reads a value. Whether it fits, [`check`](ivd_core::op::check()) tells.
///
/// # Errors
/// What was written, and how to write it.
pub fn read(schema: &Json, text: &str) -> Result<Json, ParamError> {
    let all = alternatives(schema);
    if words(schema).iter().any(|(word, _)| *word == text) {
        return Ok(Json::String(text.to_owned()));
    }
    let tagged = all.len() > 1 && all.iter().all(|one| kind(one) == "object");
    if tagged {
        return read_keys(&all, text);
    }
    // A number before a word: a word that means something is among the words.
    let order = ["integer", "number", "boolean", "array", "object", "string"];
    let rank = |one: &&&Json| order.iter().position(|kind_of| *kind_of == kind(one)).unwrap_or(order.len());
    let mut all: Vec<&&Json> = all.iter().collect();
    all.sort_by_key(rank);
    let mut problem = None;
    for one in &all {
        match read_one(one, text) {
            Ok(value) => return Ok(value),
            Err(found) => problem = problem.or(Some(found)),
        }
    }
    Err(problem.unwrap_or_else(|| ParamError::at_itself(format!("`{text}`"), "nothing can be given here")))
}

fn read_one(schema: &Json, text: &str) -> Result<Json, ParamError> {
    let text = text.trim();
    match kind(schema) {
        "number" => number(text),
        "integer" => {
            let read = text.parse::<i64>().map(Json::from).or_else(|_| text.parse::<u64>().map(Json::from));
            read.map_err(|_| ParamError::at_itself(format!("`{text}`"), "give a whole number"))
        }
        "boolean" => text
            .parse()
            .map(Json::Bool)
            .map_err(|_| ParamError::at_itself(format!("`{text}`"), "give true or false")),
        "array" => read_list(schema, text),
        "object" => match map_values(schema) {
            Some(values) => {
                let is_plain = kind(values) != "object";
                let form = if is_plain { "write CLASS=value" } else { "write CLASS=key:value,key:value" };
                let (key, entry) =
                    text.split_once('=').ok_or_else(|| ParamError::at_itself(format!("`{text}`"), form))?;
                let key = key.trim();
                let entry = if is_plain { read(values, entry) } else { read_pairs(values, entry) };
                Ok(Json::Object(Map::from_iter([(key.to_owned(), entry.map_err(|e| e.under(key))?)])))
            }
            None => read_keys(&[schema], text),
        },
        _ => Ok(Json::String(text.to_owned())),
    }
}

fn number(text: &str) -> Result<Json, ParamError> {
    if let Ok(whole) = text.parse::<i64>() {
        return Ok(whole.into());
    }
    let read =
        text.parse::<f64>().map_err(|_| ParamError::at_itself(format!("`{text}`"), "give a number"))?;
    serde_json::Number::from_f64(read)
        .map(Json::Number)
        .ok_or_else(|| ParamError::at_itself(format!("`{text}`"), "give a finite number"))
}

/// `1,2,3`; `640x480` where whole numbers are counted; `a:b,c:d` where each element is a list itself, or `a,b` for one; one element where each is an
/// object.
fn read_list(schema: &Json, text: &str) -> Result<Json, ParamError> {
    let Some(items) = schema.get("items") else { return Ok(Json::Array(Vec::new())) };
    let all = alternatives(items);
    let is = |wanted: &str| all.iter().all(|one| kind(one) == wanted);
    if is("object") {
        return Ok(Json::Array(vec![read(items, text)?]));
    }
    if is("array") {
        // One element alone.
        if !text.contains(':') {
            return Ok(Json::Array(vec![read_list(items, text)?]));
        }
        let inner = |part: &str| read_list(items, &part.replace(':', ","));
        return Ok(Json::Array(text.split(',').map(inner).collect::<Result<_, _>>()?));
    }
    let part = |part: &str| read(items, part);
    let list: Vec<Json> = if is("integer") && is_vector(schema) {
        text.split([',', 'x']).map(part).collect::<Result<_, _>>()?
    } else {
        text.split(',').map(part).collect::<Result<_, _>>()?
    };
    let wanted = schema.get("minItems").and_then(Json::as_u64);
    match wanted.filter(|n| is_vector(schema) && *n != list.len() as u64) {
        Some(wanted) => Err(ParamError::at_itself(
            format!("`{text}`"),
            format!("write {wanted} numbers with commas between them"),
        )),
        None => Ok(Json::Array(list)),
    }
}

/// `key=value;key=value` of an object, or of one of several that a key tells apart; `key.CLASS=a:b,c:d` for a map inside it. Where the
/// schema names two keys for it (`x-short`), `A=B` and `A` alone are their values.
fn read_keys(all: &[&Json], text: &str) -> Result<Json, ParamError> {
    let mut object = Map::new();
    let mut pairs = Vec::new();
    if let [schema] = all
        && let Some([first, second]) = short(schema)
        && fields(schema).all(|field| text.split('=').next().is_none_or(|key| key.trim() != field.name))
    {
        let (value, other) = text.split_once('=').map_or((text, None), |(value, other)| (value, Some(other)));
        let whole = match other {
            Some(other) => format!("{first}={value};{second}={other}"),
            None => format!("{first}={value}"),
        };
        return read_keys(all, &whole);
    }
    for part in text.split(';').filter(|part| !part.trim().is_empty()) {
        let pair = part
            .split_once('=')
            .ok_or_else(|| ParamError::at_itself(format!("`{part}`"), "write key=value"))?;
        pairs.push((pair.0.trim(), pair.1.trim()));
    }
    // The tag says which of several objects it is, and what its other keys mean.
    let told = |schema: &&&Json| {
        fields(schema).any(|field| {
            let word = field.schema.get("const").and_then(Json::as_str);
            word.is_some_and(|word| pairs.iter().any(|(key, value)| *key == field.name && *value == word))
        })
    };
    let candidates: Vec<&Json> = match all.iter().find(told) {
        Some(one) => vec![*one],
        None => all.to_vec(),
    };
    for (key, value) in pairs {
        let (name, class) = key.split_once('.').map_or((key, None), |(name, class)| (name, Some(class)));
        let field = candidates.iter().find_map(|schema| {
            fields(schema).find(|field| field.name == name || field.aliases().any(|alias| alias == name))
        });
        let value = match (field, class) {
            (None, _) => Json::String(value.to_owned()),
            (Some(field), None) => read(field.schema, value).map_err(|e| e.under(key))?,
            (Some(field), Some(class)) => {
                let values = map_values(field.schema).ok_or_else(|| {
                    ParamError::at_itself(format!("`{key}`"), format!("{name} doesn't go by class"))
                })?;
                let entry = read_pairs(values, value).map_err(|e| e.under(key))?;
                let map = object.entry(name).or_insert_with(|| Json::Object(Map::new()));
                if map.as_object_mut().is_some_and(|map| map.insert(class.to_owned(), entry).is_some()) {
                    return Err(ParamError::at_itself(format!("`{key}` is there twice"), "give it once"));
                }
                continue;
            }
        };
        if object.insert(key.to_owned(), value).is_some() {
            return Err(ParamError::at_itself(format!("`{key}` is there twice"), "give it once"));
        }
    }
    Ok(Json::Object(object))
}

/// The two keys whose values alone may be written for an object.
pub fn short(schema: &Json) -> Option<[&str; 2]> {
    let keys = schema.get("x-short")?.as_array()?;
    match &keys[..] {
        [first, second] => Some([first.as_str()?, second.as_str()?]),
        _ => None,
    }
}

/// `key:value,key:value`.
fn read_pairs(schema: &Json, text: &str) -> Result<Json, ParamError> {
    let mut object = Map::new();
    for part in text.split(',') {
        let (key, value) = part
            .split_once(':')
            .ok_or_else(|| ParamError::at_itself(format!("`{part}`"), "write key:value"))?;
        let key = key.trim();
        let value = match fields(schema).find(|field| field.name == key) {
            Some(field) => read(field.schema, value.trim()).map_err(|e| e.under(key))?,
            None => Json::String(value.trim().to_owned()),
        };
        if object.insert(key.to_owned(), value).is_some() {
            return Err(ParamError::at_itself(format!("`{key}` is there twice"), "give it once"));
        }
    }
    Ok(Json::Object(object))
}
