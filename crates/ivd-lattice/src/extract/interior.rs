//! What hangs together inside a cell: whether two loops on its faces bound two sheets or one tube.
//!
//! Inside a cell the field is the trilinear function of the corners' levels. Its slices across one axis are bilinear, and a
//! bilinear function tells by the sign of one product difference which opposite corners it joins (Nielson and Hamann 1991), so
//! the slices where that sign or a corner's changes part the cell into a few slabs in which nothing changes. Corners that are
//! joined in a slab, or by an edge from slab to slab, belong together: a trilinear function has neither peaks nor pits inside,
//! so that all that hangs together reaches a corner of every slab it passes. Sheets of the surface that part the same two regions
//! are one.
//!
//! The idea of slicing is Chernyaev's (1995) and Custodio's (2013); that it suffices to join slabs is told here without a table of cases.

use ivd_core::sets;

/// What stands for a level of 0 beside a largest one of 1 to 2. All levels are moved by it, so that what lies on the surface goes
/// where ties go. Levels much less than it beside the largest of their cell count as 0.
const NOTHING: f64 = 1.0 / (1_u64 << 32) as f64;

/// Stands for a level of 0 on a face, beside a largest one of 1 to 2: nothing, but of one sign, and with a square that is a number.
const TINY: f64 = 1e-150;

/// Corners of a slice in turn, at the low end along z; the high ends have 4 more.
const TURN: [usize; 4] = [0, 1, 3, 2];

/// Slabs at most: six slices between them.
const SLABS: usize = 7;

/// Levels by a power of two, so that the largest is from 1 to 2, and on the sides that the signs say. `None` where one is missing.
pub(super) fn scaled<const N: usize>(levels: [f64; N], inside: [bool; N]) -> Option<[f64; N]> {
    if levels.iter().any(|level| level.is_nan()) {
        return None;
    }
    let levels = levels.map(|level| level.clamp(f64::MIN, f64::MAX));
    let most = levels.iter().fold(0.0_f64, |most, level| most.max(level.abs()));
    // The power of two whose exponent is the opposite.
    let unit = f64::from_bits((2046 - (most.to_bits() >> 52)).clamp(1, 2046) << 52);
    Some(std::array::from_fn(|i| {
        let level = levels[i] * unit;
        if inside[i] { level.max(TINY) } else { level.min(-TINY) }
    }))
}

/// A number for each corner, equal where corners of the same side hang together within the cell. `None` where all of them that
/// do also do so on its faces, or where a level is missing. `case` has a bit for each corner inside; ties are inside or outside.
pub(super) fn regions(levels: [f64; 8], case: u8, joins_ties: bool) -> Option<[u8; 8]> {
    let inside = std::array::from_fn(|corner| case >> corner & 1 == 1);
    let hair = if joins_ties { NOTHING } else { -NOTHING };
    let levels = scaled(levels, inside)?;
    let level = |corner: usize| {
        if inside[corner] {
            (levels[corner] + hair).max(NOTHING)
        } else {
            (levels[corner] + hair).min(-NOTHING)
        }
    };
    let low = TURN.map(level);
    let rise: [f64; 4] = std::array::from_fn(|i| level(TURN[i] | 4) - low[i]);
    // Positive where the first and third corner of a slice are joined across it, if either pair is.
    let joint = [
        low[0] * low[2] - low[1] * low[3],
        low[0] * rise[2] + low[2] * rise[0] - low[1] * rise[3] - low[3] * rise[1],
        rise[0] * rise[2] - rise[1] * rise[3],
    ];
    let changes = roots(joint);
    if changes.iter().all(Option::is_none) {
        return None;
    }
    let crossings = (0..4).map(|i| (low[i] > 0.0) != (low[i] + rise[i] > 0.0)).enumerate();
    let crossings = crossings.filter(|(_, crosses)| *crosses).map(|(i, _)| -low[i] / rise[i]);
    let mut cuts = [0.0; SLABS + 1];
    let mut count = 1;
    for t in crossings.chain(changes.into_iter().flatten()) {
        cuts[count] = t;
        count += 1;
    }
    cuts[count] = 1.0;
    cuts[..=count].sort_by(f64::total_cmp);
    Some(join(&cuts[..=count], low, rise, joint))
}

/// Roots between 0 and 1 of `c[0] + c[1] t + c[2] t²`, where it changes sign.
fn roots(c: [f64; 3]) -> [Option<f64>; 2] {
    let square = c[1] * c[1] - 4.0 * c[0] * c[2];
    if square.is_nan() || square <= 0.0 {
        return [None; 2];
    }
    let sum = -0.5 * (c[1] + square.sqrt().copysign(c[1]));
    [sum / c[2], c[0] / sum].map(|t| Some(t).filter(|t| 0.0 < *t && *t < 1.0))
}

/// Joins the corners of the slabs between `cuts`.
fn join(cuts: &[f64], low: [f64; 4], rise: [f64; 4], joint: [f64; 3]) -> [u8; 8] {
    let mut parts: [u32; 4 * SLABS] = std::array::from_fn(|i| i as u32);
    let mut unite = |a: usize, b: usize| sets::join(&mut parts, a as u32, b as u32);
    let slabs = cuts.len() - 1;
    let mut before = [false; 4];
    for slab in 0..slabs {
        let t = 0.5 * (cuts[slab] + cuts[slab + 1]);
        let inside: [bool; 4] = std::array::from_fn(|i| low[i] + rise[i] * t > 0.0);
        let first = 4 * slab;
        for i in 0..4 {
            if inside[i] == inside[(i + 1) % 4] {
                unite(first + i, first + (i + 1) % 4);
            }
            if slab > 0 && inside[i] == before[i] {
                unite(first + i - 4, first + i);
            }
        }
        if inside[0] == inside[2] && inside[1] == inside[3] && inside[0] != inside[1] {
            let across = usize::from(joint[0] + t * (joint[1] + t * joint[2]) <= 0.0);
            unite(first + across, first + across + 2);
        }
        before = inside;
    }
    let mut regions = [0; 8];
    for (i, corner) in TURN.into_iter().enumerate() {
        regions[corner] = sets::root(&mut parts, i as u32) as u8;
        regions[corner | 4] = sets::root(&mut parts, (4 * (slabs - 1) + i) as u32) as u8;
    }
    regions
}

