//! The formulas: signed distances and scalars. Everything is computed in `f64`, in the written order.

use std::f64::consts::PI;

use super::bust::{self, Bust};
use super::params::{Contrast, Params, Shape};
use super::truth::{HEAD, NECK};

/// Offset of a phantom's centre from the middle of its grid (voxels).
const SHIFT: [f64; 3] = [0.13, -0.21, 0.37];
const GYROID_PERIODS: f64 = 4.0;
/// Periods of the bars (voxels), by band along y.
const BARS: [f64; 8] = [16.0, 12.0, 8.0, 6.0, 5.0, 4.0, 3.0, 2.0];
/// Half of the shell's thickness (voxels).
const HALF_SHELL: f64 = 0.75;

/// Outer semi-axes of the head (size).
const HEAD_AXES: [f64; 3] = [0.36, 0.44, 0.40];
const VENTRICLE_AXES: [f64; 3] = [0.045, 0.13, 0.07];

/// Semi-axes of the neck across z, its airway's radius and place along y (size).
const NECK_AXES: [f64; 2] = [0.33, 0.37];
const AIRWAY: [f64; 2] = [0.055, 0.19];
/// The spine: its place along y, semi-axes of a vertebra's body and of a disc across z (size).
const SPINE: f64 = -0.06;
const BODY_AXES: [f64; 2] = [0.11, 0.085];
const DISC_AXES: [f64; 2] = [0.10, 0.076];
/// Vertebrae from the lowest to the highest, half the way from one to the next, and half the height of one (size).
const VERTEBRAE: f64 = 5.0;
const HALF_PITCH: f64 = 0.0875;
const HALF_HEIGHT: f64 = 0.06;
/// A vertebra's spine points backwards: its radius, and its tip's way from the middle of the body along y (size).
const PROCESS: [f64; 2] = [0.03, -0.2];

/// Signed distance (voxels) of a voxel coordinate from a shape's surface, negative inside.
///
/// Exact for `sphere`, `torus`, `spheres` and `shell`. For `gyroid` it is `f / |∇f|`, right to first order near the
/// surface. For `bars` it is the distance along x within the point's band; for `head`, `neck` and `bust` a first-order distance
/// from the skin.
pub fn signed_distance(shape: Shape, point: [f64; 3], size: usize) -> f64 {
    let n = size as f64;
    let q: [f64; 3] = std::array::from_fn(|a| point[a] - centre(n)[a]);
    match shape {
        Shape::Sphere => norm(q) - 0.35 * n,
        Shape::Torus => (q[0].hypot(q[1]) - 0.28 * n).hypot(q[2]) - 0.12 * n,
        Shape::Spheres => [-0.2, 0.2]
            .map(|s: f64| norm([q[0] - s * n, q[1], q[2]]) - 0.2 * n)
            .into_iter()
            .fold(f64::INFINITY, f64::min),
        Shape::Shell => (norm(q) - 0.35 * n).abs() - HALF_SHELL,
        Shape::Gyroid => {
            let w = gyroid_frequency(n);
            let (s, c) = (q.map(|v| (v * w).sin()), q.map(|v| (v * w).cos()));
            let gradient = [
                w * (c[0] * c[1] - s[2] * s[0]),
                w * (c[1] * c[2] - s[0] * s[1]),
                w * (c[2] * c[0] - s[1] * s[2]),
            ];
            gyroid(s, c) / norm(gradient).max(1e-3)
        }
        Shape::Bars => {
            let period = bar_period(point[1], n);
            // The bar's voxels are 0 … ceil(period / 2) - 1; its faces lie half a voxel outside them.
            let half_width = (period / 2.0).ceil() / 2.0;
            let t = (point[0] + 0.5).rem_euclid(period) - half_width;
            let gap = (period - 2.0 * half_width) / 2.0;
            if t > half_width + gap { period - t - half_width } else { t.abs() - half_width }
        }
        Shape::Head => {
            let r = norm(std::array::from_fn(|a| q[a] / n / HEAD_AXES[a]));
            let slope = norm(std::array::from_fn(|a| q[a] / (n * HEAD_AXES[a] * n * HEAD_AXES[a])));
            if slope > 0.0 { (r - 1.0) * r / slope } else { -HEAD_AXES[0] * n }
        }
        Shape::Neck => {
            let r = norm([q[0] / n / NECK_AXES[0], q[1] / n / NECK_AXES[1], 0.0]);
            let slope = |a: usize| q[a] / (n * NECK_AXES[a] * n * NECK_AXES[a]);
            let slope = norm([slope(0), slope(1), 0.0]);
            if slope > 0.0 { (r - 1.0) * r / slope } else { -NECK_AXES[0] * n }
        }
        Shape::Bust => Bust::new(size, Contrast::default()).skin_distance(point),
    }
}

/// Noise-free scalar and label of voxels; what depends on one coordinate alone is computed once.
pub(super) struct Sampler {
    shape: Shape,
    size: usize,
    /// Sines and cosines by axis and index, for the shapes that need them.
    sin: [Vec<f64>; 3],
    cos: [Vec<f64>; 3],
    bust: Option<Bust>,
}

