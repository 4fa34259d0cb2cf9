//! Isolation against a plain flood fill, and on awkward volumes.
// The helpers of these tests may unwrap as the tests do.
#![allow(clippy::unwrap_used)]

use std::collections::VecDeque;

use ivd_boundary::{Component, ComponentParams, Error, component};
use ivd_core::{Class, ClassChoice, Classified, ErrorClass, Exec, Grid, Labels, Volume, Voxels, noise};

fn above(value: f64) -> ComponentParams {
    ComponentParams { above: Some(value), ..ComponentParams::default() }
}

fn volume(dims: [usize; 3], voxels: impl Into<Voxels>) -> Volume {
    Volume::new(Grid::with_spacing(dims, [1.0; 3]).unwrap(), voxels.into()).unwrap()
}

fn isolate(volume: &Volume, params: &ComponentParams) -> Result<Component, Error> {
    component(volume, None, params, &Exec::default())
}

/// Component of each voxel that `holds`, by flood fill through faces in the order of the voxels.
fn flood(dims: [usize; 3], holds: &dyn Fn(usize) -> bool) -> Vec<Option<usize>> {
    let n: usize = dims.iter().product();
    let mut found = vec![None; n];
    for first in 0..n {
        if found[first].is_some() || !holds(first) {
            continue;
        }
        found[first] = Some(first);
        let mut queue = VecDeque::from([first]);
        while let Some(i) = queue.pop_front() {
            let at = [i % dims[0], i / dims[0] % dims[1], i / dims[0] / dims[1]].map(|v| v as i64);
            for d in 0..27 {
                let step = [d % 3 - 1, d / 3 % 3 - 1, d / 9 - 1];
                if step.iter().map(|s: &i64| s.abs()).sum::<i64>() != 1 {
                    continue;
                }
                let to: [i64; 3] = std::array::from_fn(|a| at[a] + step[a]);
                if (0..3).all(|a| to[a] >= 0 && to[a] < dims[a] as i64) {
                    let j = to[0] as usize + dims[0] * (to[1] as usize + dims[1] * to[2] as usize);
                    if found[j].is_none() && holds(j) {
                        found[j] = Some(first);
                        queue.push_back(j);
                    }
                }
            }
        }
    }
    found
}

/// The largest component, or the outermost that encloses it, with its holes filled, plainly; and the number of components.
fn plain(dims: [usize; 3], part: &[bool]) -> (Vec<u8>, usize) {
    let pieces = flood(dims, &|i| part[i]);
    let size = |name: usize| pieces.iter().filter(|p| **p == Some(name)).count();
    let names: Vec<usize> = (0..part.len()).filter(|&i| pieces[i] == Some(i)).collect();
    let mut taken = *names.iter().max_by_key(|&&n| (size(n), std::cmp::Reverse(n))).unwrap();
    let border = |i: usize| {
        let at = [i % dims[0], i / dims[0] % dims[1], i / dims[0] / dims[1]];
        (0..3).any(|a| at[a] == 0 || at[a] + 1 == dims[a])
    };
    let filled = |piece: usize| -> Vec<bool> {
        let background = flood(dims, &|i| pieces[i] != Some(piece));
        let outside: Vec<usize> =
            (0..part.len()).filter(|&i| border(i)).filter_map(|i| background[i]).collect();
        (0..part.len()).map(|i| background[i].is_none_or(|b| !outside.contains(&b))).collect()
    };
    // From one that encloses it to the next, until none does. A piece is named by its first voxel.
    while let Some(round) = names.iter().find(|&&n| n != taken && filled(n)[taken]) {
        taken = *round;
    }
    (filled(taken).into_iter().map(u8::from).collect(), names.len())
}

