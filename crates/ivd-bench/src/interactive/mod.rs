//! A handle that is dragged: what every frame costs, by level of refinement and solver, and how far it is from the finest level.
//!
//! The outermost vertex along y near the middle of the coarsest surface is dragged along a closed loop out of the surface, into it and
//! sideways; the farthest it goes is an eighth of the handle's radius. Every frame is one event of an
//! [`ivd_session::Session`]: springs, map, inverse and the voxels that changed. What is made ready before the first frame, when the
//! handle is placed, is timed by itself. The same is done through the frame service, to the picture: see [`FrameBench`].

mod frames;
mod page;

use std::time::Instant;

use cpu_time::ProcessTime;
use ivd_core::{Classified, ErrorClass, Exec, FieldBricks, Lattice, Volume, VoxelIndex, VoxelType};
use ivd_frames::Source;
use ivd_lattice::extract::{ExtractParams, Iso, extract};
use ivd_lattice::refine::{RefineParams, Target, collapse};
use ivd_motion::handles::{Action, Anchor, Handle};
use ivd_motion::mass_spring::{self, Solver};
use ivd_motion::ring::RingParams;
use ivd_session::{Event, Physics, Session, Settings};
use nalgebra::Vector3;
use serde::Serialize;

pub use frames::{FrameBench, followed};
pub use page::interactive_page;

use crate::experiment::Problem;
use crate::{Error, Options};

/// Frames of a drag, and of a quick one.
const FRAMES: [usize; 2] = [200, 40];
/// Radius of the handle (voxels).
const RADIUS: f64 = 25.0;
/// Part of the radius that the handle moves at most.
const FARTHEST: f64 = 0.125;
/// Part of the radius that the handle of springs grips: a single vertex is drawn out of a sheet of springs as a needle.
const GRIP: f64 = 0.2;
/// Levels of refinement that are tried.
const LEVELS: [u8; 5] = [0, 1, 2, 3, 4];
/// Largest edge of a generated head (voxels), and where it is cut: between its fluid and its grey matter.
const HEAD: (usize, f64) = (128, 0.375);

/// Drags over one volume.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct InteractiveBench {
    /// Version of this layout: 3.
    pub schema: u32,
    /// Version of the program.
    pub version: String,
    /// Worker threads.
    pub threads: usize,
    /// The volume and its surface, in words.
    pub input: String,
    /// Voxels of the volume.
    pub dims: [usize; 3],
    /// Radius of the handle (mm).
    pub radius_mm: f64,
    /// Farthest that the handle moves (mm).
    pub farthest_mm: f64,
    /// One for every solver and level, level by level.
    pub drags: Vec<Drag>,
    /// The same through the frame service, to the picture.
    pub frames: FrameBench,
}

/// One drag.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Drag {
    /// Solver.
    pub solver: String,
    /// Level of refinement.
    pub level: u8,
    /// Vertices of its lattice.
    pub vertices: usize,
    /// What every frame took.
    pub frames: Vec<FrameCost>,
    /// Processor time of a frame (ms, all threads): the middle one, the 99th of a hundred, the first.
    pub cpu_ms: [f64; 3],
    /// The same of wall time (ms).
    pub wall_ms: [f64; 3],
    /// What it took to place the handle: processor time and wall time (ms).
    pub placed_ms: [f64; 2],
    /// Voxels computed in the middle frame.
    pub voxels: u64,
    /// Root mean square and largest difference of the voxels' motion from that of level 0 where the handle is farthest out (voxels),
    /// over all voxels that either moves. Not a number where either refused that frame.
    pub error_voxel: [f64; 2],
    /// Frames that were refused, which leave the volume as it was.
    pub refused: usize,
}

/// What a frame took.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct FrameCost {
    /// Wall time (ms).
    pub wall_ms: f64,
    /// Processor time of all threads (ms).
    pub cpu_ms: f64,
    /// Voxels computed.
    pub voxels: u64,
    /// Bricks named as changed.
    pub bricks: usize,
}

