//! The commands of the stages of the list: made from what their methods declare, as the scene's sections are.

mod arguments;
mod hooks;
mod lattice;
mod offer;
mod own_labels;
mod parts;
mod pictures;
mod posteriors;
mod precursor;
mod typed;

use std::ffi::OsString;
use std::path::Path;

use clap::{ArgMatches, Command, CommandFactory as _, FromArgMatches as _};
use ivd_core::Kind;
use ivd_core::op::{Stage, Want, alternatives, kind};
use ivd_pipeline::list;

use crate::args::{self, Args, Global};
use crate::context::Context;
use crate::exit::Failure;
use crate::files::{filled, filled_with_parts, finish, kinds_of, unused};
use crate::parse::flag;
use arguments::{slots, with_arguments};
use hooks::hooks;
pub(crate) use offer::Offer;
use offer::named;
pub(crate) use own_labels::look_like_labels;
use typed::{Typed, check_shared, check_unread, file_of};

/// What was asked for.
pub(crate) enum Asked {
    /// A stage of the list, with what was typed for it.
    Stage(Offer, ArgMatches),
    /// Another command.
    Command(Box<args::Command>),
}

/// Commands in the order in which help lists them: as data flows, then what looks at results, then the program's own.
const ORDER: &[&str] = &[
    "demo", "pipeline", "import", "phantom", "segment", "atf", "boundary", "lattice", "refine", "octree",
    "deform", "map", "space", "warp", "combine", "clip", "render", "export", "info", "compare", "bench",
    "doctor", "schema", "cache",
];

/// Stages whose commands are written out: they take files in any number.
const WRITTEN_OUT: [&str; 2] = [ivd_field::clip::STAGE.name, ivd_field::combine::STAGE.name];

/// The stages of the list whose commands are made from what they declare.
pub(crate) fn declared() -> impl Iterator<Item = &'static Stage> {
    list::STAGES.iter().copied().filter(|stage| !WRITTEN_OUT.contains(&stage.name))
}

/// One of [`declared`] by its name.
fn declared_as(name: &str) -> Option<&'static Stage> {
    declared().find(|stage| stage.name == name)
}

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
    declared().map(|stage| {
        // What a stage declares is looked up when its own command is asked for.
        let about = stage.about.trim_end_matches('.');
        Command::new(stage.name).about(about).defer(|command| match declared_as(command.get_name()) {
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
    if let Some((stage, own)) = matches.subcommand().and_then(|(name, own)| Some((declared_as(name)?, own))) {
        return Ok((Global::from_arg_matches(matches)?, Asked::Stage(Offer::whole(stage), own.clone())));
    }
    let args = Args::from_arg_matches(matches)?;
    Ok((args.global, Asked::Command(Box::new(args.command))))
}

/// Runs a stage as its command asks for it.
pub(crate) fn run(offer: &Offer, matches: &ArgMatches, context: &Context) -> anyhow::Result<()> {
    let stage = offer.stage;
    let hooks = hooks(stage);
    if (hooks.instead)(matches, context)? {
        return Ok(());
    }
    let given = precursor::Given::of(stage, matches);
    let path = |name: &str| file_of(offer, matches, name);
    let output = path("output").ok_or_else(|| Failure::usage("-o FILE is missing"))?;
    let mut keys = Typed::read(offer, matches, context)?;
    if let Some((key, value)) = (hooks.implied)(output) {
        keys.imply(key, value);
    }
    let is_method_chosen = keys.is_method_chosen() || given.taken().is_some();
    let section = match given.taken() {
        Some(precursor) => keys.section_from(precursor)?,
        None => keys.section()?,
    };
    (hooks.holds)(&section, output)?;
    let reads = |slot: &str| {
        let own = section.method().has_slot(slot) && section.wants(slot) != Want::No;
        own || given.is_needed(&section, slot)
    };
    let (mut files, mut unread): (Vec<(&'static str, Option<&Path>)>, Vec<_>) = (Vec::new(), Vec::new());
    for slot in slots(stage) {
        check_shared(offer, matches, slot)?;
        if reads(slot) { files.push((slot, path(slot))) } else { unread.push((slot, path(slot))) }
    }
    for (slot, file) in unread {
        check_unread(stage, section.method(), slot, file, is_method_chosen)?;
        unused(stage, slot, file, context)?;
    }
    if let Some(nothing) = section.job().idle() {
        let problem = format!("{}: there is nothing to do: {nothing}", stage.name);
        return Err(Failure::usage(problem));
    }
    let cache = context.stage_cache()?;
    let kinds = |slot: &str| kinds_of(stage, slot);
    // What knows labels beside a volume knows what to do with them in its place: they say where something is, not what its values are.
    let inputs = if slots(stage).into_iter().any(|slot| kinds(slot).contains(&Kind::Labels)) {
        filled_with_parts(&files, kinds, &cache, context)?
    } else {
        filled(&files, kinds, &cache, context)?
    };
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
    finish(&section, done, output, context)
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
}
