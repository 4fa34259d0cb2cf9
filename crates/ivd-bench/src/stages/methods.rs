//! The methods of refinement against each other: one lattice, the same targets, each method's own knobs round their defaults.

use std::sync::Arc;

use ivd_core::{Exec, Lattice};
use ivd_lattice::extract::{ExtractParams, Iso, extract};
use ivd_lattice::refine::{Locks, Method, RefineParams, Refined, Target, distances, refine};

use super::refine::Measure;
use crate::distance::Truth;
use crate::experiment::{Experiment, Problem, Setting};
use crate::inputs::judged;
use crate::plate;

/// What is asked for, and whether knobs are tried there too.
const TASKS: [(Target, bool); 7] = [
    (Target::Ratio(0.5), false),
    (Target::Ratio(0.25), true),
    (Target::Ratio(0.1), false),
    (Target::Ratio(0.05), true),
    (Target::Level(1), false),
    (Target::Level(2), true),
    (Target::Level(3), false),
];
/// All methods, the default first.
pub(crate) const METHODS: [Method; 5] =
    [Method::Collapse, Method::Decimate, Method::Loop, Method::Merge, Method::Sample];
/// Weights of lengths, and largest turns (degrees), round the defaults.
const SHAPE_WEIGHTS: [f64; 2] = [1e-4, 1e-2];
const TURNS: [f64; 2] = [45.0, 120.0];
/// A method that keeps more than this many times what was asked for can't go there, and isn't compared.
const REACHED: f64 = 1.1;
/// A level of the inverse subdivision keeps between a quarter and a third of the vertices.
const LEVEL_REACHED: f64 = 1.4;

/// Every method on the lattice of a plate with bores.
pub(super) fn experiment(size: usize, exec: &Exec) -> Result<Experiment, Problem> {
    let params = ExtractParams { iso: Iso::Value(0.0) };
    let lattice = Arc::new(extract(&plate::volume(size)?, None, &params, exec)?.lattice);
    let truth = Truth::formula(plate::nearest, &lattice);
    let input =
        format!("the lattice of {}, {size}³ voxels, {} triangles", plate::WORDS, lattice.triangles().len());
    let measure: Measure = Arc::new(move |found, exec| truth.apart(found, exec));
    on(&lattice, input, "the plate", &measure, exec)
}

/// The same on any lattice, with its measure.
pub(super) fn on(
    lattice: &Arc<Lattice>,
    input: String,
    truth: &'static str,
    measure: &Measure,
    exec: &Exec,
) -> Result<Experiment, Problem> {
    let mut settings = Vec::new();
    for (target, tried) in TASKS {
        let defaults = RefineParams { target: target.into(), ..RefineParams::default() };
        for params in METHODS.into_iter().flat_map(|method| variants(method, &defaults, tried)) {
            let default = params == defaults;
            if default || reaches(lattice, &params, exec)? {
                settings.push(setting(lattice, params, default, measure).of_task(words(target)));
            }
        }
    }
    Ok(Experiment {
        stage: "refine-methods",
        input,
        truth,
        measure: "distance over the surface, root mean square, from the truth or of the truth, whichever is more",
        unit: "mm",
        counted: None,
        voxel_mm: Some(lattice.grid().longest_edge()),
        work: ("triangles", lattice.triangles().len() as f64),
        settings,
    })
}

fn words(target: Target) -> String {
    match target {
        Target::Ratio(ratio) => format!("{} %", 100.0 * ratio),
        Target::Level(level) => format!("level {level}"),
        Target::Count(count) => format!("{count} triangles"),
        Target::MaxError(mm) => format!("{mm} mm"),
    }
}

/// A method's defaults and, where `tried`, its knobs on both sides of them.
fn variants(method: Method, defaults: &RefineParams, tried: bool) -> Vec<RefineParams> {
    let base = RefineParams { method, ..defaults.clone() };
    let mut all = vec![base.clone()];
    if method == Method::Merge {
        all.push(RefineParams { allow_topology: true, ..base.clone() });
    }
    if tried && method != Method::Sample {
        all.extend(TURNS.map(|max_turn_degrees| RefineParams { max_turn_degrees, ..base.clone() }));
    }
    if tried && !matches!(method, Method::Sample | Method::Decimate) {
        all.extend(SHAPE_WEIGHTS.map(|shape_weight| RefineParams { shape_weight, ..base.clone() }));
    }
    all
}

/// Whether a method comes to the target with these knobs.
fn reaches(lattice: &Lattice, params: &RefineParams, exec: &Exec) -> Result<bool, Problem> {
    let found = match refine(lattice, params, Locks::NONE, exec) {
        Err(ivd_lattice::Error::Unreachable { .. }) => return Ok(false),
        found => found?.lattice,
    };
    let share = |kept: usize, of: usize| kept as f64 / of.max(1) as f64;
    Ok(match params.target.get() {
        Target::Ratio(r) => share(found.triangles().len(), lattice.triangles().len()) <= REACHED * r,
        Target::Level(l) => {
            share(found.keys().len(), lattice.keys().len()) <= LEVEL_REACHED * 0.25_f64.powi(i32::from(l))
        }
        Target::Count(_) | Target::MaxError(_) => true,
    })
}

/// A setting by the knobs that its method reads.
fn setting(lattice: &Arc<Lattice>, params: RefineParams, default: bool, measure: &Measure) -> Setting {
    let mut knobs = vec![("method", params.method.name().to_owned())];
    if params.method == Method::Merge {
        knobs.push(("allow_topology", params.allow_topology.to_string()));
    }
    if params.method != Method::Sample && !params.allow_topology {
        knobs.push(("max_turn_degrees", params.max_turn_degrees.to_string()));
        if params.method != Method::Decimate {
            knobs.push(("shape_weight", params.shape_weight.to_string()));
        }
    }
    let (lattice, measure) = (lattice.clone(), measure.clone());
    Setting::new(knobs, default, move |exec| {
        let found: Refined = refine(&lattice, &params, Locks::NONE, exec)?;
        let (lattice, measure, exec) = (lattice.clone(), measure.clone(), exec.clone());
        Ok(Box::new(move || {
            let from_input = distances(&lattice, &found.lattice, &exec)?;
            let counters = [
                ("vertices", found.lattice.keys().len() as f64),
                ("triangles", found.lattice.triangles().len() as f64),
                ("bound_mm", found.max_error_mm),
                ("max_mm", from_input.max_mm),
                ("mean_mm", from_input.mean_mm),
            ];
            Ok(judged(measure(&found.lattice, &exec)?, counters))
        }))
    })
}
