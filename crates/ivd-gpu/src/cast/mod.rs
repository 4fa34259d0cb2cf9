//! The kernel `render/cast`.

mod look;
mod numbers;
mod resident;
pub(crate) mod state;

use std::time::{Duration, Instant};

use ivd_core::{Answer, DeviceForm, Exec, Kernel as _, parallel};
use ivd_render::Radiance;
use ivd_render::plan::{Casting, Plan, Sight};

use crate::buffers::bind;
use crate::gpu::{Count, PATIENCE, Reading};
use crate::kept::Kept;
use crate::shared::{Opened, answer};
use crate::{Error, SharedGpu, Timed};
use look::defines;
use numbers::{CAMERA_BYTES, PARAMS_BYTES, PICTURE_BYTES, Part, RAY_BYTES, TILE, camera, params, rays};
use resident::sampled;
use state::Rooms;

/// Bytes of a pixel, and of what is told of a tile.
const PIXEL_BYTES: u64 = 16;
/// In the last word of what is told of a tile, with the submission's number: that this one wrote it.
const WRITTEN: u32 = 0x01bd_5eed;
/// What a submission should take: a device that draws a desktop too doesn't stutter.
const WANTED: Duration = Duration::from_millis(8);
/// The same where nothing else waits for the device.
const SOFTWARE: Duration = Duration::from_millis(200);
/// Pixels of the first part of a picture whose speed isn't known; each of the next may have so many times as many.
const FIRST_PIXELS: usize = 1 << 14;
const GROWTH: f64 = 4.0;

/// What makes a picture.
struct Pipelines {
    cast: wgpu::ComputePipeline,
    /// Makes rays, where the device can.
    make: Option<wgpu::ComputePipeline>,
}

impl SharedGpu {
    /// Linear light of a plan's picture.
    ///
    /// # Errors
    /// As the device says the second time: one that fails is opened anew and asked once more.
    pub fn cast(&self, plan: &Plan<'_>, exec: &Exec) -> Result<Radiance, Error> {
        self.timed(plan, exec).map(|(radiance, _)| radiance)
    }

    /// The same, and what it took.
    ///
    /// # Errors
    /// As [`SharedGpu::cast`].
    pub fn timed(&self, plan: &Plan<'_>, exec: &Exec) -> Result<(Radiance, Timed), Error> {
        let start = Instant::now();
        let (mut radiance, device_ns) = self.attempt(|opened| {
            let before = opened.gpu.counters();
            let radiance = opened.cast(plan, exec)?;
            Ok((radiance, opened.gpu.counters().busy_ns - before.busy_ns))
        })?;
        let width = radiance.width;
        parallel::for_each_piece_mut(&mut radiance.rgba, width, &|_, row| {
            for pixel in row {
                plan.finish(pixel);
            }
        });
        Ok((radiance, Timed { device_ns, wall_ns: start.elapsed().as_nanos() as u64 }))
    }
}

impl DeviceForm<Casting> for SharedGpu {
    fn run(&self, sight: &Sight<'_>, exec: &Exec) -> Result<Answer<Radiance>, ivd_core::Error> {
        match sight.plan() {
            Ok(plan) => answer(Casting::NAME, self.cast(&plan, exec)),
            Err(why) => Ok(Answer::Declined(why.to_owned())),
        }
    }
}

impl Opened {
    fn cast(&mut self, plan: &Plan<'_>, exec: &Exec) -> Result<Radiance, Error> {
        let [width, height] = plan.size();
        exec.check_memory("picture", (32 * width * height) as u64)?;
        let names = defines(plan);
        Kept::bring_voxels(&mut self.volume, &self.gpu, plan.volume.voxels(), sampled(plan))?;
        self.cast.resident.bring(plan, &self.gpu)?;
        let pipelines = Pipelines {
            cast: self.pipeline("render/cast.wgsl", &names)?,
            make: if self.gpu.has("f64") { Some(self.pipeline("render/rays.wgsl", &[])?) } else { None },
        };
        let mut radiance =
            Radiance { width, height, rgba: vec![[0.0; 4]; width * height], samples: 0, skipped: 0 };
        exec.observer().begin("render", (width * height) as u64);
        let cast = self.parts(plan, names.join(" "), &pipelines, &mut radiance, exec);
        exec.observer().end("render");
        cast.map(|()| radiance)
    }

