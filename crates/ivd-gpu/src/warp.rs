//! The kernel `warp/linear`.

use bytemuck::Pod;
use ivd_core::{Answer, DeviceForm, Exec, Kernel as _, NO_BRICK, Scalar};
use ivd_field::warp::plan::{Made, Moving, Warping};

use crate::pass::{Part, Pass};
use crate::shared::{Opened, RESULT, answer};
use crate::{Error, SharedGpu};

/// Voxels of a brick.
const VOXELS: usize = 512;
/// Bytes of marks of a brick.
const MARKS: usize = VOXELS / 8;
/// Bricks that are read at once, at most.
const READ_BRICKS: usize = 1 << 14;

impl<T: Scalar + Pod> DeviceForm<Warping<T>> for SharedGpu {
    fn run(&self, args: &Moving<'_, T>, exec: &Exec) -> Result<Answer<(Vec<T>, u64)>, ivd_core::Error> {
        let made = self.attempt(|opened| opened.warp(args, exec));
        // The processor's share, once the device is free.
        answer(Warping::<T>::NAME, made.and_then(|made| Ok(args.finish(&made, exec)?)))
    }
}

impl Opened {
    fn warp<T: Scalar + Pod>(&mut self, args: &Moving<'_, T>, exec: &Exec) -> Result<Made<T>, Error> {
        if !(self.gpu.has("f64") && self.gpu.has("int64")) {
            return Err(Error::Lacks("numbers of 64 bits"));
        }
        let field = args.displacement.inverse();
        let mut places = vec![0_u32; field.buffer().len() / VOXELS];
        for (brick, slot) in field.table().iter().enumerate().filter(|(_, slot)| **slot != NO_BRICK) {
            places[*slot as usize] = brick as u32;
        }
        let brick_bytes = VOXELS * T::TYPE.bytes() + MARKS;
        exec.check_memory(
            "the voxels that move",
            (args.voxels.as_bytes().len() + places.len() * brick_bytes) as u64,
        )?;
        let mut made = Made {
            values: Vec::with_capacity(VOXELS * places.len()),
            left: Vec::with_capacity(MARKS * places.len()),
        };
        if places.is_empty() {
            return Ok(made);
        }
        let names = self.bring_stored(args.voxels)?;
        let pipeline = self.pipeline("warp/linear.wgsl", &names)?;
        let numbers: Vec<f64> = args.to_voxel.as_flattened().iter().chain(&args.most).copied().collect();
        let numbers = self.gpu.upload("the matrix", bytemuck::cast_slice(&numbers))?;
        let slots = self.gpu.upload("the bricks that move", bytemuck::cast_slice(&places))?;
        self.cast.resident.bring_vectors(&self.gpu, args.displacement)?;
        let most = self.gpu.part().unwrap_or(READ_BRICKS).min(places.len()).max(1);
        let moved = self.gpu.room("the voxels that move", (most * brick_bytes) as u64, RESULT)?;
        let [nx, ny, nz] = args.displacement.grid().dims();
        let [across, down, _] = field.brick_dims();
        for first in (0..places.len()).step_by(most) {
            let bricks = most.min(places.len() - first);
            let volume = self.volume.iter().map(|kept| &kept.room);
            let vectors = self.cast.resident.vectors().into_iter();
            let pass = Pass {
                pipeline: &pipeline,
                numbers: [nx, ny, nz, across, down, first, bricks, 0].map(|n| n as u32).to_vec(),
                rooms: volume.chain([&numbers, &slots]).chain(vectors).chain([&moved]).collect(),
                groups: 2 * bricks,
            };
            let part = Part { room: &moved, from: 0, bytes: (bricks * brick_bytes) as u64 };
            self.desk.make(&self.gpu, "voxels that move", &[pass], &[part], exec, |read| {
                for brick in read.chunks_exact(brick_bytes) {
                    let (values, marks) = brick.split_at(brick_bytes - MARKS);
                    made.values
                        .extend(values.chunks_exact(size_of::<T>()).map(bytemuck::pod_read_unaligned::<T>));
                    made.left.extend(marks);
                }
            })?;
        }
        Ok(made)
    }
}