/// Drags a handle over the volume of `options`, or over a generated head; then through the frame service.
///
/// - `iso`: where the given volume is cut; without it, the densest part's own value.
/// - `source`: what the frame service opens.
///
/// # Errors
/// [`Error::Failed`] with what failed; cancelled.
pub fn interactive(
    options: &Options,
    iso: Option<f64>,
    source: &Source,
    exec: &Exec,
) -> Result<InteractiveBench, Error> {
    let failed = |knobs: &str, problem: Problem| Error::Failed {
        stage: "interactive".to_owned(),
        knobs: knobs.to_owned(),
        problem: problem.to_string(),
    };
    let quick = usize::from(options.repeats <= Options::quick().repeats);
    let frames =
        frames::followed(source, frames::EVENTS[quick], exec).map_err(|problem| failed("frames", problem))?;
    measured(options, iso, FRAMES[quick], frames, exec).map_err(|problem| failed("the drag", problem))
}

fn measured(
    options: &Options,
    iso: Option<f64>,
    count: usize,
    frames: FrameBench,
    exec: &Exec,
) -> Result<InteractiveBench, Problem> {
    let (words, volume, lattice) = input(options, iso, exec)?;
    let voxel = volume.grid().spacing().iter().product::<f64>().cbrt();
    let radius = RADIUS * voxel;
    // A vertex that all levels have, or nearly.
    let coarsest = RefineParams { target: Target::Level(LEVELS[4]).into(), ..RefineParams::default() };
    let top = outermost(&collapse(&lattice, &coarsest, exec)?.lattice)?;
    let path = path(count, FARTHEST * radius);
    let solvers = [("ring", Physics::Ring(RingParams::default())), ("projective", projective(GRIP * radius))];
    exec.observer().begin("drags", (solvers.len() * LEVELS.len()) as u64);
    let mut drags = Vec::new();
    for (name, physics) in solvers {
        let mut finest: Option<FieldBricks> = None;
        for level in LEVELS {
            let settings = Settings { level, physics: physics.clone(), ..Settings::default() };
            let mut session = Session::new(volume.clone(), lattice.clone(), None, settings, exec)?;
            let handle = Handle { at: top, action: Action::Move([0.0; 3]), radius };
            let (drag, field) = drag(&mut session, handle, &path, exec)?;
            if level == LEVELS[0] {
                finest.clone_from(&field);
            }
            let error_voxel = match (&finest, &field) {
                (Some(finest), Some(field)) => difference(finest, field, voxel),
                _ => [f64::NAN; 2],
            };
            drags.push(Drag { solver: name.to_owned(), level, error_voxel, ..drag });
            exec.observer().advance("drags", 1);
        }
    }
    exec.observer().end("drags");
    Ok(InteractiveBench {
        schema: 3,
        version: env!("CARGO_PKG_VERSION").to_owned(),
        threads: exec.threads(),
        input: words,
        dims: volume.grid().dims(),
        radius_mm: radius,
        farthest_mm: FARTHEST * radius,
        drags,
        frames,
    })
}

fn projective(grip: f64) -> Physics {
    let params = mass_spring::Params {
        solver: Solver::Projective,
        springs: mass_spring::Springs { grip: Some(grip), ..mass_spring::Springs::default() },
        ..mass_spring::Params::default()
    };
    Physics::Springs(Box::new(params))
}

fn input(options: &Options, iso: Option<f64>, exec: &Exec) -> Result<(String, Volume, Lattice), Problem> {
    let cut = |volume: &Volume, iso: f64| -> Result<Lattice, Problem> {
        Ok(extract(volume, None, &ExtractParams { iso: Iso::Value(iso) }, exec)?.lattice)
    };
    if let Some(given) = &options.input {
        let volume = Volume::clone(&given.volume);
        let (what, lattice) = match iso {
            Some(iso) => (format!("the surface at {iso}"), cut(&volume, iso)?),
            None => ("the densest part".to_owned(), crate::stages::part(&volume, exec)?),
        };
        return Ok((format!("{what} of {}", given.name), volume, lattice));
    }
    let size = options.size.min(HEAD.0);
    let voxel_type = VoxelType::F32;
    let params = ivd_phantom::Params { size, noise: Some(0.0), voxel_type, ..ivd_phantom::Params::default() };
    let volume = ivd_phantom::generate(&params, exec)?.volume;
    let lattice = cut(&volume, HEAD.1)?;
    Ok((format!("a generated head, {size}³ voxels"), volume, lattice))
}

