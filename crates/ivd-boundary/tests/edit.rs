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

/// Whether a voxel within a distance of one `holds`.
fn near(i: usize, radius: f64, holds: &dyn Fn(usize) -> bool) -> bool {
    let at = grid().index(i).0;
    (0..grid().len()).any(|j| {
        let other = grid().index(j).0;
        let away: f64 = (0..3).map(|a| ((at[a] as f64 - other[a] as f64) * EDGES[a]).powi(2)).sum();
        away <= radius * radius && holds(j)
    })
}

#[test]
fn operations_closings_and_openings_are_what_they_are_by_definition() {
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
        let own = random(seed, 12);
        let radius = 1.5;
        let closed = edit(&own, None, &EditParams { close: radius, ..EditParams::default() }, &exec).unwrap();
        let wide: Vec<bool> = (0..grid().len()).map(|i| near(i, radius, &|j| own.inside()[j] != 0)).collect();
        let wanted: Vec<u8> = (0..grid().len()).map(|i| u8::from(!near(i, radius, &|j| !wide[j]))).collect();
        assert_eq!(closed.mask.inside(), &wanted[..]);
        // Closing adds, opening takes; done again, neither changes anything.
        assert!(own.inside().iter().zip(closed.mask.inside()).all(|(a, b)| a <= b));
        let open = EditParams { open: 1.2, ..EditParams::default() };
        let opened = edit(&random(seed, 93), None, &open, &exec).unwrap();
        assert!(random(seed, 93).inside().iter().zip(opened.mask.inside()).all(|(a, b)| a >= b));
        assert_eq!(edit(&opened.mask, None, &open, &exec).unwrap().mask, opened.mask);
    }
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
    let params = EditParams { islands: 2.0, fill: true, ..EditParams::default() };
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
