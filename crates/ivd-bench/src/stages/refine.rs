use std::sync::Arc;

use ivd_budget::{LEVELS, target};
use ivd_core::{Exec, Lattice};
use ivd_lattice::refine::{RefineParams, collapse};

use super::lattice::distance;
use crate::experiment::{Experiment, Problem, Setting};
use crate::inputs::{ball, each_once, judged};

/// Weights of a collapse's length, and largest turns (degrees), round the defaults.
const SHAPE_WEIGHTS: [f64; 5] = [0.0, 1e-4, 1e-3, 1e-2, 1e-1];
const TURNS: [f64; 4] = [20.0, 45.0, 75.0, 120.0];
/// The levels at which they are tried; at the others the defaults alone.
const TRIED: [f64; 3] = [1.0, 2.0, 3.0];

/// How collapses are chosen against the distance from the ball, for each level asked for.
pub(super) fn experiment(size: usize, exec: &Exec) -> Result<Experiment, Problem> {
    let lattice = Arc::new(ball(size, exec)?);
    let input =
        format!("the lattice of a ball of 40 mm, {size}³ voxels, {} triangles", lattice.triangles().len());
    let measure: Measure = Arc::new(|found, _| Ok(distance(found)));
    Ok(on(&lattice, input, "the ball", &measure))
}

/// How far a refined lattice is from the truth (mm).
pub(super) type Measure = Arc<dyn Fn(&Lattice, &Exec) -> Result<f64, Problem>>;

/// The same on any lattice, with its measure.
pub(super) fn on(
    lattice: &Arc<Lattice>,
    input: String,
    truth: &'static str,
    measure: &Measure,
) -> Experiment {
    let defaults = RefineParams::default();
    let mut settings = Vec::new();
    for level in LEVELS {
        for (shape_weight, max_turn_degrees) in pairs(level, &defaults) {
            let params = RefineParams {
                target: target(level).into(),
                shape_weight,
                max_turn_degrees,
                ..defaults.clone()
            };
            let default = params == defaults;
            let knobs = [
                ("shape_weight", shape_weight.to_string()),
                ("max_turn_degrees", max_turn_degrees.to_string()),
            ];
            let (lattice, measure) = (lattice.clone(), measure.clone());
            let setting = Setting::new(knobs, default, move |exec| {
                let found = collapse(&lattice, &params, exec)?;
                let (measure, exec) = (measure.clone(), exec.clone());
                Ok(Box::new(move || {
                    let counters = [
                        ("triangles", found.lattice.triangles().len() as f64),
                        ("bound_mm", found.max_error_mm),
                        ("passes", f64::from(found.passes)),
                    ];
                    Ok(judged(measure(&found.lattice, &exec)?, counters))
                }))
            });
            settings.push(setting.of_task(format!("level {level}")));
        }
    }
    Experiment {
        stage: "refine",
        input,
        truth,
        measure: "distance of the triangles' middles from the truth, root mean square",
        unit: "mm",
        counted: None,
        voxel_mm: Some(lattice.grid().longest_edge()),
        work: ("triangles", lattice.triangles().len() as f64),
        settings,
    }
}

/// Weights and turns that are tried at a level.
fn pairs(level: f64, defaults: &RefineParams) -> Vec<(f64, f64)> {
    if !TRIED.contains(&level) {
        return vec![(defaults.shape_weight, defaults.max_turn_degrees)];
    }
    let weights = SHAPE_WEIGHTS.map(|w| (w, defaults.max_turn_degrees));
    let turns = TURNS.map(|turn| (defaults.shape_weight, turn));
    each_once(weights.into_iter().chain(turns))
}
