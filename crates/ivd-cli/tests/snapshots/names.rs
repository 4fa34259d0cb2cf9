//! Every key of a scene, every flag and every value that could be written when fixtures/snapshots/old-names.json was made.
//! Who has written them in a scene or a script may go on doing so.

use std::path::Path;

use serde_json::{Map, Value, json};

use crate::snapshots::{help, ivd, snapshots, words, writing};

/// Flags that no help page shows, by command.
const HIDDEN: [(&str, &str); 3] = [("", "--no-simd"), ("bench", "--plant"), ("boundary", "--keep-holes")];

/// Keys that methods which came later have too, with another default: who names no method has the old one.
const NEWER_DEFAULTS: [&str; 1] = ["/scene/boundary.fill_holes/default"];

/// Names as they are now.
///
/// - `scene`: by path (`deform.handle[].pick`, `map.material.*.poisson`): `types` as JSON has them, `values` where it is a word
///   of a list, `required` where the section can't be without it, else its `default`.
/// - `commands`: by name (`cache prune`): `arguments` by place, and `flags`, of each what it `takes` where it takes something,
///   and `values` and `default` where they are told. The flags of every command are those of the empty name.
fn now() -> Value {
    let schema = ivd(Path::new("."), &words("schema")).out;
    let schema: Value = serde_json::from_str(&schema).unwrap();
    let mut scene = Map::new();
    members(&schema, &schema, "", &mut scene);
    let mut commands: Map<String, Value> =
        help::pages().into_iter().map(|(name, page)| (name.clone(), command(&name, &page))).collect();
    let everywhere = commands[""]["flags"].as_object().unwrap().clone();
    for (_, of) in commands.iter_mut().filter(|(name, _)| !name.is_empty()) {
        of["flags"].as_object_mut().unwrap().retain(|flag, told| everywhere.get(flag) != Some(told));
    }
    json!({ "scene": scene, "commands": commands })
}

/// The properties of a section, and of those below it.
fn members(section: &Value, schema: &Value, path: &str, found: &mut Map<String, Value>) {
    let required = |key: &str| section["required"].as_array().is_some_and(|l| l.iter().any(|k| k == key));
    for (key, property) in section["properties"].as_object().into_iter().flatten() {
        let path = if path.is_empty() { key.clone() } else { format!("{path}.{key}") };
        describe(property, schema, &path, required(key), found);
    }
    // What goes by class has a key for each, by any name or by a number.
    let by_pattern = section["patternProperties"].as_object().into_iter().flat_map(|all| all.values());
    let by_any = Some(&section["additionalProperties"]).filter(|values| values.is_object());
    for values in by_pattern.chain(by_any) {
        describe(values, schema, &format!("{path}.*"), false, found);
    }
}

/// A property with everything that it may be.
fn describe(property: &Value, schema: &Value, path: &str, required: bool, found: &mut Map<String, Value>) {
    let mut forms = Vec::new();
    alternatives(property, schema, &mut forms);
    let (mut types, mut values) = (Vec::new(), Vec::new());
    for form in &forms {
        match &form["type"] {
            Value::Array(several) => types.extend(several.iter().cloned()),
            Value::Null => panic!("{path}: {form} has no type"),
            one => types.push(one.clone()),
        }
        values.extend(form.get("const").cloned());
        values.extend(form["enum"].as_array().into_iter().flatten().cloned());
    }
    types.sort_by_key(Value::to_string);
    types.dedup();
    let mut told = json!({ "types": types });
    if !values.is_empty() {
        told["values"] = values.into();
    }
    if required {
        told["required"] = true.into();
    }
    if let Some(default) = property.get("default").filter(|d| !d.is_object()) {
        told["default"] = default.clone();
    }
    // A key that several alternatives have may be all that any of them says.
    match found.get_mut(path) {
        Some(before) => join(before, &told),
        None => drop(found.insert(path.to_owned(), told)),
    }
    for form in forms {
        members(form, schema, path, found);
        if form["items"].is_object() {
            let mut items = Vec::new();
            alternatives(&form["items"], schema, &mut items);
            if items.iter().any(|i| i["properties"].is_object() || i.get("const").is_some()) {
                describe(&form["items"], schema, &format!("{path}[]"), false, found);
            }
        }
    }
}

/// Adds what another alternative says of a key.
fn join(before: &mut Value, more: &Value) {
    for list in ["types", "values"] {
        let new: Vec<Value> = more[list].as_array().into_iter().flatten().cloned().collect();
        if let Some(all) = before[list].as_array_mut() {
            let new: Vec<Value> = new.into_iter().filter(|item| !all.contains(item)).collect();
            all.extend(new);
        } else if !new.is_empty() {
            before[list] = new.into();
        }
    }
    if more.get("required").is_none()
        && let Some(before) = before.as_object_mut()
    {
        before.remove("required");
    }
}

/// What a schema allows, references and alternatives followed.
fn alternatives<'a>(property: &'a Value, schema: &'a Value, found: &mut Vec<&'a Value>) {
    if let Some(name) = property["$ref"].as_str() {
        let target = schema.pointer(name.trim_start_matches('#')).unwrap();
        return alternatives(target, schema, found);
    }
    match property["anyOf"].as_array().or(property["oneOf"].as_array()) {
        Some(several) => several.iter().for_each(|one| alternatives(one, schema, found)),
        None => found.push(property),
    }
}

