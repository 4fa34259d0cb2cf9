use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::sync::{Arc, Mutex};
use std::time::Instant;

use crate::{Device, Error, ServedBy, Spill};

/// A flag that stops running work at its next check, and perhaps a time at which it stops by itself. Clones share the flag.
#[derive(Debug, Clone, Default)]
pub struct Cancel {
    asked: Arc<AtomicBool>,
    /// The flag of another, where that stops the work as well.
    other: Option<Arc<AtomicBool>>,
    deadline: Option<Instant>,
}

impl Cancel {
    /// Asks the work to stop.
    pub fn cancel(&self) {
        self.asked.store(true, Ordering::Relaxed);
    }

    /// The same flag with a deadline: work that looks at it stops when either comes. The flag itself stays as it is, so
    /// that whoever owns it can go on afterwards.
    #[must_use]
    pub fn until(&self, deadline: Instant) -> Self {
        Self { deadline: Some(deadline), ..self.clone() }
    }

    /// The same flag beside another's: work that looks at it stops when a stop is asked of either.
    #[must_use]
    pub fn or(&self, other: &Self) -> Self {
        Self { other: Some(other.asked.clone()), ..self.clone() }
    }

    /// Whether a stop was asked for, or the time is up.
    pub fn is_cancelled(&self) -> bool {
        self.is_asked() || self.is_late()
    }

    /// Whether a stop was asked for.
    pub fn is_asked(&self) -> bool {
        self.asked.load(Ordering::Relaxed)
            || self.other.as_ref().is_some_and(|other| other.load(Ordering::Relaxed))
    }

    /// Whether there is a deadline and it has passed.
    pub fn is_late(&self) -> bool {
        self.deadline.is_some_and(|deadline| Instant::now() >= deadline)
    }
}

/// One step of an iterative method.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Iteration {
    /// Method, such as `"kmvs"`.
    pub method: &'static str,
    /// Number of the iteration, from 1.
    pub index: u64,
    /// Energy, objective or residual after it, in the method's own unit.
    pub value: f64,
}

/// Hears how work goes on: one hook for progress bars, plots and tests. Called from worker threads.
pub trait Observer: Send + Sync {
    /// A task of `total` units begins.
    fn begin(&self, task: &'static str, total: u64) {
        let _ = (task, total);
    }
    /// `units` more of the task are done.
    fn advance(&self, task: &'static str, units: u64) {
        let _ = (task, units);
    }
    /// The task has ended.
    fn end(&self, task: &'static str) {
        let _ = task;
    }
    /// An iteration has ended.
    fn iteration(&self, iteration: Iteration) {
        let _ = iteration;
    }
    /// Something that the user should know and that is no failure.
    fn note(&self, message: &str) {
        let _ = message;
    }
}

/// The observer that ignores everything.
#[derive(Debug, Default)]
pub struct NoObserver;
impl Observer for NoObserver {}

/// How work is done: threads, memory, device, who listens, who may stop it. Never part of a result's identity.
#[derive(Clone)]
pub struct Exec {
    pool: Option<Arc<rayon::ThreadPool>>,
    observer: Arc<dyn Observer>,
    /// Stops the work at its next check.
    pub cancel: Cancel,
    /// Most bytes that bulk data may take; `None` for no limit.
    pub memory_limit: Option<u64>,
    /// Where bulk data beyond the memory limit goes; without it such data is refused.
    pub spill: Option<Arc<dyn Spill>>,
    refused: Arc<AtomicU64>,
    /// The device that makes the passes it knows; without one the processor makes all.
    pub device: Option<Arc<Device>>,
    pub(crate) served: Arc<Mutex<ServedBy>>,
    /// Whether work that can't change a result is passed over. Off: everything is looked at, for the same result; the plain
    /// twin of every shortcut.
    pub skip: bool,
    /// Whether kernels may use what this processor has beyond the least of its kind (AVX2 and the like). The bytes are the
    /// same either way; without it a test can show that they are.
    pub simd: bool,
}

impl Default for Exec {
    fn default() -> Self {
        Self {
            pool: None,
            observer: Arc::new(NoObserver),
            cancel: Cancel::default(),
            memory_limit: None,
            spill: None,
            refused: Arc::default(),
            device: None,
            served: Arc::default(),
            skip: true,
            simd: true,
        }
    }
}

impl std::fmt::Debug for Exec {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Exec")
            .field("threads", &self.threads())
            .field("memory_limit", &self.memory_limit)
            .field("device", &self.device.as_ref().map(|device| device.name()))
            .field("simd", &self.simd)
            .finish_non_exhaustive()
    }
}

