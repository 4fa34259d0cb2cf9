//! Edits of parts against what they are by definition.
#![allow(clippy::unwrap_used)]

use ivd_boundary::{EditInputs, EditParams, Edited, Error, SetOperation};
use ivd_core::{Classified, ErrorClass, Exec, Grid, Mask, Volume, noise};

const DIMS: [usize; 3] = [17, 13, 11];
const EDGES: [f64; 3] = [1.0, 1.4, 0.8];

fn grid() -> Grid {
    Grid::with_spacing(DIMS, EDGES).unwrap()
}

fn volume() -> Volume {
    Volume::new(grid(), vec![1_u8; grid().len()].into()).unwrap()
}

fn edit(part: &Mask, other: Option<&Mask>, params: &EditParams, exec: &Exec) -> Result<Edited, Error> {
    ivd_boundary::edit(&EditInputs { volume: &volume(), part, other }, params, exec)
}

fn random(seed: u64, share: u64) -> Mask {
    let inside: Vec<u8> =
        (0..grid().len() as u64).map(|i| u8::from(noise::below(seed, i, 100) < share)).collect();
    Mask::new(grid(), inside.into()).unwrap()
}

/// Voxels round the volume in which a ball may lie.
const ROUND: i64 = 4;

/// Steps from a voxel that stay within a distance.
fn ball(radius: f64) -> Vec<[i64; 3]> {
    let side = -ROUND..=ROUND;
    let all =
        side.clone().flat_map(|x| side.clone().flat_map(move |y| (-ROUND..=ROUND).map(move |z| [x, y, z])));
    let is_near = |step: &[i64; 3]| {
        (0..3).map(|a| (step[a] as f64 * EDGES[a]).powi(2)).sum::<f64>() <= radius * radius * (1.0 + 1e-9)
    };
    all.filter(is_near).collect()
}

/// A set in space, of which the volume is a window: what `ball` about a place reaches (`any`), or where all that it reaches is in the set.
fn swept(set: &dyn Fn([i64; 3]) -> bool, ball: &[[i64; 3]], any: bool) -> impl Fn([i64; 3]) -> bool {
    let size: [i64; 3] = std::array::from_fn(|a| DIMS[a] as i64 + 4 * ROUND);
    let place = move |at: [i64; 3]| -> Option<usize> {
        let at: [i64; 3] = std::array::from_fn(|a| at[a] + 2 * ROUND);
        (0..3)
            .all(|a| (0..size[a]).contains(&at[a]))
            .then(|| (at[0] + size[0] * (at[1] + size[1] * at[2])) as usize)
    };
    let mut found = vec![false; size.iter().product::<i64>() as usize];
    for x in -2 * ROUND..DIMS[0] as i64 + 2 * ROUND {
        for y in -2 * ROUND..DIMS[1] as i64 + 2 * ROUND {
            for z in -2 * ROUND..DIMS[2] as i64 + 2 * ROUND {
                let holds = |step: &[i64; 3]| set([x + step[0], y + step[1], z + step[2]]);
                let holds = if any { ball.iter().any(holds) } else { ball.iter().all(holds) };
                found[place([x, y, z]).unwrap()] = holds;
            }
        }
    }
    move |at| place(at).is_some_and(|i| found[i])
}

/// A closing (`true`) or an opening by definition, in the window.
fn plain(mask: &Mask, radius: f64, closing: bool) -> Vec<u8> {
    let set = |at: [i64; 3]| {
        (0..3).all(|a| (0..DIMS[a] as i64).contains(&at[a]))
            && mask.inside()[grid().linear(ivd_core::VoxelIndex(at.map(|v| v as usize)))] != 0
    };
    let ball = ball(radius);
    let first = swept(&set, &ball, closing);
    let second = swept(&first, &ball, !closing);
    (0..grid().len()).map(|i| u8::from(second(grid().index(i).0.map(|v| v as i64)))).collect()
}

#[test]
fn operations_are_what_they_are_by_definition() {
    let exec = Exec::default();
    for seed in 0..4 {
        let (a, b) = (random(seed, 30), random(seed + 50, 30));
        for (operation, of) in [
            (SetOperation::Union, (|a, b| a | b) as fn(u8, u8) -> u8),
            (SetOperation::Intersection, |a, b| a & b),
            (SetOperation::Difference, |a, b| a & (1 - b)),
        ] {
            let params = EditParams { operation: Some(operation), ..EditParams::default() };
            let found = edit(&a, Some(&b), &params, &exec).unwrap();
            let wanted: Vec<u8> = a.inside().iter().zip(b.inside()).map(|(a, b)| of(*a, *b)).collect();
            assert_eq!(found.mask.inside(), &wanted[..]);
        }
    }
}

