//! Pictures of lattices: lit faces, their edges, and a colour for every place.

use ivd_core::{Exec, Grid, Image, Lattice};
use nalgebra::{Matrix3, Vector3};
use rayon::prelude::*;

use crate::annotate::Marks;
use crate::camera::Camera;
use crate::fit::Held;
use crate::frame::{Radiance, means};
use crate::light::Light;
use crate::picture::{self, Background};
use crate::{Error, Projection, RenderParams, annotate};

/// Samples along a pixel's edge.
const FINE: usize = 3;
/// Half the width of an edge (pixels).
const HALF_EDGE: f64 = 0.45;
/// Colour of edges, linear RGB.
const EDGE: [f32; 3] = [0.01, 0.02, 0.05];
/// No triangle covers a sample.
const NONE: u32 = u32::MAX;

/// How a lattice is drawn.
#[derive(Clone, Copy, Default)]
pub struct SurfaceStyle<'a> {
    /// Colour of a place on the surface (mm), linear RGB in 0…1; without it that of [`RenderParams::surface`].
    pub colour: Option<&'a (dyn Fn([f64; 3]) -> [f32; 3] + Sync)>,
    /// Whether the edges of the triangles that are seen are drawn.
    pub edges: bool,
    /// Corners of the box that the picture holds at zoom 1 (mm), so that several lattices are seen alike; without it the
    /// lattice's own.
    pub frame: Option<[[f64; 3]; 2]>,
}

/// Draws a lattice: of `params` the size, the view, the background, the surface's colour, whether it is lit, and whether
/// letters and a cube are drawn; `fit` isn't read, the box is what fits. What is hidden by other triangles isn't seen, and neither are its edges; both sides of a triangle
/// are. Nine samples a pixel; the same bytes for any number of threads. A lattice without triangles gives the background.
///
/// # Errors
/// [`ivd_core::Error::Param`] names a parameter outside its domain; in [`Error::Core`] a lattice that breaks its own check, memory that
/// is short, or cancelled work.
pub fn surface(
    lattice: &Lattice,
    look: &SurfaceStyle,
    params: &RenderParams,
    exec: &Exec,
) -> Result<Image, Error> {
    // What only volumes have isn't read.
    let params = &RenderParams { antialias: 1, legend: false, shells: Vec::new(), ..params.clone() };
    params.check()?;
    let grid = match look.frame.or_else(|| extent(lattice)) {
        Some(frame) => around(frame)?,
        None => lattice.grid().clone(),
    };
    let fine = RenderParams { size: params.size.map(|side| FINE * side), ..params.clone() };
    let [wide, high] = fine.size;
    let colour = params.surface.map(|c| c as f32);
    exec.check_memory("picture of a lattice", 24 * (wide * high) as u64)?;
    let camera = Camera::new(&grid, &fine, &Held::Volume);
    exec.run(|| {
        let drawn = Drawn::new(lattice, &camera, params.view.projection);
        exec.check_cancelled()?;
        let light = params.shading.then(|| Light::new(&camera, Matrix3::identity(), -1.0));
        let shade = |sample: usize, triangle: u32| {
            let at = [(sample % wide) as f64, (sample / wide) as f64];
            drawn.shade(triangle, at, look, colour, light.as_ref())
        };
        let rows = drawn.seen.par_chunks(FINE * wide).enumerate().map(|(row, seen)| {
            let first = row * FINE * wide;
            let samples: Vec<[f32; 4]> = seen
                .iter()
                .enumerate()
                .map(|(i, &t)| if t == NONE { [0.0; 4] } else { shade(first + i, t) })
                .collect();
            means(&samples, wide, FINE)
        });
        let rgba: Vec<[f32; 4]> = rows.collect::<Vec<_>>().concat();
        let [width, height] = params.size;
        let light = Radiance { width, height, rgba, samples: 0, skipped: 0 };
        let image = picture::compose(&light, &Background::of(params));
        let camera = Camera::new(&grid, params, &Held::Volume);
        let RenderParams { annotate, cube, .. } = *params;
        let marks = Marks { annotate, cube, in_patient: lattice.grid().in_patient(), bar: None };
        Ok(annotate::annotate(image, &camera, &marks))
    })
}

/// Low and high corner of a lattice's box (mm); none for a lattice without triangles.
fn extent(lattice: &Lattice) -> Option<[[f64; 3]; 2]> {
    let positions = lattice.positions();
    let used = lattice.triangles().iter().flatten().map(|&v| positions[v as usize]);
    let [low, high] = used.map(|p| [p; 2]).reduce(|a, b| [a[0].inf(&b[0]), a[1].sup(&b[1])])?;
    Some([low.into(), high.into()])
}

/// A grid of one voxel that fills a box.
fn around([low, high]: [[f64; 3]; 2]) -> Result<Grid, Error> {
    let longest = (0..3).map(|a| high[a] - low[a]).fold(0.0, f64::max).max(1e-6);
    let spacing = std::array::from_fn(|a| (high[a] - low[a]).max(1e-6 * longest));
    let middle = std::array::from_fn(|a| 0.5 * (low[a] + high[a]));
    let axes = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];
    Grid::new([1; 3], spacing, middle, axes).map_err(|e| Error::Core(e.into()))
}

/// A vertex on the picture.
#[derive(Clone, Copy)]
struct Projected {
    at: [f64; 2],
    /// Grows towards the eye, and is affine over the picture.
    nearness: f64,
    /// What affine weights on the picture are multiplied with to give those on the triangle.
    weight: f64,
}

