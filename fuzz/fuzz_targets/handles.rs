//! Handles, fixed places, overrides and choices as a command line gives them.
#![no_main]

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| ivd_fuzz::text::handles(bytes));
