//! Progress bars on stderr, and notes.

use std::collections::BTreeMap;
use std::sync::{Mutex, PoisonError};
use std::time::Duration;

use indicatif::{MultiProgress, ProgressBar, ProgressStyle};
use ivd_core::{Iteration, Observer};

use crate::talk;

/// What a bar looks like.
const TEMPLATE: &str = "{msg:12} {bar:32} {percent:>3} % {elapsed}";

/// Shows what the stages tell.
pub(crate) struct Bars {
    all: MultiProgress,
    running: Mutex<BTreeMap<&'static str, ProgressBar>>,
    /// Whether bars are drawn.
    draw: bool,
    /// Whether notes are shown.
    notes: bool,
}

impl Bars {
    /// Bars that are drawn or not; notes likewise.
    pub(crate) fn new(draw: bool, notes: bool) -> Self {
        Self { all: MultiProgress::new(), running: Mutex::default(), draw, notes }
    }

    fn with(&self, task: &'static str, act: impl FnOnce(&ProgressBar)) {
        if let Some(bar) = self.running.lock().unwrap_or_else(PoisonError::into_inner).get(task) {
            act(bar);
        }
    }
}

impl Observer for Bars {
    fn begin(&self, task: &'static str, total: u64) {
        if !self.draw {
            return;
        }
        let style = ProgressStyle::with_template(TEMPLATE).unwrap_or_else(|_| ProgressStyle::default_bar());
        let bar = self.all.add(ProgressBar::new(total).with_style(style).with_message(task));
        bar.enable_steady_tick(Duration::from_millis(120));
        self.running.lock().unwrap_or_else(PoisonError::into_inner).insert(task, bar);
    }

    fn advance(&self, task: &'static str, units: u64) {
        if self.draw {
            self.with(task, |bar| bar.inc(units));
        }
    }

    fn end(&self, task: &'static str) {
        if self.draw {
            let bar = self.running.lock().unwrap_or_else(PoisonError::into_inner).remove(task);
            if let Some(bar) = bar {
                bar.finish_and_clear();
            }
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
}
