//! The one test program of this crate.

mod common;
mod drag;
mod parts;