#[test]
fn pieces_and_holes_equal_a_plain_flood_fill() {
    let mut empty = 0;
    for case in 0..200 {
        let dims: [usize; 3] = std::array::from_fn(|a| 1 + noise::below(case, a as u64, 7) as usize);
        let (seed, fill) = (noise::bits(case, 3), 1 + noise::below(case, 4, 9));
        let n = dims.iter().product::<usize>();
        let part: Vec<bool> = (0..n as u64).map(|i| noise::below(seed, i, 10) < fill).collect();
        let v = volume(dims, part.iter().map(|&p| u8::from(p)).collect::<Vec<_>>());
        match isolate(&v, &above(0.5)) {
            Err(Error::NothingAbove { .. }) => {
                assert!(part.iter().all(|p| !p), "case {case}");
                empty += 1;
            }
            Err(other) => panic!("case {case}: {other}"),
            Ok(found) => {
                let (mask, components) = plain(dims, &part);
                assert_eq!(found.mask.inside(), &mask[..], "case {case}");
                assert_eq!(found.components, components, "case {case}");
                assert_eq!(found.voxels, mask.iter().map(|&m| u64::from(m)).sum::<u64>(), "case {case}");
            }
        }
    }
    assert!(empty < 20, "{empty} of 200 volumes hold nothing");
}

#[test]
fn nested_pieces_equal_a_plain_flood_fill() {
    let (mut enclosed, mut largest) = (0, 0);
    for case in 0..60 {
        let dims: [usize; 3] = std::array::from_fn(|a| 17 + noise::below(case, a as u64, 4) as usize);
        let n = dims.iter().product::<usize>();
        // A solid cube in shells that are there or aren't, and one voxel in a few hundred of all that is open.
        let (core, there) = (4 + noise::below(case, 3, 3) as usize, noise::below(case, 4, 512));
        let gaps = [0, 300, 2000][noise::below(case, 5, 3) as usize];
        let part: Vec<bool> = (0..n)
            .map(|i| {
                let at = [i % dims[0], i / dims[0] % dims[1], i / dims[0] / dims[1]];
                let ring = at.iter().map(|&c: &usize| c.abs_diff(8)).max().unwrap();
                let is_shell = ring > core + 1 && ring < 9 && there >> ring & 1 == 1;
                let is_gap = gaps > 0 && noise::below(noise::bits(case, 6), i as u64, gaps) == 0;
                (ring <= core || is_shell) && !is_gap
            })
            .collect();
        let v = volume(dims, part.iter().map(|&p| u8::from(p)).collect::<Vec<_>>());
        let found = isolate(&v, &above(0.5)).unwrap();
        let (mask, components) = plain(dims, &part);
        assert_eq!((found.mask.inside(), found.components), (&mask[..], components), "case {case}");
        enclosed += usize::from(found.encloses.is_some());
        largest += usize::from(found.encloses.is_none());
    }
    assert!(enclosed >= 10 && largest >= 10, "{enclosed} enclose the largest, {largest} are it");
}

/// A cube shell of side 5 in a box of 9, hollow of side 3, with chosen voxels of the shell opened.
fn shell(doors: &[[usize; 3]]) -> Volume {
    let mut voxels = vec![0_u8; 729];
    for i in 0..729 {
        let at = [i % 9, i / 9 % 9, i / 81];
        let ring = at.iter().map(|&c: &usize| c.abs_diff(4)).max().unwrap();
        voxels[i] = u8::from(ring == 2 && !doors.contains(&at));
    }
    volume([9; 3], voxels)
}

#[test]
fn a_hole_is_filled_and_a_hole_with_a_door_is_not() {
    let closed = isolate(&shell(&[]), &above(1.0)).unwrap();
    assert_eq!((closed.voxels, closed.filled), (125, 27));
    let open = isolate(&shell(&[[2, 4, 4]]), &above(1.0)).unwrap();
    assert_eq!((open.voxels, open.filled), (97, 0));
    let through_an_edge = isolate(&shell(&[[2, 2, 4]]), &above(1.0)).unwrap();
    assert_eq!(through_an_edge.filled, 27, "background passes faces only");
    let kept = ComponentParams { fill_holes: false, ..above(1.0) };
    assert_eq!(isolate(&shell(&[]), &kept).unwrap().voxels, 98);
}

