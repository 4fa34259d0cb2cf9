use ivd_core::{Class, Classified, FieldBricks, VoxelCoord, VoxelIndex, Voxels};
use nalgebra::Vector3;

use super::*;
use crate::fixtures::{bump, displacement, field, middle, sheared_grid, voxels};
use crate::warp::{self, WarpParams};

fn exec() -> Exec {
    Exec::default()
}

fn hash(i: usize) -> u64 {
    let mixed = (i as u64 + 1).wrapping_mul(0x9E37_79B9_7F4A_7C15);
    (mixed ^ (mixed >> 29)).wrapping_mul(0xBF58_476D_1CE4_E5B9) >> 32
}

/// A number within −1 … 1.
fn number(i: usize) -> f64 {
    (hash(i) % 2001) as f64 / 1000.0 - 1.0
}

fn random(grid: &Grid) -> Volume {
    let value = |i: usize| {
        if hash(i).is_multiple_of(17) { f32::from_bits(0x7fc0_0000 | i as u32) } else { hash(i) as f32 }
    };
    Volume::new(grid.clone(), Voxels::from((0..grid.len()).map(value).collect::<Vec<f32>>())).unwrap()
}

/// A place near the middle of a grid.
fn near_middle(grid: &Grid, seed: usize) -> Vector3<f64> {
    let extent = grid.linear_part() * Vector3::from(grid.dims()).map(|n| n as f64 * 0.3);
    let scatter = Vector3::from_fn(|a, _| number(3 * seed + a)).component_mul(&extent);
    Vector3::from(grid.origin()) + middle(grid) + scatter
}

/// Planes and boxes that cut a grid somewhere.
fn some_cut(grid: &Grid, seed: usize) -> ClipParams {
    let normal = std::array::from_fn(|a| number(100 + 3 * seed + a) * 10.0_f64.powi((seed % 5) as i32 - 2));
    let plane = HalfSpace { point: near_middle(grid, seed).into(), normal };
    let (p, q) = (near_middle(grid, seed + 50), near_middle(grid, seed + 70));
    let pad = Vector3::repeat(2.0);
    let cuboid = Cuboid { min: (p.inf(&q) - pad).into(), max: (p.sup(&q) + pad).into() };
    let (planes, boxes) = match seed % 3 {
        0 => (vec![plane], vec![]),
        1 => (vec![], vec![cuboid]),
        _ => (vec![plane], vec![cuboid]),
    };
    ClipParams { planes, boxes, invert: seed % 2 == 1, ..ClipParams::default() }
}

/// The plain test of one place, by the definition.
fn inside(params: &ClipParams, at: Vector3<f64>) -> bool {
    params.planes.iter().all(|h| Vector3::from(h.normal).dot(&(at - Vector3::from(h.point))) >= 0.0)
        && params.boxes.iter().all(|b| (0..3).all(|a| (b.min[a]..=b.max[a]).contains(&at[a])))
}

#[test]
fn planes_and_boxes_equal_brute_force_on_oblique_grids() {
    for (n, dims) in [[27, 19, 20], [8, 8, 8], [1, 33, 9], [40, 3, 1]].into_iter().enumerate() {
        for grid in [sheared_grid(dims), Grid::with_spacing(dims, [0.7, 1.0, 2.3]).unwrap()] {
            let input = random(&grid);
            let lowest = input.stored(input.range().unwrap()[0]);
            let mut decided = 0;
            for seed in 0..12 {
                let params = some_cut(&grid, seed + 1000 * n);
                let got = volume(&input, &params, &By::default(), &exec()).unwrap();
                let mut kept = 0;
                for v in voxels(&grid) {
                    let keeps = inside(&params, grid.world(VoxelCoord::from(v)).0) != params.invert;
                    let (was, is) =
                        (input.voxels().get(grid.linear(v)), got.output.voxels().get(grid.linear(v)));
                    assert_eq!(is.to_bits(), if keeps { was } else { lowest }.to_bits(), "{params:?} {v:?}");
                    kept += u64::from(keeps);
                }
                assert_eq!((got.voxels_kept, got.voxels_clipped), (kept, grid.len() as u64 - kept));
                let mut plain = exec();
                plain.skip = false;
                let twin = volume(&input, &params, &By::default(), &plain).unwrap();
                assert_eq!(twin.output.voxels().as_bytes(), got.output.voxels().as_bytes());
                assert_eq!((twin.voxels_kept, twin.bricks_visited), (kept, got.bricks_total));
                decided += got.bricks_total - got.bricks_visited;
            }
            assert!(dims.contains(&1) || dims == [8; 3] || decided > 0, "no brick is decided at once");
        }
    }
}

