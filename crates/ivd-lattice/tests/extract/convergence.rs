//! Smooth bodies at three voxel sizes: area, volume and places err with the square of the voxel, normals with the voxel.
//!
//! The values are those of the function itself, so that nothing but the extraction errs. Only what lies between voxels
//! of the volume is looked at: a surface that leaves the volume is capped beyond its border, and the caps are none of
//! the function's.

use std::f64::consts::{PI, TAU};

use ivd_core::{Grid, Lattice, Volume, Voxels};
use ivd_lattice::extract::Iso;
use nalgebra::Vector3;

use crate::extract::cut_volume;
use crate::extract::mesh::{area_and_volume, assert_closed_manifold};

type Point = Vector3<f64>;

/// A function of a place (mm) that is above 0 inside the body, and its gradient.
pub(crate) struct Body {
    pub(crate) level: fn(Point) -> f64,
    pub(crate) gradient: fn(Point) -> Point,
}

/// Side of the cube that is sampled (mm).
const SIDE: f64 = 100.0;
const SIZES: [usize; 3] = [32, 64, 128];

/// Off the planes of symmetry of every grid here.
fn centre() -> Point {
    Point::new(50.13, 49.79, 50.37)
}

pub(crate) const BALL: Body =
    Body { level: |p| 35.0 - (p - centre()).norm(), gradient: |p| -(p - centre()).normalize() };

/// Radius of the torus's circle and of its tube (mm); the axis is z.
const TORUS: [f64; 2] = [28.0, 12.0];

pub(crate) const RING: Body = Body {
    level: |p| {
        let p = p - centre();
        TORUS[1] - (p.x.hypot(p.y) - TORUS[0]).hypot(p.z)
    },
    gradient: |p| {
        let p = p - centre();
        let round = p.x.hypot(p.y);
        let from_circle = Point::new(p.x * (1.0 - TORUS[0] / round), p.y * (1.0 - TORUS[0] / round), p.z);
        -from_circle.normalize()
    },
};

/// Periods of the gyroid along the side of the cube.
const PERIODS: f64 = 2.0;

/// Angles (radians) of a place.
fn phase(p: Point) -> Point {
    (p - centre()) * (TAU * PERIODS / SIDE)
}

pub(crate) const GYROID: Body = Body {
    level: |p| {
        let p = phase(p);
        p.x.sin() * p.y.cos() + p.y.sin() * p.z.cos() + p.z.sin() * p.x.cos()
    },
    gradient: |p| {
        let p = phase(p);
        Point::new(
            p.x.cos() * p.y.cos() - p.z.sin() * p.x.sin(),
            p.y.cos() * p.z.cos() - p.x.sin() * p.y.sin(),
            p.z.cos() * p.x.cos() - p.y.sin() * p.z.sin(),
        ) * (TAU * PERIODS / SIDE)
    },
};

/// Area of the gyroid `f = 0` in a cube of one period 2π.
///
/// As `1 = Σ f_k² / |∇f|²`, the area is the sum over the axes of `∫∫ Σ |f_k| / |∇f|` over the plane across axis `k`, one
/// term for each place on the surface above the plane's point; and the three axes are alike. Those places solve
/// `sin y · cos z + cos x · sin z = −sin x · cos y`.
fn area_of_a_period() -> f64 {
    let steps = 1500;
    let step = TAU / f64::from(steps);
    let mut sum = 0.0;
    for i in 0..steps {
        for j in 0..steps {
            let (x, y) = ((f64::from(i) + 0.5) * step, (f64::from(j) + 0.5) * step);
            let (sx, cx, sy, cy) = (x.sin(), x.cos(), y.sin(), y.cos());
            let (length, turn) = (sy.hypot(cx), cx.atan2(sy));
            let share = -sx * cy / length;
            if share.abs() >= 1.0 {
                continue;
            }
            for z in [turn + share.acos(), turn - share.acos()] {
                let (sz, cz) = z.sin_cos();
                let gradient = Point::new(cx * cy - sz * sx, cy * cz - sx * sy, cz * cx - sy * sz);
                sum += gradient.z.abs() / gradient.norm();
            }
        }
    }
    3.0 * sum * step * step
}

/// The cube sampled with `dims` voxels, the first and the last on its faces, and the lattice of it.
fn cut_body(dims: [usize; 3], level: impl Fn(Point) -> f64) -> Lattice {
    cut_volume(&sampled(dims, level), None, Iso::Value(0.0))
}

/// The cube sampled with `dims` voxels.
pub(crate) fn sampled(dims: [usize; 3], level: impl Fn(Point) -> f64) -> Volume {
    let spacing = dims.map(|n| SIDE / (n - 1) as f64);
    let grid = Grid::with_spacing(dims, spacing).unwrap();
    let [nx, ny, _] = dims;
    let value = |i: usize| {
        let v = [i % nx, i / nx % ny, i / nx / ny];
        level(Point::from_fn(|a, _| v[a] as f64 * spacing[a])) as f32
    };
    let voxels: Vec<f32> = (0..dims.iter().product()).map(value).collect();
    Volume::new(grid, Voxels::from(voxels)).unwrap()
}

/// What is measured between the voxels of the volume.
#[derive(Debug)]
struct Measured {
    /// mm².
    area: f64,
    /// Largest distance of a vertex from the body's surface (mm), to first order where the level is no distance.
    distance: f64,
    /// Largest angle between a vertex's normal, from its triangles by area, and the surface's (radians).
    angle: f64,
}

