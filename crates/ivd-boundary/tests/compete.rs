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
    assert_eq!(no_rival.error_class(), ErrorClass::Untrusted, "{no_rival}");
    let nothing = of(vec![point(&volume, [10.0, 9.5, 9.5], 2), point(&volume, [30.0, 9.5, 9.5], 3)]);
    assert!(nothing.to_string().contains("no seed has the part's label, 1"), "{nothing}");
    let outside = vec![Seed { at: [1e4, 0.0, 0.0], to: None, radius: None, label: None }];
    assert!(matches!(of(outside), Error::SeedOutside { .. }));
    let guard = CompeteParams { open: 2.0, ..CompeteParams::default() };
    assert!(compete(&inputs(&volume, None, None), &guard, &Exec::default()).is_err());
}