#[test]
fn what_lies_on_a_border_is_kept_and_its_complement_thrown_away() {
    // On an oblique grid the voxels of one plane are at distances that rounding scatters about 0.
    let grid = sheared_grid([24, 20, 17]);
    let input = Volume::new(grid.clone(), vec![9_u8; grid.len()].into()).unwrap();
    let index = |v: [usize; 3]| grid.world(VoxelCoord::from(VoxelIndex(v))).0;
    let (p, q, r) = (index([0, 11, 0]), index([23, 11, 0]), index([0, 11, 16]));
    let normal = (q - p).cross(&(r - p));
    let side = if normal.dot(&(index([0, 12, 0]) - p)) > 0.0 { normal } else { -normal };
    let plane = HalfSpace { point: index([7, 11, 3]).into(), normal: side.into() };
    let mut params = ClipParams { planes: vec![plane], background: Some(0.0), ..ClipParams::default() };
    let kept = volume(&input, &params, &By::default(), &exec()).unwrap();
    params.invert = true;
    let rest = volume(&input, &params, &By::default(), &exec()).unwrap();
    for v in voxels(&grid) {
        let expected = if v.0[1] >= 11 { [9.0, 0.0] } else { [0.0, 9.0] };
        assert_eq!([&kept, &rest].map(|c| c.output.value(v)), expected, "{v:?}");
    }
    // Faces of a box, and a box as thin as a slice.
    let grid = Grid::with_spacing([6, 5, 4], [0.1, 0.1, 0.1]).unwrap();
    let input = Volume::new(grid.clone(), vec![9_u8; grid.len()].into()).unwrap();
    let slice = Cuboid { min: [0.1, 0.0, 0.3], max: [0.3, 0.4, 0.3] };
    let params = ClipParams { boxes: vec![slice], background: Some(0.0), ..ClipParams::default() };
    assert_eq!(volume(&input, &params, &By::default(), &exec()).unwrap().voxels_kept, 3 * 5);
}

#[test]
fn every_type_keeps_its_bits_and_takes_the_background() {
    let grid = sheared_grid([13, 9, 8]);
    let right =
        HalfSpace { point: (Vector3::from(grid.origin()) + middle(&grid)).into(), normal: [1.0, 0.2, 0.0] };
    let values: Vec<i16> = (0..grid.len()).map(|i| (hash(i) % 201) as i16 - 100).collect();
    let stored: [Voxels; 8] = [
        Voxels::from(values.iter().map(|&v| v as u8).collect::<Vec<_>>()),
        Voxels::from(values.iter().map(|&v| v as i8).collect::<Vec<_>>()),
        Voxels::from(values.iter().map(|&v| v as u16).collect::<Vec<_>>()),
        Voxels::from(values.clone()),
        Voxels::from(values.iter().map(|&v| v as u32).collect::<Vec<_>>()),
        Voxels::from(values.iter().map(|&v| i32::from(v)).collect::<Vec<_>>()),
        Voxels::from(values.iter().map(|&v| f32::from(v)).collect::<Vec<_>>()),
        Voxels::from(values.iter().map(|&v| f64::from(v)).collect::<Vec<_>>()),
    ];
    for stored in stored {
        let kind = stored.voxel_type();
        let input = Volume::with_scale(grid.clone(), stored, -0.5, 3.0).unwrap();
        for background in [None, Some(-7.5), Some(1e300)] {
            let params = ClipParams { planes: vec![right], background, ..ClipParams::default() };
            let got = volume(&input, &params, &By::default(), &exec()).unwrap();
            let real = background.unwrap_or_else(|| input.range().unwrap()[0]);
            let limits = input.clone();
            let expected = crate::fixtures::voxels(&grid)
                .find(|v| !inside(&params, grid.world(VoxelCoord::from(*v)).0))
                .map(|v| got.output.voxels().get(grid.linear(v)))
                .unwrap();
            if background != Some(1e300) {
                let exact = limits.stored(real);
                let rounded = if kind.is_integer() { exact.round_ties_even() } else { exact };
                let clamped =
                    if kind == ivd_core::VoxelType::U8 { rounded.clamp(0.0, 255.0) } else { rounded };
                assert_eq!(expected, clamped, "{kind:?} {background:?}");
            }
            assert!(expected.is_finite());
            for v in voxels(&grid) {
                let keeps = inside(&params, grid.world(VoxelCoord::from(v)).0);
                let i = grid.linear(v);
                assert_eq!(got.output.voxels().get(i), if keeps { input.voxels().get(i) } else { expected });
            }
        }
    }
}

