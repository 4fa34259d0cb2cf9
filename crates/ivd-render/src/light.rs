use nalgebra::{Matrix3, Vector3};

use crate::camera::Camera;

/// Share of the light that reaches every side.
pub(crate) const AMBIENT: f32 = 0.25;
/// Share that depends on the angle to the lamp.
pub(crate) const DIFFUSE: f32 = 0.75;
/// Strength of the highlight.
pub(crate) const SPECULAR: f32 = 0.18;

/// What is left of the light of all around, and of the lamp's.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Left {
    pub(crate) ambient: f32,
    pub(crate) lamp: f32,
}

/// A lamp beside the eye, up and to the left, for the whole picture. Blinn–Phong with a wrapped diffuse term: `((1 + n·l) / 2)²`
/// (half Lambert), so that the sides turned away keep their shape.
pub(crate) struct Light {
    pub(crate) lamp: [f32; 3],
    pub(crate) halfway: [f32; 3],
    /// Turns a gradient per voxel into one per mm, times the sign of the slope.
    pub(crate) to_world: [[f32; 3]; 3],
    /// Real units in one of the fast values.
    unit: f32,
    /// −1 where the real value falls as the stored one rises, else 1.
    slope: f32,
    /// The shortest edge of a voxel (mm).
    voxel: f32,
}

impl Light {
    /// - `to_voxel`: the grid's world-to-voxel matrix.
    /// - `slope`: real units in one of the fast values; negative where the real value falls as the stored one rises.
    pub(crate) fn new(camera: &Camera, to_voxel: Matrix3<f64>, slope: f64) -> Self {
        let lamp = (camera.towards_eye + 0.45 * camera.up - 0.35 * camera.right).normalize();
        let halfway = (lamp + camera.towards_eye).normalize();
        let single = |v: Vector3<f64>| -> [f32; 3] { std::array::from_fn(|a| v[a] as f32) };
        let transposed = to_voxel.transpose() * slope.signum();
        Self {
            lamp: single(lamp),
            halfway: single(halfway),
            to_world: std::array::from_fn(|r| std::array::from_fn(|c| transposed[(r, c)] as f32)),
            unit: slope.abs() as f32,
            slope: slope.signum() as f32,
            voxel: to_voxel.row_iter().map(|row| 1.0 / row.norm()).fold(f64::INFINITY, f64::min) as f32,
        }
    }

    /// Real units in one of the fast values.
    pub(crate) fn unit(&self) -> f32 {
        self.unit
    }

    /// Magnitude [real units / mm] of a gradient per voxel; no number beside missing data.
    #[inline(always)]
    pub(crate) fn magnitude(&self, gradient: [f32; 3]) -> f32 {
        self.unit * squared(self.world(gradient)).sqrt()
    }

    #[inline(always)]
    fn world(&self, gradient: [f32; 3]) -> [f32; 3] {
        let m = &self.to_world;
        std::array::from_fn(|r| m[r][0] * gradient[0] + m[r][1] * gradient[1] + m[r][2] * gradient[2])
    }

    /// The shortest edge of a voxel (mm).
    pub(crate) fn voxel(&self) -> f32 {
        self.voxel
    }

    /// Unit world normal against a rise per voxel, whichever way the values go.
    pub(crate) fn normal_along(&self, rise: [f32; 3]) -> Option<[f32; 3]> {
        self.normal(rise.map(|c| self.slope * c))
    }

    /// Unit world normal from a gradient per voxel: against the gradient, out of what is dense. `None` where there is no
    /// direction: a flat place, or one beside missing data.
    #[inline(always)]
    pub(crate) fn normal(&self, gradient: [f32; 3]) -> Option<[f32; 3]> {
        let world = self.world(gradient);
        let square = squared(world);
        if !(square > f32::MIN_POSITIVE && square < f32::MAX) {
            return None;
        }
        let scale = -1.0 / square.sqrt();
        Some(world.map(|c| c * scale))
    }

    /// The same where the surroundings leave less of it. Without a normal a place scatters every way alike.
    pub(crate) fn lit_by(
        &self,
        [r, g, b, alpha]: [f32; 4],
        normal: Option<[f32; 3]>,
        left: Left,
    ) -> [f32; 4] {
        let (wrapped, shine) = normal.map_or((1.0, 0.0), |normal| self.shares(normal));
        let matt = left.ambient * (AMBIENT + DIFFUSE * wrapped * wrapped * left.lamp);
        let highlight = SPECULAR * shine * left.lamp * alpha;
        let [r, g, b] = [r, g, b].map(|c| (c * matt + highlight).min(alpha));
        [r, g, b, alpha]
    }

    /// Of the lamp's light: the root of what a side turns back matt, and what it turns back shining.
    #[inline(always)]
    fn shares(&self, n: [f32; 3]) -> (f32, f32) {
        let dot = |v: [f32; 3]| n[0] * v[0] + n[1] * v[1] + n[2] * v[2];
        let wrapped = 0.5 + 0.5 * dot(self.lamp);
        let mut shine = dot(self.halfway).max(0.0);
        for _ in 0..5 {
            shine *= shine;
        }
        (wrapped, shine)
    }

    /// A premultiplied colour under the lamp; unchanged without a normal.
    #[inline(always)]
    pub(crate) fn lit(&self, [r, g, b, alpha]: [f32; 4], normal: Option<[f32; 3]>) -> [f32; 4] {
        let Some(n) = normal else { return [r, g, b, alpha] };
        let (wrapped, shine) = self.shares(n);
        let matt = AMBIENT + DIFFUSE * wrapped * wrapped;
        let highlight = SPECULAR * shine * alpha;
        let [r, g, b] = [r, g, b].map(|c| (c * matt + highlight).min(alpha));
        [r, g, b, alpha]
    }
}

#[inline(always)]
fn squared([x, y, z]: [f32; 3]) -> f32 {
    x * x + y * y + z * z
}
