//! The one test program of this crate.

mod real_volumes;
