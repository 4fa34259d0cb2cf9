use crate::{Error, Gpu};

/// What a pass took.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Timed {
    /// By the device's own clock (ns); 0 where it has none.
    pub device_ns: u64,
    /// On the wall, with everything that crossed (ns).
    pub wall_ns: u64,
}

/// The device's clock: when the first kernel of a submission began and the last one ended.
pub(crate) struct Clock {
    queries: wgpu::QuerySet,
    resolved: wgpu::Buffer,
    read: wgpu::Buffer,
    /// Of a tick (ns).
    period: f64,
}

impl Clock {
    const BYTES: u64 = 16;

    pub(crate) fn new(device: &wgpu::Device, queue: &wgpu::Queue) -> Self {
        let buffer = |usage| {
            let usage = usage | wgpu::BufferUsages::COPY_DST;
            let descriptor =
                wgpu::BufferDescriptor { label: None, size: Self::BYTES, usage, mapped_at_creation: false };
            device.create_buffer(&descriptor)
        };
        Self {
            queries: device.create_query_set(&wgpu::QuerySetDescriptor {
                label: None,
                ty: wgpu::QueryType::Timestamp,
                count: 2,
            }),
            resolved: buffer(wgpu::BufferUsages::QUERY_RESOLVE | wgpu::BufferUsages::COPY_SRC),
            read: buffer(wgpu::BufferUsages::MAP_READ),
            period: f64::from(queue.get_timestamp_period()),
        }
    }

    /// What a pass that begins, ends, or both, writes.
    pub(crate) fn writes(&self, begins: bool, ends: bool) -> Option<wgpu::ComputePassTimestampWrites<'_>> {
        (begins || ends).then_some(wgpu::ComputePassTimestampWrites {
            query_set: &self.queries,
            beginning_of_pass_write_index: begins.then_some(0),
            end_of_pass_write_index: ends.then_some(1),
        })
    }

    pub(crate) fn resolve(&self, encoder: &mut wgpu::CommandEncoder) {
        encoder.resolve_query_set(&self.queries, 0..2, &self.resolved, 0);
        encoder.copy_buffer_to_buffer(&self.resolved, 0, &self.read, 0, Self::BYTES);
    }

    /// Time between the two (ns).
    pub(crate) fn read(&self, gpu: &Gpu) -> Result<u64, Error> {
        let answer = gpu.map(&self.read, Self::BYTES)?;
        let waited = gpu.device.poll(wgpu::PollType::wait_indefinitely());
        gpu.check()?;
        waited.map_err(|error| Error::Refused(error.to_string()))?;
        if !matches!(answer.lock().map(|mut answer| answer.take()), Ok(Some(Ok(())))) {
            return Err(Error::Lost("its clock can't be read".to_owned()));
        }
        let view = self.read.slice(..).get_mapped_range();
        let view = view.map_err(|error| Error::Refused(error.to_string()))?;
        let ticks: [u64; 2] = bytemuck::pod_read_unaligned(&view[..]);
        drop(view);
        self.read.unmap();
        Ok((ticks[1].saturating_sub(ticks[0]) as f64 * self.period) as u64)
    }
}
