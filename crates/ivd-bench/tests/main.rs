//! The harness, what it measures on given volumes, and the recorded fronts.

mod fronts;
mod given;
mod harness;
mod refinements;
