//! Lattices of any shape, and any handles on them.
#![no_main]

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| ivd_fuzz::lattices::check(bytes));