    /// Casts the rays of a picture part by part.
    fn parts(
        &mut self,
        plan: &Plan<'_>,
        key: String,
        pipelines: &Pipelines,
        radiance: &mut Radiance,
        exec: &Exec,
    ) -> Result<(), Error> {
        let fixed = self.gpu.part().map(|pixels| pixels as f64);
        let time = if self.gpu.adapter().is_software() { SOFTWARE } else { WANTED }.as_secs_f64();
        let mut wanted = match (fixed, self.cast.pace.get(&key)) {
            (Some(pixels), _) => pixels,
            (None, Some(pace)) => time / pace.max(1e-12),
            (None, None) => FIRST_PIXELS as f64,
        };
        let (mut at, mut slowest) = ([0, 0], 0.0_f64);
        while at[1] < radiance.height {
            exec.check_cancelled()?;
            let part = self.next(wanted, at, [radiance.width, radiance.height]);
            let took = self.part(plan, pipelines, part, radiance, exec).inspect_err(|error| {
                // It is tried in parts that take a fraction of what it waits.
                if matches!(error, Error::Late(_)) {
                    self.cast.pace.insert(key.clone(), PATIENCE.as_secs_f64() / part.pixels() as f64);
                }
            })?;
            slowest = slowest.max(took.as_secs_f64() / part.pixels() as f64);
            // After what was empty something may come that isn't.
            wanted = fixed.unwrap_or_else(|| (GROWTH * wanted).min(time / slowest.max(1e-12)));
            exec.observer().advance("render", part.pixels() as u64);
            at[0] += part.size[0];
            if at[0] == radiance.width {
                at = [0, at[1] + part.size[1]];
            }
        }
        self.cast.pace.insert(key, slowest);
        Ok(())
    }

    /// The part of a picture that comes next: of whole tiles, about as many pixels as are wanted, and no more than buffers hold; whole rows, or of one
    /// row of tiles some.
    fn next(&self, wanted: f64, at: [usize; 2], [width, height]: [usize; 2]) -> Part {
        let limits = self.gpu.limits();
        let most = limits.max_storage_buffer_binding_size.min(limits.max_buffer_size) / RAY_BYTES;
        let pixels = wanted.min(most as f64) as usize;
        let tiles = |pixels: usize| (pixels / TILE * TILE).max(TILE);
        let size = if at[0] == 0 && pixels >= TILE * width {
            [width, tiles(pixels / width)]
        } else {
            [tiles(pixels / TILE), TILE]
        };
        Part { first: at, size: [size[0].min(width - at[0]), size[1].min(height - at[1])] }
    }

