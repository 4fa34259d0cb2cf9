use ivd_core::{Class, Labels, Mask, Voxels};

use super::*;
use crate::fixtures::{bump, displacement, field, middle, sheared_grid, voxels};

fn exec() -> Exec {
    Exec::default()
}

fn ramp(grid: &Grid) -> Vec<i16> {
    (0..grid.len()).map(|i| ((i * 7919) % 2003) as i16 - 1000).collect()
}

fn bumped(grid: &Grid) -> Displacement {
    let radius = 8.0 * grid.spacing()[0];
    displacement(grid, field(grid, bump(middle(grid), radius, Vector3::new(0.3, 0.3, -0.2) * radius)))
}

#[test]
fn zero_displacement_is_bit_identical_with_nan_payloads() {
    let grid = sheared_grid([9, 8, 7]);
    let mut values: Vec<f32> = ramp(&grid).into_iter().map(f32::from).collect();
    values[3] = f32::from_bits(0x7fc0_1234);
    values[4] = f32::NEG_INFINITY;
    values[5] = f32::from_bits(1);
    let input = Volume::new(grid.clone(), Voxels::from(values)).unwrap();
    let identity = displacement(&grid, FieldBricks::zero(grid.dims()));
    let warped = volume(&input, &identity, &WarpParams::default(), &exec()).unwrap();
    assert_eq!(warped.output.voxels().as_bytes(), input.voxels().as_bytes());
    assert_eq!((warped.voxels_resampled, warped.voxels_total), (0, 504));
}

#[test]
fn whole_voxel_shift_moves_values_bit_for_bit_in_every_order() {
    let grid = sheared_grid([19, 18, 17]);
    let shift = grid.linear_part() * Vector3::new(3.0, -2.0, 1.0);
    let moved = displacement(&grid, field(&grid, |_| shift));
    let values: Vec<f32> = ramp(&grid).into_iter().map(|v| f32::from(v) * 0.37).collect();
    let input = Volume::new(grid.clone(), Voxels::from(values.clone())).unwrap();
    for order in [Order::Nearest, Order::Linear, Order::Cubic] {
        let params = WarpParams { order, background: Some(-7.0) };
        let warped = volume(&input, &moved, &params, &exec()).unwrap();
        for v in voxels(&grid) {
            let from = [v.0[0] as i64 - 3, v.0[1] as i64 + 2, v.0[2] as i64 - 1];
            let inside = (0..3).all(|a| (0..grid.dims()[a] as i64).contains(&from[a]));
            let expected =
                if inside { values[grid.linear(VoxelIndex(from.map(|c| c as usize)))] } else { -7.0 };
            assert_eq!(warped.output.value(v), f64::from(expected), "{order:?} at {v:?}");
        }
    }
}

/// The plain twin: every voxel, eight neighbours, no bricks.
fn plain_linear(input: &Volume, moved: &Displacement, background: f64) -> Vec<f64> {
    let grid = input.grid();
    voxels(grid)
        .map(|v| {
            let psi = Vector3::from(moved.inverse().at(v)).map(f64::from);
            let x = VoxelCoord::from(v).0 + grid.inverse_linear_part() * psi;
            if (0..3).any(|a| x[a] < -0.5 || x[a] >= grid.dims()[a] as f64 - 0.5) {
                return background;
            }
            let mut sum = 0.0;
            for corner in 0..8_usize {
                let (mut weight, mut at) = (1.0, [0; 3]);
                for a in 0..3 {
                    let (floor, far) = (x[a].floor(), corner >> a & 1);
                    weight *= if far == 1 { x[a] - floor } else { 1.0 - (x[a] - floor) };
                    at[a] = (floor as i64 + far as i64).clamp(0, grid.dims()[a] as i64 - 1) as usize;
                }
                sum += weight * input.voxels().get(grid.linear(VoxelIndex(at)));
            }
            sum
        })
        .collect()
}

