use std::hint::black_box;
use std::time::Instant;

use cpu_time::ProcessTime;

/// Runs that count; one before them warms up.
const REPEATS: usize = 10;

/// The names that are asked for; none is all.
pub(super) struct Kernels<'a>(&'a [String]);

impl<'a> Kernels<'a> {
    /// Those whose names begin with one of these words.
    pub(super) fn asked(words: &'a [String]) -> Self {
        Self(words)
    }

    fn wants(&self, kernel: &str) -> bool {
        self.0.is_empty() || self.0.iter().any(|name| kernel.starts_with(name.as_str()))
    }

    /// Whether a kernel of the group may be asked for: else its input need not be made.
    pub(super) fn wants_of(&self, group: &str) -> bool {
        self.wants(group) || self.0.iter().any(|name| name.starts_with(group))
    }

    /// Times a piece of work.
    pub(super) fn time<R>(&self, name: &str, mut work: impl FnMut() -> R) {
        self.time_prepared(name, || (), |()| work());
    }

    /// Times a piece of work on something that is made anew, untimed, for each run.
    pub(super) fn time_prepared<T, R>(
        &self,
        name: &str,
        mut make: impl FnMut() -> T,
        mut work: impl FnMut(T) -> R,
    ) {
        if !self.wants(name) {
            return;
        }
        drop(black_box(work(make())));
        let mut times = [Vec::new(), Vec::new()];
        for _ in 0..REPEATS {
            let given = make();
            let (wall, processor) = (Instant::now(), ProcessTime::now());
            let result = black_box(work(given));
            times[0].push(processor.elapsed().as_secs_f64() * 1e3);
            times[1].push(wall.elapsed().as_secs_f64() * 1e3);
            drop(result);
        }
        for of in &mut times {
            of.sort_by(f64::total_cmp);
        }
        let [processor, wall] = times.map(|of| [of[REPEATS / 2], of[0]]);
        println!(
            "{name:48} processor {:9.3} ms (least {:9.3}), wall {:9.3} ms (least {:9.3})",
            processor[0], processor[1], wall[0], wall[1]
        );
    }
}
