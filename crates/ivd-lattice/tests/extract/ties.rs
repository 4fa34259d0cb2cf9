//! Fields chosen by hand for what breaks marching cubes: exact ties, the worst of its cases, parts that touch, many tunnels.

use std::collections::{BTreeMap, BTreeSet};

use ivd_core::{Grid, Lattice, Volume, Voxels};
use ivd_lattice::extract::Iso;
use ivd_lattice::figures::measure;

use crate::extract::levels::Levels;
use crate::extract::mesh::{area_and_volume, assert_closed_manifold, euler};
use crate::extract::{cut, cut_volume, hash, noise};

/// Fails unless the lattice of an integer field is closed, manifold, and of the field's own topology.
fn assert_topology<T: Copy + Into<i64>>(dims: [usize; 3], voxels: &[T], iso: f64, context: &str) -> Lattice
where
    Voxels: From<Vec<T>>,
{
    let lattice = cut(dims, voxels.to_vec(), Iso::Value(iso));
    assert_closed_manifold(&lattice, context);
    assert_eq!(euler(&lattice), 2 * Levels::new(dims, voxels, iso).solid_euler(), "{context}");
    lattice
}

/// Grid edges that the surface crosses.
fn crossed(lattice: &Lattice) -> BTreeSet<u64> {
    lattice.keys().iter().filter(|key| key.element() < 3).map(|key| key.0).collect()
}

#[test]
fn one_ulp_either_side_of_a_voxels_value_decides_for_all_that_have_it() {
    let dims = [9, 8, 7];
    let voxels = noise(11, 504, 5);
    let floats: Vec<f32> = voxels.iter().map(|&v| f32::from(v) + 0.1).collect();
    for v in 0..5 {
        let at = [f64::from(v), f64::from(f32::from(v as u8) + 0.1)];
        let between = [f64::from(v) + 0.5, f64::from(v) + 0.6];
        for (k, (iso, above)) in at.into_iter().zip(between).enumerate() {
            let cut_at = |iso: f64| {
                let value = Iso::Value(iso);
                let lattice =
                    if k == 0 { cut(dims, voxels.clone(), value) } else { cut(dims, floats.clone(), value) };
                assert_closed_manifold(&lattice, &format!("{iso:e}"));
                crossed(&lattice)
            };
            let on = cut_at(iso);
            assert_eq!(cut_at(iso.next_down()), on, "{v}: what has the value is inside");
            assert_eq!(cut_at(iso.next_up()), cut_at(above), "{v}: what has the value is outside");
            assert_ne!(cut_at(above), on);
        }
    }
}

#[test]
fn integer_ramps_have_a_voxel_of_every_row_on_the_isovalue() {
    let dims = [12, 11, 10];
    for weights in [[1, 0, 0], [1, 1, 0], [1, 1, 1], [1, 2, 3], [0, 1, -1]] {
        let voxels: Vec<i64> = (0..1320)
            .map(|i: i64| weights[0] * (i % 12) + weights[1] * (i / 12 % 11) + weights[2] * (i / 132))
            .collect();
        let voxels: Vec<i16> = voxels.into_iter().map(|v| v as i16).collect();
        for iso in [1.0, 4.0, 5.5, 9.0] {
            let lattice = assert_topology(dims, &voxels, iso, &format!("ramp {weights:?} at {iso}"));
            // A ramp is cut into one part inside and one outside.
            assert_eq!(euler(&lattice), 2, "ramp {weights:?} at {iso}");
        }
    }
}

#[test]
fn a_face_whose_products_are_equal_is_joined_the_same_way_in_both_cells() {
    // 7 · 1 = (−7)(−1): the asymptotes cross on the isovalue, and every voxel of the plane beyond is tried.
    let turns =
        [[7, -7, -1, 1], [7, -1, -7, 1], [1, -7, -1, 7], [-7, 7, 1, -1], [-1, 1, 7, -7], [-7, 1, 7, -1]];
    for axis in 0..3 {
        let mut dims = [2; 3];
        dims[axis] = 3;
        for face in turns {
            for others in 0..256_u32 {
                let mut voxels = vec![0_i16; 12];
                for i in 0..12 {
                    let at = [i % dims[0], i / dims[0] % dims[1], i / dims[0] / dims[1]];
                    let across: Vec<usize> = (0..3).filter(|&a| a != axis).map(|a| at[a]).collect();
                    let corner = across[0] + 2 * across[1];
                    let side = |bit: usize| if others >> bit & 1 == 1 { 5 } else { -3 };
                    voxels[i] = [side(corner), face[corner], side(4 + corner)][at[axis]];
                }
                assert_topology(dims, &voxels, 0.0, &format!("axis {axis}, {face:?}, {others:08b}"));
            }
        }
    }
}

