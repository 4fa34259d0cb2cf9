use ivd_core::{Class, Classified, Displacement, VoxelCoord, VoxelIndex, Voxels};
use nalgebra::Vector3;

use super::*;
use crate::fixtures::{bump, displacement, field, middle, sheared_grid, voxels};

const OPS: [Op; 3] = [Op::Union, Op::Intersection, Op::Difference];

fn exec() -> Exec {
    Exec::default()
}

fn hash(i: usize) -> u64 {
    let mixed = (i as u64 + 1).wrapping_mul(0x9E37_79B9_7F4A_7C15);
    (mixed ^ (mixed >> 29)).wrapping_mul(0xBF58_476D_1CE4_E5B9) >> 32
}

fn params(op: Op, windows: &[[f64; 2]]) -> CombineParams {
    CombineParams { op, windows: windows.to_vec() }
}

/// Volumes of every type on a grid, with what is no data in those that can hold it.
fn of_every_type(grid: &Grid, seed: usize) -> Vec<Volume> {
    fn each<T>(grid: &Grid, seed: usize, value: impl Fn(u64) -> T) -> Voxels
    where
        Voxels: From<Vec<T>>,
    {
        Voxels::from((0..grid.len()).map(|i| value(hash(i + 7919 * seed))).collect::<Vec<T>>())
    }
    let gaps = |h: u64, v: f64| match h % 13 {
        0 => f64::NAN,
        1 => f64::INFINITY,
        2 => f64::NEG_INFINITY,
        3 => 0.0,
        _ => v,
    };
    let stored = [
        each(grid, seed, |h| (h % 200) as u8),
        each(grid, seed, |h| (h % 200) as u8 as i8),
        each(grid, seed, |h| (h % 60_000) as u16),
        each(grid, seed, |h| (h % 60_000) as u16 as i16),
        each(grid, seed, |h| h as u32),
        each(grid, seed, |h| h as u32 as i32),
        each(grid, seed, |h| gaps(h, (h % 1000) as f64 * 0.37 - 90.0) as f32),
        each(grid, seed, |h| gaps(h, (h % 1000) as f64 * 1e300)),
    ];
    let scales = [(1.0, 0.0), (-2.5, 7.0), (0.01, -3.0)];
    stored
        .into_iter()
        .enumerate()
        .map(|(n, stored)| {
            let (slope, intercept) = scales[(n + seed) % 3];
            Volume::with_scale(grid.clone(), stored, slope, intercept).unwrap()
        })
        .collect()
}

/// A window inside the volume's range, so that some opacities are 0 and some 1.
fn within(volume: &Volume) -> [f64; 2] {
    let [lo, hi] = volume.range().unwrap();
    [lo + 0.2 * (hi - lo), lo + 0.7 * (hi - lo)]
}

/// What one voxel becomes, by the definition; real values, NaN for no data.
fn plain(op: Op, a: &Volume, reals: &[f64], windows: &[[f64; 2]]) -> Option<f64> {
    let opacity = |real: f64, [lo, hi]: [f64; 2]| {
        if real.is_nan() { 0.0 } else { ((real - lo) / (hi - lo)).clamp(0.0, 1.0) }
    };
    let all: Vec<f64> = reals.iter().zip(windows).map(|(&real, &window)| opacity(real, window)).collect();
    let others = all[1..].iter().copied();
    let folded = match op {
        Op::Union => others.fold(all[0], f64::max),
        Op::Intersection => others.fold(all[0], f64::min),
        Op::Difference => others.map(|o| 1.0 - o).fold(all[0], f64::min),
    };
    if folded == all[0] {
        return None;
    }
    let real = match op {
        Op::Union => reals[all.iter().position(|o| *o == folded).unwrap()],
        _ => windows[0][0] + folded * (windows[0][1] - windows[0][0]),
    };
    Some(a.stored(real))
}

fn real_or_nan(volume: &Volume, i: usize) -> f64 {
    let stored = volume.voxels().get(i);
    if stored.is_finite() { volume.real(stored) } else { f64::NAN }
}