fn measure(lattice: &Lattice, body: &Body) -> Measured {
    let at = lattice.local_positions();
    let last = lattice.grid().dims().map(|n| (n - 1) as f64);
    let mut area = 0.0;
    let mut normals = vec![Point::zeros(); at.len()];
    for t in lattice.triangles() {
        let [a, b, c] = t.map(|v| at[v as usize]);
        let normal = (b - a).cross(&(c - a)) / 2.0;
        let middle = t.map(|v| lattice.voxel(v as usize).0).iter().sum::<Point>() / 3.0;
        if (0..3).all(|k| (0.0..last[k]).contains(&middle[k])) {
            area += normal.norm();
        }
        for v in t {
            normals[*v as usize] += normal;
        }
    }
    let (mut distance, mut angle) = (0.0_f64, 0.0_f64);
    for (v, (p, normal)) in at.iter().zip(&normals).enumerate() {
        let voxel = lattice.voxel(v).0;
        let gradient = (body.gradient)(*p);
        if (0..3).all(|k| (0.0..=last[k]).contains(&voxel[k])) {
            distance = distance.max((body.level)(*p).abs() / gradient.norm());
        }
        if (0..3).all(|k| voxel[k] > 0.0 && voxel[k] < last[k]) {
            // From sine and cosine: the angle is small, and the cosine alone would lose it.
            angle = angle.max(normal.cross(&gradient).norm().atan2(-normal.dot(&gradient)));
        }
    }
    Measured { area, distance, angle }
}

/// Order at which errors fall with the voxel, by regression of logarithms over [`SIZES`].
fn order(errors: [f64; 3]) -> f64 {
    let x = SIZES.map(|n| (n as f64).ln());
    let y = errors.map(f64::ln);
    let mean = |v: [f64; 3]| v.iter().sum::<f64>() / 3.0;
    let (mx, my) = (mean(x), mean(y));
    let across: f64 = (0..3).map(|i| (x[i] - mx) * (y[i] - my)).sum();
    -across / x.iter().map(|v| (v - mx).powi(2)).sum::<f64>()
}

/// Voxels of the finest grid along each axis for one of `n` along x: alike, or twice as many along x as along z.
const ISOTROPIC: [usize; 3] = [4, 4, 4];
const ANISOTROPIC: [usize; 3] = [4, 3, 2];

fn dims(n: usize, quarters: [usize; 3]) -> [usize; 3] {
    quarters.map(|q| n * q / 4)
}

/// Fails unless area, places and normals of `body` converge to the area given and to the body itself.
fn assert_converges(name: &str, body: &Body, area: f64, quarters: [usize; 3]) {
    let found = SIZES.map(|n| measure(&cut_body(dims(n, quarters), body.level), body));
    let error = |k: usize| (found[k].area - area).abs() / area;
    let areas = [error(0), error(1), error(2)];
    let [distances, angles] = [[0, 1, 2].map(|k| found[k].distance), [0, 1, 2].map(|k| found[k].angle)];
    let orders = [order(areas), order(distances), order(angles)];
    println!(
        "{name}, {quarters:?}: area {areas:?}, distance {distances:?} mm, angle {angles:?}, orders {orders:.3?}"
    );
    assert!(orders[0] >= 1.8, "{name}: area falls with order {}: {areas:?}", orders[0]);
    assert!(orders[1] >= 1.8, "{name}: places with order {}: {distances:?}", orders[1]);
    assert!(orders[2] >= 0.8, "{name}: normals with order {}: {angles:?}", orders[2]);
    assert!(areas[2] < 4e-3, "{name}: area {areas:?}");
}

/// Fails unless the volume that is enclosed converges to `volume` (mm³).
fn assert_encloses(name: &str, level: impl Fn(Point) -> f64, volume: f64, quarters: [usize; 3]) {
    let errors = SIZES.map(|n| {
        let lattice = cut_body(dims(n, quarters), &level);
        assert_closed_manifold(&lattice, name);
        (area_and_volume(&lattice).1 - volume).abs() / volume
    });
    println!("{name}, {quarters:?}: volume {errors:?}, order {:.3}", order(errors));
    assert!(order(errors) >= 1.8, "{name}: volume falls with order {}: {errors:?}", order(errors));
    assert!(errors[2] < 4e-3, "{name}: volume {errors:?}");
}

#[test]
fn a_ball_converges() {
    for quarters in [ISOTROPIC, ANISOTROPIC] {
        assert_converges("ball", &BALL, 4.0 * PI * 35.0_f64.powi(2), quarters);
        assert_encloses("ball", BALL.level, 4.0 / 3.0 * PI * 35.0_f64.powi(3), quarters);
    }
}

#[test]
fn a_torus_converges() {
    let [large, small] = TORUS;
    for quarters in [ISOTROPIC, ANISOTROPIC] {
        assert_converges("torus", &RING, 4.0 * PI * PI * large * small, quarters);
        assert_encloses("torus", RING.level, 2.0 * PI * PI * large * small * small, quarters);
    }
}

#[test]
fn a_gyroid_converges() {
    // The cube holds whole periods, so that it holds this area wherever they begin.
    let area = area_of_a_period() * PERIODS.powi(3) * (SIDE / (TAU * PERIODS)).powi(2);
    for quarters in [ISOTROPIC, ANISOTROPIC] {
        assert_converges("gyroid", &GYROID, area, quarters);
        // Turned inside out by reflection in its centre, it halves every ball round it.
        let halved = |p: Point| (GYROID.level)(p).min(0.1 * (40.0 - (p - centre()).norm()));
        assert_encloses("halved ball", halved, 2.0 / 3.0 * PI * 40.0_f64.powi(3), quarters);
    }
}
