use std::sync::Arc;

use ivd_core::{Exec, Lattice};
use ivd_motion::handles::{Action, Anchor, Handle};
use ivd_motion::ring::{self, RingParams};

use crate::experiment::{Experiment, Problem, Setting};
use crate::inputs::{RADIUS_MM, ball, each_once, judged, root_mean_square};

/// Steps over the duration, and shares of the force below which a vertex passes none on.
const STEPS: [u32; 8] = [32, 50, 100, 200, 400, 800, 1600, 3200];
const EPSILONS: [f64; 5] = [1e-1, 1e-2, 1e-3, 1e-4, 0.0];
/// The pull (mN).
const FORCE_MN: f64 = 300.0;
/// The truth's steps.
const FINEST: f64 = 12_800.0;

/// Time steps, and where forces end, against what a very short step gives.
pub(super) fn experiment(size: usize, exec: &Exec) -> Result<Experiment, Problem> {
    let lattice = Arc::new(ball(size / 2, exec)?);
    let input = format!("the lattice of a ball of 40 mm, {} vertices, pulled by 0.3 N", lattice.keys().len());
    on(&lattice, pulled(), input, exec)
}

/// The same on any lattice.
pub(super) fn on(
    lattice: &Arc<Lattice>,
    handle: Handle,
    input: String,
    exec: &Exec,
) -> Result<Experiment, Problem> {
    let handles = Arc::new([handle]);
    let defaults = RingParams::default();
    let default_steps = ring::solve(lattice, &*handles, &[], &defaults, exec)?.steps as u32;
    let params = move |steps: f64, epsilon: f64| {
        let defaults = RingParams::default();
        RingParams { dt: Some(defaults.duration / steps), epsilon, ..defaults }
    };
    let finest = Arc::new(displacements(lattice, &*handles, &params(FINEST, 0.0), exec)?.0);
    let by_steps = STEPS.map(|steps| (steps, defaults.epsilon));
    let by_epsilon = EPSILONS.map(|epsilon| (default_steps, epsilon));
    let pairs = each_once(by_steps.into_iter().chain(by_epsilon));
    let settings = pairs.into_iter().map(|(steps, epsilon)| {
        let (lattice, finest, handles) = (lattice.clone(), finest.clone(), handles.clone());
        let default = steps == default_steps && epsilon == defaults.epsilon;
        let knobs = [("steps", steps.to_string()), ("epsilon", epsilon.to_string())];
        Setting::new(knobs, default, move |exec| {
            let (found, moved) =
                displacements(&lattice, &*handles, &params(f64::from(steps), epsilon), exec)?;
            let (finest, lattice) = (finest.clone(), lattice.clone());
            Ok(Box::new(move || {
                let squares = found
                    .iter()
                    .zip(&*finest)
                    .map(|(a, b)| a.iter().zip(b).map(|(a, b)| (a - b).powi(2)).sum::<f64>());
                let work = f64::from(steps) * springs(&lattice, &found) as f64;
                Ok(judged(
                    root_mean_square(squares),
                    [("vertices_moved", moved as f64), ("steps × springs", work)],
                ))
            }))
        })
    });
    Ok(Experiment {
        stage: "deform",
        input,
        truth: "12,800 steps, every force passed on",
        measure: "difference of the vertices' displacements, root mean square",
        unit: "mm",
        counted: Some("steps × springs"),
        voxel_mm: Some(lattice.grid().longest_edge()),
        work: ("springs", springs(lattice, &finest) as f64),
        settings: settings.collect(),
    })
}

/// Displacement of every vertex (mm), and how many move.
fn displacements(
    lattice: &Lattice,
    handles: &[Handle],
    params: &RingParams,
    exec: &Exec,
) -> Result<(Vec<[f64; 3]>, usize), Problem> {
    let solved = ring::solve(lattice, handles, &[], params, exec)?;
    let frame = solved.motion.frames().last().ok_or("a motion without frames")?;
    Ok((frame.displacement.to_vec(), solved.vertices_moved))
}

/// Edges of the lattice with an end that moves: what a time step works on.
fn springs(lattice: &Lattice, displacement: &[[f64; 3]]) -> usize {
    let moves = |v: u32| displacement[v as usize] != [0.0; 3];
    let sides = lattice.triangles().iter().flat_map(|t| [[t[0], t[1]], [t[1], t[2]], [t[2], t[0]]]);
    // Every edge is a side of two triangles, once in each direction.
    sides.filter(|[a, b]| a < b && (moves(*a) || moves(*b))).count()
}

/// A force on the ball's top, which rings pass on.
fn pulled() -> Handle {
    let at = Anchor::NearestTo([0.0, 0.0, RADIUS_MM]);
    Handle { at, action: Action::Force([0.0, 0.0, FORCE_MN]), radius: 50.0 }
}