/// The stored value that a type holds for a number.
fn rounded(like: &Voxels, value: f64) -> f64 {
    with_voxels!(like, slice => {
        fn of<T: Scalar>(_: &[T], value: f64) -> f64 { T::from_f64(value).to_f64() }
        let most = if like.voxel_type() == ivd_core::VoxelType::F32 { f64::from(f32::MAX) } else { f64::MAX };
        of(slice, value.clamp(-most, most))
    })
}

#[test]
fn every_type_equals_the_plain_loop_with_and_without_skipping() {
    for grid in [sheared_grid([17, 11, 9]), sheared_grid([5, 1, 3])] {
        let (all, others, thirds) =
            (of_every_type(&grid, 0), of_every_type(&grid, 1), of_every_type(&grid, 2));
        for (n, a) in all.iter().enumerate() {
            let (b, c) = (&others[(n * 3 + 1) % 8], &thirds[(n * 5 + 2) % 8]);
            let windows = [a, b, c].map(within);
            let operands = [a, b, c].map(Operand::from);
            for op in OPS {
                let got = volumes(&operands, &params(op, &windows), &exec()).unwrap();
                let mut changed = 0;
                for i in 0..grid.len() {
                    let reals = [a, b, c].map(|v| real_or_nan(v, i));
                    let (was, is) = (a.voxels().get(i), got.output.voxels().get(i));
                    let expected = plain(op, a, &reals, &windows).map_or(was, |v| rounded(a.voxels(), v));
                    let same =
                        is.to_bits() == expected.to_bits() || (is - expected).abs() <= 1e-12 * is.abs();
                    assert!(same, "{op:?} {:?} voxel {i}: {is} for {expected}", a.voxel_type());
                    changed += u64::from(is.to_bits() != was.to_bits());
                }
                assert_eq!((got.voxels_changed, got.voxels_total), (changed, grid.len() as u64));
                let mut twin = exec();
                twin.skip = false;
                let twin = volumes(&operands, &params(op, &windows), &twin).unwrap();
                assert_eq!(twin.output.voxels().as_bytes(), got.output.voxels().as_bytes());
                assert_eq!(twin.bricks_visited, twin.bricks_total);
            }
        }
    }
}

#[test]
fn skipped_bricks_are_those_that_the_first_operand_decides() {
    // A is dense in its lower half, B everywhere thin; the bricks of the lower half are A's in a union.
    let grid = sheared_grid([16, 16, 32]);
    let dense = |v: VoxelIndex| if v.0[2] < 17 { 200 } else { (hash(grid.linear(v)) % 40) as u8 };
    let a = Volume::new(grid.clone(), Voxels::from(voxels(&grid).map(dense).collect::<Vec<_>>())).unwrap();
    let thin: Vec<u8> = (0..grid.len()).map(|i| (hash(i + 5) % 100) as u8).collect();
    let b = Volume::new(grid.clone(), Voxels::from(thin)).unwrap();
    let operands = [&a, &b].map(Operand::from);
    let got = volumes(&operands, &params(Op::Union, &[[0.0, 200.0]]), &exec()).unwrap();
    assert_eq!((got.bricks_visited, got.bricks_total), (8, 16));
    let got = volumes(&operands, &params(Op::Intersection, &[[0.0, 200.0]]), &exec()).unwrap();
    assert_eq!(got.bricks_visited, 16);
    // What lies beside the grid takes nothing away.
    let far = Grid::with_spacing([4; 3], [1.0; 3]).unwrap();
    let far = Volume::new(far, Voxels::from((0..64).collect::<Vec<u8>>())).unwrap();
    let operands = [&a, &far].map(Operand::from);
    for op in [Op::Union, Op::Difference] {
        let got = volumes(&operands, &params(op, &[]), &exec()).unwrap();
        assert_eq!((got.bricks_visited, &got.output), (0, &a));
    }
}

#[test]
fn opacities_obey_the_laws_of_sets() {
    let all: Vec<f64> = (0..=64).map(|i| f64::from(i) / 64.0).collect();
    for (&a, &b) in all.iter().flat_map(|a| all.iter().map(move |b| (a, b))) {
        let not = |o: f64| 1.0 - o;
        let [union, intersection, difference] = OPS.map(|op| op.opacity(a, b));
        assert_eq!(not(union), Op::Intersection.opacity(not(a), not(b)));
        assert_eq!(not(intersection), Op::Union.opacity(not(a), not(b)));
        assert_eq!(not(difference), Op::Union.opacity(not(a), b));
        assert_eq!((union, intersection), (Op::Union.opacity(b, a), Op::Intersection.opacity(b, a)));
        assert_eq!((Op::Union.opacity(a, intersection), Op::Intersection.opacity(a, union)), (a, a));
    }
    // By the clipped difference the third law fails.
    assert_ne!(1.0 - f64::max(0.0, 0.5 - 0.5), Op::Union.opacity(1.0 - 0.5, 0.5));
}

