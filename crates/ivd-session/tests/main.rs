//! The one test program of this crate.
#![allow(clippy::unwrap_used, reason = "a test ends where something is missing")]

mod common;
mod drag;
mod parts;
