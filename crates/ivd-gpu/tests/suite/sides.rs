//! The two sides of a comparison: types that only a run can make, so that no test compares the processor with itself.

use std::sync::Arc;

use ivd_core::{Exec, Kernel as _, Served};
use ivd_gpu::{Gpu, device};
use ivd_render::plan::Casting;
use ivd_render::{Prepared, Radiance, RenderParams, Scene};

/// What the processor made.
pub(crate) struct Processor(pub(crate) Radiance);
/// What a device made.
pub(crate) struct Device(pub(crate) Radiance);

/// A picture by the processor.
pub(crate) fn by_processor(scene: &Scene<'_>, params: &RenderParams) -> Processor {
    let exec = Exec::default();
    let made = Prepared::new(scene, params, &exec).unwrap().radiance(params.view, &exec).unwrap();
    assert_eq!(exec.take_served()[Casting::NAME], Served { cpu: 1, gpu: 0 });
    Processor(made)
}

/// Work on a device.
pub(crate) fn on(gpu: Gpu) -> Exec {
    Exec::default().with_device(Arc::new(device(gpu)))
}

/// A picture by the device, which must have made it.
pub(crate) fn by_device(scene: &Scene<'_>, params: &RenderParams, exec: &Exec) -> Device {
    exec.take_served();
    let made = Prepared::new(scene, params, exec).unwrap().radiance(params.view, exec).unwrap();
    assert_eq!(exec.take_served()[Casting::NAME], Served { cpu: 0, gpu: 1 });
    Device(made)
}

/// How far two pictures are apart.
#[derive(Debug, Clone, Copy, Default)]
pub(crate) struct Apart {
    /// Greatest difference of a channel, in linear light.
    pub(crate) worst: f32,
    /// Shares of the pixels with one of more than 1e-6, 1e-4 and 1/255.
    pub(crate) beyond: [f64; 3],
    /// Share of the pixels that are the same to the bit.
    pub(crate) equal: f64,
}

pub(crate) fn apart(Processor(a): &Processor, Device(b): &Device) -> Apart {
    assert_eq!((a.width, a.height), (b.width, b.height));
    let mut apart = Apart::default();
    let share = 1.0 / a.rgba.len() as f64;
    for (p, q) in a.rgba.iter().zip(&b.rgba) {
        let far = (0..4).map(|c| (p[c] - q[c]).abs()).fold(0.0, f32::max);
        assert!(q.iter().all(|c| c.is_finite()));
        apart.worst = apart.worst.max(far);
        for (beyond, least) in apart.beyond.iter_mut().zip([1e-6, 1e-4, 1.0 / 255.0]) {
            *beyond += if far > least { share } else { 0.0 };
        }
        apart.equal += if p.map(f32::to_bits) == q.map(f32::to_bits) { share } else { 0.0 };
    }
    apart
}

impl Apart {
    /// Whether the pictures are close: a device that computes as IEEE says, as software does, is within 1e-6; one that joins a product and
    /// a sum takes its samples some 1e-5 voxels off, so that where the table or the surface is steep single pixels are further.
    pub(crate) fn is_close(&self, exec: &Exec) -> bool {
        if exec.device.as_ref().is_some_and(|device| device.name().contains("llvmpipe")) {
            return self.worst < 1e-6;
        }
        self.worst < 1e-2 && self.beyond[1] < 1e-2 && self.beyond[2] < 1e-3
    }
}