#[test]
fn combining_with_itself_changes_no_bit_and_a_part_is_absorbed() {
    let grid = sheared_grid([9, 10, 11]);
    for (a, b) in of_every_type(&grid, 3).into_iter().zip(of_every_type(&grid, 4)) {
        let window = [within(&a), within(&b)];
        for op in [Op::Union, Op::Intersection] {
            let got = volumes(&[Operand::from(&a); 3], &params(op, &window[..1]), &exec()).unwrap();
            assert_eq!(got.output.voxels().as_bytes(), a.voxels().as_bytes(), "{op:?} {:?}", a.voxel_type());
            assert_eq!(got.voxels_changed, 0);
        }
        // A ∪ (A ∩ B) = A: exactly for integers, whose rounding is monotone.
        let inner =
            volumes(&[&a, &b].map(Operand::from), &params(Op::Intersection, &window), &exec()).unwrap();
        let both = [&a, &inner.output].map(Operand::from);
        let got = volumes(&both, &params(Op::Union, &window[..1]), &exec()).unwrap().output;
        if a.voxel_type().is_integer() {
            assert_eq!(got.voxels().as_bytes(), a.voxels().as_bytes(), "{:?}", a.voxel_type());
        }
    }
}

#[test]
fn union_and_intersection_commute_in_one_window() {
    let grid = sheared_grid([9, 10, 11]);
    let volume = |seed: usize| {
        let values: Vec<f64> = (0..grid.len()).map(|i| (hash(i + 7919 * seed) % 1001) as f64).collect();
        Volume::new(grid.clone(), Voxels::from(values)).unwrap()
    };
    let [a, b, c] = [0, 1, 2].map(volume);
    for op in [Op::Union, Op::Intersection] {
        let of = |all: [&Volume; 3]| {
            volumes(&all.map(Operand::from), &params(op, &[[0.0, 1024.0]]), &exec()).unwrap().output
        };
        let first = of([&a, &b, &c]);
        assert_eq!(of([&c, &b, &a]), first);
        assert_eq!(of([&b, &c, &a]), first);
        // One after the other.
        let two =
            volumes(&[&a, &b].map(Operand::from), &params(op, &[[0.0, 1024.0]]), &exec()).unwrap().output;
        let last = volumes(&[&two, &c].map(Operand::from), &params(op, &[[0.0, 1024.0]]), &exec()).unwrap();
        assert_eq!(last.output, first);
    }
}

#[test]
fn missing_data_is_transparent_and_kept_where_the_first_operand_decides() {
    let grid = Grid::with_spacing([6, 1, 1], [1.0; 3]).unwrap();
    let payload = f32::from_bits(0x7fc0_1234);
    let a = vec![payload, payload, 0.5, f32::INFINITY, 7.0, -3.0];
    let a = Volume::new(grid.clone(), Voxels::from(a)).unwrap();
    let b = vec![f64::NAN, 0.25, f64::NAN, 1e300, 1.0, f64::NEG_INFINITY];
    let b = Volume::new(grid, Voxels::from(b)).unwrap();
    let bits = |op: Op| {
        let got = volumes(&[Operand::from(&a), Operand::from(&b)], &params(op, &[[0.0, 1.0]]), &exec());
        let Voxels::F32(values) = got.unwrap().output.voxels().clone() else {
            panic!("the first one's type")
        };
        values.iter().map(|v| v.to_bits()).collect::<Vec<_>>()
    };
    let of = |values: [f32; 6]| values.map(f32::to_bits).to_vec();
    // 7 lies beyond the window, and stays where its opacity of 1 is the result's; 1e300 is no number of the type.
    assert_eq!(bits(Op::Union), of([payload, 0.25, 0.5, f32::MAX, 7.0, -3.0]));
    assert_eq!(bits(Op::Intersection), of([payload, payload, 0.0, f32::INFINITY, 7.0, -3.0]));
    assert_eq!(bits(Op::Difference), of([payload, payload, 0.5, f32::INFINITY, 0.0, -3.0]));
}