#[test]
fn every_face_of_case_13_either_way_and_its_tunnels() {
    let corners = |seed: u64| -> Vec<i16> {
        let level = |i: u64| 1 + (hash(seed * 8 + i) % 30) as i16;
        (0..8).map(|i: u64| if i.count_ones().is_multiple_of(2) { level(i) } else { -level(i) }).collect()
    };
    // Which of the six faces join their corners inside, and the topologies met with them.
    let mut met: BTreeMap<u32, BTreeSet<i64>> = BTreeMap::new();
    let mut tunnels = 0;
    for seed in 0..20_000 {
        let voxels = corners(seed);
        let lattice = assert_topology([2; 3], &voxels, 0.0, &format!("seed {seed}: {voxels:?}"));
        let at = |i: usize| i64::from(voxels[i]);
        let mut faces = 0;
        let mut tied = false;
        for (face, (fixed, [u, v])) in [(1, [2, 4]), (2, [1, 4]), (4, [1, 2])].into_iter().enumerate() {
            for far in 0..2 {
                let base = if far == 1 { fixed } else { 0 };
                let across = at(base) * at(base | u | v) - at(base | u) * at(base | v);
                // Products of those inside have the sign that the first corner's place gives them.
                let joined = if at(base) > 0 { across > 0 } else { across < 0 };
                tied |= across == 0;
                faces |= u32::from(joined) << (2 * face + far);
            }
        }
        if !tied {
            met.entry(faces).or_default().insert(euler(&lattice));
            tunnels += u32::from(lattice.keys().iter().any(|key| key.element() == 6));
        }
    }
    let undecided: Vec<u32> =
        met.iter().filter(|(_, found)| found.len() == 2).map(|(faces, _)| faces.count_ones()).collect();
    println!(
        "{} ways of the faces, {undecided:?} joined where the inside decides; {tunnels} tunnels",
        met.len()
    );
    assert!(met.len() >= 40, "{} ways of the faces", met.len());
    assert!(undecided.contains(&3), "13.5 was met with one topology alone: {met:?}");
    assert!(met.values().all(|found| found.len() <= 2));
}

#[test]
fn voxels_that_share_an_edge_or_a_corner_alone_touch_or_do_not_and_never_pinch() {
    let parts = |other: [usize; 3], iso: f64| {
        let mut voxels = vec![0_u8; 64];
        for [x, y, z] in [[1, 1, 1], other] {
            voxels[x + 4 * (y + 4 * z)] = 2;
        }
        let lattice = assert_topology([4; 3], &voxels, iso, &format!("{other:?} at {iso}"));
        measure(&lattice).components
    };
    // Beside each other; across an edge: ¼ · ¼ each way at 1, where a tie joins; across a corner.
    for (other, iso, components) in [
        ([2, 1, 1], 2.0, 1),
        ([2, 2, 1], 0.5, 1),
        ([2, 2, 1], 1.0, 1),
        ([2, 2, 1], 1.5, 2),
        ([2, 2, 1], 2.0, 2),
        ([1, 2, 2], 1.5, 2),
        ([2, 2, 2], 1.0, 2),
        ([2, 2, 2], 0.25, 1),
    ] {
        assert_eq!(parts(other, iso), components, "{other:?} at {iso}");
    }
}

#[test]
fn a_sponge_has_every_one_of_its_tunnels() {
    for k in [1, 3, 5] {
        let n = 5 * k + 5;
        let voxels: Vec<u8> = (0..n * n * n)
            .map(|i| {
                let at = [i % n, i / n % n, i / n / n];
                let inside = at.iter().all(|&c| c >= 1 && c < n - 1);
                u8::from(inside && at.iter().filter(|&&c| c % 5 >= 3 && c < n - 2).count() < 2)
            })
            .collect();
        let lattice = cut([n; 3], voxels, Iso::Value(0.5));
        assert_closed_manifold(&lattice, "sponge");
        let figures = measure(&lattice);
        // k³ halls with k² · (k + 1) ways along each axis between them and to the outside.
        let genus = 3 * k * k * (k + 1) - k * k * k;
        assert_eq!((figures.components, euler(&lattice)), (1, 2 - 2 * genus as i64), "{k}");
        assert_eq!(figures.genus, Some(genus as u64));
    }
}

#[test]
fn thin_shells_keep_both_their_sides() {
    let n = 40;
    let middle = 19.37;
    let voxels: Vec<f32> = (0..n * n * n)
        .map(|i| {
            let r = [i % n, i / n % n, i / n / n].map(|c| c as f32 - middle);
            0.9 - (r[0].hypot(r[1]).hypot(r[2]) - 14.0).abs()
        })
        .collect();
    let lattice = cut([n; 3], voxels, Iso::Value(0.0));
    assert_closed_manifold(&lattice, "shell");
    let (_, volume) = area_and_volume(&lattice);
    let (outer, inner) = (14.9_f64, 13.1_f64);
    let expected = 4.0 / 3.0 * std::f64::consts::PI * (outer.powi(3) - inner.powi(3));
    assert_eq!((measure(&lattice).components, euler(&lattice)), (2, 4));
    assert!((volume / expected - 1.0).abs() < 0.02, "{volume} of {expected} mm³");
}

