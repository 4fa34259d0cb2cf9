//! Memory and processor time of this process. The only module that knows an operating system's way to tell them.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread::JoinHandle;
use std::time::Duration;

/// Time between two looks at the memory.
const BETWEEN: Duration = Duration::from_millis(5);

/// Peak resident memory (MiB) of the whole process so far; `None` where the system doesn't tell.
pub fn peak_rss_mb() -> Option<f64> {
    status("VmHWM:")
}

/// Memory that the process holds of its own (MiB), mapped files apart; `None` where the system doesn't tell.
pub fn own_mb() -> Option<f64> {
    status("RssAnon:")
}

/// Memory that the process has taken for its data (MiB), touched or not, its threads' stacks apart; `None` where the system doesn't tell.
pub fn taken_mb() -> Option<f64> {
    let status = std::fs::read_to_string("/proc/self/status").ok()?;
    let threads: f64 = status.lines().find_map(|line| line.strip_prefix("Threads:"))?.trim().parse().ok()?;
    Some((told(&status, "VmData:")? - threads * STACK_MB).max(0.0))
}

/// Room that a thread reserves for its stack (MiB), of which it touches little.
const STACK_MB: f64 = 2.0;

fn status(line: &str) -> Option<f64> {
    told(&std::fs::read_to_string("/proc/self/status").ok()?, line)
}

fn told(status: &str, line: &str) -> Option<f64> {
    let kib: f64 =
        status.lines().find_map(|l| l.strip_prefix(line))?.split_whitespace().next()?.parse().ok()?;
    Some(kib / 1024.0)
}

/// Memory at one moment, or the most of several (MiB).
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Memory {
    /// Resident: also what is mapped of files, where it was touched.
    pub resident: f64,
    /// The process's own, mapped files apart: what a memory limit is held against.
    pub own: f64,
}

impl Memory {
    /// At this moment; 0 where the system doesn't tell.
    fn now() -> Self {
        let status = std::fs::read_to_string("/proc/self/status").unwrap_or_default();
        let of = |line| told(&status, line).unwrap_or_default();
        Self { resident: of("VmRSS:"), own: of("RssAnon:") }
    }

    fn most(self, other: Self) -> Self {
        Self { resident: self.resident.max(other.resident), own: self.own.max(other.own) }
    }
}

/// Watches the memory during a piece of work.
///
/// The system keeps one peak of what is resident for the whole run, which outside tools read too, so it is left alone: where the work
/// raises it, it is the work's. Where an earlier one's was higher, and of the process's own memory, the largest of looks 5 ms apart is
/// told, which can miss what is shorter.
#[derive(Debug)]
pub struct MemoryWatch {
    peak_before: Option<f64>,
    over: Arc<AtomicBool>,
    looks: Option<JoinHandle<Memory>>,
}

impl MemoryWatch {
    /// From here on.
    pub fn start() -> Self {
        let (peak_before, over) = (peak_rss_mb(), Arc::new(AtomicBool::new(false)));
        let told = over.clone();
        let look = move || {
            let mut largest = Memory::now();
            while !told.load(Ordering::Acquire) {
                std::thread::park_timeout(BETWEEN);
                largest = largest.most(Memory::now());
            }
            largest
        };
        let looks =
            peak_before.and_then(|_| std::thread::Builder::new().name("memory".into()).spawn(look).ok());
        Self { peak_before, over, looks }
    }

    /// Peaks of the work; `None` where the system doesn't tell.
    pub fn stop(mut self) -> Option<Memory> {
        let seen = self.end();
        let (peak, before) = (peak_rss_mb()?, self.peak_before?);
        let seen = seen.unwrap_or(Memory { resident: peak, own: own_mb()? });
        Some(if peak > before { Memory { resident: peak, ..seen } } else { seen })
    }

    fn end(&mut self) -> Option<Memory> {
        self.over.store(true, Ordering::Release);
        let looks = self.looks.take()?;
        looks.thread().unpark();
        looks.join().ok()
    }
}

impl Drop for MemoryWatch {
    fn drop(&mut self) {
        self.end();
    }
}

/// User and system time of all threads so far (s); `None` where the system doesn't tell.
pub fn cpu_seconds() -> Option<f64> {
    let stat = std::fs::read_to_string("/proc/self/stat").ok()?;
    // Fields 14 and 15 of proc(5), counted after the command's closing parenthesis; ticks of 1/100 s on Linux.
    let mut fields = stat.rsplit(')').next()?.split_whitespace().skip(11);
    let ticks = fields.next()?.parse::<f64>().ok()? + fields.next()?.parse::<f64>().ok()?;
    Some(ticks / 100.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Touches memory of this size (MiB).
    fn touch(mib: usize) {
        let mut held = vec![0_u8; mib << 20];
        held.iter_mut().step_by(4096).for_each(|b| *b = 1);
        std::hint::black_box(&held);
        std::thread::sleep(10 * BETWEEN);
    }

    #[test]
    fn work_after_larger_work_is_told_by_itself() {
        let before = Memory::now();
        if before.resident == 0.0 {
            return;
        }
        let watch = MemoryWatch::start();
        touch(400);
        let large = watch.stop().expect("the system told before");
        let watch = MemoryWatch::start();
        touch(60);
        let small = watch.stop().expect("the system told before");
        // Other tests of this process take and give back some of their own meanwhile.
        assert!(large.resident >= before.resident + 300.0, "{large:?} after {before:?}");
        assert!(small.resident < large.resident - 200.0, "{small:?} beside {large:?} after {before:?}");
        assert!(large.own >= before.own + 300.0 && large.own <= large.resident, "{large:?} after {before:?}");
        assert!(small.own < large.own - 200.0, "{small:?} beside {large:?} after {before:?}");
        assert!(peak_rss_mb().expect("as before") >= large.resident, "the process's own peak stays");
    }
}
