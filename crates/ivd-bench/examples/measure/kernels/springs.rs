//! Speed of masses on springs: explicit steps by size, a drag to its balance, implicit steps.

use ivd_core::{ElementKey, Exec, Grid, Lattice, LatticeSource};
use ivd_motion::handles::{Action, Anchor, Handle};
use ivd_motion::mass_spring::{Closeness, Descent, Params, Prepared, Solver, Springs};

use super::timing::Kernels;
use crate::anything::Anything;

const STEPS: u32 = 200;

/// A flat sheet of squares, each halved, vertices 1 mm apart.
pub(crate) fn sheet(side: usize) -> Result<Lattice, ivd_core::Error> {
    let grid = Grid::with_spacing([side, side, 2], [1.0; 3])?;
    let at = |x: usize, y: usize| (x + side * y) as u32;
    let squares = (0..side - 1).flat_map(|y| (0..side - 1).map(move |x| (x, y)));
    let triangles = squares.flat_map(|(x, y)| {
        let [a, b, c, d] = [at(x, y), at(x + 1, y), at(x + 1, y + 1), at(x, y + 1)];
        [[a, b, c], [a, c, d]]
    });
    let key = |i: usize| ElementKey::new(grid.dims(), [i % side + 1, i / side + 1, 1], 2);
    Ok(Lattice::new(
        grid.clone(),
        (0..side * side).map(key).collect(),
        vec![[0.0, 0.0, 0.5]; side * side].into(),
        triangles.collect(),
    )?
    .with_source(LatticeSource::Mask))
}

/// The middle vertex, pulled up by `z` (mm).
fn lift(side: usize, z: f64, radius: f64) -> [Handle; 1] {
    let at = Anchor::Vertex((side / 2 * (side + 1)) as u32);
    [Handle { at, action: Action::Move([0.0, 0.0, z]), radius }]
}

/// Structural springs, ground springs, unit masses and drag: what a plain loop over neighbours would do.
fn explicit(kernels: &Kernels<'_>) -> Anything<()> {
    for side in [50, 100, 200, 400] {
        let lattice = sheet(side)?;
        let params = Params {
            springs: Springs {
                stiffness: 1.0,
                shear: 0.0,
                flexion: 0.0,
                ground: 0.005,
                vertex_mass: Some(1.0),
                drag: 2.0,
                duration: f64::from(STEPS) / 240.0,
                dt: Some(1.0 / 240.0),
                push: Some(true),
                ..Springs::default()
            },
            ..Params::default()
        };
        let handles = lift(side, 5.0, 1e4);
        for threads in [1, 2] {
            let exec = Exec::default().with_threads(threads);
            let mut prepared = Prepared::new(&lattice, None, &handles, &[], &params, &exec)?;
            let name =
                format!("springs, {STEPS} explicit steps, {threads} threads, {} vertices", side * side);
            kernels.time(&name, || prepared.update(&handles, &exec));
        }
    }
    Ok(())
}

/// A sheet of 10,000 vertices, its border held, dragged up by a tenth of a millimetre at a time.
fn drag(kernels: &Kernels<'_>) -> Anything<()> {
    let (side, exec) = (102, Exec::default());
    let lattice = sheet(side)?;
    for (name, history, radius) in
        [("quasi-Newton", 8, 25.0), ("local-global", 0, 25.0), ("quasi-Newton", 8, 71.0)]
    {
        let params = Params {
            solver: Solver::Projective,
            springs: Springs { push: Some(false), ..Springs::default() },
            descent: Descent { history, ..Descent::default() },
            ..Params::default()
        };
        let up = |z| lift(side, z, radius);
        let prepare = || Prepared::new(&lattice, None, &up(3.0), &[], &params, &exec);
        let mut dragged = prepare()?;
        dragged.update(&up(3.0), &exec)?;
        kernels.time_prepared(&format!("springs, {name}, radius {radius}, from rest"), prepare, |fresh| {
            fresh.and_then(|mut fresh| fresh.update(&up(3.0), &exec))
        });
        let mut z = 3.0;
        kernels.time(&format!("springs, {name}, radius {radius}, 0.1 mm on"), || {
            z = if z < 6.0 { z + 0.1 } else { 3.0 };
            dragged.update(&up(z), &exec)
        });
    }
    for solver in [Solver::Projective, Solver::Xpbd] {
        let params = Params {
            solver,
            springs: Springs { duration: 0.01, dt: Some(1e-3), push: Some(true), ..Springs::default() },
            closeness: Closeness { tolerance: 1e-2, max_iterations: 100 },
            descent: Descent { inertia: solver == Solver::Projective, ..Descent::default() },
        };
        let handles = lift(side, 1.0, 71.0);
        let mut prepared = Prepared::new(&lattice, None, &handles, &[], &params, &exec)?;
        kernels
            .time(&format!("springs, ten implicit steps, {solver:?}"), || prepared.update(&handles, &exec));
    }
    Ok(())
}

pub(super) fn run(kernels: &Kernels<'_>) -> Anything<()> {
    explicit(kernels)?;
    drag(kernels)
}