    /// Casts the rays of a part, and says how long the device took.
    fn part(
        &mut self,
        plan: &Plan<'_>,
        pipelines: &Pipelines,
        part: Part,
        radiance: &mut Radiance,
        exec: &Exec,
    ) -> Result<Duration, Error> {
        let (pixels, tiles) = (part.pixels(), part.tiles());
        let told = tiles[0] * tiles[1];
        self.make_room(pixels, told)?;
        let Some(rooms) = &self.cast.rooms else { return Err(Error::NotWritten) };
        let gpu = &self.gpu;
        let number = gpu.counters().submissions as u32;
        gpu.write(&rooms.params, bytemuck::cast_slice(&params(plan, part, number)));
        let Pipelines { cast, make } = pipelines;
        if make.is_some() {
            let (numbers, words) = camera(plan, part);
            gpu.write(&rooms.camera, bytemuck::cast_slice(&numbers));
            gpu.write(&rooms.part, bytemuck::cast_slice(&words));
        } else {
            gpu.write(&rooms.rays, bytemuck::cast_slice(&rays(plan, part)));
        }
        let bound = self.cast.resident.bind(
            gpu,
            (cast, self.volume.as_ref()),
            &rooms.params,
            &rooms.rays,
            &rooms.picture,
        )?;
        let entries = [&rooms.camera, &rooms.part, &rooms.rays];
        let bind_rays = |make| bind(gpu, make, entries.into_iter().enumerate()).map(|group| (make, group));
        let make = make.as_ref().map(bind_rays).transpose()?;
        let bytes = PIXEL_BYTES * (pixels + told) as u64;
        let mut written = true;
        let encode = |encoder: &mut wgpu::CommandEncoder, clock: Option<&crate::timing::Clock>| {
            let mut pass = |pipeline: &wgpu::ComputePipeline,
                            group: &wgpu::BindGroup,
                            [x, y]: [usize; 2],
                            [begins, ends]: [bool; 2]| {
                let timestamp_writes = clock.and_then(|clock| clock.writes(begins, ends));
                let mut pass = encoder
                    .begin_compute_pass(&wgpu::ComputePassDescriptor { label: None, timestamp_writes });
                pass.set_pipeline(pipeline);
                pass.set_bind_group(0, group, &[]);
                pass.dispatch_workgroups(x as u32, y as u32, 1);
                Count::add(&gpu.count.dispatches, 1);
            };
            if let Some((make, group)) = &make {
                let groups = pixels.div_ceil(64);
                let across = groups.min(65_535);
                pass(make, group, [across, groups.div_ceil(across)], [true, false]);
            }
            pass(cast, &bound, tiles, [make.is_none(), true]);
            true
        };
        let result =
            Some(Reading { from: vec![(&rooms.picture.buffer, 0, bytes)], to: &rooms.result.buffer });
        let took = gpu.submit("rays", exec, encode, result, |read| {
            let (light, tail) = read.split_at(pixels * PIXEL_BYTES as usize);
            for (j, row) in light.chunks_exact(part.size[0] * PIXEL_BYTES as usize).enumerate() {
                let first = part.first[0] + radiance.width * (part.first[1] + j);
                bytemuck::cast_slice_mut(&mut radiance.rgba[first..][..part.size[0]]).copy_from_slice(row);
            }
            for tile in tail.chunks_exact(PIXEL_BYTES as usize) {
                let [taken, skipped, _, mark]: [u32; 4] = bytemuck::pod_read_unaligned(tile);
                written &= mark == WRITTEN ^ number;
                radiance.samples += u64::from(taken);
                radiance.skipped += u64::from(skipped);
            }
        })?;
        if written { Ok(took) } else { Err(Error::NotWritten) }
    }

    /// Room for a part of so many pixels in so many tiles; grows only.
    fn make_room(&mut self, mut pixels: usize, mut tiles: usize) -> Result<(), Error> {
        if let Some(rooms) = &self.cast.rooms {
            if rooms.pixels >= pixels && rooms.tiles >= tiles {
                return Ok(());
            }
            (pixels, tiles) = (pixels.max(rooms.pixels), tiles.max(rooms.tiles));
        }
        self.cast.rooms = None;
        let gpu = &self.gpu;
        let storage = wgpu::BufferUsages::STORAGE | wgpu::BufferUsages::COPY_DST;
        let picture = PIXEL_BYTES * (pixels + tiles) as u64;
        self.cast.rooms = Some(Rooms {
            pixels,
            tiles,
            params: gpu.room(
                "parameters",
                PARAMS_BYTES,
                wgpu::BufferUsages::UNIFORM | wgpu::BufferUsages::COPY_DST,
            )?,
            camera: gpu.room("camera", CAMERA_BYTES, storage)?,
            part: gpu.room("part of the picture", PICTURE_BYTES, storage)?,
            rays: gpu.room("rays", RAY_BYTES * pixels as u64, storage)?,
            picture: gpu.room("picture", picture, storage | wgpu::BufferUsages::COPY_SRC)?,
            result: gpu.room(
                "read picture",
                picture,
                wgpu::BufferUsages::MAP_READ | wgpu::BufferUsages::COPY_DST,
            )?,
        });
        Ok(())
    }
}
