//! Strokes that compete.
#![allow(clippy::unwrap_used)]

use ivd_boundary::{CompeteParams, Error, Stroke, part_of_strokes};
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

fn point(volume: &Volume, voxel: [f64; 3]) -> Stroke {
    let at = volume.grid().world(ivd_core::VoxelCoord(nalgebra::Vector3::from(voxel))).0.into();
    Stroke { at, to: None, radius: None }
}

#[test]
fn strokes_on_either_side_of_a_wall_with_a_gap_share_what_one_alone_floods() {
    let volume = rooms();
    let exec = Exec::default();
    let own = vec![Stroke { radius: Some(2.0), ..point(&volume, [10.0, 9.5, 9.5]) }];
    let room = 16 * 14 * 14;
    let against = CompeteParams {
        own: own.clone(),
        other: vec![point(&volume, [30.0, 9.5, 9.5])],
        border: true,
        ..CompeteParams::default()
    };
    let won = part_of_strokes(&volume, None, None, None, &against, &exec).unwrap();
    assert!((won.voxels as f64 / f64::from(room) - 1.0).abs() < 0.12, "{} of {room}", won.voxels);
    let alone = CompeteParams { other: Vec::new(), ..against.clone() };
    let all = part_of_strokes(&volume, None, None, None, &alone, &exec).unwrap();
    assert!(all.voxels > 2 * room as u64, "{}", all.voxels);
    // What is blocked is nobody's, and an earlier result goes on as a seed.
    let blocked: Vec<u8> = (0..volume.grid().len()).map(|i| u8::from(i % 40 < 8)).collect();
    let blocked = Mask::new(volume.grid().clone(), blocked.into()).unwrap();
    let less = part_of_strokes(&volume, None, Some(&won.mask), Some(&blocked), &against, &exec).unwrap();
    assert!((0..volume.grid().len()).all(|i| i % 40 >= 8 || less.mask.inside()[i] == 0));
    assert!(less.voxels < won.voxels && less.voxels > won.voxels / 2, "{} {}", less.voxels, won.voxels);
    let one = exec.clone().with_threads(1);
    assert_eq!(won, part_of_strokes(&volume, None, None, None, &against, &one).unwrap());
}

#[test]
fn a_part_without_rivals_or_strokes_is_refused() {
    let volume = rooms();
    let of = |params: &CompeteParams| {
        part_of_strokes(&volume, None, None, None, params, &Exec::default()).unwrap_err()
    };
    let own = vec![point(&volume, [10.0, 9.5, 9.5])];
    let no_rival = of(&CompeteParams { own: own.clone(), ..CompeteParams::default() });
    assert_eq!(no_rival.error_class(), ErrorClass::Untrusted, "{no_rival}");
    let nothing = of(&CompeteParams { other: own, ..CompeteParams::default() });
    assert!(nothing.to_string().contains("no stroke lies in the part"), "{nothing}");
    let outside = vec![Stroke { at: [1e4, 0.0, 0.0], to: None, radius: None }];
    assert!(matches!(
        of(&CompeteParams { own: outside, ..CompeteParams::default() }),
        Error::SeedOutside { .. }
    ));
}
