//! The keys of a stage's section: those of all of its methods together.

use std::collections::BTreeMap;
use std::sync::{Mutex, PoisonError};

use ivd_core::op::{Field, Method, Stage, alternatives, fields, kind};
use serde_json::{Map, Value as Json, json};

/// A key of a stage's section.
#[derive(Debug, Clone, PartialEq)]
pub struct Key {
    /// Its name.
    pub name: String,
    /// What it may be, for some method.
    pub schema: Json,
    /// What it means, for all methods that read it, or for some and for others.
    pub says: Vec<Said>,
}

/// What a key means to some methods.
#[derive(Debug, Clone, PartialEq)]
pub struct Said {
    /// The methods.
    pub methods: Vec<&'static str>,
    /// What it is, in plain words.
    pub about: String,
    /// What it is where it isn't given.
    pub default: Option<Json>,
    /// What it may be.
    pub schema: Json,
}

impl Key {
    /// The key as a field.
    pub fn field(&self) -> Field<'_> {
        Field { name: &self.name, schema: &self.schema }
    }

    /// Whether every method of its stage reads it, and means the same by it.
    pub fn is_of_all(&self, stage: &Stage) -> bool {
        matches!(&self.says[..], [one] if one.methods.len() == stage.methods.len())
    }
}

/// The keys of a stage's section, each once, in the order in which its methods declare them. They are put together once: a command line
/// asks for them three times.
pub fn keys(stage: &'static Stage) -> &'static [Key] {
    static MADE: Mutex<BTreeMap<usize, &'static [Key]>> = Mutex::new(BTreeMap::new());
    let mut made = MADE.lock().unwrap_or_else(PoisonError::into_inner);
    // No name: a test's own stage may have that of one of the list.
    made.entry(std::ptr::from_ref(stage).addr())
        .or_insert_with(|| Box::leak(together(stage.methods).into_boxed_slice()))
}

/// The keys of one method alone, in the order in which it declares them: a schema is made of no other.
pub fn keys_of(method: &Method) -> Vec<Key> {
    together(std::slice::from_ref(method))
}

fn together(methods: &[Method]) -> Vec<Key> {
    let mut all: Vec<Key> = Vec::new();
    for method in methods {
        for field in fields((method.schema)()) {
            let (about, default) = (field.about(), field.default());
            let said = || Said {
                methods: vec![method.name],
                about: about.to_owned(),
                default: default.cloned(),
                schema: field.schema.clone(),
            };
            let Some(key) = all.iter_mut().find(|key| key.name == field.name) else {
                all.push(Key {
                    name: field.name.to_owned(),
                    schema: field.schema.clone(),
                    says: vec![said()],
                });
                continue;
            };
            widen(&mut key.schema, field.schema);
            match key.says.iter_mut().find(|said| said.about == about && said.default.as_ref() == default) {
                Some(said) => said.methods.push(method.name),
                None => key.says.push(said()),
            }
        }
    }
    for key in &mut all {
        if let ([_, _, ..], Some(schema)) = (&key.says[..], key.schema.as_object_mut()) {
            // What is true of one method only is said with its name.
            schema.remove("description");
            if key.says.iter().any(|said| said.default != key.says[0].default) {
                schema.remove("default");
            }
        }
    }
    all
}

/// Lets a schema be what another may be too.
fn widen(schema: &mut Json, other: &Json) {
    if schema == other {
        return;
    }
    let mut all: Vec<Json> = alternatives(schema).into_iter().map(shape).collect();
    for one in alternatives(other).into_iter().map(shape) {
        if all.contains(&one) {
            continue;
        }
        match all.iter_mut().find(|known| is_number(known) && kind(known) == kind(&one)) {
            Some(known) => hull(known, &one),
            None => all.push(one),
        }
    }
    let nullable = ivd_core::op::is_nullable(schema) || ivd_core::op::is_nullable(other);
    let mut wide: Map<String, Json> = schema.as_object().cloned().unwrap_or_default();
    wide.retain(|key, _| key == "description" || key == "default" || key.starts_with("x-"));
    if nullable {
        all.push(json!({ "type": "null" }));
    }
    match &mut all[..] {
        [Json::Object(only)] => wide.append(only),
        _ => {
            wide.insert("anyOf".to_owned(), Json::Array(all));
        }
    }
    *schema = Json::Object(wide);
}

/// What a value may be, without what it means.
fn shape(schema: &Json) -> Json {
    let mut shape = schema.clone();
    if let Some(object) = shape.as_object_mut() {
        object.retain(|key, _| key != "default" && key != "description" && !key.starts_with("x-"));
        if let Some(Json::Array(kinds)) = object.get("type") {
            let kinds: Vec<Json> = kinds.iter().filter(|kind| *kind != "null").cloned().collect();
            let only = if let [only] = &kinds[..] { only.clone() } else { Json::Array(kinds) };
            object.insert("type".to_owned(), only);
        }
    }
    shape
}

fn is_number(schema: &Json) -> bool {
    matches!(kind(schema), "number" | "integer")
}

/// The smallest range that holds both.
fn hull(range: &mut Json, other: &Json) {
    let bound = |schema: &Json, key: &str| schema.get(key).and_then(Json::as_f64);
    for key in ["minimum", "exclusiveMinimum", "maximum", "exclusiveMaximum"] {
        let wider = match (bound(range, key), bound(other, key)) {
            (Some(a), Some(b)) if key.ends_with("aximum") => (b > a).then(|| other[key].clone()),
            (Some(a), Some(b)) => (b < a).then(|| other[key].clone()),
            _ => None,
        };
        if let Some(object) = range.as_object_mut() {
            match wider {
                Some(wider) => object.insert(key.to_owned(), wider),
                None if other.get(key).is_none() => object.remove(key),
                None => None,
            };
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_schema_that_is_widened_takes_what_either_took() {
        let mut k = json!({ "type": "integer", "minimum": 1, "maximum": 1024, "default": 4, "x-unit": "1" });
        let other = json!({
            "anyOf": [{ "type": "integer", "minimum": 1, "maximum": 256 }, { "type": "string", "const": "auto" }],
            "default": 4, "x-unit": "1",
        });
        widen(&mut k, &other);
        widen(&mut k, &json!({ "type": "integer", "minimum": 0, "maximum": 65535 }));
        assert_eq!((&k["default"], &k["x-unit"]), (&json!(4), &json!("1")));
        assert_eq!(k["anyOf"][1], json!({ "type": "string", "const": "auto" }));
        assert_eq!((&k["anyOf"][0]["minimum"], &k["anyOf"][0]["maximum"]), (&json!(0), &json!(65535)));
        let mut share = json!({ "type": ["number", "null"], "minimum": 0.5 });
        widen(&mut share, &json!({ "type": "number" }));
        assert_eq!(share, json!({ "anyOf": [{ "type": "number" }, { "type": "null" }] }));
    }
}
