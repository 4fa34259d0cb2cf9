//! Passes over data, and what is read after them.

use ivd_core::Exec;

use crate::buffers::Room;
use crate::gpu::{Count, Reading};
use crate::timing::Clock;
use crate::{Error, Gpu};

/// Words that are told: one of each pass of a submission, and one that says which submission.
const TOLD: usize = 64;
const MOST: usize = TOLD - 1;
/// Bytes between the numbers of one pass and the next: where a binding may begin.
const STRIDE: u64 = 256;
/// Workgroups along an axis.
const ACROSS: usize = 65_535;

/// One dispatch.
pub(crate) struct Pass<'a> {
    pub(crate) pipeline: &'a wgpu::ComputePipeline,
    /// The shader's parameters after the first, which is the pass's number.
    pub(crate) numbers: Vec<u32>,
    /// Its buffers, from binding 2 on.
    pub(crate) rooms: Vec<&'a Room>,
    pub(crate) groups: usize,
}

impl Pass<'_> {
    /// Workgroups along two axes, at most so many along the first; a few more than are asked for where those are many.
    fn size(&self, most: usize) -> [usize; 2] {
        let down = self.groups.div_ceil(most).max(1);
        [self.groups.div_ceil(down).max(1), down]
    }
}

/// Part of a buffer that is read.
pub(crate) struct Part<'a> {
    pub(crate) room: &'a Room,
    pub(crate) from: u64,
    pub(crate) bytes: u64,
}

/// What all passes need: their numbers, where they tell that they ran, and where results are read.
#[derive(Default)]
pub(crate) struct Desk {
    numbers: Option<Room>,
    told: Option<Room>,
    read: Option<Room>,
}

impl Desk {
    /// Makes passes, one after the other, and hands over the parts that are read, one after the other.
    pub(crate) fn make(
        &mut self,
        gpu: &Gpu,
        what: &'static str,
        passes: &[Pass<'_>],
        parts: &[Part<'_>],
        exec: &Exec,
        read: impl FnOnce(&[u8]),
    ) -> Result<(), Error> {
        exec.check_cancelled()?;
        assert!(passes.len() <= MOST, "more passes than a desk has room for");
        let storage = wgpu::BufferUsages::STORAGE | wgpu::BufferUsages::COPY_DST;
        let numbers = had(&mut self.numbers, || gpu.room("parameters", STRIDE * MOST as u64, storage))?;
        let told = had(&mut self.told, || {
            gpu.room("what passes tell", 4 * TOLD as u64, storage | wgpu::BufferUsages::COPY_SRC)
        })?;
        let mut words = vec![0_u32; STRIDE as usize / 4 * passes.len()];
        let mut bound = Vec::with_capacity(passes.len());
        let across_most = gpu.across().unwrap_or(ACROSS);
        for (i, pass) in passes.iter().enumerate() {
            let own = &mut words[STRIDE as usize / 4 * i..][..=pass.numbers.len()];
            own[0] = i as u32;
            own[1..].copy_from_slice(&pass.numbers);
            bound.push(bind(gpu, pass, i, numbers, told)?);
        }
        gpu.write(numbers, bytemuck::cast_slice(&words));
        let mut cleared = [0_u32; TOLD];
        cleared[MOST] = !(gpu.counters().submissions as u32);
        gpu.write(told, bytemuck::cast_slice(&cleared));

        let tells = Part { room: told, from: 0, bytes: 4 * TOLD as u64 };
        let all: Vec<&Part<'_>> = std::iter::once(&tells).chain(parts).collect();
        let bytes: u64 = all.iter().map(|part| part.bytes).sum();
        if self.read.as_ref().is_none_or(|room| room.bytes < bytes) {
            self.read = None;
        }
        let to = had(&mut self.read, || {
            gpu.room("results", bytes, wgpu::BufferUsages::MAP_READ | wgpu::BufferUsages::COPY_DST)
        })?;
        let encode = |encoder: &mut wgpu::CommandEncoder, clock: Option<&Clock>| {
            for (i, (pass, group)) in passes.iter().zip(&bound).enumerate() {
                let timestamp_writes = clock.and_then(|clock| clock.writes(i == 0, i + 1 == passes.len()));
                let descriptor = wgpu::ComputePassDescriptor { label: None, timestamp_writes };
                let mut encoded = encoder.begin_compute_pass(&descriptor);
                encoded.set_pipeline(pass.pipeline);
                encoded.set_bind_group(0, group, &[]);
                let [across, down] = pass.size(across_most);
                encoded.dispatch_workgroups(across as u32, down as u32, 1);
                Count::add(&gpu.count.dispatches, 1);
            }
            !passes.is_empty()
        };
        let from = all.iter().map(|part| (&part.room.buffer, part.from, part.bytes)).collect();
        let mut written = true;
        gpu.submit(what, exec, encode, Some(Reading { from, to: &to.buffer }), |bytes| {
            let (tells, results) = bytes.split_at(4 * TOLD);
            let tells: [u32; TOLD] = bytemuck::pod_read_unaligned(tells);
            written = tells[MOST] == cleared[MOST];
            for (pass, told) in passes.iter().zip(tells) {
                let [across, down] = pass.size(across_most);
                written &= told as usize == across * down;
            }
            if written {
                read(results);
            }
        })?;
        if written { Ok(()) } else { Err(Error::NotWritten) }
    }
}

/// What is there, made where it isn't yet.
fn had(slot: &mut Option<Room>, make: impl FnOnce() -> Result<Room, Error>) -> Result<&Room, Error> {
    if slot.is_none() {
        *slot = Some(make()?);
    }
    slot.as_ref().ok_or(Error::NotWritten)
}

fn bind(
    gpu: &Gpu,
    pass: &Pass<'_>,
    number: usize,
    numbers: &Room,
    told: &Room,
) -> Result<wgpu::BindGroup, Error> {
    let own = wgpu::BufferBinding {
        buffer: &numbers.buffer,
        offset: STRIDE * number as u64,
        size: std::num::NonZeroU64::new(STRIDE),
    };
    let own = wgpu::BindGroupEntry { binding: 0, resource: wgpu::BindingResource::Buffer(own) };
    let rooms = std::iter::once(told).chain(pass.rooms.iter().copied()).enumerate();
    let rooms = rooms.map(|(i, room)| wgpu::BindGroupEntry {
        binding: 1 + i as u32,
        resource: room.buffer.as_entire_binding(),
    });
    let entries: Vec<wgpu::BindGroupEntry<'_>> = std::iter::once(own).chain(rooms).collect();
    gpu.bind(pass.pipeline, &entries)
}
