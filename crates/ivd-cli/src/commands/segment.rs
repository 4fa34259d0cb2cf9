//! `ivd segment`: labels of a volume, or of a tree that is there.

use std::path::{Path, PathBuf};

use ivd_artefact::{Artefact, Cache};
use ivd_core::Volume;
use ivd_pipeline::scene::{ClassCount, SegmentMethod, SegmentSection};
use ivd_pipeline::stages::{KeepPosteriors, Segment, SegmentTree};
use ivd_pipeline::{Done, Inputs};
use toml::{Table, Value};

use super::stage::{filled, finish, list, provenance, write_artefact, write_result};
use crate::args::SegmentArgs;
use crate::context::Context;
use crate::exit::Failure;
use crate::parse::{Words, section};

/// Segments a volume, or cuts a tree.
pub(super) fn run(args: &SegmentArgs, context: &Context) -> anyhow::Result<()> {
    let mut section: SegmentSection = section(context.global.params.as_deref(), words(args).0)?;
    let cache = context.stage_cache()?;
    if let Some(tree) = &args.from_tree {
        check_of_tree(args, context)?;
        section.method = SegmentMethod::Hvs;
        let inputs = filled(&[("tree", Some(tree))], &cache, context)?;
        let done = context.run(&cache, &Segment::cut_of_section(&section)?, &inputs)?;
        return finish(done, &args.output.path, context);
    }
    let volume = args.volume.as_deref();
    let inputs = filled(&[("volume", volume), ("mask", args.mask.as_deref())], &cache, context)?;
    let done = match (&args.tree_out, &args.posteriors_out) {
        (Some(tree), None) => through_tree(&section, tree, inputs, &cache, context)?,
        (None, Some(prefix)) => with_posteriors(&section, prefix, &inputs, context)?,
        (Some(_), Some(_)) => {
            return Err(Failure::usage(
                "--tree-out is of hvs and --posteriors-out of emvs; give one".to_owned(),
            ));
        }
        (None, None) => context.run(&cache, &Segment::from_section(&section)?, &inputs)?,
    };
    finish(done, &args.output.path, context)
}

/// Keys that a tree is shaped by when it is built; a cut can't change them.
const SHAPING: [&str; 4] = ["linkage", "alpha", "max_regions", "range"];

/// What a cut of a tree that is there would leave unread is a mistake, even where it says the default: the tree may be another.
fn check_of_tree(args: &SegmentArgs, context: &Context) -> anyhow::Result<()> {
    let typed = words(args).0;
    let params = context.global.params.as_deref();
    let given: Table = section(params, typed.clone())?;
    let place = |key: &str| match params {
        Some(file) if !typed.contains_key(key) => format!("--params {}: {key}", file.display()),
        _ => format!("--{}", key.replace('_', "-")),
    };
    if let Some(method) = given.get("method").filter(|method| method.as_str() != Some("hvs")) {
        return Err(Failure::usage(format!(
            "{}: {method}, but --from-tree cuts a tree of hvs; leave it out, or segment the volume instead",
            place("method")
        )));
    }
    if let Some(key) = SHAPING.into_iter().find(|key| given.contains_key(*key)) {
        return Err(Failure::usage(format!(
            "{}: it shapes a tree, and that of --from-tree is built; leave it out, or build another tree with `ivd segment \
             VOLUME --method hvs --{} … --tree-out TREE`",
            place(key),
            key.replace('_', "-")
        )));
    }
    Ok(())
}

/// What was typed, by the keys of a scene.
fn words(args: &SegmentArgs) -> Words {
    let k = args.k.map(|k| match k {
        ClassCount::Number(n) => Value::Integer(n as i64),
        ClassCount::Word(_) => Value::String("auto".to_owned()),
    });
    Words::default()
        .with("method", args.method.clone())
        .with("k", k)
        .with("k_max", args.k_max.map(i64::from))
        .with("k_min", args.k_min.map(i64::from))
        .with("values", args.values.clone().map(list))
        .with("range", args.range.map(|r| list(r.to_vec())))
        .with("spatial_weight", args.spatial_weight)
        .with("seed", args.seed.map(i64::from))
        .with("max_iterations", args.max_iterations.map(i64::from))
        .with("tolerance", args.tolerance)
        .with("covariance", args.covariance.clone())
        .with("smoothing", args.smoothing)
        .with("bias", args.bias)
        .with("kernel", args.kernel.clone())
        .with("range_bandwidth", args.range_bandwidth)
        .with("spatial_bandwidth", args.spatial_bandwidth)
        .with("persistence", args.persistence)
        .with("linkage", args.linkage.clone())
        .with("alpha", args.alpha)
        .with("max_regions", args.max_regions.map(i64::from))
        .with("height", args.height)
        .with("level", args.level.map(i64::from))
        .with("ranking", args.ranking.clone())
        .with("smallest", args.smallest.map(i64::from))
        .with("order", args.order.clone())
}

/// Builds the tree, keeps it, and cuts it.
fn through_tree(
    section: &SegmentSection,
    tree: &Path,
    inputs: Inputs,
    cache: &Cache,
    context: &Context,
) -> anyhow::Result<Done> {
    let Some(stage) = SegmentTree::from_section(section) else {
        return Err(Failure::usage(format!(
            "--tree-out: {} has no tree; use --method hvs",
            name(section.method)
        )));
    };
    let cut = Segment::cut_of_section(section)?;
    let built = context.run(cache, &stage, &inputs)?;
    write_result(&built, tree, context)?;
    context.say(&format!("segment: tree in {:.2} s → {}", built.record.wall_s, tree.display()));
    let inputs = inputs.only("volume").with("tree", built.input());
    context.run(cache, &cut, &inputs)
}

/// Segments, and keeps the posterior maps.
fn with_posteriors(
    section: &SegmentSection,
    prefix: &Path,
    inputs: &Inputs,
    context: &Context,
) -> anyhow::Result<Done> {
    if section.method != SegmentMethod::Emvs {
        let problem = format!("--posteriors-out: {} has none; use --method emvs", name(section.method));
        return Err(Failure::usage(problem));
    }
    let stage = KeepPosteriors::new(Segment::from_section(section)?);
    // Labels from a cache would come without the maps.
    let done = context.run(&Cache::disabled(), &stage, inputs)?;
    let from = provenance(&done.record)?;
    for (i, map) in stage.into_maps().into_iter().enumerate() {
        let path = numbered(prefix, i + 1);
        write_volume(&path, map, &from, context)?;
        context.say(&format!("segment: posterior of component {} → {}", i + 1, path.display()));
    }
    Ok(done)
}

fn write_volume(
    path: &Path,
    map: Volume,
    from: &ivd_artefact::Provenance,
    context: &Context,
) -> anyhow::Result<()> {
    write_artefact(path, &Artefact::Volume(map), from, context)
}

fn numbered(prefix: &Path, number: usize) -> PathBuf {
    let mut name = prefix.file_name().unwrap_or_default().to_os_string();
    name.push(format!("-{number}.ivd"));
    prefix.with_file_name(name)
}

fn name(method: SegmentMethod) -> String {
    let value = serde_json::to_value(method).expect("a word");
    value.as_str().unwrap_or_default().to_owned()
}