/// The lattice on the picture, and which triangle each sample sees.
struct Drawn<'a> {
    lattice: &'a Lattice,
    places: Vec<Vector3<f64>>,
    projected: Vec<Option<Projected>>,
    seen: Vec<u32>,
}

impl<'a> Drawn<'a> {
    fn new(lattice: &'a Lattice, camera: &Camera, projection: Projection) -> Self {
        let places = lattice.positions();
        let projected = places.iter().map(|p| {
            let (at, depth) = (camera.project(*p)?, camera.depth(*p));
            let (nearness, weight) = match projection {
                Projection::Orthographic => (-depth, 1.0),
                Projection::Perspective => (1.0 / depth, 1.0 / depth),
            };
            Some(Projected { at, nearness, weight })
        });
        let projected = projected.collect();
        let mut drawn = Self { lattice, places, projected, seen: Vec::new() };
        drawn.seen = drawn.visible(camera.size());
        drawn
    }

    /// Corners of a triangle; none where one lies behind the eye.
    fn corners(&self, triangle: u32) -> Option<[Projected; 3]> {
        let [a, b, c] = self.lattice.triangles()[triangle as usize].map(|v| self.projected[v as usize]);
        Some([a?, b?, c?])
    }

    /// The nearest triangle at every sample, the first of equals.
    fn visible(&self, [width, height]: [usize; 2]) -> Vec<u32> {
        let mut nearest = vec![f64::NEG_INFINITY; width * height];
        let mut seen = vec![NONE; width * height];
        for triangle in 0..self.lattice.triangles().len() as u32 {
            let Some(corners) = self.corners(triangle) else { continue };
            let side = |axis: usize, size: usize| {
                let of = corners.map(|c| c.at[axis]);
                let low = of.into_iter().fold(f64::INFINITY, f64::min).ceil().max(0.0);
                let high = of.into_iter().fold(f64::NEG_INFINITY, f64::max).floor().min(size as f64 - 1.0);
                // Beside the picture nothing is left.
                if low <= high { low as usize..high as usize + 1 } else { 0..0 }
            };
            for (y, x) in side(1, height).flat_map(|y| side(0, width).map(move |x| (y, x))) {
                let Some(parts) = parts(&corners, [x as f64, y as f64]) else { break };
                if parts.iter().any(|&part| part < 0.0) {
                    continue;
                }
                let near: f64 = (0..3).map(|i| parts[i] * corners[i].nearness).sum();
                let at = x + width * y;
                if near > nearest[at] {
                    (nearest[at], seen[at]) = (near, triangle);
                }
            }
        }
        seen
    }

    /// Premultiplied light of a sample that sees a triangle.
    fn shade(
        &self,
        triangle: u32,
        at: [f64; 2],
        look: &SurfaceStyle,
        plain: [f32; 3],
        light: Option<&Light>,
    ) -> [f32; 4] {
        let corners = self.corners(triangle).expect("a triangle that is seen lies before the eye");
        let parts = parts(&corners, at).expect("a triangle that is seen has an area");
        if look.edges && (0..3).any(|i| off_edge(&corners, parts[i], i) < HALF_EDGE * FINE as f64) {
            return [EDGE[0], EDGE[1], EDGE[2], 1.0];
        }
        let [a, b, c] = self.lattice.triangles()[triangle as usize].map(|v| self.places[v as usize]);
        let whole: f64 = (0..3).map(|i| parts[i] * corners[i].weight).sum();
        let [u, v, w] = [0, 1, 2].map(|i| parts[i] * corners[i].weight / whole);
        let [red, green, blue] = look.colour.map_or(plain, |colour| colour((a * u + b * v + c * w).into()));
        let colour = [red, green, blue, 1.0];
        let Some(light) = light else { return colour };
        let mut normal = (b - a).cross(&(c - a));
        if is_turned(&corners) {
            normal = -normal;
        }
        let length = normal.norm();
        let unit = (length > 0.0).then(|| std::array::from_fn(|k| (normal[k] / length) as f32));
        light.lit(colour, unit)
    }
}

/// Whether a triangle shows its inside: counter-clockwise from outside is clockwise where y points down.
fn is_turned(corners: &[Projected; 3]) -> bool {
    double_area(corners.map(|c| c.at)) > 0.0
}

fn double_area([a, b, c]: [[f64; 2]; 3]) -> f64 {
    (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])
}

/// The parts of a triangle that lie opposite its corners, seen from a place on the picture; they add up to 1, and none is
/// negative inside. None for a triangle that is seen from its edge.
fn parts(corners: &[Projected; 3], at: [f64; 2]) -> Option<[f64; 3]> {
    let [a, b, c] = corners.map(|corner| corner.at);
    let whole = double_area([a, b, c]);
    (whole != 0.0).then(|| [[at, b, c], [a, at, c], [a, b, at]].map(|part| double_area(part) / whole))
}

/// Distance on the picture of the edge opposite corner `i`, given the part there.
fn off_edge(corners: &[Projected; 3], part: f64, i: usize) -> f64 {
    let [b, c] = [corners[(i + 1) % 3].at, corners[(i + 2) % 3].at];
    let whole = double_area(corners.map(|corner| corner.at)).abs();
    part * whole / (b[0] - c[0]).hypot(b[1] - c[1])
}
