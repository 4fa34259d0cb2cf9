//! The one test program of this crate.

mod budgets;
mod invariants;
mod outside_reach;
mod reading;
mod skipping;
mod skips_off;
mod stability;
