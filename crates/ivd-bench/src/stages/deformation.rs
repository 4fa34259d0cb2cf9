//! The whole deformation: the methods of mapping against finite elements, and level, solver and map together.

use std::sync::Arc;

use ivd_core::{Classified, Displacement, ErrorClass, Exec, Lattice, Motion};
use ivd_field::shape::{Kind, Shape};
use ivd_lattice::refine::{RefineParams, Target, collapse};
use ivd_map::{BiharmonicParams, DepthWeight, FemParams, MapResult, OctreeParams, biharmonic, fem, octree};
use ivd_motion::freeform;
use ivd_motion::handles::{Action, Anchor, Handle};
use ivd_motion::mass_spring::{self, Solver};
use ivd_motion::ring::{self, RingParams};
use ivd_session::MapChoice;

use crate::experiment::{Experiment, Problem, Scored, Setting};
use crate::inputs::{RADIUS_MM, ball, judged, root_mean_square};

/// Largest motion (mm) and radius (mm) of the handle at the ball's top.
const MOVE_MM: f64 = 5.0;
const REACH_MM: f64 = 20.0;
/// Angle of the twist at its middle (degrees).
const TWIST: f64 = 25.0;
/// Voxels along the cube of [`maps`] at least: the handle's radius is five of them.
const LEAST: usize = 32;
/// Levels of refinement.
const LEVELS: [u8; 4] = [0, 1, 2, 3];
const MEASURE: &str = "difference of the voxels' displacements where one moves, root mean square";

/// A push, a pull and a twist of a ball, carried to the voxels by every method.
pub(super) fn maps(size: usize, exec: &Exec) -> Result<Experiment, Problem> {
    let size = (size / 2).max(LEAST);
    let lattice = ball(size, exec)?;
    let input = format!("a ball of 40 mm in {size}³ voxels of {:.1} mm", lattice.grid().longest_edge());
    let top = [0.0, 0.0, RADIUS_MM];
    let pushed = |by: f64| -> Result<Motion, Problem> {
        let handle =
            Handle { at: Anchor::NearestTo(top), action: Action::Move([0.0, 0.0, by]), radius: REACH_MM };
        Ok(ring::solve(&lattice, &[handle], &[], &RingParams::default(), exec)?.motion)
    };
    let twist = Shape {
        kind: Kind::Rotate { angle: TWIST },
        centre: top,
        axis: [0.0, 0.0, 1.0],
        radius: REACH_MM,
        core: 0.3,
    };
    let twisted = freeform::lattice(&lattice, None, &[twist], exec)?.motion;
    let tasks = [("push", pushed(-MOVE_MM)?), ("pull", pushed(MOVE_MM)?), ("twist", twisted)];
    let tasks = tasks.map(|(name, motion)| (name.to_owned(), motion));
    on_maps(&Arc::new(lattice), tasks.into(), REACH_MM, input, exec)
}

/// Every map of each motion of a lattice, within a handle's `radius` (mm). No default is marked: which method one takes isn't
/// decided by how near it comes to one kind of matter.
pub(super) fn on_maps(
    lattice: &Arc<Lattice>,
    tasks: Vec<(String, Motion)>,
    radius: f64,
    input: String,
    exec: &Exec,
) -> Result<Experiment, Problem> {
    let (mut settings, mut reached) = (Vec::new(), 0);
    for (task, motion) in tasks {
        let truth = mapped(lattice, &motion, &finest(), exec)?;
        reached += truth.figures.voxels_moved;
        let (truth, motion) = (Arc::new(truth.displacement), Arc::new(motion));
        for (knobs, params) in methods(radius) {
            let (lattice, motion, truth) = (lattice.clone(), motion.clone(), truth.clone());
            if !holds(mapped(&lattice, &motion, &params, exec))? {
                continue;
            }
            let setting = Setting::new(knobs, false, move |exec| {
                let found = mapped(&lattice, &motion, &params, exec)?;
                let truth = truth.clone();
                Ok(Box::new(move || Ok(against(&truth, &found))))
            });
            settings.push(setting.of_task(task.clone()));
        }
    }
    Ok(Experiment {
        stage: "map-methods",
        input,
        truth: "finite elements on cells of one voxel",
        measure: MEASURE,
        unit: "mm",
        counted: None,
        voxel_mm: Some(lattice.grid().longest_edge()),
        work: ("voxels that move", reached as f64),
        settings,
    })
}

