//! `ivd compare`.

use std::path::Path;

use ivd_artefact::Cache;
use ivd_core::{Artefact, Displacement, Grid, Kind, Labels, Mask, Value as _, Volume, VoxelCoord, counted};
use ivd_pipeline::stages::ImportLabels;
use ivd_pipeline::{Input, Inputs};
use serde_json::json;

use crate::context::Context;
use crate::exit::{Failure, error_class};
use crate::files::{file_for, volume_or_artefact};
use crate::stages::look_like_labels;

/// Tells the error between two artefacts of one kind. A file of another program is taken for what the artefact beside it is, and volumes
/// are taken for labels where that is said.
pub(super) fn run(a: &Path, b: &Path, labels: bool, context: &Context) -> anyhow::Result<()> {
    let [first, second] = if labels {
        [labels_of(a, context)?, labels_of(b, context)?]
    } else {
        [beside(a, b, context)?, beside(b, a, context)?]
    };
    if let (Artefact::Volume(first), Artefact::Volume(second)) = (&*first.artefact, &*second.artefact)
        && context.exec.run(|| [first, second].into_iter().all(look_like_labels))
    {
        context.say(
            "ivd: note: both look like labels (few whole numbers, alike in voxels beside each other), and are compared as numbers; --labels tells how far \
             each label of one overlaps that of the other (Dice)",
        );
    }
    let mut error = ivd_pipeline::compare(&first.artefact, &second.artefact, &context.exec)?;
    if let Some(unproven) = error["unproven"].as_u64().filter(|n| *n > 0) {
        context.say(&format!(
            "ivd: note: {} those of {} in too great a tangle for the best matching; they are matched by Dice, the largest first",
            counted(
                unproven,
                &format!("class of {} overlaps", a.display()),
                &format!("classes of {} overlap", a.display())
            ),
            b.display()
        ));
    }
    error["a"] = json!(a);
    error["b"] = json!(b);
    error["equal"] = json!(first.hash == second.hash);
    if first.hash != second.hash {
        let differing = differing(&first.artefact, &second.artefact);
        let grids = grid_of(&first.artefact).zip(grid_of(&second.artefact));
        let apart = grids.map(|(here, there)| apart_mm(here, there));
        if !differing.is_empty() {
            let by = apart.filter(|mm| *mm > 0.0).map_or_else(String::new, |mm| {
                format!("; their voxels lie apart by {mm:.1e} mm at most, which counts as the same place")
            });
            context.say(&format!("ivd: note: they differ in their {}{by}", differing.join(", ")));
        }
        if let Some(mm) = apart {
            error["apart_mm"] = json!(mm);
        }
        error["differs_in"] = json!(differing);
    }
    context.print(&error, || format!("{error:#}"))
}

/// A file's labels: its own, or its numbers taken for some.
fn labels_of(file: &Path, context: &Context) -> anyhow::Result<Input> {
    let off = Cache::disabled();
    let read = file_for(file, &[Kind::Labels], &off, context)?;
    let kind = read.artefact.kind();
    if kind == Kind::Labels {
        return Ok(read);
    }
    if kind != Kind::Volume {
        return Err(Failure::usage(format!(
            "compare --labels {}: a {kind} artefact; give labels, or volumes whose numbers are labels",
            file.display()
        )));
    }
    let done = context.run(&off, &ImportLabels, &Inputs::default().with("volume", read));
    Ok(done.map_err(|e| Failure::of(error_class(&e), format!("{}: {e}", file.display())))?.input())
}

