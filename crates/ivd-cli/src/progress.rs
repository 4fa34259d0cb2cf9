//! Signs of life on stderr: bars on a terminal, else a line every half minute; and notes.

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

/// A task that has begun: units that are done, and all of them; 0 where nobody knows.
struct Task {
    name: &'static str,
    done: u64,
    total: u64,
    bar: Option<ProgressBar>,
}

/// Those that are going on, a part of another after it.
type Tasks = Mutex<Vec<Task>>;

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
fn line(since: Duration, running: &[Task]) -> String {
    let share = |task: &Task| 100.0 * task.done.min(task.total) as f64 / task.total as f64;
    let tasks: Vec<String> = running
        .iter()
        .map(|task| {
            if task.total == 0 {
                task.name.to_owned()
            } else {
                format!("{} {:.0} %", task.name, share(task).floor())
            }
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
        let bar = (self.style == Style::Bars && total > 0).then(|| self.bar(task, total));
        let mut running = self.running.lock().unwrap_or_else(PoisonError::into_inner);
        running.push(Task { name: task, done: 0, total, bar });
    }

    fn advance(&self, task: &'static str, units: u64) {
        if self.style == Style::Silent {
            return;
        }
        let mut running = self.running.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some(task) = running.iter_mut().rev().find(|running| running.name == task) {
            task.done = task.done.saturating_add(units);
            if let Some(bar) = &task.bar {
                bar.inc(units);
            }
        }
    }

    fn end(&self, task: &'static str) {
        let mut running = self.running.lock().unwrap_or_else(PoisonError::into_inner);
        let ended = running.iter().rposition(|running| running.name == task).map(|at| running.remove(at));
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
        let task = |name, done, total| Task { name, done, total, bar: None };
        let running = [task("segment", 3, 0), task("sweeps", 21, 50)];
        assert_eq!(line(Duration::from_secs(61), &running), "ivd: working for 61 s: segment, sweeps 42 %");
        assert_eq!(line(Duration::from_secs(30), &[]), "ivd: working for 30 s");
    }

    #[test]
    fn a_task_within_one_of_its_name_ends_first() {
        let progress = Progress::new(Style::Silent, false);
        let progress = Progress { style: Style::Lines, ..progress };
        progress.begin("map", 0);
        progress.begin("map", 4);
        progress.advance("map", 3);
        assert_eq!(
            line(Duration::ZERO, &progress.running.lock().unwrap()),
            "ivd: working for 0 s: map, map 75 %"
        );
        progress.end("map");
        assert_eq!(line(Duration::ZERO, &progress.running.lock().unwrap()), "ivd: working for 0 s: map");
        progress.end("map");
        assert!(progress.running.lock().unwrap().is_empty());
    }

    #[test]
    fn lines_come_while_work_goes_on_and_end_with_it() {
        let (told, heard) = std::sync::mpsc::channel();
        let running = Arc::new(Tasks::default());
        running.lock().unwrap().push(Task { name: "map", done: 1, total: 4, bar: None });
        tell_every(Duration::from_millis(20), Arc::downgrade(&running), move |line| {
            let _ = told.send(line.to_owned());
        });
        for _ in 0..3 {
            let line = heard.recv().unwrap();
            assert!(line.starts_with("ivd: working for ") && line.ends_with(" s: map 25 %"), "{line}");
        }
        drop(running);
        // The sender goes with the thread.
        while heard.recv().is_ok() {}
    }
}
