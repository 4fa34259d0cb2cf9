use std::collections::BTreeMap;
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Arc, Mutex, PoisonError};
use std::time::{Duration, Instant};

use ivd_core::Exec;

use crate::adapter::{FEATURES, choose, describe};
use crate::timing::Clock;
use crate::{Adapter, Choice, Error, OpenError};

/// The longest that a submission may take. Parts are made for a few milliseconds.
pub(crate) const PATIENCE: Duration = Duration::from_secs(20);
/// How often somebody who waits looks whether the work was cancelled.
const LOOK: Duration = Duration::from_millis(100);

/// How a device is opened.
#[derive(Debug, Clone, Default)]
pub struct Options {
    /// Which adapter.
    pub choice: Choice,
    /// Optional features that are left out, by the names of [`Adapter::features`].
    pub without: Vec<&'static str>,
    /// Largest buffer and binding, where less than the adapter has (bytes).
    pub max_buffer: Option<u64>,
    /// Pixels of a part of a picture, where that isn't left to how fast the device is.
    pub part: Option<usize>,
    /// Workgroups along an axis, where fewer than every device grants, for tests.
    pub across: Option<usize>,
    /// What goes wrong on purpose, for tests: at which of the counted events (allocations, submissions, maps).
    pub faults: Vec<(u64, Fault)>,
    /// Texts of shaders and what stands in their place, for tests: an error that a suite must find.
    pub planted: Vec<(&'static str, &'static str)>,
    /// Whether the device's own clock is read.
    pub timed: bool,
}

/// What can go wrong on purpose.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Fault {
    /// The device is gone.
    Loss,
    /// There is no room.
    NoRoom,
    /// It doesn't answer.
    Late,
    /// It does nothing of what it is told.
    Garbage,
}

/// What crossed between memory and device, and what was done there; since the device was opened.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Counters {
    /// Bytes to the device.
    pub uploaded: u64,
    /// Bytes from the device.
    pub downloaded: u64,
    /// Bytes of the device that are held.
    pub held: u64,
    /// Kernels that were started.
    pub dispatches: u64,
    /// Submissions.
    pub submissions: u64,
    /// Events that can fail: allocations, submissions, maps.
    pub events: u64,
    /// Devices that were opened.
    pub opened: u64,
    /// Time of the kernels by the device's own clock (ns); 0 without timestamps.
    pub busy_ns: u64,
}

/// What a device has done, whatever became of it.
#[derive(Clone)]
pub struct Meter(Arc<Count>);

impl Meter {
    /// What has been done.
    pub fn counters(&self) -> Counters {
        self.0.told()
    }
}

#[derive(Default)]
pub(crate) struct Count {
    pub(crate) uploaded: AtomicU64,
    pub(crate) downloaded: AtomicU64,
    pub(crate) held: AtomicU64,
    pub(crate) dispatches: AtomicU64,
    submissions: AtomicU64,
    events: AtomicU64,
    opened: AtomicU64,
    busy_ns: AtomicU64,
    /// Of each kind of submission how many there were and how long they took (ns).
    kinds: Mutex<BTreeMap<&'static str, (u64, u64)>>,
}

impl Count {
    pub(crate) fn add(which: &AtomicU64, n: u64) {
        which.fetch_add(n, Ordering::Relaxed);
    }

    fn told(&self) -> Counters {
        let of = |which: &AtomicU64| which.load(Ordering::Relaxed);
        Counters {
            uploaded: of(&self.uploaded),
            downloaded: of(&self.downloaded),
            held: of(&self.held),
            dispatches: of(&self.dispatches),
            submissions: of(&self.submissions),
            events: of(&self.events),
            opened: of(&self.opened),
            busy_ns: of(&self.busy_ns),
        }
    }
}

/// What is read after a submission: parts of buffers, each from a first byte on, one after the other; and the buffer that they are copied to.
pub(crate) struct Reading<'a> {
    pub(crate) from: Vec<(&'a wgpu::Buffer, u64, u64)>,
    pub(crate) to: &'a wgpu::Buffer,
}

/// An opened device. All calls to it are made by one thread at a time: error scopes belong to threads.
pub struct Gpu {
    pub(crate) device: wgpu::Device,
    pub(crate) queue: wgpu::Queue,
    pub(crate) count: Arc<Count>,
    adapter: Adapter,
    limits: wgpu::Limits,
    options: Options,
    clock: Option<Clock>,
    trouble: Arc<Mutex<Option<String>>>,
}

impl Gpu {
    /// Opens an adapter with its own limits.
    ///
    /// # Errors
    /// Says why none could be opened.
    pub fn open(options: Options) -> Result<Self, OpenError> {
        Self::open_counting(options, Arc::default())
    }

