//! Scene files.
#![no_main]

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| ivd_fuzz::text::scene(bytes));
