//! `--memory-limit` for whatever a stage doesn't foresee: the process is looked at, and its work cancelled beyond the limit.

use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};
use std::time::Duration;

use ivd_artefact::TemporaryFiles;
use ivd_core::{Cancel, ErrorClass, Spill, SpillSpace};
use ivd_pipeline::resource;

use crate::exit::{Failure, Unfinished, error_class};

/// Time between two looks.
const BETWEEN: Duration = Duration::from_millis(5);

/// The program itself, its threads and its files' buffers take some memory, whatever the data: smaller limits are of data alone (bytes).
const LEAST: u64 = 64 << 20;

/// Room beyond the limit, in temporary files; what is held counts where the limit is of the whole program.
#[derive(Debug)]
pub(crate) struct TemporaryRoom {
    is_whole: bool,
}

impl TemporaryRoom {
    /// For a limit (bytes).
    pub(crate) fn beyond(limit: Option<u64>) -> Self {
        Self { is_whole: limit.is_some_and(|limit| limit >= LEAST) }
    }
}

impl Spill for TemporaryRoom {
    fn space(&self, bytes: usize) -> std::io::Result<Box<dyn SpillSpace>> {
        TemporaryFiles.space(bytes)
    }

    fn held(&self) -> Option<u64> {
        let taken = self.is_whole.then(resource::taken_mb).flatten()?;
        Some((taken * f64::from(1 << 20)) as u64)
    }
}

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
        let about = error.chain().find_map(about_mib);
        let named = about.map(|mib| {
            format!(
                "about {mib} MiB do for this stage (--memory-limit {mib}MiB, reckoned from what it works on)"
            )
        });
        if passed == 0 {
            // One array was beyond the limit by itself; other failures are what they are.
            return match named.filter(|_| error_class(&error) == ErrorClass::Limit) {
                Some(named) => {
                    let told = Failure::of(ErrorClass::Limit, format!("{error}; {named}"));
                    Unfinished::carried(&error, told)
                }
                None => error,
            };
        }
        let remedy = named.unwrap_or_else(|| "give it more".to_owned());
        let problem = format!(
            "--memory-limit {:.1} MiB: the work held {:.1} MiB of its own, and isn't done; {remedy}, work on a smaller volume or \
             part, or leave the limit out",
            limit as f64 / f64::from(1 << 20),
            passed as f64 / 1024.0
        );
        Unfinished::carried(&error, Failure::of(ErrorClass::Limit, problem))
    }
}

/// The limit (MiB) that would have done, where an error tells it.
fn about_mib(error: &(dyn std::error::Error + 'static)) -> Option<u64> {
    let Some(ivd_pipeline::Error::OverMemory { about_mib, .. }) = error.downcast_ref() else { return None };
    Some(*about_mib)
}