    /// The same device anew, after it was lost.
    pub(crate) fn reopen(&self) -> Result<Self, OpenError> {
        Self::open_counting(self.options.clone(), self.count.clone())
    }

    fn open_counting(options: Options, count: Arc<Count>) -> Result<Self, OpenError> {
        let found = choose(&options.choice)?;
        let mut adapter = describe(&found);
        let mut features = wgpu::Features::empty();
        for ((name, feature), (_, there)) in FEATURES.iter().zip(&mut adapter.features) {
            *there &= !options.without.contains(name);
            features.set(*feature, *there);
        }
        let mut limits = found.limits();
        if let Some(max) = options.max_buffer {
            limits.max_buffer_size = limits.max_buffer_size.min(max);
            limits.max_storage_buffer_binding_size = limits.max_storage_buffer_binding_size.min(max);
        }
        adapter.max_binding = limits.max_storage_buffer_binding_size;
        adapter.max_buffer = limits.max_buffer_size;
        let descriptor = wgpu::DeviceDescriptor {
            label: Some("ivd"),
            required_features: features,
            required_limits: limits.clone(),
            ..wgpu::DeviceDescriptor::default()
        };
        let refused = |problem: String| OpenError::Refused { adapter: adapter.name.clone(), problem };
        let (device, queue) = pollster::block_on(found.request_device(&descriptor))
            .map_err(|error| refused(error.to_string()))?;
        let trouble = Arc::new(Mutex::new(None));
        let note = |trouble: &Arc<Mutex<Option<String>>>, what: String| {
            trouble.lock().unwrap_or_else(PoisonError::into_inner).get_or_insert(what);
        };
        let lost = trouble.clone();
        device.set_device_lost_callback(move |_, why| note(&lost, why));
        let uncaptured = trouble.clone();
        device.on_uncaptured_error(Arc::new(move |error: wgpu::Error| note(&uncaptured, error.to_string())));
        let timed = options.timed && features.contains(wgpu::Features::TIMESTAMP_QUERY);
        let clock = timed.then(|| Clock::new(&device, &queue));
        Count::add(&count.opened, 1);
        Ok(Self { device, queue, count, adapter, limits, options, clock, trouble })
    }

    /// What was opened, with the limits and features that it was opened with.
    pub fn adapter(&self) -> &Adapter {
        &self.adapter
    }

    /// What has been done.
    pub fn counters(&self) -> Counters {
        self.count.told()
    }

