//! The implicit solvers of masses on springs against each other: how far above the least energy each ends, and after how long.
//!
//! The objective is compared, not its gradient: springs that push buckle, and where a sheet is about to, the objective is flat and
//! still high. One implicit step from rest without drag has its objective in what solvers report: the energy of springs and of motion at
//! its end. A long step has no motion that counts, and is a balance to the solver that has steps only.

use std::cell::RefCell;
use std::rc::Rc;
use std::sync::Arc;
use std::time::Instant;

use ivd_core::{ElementKey, Exec, Grid, Lattice, LatticeSource};
use ivd_motion::handles::{Action, Anchor, Handle, Pin};
use ivd_motion::mass_spring::{Closeness, Descent, MassSpringResult, Params, Prepared, Solver, Springs};

use crate::experiment::{Experiment, Problem, Setting};
use crate::inputs::judged;

/// Iterations after which solvers are looked at.
const ITERATIONS: [usize; 7] = [5, 10, 20, 50, 100, 200, 500];
/// More aren't tried where a run took longer (s).
const PATIENCE_S: f64 = 4.0;
/// Iterations of the solution that the others are held against, as many times the most that are tried.
const FINEST: usize = 5;
/// The step (s), and one in which motion doesn't count.
const STEP_S: f64 = 0.02;
const LONG_S: f64 = 1e4;
/// How far the sheet's middle is moved (mm), and how wide it is gripped (mm).
const MOVE_MM: f64 = 8.0;
const GRIP_MM: f64 = 10.0;

/// A prepared body of one setting; what it keeps is a factored matrix.
type Ready = Rc<RefCell<Prepared<Arc<Lattice>>>>;

/// What is asked for.
#[derive(Clone, Copy, PartialEq)]
enum Task {
    Balance,
    Step,
}

impl Task {
    const ALL: [Self; 2] = [Self::Balance, Self::Step];

    fn words(self) -> &'static str {
        match self {
            Self::Balance => "balance",
            Self::Step => "a step of 20 ms",
        }
    }
}

/// Solvers, in the words of the scene file: the quasi-Newton method, the same without memory, constraints one by one.
const SOLVERS: [(&str, Solver, usize); 3] = [
    ("projective", Solver::Projective, 8),
    ("local-global", Solver::Projective, 0),
    ("xpbd", Solver::Xpbd, 8),
];

/// A sheet held at its corners and lifted in the middle.
pub(super) fn experiment(size: usize, exec: &Exec) -> Result<Experiment, Problem> {
    let side = (size * 100 / 128).max(8);
    let lattice = Arc::new(sheet(side)?);
    let corner = |v: usize| Pin { at: Anchor::Vertex(v as u32), radius: 0.0 };
    let fixed = [0, side - 1, side * (side - 1), side * side - 1].map(corner);
    let middle = Anchor::Vertex((side / 2 * (side + 1)) as u32);
    let handle = Handle { at: middle, action: Action::Move([0.0, 0.0, MOVE_MM]), radius: 2.0 * side as f64 };
    let input = format!("a sheet of {side}² vertices held at its corners, its middle lifted by {MOVE_MM} mm");
    on(&lattice, &handle, &fixed, GRIP_MM, input, exec)
}

