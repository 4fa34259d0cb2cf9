//! Labels where a class is asked for and none are given: those of two classes, or the volume's own numbers.

use ivd_artefact::Cache;
use ivd_boundary::ComponentParams;
use ivd_core::ClassChoice;
use ivd_lattice::extract::LatticeParams;
use ivd_pipeline::stages::ImportLabels;
use ivd_pipeline::{Input, Inputs, Section};

use crate::context::Context;
use crate::exit::{Failure, error_class};

/// The inputs with labels of two classes, where a part is looked for by classes and none are given: those that `ivd segment --k 2`
/// makes.
pub(crate) fn completed(
    inputs: Inputs,
    section: &Section,
    cache: &Cache,
    context: &Context,
) -> anyhow::Result<Inputs> {
    let by_class = section.get::<ComponentParams>().is_some_and(|part| part.above.is_none());
    if !by_class || inputs.get("labels").is_some() {
        return Ok(inputs);
    }
    inputs.check(section)?;
    // Two classes are 1 and 2: any other is one of a volume that holds labels itself.
    let class = section.get::<ComponentParams>().and_then(|part| part.class);
    if matches!(class, Some(ClassChoice::Id(3..))) {
        let labels = own_numbers(&inputs, cache, context)?;
        return Ok(inputs.with("labels", labels));
    }
    let two = serde_json::Map::from_iter([("k".to_owned(), 2.into())]);
    let two =
        Section::parse(&ivd_segment::STAGE, Some(two)).map_err(|e| Failure::usage(e.told_of("boundary")))?;
    let labels = context.run(cache, &two, &inputs)?;
    Ok(inputs.with("labels", labels.input()))
}

/// The inputs of `ivd lattice` with the volume taken for labels, where a class is asked for and neither labels nor a mask are given.
pub(crate) fn for_lattice(
    inputs: Inputs,
    section: &Section,
    cache: &Cache,
    context: &Context,
) -> anyhow::Result<Inputs> {
    let by_class = section.get::<LatticeParams>().is_some_and(LatticeParams::needs_class);
    if !by_class || inputs.get("labels").is_some() || inputs.get("mask").is_some() {
        return Ok(inputs);
    }
    inputs.check(section)?;
    let labels = own_numbers(&inputs, cache, context)?;
    Ok(inputs.with("labels", labels))
}

/// The numbers of the volume as labels.
fn own_numbers(inputs: &Inputs, cache: &Cache, context: &Context) -> anyhow::Result<Input> {
    let only = inputs.clone().only(|slot| slot == "volume");
    let labels = context.run(cache, &ImportLabels, &only);
    Ok(labels
        .map_err(|e| {
            Failure::of(error_class(&e), format!("--class without --labels takes the volume for labels: {e}"))
        })?
        .input())
}