#[test]
fn linear_equals_the_plain_loop_for_every_type() {
    let grid = sheared_grid([33, 30, 17]);
    let moved = bumped(&grid);
    let ramp = ramp(&grid);
    let wrap: [Voxels; 8] = [
        Voxels::from(ramp.iter().map(|&v| v as u8).collect::<Vec<_>>()),
        Voxels::from(ramp.iter().map(|&v| v as i8).collect::<Vec<_>>()),
        Voxels::from(ramp.iter().map(|&v| (v + 1000) as u16).collect::<Vec<_>>()),
        Voxels::from(ramp.clone()),
        Voxels::from(ramp.iter().map(|&v| (v as i32 + 1000) as u32 * 1_000_003).collect::<Vec<_>>()),
        Voxels::from(ramp.iter().map(|&v| v as i32 * 1_000_003).collect::<Vec<_>>()),
        Voxels::from(ramp.iter().map(|&v| f32::from(v)).collect::<Vec<_>>()),
        Voxels::from(ramp.iter().map(|&v| f64::from(v)).collect::<Vec<_>>()),
    ];
    for stored in wrap {
        let kind = stored.voxel_type();
        let input = Volume::with_scale(grid.clone(), stored, 2.0, -3.0).unwrap();
        let warped = volume(&input, &moved, &WarpParams::default(), &exec()).unwrap();
        assert_eq!((warped.output.slope(), warped.output.intercept()), (2.0, -3.0));
        let range = input.range().unwrap();
        let background = input.stored(range[0]);
        let span = (range[1] - range[0]) / 2.0;
        let tolerance = if kind.is_integer() { 0.5 + 1e-4 * span } else { 1e-4 * span };
        for (i, expected) in plain_linear(&input, &moved, background).into_iter().enumerate() {
            let got = warped.output.voxels().get(i);
            assert!((got - expected).abs() <= tolerance, "{kind:?} voxel {i}: {got} for {expected}");
        }
        assert!(warped.voxels_resampled > 0 && warped.voxels_resampled < warped.voxels_total);
    }
}

#[test]
fn orders_reproduce_the_polynomials_they_should() {
    let grid = Grid::with_spacing([32, 32, 32], [1.0; 3]).unwrap();
    let moved = displacement(&grid, field(&grid, bump(middle(&grid), 10.0, Vector3::new(2.0, 1.0, -1.5))));
    let shape = |p: Vector3<f64>, order: Order| match order {
        Order::Linear => 3.0 * p.x - 2.0 * p.y + p.z + 0.5 * p.x * p.y,
        _ => 0.3 * p.x * p.x - 0.2 * p.y * p.z + p.z * p.z,
    };
    for order in [Order::Linear, Order::Cubic] {
        let values: Vec<f64> = voxels(&grid).map(|v| shape(VoxelCoord::from(v).0, order)).collect();
        let input = Volume::new(grid.clone(), Voxels::from(values)).unwrap();
        let warped = volume(&input, &moved, &WarpParams { order, background: None }, &exec()).unwrap();
        for v in voxels(&grid) {
            let x = VoxelCoord::from(v).0 + Vector3::from(moved.inverse().at(v)).map(f64::from);
            let expected = shape(x, order);
            assert!((warped.output.value(v) - expected).abs() < 1e-2, "{order:?} {v:?}");
        }
    }
}

#[test]
fn missing_voxels_make_background_only_where_they_take_part() {
    let grid = Grid::with_spacing([8, 1, 1], [1.0; 3]).unwrap();
    let values = vec![0.0_f32, 1.0, f32::NAN, 3.0, 4.0, 5.0, f32::INFINITY, 7.0];
    let input = Volume::new(grid.clone(), Voxels::from(values)).unwrap();
    let params = WarpParams { order: Order::Linear, background: Some(-1.0) };
    let half = displacement(&grid, field(&grid, |_| Vector3::new(0.5, 0.0, 0.0)));
    let got = volume(&input, &half, &params, &exec()).unwrap();
    assert_eq!(
        got.output.to_array().into_raw_vec_and_offset().0,
        [0.0, 0.5, -1.0, -1.0, 3.5, 4.5, -1.0, -1.0]
    );
    let whole = displacement(&grid, field(&grid, |_| Vector3::new(1.0, 0.0, 0.0)));
    for order in [Order::Nearest, Order::Linear, Order::Cubic] {
        let got = volume(&input, &whole, &WarpParams { order, background: Some(-1.0) }, &exec()).unwrap();
        assert_eq!(
            got.output.to_array().into_raw_vec_and_offset().0,
            [-1.0, 0.0, 1.0, -1.0, 3.0, 4.0, 5.0, -1.0],
            "{order:?}: a missing neighbour of weight 0 doesn't count"
        );
    }
}

#[test]
fn labels_from_beyond_are_no_part_where_there_is_what_is_none() {
    let grid = Grid::with_spacing([10, 10, 10], [1.0; 3]).unwrap();
    for (zeros, background) in [(0, 2), (9, 2), (10, 0), (500, 0)] {
        let ids: Vec<u16> =
            (0..1000).map(|i| if i < zeros { 0 } else { 2 + u16::from(i % 2 == 0) }).collect();
        let labels = Labels::from_volume(&Volume::new(grid.clone(), Voxels::from(ids)).unwrap()).unwrap();
        assert_eq!(super::label_background(&labels, &WarpParams::default()).unwrap(), background, "{zeros}");
    }
}

