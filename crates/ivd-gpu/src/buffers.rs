use ivd_core::Exec;

use crate::gpu::Count;
use crate::{Error, Gpu};

/// A buffer of the device, counted as long as it is held.
pub(crate) struct Room {
    pub(crate) buffer: wgpu::Buffer,
    pub(crate) bytes: u64,
    count: std::sync::Arc<Count>,
}

impl Drop for Room {
    fn drop(&mut self) {
        // Others may still be looking at it; wgpu waits for them.
        self.buffer.destroy();
        self.count.held.fetch_sub(self.bytes, std::sync::atomic::Ordering::Relaxed);
    }
}

impl Gpu {
    /// Room for so many bytes.
    pub(crate) fn room(
        &self,
        what: &'static str,
        bytes: u64,
        usage: wgpu::BufferUsages,
    ) -> Result<Room, Error> {
        self.allocate(what, bytes, usage, false)
    }

    /// Bytes on the device; filled up to whole words.
    pub(crate) fn upload(&self, what: &'static str, data: &[u8]) -> Result<Room, Error> {
        let room = self.allocate(what, data.len() as u64, wgpu::BufferUsages::STORAGE, true)?;
        self.checked(what, room.bytes, || {
            let mut view = room
                .buffer
                .slice(..)
                .get_mapped_range_mut()
                .map_err(|error| Error::Refused(error.to_string()))?;
            view.slice(..data.len()).copy_from_slice(data);
            drop(view);
            room.buffer.unmap();
            Ok::<(), Error>(())
        })??;
        Count::add(&self.count.uploaded, data.len() as u64);
        Ok(room)
    }

    /// Binds buffers to a pipeline's places.
    pub(crate) fn bind(
        &self,
        pipeline: &wgpu::ComputePipeline,
        entries: &[wgpu::BindGroupEntry<'_>],
    ) -> Result<wgpu::BindGroup, Error> {
        self.checked("buffers of a kernel", 0, || {
            let layout = pipeline.get_bind_group_layout(0);
            let descriptor = wgpu::BindGroupDescriptor { label: None, layout: &layout, entries };
            self.device.create_bind_group(&descriptor)
        })
    }

    /// Bytes into what lies on the device already.
    pub(crate) fn write(&self, room: &Room, data: &[u8]) {
        self.queue.write_buffer(&room.buffer, 0, data);
        Count::add(&self.count.uploaded, data.len() as u64);
    }

    /// Bytes read and written in a second where a buffer of so many bytes is copied: what a pass can be held against.
    ///
    /// # Errors
    /// As the device says.
    pub fn copy_bandwidth(&self, bytes: u64) -> Result<f64, Error> {
        const COPIES: u32 = 200;
        let usage = wgpu::BufferUsages::COPY_SRC | wgpu::BufferUsages::COPY_DST;
        let bytes = bytes.min(self.limits().max_buffer_size).next_multiple_of(4);
        let (from, to) = (self.room("a copy", bytes, usage)?, self.room("a copy", bytes, usage)?);
        let copy = |encoder: &mut wgpu::CommandEncoder| {
            for _ in 0..COPIES {
                encoder.copy_buffer_to_buffer(&from.buffer, 0, &to.buffer, 0, bytes);
            }
            false
        };
        let mut best = f64::INFINITY;
        for _ in 0..3 {
            let start = std::time::Instant::now();
            self.submit("copies", &Exec::default(), |encoder, _| copy(encoder), None, |_| {})?;
            best = best.min(start.elapsed().as_secs_f64());
        }
        Ok(2.0 * bytes as f64 * f64::from(COPIES) / best)
    }

    fn allocate(
        &self,
        what: &'static str,
        bytes: u64,
        usage: wgpu::BufferUsages,
        mapped_at_creation: bool,
    ) -> Result<Room, Error> {
        // Whole words; four at least, as many as a kernel takes at once.
        let bytes = bytes.next_multiple_of(4).max(16);
        let limits = self.limits();
        let most = if usage.contains(wgpu::BufferUsages::STORAGE) {
            limits.max_buffer_size.min(limits.max_storage_buffer_binding_size)
        } else {
            limits.max_buffer_size
        };
        self.event(what, bytes)?;
        if bytes > most {
            return Err(Error::TooLarge { what, bytes });
        }
        let descriptor = wgpu::BufferDescriptor { label: Some(what), size: bytes, usage, mapped_at_creation };
        let buffer = self.checked(what, bytes, || self.device.create_buffer(&descriptor))?;
        Count::add(&self.count.held, bytes);
        Ok(Room { buffer, bytes, count: self.count.clone() })
    }
}

/// Binds buffers to a pipeline's places.
pub(crate) fn bind<'a>(
    gpu: &Gpu,
    pipeline: &wgpu::ComputePipeline,
    rooms: impl Iterator<Item = (usize, &'a Room)>,
) -> Result<wgpu::BindGroup, Error> {
    let entries: Vec<wgpu::BindGroupEntry<'_>> = rooms
        .map(|(binding, room)| wgpu::BindGroupEntry {
            binding: binding as u32,
            resource: room.buffer.as_entire_binding(),
        })
        .collect();
    gpu.bind(pipeline, &entries)
}