/// The same on any lattice.
pub(super) fn on(
    lattice: &Arc<Lattice>,
    handle: &Handle,
    fixed: &[Pin],
    grip: f64,
    input: String,
    exec: &Exec,
) -> Result<Experiment, Problem> {
    let (mut settings, mut springs) = (Vec::new(), 0);
    for task in Task::ALL {
        let prepared = |solver: Solver, history: usize, max_iterations: usize| -> Result<Ready, Problem> {
            let params = params(task, solver, history, max_iterations, grip);
            let ready = Prepared::new(lattice.clone(), None, &[*handle], fixed, &params, exec)?;
            Ok(Rc::new(RefCell::new(ready)))
        };
        // Every setting once: how far down any of them comes is known before one is judged, and who takes too long.
        let (mut tried, mut least, mut most) = (Vec::new(), f64::INFINITY, 0);
        for (name, solver, history) in SOLVERS {
            for iterations in ITERATIONS {
                let ready = prepared(solver, history, iterations)?;
                solved(&ready, handle, exec)?;
                let began = Instant::now();
                let found = solved(&ready, handle, exec)?;
                springs = found.springs;
                least = least.min(found.energy_last);
                let ended = found.iterations < iterations;
                tried.push((name, iterations, ready));
                if began.elapsed().as_secs_f64() > PATIENCE_S || ended {
                    break;
                }
                most = most.max(iterations);
            }
        }
        let (_, solver, history) = SOLVERS[0];
        let finest = prepared(solver, history, FINEST * most.max(ITERATIONS[0]))?;
        least = least.min(solved(&finest, handle, exec)?.energy_last);
        for (name, iterations, ready) in tried {
            let handle = *handle;
            let knobs = [("solver", name.to_owned()), ("max_iterations", iterations.to_string())];
            let setting = Setting::new(knobs, false, move |exec| {
                let found = solved(&ready, &handle, exec)?;
                Ok(Box::new(move || {
                    let counters = [
                        ("iterations", found.iterations as f64),
                        ("energy_nj", found.energy_last),
                        ("residual", found.residual),
                        ("max_mm", found.max_displacement_mm),
                    ];
                    Ok(judged(found.energy_last / least - 1.0, counters))
                }))
            });
            settings.push(setting.of_task(task.words().to_owned()));
        }
    }
    Ok(Experiment {
        stage: "solvers",
        input,
        truth: "the least energy that any of them or five times as many iterations found",
        measure: "energy above it",
        unit: "of it",
        counted: None,
        voxel_mm: None,
        work: ("springs", springs as f64),
        settings,
    })
}

/// Solves from rest, with what was factored before.
fn solved(ready: &Ready, handle: &Handle, exec: &Exec) -> Result<MassSpringResult, Problem> {
    let mut ready = ready.borrow_mut();
    ready.forget();
    Ok(ready.update(&[*handle], exec)?)
}

/// One step or the balance, ended by the number of iterations only.
fn params(task: Task, solver: Solver, history: usize, max_iterations: usize, grip: f64) -> Params {
    let step = if task == Task::Balance { LONG_S } else { STEP_S };
    Params {
        solver,
        springs: Springs {
            grip: Some(grip),
            duration: step,
            dt: Some(step),
            ramp: Some(0.0),
            drag: 0.0,
            // The sheet buckles, which is what solvers differ at.
            push: Some(true),
            ..Springs::default()
        },
        closeness: Closeness { max_iterations, tolerance: 1e-12 },
        descent: Descent { history, inertia: task == Task::Step },
    }
}

/// A sheet of squares of 1 mm, halved by diagonals that are mirrored about the middle.
fn sheet(side: usize) -> Result<Lattice, Problem> {
    let dims = [side, side, 2];
    let at = |x: usize, y: usize| (x + side * y) as u32;
    let halves = |i: usize| {
        let (x, y) = (i % (side - 1), i / (side - 1));
        let [a, b, c, d] = [at(x, y), at(x + 1, y), at(x + 1, y + 1), at(x, y + 1)];
        if x < side / 2 { [[a, b, c], [a, c, d]] } else { [[a, b, d], [b, c, d]] }
    };
    Ok(Lattice::new(
        Grid::with_spacing(dims, [1.0; 3])?,
        (0..side * side).map(|i| ElementKey::new(dims, [i % side + 1, i / side + 1, 1], 2)).collect(),
        vec![[0.0, 0.0, 0.5]; side * side].into(),
        (0..(side - 1).pow(2)).flat_map(halves).collect(),
    )?
    .with_source(LatticeSource::Mask))
}
