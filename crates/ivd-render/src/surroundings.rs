//! What the surroundings of a place leave of its light: ambient occlusion, and the shadow of the lamp.
//!
//! Both are found by rays from every lit place, whose opacity is gathered as that of the picture's own: nothing is kept from picture to picture, and nothing is
//! approximated but by the number of rays, their reach, and that they begin a voxel off: nearer by a surface that is two voxels deep would shade itself, from further off
//! cracks are overlooked. Directions are those of a Fibonacci lattice, turned for every place by a hash of the place and the seed
//! (Cranley and Patterson 1976): unbiased, and the same for any number of threads.

use std::f64::consts::TAU;

use ivd_core::Grid;
use nalgebra::Vector3;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::camera::{Camera, Ray, diagonal};
use crate::cast::{Cast, Field, first_hit_by, first_place};
use crate::dvr::{Optics, Step, dvr};
use crate::light::{Left, Light};
use crate::samples::Stored;

/// Most rays about a place.
const MOST_RAYS: u32 = 4096;
/// Rays reach so far where nothing is said, in diagonals of the volume.
const REACH: f64 = 1.0 / 16.0;
/// A place that adds this share or more to its pixel has all the rays that are asked for about it, one that adds less as many fewer: so the noise of pixels is that of surfaces, at a
/// cost that doesn't grow with the number of places that can be seen through.
const FULL: f32 = 0.25;
/// Opacity at which nothing comes through.
const OPAQUE: f32 = 0.999;

/// What of the surroundings takes light away.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(default)]
pub struct Surroundings {
    /// Ambient occlusion: rays per lit sample that find how much of the hemisphere above it is open, fewer where the sample adds little to its pixel; 0 for none. More rays
    /// give less noise.
    #[schemars(range(max = MOST_RAYS), extend("x-unit" = "1", "x-knob" = "accuracy"))]
    pub ao: u32,
    /// How far these rays reach; without it a sixteenth of the volume's diagonal.
    #[schemars(extend("x-unit" = "mm", "exclusiveMinimum" = 0.0))]
    pub ao_radius: Option<f64>,
    /// Whether what lies between the light source and a sample shades it.
    pub shadow: bool,
    /// Chooses the directions of the rays.
    #[schemars(extend("x-unit" = "1"))]
    pub seed: u64,
}

impl Surroundings {
    /// Whether anything is asked for.
    pub(crate) fn are_asked(&self) -> bool {
        self.ao > 0 || self.shadow
    }
}

/// The same for a view.
#[derive(Clone, Copy)]
pub(crate) struct Around<'a> {
    camera: &'a Camera,
    asked: Surroundings,
    /// How far rays reach (mm).
    reach: f64,
    lamp: Vector3<f64>,
}

impl<'a> Around<'a> {
    pub(crate) fn new(asked: Surroundings, camera: &'a Camera, light: &Light, grid: &Grid) -> Self {
        let reach = asked.ao_radius.unwrap_or(REACH * diagonal(grid));
        let lamp = Vector3::from(light.lamp.map(f64::from));
        Self { camera, asked, reach, lamp }
    }

    /// How long a voxel is along a direction (mm).
    fn voxel(&self, direction: Vector3<f64>) -> f64 {
        1.0 / self.camera.in_voxels(direction).norm()
    }

    /// What is left at a place (voxel coordinate) that faces along a normal, or every way.
    ///
    /// - `adds`: share that the place has of its pixel.
    /// - `through`: how much of the light comes through along a ray.
    fn left(&self, at: [f32; 3], normal: Option<[f32; 3]>, adds: f32, through: impl Fn(&Ray) -> f32) -> Left {
        let normal = normal.map(|n| Vector3::from(n.map(f64::from)));
        let from = Vector3::from(at.map(f64::from));
        let origin = normal.map_or(from, |normal| from + self.camera.in_voxels(normal * self.voxel(normal)));
        let open = |direction: Vector3<f64>, reach: f64| {
            // Along the ray itself where there is no normal.
            let near = if normal.is_some() { 0.0 } else { self.voxel(direction) };
            let ray = self.camera.ray_along(origin, direction, [near, near + reach]);
            ray.map_or(1.0, |ray| through(&ray))
        };
        let lamp = if self.asked.shadow { open(self.lamp, f64::INFINITY) } else { 1.0 };
        if self.asked.ao == 0 {
            return Left { ambient: 1.0, lamp };
        }
        let turn = turn(at, self.asked.seed);
        let rays = (self.asked.ao as f32 * (adds / FULL).min(1.0)).ceil().max(1.0) as u32;
        let sum: f32 = (0..rays).map(|i| open(direction(i, rays, turn, normal), self.reach)).sum();
        Left { ambient: sum / rays as f32, lamp }
    }
}

/// One of several directions: over the half space about a normal by the cosine to it, else over the sphere.
fn direction(i: u32, count: u32, turn: [f64; 2], normal: Option<Vector3<f64>>) -> Vector3<f64> {
    /// The golden ratio less 1.
    const GOLDEN: f64 = 0.618_033_988_749_894_9;
    let u = (turn[0] + (f64::from(i) + 0.5) / f64::from(count)).fract();
    let (sin, cos) = (TAU * (turn[1] + f64::from(i) * GOLDEN)).sin_cos();
    let Some(normal) = normal else {
        let height = 1.0 - 2.0 * u;
        let across = (1.0 - height * height).max(0.0).sqrt();
        return Vector3::new(across * cos, across * sin, height);
    };
    // Any direction that isn't the normal's spans the plane with it.
    let other = if normal.z.abs() < 0.9 { Vector3::z() } else { Vector3::x() };
    let right = normal.cross(&other).normalize();
    let up = right.cross(&normal);
    let across = u.sqrt();
    right * (across * cos) + up * (across * sin) + normal * (1.0 - u).max(0.0).sqrt()
}

