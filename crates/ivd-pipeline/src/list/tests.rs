//! What must hold of every field of every method.

use ivd_core::op::{
    Field, Method, Stage, alternatives, check, fields, is_default, kind, map_values, schema_of,
};
use serde_json::{Map, Value as Json, json};

use super::STAGES;
use crate::stages::{
    ClipFigures, CombineFigures, ImportFigures, ImportLabelsFigures, ImportMaskFigures,
    ImportTransferFigures, PutOntoFigures,
};
use crate::{Section, Stage as _};

fn methods() -> impl Iterator<Item = (&'static Stage, &'static Method)> {
    STAGES.iter().flat_map(|stage| stage.methods.iter().map(move |method| (*stage, method)))
}

/// Calls with every field of parameters and figures, and of what lies inside them: its place and itself.
fn each_field(schema: &Json, place: &str, visit: &mut impl FnMut(&str, Field<'_>)) {
    for one in alternatives(schema) {
        for field in fields(one) {
            let place = format!("{place}.{}", field.name);
            // The word that tells several objects apart says what it means where it stands.
            if field.schema.get("const").is_none() {
                visit(&place, field);
            }
            each_field(field.schema, &place, visit);
        }
        for inner in [map_values(one), one.get("items")].into_iter().flatten() {
            each_field(inner, place, visit);
        }
    }
}

fn all_fields(visit: &mut impl FnMut(&str, Field<'_>)) {
    for (stage, method) in methods() {
        let place = format!("{}.{}", stage.name, method.name);
        each_field((method.schema)(), &place, visit);
        each_field((method.figures)(), &format!("{place} figures"), visit);
    }
    let others = [
        schema_of::<ImportFigures>(),
        schema_of::<ImportLabelsFigures>(),
        schema_of::<ImportMaskFigures>(),
        schema_of::<ImportTransferFigures>(),
        schema_of::<PutOntoFigures>(),
        schema_of::<ClipFigures>(),
        schema_of::<CombineFigures>(),
    ];
    for figures in others {
        each_field(figures, &figures["title"].to_string(), visit);
    }
}

#[test]
fn every_field_is_documented_beyond_its_name() {
    all_fields(&mut |place, field| {
        let plain = |text: &str| text.to_lowercase().replace(|c: char| !c.is_alphanumeric(), "");
        let (about, name) = (plain(field.about()), plain(field.name));
        assert!(about.len() > 3 && about != name, "{place}: {}", field.about());
    });
    for (stage, method) in methods() {
        let about = (method.schema)()["description"].as_str().map_or(0, str::len);
        assert!(about > 10 && stage.about.len() > 10, "{} {}", stage.name, method.name);
    }
}

#[test]
fn every_number_has_a_unit() {
    all_fields(&mut |place, field| {
        let numbers = |schema: &Json| {
            let is_number = |one: &&Json| matches!(kind(one), "number" | "integer");
            let items =
                |one: &&Json| one.get("items").is_some_and(|items| alternatives(items).iter().any(is_number));
            alternatives(schema).iter().any(|one| is_number(one) || items(one))
        };
        assert!(!numbers(field.schema) || !field.unit().is_empty(), "{place} has no unit");
    });
}

#[test]
fn values_by_class_have_a_unit_and_a_range_of_their_own() {
    all_fields(&mut |place, field| {
        let values = alternatives(field.schema).into_iter().filter_map(map_values);
        for value in values.flat_map(alternatives) {
            let own = Field { name: "", schema: value };
            assert!(
                kind(value) == "object" || kind(value) == "string" || !own.unit().is_empty(),
                "{place}: a struct of the value, whose field says unit and range, or a type of its own that does"
            );
        }
    });
}

#[test]
fn every_default_lies_in_its_range() {
    for (stage, method) in methods() {
        for field in fields((method.schema)()) {
            let mut default = field
                .default()
                .cloned()
                .unwrap_or_else(|| panic!("{}.{} has no default", stage.name, field.name));
            let fits = check(&mut default, field.schema);
            assert_eq!(fits, Ok(()), "{}.{}.{}", stage.name, method.name, field.name);
        }
        Section::parse(stage, Some(chosen(stage, method))).unwrap();
    }
}

/// The keys that choose a method, and those that it can't do without; nothing else is said.
fn chosen(stage: &'static Stage, method: &Method) -> Map<String, Json> {
    let mut keys = Map::new();
    if !stage.selector.is_empty() {
        keys.insert(stage.selector.to_owned(), json!(method.name));
    }
    let schema = (method.schema)();
    for field in fields(schema) {
        match Section::parse(stage, Some(keys.clone())) {
            Err(problem) if problem.field == field.name => {
                keys.insert(field.name.to_owned(), others(field).pop().unwrap());
            }
            _ => {}
        }
    }
    keys
}

/// Values that a field may have, and that aren't its default.
fn others(field: Field<'_>) -> Vec<Json> {
    let mut tried = alternatives(field.schema).into_iter().flat_map(samples).collect::<Vec<_>>();
    tried.retain(|value| {
        let mut value = value.clone();
        check(&mut value, field.schema).is_ok() && !is_default(&value, field)
    });
    tried
}

fn other(field: Field<'_>) -> Option<Json> {
    others(field).into_iter().next()
}

fn samples(schema: &Json) -> Vec<Json> {
    let numbers =
        || [1, 2, 3, 8, 40].into_iter().map(Json::from).chain([0.25, 0.001, 12.5, 140.5].map(Json::from));
    if let Some(word) = schema.get("const") {
        return vec![word.clone()];
    }
    match kind(schema) {
        "number" | "integer" => numbers().collect(),
        "boolean" => vec![json!(true), json!(false)],
        "string" => {
            let words = ivd_core::op::words(schema);
            if words.is_empty() {
                vec![schema.pointer("/examples/0").cloned().unwrap_or(json!("a"))]
            } else {
                words.into_iter().map(|(word, _)| json!(word)).collect()
            }
        }
        "array" => {
            let count = schema.get("minItems").and_then(Json::as_u64).unwrap_or(1).max(1) as usize;
            let items =
                schema.get("items").map(|items| alternatives(items).into_iter().flat_map(samples).collect());
            let items: Vec<Json> = items.unwrap_or_default();
            items.into_iter().map(|item| Json::Array(vec![ascending(item); count])).collect()
        }
        "object" => {
            if let Some(values) = map_values(schema) {
                return samples(values).into_iter().map(|value| json!({ "3": value })).collect();
            }
            let full = fields(schema).filter_map(|field| Some((field.name.to_owned(), other(field)?)));
            vec![Json::Object(full.collect())]
        }
        _ => Vec::new(),
    }
}

/// A pair of equal numbers inside of a list as an interval that isn't empty.
fn ascending(item: Json) -> Json {
    match item.as_array().map(Vec::as_slice) {
        Some([low, high]) if low == high => match (low.as_i64(), low.as_f64()) {
            (Some(low), _) => json!([low, low + 1]),
            (None, Some(low)) => json!([low, low + 1.0]),
            (None, None) => item.clone(),
        },
        _ => item,
    }
}

#[test]
fn what_is_parsed_is_written_as_it_was_read_and_read_again_the_same() {
    for (stage, method) in methods() {
        for field in fields((method.schema)()) {
            let mut keys = chosen(stage, method);
            let value =
                other(field).unwrap_or_else(|| panic!("{}.{}: nothing to try", stage.name, field.name));
            keys.insert(field.name.to_owned(), value);
            let Ok(first) = Section::parse(stage, Some(keys)) else { continue };
            let Json::Object(canonical) = first.params() else { panic!("parameters are an object") };
            let again = Section::parse(stage, Some(canonical)).unwrap();
            assert_eq!(first.params(), again.params(), "{}.{}.{}", stage.name, method.name, field.name);
        }
    }
}

#[test]
fn whatever_says_what_the_result_is_changes_the_cache_key() {
    for (stage, method) in methods() {
        let plain = Section::parse(stage, Some(chosen(stage, method))).unwrap();
        for field in fields((method.schema)()) {
            let mut keys = chosen(stage, method);
            keys.insert(field.name.to_owned(), other(field).unwrap());
            let Ok(moved) = Section::parse(stage, Some(keys)) else { continue };
            let is_same = moved.identity() == plain.identity();
            assert_eq!(is_same, field.is_how(), "{}.{}.{}", stage.name, method.name, field.name);
        }
    }
}

#[test]
fn keys_of_nobody_and_of_other_methods_are_refused_by_name() {
    for (stage, method) in methods() {
        let mut keys = chosen(stage, method);
        keys.insert("nobodys_key".to_owned(), json!(1));
        let refused = Section::parse(stage, Some(keys)).unwrap_err();
        assert!(refused.field == "nobodys_key" && refused.problem.contains("unknown key"), "{refused:?}");
        let own = (method.schema)();
        for owner in stage.methods {
            for field in
                fields((owner.schema)()).filter(|field| fields(own).all(|own| own.name != field.name))
            {
                let mut keys = chosen(stage, method);
                keys.insert(field.name.to_owned(), other(field).unwrap());
                let refused = Section::parse(stage, Some(keys)).unwrap_err();
                assert_eq!(refused.field, field.name);
                assert!(refused.remedy.contains(owner.name), "{}: {refused:?}", stage.name);
                // What says nothing, to whoever reads it, is no mistake.
                let mut keys = chosen(stage, method);
                keys.insert(field.name.to_owned(), field.default().unwrap().clone());
                let readers = stage.methods.iter().flat_map(|method| fields((method.schema)()));
                let mut defaults = readers.filter(|own| own.name == field.name).map(Field::default);
                let says_nothing = defaults.all(|default| default == field.default());
                let parsed = Section::parse(stage, Some(keys));
                assert_eq!(parsed.is_ok(), says_nothing, "{}.{}", stage.name, field.name);
            }
        }
    }
}

#[test]
fn a_value_that_does_not_fit_is_refused_by_the_key_that_was_typed() {
    for (stage, method) in methods() {
        for field in fields((method.schema)()) {
            let mut keys = chosen(stage, method);
            keys.insert(field.name.to_owned(), json!({ "no": ["such", "thing"] }));
            let refused = Section::parse(stage, Some(keys)).unwrap_err();
            assert_eq!(refused.field.split('.').next(), Some(field.name), "{refused:?}");
        }
    }
}

#[test]
fn old_names_are_read_and_refused_beside_the_new() {
    for (stage, method) in methods() {
        for field in fields((method.schema)()) {
            for alias in field.aliases() {
                let value = other(field).unwrap();
                let (old, is_opposite) = (alias.trim_start_matches('!'), alias.starts_with('!'));
                let written = if is_opposite { json!(value == json!(false)) } else { value.clone() };
                let mut keys = chosen(stage, method);
                keys.insert(old.to_owned(), written);
                let read = Section::parse(stage, Some(keys.clone())).unwrap();
                let mut anew = chosen(stage, method);
                anew.insert(field.name.to_owned(), value.clone());
                let anew = Section::parse(stage, Some(anew)).unwrap();
                assert_eq!(read.params(), anew.params(), "{}.{old}", stage.name);
                keys.insert(field.name.to_owned(), value);
                let refused = Section::parse(stage, Some(keys)).unwrap_err();
                assert_eq!(refused.field, old, "{refused:?}");
            }
        }
    }
}

#[test]
fn what_changes_no_pixel_is_read_from_scenes_and_is_in_no_cache_key() {
    let render =
        |keys: Json| Section::parse(&ivd_render::STAGE, Some(keys.as_object().unwrap().clone())).unwrap();
    let [skipping, looking] = [json!({}), json!({ "skip": false })].map(render);
    assert_eq!([&skipping, &looking].map(|section| section.params()["skip"].clone()), [true, false]);
    assert_eq!(skipping.identity(), looking.identity());
    assert!(skipping.identity().get("skip").is_none());
}
