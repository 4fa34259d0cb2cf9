//! What was written for a stage.

use std::path::{Path, PathBuf};

use clap::ArgMatches;
use ivd_core::ParamError;
use ivd_core::op::{Field, Method, Stage, fields, words};
use ivd_pipeline::Section;
use ivd_pipeline::list::{self, Key};
use ivd_pipeline::params::{place_landmarks, read_entry, with_landmarks};
use serde_json::{Map, Value as Json};

use super::arguments::slots;
use super::offer::Offer;
use super::precursor::Precursor;
use crate::context::Context;
use crate::exit::Failure;
use crate::parse::{flag, table_of};

/// What was written for a stage: in the file of `--params`, and on the command line.
pub(super) struct Typed {
    stage: &'static Stage,
    file: Option<PathBuf>,
    line: Map<String, Json>,
    keys: Map<String, Json>,
}

impl Typed {
    pub(super) fn read(offer: &Offer, matches: &ArgMatches, context: &Context) -> anyhow::Result<Self> {
        let stage = offer.stage;
        let file = context.global.params.clone();
        let mut keys = file.as_deref().map(table_of).transpose()?.unwrap_or_default();
        let beside = file.as_deref().and_then(Path::parent).unwrap_or(Path::new(""));
        place_landmarks(&mut keys.values_mut(), beside)?;
        let typed = typed(offer, matches)?;
        for (key, value) in typed.clone() {
            add(&mut keys, key, value);
        }
        let has = |slot: &str| file_of(offer, matches, slot).is_some();
        let with = |method: &&Method| !method.with.is_empty() && has(method.with);
        if let Some(method) = stage.methods.iter().find(with) {
            keys.entry(stage.selector).or_insert_with(|| Json::from(method.name));
        }
        let lacks = |method: &&Method| !method.without.is_empty() && !has(method.without);
        if let Some(method) = stage.methods.iter().find(lacks) {
            keys.entry(stage.selector).or_insert_with(|| Json::from(method.name));
        }
        Ok(Self { stage, file, line: typed, keys })
    }

    /// Gives a key a value where nothing was written for it.
    pub(super) fn imply(&mut self, key: &str, value: Json) {
        self.keys.entry(key).or_insert(value);
    }

    /// Whether a method was chosen, by its name or by what it alone reads.
    pub(super) fn is_method_chosen(&self) -> bool {
        self.keys.contains_key(self.stage.selector)
    }

    /// Where a key was given, for a message.
    fn place(&self, key: &str) -> String {
        match &self.file {
            Some(file) if !self.line.contains_key(key) => format!("--params {}: {key}", file.display()),
            _ => format!("--{}", flag(key)),
        }
    }

    /// The parameters.
    pub(super) fn section(self) -> anyhow::Result<Section> {
        Section::parse(self.stage, Some(self.keys)).map_err(|problem| {
            let first = problem.field.split('.').next().unwrap_or("");
            Failure::usage(match &self.file {
                _ if self.line.contains_key(first) => told(&problem),
                Some(file) => format!("--params {}: {}", file.display(), problem.told_of(self.stage.name)),
                None => problem.told_of(self.stage.name),
            })
        })
    }

    /// The parameters of going on from a result that is there. Keys that shape it would say nothing, even where they are the default:
    /// it may be another.
    pub(super) fn section_from(mut self, precursor: Precursor) -> anyhow::Result<Section> {
        let (stage, place) = (self.stage, precursor.place);
        let names = precursor.names();
        let chosen = self.keys.get(stage.selector).filter(|chosen| !names.iter().any(|name| *chosen == name));
        if let Some(chosen) = chosen {
            return Err(Failure::usage(format!(
                "{}: {chosen}, but --from-{} goes on from that of {}; leave it out, or start anew",
                self.place(stage.selector),
                place.variant,
                names.join(", "),
            )));
        }
        let schema = (precursor.method.schema)();
        if let Some(field) = fields(schema).find(|field| self.keys.contains_key(field.name)) {
            return Err(Failure::usage(format!(
                "{}: it shapes a {variant}, and that of --from-{variant} is built; leave it out, or build another {variant} with \
                 `ivd {} … --{} {} --{} … --{} {}`",
                self.place(field.name),
                stage.name,
                flag(stage.selector),
                names.join(" or "),
                flag(field.name),
                precursor.keeper_name(),
                place.gives.to_uppercase(),
                variant = place.variant,
            )));
        }
        if let Some(name) = names.first() {
            self.keys.entry(stage.selector).or_insert_with(|| Json::from(*name));
        }
        self.section()
    }
}

/// A problem of a flag.
fn told(problem: &ParamError) -> String {
    let (first, rest) = problem.field.split_once('.').unwrap_or((&problem.field, ""));
    let inner = ParamError { field: rest.to_owned(), ..problem.clone() };
    let flag = format!("--{}", flag(first));
    if rest.is_empty() { inner.told_of(&flag) } else { format!("{flag}: {}", inner.told_of("")) }
}

