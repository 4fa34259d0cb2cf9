//! The commands of the stages of the list: made from what their methods declare, as the scene's sections are.

use std::ffi::OsString;
use std::path::{Path, PathBuf};

use clap::builder::{PossibleValue, PossibleValuesParser};
use clap::{Arg, ArgAction, ArgMatches, Command, CommandFactory as _, FromArgMatches as _};
use ivd_core::op::{Field, Method, Stage, Want, alternatives, fields, is_vector, kind, map_values, words};
use ivd_core::{Kind, ParamError};
use ivd_pipeline::Section;
use ivd_pipeline::list::{self, Key};
use ivd_pipeline::params::read_entry;
use serde_json::{Map, Value as Json};

use crate::args::{Args, Global};
use crate::commands::Asked;
use crate::commands::hooks::hooks;
use crate::commands::precursor;
use crate::commands::stage::{filled, finish, unused};
use crate::context::Context;
use crate::exit::Failure;
use crate::offer::{Offer, named};
use crate::parse::table_of;

/// Commands in the order in which help lists them: as data flows, then what looks at results, then the program's own.
const ORDER: [&str; 24] = [
    "demo", "pipeline", "import", "phantom", "segment", "atf", "boundary", "lattice", "refine", "octree",
    "deform", "map", "space", "warp", "combine", "clip", "render", "export", "info", "compare", "bench",
    "doctor", "schema", "cache",
];

/// The whole program: the commands of the stages of the list, and the others.
pub(crate) fn program() -> Command {
    let program = Args::command().subcommands(commands());
    let names: Vec<String> = program.get_subcommands().map(|command| command.get_name().to_owned()).collect();
    names.iter().fold(program, |program, name| {
        let place = ORDER.iter().position(|known| known == name).unwrap_or(ORDER.len());
        program.mut_subcommand(name, |command| command.display_order(place))
    })
}

/// The commands of all stages of the list.
fn commands() -> impl Iterator<Item = Command> {
    list::STAGES.iter().map(|stage| {
        // What a stage declares is looked up when its own command is asked for.
        let about = stage.about.trim_end_matches('.');
        Command::new(stage.name).about(about).defer(|command| match list::stage(command.get_name()) {
            Some(stage) => with_arguments(command, &Offer::whole(stage)),
            None => command,
        })
    })
}

/// What is asked for by the words of a command line.
pub(crate) fn parse(words: Vec<OsString>) -> Result<(Global, Asked), clap::Error> {
    if let Some(offer) = Offer::chosen(&words) {
        let command = with_arguments(Command::new(offer.stage.name), &offer);
        let words = with_truths(words.clone(), Some(&offer));
        let found = Args::command().subcommand(command).try_get_matches_from(words);
        // What is wrong is told by the whole program, which knows the flags of other methods too.
        if let Ok(found) = found
            && let Some((name, own)) = found.subcommand()
            && name == offer.stage.name
        {
            return Ok((Global::from_arg_matches(&found)?, Asked::Stage(offer, own.clone())));
        }
    }
    program().try_get_matches_from(with_truths(words, None)).and_then(|found| read(&found))
}

/// What was typed: the flags of every command, and the command.
pub(crate) fn read(matches: &ArgMatches) -> Result<(Global, Asked), clap::Error> {
    if let Some((stage, own)) = matches.subcommand().and_then(|(name, own)| Some((list::stage(name)?, own))) {
        return Ok((Global::from_arg_matches(matches)?, Asked::Stage(Offer::whole(stage), own.clone())));
    }
    let args = Args::from_arg_matches(matches)?;
    Ok((args.global, Asked::Command(args.command)))
}

/// Slots that some method has, each once.
fn slots(stage: &Stage) -> Vec<&'static str> {
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

