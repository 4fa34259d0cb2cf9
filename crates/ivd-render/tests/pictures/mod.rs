//! Pictures against closed forms, against each other, and against what must not change.
#![allow(clippy::unwrap_used, reason = "tests fail by panicking")]

mod analytic;
mod classes;
mod clipped;
mod common;
mod comparator;
mod deformed;
mod identical;
mod moved;
mod picks;
mod preintegrated;
mod projections;
mod shells;
mod stacks;
mod surface;
mod surroundings;
mod views;