#[test]
fn tags_keep_what_they_tag_on_any_grid() {
    let grid = sheared_grid([19, 12, 9]);
    let input = random(&grid);
    let ids: Vec<u16> = (0..grid.len()).map(|i| (hash(i) % 4) as u16).collect();
    let class =
        |id| Class { id, name: None, mean: f64::from(id), sd: 0.0, voxels: 0, lower: None, upper: None };
    let tag = Labels::new(grid.clone(), ids.clone().into(), vec![class(2)]).unwrap();
    let by = |tag| By { tag: Some(tag), displacement: None };
    let kept = |got: &Clipped<Volume>| -> Vec<bool> {
        (0..grid.len())
            .map(|i| got.output.voxels().get(i).to_bits() == input.voxels().get(i).to_bits())
            .collect()
    };
    for class in [None, Some(2), Some(3)] {
        let params = ClipParams { class, background: Some(-1.0), ..ClipParams::default() };
        let got = volume(&input, &params, &by(Tag::Labels(&tag)), &exec()).unwrap();
        let expected = ids.iter().map(|&id| class.map_or(id != 0, |class| id == class));
        assert_eq!(kept(&got), expected.collect::<Vec<_>>(), "{class:?}");
    }
    // A coarser mask that covers less: the nearest voxel, nothing beyond.
    let coarse =
        Grid::new([5, 4, 3], [1.7, 2.1, 4.5], [1.0e4 + 1.0, -299.0, 40.0], grid.direction()).unwrap();
    let mask =
        Mask::new(coarse.clone(), (0..60).map(|i| (hash(i) % 2) as u8).collect::<Vec<_>>().into()).unwrap();
    let params = ClipParams { background: Some(-1.0), ..some_cut(&grid, 6) };
    let got = volume(&input, &params, &by(Tag::Mask(&mask)), &exec()).unwrap();
    let expected = voxels(&grid).map(|v| {
        let world = grid.world(VoxelCoord::from(v));
        let at = coarse.voxel(world).0.map(|c| (c + 0.5).floor());
        let within = (0..3).all(|a| at[a] >= 0.0 && at[a] < coarse.dims()[a] as f64);
        let tagged =
            within && mask.inside()[coarse.linear(VoxelIndex([0, 1, 2].map(|a| at[a] as usize)))] == 1;
        (tagged && inside(&params, world.0)) != params.invert
    });
    let expected: Vec<bool> = expected.collect();
    assert!(expected.contains(&true) && expected.contains(&false));
    assert_eq!(kept(&got), expected);
}

#[test]
fn labels_and_masks_take_nothing_by_default_and_sizes_follow() {
    let grid = Grid::with_spacing([6, 1, 1], [1.0; 3]).unwrap();
    let class =
        |id, voxels| Class { id, name: None, mean: f64::from(id), sd: 1.0, voxels, lower: None, upper: None };
    let input =
        Labels::new(grid.clone(), vec![1_u16, 1, 2, 2, 2, 1].into(), vec![class(1, 3), class(2, 3)]).unwrap();
    let right = HalfSpace { point: [3.0, 0.0, 0.0], normal: [1.0, 0.0, 0.0] };
    let mut params = ClipParams { planes: vec![right], ..ClipParams::default() };
    let got = labels(&input, &params, &By::default(), &exec()).unwrap().output;
    assert_eq!(got.ids(), [0, 0, 0, 2, 2, 1]);
    assert_eq!([1, 2].map(|id| got.class(id).unwrap().voxels), [1, 2]);
    let level = vec![-3.0_f32, 0.5, 2.0, 2.0, -0.5, -4.0];
    let part = Mask::new(grid, vec![0, 1, 1, 1, 0, 0].into()).unwrap().with_level(level.into()).unwrap();
    let got = mask(&part, &params, &By::default(), &exec()).unwrap().output;
    assert_eq!(got.inside(), [0, 0, 0, 1, 0, 0]);
    assert_eq!(got.level().unwrap()[..], [-3.0, -1.0, -1.0, 2.0, -0.5, -4.0]);
    params.background = Some(1.0);
    let got = mask(&part, &params, &By::default(), &exec()).unwrap().output;
    assert_eq!((got.inside(), &got.level().unwrap()[..3]), (&[1, 1, 1, 1, 0, 0][..], &[1.0, 1.0, 2.0][..]));
    params.background = Some(2.0);
    assert!(mask(&part, &params, &By::default(), &exec()).unwrap_err().to_string().contains("0 or 1"));
    params.background = Some(1.5);
    assert!(labels(&input, &params, &By::default(), &exec()).unwrap_err().to_string().contains("0…65535"));
}

