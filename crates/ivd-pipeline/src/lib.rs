//! Scenes, stages, what must run and why, the cache's decisions, and reports.
//!
//! A [`scene`] says what is wanted. [`plan`] finds what its outputs need and no more; [`run`] walks that graph, takes
//! from the cache what verifies, does the rest through the [`stages`] (thin adapters of the [`Stage`] trait over the
//! stage crates) and writes the outputs. A stage that ran again to the same content stops the chain, since keys are
//! made of content hashes.
//!
//! ```
//! use ivd_artefact::Cache;
//! use ivd_core::Exec;
//! use ivd_pipeline::{PipelineOptions, State, run, scene};
//!
//! let text = r#"
//! schema = 1
//! [input]
//! phantom = "sphere"
//! size = 24
//! [lattice]
//! iso = 127.5
//! [output]
//! lattice = "lattice.ply"
//! "#;
//! let folder = tempfile::tempdir().unwrap();
//! let file = folder.path().join("scene.toml");
//! std::fs::write(&file, text).unwrap();
//! let options = PipelineOptions { out: folder.path().join("out"), ..Default::default() };
//! let report = run(&scene::load(&file, &[]).unwrap(), &options, &Cache::disabled(), &Exec::default()).unwrap();
//! let segment = report.stages.iter().find(|s| s.stage == "segment").unwrap();
//! assert_eq!(segment.state, State::NotNeeded, "an isovalue needs no classes");
//! assert!(folder.path().join("out/lattice.ply").is_file());
//! ```
#![forbid(unsafe_code)]
#![cfg_attr(not(test), deny(clippy::expect_used, clippy::unwrap_used, clippy::panic))]
#![cfg_attr(not(test), deny(clippy::unreachable, clippy::wildcard_enum_match_arm))]

mod clashes;
mod compare;
mod control;
mod describe;
mod distribution;
mod error;
mod export;
mod frame_file;
mod frames;
mod left_over;
pub mod list;
mod need;
mod node;
mod options;
mod outputs;
pub mod params;
mod pictures;
mod pipeline;
pub mod plan;
mod report;
pub mod resource;
mod runner;
pub mod scene;
mod section;
mod series;
mod stage;
pub mod stages;

pub use compare::compare;
pub use control::{Control, Decisions};
pub use describe::{describe, describe_field, describe_mesh};
pub use error::Error;
pub use export::{
    ExportOptions, FIELD_ENDINGS, check_frame, ending, export, export_with, is_of_another_format,
    labels_volume, mask_volume, write_text,
};
pub use frame_file::frame_file;
pub use frames::map_frame;
pub use ivd_core::op::Slot;
pub use ivd_io::volume::{Offer, OfferedSeries};
pub use left_over::{Before, LeftOver};
pub use node::run_node;
pub use options::PipelineOptions;
pub use outputs::OutputFile;
pub use pictures::{
    ANIMATION_ENDINGS, Depth, PICTURE_ENDINGS, animation_bytes, check_pictures, png_bytes, quick_png_bytes,
};
pub use pipeline::{PipelineReport, default_out, run, run_controlled};
pub use runner::{OutputRecord, Runner, StageRecord, StageResult, State, figures_of};
pub use section::Section;
pub use stage::{Facts, Input, Inputs, Metrics, Stage, StageOutput};