#[cfg(test)]
mod tests {
    use super::*;

    /// What hangs together among `n`³ points of the cell, by filling: the plain twin.
    fn filled(levels: [f64; 8], n: usize) -> [usize; 8] {
        let at = |i: usize| [i % n, i / n % n, i / n / n];
        let value = |i: usize| -> f64 {
            let t = at(i).map(|v| v as f64 / (n - 1) as f64);
            (0..8)
                .map(|c| {
                    (0..3).map(|a| if c >> a & 1 == 1 { t[a] } else { 1.0 - t[a] }).product::<f64>()
                        * levels[c]
                })
                .sum()
        };
        let inside: Vec<bool> = (0..n * n * n).map(|i| value(i) > 0.0).collect();
        let mut part = vec![usize::MAX; inside.len()];
        for seed in 0..inside.len() {
            let mut open = if part[seed] == usize::MAX { vec![seed] } else { Vec::new() };
            while let Some(i) = open.pop() {
                if part[i] != usize::MAX || inside[i] != inside[seed] {
                    continue;
                }
                part[i] = seed;
                for (a, step) in [1, n, n * n].into_iter().enumerate() {
                    if at(i)[a] > 0 {
                        open.push(i - step);
                    }
                    if at(i)[a] + 1 < n {
                        open.push(i + step);
                    }
                }
            }
        }
        std::array::from_fn(|c| part[(0..3).map(|a| (c >> a & 1) * (n - 1) * n.pow(a as u32)).sum::<usize>()])
    }

    fn case(levels: &[f64; 8]) -> u8 {
        (0..8).fold(0, |case, c| case | u8::from(levels[c] >= 0.0) << c)
    }

    #[test]
    fn corners_hang_together_as_a_fine_grid_of_points_does() {
        let mut state = 9_u64;
        let mut random = || {
            state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            (state >> 33) as f64 / (1_u64 << 31) as f64
        };
        let mut tubes = 0;
        for round in 0..36 {
            // Opposite corners, opposite edges, and any signs.
            let signs = [0x81_u8, 0x7E, 0xC3, 0x3C, 0x69, (random() * 256.0) as u8][round % 6];
            let levels: [f64; 8] =
                std::array::from_fn(|c| (0.02 + random()) * if signs >> c & 1 == 1 { 1.0 } else { -1.0 });
            let Some(found) = regions(levels, case(&levels), true) else { continue };
            // A bridge finer than the points is missed by filling, and nothing else.
            let plain = filled(levels, 41);
            for (a, b) in (0..8).flat_map(|a| (0..a).map(move |b| (a, b))) {
                if (levels[a] > 0.0) == (levels[b] > 0.0) && plain[a] == plain[b] {
                    assert_eq!(found[a], found[b], "{levels:?}: corners {a} and {b}");
                }
            }
            let finest = filled(levels, 71);
            let same = |parts: &dyn Fn(usize) -> usize| {
                let pairs = (0..8).flat_map(|a| (0..a).map(move |b| (a, b)));
                pairs.filter(|(a, b)| parts(*a) == parts(*b)).count()
            };
            let (found, finest) = (same(&|c| usize::from(found[c])), same(&|c| finest[c]));
            assert!(found >= finest, "{levels:?}");
            tubes += usize::from(found == finest);
        }
        assert!(tubes > 12, "{tubes}");
    }

    #[test]
    fn opposite_corners_are_joined_where_they_are_strong_enough() {
        // Known by hand: along the diagonal from corner 0 to 7 the levels a, -1 (six times) and a give
        // a ((1 - t)³ + t³) - 3 t (1 - t), at the middle a / 4 - 3 / 4.
        for (a, joined) in [(2.9, false), (3.1, true)] {
            let levels = std::array::from_fn(|c| if c == 0 || c == 7 { a } else { -1.0 });
            let found = regions(levels, 0x81, true);
            assert_eq!(found.is_some_and(|r| r[0] == r[7]), joined, "{a}");
        }
        // On the isovalue itself: where ties go.
        let levels = std::array::from_fn(|c| if c == 0 || c == 7 { 3.0 } else { -1.0 });
        for joins_ties in [true, false] {
            assert_eq!(regions(levels, 0x81, joins_ties).is_some_and(|r| r[0] == r[7]), joins_ties);
        }
    }

    #[test]
    fn missing_and_huge_levels_join_nothing_that_faces_do_not() {
        let levels = |bad| [5.0, -1.0, -1.0, -1.0, bad, -1.0, -1.0, 5.0];
        assert_eq!(regions(levels(f64::NAN), 0x81, true), None);
        assert!(regions(levels(f64::NEG_INFINITY), 0x81, true).is_none_or(|r| r[0] != r[7]));
        let huge = std::array::from_fn(|c| if c == 0 || c == 7 { f64::MAX } else { -1e-300 });
        assert!(regions(huge, 0x81, true).is_some_and(|r| r[0] == r[7]));
        for size in [1e-200, 1e-300, 1e200, 1e300] {
            let levels = std::array::from_fn(|c| if c == 0 || c == 7 { 3.1 * size } else { -size });
            assert!(regions(levels, 0x81, true).is_some_and(|r| r[0] == r[7]), "{size}");
        }
    }
}