/// Two numbers from 0 to below 1 that a place and a seed decide.
fn turn(at: [f32; 3], seed: u64) -> [f64; 2] {
    let mut state = at.iter().fold(seed, |state, c| mixed(state ^ u64::from(c.to_bits())));
    std::array::from_fn(|_| {
        state = mixed(state);
        (state >> 11) as f64 / (1_u64 << 53) as f64
    })
}

/// A step of splitmix64 (Steele, Lea and Flood 2014).
fn mixed(state: u64) -> u64 {
    let mut z = state.wrapping_add(0x9E37_79B9_7F4A_7C15);
    z = (z ^ (z >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
    z = (z ^ (z >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
    z ^ (z >> 31)
}

/// Steps that look as others do, lit by what their surroundings leave.
pub(crate) struct Surrounded<'a, O> {
    pub(crate) unlit: O,
    pub(crate) around: Around<'a>,
    /// Whether gradients turn places to the lamp; else they scatter every way alike.
    pub(crate) is_shaded: bool,
}

impl<O> Surrounded<'_, O> {
    /// Opacity decides how much comes through. `before`: what lies before it lets through so much.
    fn lit_at<T: Stored>(
        &self,
        field: &Field<'_, T>,
        entry: [f32; 4],
        at: [f32; 3],
        normal: Option<[f32; 3]>,
        before: f32,
    ) -> [f32; 4]
    where
        O: Optics<T>,
    {
        let through = |ray: &Ray| 1.0 - dvr(field, &self.unlit, OPAQUE, ray).rgba[3];
        field.light.lit_by(entry, normal, self.around.left(at, normal, before * entry[3], through))
    }

    fn normal<T: Stored>(&self, field: &Field<'_, T>, at: [f32; 3], moves: bool) -> Option<[f32; 3]> {
        field.normal_there(at, moves).filter(|_| self.is_shaded)
    }
}

impl<T: Stored, O: Optics<T> + Copy> Optics<T> for Surrounded<'_, O> {
    type End = O::End;

    fn step(
        &self,
        field: &Field<'_, T>,
        ray: &Ray,
        step: &Step,
        front: Option<O::End>,
    ) -> ([f32; 4], O::End) {
        let (entry, end) = self.unlit.step(field, ray, step, front);
        if entry[3] <= 0.0 {
            return (entry, end);
        }
        let normal = self.normal(field, step.at, field.moves(step.brick));
        (self.lit_at(field, entry, step.at, normal, step.through), end)
    }

    fn rest(&self, field: &Field<'_, T>, ray: &Ray) -> [f32; 4] {
        let entry = self.unlit.rest(field, ray);
        if entry[3] <= 0.0 {
            return entry;
        }
        let normal = self.normal(field, ray.rest_at, field.moves(field.space.brick(ray.rest_at)));
        self.lit_at(field, entry, ray.rest_at, normal, 1.0)
    }

    fn unlit(&self) -> Option<impl Optics<T, End = O::End>> {
        self.is_shaded.then_some(self.unlit)
    }

    fn lit(&self, field: &Field<'_, T>, entry: [f32; 4], at: [f32; 3], normal: [f32; 3]) -> [f32; 4] {
        self.lit_at(field, entry, at, Some(normal), 1.0)
    }
}

/// First hit of a surface, lit by what its surroundings leave: the surface lets nothing through.
pub(crate) fn first_hit<T: Stored>(
    field: &Field<'_, T>,
    iso: f32,
    sign: f32,
    [r, g, b]: [f32; 3],
    around: &Around<'_>,
    ray: &Ray,
) -> Cast {
    let through = |ray: &Ray| if first_place(field, iso, sign, ray).0.is_some() { 0.0 } else { 1.0 };
    first_hit_by(field, iso, sign, ray, |at, normal| {
        field.light.lit_by([r, g, b, 1.0], normal, around.left(at, normal, 1.0, through))
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn directions_are_spread_by_the_cosine_about_a_normal_and_evenly_without() {
        let count = 4096;
        let mean = |normal: Option<Vector3<f64>>| {
            let all = (0..count).map(|i| direction(i, count, [0.3, 0.7], normal));
            all.fold((Vector3::zeros(), 0.0_f64), |(sum, most), d| {
                (sum + d / f64::from(count), most.max((d.norm() - 1.0).abs()))
            })
        };
        for normal in [[0.0, 0.0, 1.0], [1.0, 0.0, 0.0], [-0.6, 0.64, -0.48]].map(Vector3::from) {
            let (mean, off) = mean(Some(normal));
            // The mean of a direction by its cosine is two thirds of the normal.
            assert!((mean - normal * (2.0 / 3.0)).norm() < 2e-3 && off < 1e-12, "{mean:?}");
        }
        assert!(mean(None).0.norm() < 2e-3);
    }

    #[test]
    fn turns_differ_from_place_to_place_and_by_the_seed() {
        let turns = [turn([1.0, 2.0, 3.0], 0), turn([1.0, 2.0, 3.5], 0), turn([1.0, 2.0, 3.0], 1)];
        assert!(turns.iter().flatten().all(|t| (0.0..1.0).contains(t)));
        assert!(turns[0] != turns[1] && turns[0] != turns[2]);
        let mean = (0..4000).map(|i| turn([i as f32, 0.5, 0.25], 7)[0]).sum::<f64>() / 4000.0;
        assert!((mean - 0.5).abs() < 0.02, "{mean}");
    }
}
