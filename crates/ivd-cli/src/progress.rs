//! Signs of life on stderr: bars on a terminal, else a line every half minute; and notes.

use std::collections::BTreeMap;
use std::sync::{Arc, Mutex, PoisonError, Weak};
use std::time::{Duration, Instant};

use indicatif::{MultiProgress, ProgressBar, ProgressStyle};
use ivd_core::{Iteration, Observer};

use crate::talk;

/// What a bar looks like.
const TEMPLATE: &str = "{msg:12} {bar:32} {percent:>3} % {elapsed}";
/// Time between two lines where there are no bars. Work that is shorter says nothing.
const BETWEEN_LINES: Duration = Duration::from_secs(30);

/// How the work's course is shown.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Style {
    /// Not at all.
    Silent,
    /// As bars, which a terminal can draw.
    Bars,
    /// As a line every half minute.
    Lines,
}

/// A task that has begun: units that are done, and all of them.
struct Task {
    done: u64,
    total: u64,
    bar: Option<ProgressBar>,
}

type Tasks = Mutex<BTreeMap<&'static str, Task>>;

/// Shows what the stages tell.
pub(crate) struct Progress {
    all: MultiProgress,
    running: Arc<Tasks>,
    style: Style,
    /// Whether notes are shown.
    notes: bool,
}

impl Progress {
    /// Shows the work's course in a way, and notes or not.
    pub(crate) fn new(style: Style, notes: bool) -> Self {
        let running = Arc::new(Tasks::default());
        if style == Style::Lines {
            tell_every(BETWEEN_LINES, Arc::downgrade(&running), talk::say);
        }
        Self { all: MultiProgress::new(), running, style, notes }
    }

    fn bar(&self, task: &'static str, total: u64) -> ProgressBar {
        let style = ProgressStyle::with_template(TEMPLATE).unwrap_or_else(|_| ProgressStyle::default_bar());
        let bar = self.all.add(ProgressBar::new(total).with_style(style).with_message(task));
        bar.enable_steady_tick(Duration::from_millis(120));
        bar
    }
}

/// Says a line again and again, until nobody holds the tasks any more.
fn tell_every(between: Duration, running: Weak<Tasks>, say: impl Fn(&str) + Send + 'static) {
    let begin = Instant::now();
    let tell = move || {
        loop {
            std::thread::sleep(between);
            let Some(running) = running.upgrade() else { return };
            let running = running.lock().unwrap_or_else(PoisonError::into_inner);
            say(&line(begin.elapsed(), &running));
        }
    };
    // Without the thread there are no lines; the work is the same.
    let _ = std::thread::Builder::new().name("progress".into()).spawn(tell);
}

/// What is going on, in a line.
fn line(since: Duration, running: &BTreeMap<&'static str, Task>) -> String {
    let tasks: Vec<String> = running
        .iter()
        .map(|(name, task)| match task.total {
            0 => (*name).to_owned(),
            total => format!("{name} {} %", 100 * task.done.min(total) / total),
        })
        .collect();
    let tasks = if tasks.is_empty() { String::new() } else { format!(": {}", tasks.join(", ")) };
    format!("ivd: working for {} s{tasks}", since.as_secs())
}

impl Observer for Progress {
    fn begin(&self, task: &'static str, total: u64) {
        if self.style == Style::Silent {
            return;
        }
        let bar = (self.style == Style::Bars).then(|| self.bar(task, total));
        let mut running = self.running.lock().unwrap_or_else(PoisonError::into_inner);
        running.insert(task, Task { done: 0, total, bar });
    }

    fn advance(&self, task: &'static str, units: u64) {
        if self.style == Style::Silent {
            return;
        }
        if let Some(task) = self.running.lock().unwrap_or_else(PoisonError::into_inner).get_mut(task) {
            task.done = task.done.saturating_add(units);
            if let Some(bar) = &task.bar {
                bar.inc(units);
            }
        }
    }

    fn end(&self, task: &'static str) {
        let ended = self.running.lock().unwrap_or_else(PoisonError::into_inner).remove(task);
        if let Some(bar) = ended.and_then(|task| task.bar) {
            bar.finish_and_clear();
        }
    }

    fn iteration(&self, iteration: Iteration) {
        tracing::debug!(method = iteration.method, index = iteration.index, value = iteration.value);
    }

    fn note(&self, message: &str) {
        if self.notes {
            self.all.suspend(|| talk::say(&format!("ivd: note: {message}")));
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_template_of_a_bar_is_right() {
        assert!(ProgressStyle::with_template(TEMPLATE).is_ok());
    }

    #[test]
    fn a_line_names_what_runs_and_how_far_it_is() {
        let task = |done, total| Task { done, total, bar: None };
        let running = BTreeMap::from([("segment", task(21, 50)), ("warp", task(3, 0))]);
        assert_eq!(line(Duration::from_secs(61), &running), "ivd: working for 61 s: segment 42 %, warp");
        assert_eq!(line(Duration::from_secs(30), &BTreeMap::new()), "ivd: working for 30 s");
    }

    #[test]
    fn lines_come_while_work_goes_on_and_end_with_it() {
        let (told, heard) = std::sync::mpsc::channel();
        let running = Arc::new(Tasks::default());
        running.lock().unwrap().insert("map", Task { done: 1, total: 4, bar: None });
        tell_every(Duration::from_millis(20), Arc::downgrade(&running), move |line| {
            let _ = told.send(line.to_owned());
        });
        for _ in 0..3 {
            assert_eq!(heard.recv().unwrap(), "ivd: working for 0 s: map 25 %");
        }
        drop(running);
        // The sender goes with the thread.
        while heard.recv().is_ok() {}
    }
}