#[test]
fn closings_and_openings_are_what_they_are_by_definition() {
    let exec = Exec::default();
    // Radii that are steps along the axes are among them.
    for (case, radius) in [1.5, 1.6, 2.4, 1.4].into_iter().enumerate() {
        let seed = case as u64;
        for (own, closing) in [(random(seed, 5), true), (random(seed, 90), false)] {
            let params = |radius: f64| EditParams {
                close: if closing { radius } else { 0.0 },
                open: if closing { 0.0 } else { radius },
                ..EditParams::default()
            };
            let wanted = plain(&own, radius, closing);
            if !wanted.contains(&1) {
                assert!(edit(&own, None, &params(radius), &exec).is_err());
                continue;
            }
            let found = edit(&own, None, &params(radius), &exec).unwrap();
            assert!(found.mask.inside() == wanted, "{radius} {closing}");
            // Closing adds, opening takes; done again, neither changes anything.
            let pairs = || own.inside().iter().zip(found.mask.inside());
            assert!(pairs().all(|(a, b)| if closing { a <= b } else { a >= b }), "{radius} {closing}");
            let again = edit(&found.mask, None, &params(radius), &exec).unwrap();
            assert!(again.mask == found.mask, "{radius} {closing}");
        }
    }
    let far = EditParams { close: 1e30, ..EditParams::default() };
    assert_eq!(edit(&random(1, 30), None, &far, &exec).unwrap_err().error_class(), ErrorClass::Usage);
}

#[test]
fn closing_does_not_reach_for_the_border() {
    // A layer beside the border.
    let inside: Vec<u8> = (0..grid().len()).map(|i| u8::from(grid().index(i).0[0] == 1)).collect();
    let own = Mask::new(grid(), inside.into()).unwrap();
    let params = EditParams { close: 3.0, ..EditParams::default() };
    let closed = edit(&own, None, &params, &Exec::default()).unwrap();
    assert!(closed.mask.inside() == own.inside());
}

#[test]
fn a_slice_is_opened_in_its_plane() {
    let grid = Grid::with_spacing([20, 20, 1], [1.0, 1.0, 5.0]).unwrap();
    let block = |i: usize| [i % 20, i / 20].iter().all(|c| (5..12).contains(c)) || i / 20 == 8;
    let inside: Vec<u8> = (0..400).map(|i| u8::from(block(i))).collect();
    let part = Mask::new(grid.clone(), inside.into()).unwrap();
    let volume = Volume::new(grid, vec![1_u8; 400].into()).unwrap();
    let params = EditParams { open: 1.0, ..EditParams::default() };
    let inputs = EditInputs { volume: &volume, part: &part, other: None };
    let opened = ivd_boundary::edit(&inputs, &params, &Exec::default()).unwrap();
    // Its corners go, and the line but for the voxels beside the block.
    assert_eq!(opened.voxels, 7 * 7 - 4 + 2);
}

#[test]
fn islands_go_and_holes_are_filled() {
    let inside: Vec<u8> = (0..grid().len())
        .map(|i| {
            let [x, y, z] = grid().index(i).0;
            let shell = [x, y, z].iter().map(|&c| c.abs_diff(5)).max() == Some(3);
            u8::from(shell || [x, y, z] == [15, 1, 1])
        })
        .collect();
    let own = Mask::new(grid(), inside.into()).unwrap();
    let params = EditParams { islands: 2.0, fill_holes: true, ..EditParams::default() };
    let found = edit(&own, None, &params, &Exec::default()).unwrap();
    assert_eq!((found.voxels, found.components, found.islands, found.filled), (343, 1, 1, 125));
}

#[test]
fn an_operation_without_a_second_part_and_an_empty_result_are_refused() {
    let exec = Exec::default();
    let alone = EditParams { operation: Some(SetOperation::Union), ..EditParams::default() };
    assert_eq!(edit(&random(1, 30), None, &alone, &exec).unwrap_err().error_class(), ErrorClass::Usage);
    let gone = EditParams { open: 20.0, ..EditParams::default() };
    let error = edit(&random(1, 30), None, &gone, &exec).unwrap_err();
    assert_eq!(error.error_class(), ErrorClass::Untrusted, "{error}");
}
