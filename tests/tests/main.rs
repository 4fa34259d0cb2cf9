//! The one test program of this crate.

mod budgets;
mod invariants;
mod one_part;
mod outside_reach;
mod reading;
mod skipping;
mod skips_off;
mod stability;