#[test]
fn windows_that_tell_nothing_are_refused_by_name() {
    let grid = Grid::with_spacing([2, 1, 1], [1.0; 3]).unwrap();
    let volume = |values: Vec<f64>| Volume::new(grid.clone(), Voxels::from(values)).unwrap();
    let (a, constant, none) =
        (volume(vec![0.0, 2.0]), volume(vec![7.0, 7.0]), volume(vec![f64::NAN, f64::NAN]));
    let error = |b: &Volume, windows: &[[f64; 2]]| {
        let got = volumes(&[&a, b].map(Operand::from), &params(Op::Union, windows), &exec());
        let error = got.unwrap_err();
        assert_eq!(error.error_class(), ivd_core::ErrorClass::Usage);
        error.to_string()
    };
    for window in [[1.0, 1.0], [2.0, 1.0], [f64::NAN, 1.0], [0.0, f64::INFINITY], [-1.7e308, 1.7e308]] {
        let said = error(&a, &[[0.0, 1.0], window]);
        assert!(
            said.contains("`window`") && said.contains("operand 2") && said.contains("lo below hi"),
            "{said}"
        );
    }
    let said = error(&constant, &[]);
    assert!(said.contains("operand 2 holds one value only, 7"), "{said}");
    assert!(error(&volume(vec![f64::MIN, f64::MAX]), &[]).contains("too wide"));
    assert!(error(&a, &[[0.0, 1.0]; 3]).contains("3 windows for 2 operands"));
    let one = volumes(&[Operand::from(&a)], &params(Op::Union, &[]), &exec()).unwrap_err();
    assert!(one.to_string().contains("two or more"), "{one}");
    // A volume without data is transparent, whatever its window.
    assert_eq!(volumes(&[&a, &none].map(Operand::from), &params(Op::Union, &[]), &exec()).unwrap().output, a);
    let filled = volumes(&[&none, &a].map(Operand::from), &params(Op::Union, &[]), &exec()).unwrap().output;
    assert!(filled.voxels().get(0).is_nan() && filled.voxels().get(1) == 2.0);
    // In a window of its own a constant one is as good as any.
    let got =
        volumes(&[&a, &constant].map(Operand::from), &params(Op::Union, &[[0.0, 8.0]]), &exec()).unwrap();
    assert_eq!(got.output.to_array().into_raw_vec_and_offset().0, [7.0, 7.0]);
}

/// Volume of two balls of radius `r` whose middles are `d` apart that both fill.
fn lens(r: f64, d: f64) -> f64 {
    std::f64::consts::PI * (4.0 * r + d) * (2.0 * r - d).powi(2) / 12.0
}

#[test]
fn two_balls_have_the_volumes_of_geometry() {
    let grid = Grid::with_spacing([64, 48, 48], [0.5, 0.5, 0.5]).unwrap();
    let (r, d) = (8.0, 6.0);
    let ball = |x: f64| -> Vec<u8> {
        let centre = Vector3::new(x, 12.0, 12.0);
        voxels(&grid).map(|v| u8::from((grid.world(VoxelCoord::from(v)).0 - centre).norm() < r)).collect()
    };
    let (left, right) = (ball(13.0), ball(13.0 + d));
    let whole = 4.0 / 3.0 * std::f64::consts::PI * r.powi(3);
    let expected = [2.0 * whole - lens(r, d), lens(r, d), whole - lens(r, d)];
    let masks_of = [&left, &right].map(|b| Mask::new(grid.clone(), b.clone().into()).unwrap());
    let volumes_of = [&left, &right].map(|b| {
        let dense: Vec<u8> = b.iter().map(|v| 100 * v).collect();
        Volume::new(grid.clone(), Voxels::from(dense)).unwrap()
    });
    let labels_of = [&left, &right]
        .map(|b| Labels::from_volume(&Volume::new(grid.clone(), b.clone().into()).unwrap()).unwrap());
    for (op, expected) in OPS.into_iter().zip(expected) {
        let mask = masks(&masks_of.each_ref().map(Operand::from), &params(op, &[]), &exec()).unwrap().output;
        let volume = mask.count() as f64 * grid.voxel_volume();
        assert!((volume - expected).abs() < 0.01 * expected, "{op:?}: {volume} for {expected} mm³");
        // The three kinds agree to the voxel.
        let dense =
            volumes(&volumes_of.each_ref().map(Operand::from), &params(op, &[]), &exec()).unwrap().output;
        let named =
            labels(&labels_of.each_ref().map(Operand::from), &params(op, &[]), &exec()).unwrap().output;
        for (i, inside) in mask.inside().iter().enumerate() {
            assert_eq!(
                (dense.voxels().get(i), named.ids()[i]),
                (100.0 * f64::from(*inside), u16::from(*inside))
            );
        }
        assert_eq!(named.class(1).unwrap().voxels, mask.count());
    }
    let [a, _] = masks_of.each_ref().map(Operand::from);
    let got = masks(&[a, a], &params(Op::Difference, &[]), &exec()).unwrap();
    assert_eq!((got.output.count(), got.voxels_changed), (0, a.value.count()));
}

