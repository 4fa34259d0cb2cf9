//! `ivd boundary` with neither labels nor a value: two classes tell the part from its surroundings.

use ivd_artefact::Cache;
use ivd_boundary::ComponentParams;
use ivd_pipeline::scene::{ClassCount, SegmentSection};
use ivd_pipeline::stages::Segment;
use ivd_pipeline::{Inputs, Section};

use crate::context::Context;

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
    let two = SegmentSection { k: ClassCount::Number(2), ..SegmentSection::default() };
    let labels = context.run(cache, &Segment::from_section(&two)?, &inputs)?;
    Ok(inputs.with("labels", labels.input()))
}
