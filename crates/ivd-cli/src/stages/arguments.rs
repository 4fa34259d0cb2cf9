//! The arguments of a stage's command, and their help.

use std::path::PathBuf;

use clap::builder::{PossibleValue, PossibleValuesParser};
use clap::{Arg, ArgAction, Command};
use ivd_core::Kind;
use ivd_core::op::{Field, Method, Stage, alternatives, fields, is_vector, kind, map_values, words};
use ivd_pipeline::list::Key;
use ivd_pipeline::params::short;
use serde_json::Value as Json;

use super::hooks::hooks;
use super::offer::Offer;
use super::precursor;
use crate::files::kinds_of;
use crate::parse::flag;

/// Slots that some method has, each once.
pub(super) fn slots(stage: &Stage) -> Vec<&'static str> {
    let mut all: Vec<&'static str> = stage.positional.to_vec();
    for slot in stage.methods.iter().flat_map(|method| method.slots) {
        if !all.contains(&slot.name) {
            all.push(slot.name);
        }
    }
    all
}

/// Whether every method that has a slot works without it.
fn is_optional(stage: &Stage, slot: &str) -> bool {
    stage.methods.iter().flat_map(|method| method.slots).all(|own| own.name != slot || own.optional)
}

/// The command of a stage with what it may be given.
pub(super) fn with_arguments(mut command: Command, offer: &Offer) -> Command {
    let stage = offer.stage;
    let precursor = precursor::of(stage);
    // What is a key too is a flag of both.
    let is_key = |slot: &&str| offer.keys.iter().any(|key| key.name == *slot);
    for slot in slots(stage).into_iter().filter(|slot| !is_key(slot)) {
        let file = Arg::new(slot).value_parser(clap::value_parser!(PathBuf)).help(slot_help(stage, slot));
        let is_positional = stage.positional.contains(&slot);
        let file = if is_positional {
            file.value_name(slot.to_uppercase())
        } else {
            file.long(flag(slot)).value_name("FILE")
        };
        command = command.arg(match precursor {
            Some(precursor) => precursor.argument(file, slot, is_positional),
            None => file.required(is_positional && !is_optional(stage, slot)),
        });
    }
    if let Some(precursor) = precursor {
        command = command.arg(precursor.keeper());
    }
    if !stage.selector.is_empty() {
        let named = |method: &Method| {
            if !offer.is_whole {
                return PossibleValue::new(method.name);
            }
            let schema = (method.schema)();
            let about = schema.get("description").and_then(Json::as_str).unwrap_or("").to_owned();
            PossibleValue::new(method.name).help(first_sentence(&about).to_owned())
        };
        let default = stage.methods.first().map_or("", |method| method.name);
        let words = PossibleValuesParser::new(stage.methods.iter().map(named));
        let mut about = format!("Method. Default: {default}");
        for Method { name, without, .. } in stage.methods.iter().filter(|method| !method.without.is_empty()) {
            about = format!("{about}, {name} without --{without}");
        }
        command = command.arg(
            Arg::new(stage.selector)
                .long(flag(stage.selector))
                .value_name(stage.selector.to_uppercase())
                .value_parser(words)
                .help(about),
        );
    }
    for found in &offer.keys {
        command = command.args(arguments(stage, found));
    }
    let is_picture = stage.methods.iter().any(|method| method.output == Some(Kind::Image));
    let (form, about) = if is_picture {
        (
            "OUTPUT",
            "Picture by its ending: .png or .apng (animated where there are several), .gif, .exr (its light), or .ivd for an image artefact",
        )
    } else {
        ("FILE.ivd", "Artefact file")
    };
    command = command.args((hooks(stage).flags)());
    command.arg(
        Arg::new("output")
            .short('o')
            .long("output")
            .value_name(form)
            .value_parser(clap::value_parser!(PathBuf))
            .required(true)
            .help(about),
    )
}

/// What a file for a slot may hold.
fn slot_help(stage: &Stage, slot: &str) -> String {
    let kinds = slot_kinds(stage, slot);
    let about = match slot {
        "blocked" => "Voxels that no seed may take",
        "part" => "The part to edit",
        "other" => "What the part is combined with",
        "after" => "The displacement to go on from",
        "framing" => "A displacement that the camera leaves room for, without showing it",
        "whole" => "The volume that camera and window go by, instead of the one that is shown",
        _ if kinds.starts_with(slot) => return upper(&kinds),
        _ => &upper(slot),
    };
    format!("{about}: {kinds}")
}

