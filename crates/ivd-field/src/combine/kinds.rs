//! Operands of different kinds: all are taken for what the first one is.

use std::borrow::Cow;
use std::cell::Cell;

use ivd_core::op::Voxelwise;
use ivd_core::{Artefact, Class, Displacement, Exec, Labels, Mask, ParamError, Volume, Voxels};

use super::stage::{CombineFigures, told};
use super::{CombineParams, Operand, labels, masks, volumes};
use crate::Error;
use crate::clip::labelled;

/// An operand of any kind, and what it is read through.
pub type Given<'a> = (Voxelwise<'a>, Option<&'a Displacement>);

/// Combines operands of any kinds, with the figures. The first says what comes of it; those of another kind are taken for that: labels
/// and volumes for a mask where they aren't 0, a mask for labels as one class with an id of its own, labels and masks for a volume as 1
/// inside and 0 elsewhere, with a window of 0 to 1.
///
/// # Errors
/// As [`volumes`], [`labels`] and [`masks`]; a volume among labels that doesn't hold whole numbers; labels that leave no id for a mask.
pub fn any(
    operands: &[Given<'_>],
    params: &CombineParams,
    exec: &Exec,
) -> Result<(Artefact, CombineFigures), Error> {
    params.check(operands.len())?;
    Ok(match operands[0].0 {
        Voxelwise::Volume(_) => {
            let all = taken(operands, as_volume)?;
            let params = among_volumes(operands, params, exec);
            told(volumes(&borrowed(&all), &params, exec)?, |_| None)
        }
        Voxelwise::Labels(_) => {
            let last = Cell::new(highest_id(operands)?);
            let all = taken(operands, |given| as_labels(given, &last))?;
            told(labels(&borrowed(&all), params, exec)?, |l| Some(labelled(l)))
        }
        Voxelwise::Mask(_) => {
            let all = taken(operands, as_mask)?;
            told(masks(&borrowed(&all), params, exec)?, |m| Some(m.count()))
        }
    })
}

/// An operand's value, its own or what it is taken for, and what it is read through.
type Taken<'a, V> = (Cow<'a, V>, Option<&'a Displacement>);

fn taken<'a, V: Clone>(
    operands: &[Given<'a>],
    take: impl Fn(Voxelwise<'a>) -> Result<Cow<'a, V>, Error>,
) -> Result<Vec<Taken<'a, V>>, Error> {
    operands.iter().map(|(given, field)| Ok((take(*given)?, *field))).collect()
}

fn borrowed<'a, V: Clone>(operands: &'a [Taken<'a, V>]) -> Vec<Operand<'a, V>> {
    operands
        .iter()
        .map(|(value, displacement)| Operand { value: &**value, displacement: *displacement })
        .collect()
}

/// What an operand is as a mask: where it has a label, or a value that isn't 0.
fn as_mask(given: Voxelwise<'_>) -> Result<Cow<'_, Mask>, Error> {
    Ok(match given {
        Voxelwise::Mask(mask) => Cow::Borrowed(mask),
        Voxelwise::Labels(labels) => {
            let inside: Vec<u8> = labels.ids().iter().map(|id| u8::from(*id != 0)).collect();
            Cow::Owned(Mask::new(labels.grid().clone(), inside.into())?)
        }
        Voxelwise::Volume(volume) => Cow::Owned(Mask::from_volume(volume)?),
    })
}

/// The highest id of the labels among the operands, where a mask needs one above it; else 0.
fn highest_id(operands: &[Given<'_>]) -> Result<u16, Error> {
    let mut highest = 0;
    if !operands.iter().any(|(given, _)| matches!(given, Voxelwise::Mask(_))) {
        return Ok(highest);
    }
    let of = |labels: &Labels| labels.classes().iter().map(|class| class.id).max().unwrap_or(0);
    for (given, _) in operands {
        match given {
            Voxelwise::Labels(labels) => highest = highest.max(of(labels)),
            Voxelwise::Volume(volume) => highest = highest.max(of(&Labels::from_volume(volume)?)),
            Voxelwise::Mask(_) => {}
        }
    }
    Ok(highest)
}

/// What an operand is as labels: a mask is one class, with the next id after the last one, which no labels have.
fn as_labels<'a>(given: Voxelwise<'a>, last: &Cell<u16>) -> Result<Cow<'a, Labels>, Error> {
    let mask = match given {
        Voxelwise::Labels(labels) => return Ok(Cow::Borrowed(labels)),
        Voxelwise::Volume(volume) => return Ok(Cow::Owned(Labels::from_volume(volume)?)),
        Voxelwise::Mask(mask) => mask,
    };
    let id = last.get().checked_add(1).inspect(|id| last.set(*id)).ok_or_else(|| {
        let problem = "the labels have class 65535: there is no id left for the mask";
        ParamError::new("operands", problem, "renumber the labels")
    })?;
    let labels: Vec<u16> = mask.inside().iter().map(|inside| if *inside != 0 { id } else { 0 }).collect();
    let (mean, voxels) = (f64::from(id), mask.count());
    let class = Class { id, name: None, mean, sd: 0.0, voxels, lower: None, upper: None };
    let classes = if voxels == 0 { Vec::new() } else { vec![class] };
    Ok(Cow::Owned(Labels::new(mask.grid().clone(), labels.into(), classes)?))
}

/// What an operand is as a volume: 1 inside of a mask, or where there is a label, and 0 elsewhere.
fn as_volume(given: Voxelwise<'_>) -> Result<Cow<'_, Volume>, Error> {
    if let Voxelwise::Volume(volume) = given {
        return Ok(Cow::Borrowed(volume));
    }
    let mask = as_mask(given)?;
    Ok(Cow::Owned(Volume::new(mask.grid().clone(), Voxels::U8(mask.buffer().clone()))?))
}

/// The parameters, with windows of 0 to 1 for what stands among volumes and is none.
fn among_volumes(operands: &[Given<'_>], params: &CombineParams, exec: &Exec) -> CombineParams {
    let given = &params.windows;
    if operands.iter().all(|(given, _)| matches!(given, Voxelwise::Volume(_))) || given.len() > 1 {
        return params.clone();
    }
    let window = |(operand, _): &Given<'_>| match operand {
        Voxelwise::Volume(volume) => {
            let own = || exec.run(|| volume.range()).unwrap_or([0.0, 1.0]);
            given.first().copied().unwrap_or_else(own)
        }
        Voxelwise::Labels(_) | Voxelwise::Mask(_) => [0.0, 1.0],
    };
    CombineParams { windows: operands.iter().map(window).collect(), ..params.clone() }
}
