//! `ivd boundary` with neither labels nor a value: two classes tell the part from its surroundings.

use ivd_artefact::Cache;
use ivd_boundary::ComponentParams;
use ivd_pipeline::{Inputs, Section};

use crate::context::Context;
use crate::exit::Failure;

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
    let two = serde_json::Map::from_iter([("k".to_owned(), 2.into())]);
    let two =
        Section::parse(&ivd_segment::STAGE, Some(two)).map_err(|e| Failure::usage(e.told_of("boundary")))?;
    let labels = context.run(cache, &two, &inputs)?;
    Ok(inputs.with("labels", labels.input()))
}