/// A cube of side 19 in the middle of a box of 31, in shells whose half sides are given, and a cube of side 2 in a corner; chosen voxels are opened.
fn shells(halves: &[usize], doors: &[[usize; 3]]) -> Volume {
    let holds = |i: usize| {
        let at = [i % 31, i / 31 % 31, i / 961];
        let ring = at.iter().map(|c: &usize| c.abs_diff(15)).max().unwrap();
        (ring <= 9 || halves.contains(&ring) || at.iter().all(|c| *c < 2)) && !doors.contains(&at)
    };
    volume([31; 3], (0..29_791).map(|i| u8::from(holds(i))).collect::<Vec<_>>())
}

#[test]
fn what_encloses_the_largest_piece_is_the_body() {
    let solid = |half: u64| (2 * half + 1).pow(3);
    let found =
        |halves: &[usize], doors: &[[usize; 3]]| isolate(&shells(halves, doors), &above(1.0)).unwrap();
    assert_eq!(found(&[], &[]).voxels, solid(9));
    // Thin shells have fewer voxels than the cube: 2,906 and 4,058 of 6,859.
    for (halves, half) in [(&[11][..], 11), (&[13], 13), (&[11, 13], 13)] {
        let found = found(halves, &[]);
        assert_eq!((found.voxels, found.components), (solid(half), 2 + halves.len()));
        assert_eq!(found.encloses, Some(solid(9)));
    }
    // A shell with a door encloses nothing.
    let door = [15, 15, 28];
    assert_eq!(found(&[13], &[door]).voxels, solid(9));
    assert_eq!(found(&[11, 13], &[door]).voxels, solid(11));
    // What is asked for, and what isn't filled, stays a piece.
    let v = shells(&[11], &[]);
    let seed = ComponentParams { seed: Some([15.0; 3]), ..above(1.0) };
    assert_eq!(isolate(&v, &seed).unwrap().voxels, solid(9));
    let hollow = ComponentParams { fill_holes: false, ..above(1.0) };
    assert_eq!(isolate(&v, &hollow).unwrap().voxels, solid(9));
}

#[test]
fn a_hollow_that_touches_the_border_is_outside() {
    let whole = volume([3, 3, 3], vec![1_u8; 27]);
    assert_eq!(isolate(&whole, &above(1.0)).unwrap().voxels, 27);
    let mut voxels = vec![1_u8; 27];
    voxels[4] = 0;
    assert_eq!(isolate(&volume([3, 3, 3], voxels.clone()), &above(1.0)).unwrap().voxels, 26);
    voxels[4] = 1;
    voxels[13] = 0;
    assert_eq!(isolate(&volume([3, 3, 3], voxels), &above(1.0)).unwrap().filled, 1);
}

#[test]
fn one_voxel_and_flat_volumes_work() {
    assert_eq!(isolate(&volume([1, 1, 1], vec![3_i16]), &above(3.0)).unwrap().voxels, 1);
    let ring = [1_u8, 1, 1, 1, 0, 1, 1, 1, 1];
    for dims in [[1, 3, 3], [3, 1, 3], [3, 3, 1]] {
        let found = isolate(&volume(dims, ring.to_vec()), &above(1.0)).unwrap();
        assert_eq!((found.voxels, found.filled), (8, 0), "in a flat volume every voxel touches the border");
    }
}

#[test]
fn missing_voxels_are_never_part_even_inside_a_hole() {
    let mut voxels = vec![5.0_f32; 125];
    voxels[62] = f32::NAN;
    voxels[63] = 0.0;
    voxels[0] = f32::INFINITY;
    let found = isolate(&volume([5; 3], voxels), &above(1.0)).unwrap();
    assert_eq!((found.voxels, found.filled), (123, 1));
    assert_eq!((found.mask.inside()[62], found.mask.inside()[63], found.mask.inside()[0]), (0, 1, 0));
}

