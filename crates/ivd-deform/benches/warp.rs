//! Speed of the inverse and of the warp on a bump of 48 voxels in a volume of 192³.
#![allow(missing_docs, clippy::unwrap_used, reason = "a benchmark")]

use criterion::{Criterion, Throughput, criterion_group, criterion_main};
use ivd_core::{Displacement, Exec, FieldBricks, Grid, Volume, VoxelCoord, VoxelIndex, Voxels};
use ivd_deform::inverse::invert;
use ivd_deform::warp::{Order, WarpParams, volume};
use nalgebra::Vector3;

const SIDE: usize = 192;

/// A smooth push of 9 voxels that ends 72 voxels away from the middle.
fn bump() -> FieldBricks {
    let bricks = SIDE / 8;
    let (mut table, mut vectors) = (Vec::new(), Vec::new());
    for b in 0..bricks * bricks * bricks {
        let base = VoxelIndex([b % bricks, b / bricks % bricks, b / bricks / bricks].map(|c| 8 * c));
        let brick: Vec<[f32; 3]> = (0..FieldBricks::VOXELS)
            .map(|i| {
                let at = VoxelCoord::from(base).0 + Vector3::new(i % 8, i / 8 % 8, i / 64).map(|c| c as f64);
                let t = at.add_scalar(-95.5).norm() / 72.0;
                let u = if t < 1.0 { 9.0 * (1.0 - t * t).powi(3) } else { 0.0 };
                [u as f32, (0.5 * u) as f32, 0.0]
            })
            .collect();
        let moves = brick.iter().any(|v| *v != [0.0; 3]);
        table.push(if moves { (vectors.len() / FieldBricks::VOXELS) as u32 } else { ivd_core::NO_BRICK });
        if moves {
            vectors.extend(brick);
        }
    }
    FieldBricks::new([SIDE; 3], table, vectors.into()).unwrap()
}

fn benches(c: &mut Criterion) {
    let grid = Grid::with_spacing([SIDE; 3], [1.0; 3]).unwrap();
    let (forward, exec) = (bump(), Exec::default());
    let moved = forward.vectors().iter().filter(|v| **v != [0.0; 3]).count() as u64;
    let mut group = c.benchmark_group("warp");
    group.throughput(Throughput::Elements(moved)).sample_size(10);
    group.bench_function("invert", |b| b.iter(|| invert(&forward, &grid, &exec).unwrap()));
    let displacement = Displacement {
        grid: grid.clone(),
        time: 0.0,
        inverse: invert(&forward, &grid, &exec).unwrap().field,
        forward,
        inverse_residual_max: 0.0,
        min_det_j: 0.0,
        vacated: Vec::new().into(),
    };
    let input =
        Volume::new(grid, Voxels::from((0..SIDE.pow(3)).map(|i| (i % 251) as u8).collect::<Vec<_>>()))
            .unwrap();
    for order in [Order::Nearest, Order::Linear, Order::Cubic] {
        let params = WarpParams { order, background: Some(0.0) };
        group.bench_function(format!("{order:?}"), |b| {
            b.iter(|| volume(&input, &displacement, &params, &exec).unwrap());
        });
    }
    group.finish();
}

criterion_group!(all, benches);
criterion_main!(all);
