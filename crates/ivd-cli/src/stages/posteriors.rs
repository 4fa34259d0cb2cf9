//! `ivd segment --posteriors-out`: the posterior maps of a mixture beside its labels.

use std::path::{Path, PathBuf};

use clap::Arg;
use ivd_artefact::{Artefact, Cache};
use ivd_core::op::{Product, Slots as _};
use ivd_pipeline::{Inputs, Runner, Section, StageResult};
use ivd_segment::{EmvsParams, Scanned, Tidied};

use crate::context::Context;
use crate::exit::Failure;
use crate::files::{provenance, write_artefact};

/// The flag.
pub(crate) const FLAG: &str = "posteriors-out";

/// It as an argument.
pub(crate) fn argument() -> Arg {
    let about = "emvs: keep the posterior maps: a volume artefact a component, PREFIX-1.ivd and so on";
    Arg::new(FLAG).long(FLAG).value_name("PREFIX").value_parser(clap::value_parser!(PathBuf)).help(about)
}

/// Segments, and keeps the posterior maps.
pub(crate) fn run(
    section: &Section,
    prefix: &Path,
    inputs: &Inputs,
    context: &Context,
) -> anyhow::Result<StageResult> {
    let Some(params) = section.get::<Tidied<EmvsParams>>() else {
        let problem = format!("--{FLAG}: {} has none; use --method emvs", section.method().name);
        return Err(Failure::usage(problem));
    };
    // Labels from a cache would come without the maps.
    let runner = Runner { exec: &context.exec, cache: &Cache::disabled(), lazy: false };
    let (done, maps) = runner.run_beside(section, inputs, |values| {
        let (labels, figures, maps) = params.run_with_posteriors(Scanned::take(values)?, &context.exec)?;
        Ok((Product::new(labels, &figures), maps))
    })?;
    let from = provenance(&done.record)?;
    for (i, map) in maps.into_iter().enumerate() {
        let path = numbered(prefix, i + 1);
        write_artefact(&path, &Artefact::Volume(map), &from, context)?;
        context.say(&format!("segment: posterior of component {} → {}", i + 1, path.display()));
    }
    Ok(done)
}

fn numbered(prefix: &Path, number: usize) -> PathBuf {
    let mut name = prefix.file_name().unwrap_or_default().to_os_string();
    name.push(format!("-{number}.ivd"));
    prefix.with_file_name(name)
}