/// A file's value, to be compared with another's.
fn beside(file: &Path, other: &Path, context: &Context) -> anyhow::Result<Input> {
    let off = Cache::disabled();
    if ivd_artefact::is_artefact(file) || !ivd_artefact::is_artefact(other) {
        return volume_or_artefact(file, &off, context);
    }
    let (kind, name) = (ivd_artefact::peek(other)?.kind, file.display());
    let remedy = match kind {
        Kind::Volume | Kind::Labels | Kind::Mask => return file_for(file, &[kind], &off, context),
        Kind::Lattice => format!("`ivd lattice VOLUME --mesh {name} -o FILE` makes a lattice of a mesh"),
        Kind::Displacement => format!("`ivd import {name} --displacement -o FILE` makes one of a field"),
        Kind::Transfer => format!("`ivd import {name} -o FILE` makes one of a .json file"),
        Kind::Octree | Kind::Motion | Kind::Image | Kind::Tree => "give another one".to_owned(),
    };
    Err(Failure::usage(format!(
        "compare: {} is a {kind} artefact, and {name} is none; {remedy}",
        other.display()
    )))
}

/// What two values differ in beside what is measured of them.
fn differing(a: &Artefact, b: &Artefact) -> Vec<&'static str> {
    let differences = match (a, b) {
        (Artefact::Volume(a), Artefact::Volume(b)) => vec![
            ("stored type", a.voxel_type() != b.voxel_type()),
            ("scale", (a.slope(), a.intercept()) != (b.slope(), b.intercept())),
            ("modality", a.modality() != b.modality()),
        ],
        (Artefact::Labels(a), Artefact::Labels(b)) => {
            vec![("figures of classes", a.classes() != b.classes())]
        }
        (Artefact::Mask(a), Artefact::Mask(b)) => vec![("level function", a.level() != b.level())],
        (Artefact::Displacement(a), Artefact::Displacement(b)) => vec![
            ("proven det J", a.min_det_j() != b.min_det_j()),
            ("residual of the inverse", a.inverse_residual_max() != b.inverse_residual_max()),
            ("time", a.time() != b.time()),
        ],
        _ => Vec::new(),
    };
    let places = grid_of(a).zip(grid_of(b)).map(|(here, there)| {
        let is_apart = !differ_by_digits(here, there);
        let (spacing, origin, axes) = (
            here.spacing() != there.spacing(),
            here.origin() != there.origin(),
            here.direction() != there.direction(),
        );
        [
            ("spacing", is_apart && spacing),
            ("origin", is_apart && origin),
            ("axes", is_apart && axes),
            ("last digits of the grid", !is_apart && (spacing || origin || axes)),
            ("word of what space it lies in", here.reference() != there.reference()),
        ]
    });
    let all = differences.into_iter().chain(places.into_iter().flatten());
    all.filter_map(|(what, differs)| differs.then_some(what)).collect()
}

/// Whether two grids differ by no more than the last digits of their numbers, which move no voxel.
fn differ_by_digits(here: &Grid, there: &Grid) -> bool {
    let are_near = |a: f64, b: f64| (a - b).abs() <= 1e-9 * a.abs().max(1.0);
    let spacing = here.spacing().into_iter().zip(there.spacing());
    let axes = here.direction().into_iter().flatten().zip(there.direction().into_iter().flatten());
    apart_mm(here, there) == 0.0 && spacing.chain(axes).all(|(a, b)| are_near(a, b))
}

/// How far the voxels of one lie from those of the other at most (mm), where their grids count as one.
fn apart_mm(here: &Grid, there: &Grid) -> f64 {
    let corner = |grid: &Grid, corner: usize| {
        let last = grid.dims().map(|n| n as f64 - 1.0);
        let voxel = [0, 1, 2].map(|a| if corner >> a & 1 == 1 { last[a] } else { 0.0 });
        grid.world(VoxelCoord(voxel.into())).0
    };
    // Both are affine in the voxel: what lies apart most is a corner.
    (0..8).map(|at| (corner(here, at) - corner(there, at)).norm()).fold(0.0, f64::max)
}

fn grid_of(artefact: &Artefact) -> Option<&Grid> {
    let grids = [
        Volume::of(artefact).map(Volume::grid),
        Labels::of(artefact).map(Labels::grid),
        Mask::of(artefact).map(Mask::grid),
        Displacement::of(artefact).map(Displacement::grid),
    ];
    grids.into_iter().flatten().next()
}