#[test]
fn level_functions_follow_and_agree_with_their_masks() {
    let grid = sheared_grid([12, 10, 9]);
    let mask = |seed: usize| {
        let level: Vec<f32> = (0..grid.len()).map(|i| (hash(i + 7919 * seed) % 21) as f32 - 10.0).collect();
        let inside: Vec<u8> = level.iter().map(|&l| u8::from(l > 0.0)).collect();
        Mask::new(grid.clone(), inside.into()).unwrap().with_level(level.into()).unwrap()
    };
    let all = [0, 1, 2].map(mask);
    for op in OPS {
        let got = masks(&all.each_ref().map(Operand::from), &params(op, &[]), &exec()).unwrap().output;
        let level = got.level().unwrap();
        for i in 0..grid.len() {
            let inside = all.each_ref().map(|m| m.inside()[i] == 1);
            let expected = match op {
                Op::Union => inside[0] || inside[1] || inside[2],
                Op::Intersection => inside[0] && inside[1] && inside[2],
                Op::Difference => inside[0] && !inside[1] && !inside[2],
            };
            assert_eq!(got.inside()[i] == 1, expected, "{op:?} {i}");
            assert!(level[i] == 0.0 || (level[i] > 0.0) == expected, "{op:?} {i}: {}", level[i]);
        }
    }
    let plain = Mask::new(grid.clone(), all[1].buffer().clone()).unwrap();
    let got = masks(&[&all[0], &plain].map(Operand::from), &params(Op::Union, &[]), &exec()).unwrap();
    assert!(got.output.level().is_none());
}

#[test]
fn labels_keep_the_first_operands_names_and_count_anew() {
    let grid = Grid::with_spacing([5, 1, 1], [1.0; 3]).unwrap();
    let class = |id, mean| Class { id, name: None, mean, sd: 1.0, voxels: 99, lower: None, upper: None };
    let a = Labels::new(grid.clone(), vec![0_u16, 0, 1, 1, 4].into(), vec![class(1, 30.0)]).unwrap();
    let b = Labels::new(grid.clone(), vec![0_u16, 2, 2, 0, 1].into(), vec![class(1, 5.0), class(2, 10.0)])
        .unwrap();
    let of = |op: Op| {
        let got = labels(&[&a, &b].map(Operand::from), &params(op, &[]), &exec()).unwrap();
        let classes: Vec<_> = got.output.classes().iter().map(|c| (c.id, c.mean, c.voxels)).collect();
        (got.output.ids().to_vec(), classes, got.voxels_changed)
    };
    assert_eq!(of(Op::Union), (vec![0, 2, 1, 1, 4], vec![(2, 10.0, 1), (1, 30.0, 2)], 1));
    assert_eq!(of(Op::Intersection), (vec![0, 0, 1, 0, 4], vec![(1, 30.0, 1)], 1));
    assert_eq!(of(Op::Difference), (vec![0, 0, 0, 1, 0], vec![(1, 30.0, 1)], 2));
    let windowed = labels(&[&a, &b].map(Operand::from), &params(Op::Union, &[[0.0, 1.0]]), &exec());
    assert!(windowed.unwrap_err().to_string().contains("labels are there or not"));
}

