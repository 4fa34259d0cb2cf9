//! The one test program of this crate.

mod anatomies;
mod real_volumes;
