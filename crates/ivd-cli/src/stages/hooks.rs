//! What single commands do beside their stage, in one list.

use std::path::Path;

use clap::{Arg, ArgMatches};
use ivd_artefact::Cache;
use ivd_core::op::Stage;
use ivd_pipeline::{Inputs, Section, StageResult};
use serde_json::Value as Json;

use super::{lattice, own_labels, pictures, posteriors};
use crate::args::check_artefact_name;
use crate::context::Context;
use crate::exit::Failure;

/// Does a stage's work and writes something else beside its result, as a flag asks for.
pub(crate) type Beside = fn(&Section, &Path, &Inputs, &Context) -> anyhow::Result<StageResult>;

/// What a command does beside its stage.
pub(crate) struct Hooks {
    /// Its flags that are neither keys nor inputs.
    pub(crate) flags: fn() -> Vec<Arg>,
    /// Does something else instead, where flags ask for it; tells whether.
    pub(crate) instead: fn(&ArgMatches, &Context) -> anyhow::Result<bool>,
    /// Fills slots that were left empty.
    pub(crate) completed: fn(Inputs, &Section, &Cache, &Context) -> anyhow::Result<Inputs>,
    /// What is written beside its result, with the flag that asks for it.
    pub(crate) beside: Option<(&'static str, Beside)>,
    /// What the file that is asked for needs of the parameters, where they say nothing of it.
    pub(crate) implied: fn(&Path) -> Option<(&'static str, Json)>,
    /// Refuses a file that can't hold the result, before that is made.
    pub(crate) holds: fn(&Section, &Path) -> anyhow::Result<()>,
}

/// Nothing, and an artefact as the result.
const PLAIN: Hooks = Hooks {
    flags: Vec::new,
    instead: |_, _| Ok(false),
    completed: |inputs, _, _, _| Ok(inputs),
    beside: None,
    implied: |_| None,
    holds: |_, output| check_artefact_name(output).map_err(Failure::usage),
};

const ALL: [(&str, Hooks); 5] = [
    (ivd_render::STAGE.name, Hooks { implied: pictures::implied, holds: pictures::check, ..PLAIN }),
    (ivd_field::warp::STAGE.name, Hooks { completed: own_labels::for_warp, ..PLAIN }),
    (
        ivd_segment::STAGE.name,
        Hooks {
            flags: || vec![posteriors::argument()],
            beside: Some((posteriors::FLAG, posteriors::run)),
            ..PLAIN
        },
    ),
    (ivd_boundary::STAGE.name, Hooks { completed: own_labels::completed, ..PLAIN }),
    (
        ivd_lattice::extract::STAGE.name,
        Hooks {
            flags: || lattice::flags().into(),
            instead: lattice::run,
            completed: own_labels::for_lattice,
            ..PLAIN
        },
    ),
];

/// What the command of a stage does beside it.
pub(crate) fn hooks(stage: &Stage) -> &'static Hooks {
    ALL.iter().find(|(name, _)| *name == stage.name).map_or(&PLAIN, |(_, hooks)| hooks)
}
