use std::sync::Arc;

use ivd_boundary::component;
use ivd_budget::{LEVELS, target};
use ivd_core::{ClassChoice, Exec, Lattice, Volume};
use ivd_lattice::extract::{ExtractParams, Iso, extract};
use ivd_lattice::refine::{RefineParams, collapse};
use ivd_motion::handles::{Action, Anchor, Handle};
use ivd_segment::{KmvsParams, kmvs};
use ivd_session::MapChoice;

use super::deformation::{apart, deformed};
use crate::experiment::{Experiment, Problem, Setting};
use crate::inputs::judged;

/// How coarse the lattice is that carries the voxels against what the whole one gives: solver and map on each level.
pub(super) fn experiment(size: usize, exec: &Exec) -> Result<Experiment, Problem> {
    // A smaller head has no part worth a lattice.
    let size = (size / 2).max(32);
    let volume =
        ivd_phantom::generate(&ivd_phantom::Params { size, ..ivd_phantom::Params::default() }, exec)?.volume;
    let words = format!("the densest part of a head phantom of {size}³ voxels, pushed by {PUSH} of its edge");
    on(&part(&volume, exec)?, &push(size), words, exec)
}

/// The same on any lattice.
pub(super) fn on(
    whole: &Lattice,
    handle: &Handle,
    input: String,
    exec: &Exec,
) -> Result<Experiment, Problem> {
    let Action::Move(by) = handle.action else { return Err("a motion is needed".into()) };
    let push_mm = by.iter().map(|c| c * c).sum::<f64>().sqrt();
    let voxel = whole.grid().longest_edge();
    let mut lattices = Vec::new();
    for level in LEVELS {
        let params = RefineParams { target: target(level).into(), ..RefineParams::default() };
        let refined = collapse(whole, &params, exec)?;
        lattices.push((level, Arc::new(refined.lattice), refined.max_error_mm));
    }
    let finest = deformed(whole, handle, None, &MapChoice::default(), exec)?;
    let reached = finest.figures.voxels_moved as f64;
    let finest = Arc::new(finest.displacement);
    let settings = lattices.into_iter().map(|(level, lattice, bound)| {
        let (finest, handle) = (finest.clone(), *handle);
        let default = target(level) == RefineParams::default().target.get();
        Setting::new([("refine.level", level.to_string())], default, move |exec| {
            let found = deformed(&lattice, &handle, None, &MapChoice::default(), exec)?;
            let (finest, triangles) = (finest.clone(), lattice.triangles().len() as f64);
            Ok(Box::new(move || {
                let (error, most) = apart(&found.displacement, &finest);
                let counters = [
                    ("triangles", triangles),
                    ("voxels_moved", found.figures.voxels_moved as f64),
                    ("bound_mm", bound),
                    ("max_mm", most),
                    ("push_mm", push_mm),
                ];
                Ok(judged(error, counters))
            }))
        })
    });
    Ok(Experiment {
        stage: "map",
        input,
        truth: "the unrefined lattice",
        measure: "difference of the voxels' displacements where one moves, root mean square",
        unit: "mm",
        counted: None,
        voxel_mm: Some(voxel),
        work: ("voxels in reach", reached),
        settings: settings.collect(),
    })
}

/// The handle's motion as a fraction of the volume's edge.
const PUSH: f64 = 0.06;

/// The lattice of a volume's densest class, its largest part.
pub(crate) fn part(volume: &Volume, exec: &Exec) -> Result<Lattice, Problem> {
    let labels = kmvs(volume, None, &KmvsParams::default(), exec)?.labels;
    let params = ivd_boundary::ComponentParams {
        class: Some(ClassChoice::Densest),
        ..ivd_boundary::ComponentParams::default()
    };
    let part = component(volume, Some(&labels), &params, exec)?;
    let iso = match (part.lower, part.upper) {
        (None, None) => Iso::Mask,
        (lower, upper) => Iso::Interval { lower, upper },
    };
    Ok(extract(volume, Some(&part.mask), &ExtractParams { iso }, exec)?.lattice)
}

/// A push at the part's front.
fn push(size: usize) -> Handle {
    let edge = size as f64;
    let at = Anchor::NearestTo([0.5 * edge, 0.78 * edge, 0.5 * edge]);
    Handle { at, action: Action::Move([0.0, PUSH * edge, 0.0]), radius: 0.25 * edge }
}