#[test]
fn background_is_the_smallest_real_value_even_with_a_negative_slope() {
    let grid = Grid::with_spacing([4, 1, 1], [1.0; 3]).unwrap();
    let input = Volume::with_scale(grid.clone(), Voxels::from(vec![5_u8, 9, 200, 7]), -1.0, 0.0).unwrap();
    let moved = displacement(&grid, field(&grid, |_| Vector3::new(2.0, 0.0, 0.0)));
    let got = volume(&input, &moved, &WarpParams::default(), &exec()).unwrap();
    assert_eq!(got.output.voxels().as_bytes(), [200, 200, 5, 9]);
}

#[test]
fn labels_take_the_nearest_and_their_sizes_follow() {
    let grid = Grid::with_spacing([6, 1, 1], [1.0; 3]).unwrap();
    let class = |id, mean, voxels| Class { id, name: None, mean, sd: 1.0, voxels, lower: None, upper: None };
    let classes = vec![class(1, 10.0, 2), class(2, 90.0, 4)];
    let input = Labels::new(grid.clone(), vec![1_u16, 2, 2, 2, 2, 1].into(), classes).unwrap();
    let mut moved = displacement(&grid, field(&grid, |_| Vector3::new(2.0, 0.0, 0.0)));
    let got = labels(&input, &moved, &WarpParams::default(), &exec()).unwrap().output;
    assert_eq!(got.ids(), [1, 1, 1, 2, 2, 2], "what enters from outside is the lowest class");
    assert_eq!((got.class(1).unwrap().voxels, got.class(2).unwrap().voxels), (3, 3));
    moved = moved.with_vacated(vec![0, 0, 0, 0, 1, 0].into()).unwrap();
    let got = labels(&input, &moved, &WarpParams { background: Some(2.0), ..WarpParams::default() }, &exec())
        .unwrap();
    assert_eq!(got.output.ids(), [2, 2, 1, 2, 2, 2]);
    assert!(
        labels(&input, &moved, &WarpParams { background: Some(1.5), ..WarpParams::default() }, &exec())
            .is_err()
    );
}

#[test]
fn level_function_and_mask_keep_one_sign() {
    let grid = Grid::with_spacing([24, 24, 24], [1.0; 3]).unwrap();
    let centre = middle(&grid);
    let level: Vec<f32> =
        voxels(&grid).map(|v| (7.0 - (VoxelCoord::from(v).0 - centre).norm()) as f32).collect();
    let inside: Vec<u8> = level.iter().map(|&l| u8::from(l > 0.0)).collect();
    let input = Mask::new(grid.clone(), inside.into()).unwrap().with_level(level.into()).unwrap();
    let moved = displacement(&grid, field(&grid, bump(centre, 11.0, Vector3::new(0.0, 3.0, 1.0))));
    let got = mask(&input, &moved, &exec()).unwrap().output;
    let level = got.level().unwrap();
    for v in voxels(&grid) {
        let i = grid.linear(v);
        assert!(level[i] == 0.0 || (level[i] > 0.0) == (got.inside()[i] == 1));
        let x = VoxelCoord::from(v).0 + Vector3::from(moved.inverse().at(v)).map(f64::from);
        assert!((f64::from(level[i]) - (7.0 - (x - centre).norm())).abs() < 0.3);
    }
    let plain = Mask::new(grid.clone(), input.buffer().clone()).unwrap();
    let got = mask(&plain, &moved, &exec()).unwrap();
    assert!(got.output.count() > 0 && got.output.level().is_none());
}

#[test]
fn any_number_of_threads_gives_the_same_bytes() {
    let grid = sheared_grid([33, 30, 17]);
    let (moved, input) = (bumped(&grid), Volume::new(grid.clone(), Voxels::from(ramp(&grid))).unwrap());
    let one = volume(&input, &moved, &WarpParams::default(), &exec().with_threads(1)).unwrap();
    for threads in [2, 3] {
        assert_eq!(
            one,
            volume(&input, &moved, &WarpParams::default(), &exec().with_threads(threads)).unwrap()
        );
    }
}