#[test]
fn a_translated_ball_is_clipped_in_rest_space_as_before_it_moved() {
    // Whole voxels: nothing is interpolated, and the two orders agree to the voxel.
    let grid = Grid::with_spacing([40, 32, 24], [0.5, 1.0, 1.5]).unwrap();
    let centre = middle(&grid);
    let dense = |v: VoxelIndex| {
        let r = (grid.world(VoxelCoord::from(v)).0 - centre).norm();
        if r < 7.0 { 100 + (hash(grid.linear(v)) % 100) as u8 } else { 0 }
    };
    let ball = Volume::new(grid.clone(), Voxels::from(voxels(&grid).map(dense).collect::<Vec<_>>())).unwrap();
    let shift = displacement(&grid, field(&grid, |_| Vector3::new(2.0, -3.0, 1.5)));
    let tilted = HalfSpace { point: centre.into(), normal: [0.3, 1.0, -0.2] };
    let warped = warp::volume(&ball, &shift, &WarpParams::default(), &exec()).unwrap().output;
    for invert in [false, true] {
        let params =
            ClipParams { planes: vec![tilted], invert, background: Some(0.0), ..ClipParams::default() };
        let by = By { displacement: Some(&shift), tag: None };
        let after = volume(&warped, &params, &by, &exec()).unwrap().output;
        let before = volume(&ball, &params, &By::default(), &exec()).unwrap().output;
        let before = warp::volume(&before, &shift, &WarpParams::default(), &exec()).unwrap().output;
        assert_eq!(after, before);
        assert_ne!(after, warped);
    }
}

#[test]
fn a_bent_cut_differs_from_the_warp_of_the_cut_by_its_border_alone() {
    let grid = sheared_grid([40, 32, 17]);
    let mut moved = displacement(&grid, field(&grid, bump(middle(&grid), 8.0, Vector3::new(1.5, 1.5, -1.0))));
    let smooth = |v: VoxelIndex| 200.0 - (grid.linear_part() * VoxelCoord::from(v).0 - middle(&grid)).norm();
    let input =
        Volume::new(grid.clone(), Voxels::from(voxels(&grid).map(smooth).collect::<Vec<f64>>())).unwrap();
    let warped = warp::volume(&input, &moved, &WarpParams::default(), &exec()).unwrap().output;
    let point = Vector3::from(grid.origin()) + middle(&grid) + Vector3::new(0.13, 0.07, 0.0);
    let plane = HalfSpace { point: point.into(), normal: [1.0, 0.4, 0.1] };
    let params = ClipParams { planes: vec![plane], background: Some(0.0), ..ClipParams::default() };
    let by = By { displacement: Some(&moved), tag: None };
    let after = volume(&warped, &params, &by, &exec()).unwrap();
    let before = volume(&input, &params, &By::default(), &exec()).unwrap().output;
    let before = warp::volume(&before, &moved, &WarpParams::default(), &exec()).unwrap().output;
    let (normal, mut border) = (Vector3::from(plane.normal).normalize(), 0);
    for v in voxels(&grid) {
        let psi = Vector3::from(moved.inverse().at(v)).map(f64::from);
        let distance = normal.dot(&(grid.world(VoxelCoord::from(v)).0 + psi - point));
        // Linear interpolation reads no further than a voxel's diagonal.
        if distance.abs() > grid.voxel_diagonal() {
            assert_eq!(after.output.value(v), before.value(v), "{v:?} at {distance} mm");
        }
        assert_eq!(after.output.value(v), if distance >= 0.0 { warped.value(v) } else { 0.0 });
        border += usize::from(after.output.value(v) != before.value(v));
    }
    assert!(border > 0, "interpolation mixes at the border");
    // What a part left behind has no place at rest.
    let vacated: Vec<_> = (0..grid.len()).map(|i| u8::from(hash(i).is_multiple_of(7))).collect();
    moved = moved.with_vacated(vacated.into()).unwrap();
    for invert in [false, true] {
        let params = ClipParams { invert, ..params.clone() };
        let got = volume(&warped, &params, &By { displacement: Some(&moved), tag: None }, &exec()).unwrap();
        for (i, flag) in moved.vacated().iter().enumerate().filter(|(_, flag)| **flag != 0) {
            assert_eq!(got.output.voxels().get(i), warped.voxels().get(i), "{flag} at {i}");
        }
        let mut plain = exec();
        plain.skip = false;
        let twin = volume(&warped, &params, &By { displacement: Some(&moved), tag: None }, &plain).unwrap();
        assert_eq!(twin.output, got.output);
    }
}