    /// Of each kind of submission how many there were and how long they took by the device's own clock (ns); empty without timestamps.
    pub fn times(&self) -> BTreeMap<&'static str, (u64, u64)> {
        self.count.kinds.lock().unwrap_or_else(PoisonError::into_inner).clone()
    }

    /// Tells what has been done after the device is gone too.
    pub fn meter(&self) -> Meter {
        Meter(self.count.clone())
    }

    /// Whether an optional feature is there and wasn't left out.
    pub(crate) fn has(&self, feature: &str) -> bool {
        self.adapter.features.iter().any(|(name, there)| *name == feature && *there)
    }

    /// A shader's text with what was planted in it.
    pub(crate) fn planted(&self, text: &str) -> String {
        self.options.planted.iter().fold(text.to_owned(), |text, (from, to)| text.replace(from, to))
    }

    pub(crate) fn limits(&self) -> &wgpu::Limits {
        &self.limits
    }

    /// See [`Options::part`].
    pub(crate) fn part(&self) -> Option<usize> {
        self.options.part
    }

    /// See [`Options::across`].
    pub(crate) fn across(&self) -> Option<usize> {
        self.options.across
    }

    /// An event that can fail; whether the device does nothing of it, on purpose.
    ///
    /// # Errors
    /// What else goes wrong at it on purpose.
    pub(crate) fn event(&self, what: &'static str, bytes: u64) -> Result<bool, Error> {
        let n = self.count.events.fetch_add(1, Ordering::Relaxed);
        let fault = self.options.faults.iter().find(|(at, _)| *at == n).map(|(_, fault)| *fault);
        match fault {
            Some(Fault::NoRoom) => Err(Error::NoRoom { what, bytes }),
            Some(Fault::Late) => Err(Error::Late(PATIENCE)),
            Some(Fault::Loss) => {
                self.device.destroy();
                Ok(false)
            }
            Some(Fault::Garbage) => Ok(true),
            None => Ok(false),
        }
    }

    /// Whether everything that was submitted is done by and by.
    pub(crate) fn answers(&self) -> bool {
        self.device.poll(wgpu::PollType::Wait { submission_index: None, timeout: Some(LOOK) }).is_ok()
    }

    /// # Errors
    /// Where the device was lost, or refused something that nobody was looking at.
    pub(crate) fn check(&self) -> Result<(), Error> {
        match &*self.trouble.lock().unwrap_or_else(PoisonError::into_inner) {
            Some(what) => Err(Error::Lost(what.clone())),
            None => Ok(()),
        }
    }

    /// Does something to the device and looks at what it says of it.
    pub(crate) fn checked<T>(
        &self,
        what: &'static str,
        bytes: u64,
        work: impl FnOnce() -> T,
    ) -> Result<T, Error> {
        let scopes =
            [wgpu::ErrorFilter::Internal, wgpu::ErrorFilter::Validation, wgpu::ErrorFilter::OutOfMemory]
                .map(|filter| self.device.push_error_scope(filter));
        let done = work();
        let [internal, validation, memory] = scopes;
        let said = [memory, validation, internal].map(|scope| pollster::block_on(scope.pop()));
        self.check()?;
        match said.into_iter().flatten().next() {
            None => Ok(done),
            Some(wgpu::Error::OutOfMemory { .. }) => Err(Error::NoRoom { what, bytes }),
            Some(error) => Err(Error::Refused(format!("{what}: {error}"))),
        }
    }

    /// Submits commands, which say whether they are timed, and waits for them; what is read from is copied to where it can be mapped. Gives how long the device took.
    ///
    /// # Errors
    /// As the device says; a result is believed only where its map succeeded, no scope said anything, and the device is still there.
    pub(crate) fn submit(
        &self,
        what: &'static str,
        exec: &Exec,
        encode: impl FnOnce(&mut wgpu::CommandEncoder, Option<&Clock>) -> bool,
        result: Option<Reading<'_>>,
        read: impl FnOnce(&[u8]),
    ) -> Result<Duration, Error> {
        let idle = self.event(what, 0)?;
        let submitted = self.checked(what, 0, || {
            let mut encoder = self.device.create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
            let timed = !idle && encode(&mut encoder, self.clock.as_ref());
            if let Some(result) = &result {
                let mut at = 0;
                for (from, first, bytes) in &result.from {
                    encoder.copy_buffer_to_buffer(from, *first, result.to, at, *bytes);
                    at += bytes;
                }
            }
            if let Some(clock) = self.clock.as_ref().filter(|_| timed) {
                clock.resolve(&mut encoder);
            }
            (self.queue.submit([encoder.finish()]), timed)
        })?;
        let (submitted, timed) = submitted;
        Count::add(&self.count.submissions, 1);
        let mapped = match result {
            Some(Reading { from, to }) => {
                let bytes = from.iter().map(|(.., bytes)| bytes).sum();
                Some((to, bytes, self.map(to, bytes)?))
            }
            None => None,
        };
        let start = Instant::now();
        loop {
            let wait =
                wgpu::PollType::Wait { submission_index: Some(submitted.clone()), timeout: Some(LOOK) };
            let waited = self.device.poll(wait);
            self.check()?;
            match waited {
                Ok(_) => break,
                Err(wgpu::PollError::Timeout) if start.elapsed() < PATIENCE => exec.check_cancelled()?,
                Err(wgpu::PollError::Timeout) => return Err(Error::Late(PATIENCE)),
                Err(other) => return Err(Error::Refused(format!("{what}: {other}"))),
            }
        }
        let took = start.elapsed();
        if let Some((to, bytes, answer)) = mapped {
            // The callback was called while waiting, or the device is no longer there.
            match answer.lock().unwrap_or_else(PoisonError::into_inner).take() {
                Some(Ok(())) => {}
                Some(Err(error)) => return Err(Error::Lost(error.to_string())),
                None => return Err(Error::Late(PATIENCE)),
            }
            let view = to.slice(..bytes).get_mapped_range();
            let view = view.map_err(|error| Error::Refused(format!("{what}: {error}")))?;
            read(&view);
            drop(view);
            to.unmap();
            Count::add(&self.count.downloaded, bytes);
        }
        if let Some(clock) = self.clock.as_ref().filter(|_| timed) {
            let ns = clock.read(self)?;
            Count::add(&self.count.busy_ns, ns);
            let mut kinds = self.count.kinds.lock().unwrap_or_else(PoisonError::into_inner);
            let kind = kinds.entry(what).or_default();
            *kind = (kind.0 + 1, kind.1 + ns);
        }
        self.check().map(|()| took)
    }

    #[allow(clippy::type_complexity, reason = "an answer that comes later")]
    pub(crate) fn map(
        &self,
        buffer: &wgpu::Buffer,
        bytes: u64,
    ) -> Result<Arc<Mutex<Option<Result<(), wgpu::BufferAsyncError>>>>, Error> {
        self.event("a result", bytes)?;
        let answer = Arc::new(Mutex::new(None));
        let told = answer.clone();
        buffer.slice(..bytes).map_async(wgpu::MapMode::Read, move |result| {
            *told.lock().unwrap_or_else(PoisonError::into_inner) = Some(result);
        });
        Ok(answer)
    }
}
