//! Passes of IVD on graphics processors, through wgpu: Vulkan, Metal and Direct3D 12.
//!
//! [`Gpu::open`] opens an adapter, or says in words why there is none; [`device`] makes of it what an [`ivd_core::Exec`] takes as its
//! `device`: the forms of those kernels that are known here ([`KERNELS`]). Every other pass runs on the CPU, and the record of a run says which
//! ran where. Kernels hold one of these promises against the processor:
//!
//! - **equal**: the same bytes on every device (whole numbers, comparisons, and sums of doubles in which no driver fuses a multiplication with an addition);
//! - **close**: within a tolerance that the suite holds; such results have a cache key of their own, one for all devices.
//!
//! | kernel | promise |
//! |---|---|
//! | `volume/ranges`: least and greatest value of each brick | equal |
//! | `segment/histogram`: how often each value of 8 or 16 bits occurs | equal |
//! | `segment/label`: labels by value | equal |
//! | `lattice/cut`: marching cubes; the processor decides the cells that signs leave open, and puts the vertices in their places | equal |
//! | `warp/linear`: voxels that move, trilinearly; the processor makes those that need more than eight voxels of data | equal, on devices with numbers of 64 bits; others leave it |
//! | `render/cast`: rays of direct volume rendering, maximum and first hit; labelled, shaded, by gradient, deformed | close: 2e-6 of linear light, but for pixels, one in 10⁵, whose ray is rounded the other way and meets a hard edge |
//!
//! All kernels give the same bytes from run to run on one device and driver. Nothing is read back that wasn't written: every result ends in status
//! words that show whether it is complete, a device that fails is opened again once, and what fails twice is an error that names the pass. What doesn't fit into a device's memory is done
//! by the CPU.
//!
//! Shaders lie in the workspace's folder `shaders`, a file for each kernel, and are put together here ([`shader`]).

mod adapter;
mod buffers;
mod cast;
mod cut;
mod error;
mod gpu;
mod kept;
mod pass;
mod segment;
pub mod shader;
mod shared;
mod stored;
mod timing;
mod volume;
mod warp;

pub use adapter::{Adapter, Choice, OpenError, adapters};
pub use error::Error;
pub use gpu::{Counters, Fault, Gpu, Meter, Options};
pub use shared::SharedGpu;
pub use timing::Timed;

use ivd_core::{BrickRanges, Device, Kernel as _};
use ivd_field::warp::plan::Warping;
use ivd_lattice::extract::plan::Cutting;
use ivd_render::plan::Casting;
use ivd_segment::plan::{Counting, Labelling};

/// The kernels of which there is a form here.
pub const KERNELS: &[&str] =
    &[BrickRanges::NAME, Counting::NAME, Labelling::NAME, Cutting::NAME, Warping::<u8>::NAME, Casting::NAME];

/// An opened adapter as the device of an [`ivd_core::Exec`].
pub fn device(gpu: Gpu) -> Device {
    let name = gpu.adapter().name.clone();
    let gpu = SharedGpu::new(gpu);
    Device::new(name)
        .with::<BrickRanges>(gpu.clone())
        .with::<Counting>(gpu.clone())
        .with::<Labelling>(gpu.clone())
        .with::<Cutting>(gpu.clone())
        .with::<Warping<u8>>(gpu.clone())
        .with::<Warping<i8>>(gpu.clone())
        .with::<Warping<u16>>(gpu.clone())
        .with::<Warping<i16>>(gpu.clone())
        .with::<Warping<f32>>(gpu.clone())
        .with::<Casting>(gpu)
}
