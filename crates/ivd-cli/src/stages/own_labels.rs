//! Labels where a class is asked for and none are given: those of two classes, or the volume's own numbers.

use ivd_artefact::Cache;
use ivd_boundary::ComponentParams;
use std::collections::BTreeSet;

use ivd_core::{Artefact, ClassChoice, Labels, Scalar as _, Value as _, Volume, with_voxels};
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
    let by_class = section.get::<ComponentParams>().filter(|part| part.above.is_none());
    let Some(part) = by_class.filter(|_| inputs.get("labels").is_none()) else { return Ok(inputs) };
    inputs.check(section)?;
    // Two classes are 1 and 2: any other is one of a volume that holds labels itself; so are these where its numbers are few.
    if let Some(ClassChoice::Id(id)) = part.class {
        let own = own_numbers(&inputs, cache, context);
        let few = own.as_ref().is_ok_and(|own| has_few_with(own, id));
        if id > 2 || few {
            context.say(&format!(
                "ivd: note: --class {id} without --labels: the volume's own numbers are taken for labels"
            ));
            return Ok(inputs.with("labels", own?));
        }
        context.say(&format!(
            "ivd: note: --class {id} without --labels is one of two classes that are found by value (`ivd segment --k 2`)"
        ));
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
    let own = own_numbers(&inputs, cache, context)?;
    if let Some(labels) = Labels::of(&own.artefact).filter(|labels| are_values(labels)) {
        let values = labels.classes().len();
        return Err(Failure::usage(format!(
            "--class without --labels takes the volume for labels, but it looks like a scan: {values} different values, and voxels beside each \
             other differ; give --labels (`ivd segment` finds them), or make labels of it by `ivd import --labels` where it holds some"
        )));
    }
    Ok(inputs.with("labels", own))
}

/// Whether labels are the values of a scan: of more than parts have, and seldom alike in voxels beside each other.
fn are_values(labels: &Labels) -> bool {
    if labels.classes().len() <= MOST_PARTS {
        return false;
    }
    let [pairs, alike] = pairs_alike(labels.ids().chunks(labels.grid().dims()[0]));
    2 * alike < pairs
}

/// Pairs of voxels beside each other along rows of which neither is 0, and those of them that are the same.
fn pairs_alike<'a, T: Default + PartialEq + 'a>(rows: impl Iterator<Item = &'a [T]>) -> [u64; 2] {
    let (mut pairs, mut alike, zero) = (0, 0, T::default());
    for pair in rows.flat_map(|row| row.windows(2)).filter(|pair| pair[0] != zero && pair[1] != zero) {
        pairs += 1;
        alike += u64::from(pair[0] == pair[1]);
    }
    [pairs, alike]
}

/// Whether labels are as few as those of parts are, and one is among them.
fn has_few_with(labels: &Input, id: u16) -> bool {
    let labels = Labels::of(&labels.artefact);
    labels.is_some_and(|labels| labels.classes().len() <= MOST_PARTS && labels.class(id).is_some())
}

/// More different numbers than this are values of a scan.
const MOST_PARTS: usize = 128;

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

/// Rows that are looked at.
const ROWS: usize = 256;
/// Pairs of voxels fewer than which tell nothing.
const FEWEST: u64 = 200;

/// The inputs of `ivd warp`; says where a volume is most likely labels, whose numbers would be mixed.
#[allow(clippy::unnecessary_wraps, reason = "as the other hooks")]
pub(crate) fn for_warp(inputs: Inputs, _: &Section, _: &Cache, context: &Context) -> anyhow::Result<Inputs> {
    if let Some(Artefact::Volume(volume)) = inputs.get("volume")
        && look_like_labels(volume)
    {
        context.say(
            "ivd: note: the volume looks like labels (few whole numbers, alike in voxels beside each other), and between two of them it gets numbers of \
             neither; make labels of it first (`ivd import FILE --labels -o labels.ivd`)",
        );
    }
    Ok(inputs)
}

/// Whether a volume holds few whole numbers, four times of five the same in voxels beside each other, and is no mask of two.
pub(crate) fn look_like_labels(volume: &Volume) -> bool {
    if (volume.slope(), volume.intercept()) != (1.0, 0.0) {
        return false;
    }
    let row = volume.grid().dims()[0];
    with_voxels!(volume.voxels(), voxels => {
        let rows = voxels.len() / row;
        let looked_at = || voxels.chunks(row).step_by(rows.div_ceil(ROWS).max(1));
        let mut seen = BTreeSet::new();
        for value in looked_at().flatten().map(|value| value.to_f64()) {
            if value.fract() != 0.0 || (seen.insert(value as i64) && seen.len() > MOST_PARTS) {
                return false;
            }
        }
        let [pairs, alike] = pairs_alike(looked_at());
        seen.len() >= 3 && pairs >= FEWEST && 5 * alike >= 4 * pairs
    })
}
