//! A job that a stage's own goes on from, such as the tree that classes are cut from: kept by `--tree-out`, and taken by `--from-tree`.

use std::path::{Path, PathBuf};

use clap::{Arg, ArgMatches};
use ivd_artefact::Cache;
use ivd_core::op::{Method, Place, PlaceKind, Stage, Want, fields};
use ivd_pipeline::{Inputs, Section, StageRecord, StageResult};

use crate::args::artefact_file;
use crate::context::Context;
use crate::exit::Failure;
use crate::files::write_result;
use crate::parse::flag;

/// The precursor of a stage, by its place.
#[derive(Clone, Copy)]
pub(super) struct Precursor {
    stage: &'static Stage,
    pub(super) place: &'static Place,
    pub(super) method: &'static Method,
}

/// The precursor that some method of a stage has.
pub(super) fn of(stage: &Stage) -> Option<Precursor> {
    let stage = ivd_pipeline::list::stage(stage.name)?;
    stage.places.iter().find_map(|place| match place.kind {
        PlaceKind::Precursor { method } => Some(Precursor { stage, place, method }),
        PlaceKind::Own | PlaceKind::Beside { .. } | PlaceKind::Fixed { .. } => None,
    })
}

impl Precursor {
    /// The argument of a slot: that of the precursor's result takes the place of all others.
    pub(super) fn argument(self, file: Arg, slot: &str, is_positional: bool) -> Arg {
        let Place { gives, variant, .. } = *self.place;
        if slot == gives {
            let about = format!("Go on from this {variant} (artefact)");
            return file.long(format!("from-{variant}")).value_name(gives.to_uppercase()).help(about);
        }
        let file = file.conflicts_with(gives);
        if is_positional { file.required_unless_present(gives) } else { file }
    }

    /// The flag that keeps the precursor's result.
    pub(super) fn keeper(self) -> Arg {
        let Place { gives, variant, .. } = *self.place;
        Arg::new(self.keeper_name())
            .long(self.keeper_name())
            .value_name(gives.to_uppercase())
            .value_parser(artefact_file)
            .conflicts_with(gives)
            .help(format!("{}: keep the {variant} (artefact)", self.names().join(", ")))
    }

    pub(super) fn keeper_name(self) -> String {
        format!("{}-out", self.place.variant)
    }

    /// The methods that go on from its result.
    pub(super) fn names(self) -> Vec<&'static str> {
        let reads = |method: &&Method| method.has_slot(self.place.gives);
        self.stage.methods.iter().filter(reads).map(|method| method.name).collect()
    }

    /// Takes out of a record what would shape a result that was there already.
    pub(super) fn leave_out(self, record: &mut StageRecord) {
        if let Some(params) = record.params.as_object_mut() {
            let schema = (self.method.schema)();
            params.retain(|key, _| fields(schema).all(|field| field.name != key));
        }
    }
}

/// What the command line says of a precursor.
pub(super) struct Given<'a> {
    precursor: Option<Precursor>,
    is_taken: bool,
    kept: Option<&'a Path>,
}

impl<'a> Given<'a> {
    pub(super) fn of(stage: &Stage, matches: &'a ArgMatches) -> Self {
        let precursor = of(stage);
        let file = |name: &str| matches.get_one::<PathBuf>(name).map(PathBuf::as_path);
        Self {
            is_taken: precursor.is_some_and(|precursor| file(precursor.place.gives).is_some()),
            kept: precursor.and_then(|precursor| file(&precursor.keeper_name())),
            precursor,
        }
    }

    /// The precursor, where its result is given.
    pub(super) fn taken(&self) -> Option<Precursor> {
        self.precursor.filter(|_| self.is_taken)
    }

    /// Where its result goes.
    pub(super) fn kept(&self) -> Option<&'a Path> {
        self.kept
    }

    /// Whether it has to be done, and reads a slot.
    pub(super) fn is_needed(&self, section: &Section, slot: &str) -> bool {
        let Some(precursor) = self.precursor.filter(|_| !self.is_taken) else { return false };
        let own = section.at(precursor.place);
        own.is_some_and(|own| own.wants(slot) != Want::No)
    }
}

/// Does the precursor, keeps its result, and goes on from that.
pub(super) fn run_through(
    section: &Section,
    file: &Path,
    inputs: Inputs,
    cache: &Cache,
    context: &Context,
) -> anyhow::Result<StageResult> {
    let stage = section.stage();
    let precursor = of(stage).and_then(|precursor| Some((precursor, section.at(precursor.place)?)));
    let Some((precursor, first)) = precursor else {
        let (variant, names) = of(stage).map_or(("", Vec::new()), |p| (p.place.variant, p.names()));
        return Err(Failure::usage(format!(
            "--{variant}-out: {} has no {variant}; use --{} {}",
            section.method().name,
            flag(stage.selector),
            names.join(" or "),
        )));
    };
    let built = context.run(cache, &first, &inputs)?;
    write_result(&built, file, context)?;
    let Place { variant, gives, .. } = *precursor.place;
    context.say(&format!("{}: {variant} in {:.2} s → {}", stage.name, built.record.wall_s, file.display()));
    let inputs = inputs.only(|slot| section.wants(slot) == Want::Yes).with(gives, built.input());
    context.run(cache, section, &inputs)
}