/// The map that all are held against.
fn finest() -> MapChoice {
    MapChoice::Fem(FemParams { cell: Some(1), ..FemParams::default() })
}

/// The methods with their own knobs round the defaults.
fn methods(radius: f64) -> Vec<(Vec<(&'static str, String)>, MapChoice)> {
    let octree = |params| MapChoice::Octree(params);
    let plain = OctreeParams::default();
    let mut all = Vec::new();
    let mut add = |knobs: &[(&'static str, &str)], params: MapChoice| {
        all.push((knobs.iter().map(|(name, value)| (*name, (*value).to_owned())).collect(), params));
    };
    for (word, weight) in [
        ("linear", DepthWeight::Linear),
        ("smooth", DepthWeight::Smooth),
        ("exponential", DepthWeight::Exponential),
        ("one", DepthWeight::One),
    ] {
        add(&[("method", "octree"), ("weight", word)], octree(OctreeParams { weight, ..plain.clone() }));
    }
    for (word, times) in [("half the radius", 0.5), ("twice the radius", 2.0)] {
        let depth = Some(times * radius);
        add(
            &[("method", "octree"), ("weight", "smooth"), ("depth", word)],
            octree(OctreeParams { depth, ..plain.clone() }),
        );
    }
    for (edge, cell) in [("4", Some(4)), ("2", Some(2))] {
        let smooth = BiharmonicParams { cell, ..BiharmonicParams::default() };
        add(&[("method", "biharmonic"), ("cell", edge)], MapChoice::Biharmonic(smooth));
    }
    for (edge, cell) in [("4", Some(4)), ("2", Some(2))] {
        let elastic = FemParams { cell, ..FemParams::default() };
        add(&[("method", "fem"), ("cell", edge)], MapChoice::Fem(elastic));
    }
    let fine = BiharmonicParams { cell: Some(1), ..BiharmonicParams::default() };
    add(&[("method", "biharmonic"), ("cell", "1")], MapChoice::Biharmonic(fine));
    all
}

/// A push of a ball by every level, solver and map.
pub(super) fn whole(size: usize, exec: &Exec) -> Result<Experiment, Problem> {
    let lattice = ball(size / 2, exec)?;
    let input =
        format!("a ball of 40 mm in {}³ voxels of {:.1} mm, pushed", size / 2, lattice.grid().longest_edge());
    let at = Anchor::NearestTo([0.0, 0.0, RADIUS_MM]);
    let handle = Handle { at, action: Action::Move([0.0, 0.0, -MOVE_MM]), radius: REACH_MM };
    on_whole(&lattice, &handle, input, exec)
}

/// The same on any lattice.
pub(super) fn on_whole(
    lattice: &Lattice,
    handle: &Handle,
    input: String,
    exec: &Exec,
) -> Result<Experiment, Problem> {
    let truth = deformed(lattice, handle, Some(Solver::Projective), &finest(), exec)?;
    let reached = truth.figures.voxels_moved as f64;
    let truth = Arc::new(truth.displacement);
    let mut settings = Vec::new();
    for level in LEVELS {
        let refine = RefineParams { target: Target::Level(level).into(), ..RefineParams::default() };
        let lattice = match level {
            0 => Arc::new(lattice.clone()),
            _ => Arc::new(collapse(lattice, &refine, exec)?.lattice),
        };
        for (name, solver) in SOLVERS {
            for (knobs, params) in maps_of_whole(handle.radius) {
                let default = refine == RefineParams::default() && solver.is_none();
                let default = default && params == MapChoice::default();
                if !default && !holds(deformed(&lattice, handle, solver, &params, exec))? {
                    continue;
                }
                let (lattice, handle, truth) = (lattice.clone(), *handle, truth.clone());
                let first = [("refine.level", level.to_string()), ("solver", name.to_owned())];
                settings.push(Setting::new(first.into_iter().chain(knobs), default, move |exec| {
                    let found = deformed(&lattice, &handle, solver, &params, exec)?;
                    let truth = truth.clone();
                    Ok(Box::new(move || Ok(against(&truth, &found))))
                }));
            }
        }
    }
    Ok(Experiment {
        stage: "deformation",
        input,
        truth: "the unrefined lattice, springs in balance, finite elements on cells of one voxel",
        measure: MEASURE,
        unit: "mm",
        counted: None,
        voxel_mm: Some(lattice.grid().longest_edge()),
        work: ("voxels that move", reached),
        settings,
    })
}

/// The solvers; without one it is the ring.
const SOLVERS: [(&str, Option<Solver>); 4] = [
    ("ring", None),
    ("dynamics", Some(Solver::Dynamics)),
    ("projective", Some(Solver::Projective)),
    ("xpbd", Some(Solver::Xpbd)),
];

/// Methods and depths, the default first.
fn maps_of_whole(radius: f64) -> Vec<(Vec<(&'static str, String)>, MapChoice)> {
    let octree = |word: &str, times: Option<f64>| {
        let depth = times.map(|times| times * radius);
        let knobs = vec![("map", "octree".to_owned()), ("depth", word.to_owned())];
        (knobs, MapChoice::Octree(OctreeParams { depth, ..OctreeParams::default() }))
    };
    let others = [
        ("biharmonic", MapChoice::Biharmonic(BiharmonicParams::default())),
        ("fem", MapChoice::Fem(FemParams::default())),
    ];
    let others = others.map(|(word, choice)| (vec![("map", word.to_owned())], choice));
    let depths = [octree("the radius", None), octree("half of it", Some(0.5)), octree("twice it", Some(2.0))];
    depths.into_iter().chain(others).collect()
}

/// Whether a setting gives a map that can be trusted; one that is refused isn't compared.
fn holds(found: Result<MapResult, Problem>) -> Result<bool, Problem> {
    let Err(problem) = found else { return Ok(true) };
    let of_solver = problem.downcast_ref::<ivd_core::Error>().map(Classified::error_class);
    let of_map = problem.downcast_ref::<ivd_map::Error>().map(Classified::error_class);
    if of_solver.or(of_map) == Some(ErrorClass::Untrusted) { Ok(false) } else { Err(problem) }
}

/// Solver and map in one go, as a user waits for them; the ring without a solver.
pub(super) fn deformed(
    lattice: &Lattice,
    handle: &Handle,
    solver: Option<Solver>,
    params: &MapChoice,
    exec: &Exec,
) -> Result<MapResult, Problem> {
    let handles = std::slice::from_ref(handle);
    let motion = match solver {
        None => ring::solve(lattice, handles, &[], &RingParams::default(), exec)?.motion,
        Some(solver) => {
            let springs = mass_spring::Params { solver, ..mass_spring::Params::default() };
            mass_spring::solve(lattice, None, handles, &[], &springs, exec)?.motion
        }
    };
    mapped(lattice, &motion, params, exec)
}

fn mapped(lattice: &Lattice, motion: &Motion, choice: &MapChoice, exec: &Exec) -> Result<MapResult, Problem> {
    let last = motion.frames().len() - 1;
    Ok(match choice {
        MapChoice::Octree(params) => {
            let tree = ivd_octree::build(lattice, &ivd_octree::Params::default(), exec)?;
            octree(lattice, &tree, motion, last, params, exec)?
        }
        MapChoice::Biharmonic(params) => biharmonic(lattice, motion, last, params, exec)?,
        MapChoice::Fem(params) => fem(lattice, None, motion, last, params, exec)?,
    })
}

fn against(truth: &Displacement, found: &MapResult) -> Scored {
    let (error, most) = apart(&found.displacement, truth);
    let counters = [
        ("max_mm", most),
        ("voxels_moved", found.figures.voxels_moved as f64),
        ("min_det_j", found.figures.min_det_j),
        ("misfit", found.figures.followed.misfit),
    ];
    judged(error, counters)
}

/// Root mean square and largest difference of two displacements (mm), where either moves.
pub(super) fn apart(a: &Displacement, b: &Displacement) -> (f64, f64) {
    let places = (0..a.grid().len()).map(|i| a.grid().index(i));
    let squares = places
        .map(|at| (a.forward().at(at), b.forward().at(at)))
        .filter(|(a, b)| a.iter().chain(b).any(|&c| c != 0.0))
        .map(|(a, b)| a.iter().zip(b).map(|(a, b)| f64::from(a - b).powi(2)).sum::<f64>());
    let squares: Vec<f64> = squares.collect();
    let most = squares.iter().copied().fold(0.0, f64::max).sqrt();
    (root_mean_square(squares.into_iter()), most)
}
