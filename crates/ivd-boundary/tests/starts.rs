//! Surfaces from any start, on many small volumes.
#![allow(clippy::unwrap_used)]

use ivd_boundary::{Error, SurfaceParams, active_surface};
use ivd_core::{Exec, Grid, Mask, Volume, noise};

/// What is in the volume.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Scan {
    Brighter,
    Darker,
    /// The part's values are spread more widely than those round it, about the same mean.
    SameMeans,
    /// Nothing but noise.
    Noise,
}

/// Where it starts.
#[derive(Debug, Clone, Copy, PartialEq)]
enum From {
    Inside,
    Across,
    Covering,
    Outside,
    Border,
    Full,
    Empty,
}

const SCANS: [Scan; 4] = [Scan::Brighter, Scan::Darker, Scan::SameMeans, Scan::Noise];
const STARTS: [From; 7] =
    [From::Inside, From::Across, From::Covering, From::Outside, From::Border, From::Full, From::Empty];

struct Case {
    scan: Scan,
    start: From,
    volume: Volume,
    truth: Vec<bool>,
    drawn: Mask,
}

/// A box in noise, some of whose voxels have no data, on a grid that may be ten times as coarse along z.
fn case(number: u64) -> Case {
    let pick = |salt: u64, of: u64| noise::below(number, salt, of) as usize;
    let dims: [usize; 3] = std::array::from_fn(|a| 10 + pick(a as u64, 4));
    let low: [usize; 3] = std::array::from_fn(|a| 2 + pick(3 + a as u64, 2));
    let high: [usize; 3] =
        std::array::from_fn(|a| low[a] + 5 + pick(6 + a as u64, dims[a] as u64 - low[a] as u64 - 6));
    let (scan, start) = (SCANS[pick(9, 4)], STARTS[pick(10, 7)]);
    let grid = Grid::with_spacing(dims, [1.0, 1.0, [1.0, 10.0][pick(11, 2)]]).unwrap();
    let has_holes = pick(12, 3) == 0;
    let within = |at: [usize; 3], by: usize| (0..3).all(|a| at[a] + by >= low[a] && at[a] < high[a] + by);
    let truth: Vec<bool> = (0..grid.len()).map(|i| within(grid.index(i).0, 0)).collect();
    let voxel = |i: usize| -> f32 {
        let noise = (noise::unit(number + 1, i as u64) - 0.5) as f32;
        if has_holes && noise::below(number + 2, i as u64, 20) == 0 {
            return [f32::NAN, f32::INFINITY, f32::NEG_INFINITY][i % 3];
        }
        match (scan, truth[i]) {
            (Scan::Brighter, true) | (Scan::Darker, false) => 1.0 + 0.3 * noise,
            (Scan::Brighter, false) | (Scan::Darker, true) => 0.3 * noise,
            (Scan::SameMeans, true) | (Scan::Noise, _) => noise,
            (Scan::SameMeans, false) => 0.3 * noise,
        }
    };
    let middle: [usize; 3] = std::array::from_fn(|a| usize::midpoint(low[a], high[a]));
    let begins = |i: usize| {
        let at = grid.index(i).0;
        match start {
            From::Inside => (0..3).all(|a| at[a].abs_diff(middle[a]) < 2),
            From::Across => truth[i] && at[0] <= middle[0] || at[0] == low[0] - 1 && truth[i + 1],
            From::Covering => within(at, 1),
            From::Outside => at.iter().all(|c| *c < 2),
            From::Border => at[2] == 0,
            From::Full => true,
            From::Empty => false,
        }
    };
    let drawn: Vec<u8> = (0..grid.len()).map(|i| u8::from(begins(i))).collect();
    let voxels: Vec<f32> = (0..grid.len()).map(voxel).collect();
    let volume = Volume::new(grid.clone(), voxels.into()).unwrap();
    Case { scan, start, volume, truth, drawn: Mask::new(grid, drawn.into()).unwrap() }
}

/// Whether there is a part, and whether that is the right one.
fn found(number: u64, exec: &Exec) -> (Case, Option<bool>) {
    let case = case(number);
    let params = SurfaceParams { fill_holes: false, ..SurfaceParams::default() };
    let found = match active_surface(&case.volume, None, Some(&case.drawn), &params, exec) {
        Ok(found) => found,
        Err(Error::NoBoundary { .. }) => return (case, None),
        Err(error) => panic!("case {number}: {error}"),
    };
    let told = format!("case {number}: {:?} from {:?}", case.scan, case.start);
    assert!(found.energies.windows(2).all(|e| e[1] < e[0]), "{told}: {:?}", found.energies);
    assert!(found.energies.iter().all(|e| e.is_finite()), "{told}: {:?}", found.energies);
    let inside = found.mask.inside();
    let has_data = |i: usize| case.volume.voxels().get(i).is_finite();
    assert!((0..inside.len()).all(|i| inside[i] == 0 || has_data(i)), "{told}: no data");
    let mut is_right = true;
    if matches!(case.scan, Scan::Brighter | Scan::Darker) {
        // Where the start covers all, or as much of both sides, it is the part; from outside, what surrounds it.
        let wanted = !matches!(case.start, From::Outside | From::Border);
        let known = || (0..inside.len()).filter(|&i| has_data(i));
        let right = known().filter(|&i| (inside[i] != 0) == (case.truth[i] == wanted)).count();
        let share = right as f64 / known().count() as f64;
        is_right = share > 0.97;
    }
    assert!(case.start != From::Empty, "{told}");
    (case, Some(is_right))
}

/// Energies fall, and parts are right or there is none, in volumes of these numbers.
fn check(numbers: std::ops::Range<u64>) {
    // By scan: how many have a part, how many a wrong one, and how many there are but for empty starts.
    let mut counts = [[0_u32; 3]; 4];
    let exec = Exec::default().with_threads(1);
    for number in numbers {
        let (case, found) = found(number, &exec);
        let own = &mut counts[SCANS.iter().position(|scan| *scan == case.scan).unwrap()];
        own[0] += u32::from(found.is_some());
        own[1] += u32::from(found == Some(false));
        own[2] += u32::from(case.start != From::Empty);
    }
    let [brighter, darker, alike, noise] = counts.map(|[found, _, all]| f64::from(found) / f64::from(all));
    assert!(brighter > 0.95 && darker > 0.95, "{counts:?}");
    assert!(alike < 0.15 && noise < 0.01, "{counts:?}");
    let wrong: u32 = counts.iter().map(|[_, wrong, _]| wrong).sum();
    assert!(wrong <= 2, "{counts:?}");
}

#[test]
fn small_volumes_are_right_from_any_start_or_have_no_boundary() {
    check(0..1500);
}

/// As above, by the ten thousand: part of `just stress`.
#[test]
#[ignore = "takes a minute; `just stress` runs it"]
fn ten_thousand_small_volumes_are_right_from_any_start_or_have_no_boundary() {
    check(0..10_000);
}