#[test]
fn other_grids_are_read_by_world_position() {
    let grid = sheared_grid([14, 12, 10]);
    // Half the spacing, and the first voxels 0.6 of it before: a linear function of the place is read exactly.
    let fine = Grid::new(
        [27, 23, 19],
        grid.spacing().map(|s| s / 2.0),
        grid.world(VoxelCoord(Vector3::repeat(0.3))).0.into(),
        grid.direction(),
    )
    .unwrap();
    let linear = |g: &Grid, v: VoxelIndex| {
        let p = g.world(VoxelCoord::from(v)).0 - Vector3::from(grid.origin());
        0.3 * p.x - 0.2 * p.y + 0.1 * p.z
    };
    let of = |g: &Grid, from: f64| {
        Volume::new(g.clone(), Voxels::from(voxels(g).map(|v| linear(g, v) + from).collect::<Vec<f64>>()))
            .unwrap()
    };
    let (a, b) = (of(&grid, 0.0), of(&fine, 1.0));
    let window = [-100.0, 100.0];
    let got = volumes(&[&a, &b].map(Operand::from), &params(Op::Union, &[window]), &exec()).unwrap();
    let tagged = Labels::new(fine.clone(), vec![3_u16; fine.len()].into(), Vec::new()).unwrap();
    let empty = Labels::new(grid.clone(), vec![0_u16; grid.len()].into(), Vec::new()).unwrap();
    let filled =
        labels(&[&empty, &tagged].map(Operand::from), &params(Op::Union, &[]), &exec()).unwrap().output;
    for v in voxels(&grid) {
        let (value, rest) = (got.output.value(v), linear(&grid, v));
        let outside = v.0.contains(&0);
        assert_eq!(filled.ids()[grid.linear(v)], if outside { 0 } else { 3 });
        let expected = if outside { rest } else { rest + 1.0 };
        assert!((value - expected).abs() < 1e-9, "{v:?}: {value} for {expected}");
    }
}

/// A displacement that moves only a ball, and one that leaves some voxels behind.
fn moved(grid: &Grid) -> [Displacement; 2] {
    let one = displacement(grid, field(grid, bump(middle(grid), 6.0, Vector3::new(1.9, 1.2, -2.0))));
    let other = displacement(grid, field(grid, |p| Vector3::new(0.1 * p.z, 0.4, 0.3)));
    let vacated: Vec<_> = (0..grid.len()).map(|i| u8::from(hash(i).is_multiple_of(19))).collect();
    [one, other.with_vacated(vacated.into()).unwrap()]
}

#[test]
fn reading_through_a_displacement_is_combining_the_warped() {
    let grid = sheared_grid([33, 20, 18]);
    let elsewhere = Grid::with_spacing([20, 18, 16], [0.8, 0.9, 2.0]).unwrap();
    let elsewhere =
        Grid::new(elsewhere.dims(), elsewhere.spacing(), [10_000.5, -299.0, 10.0], elsewhere.direction())
            .unwrap();
    for (n, grid_b) in [&grid, &elsewhere].into_iter().enumerate() {
        let (through, other) = (moved(&grid), moved(grid_b));
        for (a, b) in of_every_type(&grid, 5).iter().zip(of_every_type(grid_b, 6)) {
            if a.voxel_type() == ivd_core::VoxelType::F64 {
                continue; // Its values are too far apart to be interpolated.
            }
            let (d, e) = (&through[n], &other[1 - n]);
            let still = [(a, Some(d)), (&b, Some(e))];
            let still = still.map(|(value, displacement)| Operand { value, displacement });
            let default = WarpParams::default();
            let [wa, wb] =
                [(a, d), (&b, e)].map(|(v, d)| warp::volume(v, d, &default, &exec()).unwrap().output);
            for op in OPS {
                for windows in [vec![], vec![within(a), within(&b)]] {
                    let params = params(op, &windows);
                    let expected = volumes(&[&wa, &wb].map(Operand::from), &params, &exec()).unwrap();
                    let got = volumes(&still, &params, &exec()).unwrap();
                    assert!(got.output.voxels().as_bytes() == expected.output.voxels().as_bytes(), "{op:?}");
                    assert_eq!(got.voxels_changed, expected.voxels_changed);
                    assert!(got.voxels_changed > 0);
                }
            }
        }
    }
}