/// The keys that flags were given for.
fn typed(offer: &Offer, matches: &ArgMatches) -> anyhow::Result<Map<String, Json>> {
    let (stage, mut keys) = (offer.stage, Map::new());
    if !stage.selector.is_empty()
        && let Some(word) = matches.get_one::<String>(stage.selector)
    {
        keys.insert(stage.selector.to_owned(), Json::String(word.clone()));
    }
    for found in &offer.keys {
        let field = found.field();
        for name in std::iter::once(field.name).chain(field.aliases()) {
            let mut value = None;
            let is_slot = slots(stage).contains(&name);
            let all = matches.get_many::<String>(name).into_iter().flatten();
            let own = all.filter(|text| !is_slot || !is_file(field, text));
            let placed = own.map(|text| with_landmarks(text, Path::new("")));
            for text in placed.collect::<Result<Vec<_>, _>>()?.iter().flatten() {
                // What another method would take is read, and then refused by what this one takes.
                let of_any = || list::keys(stage).iter().find(|key| key.name == found.name).map(Key::field);
                let read = read_entry(value.clone(), field, text)
                    .or_else(|e| of_any().map_or(Err(e), |field| read_entry(value, field, text)))
                    .map_err(|e| Failure::usage(told(&e.under(name.trim_start_matches('!')))))?;
                value = Some(read);
            }
            if let Some(value) = value {
                keys.insert(name.trim_start_matches('!').to_owned(), value);
            }
        }
    }
    Ok(keys)
}

/// Puts a flag's value over that of the file: things and classes are added to those that the file has.
fn add(keys: &mut Map<String, Json>, key: String, value: Json) {
    let is_things = |list: &[Json]| list.iter().all(Json::is_object);
    match (keys.get_mut(&key), value) {
        (Some(Json::Array(list)), Json::Array(more)) if is_things(&more) && is_things(list) => {
            list.extend(more);
        }
        (Some(Json::Object(map)), Json::Object(more)) => map.extend(more),
        (_, value) => {
            keys.insert(key, value);
        }
    }
}

/// Whether what was written for a key that has a slot's name is a file for the slot.
fn is_file(field: Field<'_>, text: &str) -> bool {
    let words = words(field.schema);
    if words.is_empty() { !text.contains('=') } else { words.iter().all(|(word, _)| *word != text) }
}

/// What was written for a key that a slot has the name of; nothing of a flag that is one or the other.
fn shared<'a>(
    offer: &'a Offer,
    matches: &'a ArgMatches,
    name: &str,
) -> Option<impl Iterator<Item = &'a Path>> {
    let found = offer.keys.iter().find(|key| key.name == name)?;
    let field = found.field();
    let all = matches.get_many::<String>(name).into_iter().flatten();
    Some(all.filter(move |text| is_file(field, text)).map(Path::new))
}

/// The file that was given for a slot, or for another argument that takes one.
pub(super) fn file_of<'a>(offer: &'a Offer, matches: &'a ArgMatches, name: &str) -> Option<&'a Path> {
    match shared(offer, matches, name) {
        Some(mut files) => files.next(),
        None => matches.get_one::<PathBuf>(name).map(PathBuf::as_path),
    }
}

/// Refuses what was written for a slot with the name of a key, where the method doesn't have that slot: a value of another method's key,
/// and a file where no method was chosen.
pub(super) fn check_unread(
    stage: &'static Stage,
    method: &Method,
    slot: &str,
    file: Option<&Path>,
    is_method_chosen: bool,
) -> anyhow::Result<()> {
    // The keys of all methods last: putting them together takes longer than some stages do.
    let is_key = || list::keys(stage).iter().any(|key| key.name == slot);
    let is_read = |file: &Path| method.has_slot(slot) || (is_method_chosen && file.exists());
    let refused = |file: &Path| !is_read(file) && is_key();
    if !file.is_some_and(refused) {
        return Ok(());
    }
    let readers: Vec<&str> =
        stage.methods.iter().filter(|method| method.has_slot(slot)).map(|own| own.name).collect();
    Err(Failure::usage(format!(
        "--{}: {} doesn't read it; leave it out, or choose --{} {}",
        flag(slot),
        method.name,
        flag(stage.selector),
        readers.join(" or ")
    )))
}

/// Refuses what is neither a value of a key nor a file for the slot of its name, and a second file.
pub(super) fn check_shared(offer: &Offer, matches: &ArgMatches, slot: &str) -> anyhow::Result<()> {
    let Some(mut files) = shared(offer, matches, slot) else { return Ok(()) };
    let problem = match (files.next(), files.next()) {
        (Some(file), _) if !file.exists() => {
            format!("`{}` is neither a value of it (see --help) nor a file", file.display())
        }
        (_, Some(second)) => format!("it takes one file; got a second, {}", second.display()),
        _ => return Ok(()),
    };
    Err(Failure::usage(format!("--{}: {problem}", flag(slot))))
}
