use std::collections::{BTreeMap, HashMap};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::Instant;

use ivd_core::{Answer, Voxels};

use crate::cast::state::State;
use crate::kept::Kept;
use crate::pass::Desk;
use crate::shader::assemble;
use crate::{Counters, Error, Gpu};

/// What a buffer of results is used for.
pub(crate) const RESULT: wgpu::BufferUsages = wgpu::BufferUsages::STORAGE.union(wgpu::BufferUsages::COPY_SRC);

/// An opened device and what lies on it; the forms of all kernels work on the same. What was brought stays until it is replaced: the last volume with a clone of
/// it in memory, and what pictures have in common.
#[derive(Clone)]
pub struct SharedGpu(Arc<Mutex<Opened>>);

pub(crate) struct Opened {
    pub(crate) gpu: Gpu,
    pipelines: HashMap<String, wgpu::ComputePipeline>,
    pub(crate) desk: Desk,
    pub(crate) volume: Option<Kept>,
    pub(crate) cast: State,
}

impl SharedGpu {
    /// A device to be shared.
    pub fn new(gpu: Gpu) -> Self {
        Self(Arc::new(Mutex::new(Opened {
            gpu,
            pipelines: HashMap::new(),
            desk: Desk::default(),
            volume: None,
            cast: State::default(),
        })))
    }

    /// What has been done on the device.
    pub fn counters(&self) -> Counters {
        self.lock().gpu.counters()
    }

    /// Of each kind of submission how many there were and how long they took: [`Gpu::times`].
    pub fn times(&self) -> BTreeMap<&'static str, (u64, u64)> {
        self.lock().gpu.times()
    }

    fn lock(&self) -> MutexGuard<'_, Opened> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Does work on the device. Where that fails the device is opened anew and the work done once more; where there is no room, what is kept is
    /// let go first.
    ///
    /// While the work is done nothing may be shared out to threads: one of them could come back for more of the device, and wait for itself.
    ///
    /// # Errors
    /// As the device says the second time.
    pub(crate) fn attempt<T>(
        &self,
        mut work: impl FnMut(&mut Opened) -> Result<T, Error>,
    ) -> Result<T, Error> {
        let mut opened = self.lock();
        match work(&mut opened) {
            Ok(done) => Ok(done),
            Err(error) => {
                opened.recover(error)?;
                work(&mut opened)
            }
        }
    }
}

impl Opened {
    /// Lets go of everything on the device.
    fn forget(&mut self) {
        self.pipelines.clear();
        self.desk = Desk::default();
        self.volume = None;
        self.cast.forget();
    }

    /// After a failure: lets go of everything, and opens the device anew where it is to blame.
    fn recover(&mut self, error: Error) -> Result<(), Error> {
        // A device is none the better for being opened again, nor for being empty.
        if matches!(error, Error::Unknown(_) | Error::Lacks(_) | Error::TooLarge { .. }) {
            return Err(error);
        }
        self.forget();
        match error {
            // Of what was going on when it was cancelled nothing is looked at any more.
            Error::Core(error) => return Err(error.into()),
            Error::NoRoom { .. } => {}
            _ => {
                let anew = self.gpu.reopen().map_err(|_| error.clone())?;
                let old = std::mem::replace(&mut self.gpu, anew);
                if matches!(error, Error::Late(_)) && !old.answers() {
                    // Who lets go of a device waits for it.
                    std::mem::forget(old);
                }
            }
        }
        tracing::warn!(%error, "the GPU failed, and is asked once more");
        Ok(())
    }

    /// The pipeline of a shader, made where it isn't yet.
    pub(crate) fn pipeline(
        &mut self,
        file: &'static str,
        names: &[&str],
    ) -> Result<wgpu::ComputePipeline, Error> {
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

    /// Brings voxels to the device as they are stored, and gives the names that shaders know their type by.
    pub(crate) fn bring_stored(&mut self, voxels: &Voxels) -> Result<Vec<&'static str>, Error> {
        let names = names_of(voxels)?;
        Kept::bring_voxels(&mut self.volume, &self.gpu, voxels, voxels.as_bytes())?;
        Ok(names)
    }

    /// The parts that so many quads of voxels are passed over in, each as its first and the one after its last: a part takes some milliseconds.
    pub(crate) fn pieces(&self, quads: usize) -> Vec<[usize; 2]> {
        let most = match self.gpu.part() {
            Some(part) => part,
            None if self.gpu.adapter().is_software() => 1 << 20,
            None => 1 << 24,
        };
        (0..quads).step_by(most.max(1)).map(|first| [first, quads.min(first + most)]).collect()
    }
}

/// The names that shaders know the type of voxels by.
pub(crate) fn names_of(voxels: &Voxels) -> Result<Vec<&'static str>, Error> {
    Ok(match voxels {
        Voxels::U8(_) => vec!["U8", "BYTES"],
        Voxels::I8(_) => vec!["I8", "BYTES"],
        Voxels::U16(_) => vec!["U16", "HALVES"],
        Voxels::I16(_) => vec!["I16", "HALVES"],
        Voxels::F32(_) => vec!["F32"],
        _ => return Err(Error::Unknown(voxels.voxel_type().name())),
    })
}

/// What the form of a kernel answers.
pub(crate) fn answer<T>(kernel: &'static str, made: Result<T, Error>) -> Result<Answer<T>, ivd_core::Error> {
    match made {
        Ok(made) => Ok(Answer::Done(made)),
        Err(Error::Core(error)) => Err(error),
        Err(Error::Unknown(_) | Error::Lacks(_)) => Ok(Answer::NoForm),
        Err(error @ (Error::NoRoom { .. } | Error::TooLarge { .. })) => {
            Ok(Answer::Declined(error.to_string()))
        }
        Err(error) => Err(ivd_core::Error::Device { kernel, problem: error.to_string() }),
    }
}
