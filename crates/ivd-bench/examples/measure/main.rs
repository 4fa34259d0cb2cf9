//! Programs that only measure: one stage or kernel at a time, in memory, for comparisons with other programs and for profiles.
//!
//! `cargo run --release -p ivd-bench --example measure -- PROGRAM …`; without a program it lists them, and the head of each one's source
//! says what it takes. What they print is for scripts (`tests/peers`, `tests/interop`) or for one who looks.

mod anything;
mod drag;
mod frames;
mod kernels;
mod kmvs_spatial;
mod meshes;
mod method;
mod mixture;
mod msvs;
mod msvs_kmvs;
mod raw;
mod springs;
mod stages;
mod surface;
mod tree;
mod warp;

use anything::Anything;

/// What is run with the words after the name.
type Program = fn(&[String]) -> Anything<()>;

/// Name, how it is called, and what runs.
const PROGRAMS: [(&str, &str, Program); 14] = [
    ("drag", drag::USAGE, drag::run),
    ("frames", frames::USAGE, frames::run),
    ("kernels", kernels::USAGE, kernels::run),
    ("kmvs-spatial", kmvs_spatial::USAGE, kmvs_spatial::run),
    ("meshes", meshes::USAGE, meshes::run),
    ("method", method::USAGE, method::run),
    ("mixture", mixture::USAGE, mixture::run),
    ("msvs", msvs::USAGE, msvs::run),
    ("msvs-kmvs", msvs_kmvs::USAGE, msvs_kmvs::run),
    ("springs", springs::USAGE, springs::run),
    ("stages", stages::USAGE, stages::run),
    ("surface", surface::USAGE, surface::run),
    ("tree", tree::USAGE, tree::run),
    ("warp", warp::USAGE, warp::run),
];

fn main() -> Anything<()> {
    let words: Vec<String> = std::env::args().skip(1).collect();
    let asked = words.split_first().and_then(|(name, rest)| {
        PROGRAMS.iter().find(|(known, ..)| known == name).map(|(.., run)| (run, rest))
    });
    let Some((run, rest)) = asked else {
        let calls: Vec<String> =
            PROGRAMS.iter().map(|(name, usage, _)| format!("  measure {name} {usage}")).collect();
        return Err(format!("one of these is expected:\n{}", calls.join("\n")).into());
    };
    run(rest)
}
