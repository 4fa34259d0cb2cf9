//! What rays are cast through, as plain data: for backends other than the processor.

use ivd_core::{Displacement, Exec, Kernel, Labels, Volume, srgb};

use crate::camera::{Camera, Ray};
pub use crate::classify::PlanSteep;
use crate::light::{AMBIENT, DIFFUSE, Light, SPECULAR};
use crate::prepared::Prepared;
use crate::samples::KernelVoxels;
use crate::{Error, Projection, Radiance, RenderParams};

/// Halvings of the step in which a surface was met.
pub const HALVINGS: usize = crate::cast::HALVINGS;

/// The pass that casts a ray through every pixel: linear light of a [`Sight`].
pub struct Casting;

impl Kernel for Casting {
    const NAME: &'static str = "render/cast";
    type Args<'a> = Sight<'a>;
    type Out = Radiance;
    type Error = Error;

    fn on_processor(sight: &Sight<'_>, exec: &Exec) -> Result<Radiance, Error> {
        sight.prepared.cast_all(sight.params, exec)
    }
}

/// A prepared scene and how it is looked at.
#[derive(Clone, Copy)]
pub struct Sight<'a> {
    pub(crate) prepared: &'a Prepared<'a>,
    pub(crate) params: &'a RenderParams,
}

impl<'a> Sight<'a> {
    /// The plan of its picture; where there is none, why.
    ///
    /// # Errors
    /// Says which of its looks only the processor knows.
    pub fn plan(&self) -> Result<Plan<'a>, &'static str> {
        self.prepared.plan(self.params)
    }
}

/// What a picture is made from.
pub struct Plan<'a> {
    pub(crate) camera: Camera,
    /// Differs for every prepared scene: what was made for one with this number holds for it.
    pub scene: u64,
    /// Of them come the voxels; whoever keeps something made from its voxels keeps a clone of them too, so that their address stays theirs.
    pub volume: &'a Volume,
    /// The voxels as they are sampled.
    pub voxels: PlanVoxels<'a>,
    /// Labels that choose a voxel's row of the table; without a table none.
    pub labels: Option<&'a Labels>,
    /// Distance in memory to the next voxel along each axis, 0 along an axis of one voxel.
    pub next: [usize; 3],
    /// The greatest coordinate whose whole part is a cell, and the last voxel's coordinate, along each axis.
    pub ends: [[f32; 3]; 2],
    /// Bricks of 8³ voxels along each axis.
    pub bricks: [usize; 3],
    /// For every brick 0 where it must be sampled, else `d` where every brick up to `d - 1` away along each axis may be passed over.
    pub leaps: &'a [u8],
    /// How the volume is deformed.
    pub moved: Option<PlanWarp<'a>>,
    /// The lamp.
    pub lamp: PlanLamp,
    /// What rays make of the values.
    pub look: PlanLook<'a>,
}

/// The voxels as kernels sample them; values of them are called fast.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum PlanVoxels<'a> {
    /// Bytes.
    U8(&'a [u8]),
    /// Unsigned words.
    U16(&'a [u16]),
    /// Signed words.
    I16(&'a [i16]),
    /// Numbers; where they aren't finite there is no data.
    F32(&'a [f32]),
}

/// How a volume is deformed: `before(y) = y + rows · v(y)` in voxel coordinates, v trilinear in the stored vectors.
#[derive(Clone, Copy)]
pub struct PlanWarp<'a> {
    /// The inverse displacement (mm) and the voxels that are left behind.
    pub displacement: &'a Displacement,
    /// For every brick whether its samples may come from elsewhere.
    pub moves: &'a [bool],
    /// Rows of the world-to-voxel matrix.
    pub rows: [[f32; 3]; 3],
}

/// The lamp: wrapped diffuse light and a highlight of the 32nd power.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PlanLamp {
    /// Unit vector to the lamp.
    pub lamp: [f32; 3],
    /// Unit vector half-way between lamp and eye.
    pub halfway: [f32; 3],
    /// Rows of the matrix that turns a gradient per voxel into one per mm, times the sign of the slope.
    pub to_world: [[f32; 3]; 3],
    /// Real units in one of the fast values.
    pub unit: f32,
    /// Shares of light: everywhere, by the angle, of the highlight.
    pub shares: [f32; 3],
}

/// What rays make of the values.
#[derive(Clone, Copy)]
pub enum PlanLook<'a> {
    /// Emission and absorption by a table, front to back.
    Classified {
        /// Premultiplied colour and opacity of one step, row after row.
        table: &'a [[f32; 4]],
        /// What turns a fast value into a place of a row, `(value - low) · scale + 0.5` in `0 ..= top`: low, scale, top.
        axis: [f32; 3],
        /// First entry of each label's row; empty without labels.
        row_starts: &'a [u32],
        /// The table by value and gradient, where colours go by both; `table` then only tells what is clear.
        steep: Option<PlanSteep<'a>>,
        /// Whether gradients light it.
        shaded: bool,
        /// Opacity at which a ray ends.
        termination: f32,
    },
    /// The greatest `sign · value`: as red, which [`Plan::finish`] makes grey.
    Maximum {
        /// For every brick a value that no sample in it exceeds.
        bounds: &'a [f32],
        /// −1 where what is sought falls as the fast value rises, as where the least one is, else 1.
        sign: f32,
        /// Whether bricks whose bound is no greater than what was met are passed over.
        skip: bool,
        /// What makes the greatest value grey.
        grey: Grey<'a>,
    },
    /// The first place where `sign · value` reaches `iso`, lit.
    Surface {
        /// `sign · fast` of the surface.
        iso: f32,
        /// As above.
        sign: f32,
        /// Linear RGB.
        colour: [f32; 3],
    },
}

