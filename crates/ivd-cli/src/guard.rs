//! `--memory-limit` for whatever a stage doesn't foresee: the process is looked at, and its work cancelled beyond the limit.

use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};
use std::time::Duration;

use ivd_core::{Cancel, ErrorClass};
use ivd_pipeline::resource;

use crate::exit::Failure;

/// Time between two looks.
const BETWEEN: Duration = Duration::from_millis(5);

/// The program itself, its threads and its files' buffers take some memory, whatever the data: smaller limits are of data alone (bytes).
const LEAST: u64 = 64 << 20;

/// What was held when the limit was passed (KiB); 0 before.
#[derive(Debug, Clone, Default)]
pub(crate) struct Guard {
    passed: Arc<AtomicU64>,
}

impl Guard {
    /// Looks from now on that the process holds no more than a limit (bytes) of its own.
    pub(crate) fn start(limit: u64, cancel: Cancel) -> Self {
        let (guard, most) = (Self::default(), limit.max(LEAST) as f64);
        // One reference is this guard's, one the thread's: without the first nobody asks any more.
        let passed = Arc::downgrade(&guard.passed);
        let look = move || {
            while let Some(passed) = passed.upgrade() {
                let held = resource::own_mb().unwrap_or_default();
                if held * f64::from(1 << 20) > most {
                    passed.store((held * 1024.0) as u64, Ordering::Release);
                    cancel.cancel();
                    return;
                }
                drop(passed);
                std::thread::sleep(BETWEEN);
            }
        };
        // Without the thread what stages foresee is still held to the limit.
        let _ = std::thread::Builder::new().name("memory limit".into()).spawn(look);
        guard
    }

    /// The failure in place of the interruption that it comes as, where the limit was passed.
    pub(crate) fn explain(&self, error: anyhow::Error, limit: Option<u64>) -> anyhow::Error {
        let (passed, Some(limit)) = (self.passed.load(Ordering::Acquire), limit) else { return error };
        if passed == 0 {
            return error;
        }
        let problem = format!(
            "--memory-limit {:.1} MiB: the work held {:.1} MiB of its own, and isn't done; give it more, work on a smaller volume or \
             part, or leave the limit out",
            limit as f64 / f64::from(1 << 20),
            passed as f64 / 1024.0
        );
        Failure::of(ErrorClass::Limit, problem)
    }
}