#[test]
fn other_grids_and_bad_parameters_are_refused() {
    let grid = sheared_grid([9, 8, 7]);
    let moved = displacement(&grid, FieldBricks::zero(grid.dims()));
    let other = Grid::with_spacing([9, 8, 7], [1.0; 3]).unwrap();
    let input = Volume::new(other, Voxels::from(vec![0_u8; 504])).unwrap();
    let error = volume(&input, &moved, &WarpParams::default(), &exec()).unwrap_err();
    assert!(error.to_string().contains("spacing"), "{error}");
    let input = Volume::new(grid, Voxels::from(vec![0_u8; 504])).unwrap();
    let params = WarpParams { background: Some(f64::NAN), ..WarpParams::default() };
    assert!(volume(&input, &moved, &params, &exec()).is_err());
    let tight = exec().with_memory_limit(Some(100));
    assert!(volume(&input, &moved, &WarpParams::default(), &tight).is_err());
}

/// Rows of lanes against the plain path, voxel by voxel.
fn assert_rows_are_plain<T: Scalar>(grid: &Grid, displacement: &Displacement, value: impl Fn(usize) -> T)
where
    Voxels: From<Vec<T>>,
{
    let voxels: Vec<T> = (0..grid.len()).map(value).collect();
    let source = Source { voxels: &voxels, dims: grid.dims() };
    let background = T::from_f64(1.0);
    let mut expected = voxels.clone();
    let count = for_each_moved(grid, displacement, &mut expected, &Exec::default(), |_, place| {
        place.and_then(|x| source.sample(x, Order::Linear)).map_or(background, T::from_f64)
    })
    .unwrap();
    let volume = Volume::new(grid.clone(), Voxels::from(voxels.clone())).unwrap();
    let params = WarpParams { order: Order::Linear, background: Some(1.0) };
    for simd in [false, true] {
        let mut exec = Exec::default().with_threads(if simd { 8 } else { 1 });
        exec.simd = simd;
        let warped = super::volume(&volume, displacement, &params, &exec).unwrap();
        assert_eq!(warped.voxels_resampled, count);
        let expected = Voxels::from(expected.clone());
        assert!(warped.output.voxels().as_bytes() == expected.as_bytes(), "{:?}, simd {simd}", T::TYPE);
    }
}

#[test]
fn rows_of_lanes_are_the_plain_path_to_the_last_bit() {
    let hash = |i: usize| (i as u64 + 1).wrapping_mul(0x9E37_79B9_7F4A_7C15) >> 32;
    for (n, dims) in [[17, 13, 11], [8, 16, 9], [33, 5, 2], [24, 9, 1], [1, 20, 9]].into_iter().enumerate() {
        for grid in [sheared_grid(dims), Grid::with_spacing(dims, [0.5, 1.0, 2.0]).unwrap()] {
            let bricks: usize = dims.iter().map(|n| n.div_ceil(8)).product();
            // Whole numbers of voxels, less than a snap beside them, all directions, far out of the volume; some rest.
            let vectors = |i: usize| -> [f32; 3] {
                let part = |k: usize| (hash(3 * i + k + 1000 * n) % 2001) as f32 / 100.0 - 10.0;
                match hash(i) % 5 {
                    0 => [0.0; 3],
                    1 => [part(0).round(), part(1).round() + 1e-6, part(2).round() - 1e-6],
                    2 => [part(0) * 0.1, part(1) * 0.1, part(2) * 0.1],
                    3 => [part(0), part(1), part(2)],
                    _ => [1e30 * part(0), 0.0, part(1)],
                }
            };
            let table = (0..bricks)
                .map(|b| if b == 1 { NO_BRICK } else { (b - usize::from(b > 1)) as u32 })
                .collect();
            let stored = bricks - usize::from(bricks > 1);
            let inverse =
                FieldBricks::new(dims, table, (0..512 * stored).map(vectors).collect::<Vec<_>>().into());
            let moved = Displacement::new(grid.clone(), FieldBricks::zero(dims), inverse.unwrap()).unwrap();
            let vacated: Vec<_> = (0..grid.len()).map(|i| u8::from(hash(i) % 97 == 0)).collect();
            let moved = moved.with_vacated(vacated.into()).unwrap();
            assert_rows_are_plain(&grid, &moved, |i| hash(i) as u8);
            assert_rows_are_plain(&grid, &moved, |i| hash(i) as i16);
            assert_rows_are_plain(&grid, &moved, |i| hash(i) as u32);
            assert_rows_are_plain(&grid, &moved, |i| match hash(i) % 41 {
                0 => f32::NAN,
                1 => f32::INFINITY,
                2 => f32::MAX,
                3..20 => -0.0,
                _ => hash(i) as f32 * 1e-3,
            });
            assert_rows_are_plain(
                &grid,
                &moved,
                |i| if hash(i) % 41 == 0 { f64::MAX } else { hash(i) as f64 },
            );
        }
    }
}