fn with_arguments(mut command: Command, offer: &Offer) -> Command {
    let stage = offer.stage;
    let precursor = precursor::of(stage);
    for slot in slots(stage) {
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
        ("OUTPUT", "PNG file, or `.ivd` for an image artefact")
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

/// What a file for a slot may hold; a volume may lie in a file of any format.
fn slot_help(stage: &Stage, slot: &str) -> String {
    let known = stage.methods.iter().flat_map(|method| method.slots).find(|known| known.name == slot);
    let kinds = known.map_or(&[][..], |known| known.kinds).iter().map(|kind| {
        let file = if *kind == Kind::Volume { " or file" } else { "" };
        format!("{} artefact{file}", kind.name())
    });
    let kinds: Vec<String> = kinds.collect();
    let kinds = kinds.join(", ");
    if kinds.starts_with(slot) { upper(&kinds) } else { format!("{}: {kinds}", upper(slot)) }
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
    if map_values(schema).is_some() {
        return "CLASS=key:value,…".to_owned();
    }
    match kind(schema) {
        "array" => {
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
                _ if object => "key=value;…".to_owned(),
                _ => "N,N…".to_owned(),
            }
        }
        "object" => "key=value;…".to_owned(),
        _ if one.len() > 1 => {
            let form = |one: &&Json| match kind(one) {
                "string" => words(one).iter().map(|(word, _)| *word).collect::<Vec<_>>().join("|"),
                "array" => "N,N…".to_owned(),
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
        format!("{whose}{}{own}", said.about.trim_end_matches('.').replace('\n', " "))
    });
    let text = said.collect::<Vec<_>>().join("; ");
    let domain = field.domain();
    let domain = if words_alone(field) || domain.is_empty() { String::new() } else { format!(" [{domain}]") };
    format!("{text}{}{domain}{}", keys(field), default(field.default()))
}

/// Whether a flag takes words and nothing else: help lists them by themselves.
fn words_alone(field: Field<'_>) -> bool {
    alternatives(field.schema).iter().all(|one| !words(one).is_empty())
}

/// The keys of the things that a flag lists, or of what it says of a class; where a word tells several kinds apart, those that all
/// have, and then those of each.
fn keys(field: Field<'_>) -> String {
    let things = field.schema.get("items").or_else(|| map_values(field.schema));
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

/// The flag of a key.
pub(crate) fn flag(key: &str) -> String {
    key.replace('_', "-")
}

/// Runs a stage as its command asks for it.
pub(crate) fn run(offer: &Offer, matches: &ArgMatches, context: &Context) -> anyhow::Result<()> {
    let stage = offer.stage;
    let hooks = hooks(stage);
    if (hooks.instead)(matches, context)? {
        return Ok(());
    }
    let given = precursor::Given::of(stage, matches);
    let keys = Typed::read(offer, matches, context)?;
    let section = match given.taken() {
        Some(precursor) => precursor.cut(keys)?,
        None => keys.section()?,
    };
    let path = |name: &str| matches.get_one::<PathBuf>(name).map(PathBuf::as_path);
    let reads = |slot: &str| {
        let own =
            section.method().slots.iter().any(|own| own.name == slot) && section.wants(slot) != Want::No;
        own || given.is_needed(&section, slot)
    };
    let (mut files, mut unread): (Vec<(&'static str, Option<&Path>)>, Vec<_>) = (Vec::new(), Vec::new());
    for slot in slots(stage) {
        if reads(slot) { files.push((slot, path(slot))) } else { unread.push((slot, path(slot))) }
    }
    for (slot, file) in unread {
        unused(stage, slot, file, context)?;
    }
    if let Some(nothing) = section.job().idle() {
        let problem = format!("{}: there is nothing to do: {nothing}", stage.name);
        return Err(Failure::usage(problem));
    }
    let cache = context.stage_cache()?;
    let inputs = filled(&files, &cache, context)?;
    let inputs = (hooks.completed)(inputs, &section, &cache, context)?;
    let beside = hooks.beside.and_then(|(flag, run)| Some((flag, run, path(flag)?)));
    let mut done = match (beside, given.kept()) {
        (Some((flag, ..)), Some(_)) => {
            let problem = format!("--{flag} is of another method than what is kept beside it; give one");
            return Err(Failure::usage(problem));
        }
        (Some((_, run, file)), None) => run(&section, file, &inputs, context)?,
        (None, Some(file)) => precursor::run_through(&section, file, inputs, &cache, context)?,
        (None, None) => context.run(&cache, &section, &inputs)?,
    };
    if let Some(precursor) = given.taken() {
        precursor.leave_out(&mut done.record);
    }
    let output = path("output").ok_or_else(|| Failure::usage("-o FILE is missing"))?;
    finish(&section, done, output, context)
}

/// Whether a file was given for a slot.
fn is_filled(matches: &ArgMatches, slot: &str) -> bool {
    matches.get_one::<PathBuf>(slot).is_some()
}

/// What was written for a stage: in the file of `--params`, and on the command line.
pub(crate) struct Typed {
    stage: &'static Stage,
    file: Option<PathBuf>,
    line: Map<String, Json>,
    keys: Map<String, Json>,
}

impl Typed {
    fn read(offer: &Offer, matches: &ArgMatches, context: &Context) -> anyhow::Result<Self> {
        let stage = offer.stage;
        let file = context.global.params.clone();
        let mut keys = file.as_deref().map(table_of).transpose()?.unwrap_or_default();
        let typed = typed(offer, matches)?;
        for (key, value) in typed.clone() {
            add(&mut keys, key, value);
        }
        let lacks = |method: &&Method| !method.without.is_empty() && !is_filled(matches, method.without);
        if let Some(method) = stage.methods.iter().find(lacks) {
            keys.entry(stage.selector).or_insert_with(|| Json::from(method.name));
        }
        Ok(Self { stage, file, line: typed, keys })
    }

    /// What is given for a key.
    pub(crate) fn get(&self, key: &str) -> Option<&Json> {
        self.keys.get(key)
    }

    /// Gives a key where it isn't given.
    pub(crate) fn or_insert(&mut self, key: &str, value: &str) {
        self.keys.entry(key).or_insert_with(|| Json::String(value.to_owned()));
    }

    /// Where a key was given, for a message.
    pub(crate) fn place(&self, key: &str) -> String {
        match &self.file {
            Some(file) if !self.line.contains_key(key) => format!("--params {}: {key}", file.display()),
            _ => format!("--{}", flag(key)),
        }
    }

    /// The parameters.
    pub(crate) fn section(self) -> anyhow::Result<Section> {
        Section::parse(self.stage, Some(self.keys)).map_err(|problem| {
            let first = problem.field.split('.').next().unwrap_or("");
            Failure::usage(match &self.file {
                _ if self.line.contains_key(first) => told(&problem),
                Some(file) => format!("--params {}: {}", file.display(), problem.told_of(self.stage.name)),
                None => problem.told_of(self.stage.name),
            })
        })
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
            for text in matches.get_many::<String>(name).into_iter().flatten() {
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

/// The words of a command line, with `true` written behind flags that are given without a value: those of an offer, or of the stage that
/// is named.
pub(crate) fn with_truths(words: Vec<OsString>, offer: Option<&Offer>) -> Vec<OsString> {
    let whole = if offer.is_none() { named(&words).map(Offer::whole) } else { None };
    let Some(offer) = offer.or(whole.as_ref()) else { return words };
    let truths: Vec<String> = offer
        .keys
        .iter()
        .filter(|found| alternatives(&found.schema).iter().all(|one| kind(one) == "boolean"))
        .flat_map(|found| {
            let field = found.field();
            std::iter::once(field.name)
                .chain(field.aliases())
                .map(|name| format!("--{}", flag(name.trim_start_matches('!'))))
                .collect::<Vec<_>>()
        })
        .collect();
    let mut all = Vec::with_capacity(words.len());
    let mut rest = words.into_iter().peekable();
    while let Some(word) = rest.next() {
        let is_bare = word.to_str().is_some_and(|word| truths.iter().any(|flag| flag == word));
        let has_value = rest.peek().is_some_and(|next| next == "true" || next == "false");
        all.push(word);
        if is_bare && !has_value {
            all.push("true".into());
        }
    }
    all
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn help_lists_every_stage_where_data_flow_through_it() {
        for stage in list::STAGES {
            assert!(ORDER.contains(&stage.name), "ORDER has no place for {}", stage.name);
        }
    }

    #[test]
    fn every_flag_is_a_key_an_input_the_output_or_on_the_list() {
        for stage in list::STAGES {
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
