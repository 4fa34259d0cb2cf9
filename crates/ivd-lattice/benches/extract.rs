//! Time to cut a lattice out of 128³ voxels: a smooth closed surface, one that fills space, and noise.

use std::hint::black_box;
use std::time::Duration;

use criterion::{BatchSize, Criterion, criterion_group, criterion_main};
use ivd_core::{Exec, Grid, Volume, Voxels};
use ivd_lattice::extract::{ExtractParams, Iso, extract};

const N: usize = 128;

fn volume(value: impl Fn([f32; 3]) -> f32) -> Volume {
    let at = |i: usize| [i % N, i / N % N, i / N / N].map(|v| v as f32 - 63.3);
    let voxels: Vec<f32> = (0..N * N * N).map(|i| value(at(i))).collect();
    let grid = Grid::with_spacing([N; 3], [1.0; 3]).expect("a valid grid");
    Volume::new(grid, Voxels::from(voxels)).expect("one value a voxel")
}

fn gyroid(p: [f32; 3]) -> f32 {
    let [(sx, cx), (sy, cy), (sz, cz)] = p.map(|v| (v * 0.2).sin_cos());
    sx * cy + sy * cz + sz * cx
}

fn noise(p: [f32; 3]) -> f32 {
    ((p[0] * 12.9898 + p[1] * 78.233 + p[2] * 37.719).sin() * 43_758.547).fract()
}

fn bench(c: &mut Criterion) {
    let exec = Exec::default();
    let mut group = c.benchmark_group("extract");
    group.sample_size(10).measurement_time(Duration::from_secs(2));
    for (name, volume, iso) in [
        ("sphere", volume(|p| 45.0 - p[0].hypot(p[1]).hypot(p[2])), 0.0),
        ("gyroid", volume(gyroid), 0.0),
        ("noise", volume(noise), 0.5),
    ] {
        let params = ExtractParams { iso: Iso::Value(iso) };
        let cut = |volume: &Volume| extract(volume, None, &params, &exec).expect("a lattice");
        group.bench_function(format!("{name}, index at hand"), |b| {
            volume.bricks();
            b.iter(|| cut(black_box(&volume)));
        });
        let raw =
            || Volume::new(volume.grid().clone(), volume.voxels().clone()).expect("the parts of a volume");
        group.bench_function(format!("{name}, index built"), |b| {
            b.iter_batched(raw, |volume| cut(black_box(&volume)), BatchSize::PerIteration);
        });
    }
    group.finish();
}

criterion_group!(benches, bench);
criterion_main!(benches);
