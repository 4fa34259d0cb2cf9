//! The kernel `render/cast`.

mod look;
mod numbers;
mod resident;

use std::collections::HashMap;
use std::sync::{Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

use ivd_core::{Answer, DeviceForm, Exec, Kernel as _, parallel};
use ivd_render::Radiance;
use ivd_render::plan::{Casting, Plan, Sight};

use crate::buffers::Room;
use crate::gpu::{Count, PATIENCE};
use crate::shader::assemble;
use crate::{Counters, Error, Gpu, Timed};
use look::defines;
use numbers::{CAMERA_BYTES, PARAMS_BYTES, PICTURE_BYTES, Part, RAY_BYTES, camera, params, rays};
use resident::Resident;

/// Pixels along a tile's edge: a workgroup.
const TILE: usize = 8;
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

/// Casts rays on a device, and keeps there what pictures have in common: the last volume, labels and displacement, with clones of them in memory.
pub struct Caster(Mutex<State>);

struct State {
    gpu: Gpu,
    pipelines: HashMap<String, wgpu::ComputePipeline>,
    resident: Resident,
    rooms: Option<Rooms>,
    /// Of each kind of picture, time of a pixel [s] in its slowest part when one was last made.
    pace: HashMap<String, f64>,
    /// The kind and the pixels of the part that was last asked for.
    trying: Option<(String, usize)>,
}

/// What makes a picture.
struct Pipelines {
    cast: wgpu::ComputePipeline,
    /// Makes rays, where the device can.
    make: Option<wgpu::ComputePipeline>,
}

/// What a part of a picture needs.
struct Rooms {
    pixels: usize,
    tiles: usize,
    params: Room,
    camera: Room,
    part: Room,
    rays: Room,
    picture: Room,
    result: Room,
}

impl Caster {
    /// A caster on an opened device.
    pub fn new(gpu: Gpu) -> Self {
        Self(Mutex::new(State {
            gpu,
            pipelines: HashMap::new(),
            resident: Resident::default(),
            rooms: None,
            pace: HashMap::new(),
            trying: None,
        }))
    }

    /// What has been done on the device.
    pub fn counters(&self) -> Counters {
        self.lock().gpu.counters()
    }

    fn lock(&self) -> MutexGuard<'_, State> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Linear light of a plan's picture. A device that fails is opened anew and asked once more; where it has no room, what it keeps is let
    /// go first.
    ///
    /// # Errors
    /// As the device says the second time.
    pub fn cast(&self, plan: &Plan<'_>, exec: &Exec) -> Result<Radiance, Error> {
        self.timed(plan, exec).map(|(radiance, _)| radiance)
    }

    /// The same, and what it took.
    ///
    /// # Errors
    /// As [`Caster::cast`].
    pub fn timed(&self, plan: &Plan<'_>, exec: &Exec) -> Result<(Radiance, Timed), Error> {
        let start = Instant::now();
        // While the lock is held no work is shared out to threads: one of them could come back for another picture, and wait for itself.
        let mut state = self.lock();
        let before = state.gpu.counters();
        let mut radiance = match state.cast(plan, exec) {
            Ok(radiance) => radiance,
            Err(error) => state.once_more(error, plan, exec)?,
        };
        let device_ns = state.gpu.counters().busy_ns - before.busy_ns;
        drop(state);
        let width = radiance.width;
        parallel::for_each_piece_mut(&mut radiance.rgba, width, &|_, row| {
            for pixel in row {
                plan.finish(pixel);
            }
        });
        Ok((radiance, Timed { device_ns, wall_ns: start.elapsed().as_nanos() as u64 }))
    }
}

impl DeviceForm<Casting> for Caster {
    fn run(&self, sight: &Sight<'_>, exec: &Exec) -> Result<Answer<Radiance>, ivd_core::Error> {
        let plan = match sight.plan() {
            Ok(plan) => plan,
            Err(why) => return Ok(Answer::Declined(why.to_owned())),
        };
        match self.cast(&plan, exec) {
            Ok(radiance) => Ok(Answer::Done(radiance)),
            Err(Error::Core(error)) => Err(error),
            Err(error @ Error::NoRoom { .. }) => Ok(Answer::Declined(error.to_string())),
            Err(error) => Err(ivd_core::Error::Device { kernel: Casting::NAME, problem: error.to_string() }),
        }
    }
}

impl State {
    /// Lets go of everything on the device.
    fn forget(&mut self) {
        self.pipelines.clear();
        self.resident = Resident::default();
        self.rooms = None;
    }

    /// After a failure: lets go of everything, opens the device anew where it is to blame, and casts again.
    fn once_more(&mut self, error: Error, plan: &Plan<'_>, exec: &Exec) -> Result<Radiance, Error> {
        self.forget();
        match error {
            // Of what was going on when it was cancelled nothing is looked at any more.
            Error::Core(error) => return Err(error.into()),
            Error::NoRoom { .. } => {}
            _ => {
                let late = matches!(error, Error::Late(_));
                if let (true, Some((key, pixels))) = (late, self.trying.take()) {
                    self.pace.insert(key, PATIENCE.as_secs_f64() / pixels as f64);
                }
                let anew = self.gpu.reopen().map_err(|_| error.clone())?;
                let old = std::mem::replace(&mut self.gpu, anew);
                if late {
                    // Who lets go of a device waits for it, and this one doesn't answer.
                    std::mem::forget(old);
                }
            }
        }
        tracing::warn!(%error, "the GPU failed, and is asked once more");
        self.cast(plan, exec)
    }

    fn cast(&mut self, plan: &Plan<'_>, exec: &Exec) -> Result<Radiance, Error> {
        let [width, height] = plan.size();
        exec.check_memory("picture", (32 * width * height) as u64)?;
        let names = defines(plan);
        self.resident.bring(plan, &self.gpu)?;
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
        let mut wanted = match (fixed, self.pace.get(&key)) {
            (Some(pixels), _) => pixels,
            (None, Some(pace)) => time / pace.max(1e-12),
            (None, None) => FIRST_PIXELS as f64,
        };
        let (mut at, mut slowest) = ([0, 0], 0.0_f64);
        while at[1] < radiance.height {
            exec.check_cancelled()?;
            let part = self.next(wanted, at, [radiance.width, radiance.height]);
            self.trying = Some((key.clone(), part.pixels()));
            let took = self.part(plan, pipelines, part, radiance, exec)?;
            slowest = slowest.max(took.as_secs_f64() / part.pixels() as f64);
            // After what was empty something may come that isn't.
            wanted = fixed.unwrap_or_else(|| (GROWTH * wanted).min(time / slowest.max(1e-12)));
            exec.observer().advance("render", part.pixels() as u64);
            at[0] += part.size[0];
            if at[0] == radiance.width {
                at = [0, at[1] + part.size[1]];
            }
        }
        self.pace.insert(key, slowest);
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

    /// The pipeline of a shader, made where it isn't yet.
    fn pipeline(&mut self, file: &'static str, names: &[&str]) -> Result<wgpu::ComputePipeline, Error> {
        let key = format!("{file} {}", names.join(" "));
        if let Some(made) = self.pipelines.get(&key) {
            return Ok(made.clone());
        }
        let start = Instant::now();
        let shader = assemble(file, names).map_err(Error::Refused)?;
        let text = self.gpu.planted(&shader.text);
        let pipeline = self.gpu.checked(file, 0, || {
            let device = &self.gpu.device;
            let module = device.create_shader_module(wgpu::ShaderModuleDescriptor {
                label: Some(file),
                source: wgpu::ShaderSource::Wgsl(text.as_str().into()),
            });
            device.create_compute_pipeline(&wgpu::ComputePipelineDescriptor {
                label: Some(file),
                layout: None,
                module: &module,
                entry_point: Some("main"),
                compilation_options: wgpu::PipelineCompilationOptions::default(),
                cache: None,
            })
        })?;
        tracing::debug!(key, ms = start.elapsed().as_millis() as u64, "pipeline made");
        self.pipelines.insert(key, pipeline.clone());
        Ok(pipeline)
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
        let Some(rooms) = &self.rooms else { return Err(Error::NotWritten) };
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
        let bound = self.resident.bind(gpu, cast, &rooms.params, &rooms.rays, &rooms.picture)?;
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
        };
        let result = Some((&rooms.picture.buffer, &rooms.result.buffer, bytes));
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
        if let Some(rooms) = &self.rooms {
            if rooms.pixels >= pixels && rooms.tiles >= tiles {
                return Ok(());
            }
            (pixels, tiles) = (pixels.max(rooms.pixels), tiles.max(rooms.tiles));
        }
        self.rooms = None;
        let gpu = &self.gpu;
        let storage = wgpu::BufferUsages::STORAGE | wgpu::BufferUsages::COPY_DST;
        let picture = PIXEL_BYTES * (pixels + tiles) as u64;
        self.rooms = Some(Rooms {
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

/// Binds buffers to a pipeline's places.
fn bind<'a>(
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
    gpu.checked("buffers of a kernel", 0, || {
        let layout = pipeline.get_bind_group_layout(0);
        gpu.device.create_bind_group(&wgpu::BindGroupDescriptor {
            label: None,
            layout: &layout,
            entries: &entries,
        })
    })
}