/// The vertex furthest along y of those within a tenth of the surface's size of its middle in x and z.
fn outermost(lattice: &Lattice) -> Result<Anchor, Problem> {
    let places: Vec<Vector3<f64>> = (0..lattice.keys().len()).map(|v| lattice.world(v).0).collect();
    let low = places.iter().copied().reduce(|a, b| a.inf(&b)).ok_or("the surface has no vertex")?;
    let high = places.iter().copied().reduce(|a, b| a.sup(&b)).ok_or("the surface has no vertex")?;
    let (middle, near) = ((low + high) / 2.0, 0.1 * (high - low).amax());
    let central = |p: &&Vector3<f64>| (p.x - middle.x).abs().max((p.z - middle.z).abs()) <= near;
    let by_y = |a: &&Vector3<f64>, b: &&Vector3<f64>| a.y.total_cmp(&b.y);
    let top = places.iter().filter(central).max_by(by_y).or(places.iter().max_by(by_y));
    Ok(Anchor::NearestTo((*top.expect("there is a vertex")).into()))
}

/// Where the handle is in every frame (mm, from rest): a closed loop, farthest out at a quarter of it.
fn path(frames: usize, farthest: f64) -> Vec<[f64; 3]> {
    let at = |k: usize| {
        let t = std::f64::consts::TAU * (k as f64 / frames as f64);
        // At most 1 long, and that where t is a quarter.
        let [out, along, up] = [t.sin(), 0.5 * (2.0 * t).sin(), 0.3 * (3.0 * t).cos() * t.cos()];
        [along, out, up].map(|c| farthest * c)
    };
    (1..=frames).map(at).collect()
}

/// Drags the handle along the path; what it cost, and the voxels' motion where it was farthest out.
fn drag(
    session: &mut Session,
    handle: Handle,
    path: &[[f64; 3]],
    exec: &Exec,
) -> Result<(Drag, Option<FieldBricks>), Problem> {
    let (wall, cpu) = (Instant::now(), ProcessTime::now());
    session.apply(Event::Add { id: None, handle }, exec)?;
    let placed_ms = [cpu.elapsed(), wall.elapsed()].map(|time| 1e3 * time.as_secs_f64());
    let (mut frames, mut refused) = (Vec::with_capacity(path.len()), 0);
    let mut farthest = None;
    for (k, by) in path.iter().enumerate() {
        exec.check_cancelled()?;
        let (wall, cpu) = (Instant::now(), ProcessTime::now());
        let update = session.apply(Event::Move { handle: 0, by: *by }, exec);
        let (wall, cpu) = (wall.elapsed(), cpu.elapsed());
        let (voxels, bricks, followed) = match update {
            Ok(update) => (update.voxels, update.dirty.len(), true),
            Err(error) if error.error_class() == ErrorClass::Untrusted => (0, 0, false),
            Err(error) => return Err(error.into()),
        };
        refused += usize::from(!followed);
        frames.push(FrameCost {
            wall_ms: 1e3 * wall.as_secs_f64(),
            cpu_ms: 1e3 * cpu.as_secs_f64(),
            voxels,
            bricks,
        });
        if 4 * (k + 1) == path.len() && followed {
            farthest = Some(session.displacement().forward().clone());
        }
    }
    let figures = |of: fn(&FrameCost) -> f64| {
        let all: Vec<f64> = frames.iter().map(of).collect();
        [rank(&all, 0.5), rank(&all, 0.99), all[0]]
    };
    let (cpu_ms, wall_ms) = (figures(|f| f.cpu_ms), figures(|f| f.wall_ms));
    let drag = Drag {
        solver: String::new(),
        level: session.settings().level,
        vertices: session.lattice().keys().len(),
        cpu_ms,
        wall_ms,
        placed_ms,
        voxels: frames[frames.len() / 2].voxels,
        error_voxel: [0.0; 2],
        refused,
        frames,
    };
    Ok((drag, farthest))
}

/// The value that a share of all is not above; of one at least.
fn rank(all: &[f64], share: f64) -> f64 {
    let mut sorted = all.to_vec();
    sorted.sort_by(f64::total_cmp);
    sorted[((share * sorted.len() as f64).ceil() as usize).clamp(1, sorted.len()) - 1]
}