#[test]
fn what_makes_no_sense_is_refused_by_name_and_an_empty_part_is_not() {
    let grid = sheared_grid([9, 8, 7]);
    let input = random(&grid);
    let refused = |params: &ClipParams, by: &By<'_>| {
        let error = volume(&input, params, by, &exec()).unwrap_err();
        assert_eq!(error.error_class(), ivd_core::ErrorClass::Usage);
        error.to_string()
    };
    let by = By::default();
    assert!(refused(&ClipParams::default(), &by).contains("nothing to clip by"));
    let plane =
        |point, normal| ClipParams { planes: vec![HalfSpace { point, normal }], ..ClipParams::default() };
    let cuboid = |min, max| ClipParams { boxes: vec![Cuboid { min, max }], ..ClipParams::default() };
    assert!(
        refused(&plane([1.0; 3], [0.0; 3]), &by)
            .contains("`plane`: the normal at [1.0, 1.0, 1.0] has length 0")
    );
    assert!(refused(&plane([f64::NAN, 0.0, 0.0], [1.0; 3]), &by).contains("point"));
    assert!(refused(&plane([0.0; 3], [f64::INFINITY, 0.0, 0.0]), &by).contains("normal"));
    assert!(refused(&cuboid([0.0, 2.0, 0.0], [1.0, 1.0, 1.0]), &by).contains("along y"));
    let background = ClipParams { background: Some(f64::NAN), ..plane([0.0; 3], [1.0; 3]) };
    assert!(refused(&background, &by).contains("background"));
    let class = ClipParams { class: Some(4), ..ClipParams::default() };
    let mask = Mask::new(grid.clone(), vec![1; grid.len()].into()).unwrap();
    assert!(refused(&class, &By { tag: Some(Tag::Mask(&mask)), ..by }).contains("4 is a class of no labels"));
    let tag = Labels::new(grid.clone(), vec![1; grid.len()].into(), Vec::new()).unwrap();
    assert!(
        refused(&class, &By { tag: Some(Tag::Labels(&tag)), ..by })
            .contains("no voxel of the tag has label 4")
    );
    let other = displacement(&sheared_grid([8, 8, 7]), FieldBricks::zero([8, 8, 7]));
    assert!(refused(&plane([0.0; 3], [1.0; 3]), &By { displacement: Some(&other), ..by }).contains("grids"));
    // Beside the volume, of no voxel, with a normal of any length.
    let all = volume(&input, &cuboid([0.0; 3], [1.0; 3]), &by, &exec()).unwrap();
    assert_eq!((all.voxels_kept, all.bricks_visited), (0, 0));
    for length in [1e-320, 1.0, 1e308] {
        let far = plane([0.0; 3], [length, 0.0, 0.0]);
        assert_eq!(volume(&input, &far, &by, &exec()).unwrap().voxels_clipped, 0, "{length}");
    }
    let tight = exec().with_memory_limit(Some(100));
    let error = volume(&input, &plane([0.0; 3], [1.0; 3]), &by, &tight).unwrap_err();
    assert_eq!(error.error_class(), ivd_core::ErrorClass::Limit);
    let stopped = exec();
    stopped.cancel.cancel();
    let error = volume(&input, &plane([0.0; 3], [1.0; 3]), &by, &stopped).unwrap_err();
    assert_eq!(error.error_class(), ivd_core::ErrorClass::Cancelled);
}

#[test]
fn any_number_of_threads_gives_the_same_bytes() {
    let grid = sheared_grid([33, 30, 17]);
    let (input, params) = (random(&grid), some_cut(&grid, 2));
    let moved = displacement(&grid, field(&grid, bump(middle(&grid), 6.0, Vector3::new(1.0, 1.0, -1.0))));
    let by = By { displacement: Some(&moved), tag: None };
    let one = volume(&input, &params, &by, &exec().with_threads(1)).unwrap();
    for threads in [2, 5] {
        let more = volume(&input, &params, &by, &exec().with_threads(threads)).unwrap();
        assert_eq!(more.output.voxels().as_bytes(), one.output.voxels().as_bytes());
        assert_eq!((more.voxels_kept, more.bricks_visited), (one.voxels_kept, one.bricks_visited));
    }
}
