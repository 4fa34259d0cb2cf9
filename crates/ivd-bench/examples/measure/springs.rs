//! Steps of a flat sheet of springs, for a comparison with other programs: `measure springs SIDE STEPS THREADS [STIFFNESS]`.
//!
//! Each line on stdin asks for a run; the answer is a line of JSON: wall and processor time (s), and at the first the displacement (mm) of every
//! vertex. An empty line asks for so many explicit steps; `HZ TOLERANCE` for a second of so many implicit steps a second by projective
//! descent, with a matrix that was factored before, and the displacements each time. The sheet has SIDE × SIDE vertices of 1 g, 1 mm apart,
//! springs of 1 N/m (or STIFFNESS) along the edges of halved squares, ground springs of 5 mN/m, a drag of 2/s, and steps of 1/240 s; its
//! middle vertex is lifted by 5 mm in 0.2 s.

use std::io::BufRead;
use std::time::Instant;

use cpu_time::ProcessTime;
use ivd_core::Exec;
use ivd_motion::handles::{Action, Anchor, Handle};
use ivd_motion::mass_spring::{Closeness, Descent, LoadRamp, Params, Prepared, Solver, Springs};

use crate::anything::Anything;
use crate::kernels::springs::sheet;

pub(crate) const USAGE: &str = "SIDE STEPS THREADS [STIFFNESS]";

pub(crate) fn run(words: &[String]) -> Anything<()> {
    let (side, steps, threads, stiffness) = match words {
        [side, steps, threads] => (side, steps, threads, 1.0),
        [side, steps, threads, stiffness] => (side, steps, threads, stiffness.parse()?),
        _ => return Err(USAGE.into()),
    };
    let (side, steps, threads): (usize, u32, usize) = (side.parse()?, steps.parse()?, threads.parse()?);
    let params = Params {
        springs: Springs {
            stiffness,
            shear: 0.0,
            flexion: 0.0,
            ground: 0.005 / stiffness,
            vertex_mass: Some(1.0),
            drag: 2.0,
            duration: f64::from(steps) / 240.0,
            dt: Some(1.0 / 240.0),
            ramp: Some(0.2),
            course: LoadRamp::Linear,
            push: Some(true),
            ..Springs::default()
        },
        ..Params::default()
    };
    let lattice = sheet(side)?;
    let middle = Anchor::Vertex((side / 2 * (side + 1)) as u32);
    let handles = [Handle { at: middle, action: Action::Move([0.0, 0.0, 5.0]), radius: 1e5 }];
    let exec = Exec::default().with_threads(threads);
    let mut prepared = Prepared::new(&lattice, None, &handles, &[], &params, &exec)?;
    let mut first = true;
    for line in std::io::stdin().lock().lines() {
        if let Some((hz, tolerance)) = line?.split_once(' ') {
            let (hz, tolerance): (f64, f64) = (hz.parse()?, tolerance.trim().parse()?);
            let (solver, inertia) = (Solver::Projective, true);
            let (duration, dt) = (1.0, Some(1.0 / hz));
            let params = Params {
                solver,
                springs: Springs { duration, dt, ..params.springs.clone() },
                closeness: Closeness { tolerance, ..params.closeness },
                descent: Descent { inertia, ..params.descent },
            };
            let mut prepared = Prepared::new(&lattice, None, &handles, &[], &params, &exec)?;
            prepared.update(&handles, &exec)?;
            prepared.forget();
            let (wall, cpu) = (Instant::now(), ProcessTime::now());
            let solved = prepared.update(&handles, &exec)?;
            let (wall, cpu) = (wall.elapsed().as_secs_f64(), cpu.elapsed().as_secs_f64());
            let (steps, iterations) = (solved.steps, solved.iterations);
            let moved = &solved.motion.frames()[0].displacement[..];
            println!(
                "{{\"wall_s\": {wall:?}, \"cpu_s\": {cpu:?}, \"steps\": {steps}, \"iterations\": {iterations}, \"moved\": {moved:?}}}"
            );
            continue;
        }
        let (wall, cpu) = (Instant::now(), ProcessTime::now());
        let solved = prepared.update(&handles, &exec)?;
        let (wall, cpu) = (wall.elapsed().as_secs_f64(), cpu.elapsed().as_secs_f64());
        let moved = if first {
            format!("{:?}", &solved.motion.frames()[0].displacement[..])
        } else {
            "[]".to_owned()
        };
        println!(
            "{{\"wall_s\": {wall:?}, \"cpu_s\": {cpu:?}, \"steps\": {}, \"moved\": {moved}}}",
            solved.steps
        );
        first = false;
    }
    Ok(())
}
