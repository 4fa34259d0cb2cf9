//! `ivd combine` and `ivd clip`.

use ivd_core::Kind;
use ivd_field::clip::ClipParams;
use ivd_field::combine::CombineParams;
use ivd_pipeline::Inputs;
use ivd_pipeline::stages::{Clip, Combine};

use crate::args::{ClipArgs, CombineArgs};
use crate::context::Context;
use crate::exit::Failure;
use crate::files::{file_for, filled, finish};

/// `ivd combine`.
pub(super) fn combine(args: &CombineArgs, context: &Context) -> anyhow::Result<()> {
    let params = CombineParams { op: args.op.into(), windows: args.window.clone() };
    // Before anything is read.
    params.check(args.operands.len()).map_err(|e| Failure::usage(format!("combine: {e}")))?;
    let cache = context.stage_cache()?;
    let mut inputs = Inputs::default();
    for (file, [slot, _]) in args.operands.iter().zip(Combine::OPERANDS) {
        inputs = inputs.with(slot, file_for(file, &[Kind::Volume], &cache, context)?);
    }
    for (i, (number, file)) in args.displacement.iter().enumerate() {
        let wrong = |problem: String| {
            Failure::usage(format!("--displacement {number}={}: {problem}", file.display()))
        };
        if *number > args.operands.len() {
            return Err(wrong(format!("there are {} operands, counted from 1", args.operands.len())));
        }
        if args.displacement[..i].iter().any(|(other, _)| other == number) {
            return Err(wrong(format!("operand {number} has one already; give one for each operand")));
        }
        let [_, slot] = Combine::OPERANDS[number - 1];
        inputs = inputs.with(slot, context.stage_input(file)?);
    }
    let stage = Combine { params };
    let done = context.run(&cache, &stage, &inputs)?;
    finish(&stage, done, &args.output.path, context)
}

/// `ivd clip`.
pub(super) fn clip(args: &ClipArgs, context: &Context) -> anyhow::Result<()> {
    let params = ClipParams {
        planes: args.plane.clone(),
        boxes: args.boxes.clone(),
        class: args.class,
        invert: args.invert,
        background: args.background,
    };
    params.check().map_err(|e| Failure::usage(format!("clip: {e}")))?;
    let cache = context.stage_cache()?;
    let files = [
        ("volume", Some(args.volume.as_path())),
        ("tag", args.tag.as_deref()),
        ("displacement", args.displacement.as_deref()),
    ];
    let stage = Clip { params };
    let slots = ivd_pipeline::Stage::facts(&stage).inputs;
    let kinds =
        |slot: &str| slots.iter().find(|known| known.name == slot).map_or(&[][..], |known| known.kinds);
    let inputs = filled(&files, kinds, &cache, context)?;
    let done = context.run(&cache, &stage, &inputs)?;
    finish(&stage, done, &args.output.path, context)
}
