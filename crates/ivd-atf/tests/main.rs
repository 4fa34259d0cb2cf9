//! The one test program of this crate.

mod gradient;
mod transfer;
