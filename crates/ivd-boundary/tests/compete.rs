//! Seeds that compete.
#![allow(clippy::unwrap_used)]

use ivd_boundary::{CompeteParams, Error, Seed, SeedInputs, compete, part_of_seeds};
use ivd_core::{Classified, ErrorClass, Exec, Grid, Mask, Volume, noise};

/// Two blocks of nearly one value, a thin darker wall between them with a gap, in darkness.
fn rooms() -> Volume {
    let grid = Grid::with_spacing([40, 20, 20], [1.0; 3]).unwrap();
    let voxels: Vec<f32> = (0..grid.len())
        .map(|i| {
            let [x, y, z] = grid.index(i).0;
            let within = (3..37).contains(&x) && (3..17).contains(&y) && (3..17).contains(&z);
            let wall = (19..21).contains(&x) && !((9..11).contains(&y) && (9..11).contains(&z));
            let value = if !within {
                0.0
            } else if wall {
                60.0
            } else {
                100.0
            };
            value + 4.0 * noise::unit(3, i as u64) as f32
        })
        .collect();
    Volume::new(grid, voxels.into()).unwrap()
}

fn inputs<'a>(volume: &'a Volume, start: Option<&'a Mask>, blocked: Option<&'a Mask>) -> SeedInputs<'a> {
    SeedInputs { volume, seeds: None, start, blocked }
}

fn point(volume: &Volume, voxel: [f64; 3], label: u16) -> Seed {
    let at = volume.grid().world(ivd_core::VoxelCoord(nalgebra::Vector3::from(voxel))).0.into();
    Seed { at, to: None, radius: None, label: Some(label) }
}

#[test]
fn seeds_on_either_side_of_a_wall_with_a_gap_share_what_one_alone_floods() {
    let volume = rooms();
    let exec = Exec::default();
    let own = Seed { radius: Some(2.0), ..point(&volume, [10.0, 9.5, 9.5], 1) };
    let room = 16 * 14 * 14;
    let against = CompeteParams {
        seeds: vec![own.clone(), point(&volume, [30.0, 9.5, 9.5], 2)],
        label: Some(1),
        border: true,
        ..CompeteParams::default()
    };
    let won = part_of_seeds(&inputs(&volume, None, None), &against, &exec).unwrap();
    assert!((won.voxels as f64 / f64::from(room) - 1.0).abs() < 0.12, "{} of {room}", won.voxels);
    let alone = CompeteParams { seeds: vec![own], ..against.clone() };
    let all = part_of_seeds(&inputs(&volume, None, None), &alone, &exec).unwrap();
    assert!(all.voxels > 2 * room as u64, "{}", all.voxels);
    // What is blocked is nobody's, and an earlier result goes on as a seed.
    let blocked: Vec<u8> = (0..volume.grid().len()).map(|i| u8::from(i % 40 < 8)).collect();
    let blocked = Mask::new(volume.grid().clone(), blocked.into()).unwrap();
    let less = part_of_seeds(&inputs(&volume, Some(&won.mask), Some(&blocked)), &against, &exec).unwrap();
    assert!((0..volume.grid().len()).all(|i| i % 40 >= 8 || less.mask.inside()[i] == 0));
    assert!(less.voxels < won.voxels && less.voxels > won.voxels / 2, "{} {}", less.voxels, won.voxels);
    let one = exec.clone().with_threads(1);
    assert_eq!(won, part_of_seeds(&inputs(&volume, None, None), &against, &one).unwrap());
}

#[test]
fn all_labels_are_shared_out_at_once_with_what_their_voxels_are_like() {
    let volume = rooms();
    let seeds = vec![point(&volume, [10.0, 9.5, 9.5], 5), point(&volume, [30.0, 9.5, 9.5], 3)];
    let all = CompeteParams { seeds: seeds.clone(), border: true, ..CompeteParams::default() };
    let labels = compete(&inputs(&volume, None, None), &all, &Exec::default()).unwrap();
    assert!(labels.ids().iter().all(|id| [3, 5, 6].contains(id)));
    let ids: Vec<u16> = labels.classes().iter().map(|class| class.id).collect();
    assert_eq!(ids[0], 6, "the border's is the darkest");
    assert_eq!(labels.classes().iter().map(|class| class.voxels).sum::<u64>(), volume.grid().len() as u64);
    let room = labels.class(5).unwrap();
    assert!((room.mean - 102.0).abs() < 8.0, "{room:?}");
    let part = CompeteParams { label: Some(5), fill_holes: false, ..all };
    let part = part_of_seeds(&inputs(&volume, None, None), &part, &Exec::default()).unwrap();
    assert!(labels.ids().iter().zip(part.mask.inside()).all(|(id, inside)| *inside == 0 || *id == 5));
    assert_eq!((part.voxels, part.components), (room.voxels, 1));
}