impl Exec {
    /// Work on a pool of its own with `threads` threads (at least 1). The global pool stays untouched.
    ///
    /// # Panics
    /// If the operating system refuses to start the threads.
    #[must_use]
    pub fn with_threads(mut self, threads: usize) -> Self {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads.max(1)).build();
        self.pool = Some(Arc::new(pool.expect("the operating system starts the worker threads")));
        self
    }

    /// Work that reports to `observer`.
    #[must_use]
    pub fn with_observer(mut self, observer: Arc<dyn Observer>) -> Self {
        self.observer = observer;
        self
    }

    /// Work within `limit` bytes of bulk data.
    #[must_use]
    pub fn with_memory_limit(mut self, limit: Option<u64>) -> Self {
        self.memory_limit = limit;
        self
    }

    /// Work that puts bulk data beyond the memory limit where `spill` says.
    #[must_use]
    pub fn with_spill(mut self, spill: Arc<dyn Spill>) -> Self {
        self.spill = Some(spill);
        self
    }

    /// Work whose passes a device makes, those that it knows.
    #[must_use]
    pub fn with_device(mut self, device: Arc<Device>) -> Self {
        self.device = Some(device);
        self
    }

    /// Work that stops at `deadline` at the latest; whoever holds the flag of `self` can still stop it sooner.
    #[must_use]
    pub fn with_deadline(mut self, deadline: Instant) -> Self {
        self.cancel = self.cancel.until(deadline);
        self
    }

    /// Work with the kernels for any processor (`false`), or with the fastest that this one runs.
    #[must_use]
    pub fn with_simd(mut self, simd: bool) -> Self {
        self.simd = simd;
        self
    }

    /// Runs `work` so that rayon inside it uses this context's threads. Stage functions wrap their body in it.
    pub fn run<R: Send>(&self, work: impl FnOnce() -> R + Send) -> R {
        match &self.pool {
            Some(pool) => pool.install(work),
            None => work(),
        }
    }

    /// Number of threads that [`Exec::run`] works on.
    pub fn threads(&self) -> usize {
        self.pool.as_ref().map_or_else(rayon::current_num_threads, |pool| pool.current_num_threads())
    }

    /// Who listens.
    pub fn observer(&self) -> &dyn Observer {
        self.observer.as_ref()
    }

    /// # Errors
    /// [`Error::Cancelled`] once a stop was asked for, [`Error::Deadline`] once the time is up.
    pub fn check_cancelled(&self) -> Result<(), Error> {
        match &self.cancel {
            cancel if cancel.is_asked() => Err(Error::Cancelled),
            cancel if cancel.is_late() => Err(Error::Deadline),
            _ => Ok(()),
        }
    }

    /// Call before a large allocation.
    ///
    /// # Errors
    /// [`Error::MemoryLimit`] where `needed` bytes for `what` exceed the limit.
    pub fn check_memory(&self, what: &str, needed: u64) -> Result<(), Error> {
        let checked = self.fits(what, needed);
        if checked.is_err() {
            self.refused.fetch_max(needed, Ordering::Relaxed);
        }
        checked
    }

    /// As [`Exec::check_memory`], for what has somewhere else to go.
    pub(crate) fn fits(&self, what: &str, needed: u64) -> Result<(), Error> {
        match self.memory_limit {
            Some(limit) if needed > limit => Err(Error::MemoryLimit { what: what.to_owned(), needed, limit }),
            _ => Ok(()),
        }
    }

    /// The most bytes that the memory limit has refused to this context and its clones; `None` where it refused none.
    pub fn refused(&self) -> Option<u64> {
        Some(self.refused.load(Ordering::Relaxed)).filter(|bytes| *bytes > 0)
    }
}

/// Whether this processor has the wide registers that kernels use (AVX2).
pub fn has_avx2() -> bool {
    #[cfg(target_arch = "x86_64")]
    return std::arch::is_x86_feature_detected!("avx2");
    #[cfg(not(target_arch = "x86_64"))]
    false
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::time::Duration;

    #[test]
    fn a_deadline_stops_the_work_that_has_it_and_leaves_the_flag_alone() {
        let whole = Exec::default();
        let now = Instant::now();
        let late = whole.clone().with_deadline(now);
        assert_eq!(late.check_cancelled(), Err(Error::Deadline));
        assert_eq!(whole.check_cancelled(), Ok(()));
        let early = whole.clone().with_deadline(now + Duration::from_hours(1));
        assert_eq!(early.check_cancelled(), Ok(()));
        // Whoever interrupts is heard first: the two end in different exit codes.
        whole.cancel.cancel();
        assert_eq!(late.check_cancelled(), Err(Error::Cancelled));
        assert_eq!(early.check_cancelled(), Err(Error::Cancelled));
    }

    #[test]
    fn work_that_two_may_stop_stops_by_either_and_the_other_goes_on() {
        for by_other in [false, true] {
            let (whole, other) = (Exec::default(), Cancel::default());
            let mut part = whole.clone();
            part.cancel = part.cancel.or(&other);
            assert_eq!(part.check_cancelled(), Ok(()));
            if by_other { &other } else { &whole.cancel }.cancel();
            assert_eq!(part.check_cancelled(), Err(Error::Cancelled));
            assert_eq!((whole.cancel.is_asked(), other.is_asked()), (!by_other, by_other));
        }
    }
}