impl Sampler {
    pub(super) fn new(params: &Params) -> Self {
        let (shape, size) = (params.shape, params.size);
        let n = size as f64;
        let axis = |angle: &dyn Fn(usize, f64) -> f64, wave: fn(f64) -> f64| {
            std::array::from_fn(|a| (0..size).map(|i| wave(angle(a, i as f64 - centre(n)[a]))).collect())
        };
        let gyroid_angle = |_: usize, q: f64| q * gyroid_frequency(n);
        let fold_angle = |a: usize, q: f64| [34.0, 31.0, 29.0][a] * (q / n) + a as f64;
        let (sin, cos) = match shape {
            Shape::Gyroid => (axis(&gyroid_angle, f64::sin), axis(&gyroid_angle, f64::cos)),
            Shape::Head => (axis(&fold_angle, f64::sin), Default::default()),
            _ => Default::default(),
        };
        let bust = (shape == Shape::Bust).then(|| Bust::new(size, params.contrast));
        Self { shape, size, sin, cos, bust }
    }

    /// Slices that are computed together.
    pub(super) fn depth(&self) -> usize {
        if self.bust.is_some() { bust::BRICK } else { 1 }
    }

    /// Scalars (0…1) and labels of the slices from `z` on.
    pub(super) fn fill(&self, z: usize, scalars: &mut [f64], ids: &mut [u16]) {
        if let Some(bust) = &self.bust {
            return bust.slab(z, scalars, ids);
        }
        let n = self.size;
        for (i, (scalar, id)) in scalars.iter_mut().zip(ids).enumerate() {
            (*scalar, *id) = self.at([i % n, i / n % n, z + i / (n * n)]);
        }
    }

    /// Scalar (0…1) and label of a voxel.
    #[inline]
    fn at(&self, voxel: [usize; 3]) -> (f64, u16) {
        let p = voxel.map(|v| v as f64);
        let value = match self.shape {
            Shape::Head => {
                let label = self.head_label(voxel);
                return (HEAD[label as usize].1, label);
            }
            Shape::Neck => {
                let centre = centre(self.size as f64);
                let label = neck_label(std::array::from_fn(|a| (p[a] - centre[a]) / self.size as f64));
                return (NECK[label as usize].1, label);
            }
            Shape::Bars => {
                let period = bar_period(p[1], self.size as f64);
                f64::from(u8::from(p[0] % period < period / 2.0))
            }
            Shape::Gyroid => {
                let wave = |table: &[Vec<f64>; 3]| std::array::from_fn(|a| table[a][voxel[a]]);
                0.5 - 0.3 * gyroid(wave(&self.sin), wave(&self.cos))
            }
            shape => 0.5 - signed_distance(shape, p, self.size) / 8.0,
        }
        .clamp(0.0, 1.0);
        (value, u16::from(value > 0.5))
    }

    fn head_label(&self, voxel: [usize; 3]) -> u16 {
        let n = self.size as f64;
        let q: [f64; 3] = std::array::from_fn(|a| (voxel[a] as f64 - centre(n)[a]) / n);
        let ventricle = |side: f64| {
            let o = [side * 0.07, 0.02, 0.03];
            norm(std::array::from_fn(|a| (q[a] - o[a]) / VENTRICLE_AXES[a])) < 1.0
        };
        let r = norm(std::array::from_fn(|a| q[a] / HEAD_AXES[a]));
        let fold = 0.035 * self.sin[0][voxel[0]] * self.sin[1][voxel[1]] * self.sin[2][voxel[2]];
        let brain = r + fold;
        if ventricle(-1.0) || ventricle(1.0) {
            return 3;
        }
        match () {
            () if brain < 0.64 => 5,
            () if brain < 0.78 => 4,
            () if r < 0.82 => 3,
            () if r < 0.90 => 2,
            () if r < 1.0 => 1,
            () => 0,
        }
    }
}

/// Class of a place in the neck, from its centre (size).
fn neck_label(q: [f64; 3]) -> u16 {
    let ellipse = |axes: [f64; 2], y: f64| norm([q[0] / axes[0], (q[1] - y) / axes[1], 0.0]) < 1.0;
    // Heights from the middle of the nearest vertebra.
    let pitch = 2.0 * HALF_PITCH;
    let half = (VERTEBRAE - 1.0) / 2.0;
    let height = q[2] - (q[2] / pitch).round().clamp(-half, half) * pitch;
    let in_spine = q[2].abs() < half * pitch + HALF_HEIGHT;
    let process = {
        let back = (q[1] - SPINE).clamp(PROCESS[1], 0.0);
        norm([q[0], q[1] - SPINE - back, height]) < PROCESS[0]
    };
    match () {
        () if !ellipse(NECK_AXES, 0.0) => 0,
        () if norm([q[0], q[1] - AIRWAY[1], 0.0]) < AIRWAY[0] => 0,
        () if height.abs() < HALF_HEIGHT && (process || ellipse(BODY_AXES, SPINE)) => 3,
        () if in_spine && ellipse(DISC_AXES, SPINE) => 2,
        () => 1,
    }
}

fn centre(n: f64) -> [f64; 3] {
    SHIFT.map(|s| (n - 1.0) / 2.0 + s)
}

fn norm(q: [f64; 3]) -> f64 {
    (q[0] * q[0] + q[1] * q[1] + q[2] * q[2]).sqrt()
}

/// Angle per voxel.
fn gyroid_frequency(n: f64) -> f64 {
    2.0 * PI * GYROID_PERIODS / n
}

fn gyroid(s: [f64; 3], c: [f64; 3]) -> f64 {
    s[0] * c[1] + s[1] * c[2] + s[2] * c[0]
}

fn bar_period(y: f64, n: f64) -> f64 {
    BARS[((y * BARS.len() as f64 / n).max(0.0) as usize).min(BARS.len() - 1)]
}
