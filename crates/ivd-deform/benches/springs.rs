//! Speed of masses on springs: explicit steps by size, a drag to its balance, implicit steps.
#![allow(missing_docs, clippy::unwrap_used, reason = "a benchmark")]

use criterion::{BenchmarkId, Criterion, Throughput, criterion_group, criterion_main};
use ivd_core::{ElementKey, Exec, Grid, Lattice, LatticeSource};
use ivd_deform::mass_spring::{Params, Prepared, Solver};
use ivd_deform::spring::{Action, Handle, HandleAt};

const STEPS: u32 = 200;

/// A flat sheet of squares, each halved, vertices 1 mm apart.
fn sheet(side: usize) -> Lattice {
    let grid = Grid::with_spacing([side, side, 2], [1.0; 3]).unwrap();
    let at = |x: usize, y: usize| (x + side * y) as u32;
    let squares = (0..side - 1).flat_map(|y| (0..side - 1).map(move |x| (x, y)));
    let triangles = squares.flat_map(|(x, y)| {
        let [a, b, c, d] = [at(x, y), at(x + 1, y), at(x + 1, y + 1), at(x, y + 1)];
        [[a, b, c], [a, c, d]]
    });
    let key = |i: usize| ElementKey::new(grid.dims(), [i % side + 1, i / side + 1, 1], 2);
    Lattice {
        keys: (0..side * side).map(key).collect(),
        places: vec![[0.0, 0.0, 0.5]; side * side],
        triangles: triangles.collect(),
        source: LatticeSource::Mask,
        level: 0,
        max_error_mm: 0.0,
        coarser: Vec::new(),
        grid,
    }
}

/// The middle vertex, pulled up by `z` (mm).
fn lift(side: usize, z: f64, radius: f64) -> [Handle; 1] {
    let at = HandleAt::Vertex((side / 2 * (side + 1)) as u32);
    [Handle { at, action: Action::Move([0.0, 0.0, z]), radius }]
}

/// Structural springs, ground springs, unit masses and drag: what a plain loop over neighbours would do.
fn explicit(c: &mut Criterion) {
    let mut group = c.benchmark_group("explicit steps");
    group.sample_size(10);
    for side in [50, 100, 200, 400] {
        let lattice = sheet(side);
        let params = Params {
            stiffness: 1.0,
            shear: 0.0,
            flexion: 0.0,
            ground: 0.005,
            vertex_mass: Some(1.0),
            drag: 2.0,
            duration: f64::from(STEPS) / 240.0,
            dt: Some(1.0 / 240.0),
            ..Params::default()
        };
        let handles = lift(side, 5.0, 1e4);
        let springs = (side * (side - 1) * 2 + (side - 1) * (side - 1)) as u64;
        group.throughput(Throughput::Elements(springs * u64::from(STEPS)));
        for threads in [1, 2] {
            let exec = Exec::default().with_threads(threads);
            let mut prepared = Prepared::new(&lattice, None, &handles, &[], &params, &exec).unwrap();
            group.bench_function(BenchmarkId::new(format!("{threads} threads"), side * side), |b| {
                b.iter(|| assert_eq!(prepared.update(&handles, &exec).unwrap().steps, STEPS as usize));
            });
        }
    }
    group.finish();
}

/// A sheet of 10,000 vertices, its border held, dragged up by a tenth of a millimetre at a time.
fn drag(c: &mut Criterion) {
    let mut group = c.benchmark_group("projective");
    group.sample_size(10);
    let (side, exec) = (102, Exec::default());
    let lattice = sheet(side);
    for (name, history, radius) in
        [("quasi-Newton", 8, 25.0), ("local-global", 0, 25.0), ("quasi-Newton", 8, 71.0)]
    {
        let params = Params { solver: Solver::Projective, history, push: false, ..Params::default() };
        let prepare =
            || Prepared::new(&lattice, None, &lift(side, 3.0, radius), &[], &params, &exec).unwrap();
        let mut dragged = prepare();
        dragged.update(&lift(side, 3.0, radius), &exec).unwrap();
        group.bench_function(format!("{name}, radius {radius}, from rest"), |b| {
            b.iter_batched(
                prepare,
                |mut fresh| fresh.update(&lift(side, 3.0, radius), &exec).unwrap(),
                criterion::BatchSize::LargeInput,
            );
        });
        let mut z = 3.0;
        group.bench_function(format!("{name}, radius {radius}, 0.1 mm on"), |b| {
            b.iter(|| {
                z = if z < 6.0 { z + 0.1 } else { 3.0 };
                dragged.update(&lift(side, z, radius), &exec).unwrap()
            });
        });
    }
    for solver in [Solver::Projective, Solver::Xpbd] {
        let params = Params {
            solver,
            inertia: solver == Solver::Projective,
            duration: 0.01,
            dt: Some(1e-3),
            tolerance: 1e-2,
            max_iterations: 100,
            ..Params::default()
        };
        let handles = lift(side, 1.0, 71.0);
        let mut prepared = Prepared::new(&lattice, None, &handles, &[], &params, &exec).unwrap();
        group.bench_function(format!("ten implicit steps, {solver:?}"), |b| {
            b.iter(|| prepared.update(&handles, &exec).unwrap());
        });
    }
    group.finish();
}

criterion_group!(all, explicit, drag);
criterion_main!(all);