/// What makes a greatest value grey.
#[derive(Clone, Copy)]
pub struct Grey<'a> {
    pub(crate) volume: &'a Volume,
    pub(crate) sign: f64,
    pub(crate) shift: f64,
    /// Real values that are black and white.
    pub(crate) window: [f64; 2],
}

impl Grey<'_> {
    /// Grey, in linear light, of the greatest `sign · value` of a ray.
    pub fn of(&self, greatest: f32) -> f32 {
        let [low, high] = self.window;
        let value = self.volume.real(self.sign * f64::from(greatest) + self.shift);
        let share = if high > low { ((value - low) / (high - low)).clamp(0.0, 1.0) } else { 1.0 };
        srgb::linear(share as f32)
    }
}

/// The camera's numbers, all in voxel coordinates but for lengths along the view (mm).
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PlanCamera {
    /// Where rays start: the eye, or of parallel rays the middle of their plane.
    pub start: [f64; 3],
    /// A millimetre to the picture's right.
    pub right: [f64; 3],
    /// A millimetre up.
    pub up: [f64; 3],
    /// A millimetre away from the eye.
    pub away: [f64; 3],
    /// From the eye to what it looks at (mm).
    pub distance: f64,
    /// Size of a pixel there (mm).
    pub pixel: f64,
    /// A step (mm).
    pub step: f64,
    /// Whether rays spread from the eye.
    pub perspective: bool,
}

/// The part of a ray inside the volume, in voxel coordinates: the middle of step `i` is at `start + i · delta`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PlanRay {
    /// The middle of the first step.
    pub start: [f32; 3],
    /// A step.
    pub delta: [f32; 3],
    /// Whole steps.
    pub steps: u32,
    /// The middle of what is left after them.
    pub rest_at: [f32; 3],
    /// Its length in steps, 0 for none.
    pub rest: f32,
}

impl Plan<'_> {
    /// Width and height (pixels).
    pub fn size(&self) -> [usize; 2] {
        self.camera.size()
    }

    /// Voxels along each axis.
    pub fn dims(&self) -> [usize; 3] {
        self.volume.grid().dims()
    }

    /// The camera's numbers.
    pub fn camera(&self) -> PlanCamera {
        self.camera.numbers()
    }

    /// The ray through the middle of a pixel, `None` where it misses the volume.
    pub fn ray(&self, x: usize, y: usize) -> Option<PlanRay> {
        let Ray { start, delta, steps, rest_at, rest, .. } = self.camera.ray(x, y)?;
        Some(PlanRay { start, delta, steps: steps as u32, rest_at, rest })
    }

    /// Makes of what a device gives for a pixel its premultiplied colour: what isn't a maximum stays as it is; one that met no value has
    /// opacity 0.
    pub fn finish(&self, pixel: &mut [f32; 4]) {
        if let PlanLook::Maximum { grey, .. } = self.look
            && pixel[3] > 0.0
        {
            let grey = grey.of(pixel[0]);
            *pixel = [grey, grey, grey, 1.0];
        }
    }
}

impl Camera {
    fn numbers(&self) -> PlanCamera {
        let [start, right, up, away] = self.axes().map(|v| [v.x, v.y, v.z]);
        let perspective = self.projection() == Projection::Perspective;
        let (distance, step) = (self.distance(), self.step());
        PlanCamera { start, right, up, away, distance, pixel: self.pixel_mm, step, perspective }
    }
}

impl Light {
    pub(crate) fn numbers(&self) -> PlanLamp {
        let Self { lamp, halfway, to_world, .. } = *self;
        PlanLamp { lamp, halfway, to_world, unit: self.unit(), shares: [AMBIENT, DIFFUSE, SPECULAR] }
    }
}

impl<'a> From<&'a KernelVoxels<'_>> for PlanVoxels<'a> {
    fn from(voxels: &'a KernelVoxels<'_>) -> Self {
        match voxels {
            KernelVoxels::U8(voxels) => Self::U8(voxels),
            KernelVoxels::U16(voxels) => Self::U16(voxels),
            KernelVoxels::I16(voxels) => Self::I16(voxels),
            KernelVoxels::F32(voxels) => Self::F32(voxels),
        }
    }
}