/// Arguments and flags of a help page.
fn command(name: &str, page: &str) -> Value {
    let usage = page.lines().find_map(|l| l.strip_prefix("Usage: ")).unwrap();
    let mut flags = Map::new();
    let mut last: Option<String> = None;
    for line in page.lines() {
        let text = line.trim_start();
        let indent = line.len() - text.len();
        if (text.starts_with("--") || (text.starts_with('-') && text[2..].starts_with(", --"))) && indent <= 6
        {
            let flag = text.split([' ', ',']).find(|w| w.starts_with("--")).unwrap();
            let flag = flag.trim_end_matches("...").to_owned();
            let takes =
                text.split_once('<').and_then(|(_, rest)| rest.split_once('>')).map(|(takes, _)| takes);
            flags.insert(flag.clone(), takes.map_or_else(|| json!({}), |takes| json!({ "takes": takes })));
            last = Some(flag);
        }
        let Some(told) = last.as_ref().and_then(|flag| flags.get_mut(flag)) else { continue };
        if let Some(default) = between(text, "[default: ", "]") {
            told["default"] = default.into();
        }
        if let Some(values) = between(text, "[possible values: ", "]") {
            told["values"] = values.split(", ").collect();
        }
        if let Some((value, _)) = text.strip_prefix("- ").and_then(|l| l.split_once(':')) {
            let values = told.as_object_mut().unwrap().entry("values").or_insert_with(|| json!([]));
            values.as_array_mut().unwrap().push(value.into());
        }
    }
    let hidden = HIDDEN.iter().filter(|(command, _)| *command == name);
    flags.extend(hidden.map(|(_, flag)| ((*flag).to_owned(), json!({ "hidden": true }))));
    let arguments: Vec<&str> = usage.split(' ').skip(1).filter(|w| is_argument(w)).collect();
    json!({ "arguments": arguments, "flags": flags })
}

fn is_argument(word: &str) -> bool {
    let word = word.trim_end_matches("...");
    let bare = word.trim_matches(['<', '>', '[', ']']);
    bare != word && bare.chars().all(|c| c.is_ascii_uppercase() || c == '_') && bare != "OPTIONS"
}

fn between<'a>(text: &'a str, before: &str, after: &str) -> Option<&'a str> {
    text.split_once(before)?.1.split_once(after).map(|(inside, _)| inside)
}

/// Whether two values are the same. Numbers that were kept in 32 bits were told with more digits than were meant; an argument that
/// had to be given need not be any more.
fn same(old: &Value, now: &Value) -> bool {
    let is_optional_now = |(old, now): (&str, &str)| {
        old.strip_prefix('<').and_then(|old| old.strip_suffix('>'))
            == now.strip_prefix('[').and_then(|now| now.strip_suffix(']'))
            && old.starts_with('<')
    };
    old == now
        || old.as_f64().zip(now.as_f64()).is_some_and(|(old, now)| old as f32 == now as f32)
        || old.as_str().zip(now.as_str()).is_some_and(is_optional_now)
}

/// Everything that was, beside what is now; lists may have grown.
fn missing(path: &str, old: &Value, now: &Value, found: &mut Vec<String>) {
    match (old, now) {
        (Value::Object(a), Value::Object(b)) => {
            for (key, value) in a {
                let path = format!("{path}/{key}");
                match b.get(key) {
                    // How help calls a value is no name that anyone writes.
                    Some(_) if key == "takes" => {}
                    // What isn't given had a value that no schema told.
                    Some(_) if key == "default" && value.is_null() => {}
                    None if key == "default" && value.is_null() => {}
                    Some(other) => missing(&path, value, other, found),
                    // Nor is there one where methods differ in it: each one's is told with what it means.
                    None if NEWER_DEFAULTS.contains(&&*path) => {}
                    None => found.push(path),
                }
            }
        }
        (Value::Array(a), Value::Array(b)) => {
            // Nothing at all can't be written in a scene.
            let gone = a.iter().filter(|item| !b.iter().any(|now| same(item, now)) && **item != "null");
            found.extend(gone.map(|item| format!("{path}: {item}")));
        }
        (a, b) if !same(a, b) => found.push(format!("{path}: {a}, now {b}")),
        _ => {}
    }
}

#[test]
fn whatever_could_be_written_still_can() {
    let file = snapshots().join("old-names.json");
    // Made once: what is added later isn't old.
    if writing() && !file.exists() {
        std::fs::create_dir_all(snapshots()).unwrap();
        std::fs::write(&file, crate::snapshots::masks::pretty(&now())).unwrap();
    }
    let old: Value = serde_json::from_str(&std::fs::read_to_string(file).unwrap()).unwrap();
    assert!(
        old["scene"].as_object().unwrap().len() > 150
            && old["commands"]["deform"]["flags"]["--handle"].is_object()
    );
    let mut gone = Vec::new();
    missing("", &old, &now(), &mut gone);
    assert!(gone.is_empty(), "{gone:#?}");
}
