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
    /// Pixels with one of more than 2e-6.
    pub(crate) beyond: usize,
    pixels: usize,
}

pub(crate) fn apart(Processor(a): &Processor, Device(b): &Device) -> Apart {
    assert_eq!((a.width, a.height), (b.width, b.height));
    let mut apart = Apart { pixels: a.rgba.len(), ..Apart::default() };
    for (p, q) in a.rgba.iter().zip(&b.rgba) {
        let far = (0..4).map(|c| (p[c] - q[c]).abs()).fold(0.0, f32::max);
        assert!(q.iter().all(|c| c.is_finite()));
        apart.worst = apart.worst.max(far);
        apart.beyond += usize::from(far > 2e-6);
    }
    apart
}

impl Apart {
    /// Whether the pictures are close: within 2e-6 of linear light but for a pixel or so, whose ray is rounded the other way and meets a hard edge
    /// sooner or later; a device that computes as IEEE says in every operation, as software does, has none.
    pub(crate) fn is_close(&self, exec: &Exec) -> bool {
        if exec.device.as_ref().is_some_and(|device| device.name().contains("llvmpipe")) {
            return self.worst < 1e-6;
        }
        self.beyond <= 1.max(self.pixels / 100_000) && self.worst < 1e-2
    }
}
