use ivd_core::{Class, Labels, NO_BRICK, noise};

use super::*;
use crate::fixtures::sheared_grid;
use crate::warp::{DeformedLabels, labels, volume};

const DIMS: [usize; 3] = [27, 18, 19];

/// A number 0 … `n` − 1 that looks random.
fn below(n: u64, seed: u64, i: usize) -> u64 {
    noise::below(seed, i as u64, n)
}

/// What a displacement of a series is made of, by seeds: what has the same seed is the same.
#[derive(Clone, Copy)]
struct Made {
    /// Of the vectors; 0 for none.
    motion: u64,
    /// Of what is left behind.
    vacated: u64,
    /// Of the sides that deformed voxels come from.
    origins: u64,
    /// Of the sides at rest.
    rest: u64,
    /// Bricks that it all lies in: one of so many.
    part: usize,
}

fn made(grid: &Grid, of: Made) -> Displacement {
    let bricks: usize = DIMS.iter().map(|n| n.div_ceil(8)).product();
    let stored: Vec<usize> = (0..bricks).filter(|b| of.motion > 0 && b % of.part == 1).collect();
    let mut table = vec![NO_BRICK; bricks];
    stored.iter().zip(0..).for_each(|(&b, slot)| table[b] = slot);
    let vector = |i: usize| {
        let part = |k: usize| (4.0 * noise::unit(of.motion, (3 * i + k) as u64) - 2.0) as f32;
        match below(4, of.motion + 100, i) {
            0 => [0.0; 3],
            1 => [part(0).round(), part(1).round() + 1e-6, part(2).round()],
            _ => [part(0), part(1), part(2)],
        }
    };
    let vectors: Vec<[f32; 3]> = (0..512 * stored.len()).map(vector).collect();
    let inverse = FieldBricks::new(DIMS, table, vectors.into()).unwrap();
    let within = |i: usize| {
        let [x, y, z] = grid.index(i).0;
        stored.contains(&(x / 8 + 4 * (y / 8 + 3 * (z / 8))))
    };
    let flags = |seed: u64, of: &dyn Fn(usize) -> u8| -> Vec<u8> {
        (0..grid.len()).map(|i| if seed > 0 && within(i) { of(i) } else { 0 }).collect()
    };
    let displacement = Displacement::new(grid.clone(), FieldBricks::zero(DIMS), inverse).unwrap();
    let displacement = if of.vacated > 0 {
        let vacated = flags(of.vacated, &|i| u8::from(below(9, of.vacated, i) == 0));
        displacement.with_vacated(vacated.into()).unwrap()
    } else {
        displacement
    };
    if of.origins == 0 {
        return displacement;
    }
    let origins = flags(of.origins, &|i| (below(3, of.origins, i) as u8) << 2);
    let rest = (0..grid.len()).map(|i| below(3, of.rest, i) as u8);
    let sides: Vec<u8> = origins.into_iter().zip(rest).map(|(origin, rest)| origin | rest).collect();
    displacement.with_sides(sides.into()).unwrap()
}

/// Cuts that come, go elsewhere at rest alone, change sides, open and go.
const SERIES: [Made; 10] = {
    let moved = Made { motion: 1, vacated: 0, origins: 0, rest: 0, part: 5 };
    let cut = Made { origins: 11, rest: 21, ..moved };
    [
        Made { motion: 0, ..moved },
        moved,
        cut,
        Made { rest: 22, ..cut },
        Made { origins: 12, rest: 22, ..cut },
        Made { origins: 12, rest: 22, vacated: 31, ..cut },
        Made { motion: 2, origins: 12, rest: 22, vacated: 31, part: 4 },
        Made { motion: 2, part: 4, ..moved },
        Made { vacated: 32, ..cut },
        Made { motion: 0, ..moved },
    ]
};

#[test]
fn updates_by_bricks_are_the_whole_warp_where_cuts_come_and_go() {
    let grid = sheared_grid(DIMS);
    let raw: Vec<i32> = (0..grid.len()).map(|i| below(200, 7, i) as i32 - 100).collect();
    let rough: Vec<f32> = raw.iter().map(|&v| if v == 17 { f32::NAN } else { v as f32 * 0.37 }).collect();
    let types: [Voxels; 8] = [
        Voxels::from(raw.iter().map(|&v| (v + 100) as u8).collect::<Vec<_>>()),
        Voxels::from(raw.iter().map(|&v| v as i8).collect::<Vec<_>>()),
        Voxels::from(raw.iter().map(|&v| (v + 100) as u16 * 99).collect::<Vec<_>>()),
        Voxels::from(raw.iter().map(|&v| v as i16 * 99).collect::<Vec<_>>()),
        Voxels::from(raw.iter().map(|&v| (v + 100) as u32 * 1_000_003).collect::<Vec<_>>()),
        Voxels::from(raw.iter().map(|&v| v * 1_000_003).collect::<Vec<_>>()),
        Voxels::from(rough.clone()),
        Voxels::from(rough.iter().map(|&v| f64::from(v)).collect::<Vec<_>>()),
    ];
    let series = SERIES.map(|of| made(&grid, of));
    let (exec, all) = (Exec::default(), 4 * 3 * 3);
    for stored in types {
        let kind = stored.voxel_type();
        let input = Volume::with_scale(grid.clone(), stored, 2.0, -3.0).unwrap();
        for order in [Order::Nearest, Order::Linear, Order::Cubic] {
            let params = WarpParams { order, background: None };
            let mut kept = Deformed::new(&input, params.clone(), &exec).unwrap();
            for (n, pair) in series.windows(2).enumerate() {
                let bricks = pair[1].changed(&pair[0]).unwrap();
                let computed = kept.update(&input, &pair[1], &bricks, &exec).unwrap();
                let whole = volume(&input, &pair[1], &params, &exec).unwrap();
                let same = kept.output().voxels().as_bytes() == whole.output.voxels().as_bytes();
                assert!(same, "{kind:?}, {order:?}, step {n}");
                assert!(!bricks.is_empty() && bricks.len() < all, "{} bricks in step {n}", bricks.len());
                assert!(computed <= whole.voxels_resampled, "what is untouched is skipped");
            }
        }
    }
}

#[test]
fn labels_updated_by_bricks_are_the_whole_warp_with_the_sizes_of_their_classes() {
    let grid = sheared_grid(DIMS);
    let ids: Vec<u16> = (0..grid.len()).map(|i| below(4, 3, i) as u16).collect();
    let class = |id: u16| Class {
        id,
        name: None,
        mean: 10.0 - f64::from(id),
        sd: 0.0,
        voxels: ids.iter().filter(|i| **i == id).count() as u64,
        lower: None,
        upper: None,
    };
    let rest = Labels::new(grid.clone(), ids.clone().into(), vec![class(3), class(1), class(2)]).unwrap();
    let (exec, params) = (Exec::default(), WarpParams::default());
    let mut kept = DeformedLabels::new(&rest, &params, &exec).unwrap();
    assert_eq!(kept.output(), &rest);
    let series = SERIES.map(|of| made(&grid, of));
    for (n, pair) in series.windows(2).enumerate() {
        let bricks = pair[1].changed(&pair[0]).unwrap();
        kept.update(&rest, &pair[1], &bricks, &exec).unwrap();
        let whole = labels(&rest, &pair[1], &params, &exec).unwrap().output;
        assert!(kept.output() == &whole, "step {n}");
        assert!(n > 0 || whole.classes() != rest.classes(), "sizes change");
    }
    assert_eq!(kept.output(), &rest);
}
