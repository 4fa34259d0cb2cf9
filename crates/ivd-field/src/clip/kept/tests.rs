use ivd_core::Grid;
use nalgebra::Vector3;

use super::super::{Cuboid, HalfSpace, volume};
use super::*;
use crate::fixtures::{bump, displacement, field, middle, sheared_grid};
use crate::warp;

const DIMS: [usize; 3] = [27, 26, 19];

/// A part of space, about the grid's middle.
fn part(grid: &Grid, normal: [f64; 3], off: f64) -> HalfSpace {
    let point = Vector3::from(grid.origin()) + middle(grid) + Vector3::from(normal) * off;
    HalfSpace { point: point.into(), normal }
}

#[test]
fn updates_by_bricks_are_the_whole_clip_whatever_changes() {
    let grid = sheared_grid(DIMS);
    let push = |by: f64| {
        let away = Vector3::new(0.8, -0.3, 0.5) * by;
        let moved = displacement(&grid, field(&grid, bump(middle(&grid), 6.0, away)));
        let left = (0..grid.len()).map(|i| u8::from(by > 1.0 && i % 1001 == 500)).collect::<Vec<_>>();
        if by > 1.0 { moved.with_vacated(left.into()).unwrap() } else { moved }
    };
    let still = Displacement::identity(grid.clone());
    let [near, far, left] = [push(0.4), push(0.9), push(1.3)];
    let plane = |off| ClipParams { planes: vec![part(&grid, [0.2, 1.0, 0.1], off)], ..ClipParams::default() };
    let other_side =
        ClipParams { planes: vec![part(&grid, [-0.2, -1.0, -0.1], -3.0)], ..ClipParams::default() };
    let centre = Vector3::from(grid.origin()) + middle(&grid);
    let corner = |by: f64| centre.map(|c| c + by).into();
    let boxed = ClipParams { boxes: vec![Cuboid { min: corner(-3.0), max: corner(4.0) }], ..plane(-2.0) };
    let inverted = ClipParams { invert: true, ..boxed.clone() };
    let valued = ClipParams { background: Some(-0.5), ..inverted.clone() };
    let series: [(&Displacement, &ClipParams, bool); 14] = [
        (&still, &plane(0.0), false),
        (&near, &plane(0.0), false),
        (&near, &plane(1.0), false),
        (&near, &other_side, false),
        (&near, &plane(1.0), false),
        (&near, &plane(1.0), true),
        (&far, &plane(1.0), true),
        (&far, &boxed, true),
        (&left, &boxed, true),
        (&left, &inverted, true),
        (&left, &inverted, false),
        (&near, &inverted, false),
        (&near, &valued, false),
        (&still, &valued, true),
    ];
    // The least value lies where it is pushed away, so that the background changes with the motion.
    let deep = grid.linear(ivd_core::VoxelIndex(DIMS.map(|n| n / 2)));
    let values = |i: usize| if i == deep { -100.0 } else { (i * 7919 % 203) as f32 * 0.37 };
    let rough: Vec<f32> = (0..grid.len()).map(|i| if i == 50 { f32::NAN } else { values(i) }).collect();
    let types =
        [Voxels::from(rough.clone()), Voxels::from(rough.iter().map(|v| *v as i16).collect::<Vec<_>>())];
    let exec = Exec::default();
    for stored in types {
        let rest = Volume::with_scale(grid.clone(), stored, 0.5, -3.0).unwrap();
        let warped =
            |d: &Displacement| warp::volume(&rest, d, &warp::WarpParams::default(), &exec).unwrap().output;
        let mut kept = Kept::new(&rest, &exec).unwrap();
        let (mut before, mut fewest, mut backgrounds) = (&still, usize::MAX, Vec::new());
        for (n, (displacement, params, at_rest)) in series.into_iter().enumerate() {
            let now = warped(displacement);
            let bricks = displacement.changed(before).unwrap();
            let was = kept.output().clone();
            let again = kept.update(&now, params, at_rest, displacement, &bricks, &exec);
            let by = By { tag: None, displacement: at_rest.then_some(displacement) };
            let whole = volume(&now, params, &by, &exec).unwrap().output;
            let same = kept.output().voxels().as_bytes() == whole.voxels().as_bytes();
            assert!(same, "{:?}, step {n}", rest.voxel_type());
            assert_eq!(kept.output().bricks(), whole.bricks(), "step {n}");
            let brick_dims = DIMS.map(|n| n.div_ceil(8));
            for i in
                (0..grid.len()).filter(|i| was.voxels().get(*i).to_bits() != whole.voxels().get(*i).to_bits())
            {
                let at = grid.index(i).0.map(|c| c / 8);
                let brick = at[0] + brick_dims[0] * (at[1] + brick_dims[1] * at[2]);
                assert!(again.binary_search(&brick).is_ok(), "{i} changed unsaid in step {n}");
            }
            fewest = fewest.min(again.len());
            backgrounds.push(stored_background(&now, params));
            before = displacement;
        }
        assert!(fewest < 24, "{fewest} of 48 bricks");
        backgrounds.dedup();
        assert!(backgrounds.len() > 2, "the background changes: {backgrounds:?}");
    }
}
