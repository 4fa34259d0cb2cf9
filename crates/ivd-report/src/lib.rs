//! Reports as self-contained pages: pictures, charts, tables and slices of the values and numbers that they are given.
//!
//! Nothing here knows a stage or a record. Whoever has something to report chooses what a [`Page`] shows, in which order and under
//! which titles; this crate draws it.
//!
//! ```
//! use ivd_report::{Page, pairs, shown};
//!
//! let mut page = Page::new("head");
//! page.section("Volume", &pairs(&[("voxels along x, y, z", shown([64, 64, 64]))]));
//! assert!(page.finish().contains("<td>64, 64, 64</td>"));
//! ```
#![forbid(unsafe_code)]
#![cfg_attr(not(test), deny(clippy::expect_used, clippy::unwrap_used, clippy::panic))]
#![cfg_attr(not(test), deny(clippy::unreachable, clippy::wildcard_enum_match_arm))]

mod chart;
mod curve;
pub mod html;
mod page;
mod planes;
mod slices;
mod tables;
mod tree;
mod values;

pub use chart::{Bars, Line, bars, histogram};
pub use curve::{Curve, curve};
pub use page::{Page, Pictures, body_or_problem};
pub use planes::{Plane, planes};
pub use slices::{MovedSlices, Outlines, ResultSlices, class_slices, slices};
pub use tables::{Cell, Figure, MOST_ROWS, figures, pairs, shortened_table, shown, table};
pub use tree::{Dendrogram, Leaf, dendrogram};
pub use values::{ClassDensity, value_histogram};
