//! Times of single kernels on generated input: processor and wall time, the middle and the least of the repeats.
//!
//! `measure kernels [NAME …]`: those whose name begins so (`warp`, `"warp map"`), all where no name is given.

mod dvr;
mod extract;
mod kmvs;
mod refine;
pub(crate) mod springs;
mod timing;
mod warp;

use crate::anything::Anything;
use timing::Kernels;

pub(crate) const USAGE: &str = "[NAME …]";

/// Times the kernels of a group.
type Group = fn(&Kernels<'_>) -> Anything<()>;

pub(crate) fn run(words: &[String]) -> Anything<()> {
    let kernels = Kernels::asked(words);
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
