//! The solvers of masses on springs: how far from balance each number of iterations leaves them.

use std::sync::Arc;

use ivd_core::{ElementKey, Exec, Grid, Lattice, LatticeSource};
use ivd_deform::mass_spring::{Params, Prepared, Solver};
use ivd_deform::spring::{Action, Handle, HandleAt};

use super::inputs::judged;
use crate::experiment::{Experiment, Problem, Setting};

/// Most iterations of a run.
const ITERATIONS: [usize; 9] = [1, 3, 10, 30, 100, 300, 1000, 3000, 10_000];
/// Length of the one step that masses make (s).
const STEP: f64 = 0.02;
/// What the handle in the middle of a sheet does (mm), and the distance that it reaches: everything.
const LIFT: [f64; 3] = [2.0, 1.0, 8.0];
const REACH: f64 = 1e5;

/// A sheet of `side`² vertices, 1 mm apart.
fn sheet(side: usize) -> Result<Lattice, Problem> {
    let grid = Grid::with_spacing([side, side, 2], [1.0; 3])?;
    let at = |x: usize, y: usize| (x + side * y) as u32;
    let squares = (0..side - 1).flat_map(|y| (0..side - 1).map(move |x| (x, y)));
    let triangles = squares.flat_map(|(x, y)| {
        let [a, b, c, d] = [at(x, y), at(x + 1, y), at(x + 1, y + 1), at(x, y + 1)];
        [[a, b, c], [a, c, d]]
    });
    Ok(Lattice {
        triangles: triangles.collect(),
        keys: (0..side * side)
            .map(|i| ElementKey::new(grid.dims(), [i % side + 1, i / side + 1, 1], 2))
            .collect(),
        places: vec![[0.0, 0.0, 0.5]; side * side],
        source: LatticeSource::Mask,
        level: 0,
        max_error_mm: 0.0,
        coarser: Vec::new(),
        grid,
    })
}

/// The middle of a sheet is lifted, its corners stay: `size`² vertices, 100² at 128.
pub(super) fn experiment(size: usize, exec: &Exec) -> Result<Experiment, Problem> {
    let side = (size * 100 / 128).max(16);
    let corners = [0, side - 1, side * (side - 1), side * side - 1];
    let corners: Vec<Handle> = corners.iter().map(|&v| moved(v as u32, [0.0; 3])).collect();
    let handles = [vec![moved((side / 2 * (side + 1)) as u32, LIFT)], corners].concat();
    on(
        &Arc::new(sheet(side)?),
        &handles,
        format!("a sheet of {side}² vertices, its middle lifted, its corners held"),
        exec,
    )
}

fn moved(vertex: u32, by: [f64; 3]) -> Handle {
    Handle { at: HandleAt::Vertex(vertex), action: Action::Move(by), radius: REACH }
}

/// The same on any lattice and handles.
pub(super) fn on(
    lattice: &Arc<Lattice>,
    handles: &[Handle],
    input: String,
    exec: &Exec,
) -> Result<Experiment, Problem> {
    let handles: Arc<[Handle]> = handles.into();
    let mut settings = Vec::new();
    for (task, inertia) in [("balance", false), ("a step of 20 ms", true)] {
        for (name, solver, history) in [
            ("projective", Solver::Projective, 8),
            ("local–global", Solver::Projective, 0),
            ("xpbd", Solver::Xpbd, 0),
        ] {
            // It has no balance of its own: time has to pass.
            if solver == Solver::Xpbd && !inertia {
                continue;
            }
            let mut last = f64::INFINITY;
            for iterations in ITERATIONS {
                let params = Params {
                    solver,
                    history,
                    inertia: inertia && solver == Solver::Projective,
                    duration: STEP,
                    dt: inertia.then_some(STEP),
                    max_iterations: iterations,
                    tolerance: 1e-10,
                    ..Params::default()
                };
                let residual = solved(lattice, &handles, &params, exec)?;
                // Where nothing more is gained there is nothing more to show.
                if residual >= last {
                    break;
                }
                last = residual;
                let knobs = [("solver", name.to_owned()), ("iterations", iterations.to_string())];
                let (lattice, handles) = (lattice.clone(), handles.clone());
                let setting = Setting::new(knobs, false, move |exec| {
                    let residual = solved(&lattice, &handles, &params, exec)?;
                    Ok(Box::new(move || Ok(judged(residual, []))))
                });
                settings.push(setting.of_task(task.to_owned()));
            }
        }
    }
    Ok(Experiment {
        stage: "solvers",
        input,
        truth: "the balance of forces",
        measure: "unbalanced force relative to the handles' and inertia's",
        unit: "of it",
        counted: None,
        voxel_mm: None,
        work: ("vertices", lattice.keys.len() as f64),
        settings,
    })
}

/// What a run leaves unbalanced. Making ready counts: a matrix is factored there.
fn solved(lattice: &Lattice, handles: &[Handle], params: &Params, exec: &Exec) -> Result<f64, Problem> {
    Ok(Prepared::new(lattice, None, handles, &[], params, exec)?.update(handles, exec)?.residual)
}