/// Kinds that fill a slot. A volume may lie in a file of any format, and so may labels or a mask that another program drew, where a volume
/// isn't what such a file is read as.
fn slot_kinds(stage: &Stage, slot: &str) -> String {
    let kinds = kinds_of(stage, slot);
    let foreign = |kind: Kind| match kind {
        Kind::Volume | Kind::Transfer => " or file",
        Kind::Labels | Kind::Mask if !kinds.contains(&Kind::Volume) => " or volume file",
        Kind::Labels
        | Kind::Mask
        | Kind::Lattice
        | Kind::Octree
        | Kind::Motion
        | Kind::Displacement
        | Kind::Image
        | Kind::Tree => "",
    };
    let kinds: Vec<String> =
        kinds.iter().map(|kind| format!("{} artefact{}", kind.name(), foreign(*kind))).collect();
    kinds.join(", ")
}

/// The flags of a command that are neither keys nor inputs of its stage: the command, the flag, and why it is none of them.
#[cfg(test)]
const EXTRA: [(&str, &str, &str); 6] = [
    ("segment", "posteriors-out", "volumes beside the labels, as many as there are components"),
    ("segment", "tree-out", "what the labels are cut from, kept too"),
    ("lattice", "parts", "it gives a lattice for each label, where a stage gives one value"),
    ("lattice", "mesh", "a file of another program stands in for the stage's work"),
    ("lattice", "weld", "how that file is taken"),
    ("lattice", "allow_open", "how that file is taken"),
];

/// The flag of a field, and hidden ones for names that it had before.
fn arguments(stage: &Stage, found: &Key) -> Vec<Arg> {
    let field = found.field();
    let mut arg = Arg::new(found.name.clone()).long(flag(field.name)).help(help(stage, found));
    let whole = alternatives(field.schema);
    let is = |wanted: &str| whole.iter().all(|one| kind(one) == wanted);
    if is("boolean") {
        arg = arg.num_args(0..=1).default_missing_value("true").value_name("true|false");
    } else if slots(stage).contains(&field.name) {
        let own = words(field.schema).into_iter().map(|(word, _)| word).collect::<Vec<_>>().join("|");
        let own = if own.is_empty() { form(field) } else { own };
        arg = arg.value_name(format!("{own}|FILE")).allow_hyphen_values(words(field.schema).is_empty());
    } else if is("string") && !words(field.schema).is_empty() {
        let known = words(field.schema)
            .into_iter()
            .map(|(word, about)| PossibleValue::new(word.to_owned()).help(first_sentence(about).to_owned()));
        arg = arg.value_name(field.name.to_uppercase()).value_parser(PossibleValuesParser::new(known));
    } else {
        arg = arg.value_name(form(field)).allow_hyphen_values(!is("string"));
    }
    arg = arg.action(if repeats(field) { ArgAction::Append } else { ArgAction::Set });
    let old = |alias: &str| {
        let name = alias.trim_start_matches('!');
        arg.clone().id(alias.to_owned()).long(flag(name)).hide(true)
    };
    let mut all: Vec<Arg> = field.aliases().map(old).collect();
    all.insert(0, arg);
    all
}

/// Whether a flag may be given several times: a list of things, a map.
fn repeats(field: Field<'_>) -> bool {
    map_values(field.schema).is_some() || (kind(field.schema) == "array" && !is_vector(field.schema))
}

/// What is written for a value.
fn form(field: Field<'_>) -> String {
    let unit = match field.unit() {
        "" | "1" => None,
        unit => Some(unit),
    };
    let one = alternatives(field.schema);
    let Some(schema) = one.first() else { return "VALUE".to_owned() };
    if let Some(values) = map_values(schema) {
        let example = values.pointer("/examples/0").and_then(Json::as_str);
        return match kind(values) {
            "object" => "CLASS=key:value,…".to_owned(),
            _ => format!("CLASS={}", example.unwrap_or("N")),
        };
    }
    match kind(schema) {
        "array" if one.len() == 1 => list_form(schema),
        "object" => "key=value;…".to_owned(),
        _ if one.len() > 1 => {
            let form = |one: &&Json| match kind(one) {
                "string" => words(one).iter().map(|(word, _)| *word).collect::<Vec<_>>().join("|"),
                "array" => list_form(one),
                _ => unit.unwrap_or("N").to_owned(),
            };
            one.iter().map(form).collect::<Vec<_>>().join("|")
        }
        _ => match unit {
            None => "N".to_owned(),
            Some(unit) if unit.contains(' ') => "VALUE".to_owned(),
            Some(unit) => unit.to_owned(),
        },
    }
}

