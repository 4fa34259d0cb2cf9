//! Refinement of a torus to a tenth of its triangles, and its measuring.

use std::hint::black_box;

use criterion::{Criterion, Throughput, criterion_group, criterion_main};
use ivd_core::{Exec, Grid, Lattice, Volume, Voxels};
use ivd_lattice::extract::{ExtractParams, Iso, extract};
use ivd_lattice::figures::measure;
use ivd_lattice::refine::{RefineParams, Target, collapse};

/// A torus in a cube of `n` voxels.
fn torus(n: usize) -> Lattice {
    let grid = Grid::with_spacing([n; 3], [1.0; 3]).expect("a cube of voxels is a grid");
    let size = n as f64;
    let voxels: Vec<f32> = (0..grid.len())
        .map(|i| {
            let [x, y, z] = grid.index(i).0.map(|c| c as f64 - 0.5 * size + 0.4);
            (0.12 * size - (x.hypot(y) - 0.28 * size).hypot(z)) as f32
        })
        .collect();
    let volume = Volume::new(grid, Voxels::from(voxels)).expect("one value a voxel");
    let params = ExtractParams { iso: Iso::Value(0.0) };
    extract(&volume, None, &params, &Exec::default()).expect("the isovalue is finite").lattice
}

fn refine(criterion: &mut Criterion) {
    let lattice = torus(128);
    let mut group = criterion.benchmark_group("refine");
    group.throughput(Throughput::Elements(lattice.triangles.len() as u64)).sample_size(10);
    for threads in [1, 2] {
        let exec = Exec::default().with_threads(threads);
        let params = RefineParams { target: Target::Ratio(0.1), ..RefineParams::default() };
        group.bench_function(format!("collapse to a tenth, {threads} threads"), |bench| {
            bench.iter(|| collapse(black_box(&lattice), &params, &exec).expect("the lattice is sound"));
        });
    }
    group.bench_function("measure", |bench| bench.iter(|| measure(black_box(&lattice))));
    group.finish();
}

criterion_group!(benches, refine);
criterion_main!(benches);