#[test]
fn labels_and_masks_through_a_displacement_are_the_warped_ones() {
    let grid = sheared_grid([24, 18, 17]);
    let [d, e] = moved(&grid);
    let with_level = |seed: usize| {
        let level: Vec<f32> = (0..grid.len()).map(|i| (hash(i / 3 + seed) % 21) as f32 - 10.5).collect();
        let inside: Vec<u8> = level.iter().map(|&l| u8::from(l > 0.0)).collect();
        Mask::new(grid.clone(), inside.into()).unwrap().with_level(level.into()).unwrap()
    };
    let bare = |mask: Mask| Mask::new(grid.clone(), mask.buffer().clone()).unwrap();
    for [a, b] in [
        [with_level(1), with_level(2)],
        [bare(with_level(1)), with_level(3)],
        [1, 2].map(|s| bare(with_level(s))),
    ] {
        let through =
            [Operand { value: &a, displacement: Some(&d) }, Operand { value: &b, displacement: Some(&e) }];
        let warped = [(&a, &d), (&b, &e)].map(|(m, d)| warp::mask(m, d, &exec()).unwrap().output);
        for op in OPS {
            let expected = masks(&warped.each_ref().map(Operand::from), &params(op, &[]), &exec()).unwrap();
            assert_eq!(masks(&through, &params(op, &[]), &exec()).unwrap(), expected, "{op:?}");
        }
    }
    let of = |seed: usize| {
        let ids: Vec<u16> = (0..grid.len()).map(|i| (hash(i / 2 + seed) % 4) as u16).collect();
        let class = Class { id: 2, name: None, mean: 1.0, sd: 1.0, voxels: 1, lower: None, upper: None };
        Labels::new(grid.clone(), ids.into(), vec![class]).unwrap()
    };
    let (a, b) = (of(1), of(2));
    let through =
        [Operand { value: &a, displacement: Some(&d) }, Operand { value: &b, displacement: Some(&e) }];
    let warped = [(&a, &d), (&b, &e)]
        .map(|(l, d)| warp::labels(l, d, &WarpParams::default(), &exec()).unwrap().output);
    for op in OPS {
        let expected = labels(&warped.each_ref().map(Operand::from), &params(op, &[]), &exec()).unwrap();
        assert_eq!(labels(&through, &params(op, &[]), &exec()).unwrap(), expected, "{op:?}");
    }
}

#[test]
fn any_number_of_threads_gives_the_same_bytes_and_limits_hold() {
    let grid = sheared_grid([33, 20, 18]);
    let (a, b, [d, _]) = (&of_every_type(&grid, 8)[3], &of_every_type(&grid, 9)[6], moved(&grid));
    let operands = [Operand { value: a, displacement: Some(&d) }, Operand::from(b)];
    for op in OPS {
        let one = volumes(&operands, &params(op, &[]), &exec().with_threads(1)).unwrap();
        for threads in [2, 5] {
            let more = volumes(&operands, &params(op, &[]), &exec().with_threads(threads)).unwrap();
            assert_eq!(more.output.voxels().as_bytes(), one.output.voxels().as_bytes());
            assert_eq!((more.voxels_changed, more.bricks_visited), (one.voxels_changed, one.bricks_visited));
        }
    }
    let tight = exec().with_memory_limit(Some(100));
    let error = volumes(&operands, &params(Op::Union, &[]), &tight).unwrap_err();
    assert_eq!(error.error_class(), ivd_core::ErrorClass::Limit);
    let stopped = exec();
    stopped.cancel.cancel();
    let error = volumes(&operands, &params(Op::Union, &[]), &stopped).unwrap_err();
    assert_eq!(error.error_class(), ivd_core::ErrorClass::Cancelled);
    let other = displacement(&sheared_grid([9, 8, 7]), ivd_core::FieldBricks::zero([9, 8, 7]));
    let operands = [Operand::from(a), Operand { value: b, displacement: Some(&other) }];
    assert!(volumes(&operands, &params(Op::Union, &[]), &exec()).is_err());
}