/// What is written for a list.
fn list_form(schema: &Json) -> String {
    let count = schema.get("maxItems").and_then(Json::as_u64).unwrap_or(0);
    let items = |wanted: &str| {
        let items = schema.get("items");
        items.is_some_and(|items| alternatives(items).iter().all(|one| kind(one) == wanted))
    };
    let (object, whole) = (items("object"), items("integer"));
    match count {
        2 if whole => "WxH".to_owned(),
        2 => "a,b".to_owned(),
        3 => "x,y,z".to_owned(),
        4 => "r,g,b,a".to_owned(),
        _ if object => short_form(schema) + "key=value;…",
        _ => "N,N…".to_owned(),
    }
}

/// What may be written for the things of a list without their keys, where that is so.
fn short_form(list: &Json) -> String {
    let things = list.get("items").map_or_else(Vec::new, alternatives);
    let [thing] = things[..] else { return String::new() };
    let Some([first, second]) = short(thing) else { return String::new() };
    let of = fields(thing).find(|field| field.name == first).map_or_else(String::new, form);
    format!("{of}={second}|")
}

/// What a flag's help says: the field's own doc, what it may be, what it is where it isn't given.
fn help(stage: &Stage, found: &Key) -> String {
    let field = found.field();
    let default = |default: Option<&Json>| match default {
        None | Some(Json::Null) => String::new(),
        Some(Json::Array(list)) if list.is_empty() => String::new(),
        Some(Json::Object(map)) if map.is_empty() => String::new(),
        Some(default) => {
            format!(" [default: {}]", default.as_str().map_or_else(|| default.to_string(), str::to_owned))
        }
    };
    let said = found.says.iter().map(|said| {
        let whose = if said.methods.len() < stage.methods.len() {
            format!("{}: ", said.methods.join(", "))
        } else {
            String::new()
        };
        let own = if field.default().is_none() { default(said.default.as_ref()) } else { String::new() };
        let about = said.about.trim_end_matches('.').replace('\n', " ");
        format!("{whose}{about}{}{own}", keys(&said.schema))
    });
    let text = said.collect::<Vec<_>>().join("; ");
    let domain = field.domain();
    let domain = if words_alone(field) || domain.is_empty() { String::new() } else { format!(" [{domain}]") };
    let file = if slots(stage).contains(&field.name) {
        format!(". FILE: {}", slot_kinds(stage, field.name))
    } else {
        String::new()
    };
    format!("{text}{domain}{}{file}", default(field.default()))
}

/// Whether a flag takes words and nothing else: help lists them by themselves.
fn words_alone(field: Field<'_>) -> bool {
    alternatives(field.schema).iter().all(|one| !words(one).is_empty())
}

/// The keys of the things that a flag lists, or of what it says of a class; where a word tells several kinds apart, those that all
/// have, and then those of each.
fn keys(schema: &Json) -> String {
    let things = schema.get("items").or_else(|| map_values(schema));
    let all = things.map_or_else(Vec::new, alternatives);
    if all.is_empty() || !all.iter().all(|one| kind(one) == "object") {
        return String::new();
    }
    let word =
        |field: Field<'_>| Some((field.name.to_owned(), field.schema.get("const")?.as_str()?.to_owned()));
    let own = |one: &Json| -> Vec<String> {
        fields(one).filter(|field| word(*field).is_none()).map(|field| field.name.to_owned()).collect()
    };
    let shared: Vec<String> =
        own(all[0]).into_iter().filter(|key| all.iter().all(|one| own(one).contains(key))).collect();
    let mut parts: Vec<String> = (!shared.is_empty()).then(|| shared.join(", ")).into_iter().collect();
    for one in all {
        let Some((key, word)) = fields(one).find_map(word) else { continue };
        let own: Vec<String> = own(one).into_iter().filter(|key| !shared.contains(key)).collect();
        parts.push(format!("{key}={word}: {}", own.join(", ")));
    }
    format!(". Keys: {}", parts.join("; "))
}

fn first_sentence(text: &str) -> &str {
    text.split_once(". ").map_or(text, |(first, _)| first).trim_end_matches('.')
}

fn upper(slot: &str) -> String {
    let mut letters = slot.chars();
    letters.next().map_or_else(String::new, |first| first.to_uppercase().chain(letters).collect())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_flag_is_a_key_an_input_the_output_or_on_the_list() {
        for stage in super::super::declared() {
            let offer = Offer::whole(stage);
            let command = with_arguments(Command::new(stage.name), &offer);
            let keys = &offer.keys;
            for arg in command.get_arguments() {
                let id = arg.get_id().as_str();
                let is_key =
                    keys.iter().any(|key| key.name == id || key.field().aliases().any(|old| old == id));
                let is_listed = EXTRA.iter().any(|(command, flag, _)| (*command, *flag) == (stage.name, id));
                let is_known =
                    is_key || slots(stage).contains(&id) || [stage.selector, "output"].contains(&id);
                assert!(is_known != is_listed, "{} {id}", stage.name);
            }
        }
    }
}
