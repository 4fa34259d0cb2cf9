//! Run time against error, for every stage that has an accuracy knob.
//!
//! A stage registers an [`Experiment`]: its knobs at several values ([`Setting`]s), what the truth is, and how far a result is from it, with a unit.
//! [`run`] sweeps the settings in turn, several times over, so that a machine that slows down slows all of them, and gives a [`Bench`]: wall and
//! processor time (median and spread), peak memory, counters and error of every point, and which points no other beats in both processor
//! time and error (the Pareto front).
//!
//! [`fronts`] and [`rates`] record what a bench found, for the checks of the defaults and for budgets. [`compare`] holds a bench against an older one of the same machine; [`page`] and [`table`] show it.
//!
//! ```
//! use ivd_bench::{Options, run};
//! use ivd_core::Exec;
//!
//! let options = Options { size: 16, repeats: 1, stages: vec!["segment".to_owned()], ..Options::default() };
//! let bench = run(&options, &Exec::default()).unwrap();
//! let segment = &bench.stages[0];
//! assert_eq!((segment.stage.as_str(), segment.unit.as_str()), ("segment", "grey value"));
//! assert!(segment.points.iter().any(|point| point.default));
//! ```
//!
//! [`refinements`] holds the methods of refinement side by side, with pictures.
//!
//! [`interactive`] drags a handle, frame by frame, and through the frame service, picture by picture.
//!
//! [`scenes`] does the same for whole scenes: what they skip, and how they grow with the volume.
//!
//! Stages without an accuracy knob aren't here: `boundary` and `octree` are exact, and the octree's leaf size changes no answer.
#![forbid(unsafe_code)]

mod compare;
mod distance;
mod error;
mod experiment;
mod front;
mod inputs;
mod interactive;
mod page;
mod plate;
mod plot;
mod rates;
mod record;
mod refinements;
mod scenes;
mod stages;
mod sweep;
mod table;

pub use compare::{Change, Comparison, compare};
pub use error::Error;
pub use experiment::{Experiment, Knobs, Problem, Score, Scored, Setting, Work};
pub use front::fronts;
pub use interactive::{
    Drag, FrameBench, FrameCost, InteractiveBench, followed, interactive, interactive_page,
};
pub use page::page;
pub use rates::rates;
pub use record::{Bench, Point, StageBench};
pub use refinements::{
    Claim, LatticeBench, Reach, RefinementBench, RefinementRow, Shape, refinements, refinements_page,
};
pub use scenes::{ScalePoint, SceneBench, SkipRow, scaling, scenes, scenes_page, skipping};
pub use stages::{Given, NAMES, ON_REQUEST, experiments, given};
pub use sweep::{Options, Plant, run, sweep};
pub use table::table;