#[test]
fn a_part_without_rivals_or_seeds_is_refused() {
    let volume = rooms();
    let of = |seeds: Vec<Seed>| {
        let params = CompeteParams { seeds, label: Some(1), ..CompeteParams::default() };
        part_of_seeds(&inputs(&volume, None, None), &params, &Exec::default()).unwrap_err()
    };
    let no_rival = of(vec![point(&volume, [10.0, 9.5, 9.5], 1)]);
    assert_eq!(no_rival.error_class(), ErrorClass::Usage, "{no_rival}");
    let nothing = of(vec![point(&volume, [10.0, 9.5, 9.5], 2), point(&volume, [30.0, 9.5, 9.5], 3)]);
    assert!(nothing.to_string().contains("no seed has the part's label, 1"), "{nothing}");
    assert_eq!(nothing.error_class(), ErrorClass::Usage);
    let none = compete(&inputs(&volume, None, None), &CompeteParams::default(), &Exec::default());
    assert_eq!(none.unwrap_err().error_class(), ErrorClass::Usage);
    let two = vec![point(&volume, [10.0, 9.5, 9.5], 1), point(&volume, [30.0, 9.5, 9.5], 2)];
    let blocked: Vec<u8> = (0..volume.grid().len()).map(|i| u8::from(i % 40 > 20)).collect();
    let blocked = Mask::new(volume.grid().clone(), blocked.into()).unwrap();
    let params = CompeteParams { seeds: two, ..CompeteParams::default() };
    let shut = compete(&inputs(&volume, None, Some(&blocked)), &params, &Exec::default()).unwrap_err();
    assert_eq!(shut.error_class(), ErrorClass::Usage);
    assert!(shut.to_string().contains("label 2 are blocked"), "{shut}");
    let outside = vec![Seed { at: [1e4, 0.0, 0.0], to: None, radius: None, label: None }];
    assert!(matches!(of(outside), Error::SeedOutside { .. }));
    let guard = CompeteParams { open: 2.0, ..CompeteParams::default() };
    assert!(compete(&inputs(&volume, None, None), &guard, &Exec::default()).is_err());
}

/// A volume of one value but where `of` tells another.
fn cube(n: usize, of: impl Fn([usize; 3]) -> f32) -> Volume {
    let grid = Grid::with_spacing([n; 3], [1.0; 3]).unwrap();
    let voxels: Vec<f32> = (0..grid.len()).map(|i| of(grid.index(i).0)).collect();
    Volume::new(grid, voxels.into()).unwrap()
}

#[test]
fn holes_are_not_filled_with_what_is_blocked_or_another_labels() {
    let n = 20;
    let within = |at: [usize; 3], low: usize, high: usize| at.iter().all(|c| (low..high).contains(c));
    // An organ in another, and what is blocked beside it.
    let volume = cube(n, |at| if within(at, 6, 10) { 50.0 } else { 100.0 });
    let blocked: Vec<u8> =
        (0..volume.grid().len()).map(|i| u8::from(within(volume.grid().index(i).0, 12, 16))).collect();
    let blocked = Mask::new(volume.grid().clone(), blocked.into()).unwrap();
    let seeds = vec![point(&volume, [2.0, 2.0, 2.0], 1), point(&volume, [8.0, 8.0, 8.0], 2)];
    let params = CompeteParams { seeds, label: Some(1), ..CompeteParams::default() };
    let won = part_of_seeds(&inputs(&volume, None, Some(&blocked)), &params, &Exec::default()).unwrap();
    let all = CompeteParams { label: None, ..params };
    let labels = compete(&inputs(&volume, None, Some(&blocked)), &all, &Exec::default()).unwrap();
    assert!(labels.class(2).unwrap().voxels >= 8);
    let own = |i: usize| labels.ids()[i] == 1;
    assert!((0..volume.grid().len()).all(|i| (won.mask.inside()[i] != 0) == own(i)));
    assert!((0..volume.grid().len()).all(|i| blocked.inside()[i] == 0 || won.mask.inside()[i] == 0));
}

#[test]
fn a_small_part_in_a_flat_volume_has_an_edge() {
    // Fewer than one voxel in 500 isn't flat: a box of 5, whose wall is a slope of two voxels in one place.
    let volume = cube(60, |[x, y, z]| {
        let within = [x, y, z].iter().all(|c| (30..35).contains(c));
        if within { if x == 30 { 40.0 } else { 100.0 } } else { 0.0 }
    });
    let seeds = vec![point(&volume, [33.0, 32.0, 32.0], 1), point(&volume, [20.0, 32.0, 32.0], 2)];
    let params = CompeteParams { seeds, label: Some(1), ..CompeteParams::default() };
    let won = part_of_seeds(&inputs(&volume, None, None), &params, &Exec::default()).unwrap();
    assert!((27..=343).contains(&won.voxels), "{}", won.voxels);
}

#[test]
fn the_border_has_a_label_of_its_own_beside_the_greatest() {
    let volume = rooms();
    let seeds = vec![point(&volume, [10.0, 9.5, 9.5], u16::MAX)];
    let params = CompeteParams { seeds, border: true, ..CompeteParams::default() };
    let labels = compete(&inputs(&volume, None, None), &params, &Exec::default()).unwrap();
    let ids: Vec<u16> = labels.classes().iter().map(|class| class.id).collect();
    assert_eq!((ids.len(), ids[0]), (2, 1), "the border's is the darkest: {ids:?}");
}

#[test]
fn voxels_without_data_are_nobodys() {
    let holed = cube(12, |[x, y, z]| if [x, y, z] == [5, 5, 5] { f32::NAN } else { x as f32 });
    let seeds = vec![point(&holed, [1.0, 5.0, 5.0], 1), point(&holed, [10.0, 5.0, 5.0], 2)];
    let params = CompeteParams { seeds, ..CompeteParams::default() };
    let labels = compete(&inputs(&holed, None, None), &params, &Exec::default()).unwrap();
    let nobodys: Vec<usize> = (0..labels.ids().len()).filter(|&i| labels.ids()[i] == 0).collect();
    assert_eq!(nobodys, [5 + 12 * (5 + 12 * 5)]);
}
