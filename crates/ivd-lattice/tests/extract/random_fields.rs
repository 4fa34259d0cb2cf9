//! Random integer fields, full of ties: topology must come out right in every one.

use ivd_lattice::extract::Iso;
use nalgebra::Vector3;

use crate::mesh::{assert_closed_manifold, euler, winding};
use crate::{cut, hash, noise};

/// A small field with its levels doubled, so that half isovalues stay integers; everything around it is outside.
struct Levels {
    dims: [i64; 3],
    doubled: Vec<i64>,
}

impl Levels {
    fn new(dims: [usize; 3], voxels: &[u8], iso: f64) -> Self {
        let doubled = voxels.iter().map(|&v| 2 * i64::from(v) - (2.0 * iso) as i64).collect();
        Self { dims: dims.map(|d| d as i64), doubled }
    }

    fn at(&self, v: [i64; 3]) -> Option<i64> {
        let inside = (0..3).all(|a| (0..self.dims[a]).contains(&v[a]));
        inside.then(|| self.doubled[(v[0] + self.dims[0] * (v[1] + self.dims[1] * v[2])) as usize])
    }

    fn inside(&self, v: [i64; 3]) -> bool {
        self.at(v).is_some_and(|level| level >= 0)
    }

    /// Whether the diagonal `a`, `c` of a face is connected across it, `b` and `d` outside.
    fn joined(&self, [a, b, c, d]: [[i64; 3]; 4]) -> bool {
        let Some((a, b, c, d)) = (|| Some((self.at(a)?, self.at(b)?, self.at(c)?, self.at(d)?)))() else {
            return false;
        };
        a * c > b * d
    }

    /// Components of the inside on an axis-aligned box of 1, 2 or more voxels a side of at most 2.
    fn components(&self, first: [i64; 3], extent: [i64; 3]) -> i64 {
        let corners: Vec<[i64; 3]> = (0..8_i64)
            .map(|i| [i & 1, i >> 1 & 1, i >> 2 & 1])
            .filter(|o| (0..3).all(|a| o[a] <= extent[a]))
            .map(|o| std::array::from_fn(|a| first[a] + o[a]))
            .collect();
        let mut group: Vec<usize> = (0..corners.len()).collect();
        for i in 0..corners.len() {
            for j in 0..i {
                let apart: Vec<usize> = (0..3).filter(|&a| corners[i][a] != corners[j][a]).collect();
                let linked = self.inside(corners[i])
                    && self.inside(corners[j])
                    && match apart.as_slice() {
                        [_] => true,
                        &[u, _] => {
                            let (mut b, mut d) = (corners[i], corners[j]);
                            b[u] = corners[j][u];
                            d[u] = corners[i][u];
                            !self.inside(b) && !self.inside(d) && self.joined([corners[i], b, corners[j], d])
                        }
                        _ => false,
                    };
                if linked {
                    let (from, to) = (group[i], group[j]);
                    group.iter_mut().filter(|g| **g == from).for_each(|g| *g = to);
                }
            }
        }
        let mut groups: Vec<usize> =
            (0..corners.len()).filter(|&i| self.inside(corners[i])).map(|i| group[i]).collect();
        groups.sort_unstable();
        groups.dedup();
        groups.len() as i64
    }

    /// Euler characteristic of the solid: by inclusion and exclusion over cells, faces, edges and voxels, each of
    /// which the solid meets in contractible pieces.
    fn solid_euler(&self) -> i64 {
        let mut sum = 0;
        for z in -1..=self.dims[2] {
            for y in -1..=self.dims[1] {
                for x in -1..=self.dims[0] {
                    for (extent, sign) in [
                        ([1, 1, 1], 1),
                        ([1, 1, 0], -1),
                        ([1, 0, 1], -1),
                        ([0, 1, 1], -1),
                        ([1, 0, 0], 1),
                        ([0, 1, 0], 1),
                        ([0, 0, 1], 1),
                        ([0, 0, 0], -1),
                    ] {
                        let pieces = match extent {
                            e if e.iter().sum::<i64>() > 1 => self.components([x, y, z], e),
                            e => i64::from(
                                self.inside([x, y, z]) || self.inside([x + e[0], y + e[1], z + e[2]]),
                            ),
                        };
                        sum += sign * pieces;
                    }
                }
            }
        }
        sum
    }
}

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