/// Two bars of class 2 in air (1), one of class 3; on an oblique, left-handed grid far from the origin.
fn bars() -> (Volume, Labels) {
    let (s, c) = 0.3_f64.sin_cos();
    let grid = Grid::new(
        [7, 3, 3],
        [0.5, 2.0, 1.0],
        [1e5, 0.0, -40.0],
        [[c, s, 0.0], [s, -c, 0.0], [0.0, 0.0, 1.0]],
    )
    .unwrap();
    let ids: Vec<u16> = (0..63).map(|i| [1, 2, 1, 2, 2, 1, 3][i % 7]).collect();
    let class = |id: u16, voxels| Class {
        id,
        name: None,
        mean: f64::from(id) * 10.0,
        sd: 1.0,
        voxels,
        lower: (id > 1).then_some(f64::from(id) * 10.0 - 5.0),
        upper: (id < 3).then_some(f64::from(id) * 10.0 + 5.0),
    };
    let volume =
        Volume::new(grid.clone(), ids.iter().map(|&i| i as u8 * 10).collect::<Vec<_>>().into()).unwrap();
    (volume, Labels::new(grid, ids.into(), vec![class(1, 27), class(2, 27), class(3, 9)]).unwrap())
}

#[test]
fn classes_are_chosen_by_id_density_and_size_and_seeds_pick_the_piece() {
    let (volume, labels) = bars();
    let world = |x: usize| volume.grid().world(ivd_core::VoxelIndex([x, 1, 1]).into()).0.into();
    let run = |class, seed| {
        component(
            &volume,
            Some(&labels),
            &ComponentParams { class, seed, ..ComponentParams::default() },
            &Exec::default(),
        )
    };
    let largest = run(None, None).unwrap();
    assert_eq!((largest.class, largest.voxels, largest.components), (Some(2), 18, 2));
    assert_eq!((largest.lower, largest.upper), (Some(15.0), Some(25.0)));
    assert_eq!(run(Some(ClassChoice::Densest), None).unwrap().class, Some(3));
    assert_eq!(run(Some(ClassChoice::Id(1)), None).unwrap().components, 3);
    assert_eq!(run(Some(ClassChoice::Id(2)), Some(world(1))).unwrap().voxels, 9);
    let at_seed = run(None, Some(world(6))).unwrap();
    assert_eq!((at_seed.class, at_seed.upper), (Some(3), None));
    let Err(Error::SeedElsewhere { found, distance_mm, .. }) = run(Some(ClassChoice::Id(3)), Some(world(3)))
    else {
        panic!("the seed isn't in class 3")
    };
    assert_eq!(found, "class 2");
    assert!((distance_mm - 1.5).abs() < 1e-6);
    let Err(Error::SeedOutside { dims, .. }) = run(None, Some([0.0; 3])) else { panic!("far outside") };
    assert_eq!(dims, [7, 3, 3]);
    let error = run(Some(ClassChoice::Id(9)), None).unwrap_err();
    assert!(error.to_string().contains("2 (mean 20") && error.error_class() == ErrorClass::Usage, "{error}");
}

#[test]
fn seeds_in_nothing_and_empty_parts_say_so() {
    let v = volume([4, 1, 1], vec![0_u8, 0, 0, 9]);
    let params = ComponentParams { seed: Some([0.0; 3]), ..above(5.0) };
    let Err(Error::SeedElsewhere { distance_mm, .. }) = isolate(&v, &params) else {
        panic!("0 isn't above 5")
    };
    assert_eq!(distance_mm, 3.0);
    assert!(isolate(&v, &above(10.0)).unwrap_err().to_string().contains("0 to 9"));
    assert!(isolate(&volume([1, 1, 1], vec![f32::NAN]), &above(0.0)).is_err());
    assert!(isolate(&v, &ComponentParams::default()).unwrap_err().to_string().contains("`above`"));
}

#[test]
fn threads_limits_and_cancelling_behave() {
    let v = volume(
        [30, 30, 30],
        (0..27_000_u32).map(|i| (i.wrapping_mul(2_654_435_761) >> 24) as u8).collect::<Vec<_>>(),
    );
    let with = |threads| component(&v, None, &above(100.0), &Exec::default().with_threads(threads)).unwrap();
    assert_eq!(with(1), with(4));
    let tight = Exec::default().with_memory_limit(Some(10));
    assert_eq!(component(&v, None, &above(1.0), &tight).unwrap_err().error_class(), ErrorClass::Limit);
    let stopped = Exec::default();
    stopped.cancel.cancel();
    assert_eq!(component(&v, None, &above(1.0), &stopped).unwrap_err().error_class(), ErrorClass::Cancelled);
}
