//! The one test program of this crate.

mod component;
mod surface;
