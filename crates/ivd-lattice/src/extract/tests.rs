//! The sweep against the plain version, bit for bit.

use ivd_core::{Exec, Grid, Volume, Voxels};

use super::bounds::{Bounds, Ordered};
use super::samples::{Field, Masked, Samples, halfway, levelled};
use super::signs::{BrickState, Signs, brick_states};
use super::surface::Surface;
use super::{Iso, plain, sweep};

/// Integers that look random.
fn noise(seed: u64, len: usize, values: u64) -> Vec<u8> {
    let mix = |x: u64| (x ^ (x >> 31)).wrapping_mul(0xD6E8_FEB8_6659_FD93);
    (0..len as u64).map(|i| ((mix(mix(mix(seed + 1) ^ i)) >> 32) % values) as u8).collect()
}

fn swept(samples: &impl Samples, dims: [usize; 3], flip: bool, bricks: Option<&[BrickState]>) -> Surface {
    // Slabs of many layers, and of one.
    let [one, many] = [1, 8].map(|threads| {
        let exec = Exec::default().with_threads(threads);
        exec.run(|| {
            let signs = Signs::default().read(samples, dims, bricks, &exec).unwrap();
            sweep::extract(samples, &signs, dims, flip, &mut sweep::Spare::default(), &exec).unwrap()
        })
    });
    assert!(one == many, "{dims:?}: another surface with eight threads");
    one
}

fn assert_twins<T: Ordered>(dims: [usize; 3], voxels: &[T], iso: Iso, context: &str)
where
    Voxels: From<Vec<T>>,
{
    let grid = Grid::with_spacing(dims, [1.0; 3]).unwrap();
    let volume = Volume::new(grid, Voxels::from(voxels.to_vec())).unwrap();
    let field = Field { voxels, bounds: Bounds::new(&volume, &iso) };
    let bricks = brick_states(volume.bricks(), &field.bounds);
    for flip in [false, true] {
        let expected = plain::extract(&field, dims, flip);
        assert!(swept(&field, dims, flip, None) == expected, "{context}, every voxel read");
        assert!(swept(&field, dims, flip, Some(&bricks)) == expected, "{context}, bricks skipped");
    }
}

const DIMS: [[usize; 3]; 9] = [
    [1, 1, 1],
    [3, 4, 5],
    [7, 8, 9],
    [17, 3, 2],
    [30, 4, 3],
    [31, 5, 4],
    [62, 3, 17],
    [64, 2, 3],
    [65, 9, 2],
];

#[test]
fn the_sweep_equals_the_plain_version_on_noise() {
    for (seed, dims) in DIMS.into_iter().enumerate() {
        let voxels = noise(seed as u64, dims.iter().product(), 4);
        for iso in [Iso::Value(1.0), Iso::Value(1.5), Iso::Interval { lower: Some(1.0), upper: Some(3.0) }] {
            assert_twins(dims, &voxels, iso, &format!("{dims:?} {iso:?}"));
            let gaps: Vec<f32> = voxels
                .iter()
                .enumerate()
                .map(|(i, &v)| if i % 7 == 3 { f32::NAN } else { f32::from(v) })
                .collect();
            assert_twins(dims, &gaps, iso, &format!("{dims:?} {iso:?} with gaps"));
        }
    }
}

#[test]
fn the_sweep_equals_the_plain_version_where_most_bricks_are_of_one_sign() {
    let dims = [40, 33, 27];
    let distance = |i: usize| {
        let v = [i % 40, i / 40 % 33, i / 1320].map(|v| v as f32);
        (v[0] - 15.2).hypot(v[1] - 17.1).hypot(v[2] - 12.9)
    };
    let smooth: Vec<f32> = (0..40 * 33 * 27).map(|i| 11.0 - distance(i)).collect();
    for iso in [-40.0, -20.0, 0.0, 10.0, 20.0] {
        assert_twins(dims, &smooth, Iso::Value(iso), &format!("ball {iso}"));
    }
    let stored: Vec<i16> = smooth.iter().map(|v| (v * 100.0) as i16).collect();
    assert_twins(dims, &stored, Iso::Value(-250.0), "i16");
}

#[test]
fn the_sweep_equals_the_plain_version_where_rows_are_empty_but_for_a_voxel_at_a_words_end() {
    let dims = [130, 3, 3];
    let places = [30, 31, 32, 62, 63, 64, 95, 96, 127];
    for (i, a) in places.into_iter().enumerate() {
        for b in &places[i..] {
            // Padded, a voxel's bit is one place up.
            for at in [[a, *b], [a - 1, *b - 1]] {
                let mut voxels = vec![0_u8; dims.iter().product()];
                voxels[at[0] + dims[0] * (1 + dims[1])] = 9;
                voxels[at[1] + dims[0] * (2 + dims[1])] = 5;
                assert_twins(dims, &voxels, Iso::Value(4.0), &format!("{at:?}"));
                let inside: Vec<u8> = voxels.iter().map(|v| u8::from(*v > 0)).collect();
                let expected = plain::extract(&halfway(&inside), dims, false);
                assert!(swept(&halfway(&inside), dims, false, None) == expected, "{at:?}, a mask");
            }
        }
    }
}

#[test]
fn the_sweep_equals_the_plain_version_on_masks() {
    for (seed, dims) in DIMS.into_iter().enumerate() {
        let len = dims.iter().product();
        let mask = noise(seed as u64 + 50, len, 2);
        let values: Vec<f32> = noise(seed as u64, len, 9)
            .iter()
            .map(|&v| if v == 8 { f32::NAN } else { f32::from(v) - 4.0 })
            .collect();
        let bounds = Bounds { first: 0.0, last: f32::MAX, low: 0.0, high: f64::INFINITY, joins_ties: true };
        let part = Masked { mask: &mask, field: Field { voxels: &values, bounds }, contradicts: 0.0 };
        assert!(swept(&part, dims, false, None) == plain::extract(&part, dims, false), "part {dims:?}");
        let level = levelled(&mask, &values);
        assert!(swept(&level, dims, false, None) == plain::extract(&level, dims, false), "level {dims:?}");
        let border = halfway(&mask);
        assert!(swept(&border, dims, false, None) == plain::extract(&border, dims, false), "border {dims:?}");
    }
}

#[test]
fn mixed_bricks_are_counted_alike_from_ranges_and_from_signs() {
    for dims in [[8, 8, 8], [9, 17, 25], [40, 33, 9], [1, 1, 70]] {
        let voxels: Vec<u8> =
            noise(2, dims.iter().product(), 200).iter().map(|&v| u8::from(v == 0)).collect();
        let volume =
            Volume::new(Grid::with_spacing(dims, [1.0; 3]).unwrap(), Voxels::from(voxels.clone())).unwrap();
        let field = Field { voxels: &voxels, bounds: Bounds::new(&volume, &Iso::Value(0.5)) };
        let bricks = brick_states(volume.bricks(), &field.bounds);
        let signs = Signs::default().read(&field, dims, None, &Exec::default()).unwrap();
        let mixed = bricks.iter().filter(|b| **b == BrickState::Mixed).count() as u64;
        assert_eq!(signs.mixed_bricks(), mixed, "{dims:?}");
    }
}
