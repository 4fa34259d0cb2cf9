//! Times of single kernels on generated input: processor and wall time, the middle and the least of the repeats.
//!
//! `measure kernels [NAME …]`: those whose name begins so (`warp`, `"warp map"`), all where no name is given.

mod dvr;
mod extract;
mod kmvs;
mod refine;
pub(crate) mod springs;
mod warp;

use std::hint::black_box;
use std::time::Instant;

use cpu_time::ProcessTime;

use crate::Anything;

pub(crate) const USAGE: &str = "[NAME …]";

/// Runs that count; one before them warms up.
const REPEATS: usize = 10;

/// Times the kernels of a group.
type Group = fn(&Kernels<'_>) -> Anything<()>;

/// The names that are asked for; none is all.
struct Kernels<'a>(&'a [String]);

impl Kernels<'_> {
    fn wants(&self, kernel: &str) -> bool {
        self.0.is_empty() || self.0.iter().any(|name| kernel.starts_with(name.as_str()))
    }

    /// Whether a kernel of the group may be asked for: else its input need not be made.
    fn wants_of(&self, group: &str) -> bool {
        self.wants(group) || self.0.iter().any(|name| name.starts_with(group))
    }

    /// Times a piece of work.
    fn time<R>(&self, name: &str, mut work: impl FnMut() -> R) {
        self.time_prepared(name, || (), |()| work());
    }

    /// Times a piece of work on something that is made anew, untimed, for each run.
    fn time_prepared<T, R>(&self, name: &str, mut make: impl FnMut() -> T, mut work: impl FnMut(T) -> R) {
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

pub(crate) fn run(words: &[String]) -> Anything<()> {
    let kernels = Kernels(words);
    let groups: [(&str, Group); 6] = [
        ("kmvs", kmvs::run),
        ("extract", extract::run),
        ("refine", refine::run),
        ("springs", springs::run),
        ("warp", warp::run),
        ("dvr", dvr::run),
    ];
    for (name, group) in groups {
        if kernels.wants_of(name) {
            group(&kernels)?;
        }
    }
    Ok(())
}
