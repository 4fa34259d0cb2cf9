//! The one test program of this crate.

mod suite;