#[test]
fn a_field_far_from_zero_is_cut_as_one_near_it() {
    let dims = [9, 7, 8];
    let voxels = noise(21, 504, 7);
    for offset in [1e7_f32, -1e7, 16_777_209.0] {
        let floats: Vec<f32> = voxels.iter().map(|&v| f32::from(v) + offset).collect();
        for iso in [1.0, 2.5, 6.0] {
            let near = cut(dims, voxels.clone(), Iso::Value(iso));
            let far = cut(dims, floats.clone(), Iso::Value(iso + f64::from(offset)));
            assert_eq!((near.keys(), near.triangles()), (far.keys(), far.triangles()), "{offset} + {iso}");
            assert!(near.places().iter().flatten().zip(far.places().iter().flatten()).all(|(a, b)| a == b));
        }
    }
}

#[test]
fn padding_far_below_and_single_values_above_all_others_change_nothing_else() {
    let dims = [10, 9, 8];
    let inside: Vec<i16> = noise(31, 720, 9).iter().map(|&v| i16::from(v) * 100).collect();
    let air = |i: usize| (i % 10) < 2 || i / 90 == 7;
    let padded = |pad: i16| -> Vec<i16> {
        inside.iter().enumerate().map(|(i, &v)| if air(i) { pad } else { v }).collect()
    };
    let [plain, far] = [0, -2000].map(|pad| cut(dims, padded(pad), Iso::Value(350.0)));
    assert_closed_manifold(&far, "padding");
    // Which edges are crossed doesn't depend on how far below the padding lies.
    assert_eq!(crossed(&plain), crossed(&far));
    let spiked: Vec<u16> = inside.iter().map(|&v| if v == 800 { 65535 } else { v as u16 }).collect();
    let plain: Vec<u16> = inside.iter().map(|&v| v as u16).collect();
    let [plain, spiked] = [plain, spiked].map(|voxels| cut(dims, voxels, Iso::Value(350.0)));
    assert_closed_manifold(&spiked, "spikes");
    assert_eq!(crossed(&plain), crossed(&spiked));
}

#[test]
fn a_mirrored_field_without_ties_gives_the_mirrored_lattice() {
    let dims = [7, 6, 8];
    // Odd levels of a prime stride: no two are equal, and no product ties.
    let voxels: Vec<f32> = (0..336).map(|i: u64| (hash(i + 77) % 100_003) as f32 - 50_001.5).collect();
    let plain = cut(dims, voxels.clone(), Iso::Value(0.0));
    let figures = measure(&plain);
    for axis in 0..3 {
        let mirrored: Vec<f32> = (0..336)
            .map(|i| {
                let mut at = [i % 7, i / 7 % 6, i / 42];
                at[axis] = dims[axis] - 1 - at[axis];
                voxels[at[0] + 7 * (at[1] + 6 * at[2])]
            })
            .collect();
        let lattice = cut(dims, mirrored, Iso::Value(0.0));
        assert_closed_manifold(&lattice, "mirrored");
        let other = measure(&lattice);
        assert_eq!((other.euler, other.components), (figures.euler, figures.components));
        let places = |lattice: &Lattice, turned: bool| {
            let mut places: Vec<[i64; 3]> = (0..lattice.keys().len())
                .filter(|&i| lattice.keys()[i].element() < 3)
                .map(|i| {
                    let mut p = <[f64; 3]>::from(lattice.voxel(i).0);
                    if turned {
                        p[axis] = (dims[axis] - 1) as f64 - p[axis];
                    }
                    // To 10⁻⁶ of a voxel: 1 − t is rounded.
                    p.map(|c| (c * 1e6).round() as i64)
                })
                .collect();
            places.sort_unstable();
            places
        };
        let (a, b) = (places(&plain, false), places(&lattice, true));
        assert_eq!(a.len(), b.len());
        for (a, b) in a.iter().zip(&b) {
            assert!((0..3).all(|k| (a[k] - b[k]).abs() <= 1), "axis {axis}: {a:?} and {b:?}");
        }
    }
}

#[test]
fn voxels_of_any_size_give_the_same_places() {
    let dims = [8, 7, 6];
    let voxels = noise(41, 336, 250);
    let at = |scale: f64| {
        let grid = Grid::with_spacing(dims, [scale, 0.5 * scale, 50.0 * scale]).unwrap();
        cut_volume(&Volume::new(grid, Voxels::from(voxels.clone())).unwrap(), None, Iso::Value(99.5))
    };
    let one = at(1.0);
    assert_closed_manifold(&one, "1");
    for scale in [1e-3, 1e3] {
        let other = at(scale);
        assert_eq!(
            (one.keys(), one.places(), one.triangles()),
            (other.keys(), other.places(), other.triangles())
        );
        let ([area, volume], [a, v]) = (area_and_volume(&one).into(), area_and_volume(&other).into());
        assert!((a / (area * scale * scale) - 1.0_f64).abs() < 1e-12);
        assert!((v / (volume * scale * scale * scale) - 1.0_f64).abs() < 1e-12);
    }
}