/// Root mean square and largest difference of two fields (voxels) where either isn't 0.
fn difference(a: &FieldBricks, b: &FieldBricks, voxel: f64) -> [f64; 2] {
    let (mut squares, mut count, mut most) = (0.0, 0_u64, 0.0_f64);
    let [nx, ny, nz] = a.dims();
    let [bx, by, _] = a.brick_dims();
    for brick in (0..a.table().len()).filter(|&i| a.brick(i).is_some() || b.brick(i).is_some()) {
        let start = [8 * (brick % bx), 8 * (brick / bx % by), 8 * (brick / (bx * by))];
        for z in start[2]..(start[2] + 8).min(nz) {
            for y in start[1]..(start[1] + 8).min(ny) {
                for x in start[0]..(start[0] + 8).min(nx) {
                    let [u, v] =
                        [a, b].map(|field| Vector3::from(field.at(VoxelIndex([x, y, z]))).map(f64::from));
                    if u != Vector3::zeros() || v != Vector3::zeros() {
                        let d = (u - v).norm() / voxel;
                        (squares, count, most) = (squares + d * d, count + 1, most.max(d));
                    }
                }
            }
        }
    }
    [(squares / count.max(1) as f64).sqrt(), most]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn drags_move_voxels_and_coarser_levels_are_further_from_the_finest() {
        let options = Options { size: 64, repeats: 1, ..Options::default() };
        let keys = [
            "input.size=48",
            "refine.level=1",
            "deform.handle.0.pick=[24.0, 44.75, 22.0]",
            "deform.handle.0.move=[0.0, -2.0, 0.0]",
            "deform.handle.0.radius=11.0",
        ];
        let overrides = keys.map(|key| key.parse().unwrap()).to_vec();
        let head = Source { overrides, ..Source::default() };
        let frames = frames::followed(&head, 12, &Exec::default()).unwrap();
        assert_eq!((frames.dims[0], frames.event_ms.len(), frames.refused), (48, 12, 0));
        assert_eq!(frames.divided.iter().sum::<usize>(), 12);
        assert!(frames.coarse_error.is_none_or(|[rms, most]| rms > 0.0 && rms < most));
        let bench = measured(&options, None, 8, frames, &Exec::default()).unwrap();
        assert_eq!(bench.drags.len(), 2 * LEVELS.len());
        for drag in &bench.drags {
            // The coarsest surfaces of so small a head, of triangles as large as the push, may be too stiff to be followed.
            assert!(drag.refused == 0 || drag.level > 2, "{} {}", drag.solver, drag.level);
            assert!(drag.frames.iter().filter(|f| f.bricks == 0).count() >= drag.refused);
            assert!(drag.frames.iter().all(|f| f.bricks == 0 || f.voxels > 1000));
            assert!(drag.cpu_ms[0] <= drag.cpu_ms[1] && drag.wall_ms[0] <= drag.wall_ms[1]);
            let [rms, most] = drag.error_voxel;
            assert!(
                (drag.level > 2 || rms <= most) && (drag.level == 0) == (most == 0.0),
                "{} {}: {rms}",
                drag.solver,
                drag.level
            );
        }
        for solver in bench.drags.chunks(LEVELS.len()) {
            assert!(solver[0].vertices > 20 * solver[4].vertices);
            assert!(solver[1].error_voxel[0] < solver[2].error_voxel[0], "{}", solver[0].solver);
        }
        let page = interactive_page(&bench);
        assert!(page.contains("projective") && page.contains("<svg") && page.contains("frame service"));
    }

    #[test]
    fn the_path_is_closed_and_goes_farthest_at_its_quarter() {
        let path = path(200, 3.0);
        let length = |by: &[f64; 3]| by.iter().map(|c| c * c).sum::<f64>().sqrt();
        let most = path.iter().map(length).fold(0.0, f64::max);
        assert!((length(&path[49]) - 3.0).abs() < 1e-9 && most <= 3.0 * 1.1, "{most}");
    }

    #[test]
    fn fields_differ_by_what_they_do() {
        let brick =
            |value: f32| FieldBricks::new([8, 8, 4], vec![0], vec![[value, 0.0, 0.0]; 512].into()).unwrap();
        assert_eq!(difference(&brick(1.0), &brick(3.0), 0.5), [4.0, 4.0]);
        assert_eq!(difference(&brick(1.0), &FieldBricks::zero([8, 8, 4]), 1.0), [1.0, 1.0]);
        assert_eq!(difference(&FieldBricks::zero([8; 3]), &FieldBricks::zero([8; 3]), 1.0), [0.0, 0.0]);
    }
}
