//! Random integer fields, full of ties: topology must come out right in every one.

use ivd_lattice::extract::Iso;
use nalgebra::Vector3;

use crate::extract::levels::Levels;
use crate::extract::mesh::{assert_closed_manifold, euler, winding};
use crate::extract::{cut, hash, noise};

#[test]
fn a_thousand_fields_give_closed_manifolds_of_the_right_topology() {
    for seed in 0..1000_u64 {
        let dims: [usize; 3] = std::array::from_fn(|a| 3 + (hash(seed * 3 + a as u64) % 8) as usize);
        let voxels = noise(seed, dims.iter().product(), 4);
        let iso = [0.0, 1.0, 1.5, 2.0][(seed % 4) as usize];
        let lattice = cut(dims, voxels.clone(), Iso::Value(iso));
        let context = format!("seed {seed}, {dims:?}, iso {iso}");
        assert_closed_manifold(&lattice, &context);
        let levels = Levels::new(dims, &voxels, iso);
        assert_eq!(euler(&lattice), 2 * levels.solid_euler(), "{context}");
    }
}

#[test]
fn the_surface_winds_once_around_each_voxel_inside_and_never_outside() {
    for seed in 0..100_u64 {
        let dims = [3, 4, 3 + (seed % 2) as usize];
        let voxels = noise(seed + 5000, dims.iter().product(), 4);
        let iso = [1.0, 1.5, 2.0][(seed % 3) as usize];
        let lattice = cut(dims, voxels.clone(), Iso::Value(iso));
        let levels = Levels::new(dims, &voxels, iso);
        for z in -1..=dims[2] as i64 {
            for y in -1..=dims[1] as i64 {
                for x in -1..=dims[0] as i64 {
                    let at = Vector3::new(x as f64, y as f64, z as f64);
                    let expected = f64::from(u8::from(levels.inside([x, y, z])));
                    let found = winding(&lattice, at);
                    assert!((found - expected).abs() < 1e-6, "seed {seed}, voxel {x} {y} {z}: {found}");
                }
            }
        }
    }
}

#[test]
fn fields_with_every_face_ambiguous_stay_manifold() {
    for (inside, outside, iso) in [(1_u8, 0, 1.0), (1, 0, 0.5), (3, 0, 1.0), (3, 0, 2.0)] {
        let dims = [5, 6, 7];
        let voxels: Vec<u8> = (0..210_usize)
            .map(|i| if (i % 5 + i / 5 % 6 + i / 30) % 2 == 0 { inside } else { outside })
            .collect();
        let lattice = cut(dims, voxels.clone(), Iso::Value(iso));
        assert_closed_manifold(&lattice, &format!("checkerboard {inside} {outside} {iso}"));
        assert_eq!(euler(&lattice), 2 * Levels::new(dims, &voxels, iso).solid_euler());
    }
}
